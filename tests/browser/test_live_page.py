"""The experimenter's page of one session, in a real browser beside a driving participant."""

from __future__ import annotations

import asyncio
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import httpx
import pytest
from playwright.sync_api import expect

from tests.support.data_places import locked
from tests.support.lab_server import LabServer
from tests.support.wire_client import events, invite, read, visit

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Locator, Page

WITHIN_MS = 20_000


def part(page: Page, testid: str) -> Locator:
    return page.get_by_test_id(testid)


@contextmanager
def driving(link: str, ticks: int) -> Iterator[None]:
    """A participant who drove `ticks` ticks to the left and keeps the page open."""
    driven, enough = threading.Event(), threading.Event()

    async def drive() -> None:
        async with visit(link) as player:
            await player.reach_trial()
            for _ in range(ticks):
                await player.tick((0, 1, 0))
            driven.set()
            await asyncio.to_thread(enough.wait)

    thread = threading.Thread(target=lambda: asyncio.run(drive()), daemon=True)
    thread.start()
    try:
        assert driven.wait(WITHIN_MS / 1000.0), "the participant did not get into the trial"
        yield
    finally:
        enough.set()
        thread.join(WITHIN_MS / 1000.0)


def test_the_dashboard_says_that_the_lab_cannot_save(page: Page, quick_lab: LabServer) -> None:
    invite(quick_lab)
    page.goto(quick_lab.experimenter_link)
    part(page, "sessions").wait_for(timeout=WITHIN_MS)
    notice = part(page, "lab-trouble")
    with locked(quick_lab.data_dir):
        answer = httpx.post(
            f"{quick_lab.base_url}/api/participants", headers=quick_lab.headers, json={}, trust_env=False, timeout=10.0
        )
        assert answer.status_code == 503 and "Another program keeps the database locked" in answer.text
        notice.wait_for(timeout=WITHIN_MS)
        assert "Another program keeps the database locked" in notice.inner_text()
    expect(notice).to_be_hidden(timeout=WITHIN_MS)


def opened(page: Page, lab: LabServer, participant: str) -> None:
    """The dashboard, then the participant's session, by keyboard."""
    page.goto(lab.experimenter_link)
    link = page.locator(f"[data-participant={participant}]").get_by_test_id("open")
    link.wait_for(timeout=WITHIN_MS)
    link.focus()
    page.keyboard.press("Enter")
    part(page, "page-session").wait_for(timeout=WITHIN_MS)


def test_an_opened_session_shows_what_the_robot_believes(page: Page, quick_lab: LabServer) -> None:
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    made = invite(quick_lab, label="<b>seat</b>")
    participant = made["participant"]
    with driving(made["link"], 8):
        opened(page, quick_lab, participant)
        part(page, "heatmap").wait_for(timeout=WITHIN_MS)
        assert page.locator("h1").inner_text() == f"{participant} · <b>seat</b>"
        assert page.evaluate("document.activeElement.tagName") == "H1"
        assert "In a trial" in part(page, "live-state").inner_text()
        numbers = [float(text) for text in part(page, "belief").locator(".number").all_inner_texts()]
        assert len(numbers) == 6 and sum(numbers) == pytest.approx(1.0, abs=0.04)
        assert part(page, "belief").locator(".instructed:visible").count() == 1
        for chart, lines in (("chart-entropy", 1), ("chart-scores", 3)):
            paths = part(page, chart).locator("path.line")
            assert paths.count() == lines
            assert all((paths.nth(index).get_attribute("d") or "").startswith("M") for index in range(lines))
        assert re.search(r"from \d\.\d+ to \d\.\d+, highest", part(page, "heatmap").get_attribute("aria-label") or "")
        part(page, "heatmap-information").focus()
        page.keyboard.press("ArrowRight")
        expect(part(page, "heatmap")).to_have_attribute("aria-label", re.compile("^B"), timeout=WITHIN_MS)
        part(page, "back").click()
        part(page, "page-dashboard").wait_for()
        assert page.evaluate("document.activeElement.textContent").startswith(participant)
    assert problems == []


def test_a_task_is_marked_and_what_cannot_be_done_says_why(page: Page, quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    with driving(made["link"], 2):
        opened(page, quick_lab, participant)
        part(page, "belief").locator("tbody tr").first.wait_for(timeout=WITHIN_MS)
        part(page, "task_marked").click()
        page.get_by_role("textbox", name="What is special about it").fill("<i>slipped</i>")
        part(page, "dialog-confirm").click()
        listed = part(page, "events").get_by_text("task marked").first
        listed.wait_for(timeout=WITHIN_MS)
        assert "<i>slipped</i>" in part(page, "events").inner_text()
        refused = part(page, "resume")
        assert refused.get_attribute("aria-disabled") == "true"
        part(page, "why-not").locator("summary").click()
        assert "Resume: The session is not paused." in part(page, "why-not").inner_text()
        refused.focus()
        page.keyboard.press("Enter")
        part(page, "toast").get_by_text("The session is not paused.").wait_for()
        assert page.locator("dialog").count() == 0
    assert [data["text"] for _, data in read(quick_lab, participant, "task_marked")] == ["<i>slipped</i>"]


def test_a_message_stays_on_the_participants_page_until_it_is_put_away(
    page: Page, context: BrowserContext, quick_lab: LabServer
) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    theirs = context.new_page()
    theirs.goto(made["link"])
    theirs.get_by_role("heading", level=1).wait_for(timeout=WITHIN_MS)
    opened(page, quick_lab, participant)
    expect(part(page, "message")).to_have_attribute("aria-disabled", "false", timeout=WITHIN_MS)
    part(page, "message").click()
    page.get_by_role("textbox", name="Message").fill("Please <b>wait</b>.")
    part(page, "dialog-confirm").click()
    toast = theirs.get_by_text("From the experimenter: Please <b>wait</b>.")
    toast.wait_for(timeout=WITHIN_MS)
    theirs.get_by_role("button", name="Dismiss this message").click()
    toast.wait_for(state="detached")
    part(page, "events").get_by_text("message dismissed").wait_for(timeout=WITHIN_MS)
    assert [kind for kind, _ in events(quick_lab, participant, "message", "page.message_dismissed")] == [
        "message",
        "page.message_dismissed",
    ]


def test_a_button_that_came_too_late_is_told_why(page: Page, quick_lab: LabServer) -> None:
    """By keyboard alone: two experimenters pause the same session."""
    participant = invite(quick_lab)["participant"]
    opened(page, quick_lab, participant)
    part(page, "initials").fill("AB")
    pause = part(page, "pause")
    expect(pause).to_have_attribute("aria-disabled", "false", timeout=WITHIN_MS)
    pause.focus()
    page.keyboard.press("Enter")
    page.keyboard.type("coffee")
    other = httpx.post(
        f"{quick_lab.base_url}/api/sessions/{participant}/pause",
        headers={**quick_lab.headers, "Salab-Who": "CD"},
        json={},
        trust_env=False,
    )
    assert other.status_code == 200
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    part(page, "toast-problem").get_by_text("nothing was done. An experimenter has paused it already.").wait_for()
    assert page.evaluate("document.activeElement.dataset.testid") == "pause"
    expect(pause).to_have_attribute("aria-disabled", "true")
    resume = part(page, "resume")
    expect(resume).to_have_attribute("aria-disabled", "false")
    resume.focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    part(page, "toast").get_by_text("resumed.").wait_for()
    told = events(quick_lab, participant, "experimenter_pause", "experimenter_resume")
    assert [(kind, data["by"]) for kind, data in told] == [("experimenter_pause", "CD"), ("experimenter_resume", "AB")]
