"""The roster as an experimenter uses it, in a real browser against a running lab."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
import pytest

from study.definition.study import load_study
from study.store import Batch, open_store
from tests.support.lab_server import LabServer
from tests.support.study_samples import UTC, answer_row, trial_row
from tests.support.wire_client import invite, write_study
from tests.web.test_roster_api import make_done

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

pytestmark = pytest.mark.usefixtures("no_script_errors")

SCRIPT = "<script>window.broken = 1</script><img src=x onerror='window.broken = 2'>"


@pytest.fixture
def lab(tmp_path: Path, start_lab: Callable[..., LabServer]) -> LabServer:
    return start_lab("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", str(write_study(tmp_path)))


def opened(page: Page, lab: LabServer) -> Locator:
    page.goto(lab.experimenter_link)
    roster = page.get_by_test_id("roster")
    roster.get_by_test_id("order-grid").wait_for()
    return roster


def line(page: Page, participant: str) -> Locator:
    return page.locator(f"[data-testid=roster-row][data-participant={participant}]")


def told(page: Page, text: str) -> None:
    page.get_by_test_id("toast").get_by_text(text).wait_for()


def test_links_are_made_shown_as_qr_codes_and_fill_the_grid(page: Page, lab: LabServer, screenshot_dir: Path) -> None:
    roster = opened(page, lab)
    first = roster.locator("[data-testid=order-row][data-next=true]").locator("th").inner_text()
    page.get_by_test_id("create-count").fill("8")
    page.get_by_test_id("create-label").fill(SCRIPT)
    page.get_by_test_id("create-participant").click()
    line(page, "P008").wait_for()
    chips = page.locator(".chip[data-participant=P001]")
    assert first == roster.locator("[data-testid=order-row]", has=chips).locator("th").inner_text()
    assert SCRIPT in line(page, "P001").inner_text()
    page.get_by_test_id("create-count").fill("1")
    page.get_by_test_id("create-pilot").click()
    line(page, "T009").get_by_text("a pilot").wait_for()
    page.get_by_test_id("show-qr").first.click()
    assert page.get_by_test_id("qr").evaluate("image => image.decode().then(() => image.naturalWidth > 100)")
    page.screenshot(path=screenshot_dir / "roster-qr.png")
    assert "/p/" in page.get_by_test_id("qr-link").input_value()
    page.get_by_test_id("dialog-back").click()
    line(page, "P008").get_by_test_id("roster-new_link").click()
    page.get_by_test_id("qr").wait_for()
    assert page.get_by_test_id("qr-link").input_value().startswith(f"{lab.base_url}/p/")
    page.get_by_test_id("dialog-back").click()
    assert page.evaluate("window.broken") is None


def test_reject_withdraw_and_erase_ask_first_and_free_the_cell(
    page: Page, lab: LabServer, screenshot_dir: Path
) -> None:
    invite(lab, count=7)
    make_done(lab, "P001")
    roster = opened(page, lab)
    stale = line(page, "P002").get_by_test_id("roster-reject")
    assert stale.get_attribute("aria-disabled") == "true"
    assert "The session is not over" in (stale.get_attribute("title") or "")
    line(page, "P001").get_by_test_id("roster-reject").click()
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_text("Give a reason.").wait_for()
    page.get_by_test_id("reject-dialog").get_by_role("textbox").fill(SCRIPT)
    page.get_by_test_id("dialog-confirm").click()
    told(page, "P001: rejected. The cell is free again.")
    line(page, "P001").locator("[data-column=state]", has_text="rejected").wait_for()
    roster.locator(".chip[data-participant=P001]").wait_for(state="detached")

    line(page, "P002").get_by_test_id("roster-withdraw").click()
    assert page.get_by_test_id("withdraw-keep").is_checked()  # as the consent text says
    page.screenshot(path=screenshot_dir / "roster-withdraw.png")
    page.get_by_test_id("dialog-confirm").click()
    told(page, "P002: withdrawn.")
    roster.locator(".chip[data-participant=P002]").wait_for(state="detached")
    line(page, "P003").get_by_test_id("roster-withdraw").click()
    page.get_by_test_id("withdraw-erase").check()
    page.get_by_test_id("dialog-confirm").click()
    told(page, "P003: withdrawn and erased.")

    line(page, "P002").get_by_test_id("roster-erase").click()
    page.get_by_test_id("erase-dialog").get_by_role("textbox").fill("P003")
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_text("This is not P002.").wait_for()
    page.get_by_test_id("erase-dialog").get_by_role("textbox").fill("P002")
    page.get_by_test_id("dialog-confirm").click()
    told(page, "P002: erased.")
    for gone in ("P002", "P003"):
        line(page, gone).locator("[data-column=state]", has_text="erased").wait_for()
        line(page, gone).get_by_role("button").first.wait_for(state="detached")
    page.get_by_test_id("roster").screenshot(path=screenshot_dir / "roster.png")


def test_what_another_experimenter_did_first_is_said(page: Page, lab: LabServer) -> None:
    who = invite(lab)["participant"]
    opened(page, lab)
    line(page, who).get_by_test_id("roster-withdraw").click()
    place = f"{lab.base_url}/api/participants/{who}/withdraw"
    httpx.post(place, headers=lab.headers, json={}, trust_env=False, timeout=30.0).raise_for_status()
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_test_id("toast-problem").get_by_text("The session is over").wait_for()
    line(page, who).locator("[data-column=state]", has_text="withdrawn").wait_for()


def test_a_thousand_participants_are_turned_through_page_by_page(
    page: Page, tmp_path: Path, start_lab: Callable[..., LabServer]
) -> None:
    path, data = write_study(tmp_path), tmp_path / "data"
    study = load_study(path)
    with open_store(data) as store:
        for number in range(60):
            store.create_participant(study, seed=number, public_id=f"{number:x}", utc=UTC)
    lab = start_lab("--robot", "kinematic", "--no-scene", "--study", str(path), data_dir=data)
    opened(page, lab)
    rows = page.get_by_test_id("roster-row")
    assert (rows.count(), page.get_by_test_id("roster-range").inner_text()) == (25, "1–25 of 60")
    for _ in range(2):
        page.get_by_test_id("roster-older").click()
    page.get_by_text("51–60 of 60").wait_for()
    assert (rows.count(), rows.last.get_attribute("data-participant")) == (10, "P001")
    page.get_by_test_id("roster-search").fill("p033")
    page.get_by_text("1–1 of 1").wait_for()
    # The table of sessions shows those that somebody may have to act on.
    page.get_by_test_id("sessions-left").get_by_text("60 more have not begun or are over.").wait_for()
    sessions = page.get_by_test_id("session-row")
    assert sessions.count() == 0
    page.get_by_test_id("sessions-show").select_option("all")
    assert [sessions.first.get_attribute("data-participant"), sessions.count()] == ["P060", 60]
    page.get_by_test_id("sessions-show").select_option("")
    assert sessions.count() == 0
    page.get_by_test_id("roster-show").select_option("done")
    page.get_by_test_id("roster-range").get_by_text("Nobody").wait_for()


def test_a_verdict_is_shown_and_overridden_with_a_reason(page: Page, lab: LabServer, screenshot_dir: Path) -> None:
    who = invite(lab)["participant"]
    ended = "2026-01-01T00:01:00Z"
    row = trial_row(who, outcome="completed", finished_utc=ended, quality="suspect", hidden_s=9.5, unanswered_alerts=0)
    row = replace(row, quality_broken=json.dumps(["page hidden: 9.5 s, at most 5 allowed"]))
    scales = ("mental_demand", "physical_demand", "temporal_demand", "performance", "effort", "frustration")
    with open_store(lab.data_dir) as store:
        store.commit(Batch(trials=(row,), answers=tuple(answer_row(who, item, "5") for item in scales)))
    # The regular look at the data never comes: what is new is followed.
    page.add_init_script("const set = setInterval; setInterval = (run, ms) => (ms < 10_000 ? set(run, ms) : 0)")
    opened(page, lab)
    shown = page.get_by_test_id("quality-row")
    shown.get_by_text("page hidden: 9.5 s, at most 5 allowed").wait_for()
    assert "1 completed" in page.get_by_test_id("summary").inner_text()
    assert page.get_by_test_id("scores").locator("tbody tr").inner_text().split() == [
        "tlx_raw",
        "balanced",
        "5.00",
        "1",
    ]
    shown.get_by_test_id("override").click()
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_text("Give a reason.").wait_for()
    page.get_by_test_id("override-dialog").get_by_role("textbox").fill(SCRIPT)
    page.get_by_test_id("dialog-confirm").click()
    told(page, f"Trial 1 of {who} counts as good.")
    shown.get_by_text(f"Overridden: {SCRIPT} (automatic: suspect)").wait_for()
    assert page.get_by_test_id("verdicts").inner_text() == "1 good, 0 suspect"
    page.get_by_test_id("results").screenshot(path=screenshot_dir / "results.png")
    with open_store(lab.data_dir) as store:
        store.commit(Batch(trials=(replace(row, trial=2),)))
    invite(lab)
    page.get_by_test_id("summary").get_by_text("2 completed").wait_for()
    assert page.evaluate("window.broken") is None
