"""Another kind of distractor than readings: letters, answered by a key or a button."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import letter
from tests.support.participant_page import driving, opened, visible

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


LETTERS = {"one": "letter", "many": "letters"}


@pytest.fixture
def letters_lab() -> Iterator[FakeLab]:
    with FakeLab(stimuli=LETTERS) as running:
        yield running


@pytest.fixture
def letters_panel() -> Iterator[FakeLab]:
    with FakeLab(placement="second_device", state="trial", stimuli=LETTERS) as running:
        yield running


def closed(number: int, status: str = "answered", release_in_s: float = 0.0) -> dict[str, Any]:
    return {"type": "alert_closed", "alert": number, "status": status, "release_in_s": release_in_s}


def answers(lab: FakeLab) -> list[dict[str, Any]]:
    return [message["data"] for message in lab.received if message.get("step") == "alert_answer"]


def test_a_letter_is_answered_by_its_key_and_not_by_one_that_is_held(
    page: Page, letters_lab: FakeLab, screenshot_dir: Path
) -> None:
    lab = letters_lab
    driving(page, lab)
    page.keyboard.down("KeyW")
    page.keyboard.down("Digit1")  # held since before the letter comes: no answer
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0])
    mark = lab.mark()
    lab.send(letter(1, "K"))
    visible(page, "alert")
    lab.wait_for(lambda message: message["type"] == "input" and message["direction"] is None, after=mark)
    page.keyboard.down("Digit1")
    page.keyboard.up("Digit1")
    page.keyboard.up("KeyW")
    covered = lab.mark()
    assert page.get_by_test_id("alert").get_attribute("aria-label") == "Letter"
    assert page.get_by_test_id("alert-prompt").inner_text() == "Is this letter the same as the one 2 before?"
    assert page.get_by_test_id("alert-reading").inner_text() == "K"
    assert page.get_by_test_id("alert-input").is_hidden() and page.get_by_test_id("alert-submit").is_hidden()
    focused = "document.querySelector('[data-testid=alert]').contains(document.activeElement)"
    assert page.evaluate(focused), "a screen reader is told at once"
    page.screenshot(path=screenshot_dir / "nback_same_page.png")
    for key in ("Enter", "Space", "w", "9"):
        page.keyboard.press(key)
    lab.wait_submit("alert_shown")
    assert answers(lab) == []
    page.keyboard.press("2")
    lab.wait_submit("alert_answer")
    page.keyboard.press("1")  # too late to change one's mind
    lab.send(closed(1, release_in_s=0.5))
    page.get_by_text("The controls come back", exact=False).wait_for()
    page.get_by_test_id("alert").wait_for(state="hidden")
    assert answers(lab) == [{"alert": 1, "value": "different"}]
    assert lab.inputs(after=covered) == []


def test_the_keys_work_on_every_keyboard_and_the_buttons_with_tab_and_mouse(page: Page, letters_panel: FakeLab) -> None:
    lab = letters_panel
    page.goto(lab.panel_url)
    page.get_by_test_id("panel-start").click()
    visible(page, "panel-waiting")

    def answered(number: int, act: Any) -> str:
        lab.send(letter(number), "panel")
        page.get_by_test_id("alert-choice-same").wait_for(state="visible")
        act()
        mine = lab.wait_for(
            lambda message: message.get("data", {}).get("alert") == number and "value" in message["data"]
        )
        lab.send(closed(number), "panel")
        visible(page, "panel-waiting")
        return str(mine["data"]["value"])

    pressed = "(keys) => document.dispatchEvent(new KeyboardEvent('keydown', {...keys, bubbles: true}))"
    french, pad = {"key": "&", "code": "Digit1"}, {"key": "2", "code": "Numpad2"}
    assert answered(1, lambda: page.evaluate(pressed, french)) == "same"
    assert answered(2, lambda: page.evaluate(pressed, pad)) == "different"
    assert answered(3, lambda: page.get_by_test_id("alert-choice-same").click()) == "same"

    def by_tab() -> None:
        page.keyboard.press("Tab")
        page.keyboard.press("Tab")
        page.keyboard.press("Space")

    assert answered(4, by_tab) == "different"


def test_the_second_device_speaks_of_letters(page: Page, letters_panel: FakeLab, screenshot_dir: Path) -> None:
    lab = letters_panel
    page.goto(lab.panel_url)
    page.get_by_role("heading", name="Letters").wait_for()
    assert "reading" not in page.locator("body").inner_text().lower()
    page.get_by_test_id("panel-start").click()
    page.get_by_role("heading", name="Waiting for the next letter").wait_for()
    lab.send(letter(1, "Q"), "panel")
    visible(page, "alert-choice-same")
    page.screenshot(path=screenshot_dir / "nback_panel.png")
    assert "reading" not in page.locator("body").inner_text().lower()
    lab.send(closed(1, "expired"), "panel")
    page.get_by_text("Time ran out for the last letter.").wait_for()
    page.screenshot(path=screenshot_dir / "nback_panel_waiting.png")
    lab.send(
        {**letter(2), "choices": [], "prompt": "Type the sum, then press Enter", "reading": "17 + 26 + 9"}, "panel"
    )
    visible(page, "alert-input")
    assert page.get_by_label("Type the sum, then press Enter").is_visible()
    page.screenshot(path=screenshot_dir / "sums_panel.png")
    page.keyboard.press("Enter")
    page.get_by_text("Type your answer first.").wait_for()
    page.keyboard.type("52")
    page.keyboard.press("Enter")
    assert lab.wait_submit("alert_answer")["data"] == {"alert": 2, "value": "52"}


def test_an_answer_that_is_not_taken_is_said_beside_the_choices(page: Page, letters_lab: FakeLab) -> None:
    lab = letters_lab
    driving(page, lab)
    lab.refuses["alert_answer"] = [{"code": "invalid", "field": "data.value", "message": "is none of the answers"}]
    lab.send(letter(1))
    visible(page, "alert-choice-same")
    page.keyboard.press("1")
    page.get_by_text("Not saved: is none of the answers").wait_for()
    page.keyboard.press("2")
    lab.wait_for(lambda message: message.get("data") == {"alert": 1, "value": "different"})


def test_the_set_up_speaks_of_letters(page: Page, letters_lab: FakeLab) -> None:
    opened(page, letters_lab, "setup")
    page.get_by_text("Letters come with a loud sound.", exact=False).wait_for()
    assert "reading" not in page.get_by_test_id("page-setup").inner_text().lower()
