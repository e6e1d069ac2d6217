"""The way out on the participant's page: asked twice, never by a key held for driving, and told when time runs out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import CONTENT, instruction, tick
from tests.support.participant_page import driving

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


@pytest.fixture(scope="module")
def one() -> Iterator[FakeLab]:
    with FakeLab() as lab:
        yield lab


@pytest.fixture
def lab(page: Page, one: FakeLab) -> FakeLab:
    """In a round that runs; a page of its own each time."""
    driving(page, one)
    return one


def test_the_arm_is_freed_by_two_presses_that_are_meant(page: Page, lab: FakeLab) -> None:
    mark = lab.mark()
    page.keyboard.down("KeyW")
    page.get_by_test_id("free-button").click()
    page.get_by_test_id("free-dialog").wait_for()
    page.keyboard.press("Enter")  # the harmless answer has the focus
    page.get_by_test_id("free-dialog").wait_for(state="detached")
    assert lab.submits("free_arm") == []
    last = lab.inputs(after=mark)[-1]
    assert last["direction"] is None, "the question takes the hands off"
    page.get_by_test_id("free-button").click()
    page.get_by_test_id("dialog-confirm").click()
    assert lab.wait_submit("free_arm", after=mark)["data"] == {}
    page.get_by_test_id("free-said").wait_for(state="visible")
    lab.send(tick(1, status="resetting", instruction=instruction("reset", "spray_bottle"), notice="The arm is free."))
    page.get_by_test_id("free-said").wait_for(state="hidden")
    assert page.get_by_test_id("free-button").is_disabled()
    assert page.get_by_test_id("notice").inner_text() == "The arm is free."
    lab.send(tick(2))
    page.locator("[data-testid=free-button]:enabled").wait_for()


def test_it_is_reached_by_keyboard_and_driving_keys_never_press_it(page: Page, lab: FakeLab) -> None:
    button = page.get_by_test_id("free-button")
    for key in ("KeyW", "KeyA", "Space", "Enter", "KeyQ"):
        page.keyboard.press(key)
    assert page.get_by_test_id("free-dialog").count() == 0
    for _ in range(40):
        page.keyboard.press("Tab")
        if button.evaluate("element => element === document.activeElement"):
            break
    page.keyboard.press("Enter")
    page.get_by_test_id("free-dialog").wait_for()
    page.keyboard.press("Escape")
    page.get_by_test_id("free-dialog").wait_for(state="detached")
    assert page.evaluate("() => document.activeElement?.className") == "drive-scene"


def test_it_is_offered_in_a_pause_too(page: Page, lab: FakeLab) -> None:
    lab.show("paused", 1)
    page.get_by_test_id("page-paused").wait_for()
    mark = lab.mark()
    page.get_by_test_id("free-button").click()
    page.get_by_test_id("dialog-confirm").click()
    lab.wait_submit("free_arm", after=mark)
    page.get_by_test_id("free-said").wait_for(state="visible")
    assert "as soon as" in page.get_by_test_id("free-said").inner_text()


def test_before_a_start_there_is_nothing_to_free_in_a_pause(
    page: Page, lab: FakeLab, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(lab.content, "paused", {**CONTENT["paused"], "can_free": False})
    lab.show("trial_ready", 1)
    page.get_by_test_id("page-trial_ready").wait_for()
    lab.show("paused", 1)
    page.get_by_test_id("page-paused").wait_for()
    assert page.get_by_test_id("free-button").is_disabled()


@pytest.mark.parametrize("after", ["survey", "trial_ready"])
def test_a_round_that_ends_meanwhile_takes_its_question_along(page: Page, lab: FakeLab, after: str) -> None:
    page.get_by_test_id("free-button").click()
    page.get_by_test_id("free-dialog").wait_for()
    lab.show(after)
    page.get_by_test_id(f"page-{after}").wait_for()
    page.get_by_test_id("free-dialog").wait_for(state="detached")
    mark = lab.mark()
    page.keyboard.press("KeyW")
    lab.wait_for(lambda message: message["type"] == "heartbeat", after=mark)
    assert lab.inputs(after=mark) == [], "nobody drives any more"
    assert not [one for one in lab.received[mark:] if one["type"] == "submit"]


def test_an_arm_that_goes_back_by_itself_takes_the_question_along(page: Page, lab: FakeLab) -> None:
    page.get_by_test_id("free-button").click()
    page.get_by_test_id("free-dialog").wait_for()
    lab.send(tick(1, status="resetting", instruction=instruction("reset", "spray_bottle")))
    page.get_by_test_id("free-dialog").wait_for(state="detached")


def test_a_limit_that_is_near_is_told_in_calm_words(page: Page, lab: FakeLab) -> None:
    words = page.get_by_test_id("time-words")
    assert words.is_hidden()
    lab.send(tick(1, ending="task"))
    words.wait_for(state="visible")
    assert "object is nearly over" in words.inner_text()
    lab.send(tick(2, ending="trial"))
    page.get_by_text("The time for this round is nearly over").wait_for()
    lab.send(tick(3))
    words.wait_for(state="hidden")


def test_the_instructions_tell_the_way_out_and_the_time_there_is(
    page: Page, one: FakeLab, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(
        one.content, "instructions", {**CONTENT["instructions"], "limits": {"task_s": 300, "trial_s": 90}}
    )
    one.state = "instructions"
    page.goto(one.participant_url)
    page.get_by_test_id("page-instructions").wait_for()
    text = page.get_by_test_id("page-instructions").inner_text()
    assert "press “Free the arm” beside the picture" in text
    assert "5 minutes to pick an object up" in text
    assert "takes 90 seconds at most" in text
