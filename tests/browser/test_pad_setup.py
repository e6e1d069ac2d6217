"""The set-up of a gamepad: which one it takes, what blocks it, and the way back from every phase."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pad import PS3_RAW_ID, STANDARD_ID, FakePad
from tests.support.participant_page import running

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def asked(page: Page, step: str) -> None:
    page.locator(f"[data-testid=calibration][data-step={step}]").wait_for()


def in_setup(page: Page, lab: FakeLab) -> None:
    lab.state = "setup"
    page.goto(lab.participant_url)
    page.get_by_test_id("page-setup").wait_for()
    page.get_by_test_id("device-gamepad").click()
    asked(page, "wake")


def learn_buttons(page: Page, pad: FakePad, slot: int = 0) -> None:
    for button, step in enumerate(("forward", "back", "left", "right", "up", "down", "close", "open")):
        asked(page, step)
        pad.tap(button, slot=slot)
    asked(page, "view")
    page.get_by_test_id("calibration-skip").click()
    page.get_by_test_id("dead-zone").wait_for()


def test_a_set_up_takes_the_pad_that_was_pressed_and_logs_no_plugging(page: Page, lab: FakeLab) -> None:
    pad = FakePad(page)
    in_setup(page, lab)
    pad.connect(PS3_RAW_ID, "", index=0)
    pad.connect(PS3_RAW_ID, "", index=1)
    pad.tap(9, slot=1)
    learn_buttons(page, pad, slot=1)
    pad.press(0, 1)
    page.get_by_test_id("hands").get_by_text("forward", exact=True).wait_for()
    pad.release(0, 1)
    page.get_by_test_id("calibrate-again").click()
    asked(page, "wake")
    pad.tap(9, slot=0)
    learn_buttons(page, pad, slot=0)
    page.get_by_test_id("sound-play").click()
    page.get_by_test_id("sound-yes").click()
    page.get_by_test_id("setup-submit").click()
    lab.wait_submit("setup")
    notes = [m["name"] for m in lab.received if m["type"] == "note"]
    assert not [name for name in notes if name.startswith("pad_")]


def test_a_pad_with_a_stuck_button_is_named_and_does_not_take_the_place_of_the_one_that_is_pressed(
    page: Page, lab: FakeLab
) -> None:
    pad = FakePad(page)
    in_setup(page, lab)
    pad.connect("A lap-top's strange device", "", index=0)
    pad.press(3, 0)
    page.get_by_test_id("calibration-blocking").get_by_text("Button 4 of A lap-top's strange device").wait_for()
    asked(page, "wake")
    pad.connect(STANDARD_ID, index=1)
    pad.tap(0, slot=1)
    learn_buttons(page, pad, slot=1)


def test_start_over_leads_back_from_every_phase_and_what_is_held_can_be_ignored(page: Page, lab: FakeLab) -> None:
    pad = FakePad(page)
    in_setup(page, lab)
    page.get_by_test_id("calibration-restart").click()
    asked(page, "wake")
    pad.connect(PS3_RAW_ID, "", axes=4)
    pad.axis(3, 0.8)
    pad.tap(5)
    asked(page, "rest")
    page.get_by_test_id("calibration-blocking").get_by_text("Axis 4 is held at 0.8: let go, or press Ignore").wait_for()
    page.get_by_test_id("calibration-restart").click()
    asked(page, "wake")
    pad.tap(5)
    asked(page, "rest")
    page.get_by_test_id("calibration-ignore").click()
    asked(page, "forward")
    pad.tap(0)
    asked(page, "back")
    page.get_by_test_id("calibration-restart").click()
    asked(page, "wake")
    pad.tap(5)
    page.get_by_test_id("calibration-ignore").click()
    learn_buttons(page, pad)
    page.reload()  # what was learned is offered, and can be refused
    page.get_by_test_id("device-gamepad").click()
    asked(page, "wake")
    page.get_by_test_id("calibration-restart").click()
    pad.tap(5)
    asked(page, "rest")


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        ("delete Navigator.prototype.getGamepads", "was not opened over https"),
        ("Navigator.prototype.getGamepads = () => { throw new DOMException('no', 'SecurityError'); }", "refuses"),
    ],
    ids=["absent", "throws"],
)
def test_a_browser_without_gamepads_says_so_and_the_keyboard_is_offered(
    page: Page, lab: FakeLab, broken: str, words: str
) -> None:
    page.add_init_script(broken)
    lab.state = "setup"
    page.goto(lab.participant_url)
    page.get_by_test_id("device-gamepad").click()
    assert page.get_by_test_id("calibration-prompt").inner_text() == "No gamepad can be used here"
    assert words in page.get_by_test_id("calibration").inner_text()
    page.get_by_test_id("calibration-keyboard").click()
    page.get_by_test_id("test-area").wait_for()
    page.keyboard.down("KeyW")
    page.get_by_test_id("hands").get_by_text("forward", exact=True).wait_for()


def test_the_legend_speaks_of_what_was_pressed_and_lights_up(page: Page, lab: FakeLab) -> None:
    pad = FakePad(page)
    for mapping, pad_id, words in (
        (
            "standard",
            STANDARD_ID,
            ["left stick ↑ ↓", "left stick ← →", "right shoulder", "left shoulder", "bottom button"],
        ),
        ("", PS3_RAW_ID, ["stick ↑ ↓", "stick ← →", "button 6", "button 5", "button 1"]),
    ):
        in_setup(page, lab)
        pad.connect(pad_id, mapping)
        pad.tap(9)
        for step, axis in (("forward", 1), ("left", 0)):
            asked(page, step)
            for value in (-1.0, 0.01):
                pad.axis(axis, value)
                pad.frames(3)
        for step, button in (("up", 5), ("down", 4), ("close", 0), ("open", 1)):
            asked(page, step)
            pad.tap(button)
        asked(page, "view")
        pad.tap(3)
        legend = page.locator(".pad-legend")
        assert legend.locator("kbd").all_inner_texts()[:5] == words
        assert legend.locator("svg").count() == (7 if mapping else 0)
        pad.press(5)
        legend.locator("kbd.on[data-action=up]").wait_for()
        pad.release(5)
        legend.locator("kbd.on").wait_for(state="detached")
        lab.state = "trial"
        page.reload()
        running(page, lab)
        pad.tap(9)
        page.locator(".side .pad-legend").wait_for()
        side = page.locator(".side").evaluate("(side) => side.scrollHeight - side.clientHeight")
        assert side <= 0, "all of it is in sight at 1280 x 720"
        pad.disconnect()
