"""Phones, narrow windows, 200 % zoom: nothing is cut off, the way on can be reached, the task is in sight."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import CONTENT, alert, letter, tick

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

SIZES = [(390, 844), (320, 640), (640, 360), (1280, 720), (1920, 1080)]
"""A phone; the narrowest that pages must bear; 1280 by 720 at 200 % zoom; and what most people have."""
NARROW = SIZES[:3]

OVERFLOW = """() => {
  const width = document.documentElement.clientWidth;
  const out = [...document.querySelectorAll("body *")].filter((one) => {
    const box = one.getBoundingClientRect();
    return box.width > 1 && one.checkVisibility() && (box.right > width + 1 || box.left < -1);
  });
  const wide = document.documentElement.scrollWidth > width ? ["the document"] : [];
  return [...wide, ...out.map((one) => `${one.tagName} ${one.className} ${one.textContent.slice(0, 30)}`)].slice(0, 5);
}"""
REACHED = """(one) => {
  one.scrollIntoView({ block: "nearest" });
  const box = one.getBoundingClientRect();
  const at = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
  return box.bottom <= innerHeight + 1 && box.top >= -1 && (one === at || one.contains(at));
}"""
PRIMARY = {
    "consent": "consent-agree",
    "demographics": "demographics-submit",
    "setup": "setup-submit",
    "instructions": "instructions-submit",
    "practice_ready": "start-button",
    "trial_ready": "start-button",
    "survey": "survey-submit",
    "break": "continue-button",
    "debrief": "debrief-submit",
    "done": "completion-link",
    "paused": "resume-button",
}


@pytest.fixture(scope="module")
def labs() -> Iterator[tuple[FakeLab, FakeLab]]:
    """One for the participant's page, one with a second device."""
    with FakeLab() as one, FakeLab(placement="second_device", state="trial") as two:
        link = f"{two.base_url}/d/{'x' * 43}"
        two.content["setup"] = {**CONTENT["setup"], "placement": "second_device", "panel_link": link}
        two.content["trial_ready"] = {**CONTENT["trial_ready"], "panel_link": link}
        yield one, two


def reached(button: Locator) -> bool:
    button.wait_for()
    return bool(button.evaluate(REACHED))


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_every_page_fits_and_leads_on(page: Page, labs: tuple[FakeLab, FakeLab], size: tuple[int, int]) -> None:
    lab, two = labs
    page.set_viewport_size({"width": size[0], "height": size[1]})
    lab.state = "consent"
    page.goto(lab.participant_url)
    for state in CONTENT:
        lab.show(state)
        page.get_by_test_id("page-drive" if state in ("practice", "trial") else f"page-{state}").wait_for()
        if state == "setup":
            page.get_by_test_id("device-keyboard").click()
        assert page.evaluate(OVERFLOW) == [], state
        if state in PRIMARY:
            assert reached(page.get_by_test_id(PRIMARY[state])), state
        for button in ("help-button", "stop-button"):
            if page.get_by_test_id(button).is_visible():
                assert reached(page.get_by_test_id(button)), (state, button)
    page.goto(two.participant_url)
    for state in ("setup", "trial_ready"):
        two.show(state)
        page.get_by_test_id(f"page-{state}").wait_for()
        assert page.evaluate(OVERFLOW) == [], state
        assert reached(page.get_by_test_id(PRIMARY[state])), state


@pytest.mark.parametrize("size", NARROW, ids=str)
def test_the_task_is_in_sight_beside_the_picture(
    page: Page, labs: tuple[FakeLab, FakeLab], size: tuple[int, int]
) -> None:
    lab, _ = labs
    page.set_viewport_size({"width": size[0], "height": size[1]})
    lab.state = "trial"
    page.goto(lab.participant_url)
    lab.send(tick(0))
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()
    task, scene = (page.get_by_test_id(name).bounding_box() for name in ("instruction", "scene"))
    assert task and scene
    assert task["y"] >= 0 and task["y"] + task["height"] <= size[1], "the task is below the fold"
    seen = min(size[1], scene["y"] + scene["height"]) - scene["y"]
    assert seen >= 0.4 * size[1], "of the picture too little is to be seen with it"
    lab.send(alert(1, "582.4"))
    page.get_by_test_id("alert").wait_for()
    assert page.evaluate(OVERFLOW) == []
    for part in ("reading", "input", "submit", "countdown", "rest"):
        box = page.get_by_test_id(f"alert-{part}").bounding_box()
        assert box and box["y"] >= 0 and box["y"] + box["height"] <= size[1], f"{part} is below the fold"
    assert reached(page.get_by_test_id("alert-reading"))
    assert reached(page.get_by_test_id("alert-submit"))


@pytest.mark.parametrize("size", NARROW, ids=str)
def test_a_round_begins_with_the_task_in_sight_wherever_start_was(
    page: Page, labs: tuple[FakeLab, FakeLab], size: tuple[int, int]
) -> None:
    lab, _ = labs
    page.set_viewport_size({"width": size[0], "height": size[1]})
    lab.state = "trial_ready"
    page.goto(lab.participant_url)
    page.get_by_test_id("start-button").wait_for()
    page.evaluate("for (const one of document.querySelectorAll('html, .drive-scene')) one.scrollTop = 10_000")
    page.get_by_test_id("start-button").click()
    lab.wait_submit("start")
    lab.send(tick(0))
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()
    task = page.get_by_test_id("instruction").bounding_box()
    assert task and task["y"] >= 0 and task["y"] + task["height"] <= size[1]
    assert page.locator(".drive-scene").evaluate("(one) => one.scrollTop") == 0


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("value", ["582.4", "88888888.88"])
def test_the_second_device_shows_its_whole_value_and_its_button(
    page: Page, labs: tuple[FakeLab, FakeLab], size: tuple[int, int], value: str
) -> None:
    _, two = labs
    two.state = "trial"
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.goto(two.panel_url)
    assert reached(page.get_by_test_id("panel-start"))
    page.get_by_test_id("panel-start").click()
    assert reached(page.get_by_test_id("panel-heard"))
    assert page.evaluate(OVERFLOW) == []
    two.send(alert(1, value), "panel")
    reading = page.get_by_test_id("alert-reading")
    reading.wait_for()
    assert page.evaluate(OVERFLOW) == []
    assert reading.evaluate("(one) => one.scrollWidth <= one.clientWidth"), "the value is cut off"
    assert reached(page.get_by_test_id("alert-submit"))
    two.send(letter(2), "panel")
    assert reached(page.get_by_test_id("alert-choice-different"))
    assert page.evaluate(OVERFLOW) == []
