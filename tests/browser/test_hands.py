"""Hands: what keys and a pad send, and when they send nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pad import PS3_RAW_ID, FakePad
from tests.support.fake_pages import CONTENT, tick
from tests.support.participant_page import driving, opened, visible

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def test_a_press_and_release_within_one_tick_are_both_sent(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    mark = lab.mark()
    page.evaluate(
        """() => { for (const type of ["keydown", "keyup"])
             document.body.dispatchEvent(new KeyboardEvent(type, {code: "KeyA", bubbles: true})); }"""
    )
    lab.wait_for(lambda message: message["type"] == "input" and message["direction"] is None, after=mark)
    inputs = lab.inputs(after=mark)
    assert [message["direction"] for message in inputs] == [[0, 1, 0], None]
    assert inputs[1]["seq"] == inputs[0]["seq"] + 1


def test_sequence_numbers_go_on_from_what_the_lab_has_seen(page: Page, lab: FakeLab) -> None:
    lab.welcome["last_seq"] = 700
    driving(page, lab)
    page.keyboard.down("KeyS")
    assert lab.wait_for(lambda message: message["type"] == "input")["seq"] == 701


def test_keys_combine_cancel_and_are_let_go_when_the_window_loses_focus(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    for key in ("KeyW", "KeyD", "PageUp"):
        page.keyboard.down(key)
    lab.wait_for(lambda message: message.get("direction") == [1, -1, 1])
    page.keyboard.down("KeyS")
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 1])
    page.evaluate("() => window.dispatchEvent(new Event('blur'))")
    lab.wait_for(lambda message: message["type"] == "input" and message["direction"] is None)


def test_a_gripper_key_counts_once_however_long_it_is_held(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    mark = lab.mark()
    page.keyboard.down("Space")
    page.keyboard.down("Space")  # the keyboard's own repeat
    page.keyboard.up("Space")
    page.keyboard.press("Enter")
    lab.wait_for(lambda message: message.get("gripper") == "open", after=mark)
    pressed = [message["gripper"] for message in lab.inputs(after=mark)]
    assert pressed == ["close", "open"]


def test_nothing_drives_before_start_or_while_paused_or_behind_a_dialog(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "trial_ready")
    page.keyboard.press("KeyW")
    lab.show("trial")
    lab.send({"type": "status", "status": "paused"})
    page.locator("[data-testid=state-sign][data-state=paused]").wait_for()
    page.keyboard.press("KeyW")
    lab.send({"type": "status", "status": "running"})
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()
    page.get_by_test_id("help-button").click()
    page.get_by_test_id("help-dialog").get_by_role("textbox").type("wasd")
    page.get_by_test_id("dialog-back").click()
    page.locator(".drive-scene:focus").wait_for()  # a dialog's `close` event comes a task after the click
    mark = lab.mark()
    page.keyboard.press("KeyD")
    lab.wait_for(lambda message: message["type"] == "input", after=mark)
    assert lab.inputs() == lab.inputs(after=mark)


def calibrated(page: Page, lab: FakeLab, pad: FakePad, view: int | None = None) -> None:
    """Goes through "press what the page asks" with the left stick, and buttons for everything else."""
    opened(page, lab, "setup")
    page.get_by_test_id("device-gamepad").click()
    pad.connect(PS3_RAW_ID, "", axes=4, buttons=17)

    def asked(step: str) -> None:
        page.locator(f"[data-testid=calibration][data-step={step}]").wait_for()
        pad.frames(2)

    asked("wake")
    pad.tap(3)
    for step, axis, value in (("forward", 1, -1.0), ("left", 0, -1.0)):
        asked(step)
        pad.axis(axis, value)
        pad.frames(3)
        pad.axis(axis, 0.02)
        pad.frames(3)
    for step, button in (("up", 4), ("down", 6), ("close", 14), ("open", 13)):
        asked(step)
        pad.tap(button)
        pad.frames(3)
    asked("view")
    if view is None:
        page.get_by_test_id("calibration-skip").click()
    else:
        pad.tap(view)
    page.get_by_test_id("dead-zone").wait_for()


def test_a_pad_is_learned_by_pressing_what_the_page_asks(page: Page, lab: FakeLab) -> None:
    pad = FakePad(page)
    calibrated(page, lab, pad)
    page.get_by_test_id("sound-play").click()
    page.get_by_test_id("sound-yes").click()
    page.get_by_test_id("setup-submit").click()
    data = lab.wait_submit("setup")["data"]
    assert (data["device"], data["pad_id"], data["sound"]) == ("gamepad", PS3_RAW_ID, True)
    mapping = data["mapping"]
    assert (mapping["forward"]["index"], mapping["forward"]["sign"]) == (1, -1)
    assert (mapping["back"]["index"], mapping["back"]["sign"]) == (1, 1), "the other way on the same stick"
    assert mapping["close"] == {"kind": "button", "index": 14}
    assert 0.1 <= data["dead_zone"] <= 0.8


def test_a_learned_pad_drives_is_remembered_and_yields_to_the_keyboard_when_unplugged(page: Page, lab: FakeLab) -> None:
    pad = FakePad(page)
    calibrated(page, lab, pad)
    lab.state = "trial"
    page.reload()
    visible(page, "page-drive")
    pad.tap(0)  # browsers hide pads from a new page until a button is pressed; this one means nothing
    mark = lab.mark()
    pad.axis(1, -0.9)
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0], after=mark)
    pad.axis(1, -0.2)
    lab.wait_for(lambda message: message["type"] == "input" and message["direction"] is None, after=mark)
    pad.tap(14)
    assert lab.wait_for(lambda message: message.get("gripper") is not None, after=mark)["gripper"] == "close"
    pad.axis(0, 0.9)
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 0], after=mark)
    before_unplug = lab.mark()
    pad.disconnect()
    lab.wait_for(lambda message: message["type"] == "input" and message["direction"] is None, after=before_unplug)
    lab.wait_for(lambda message: message["type"] == "note" and message["name"] == "pad_unplugged")
    page.get_by_text("The gamepad is unplugged. The keyboard has taken over", exact=False).wait_for()
    page.keyboard.down("KeyW")
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0], after=before_unplug)
    lab.wait_for(lambda message: message.get("device") == "keyboard", after=before_unplug)


def test_a_key_and_a_button_of_the_pad_switch_the_view(page: Page, lab: FakeLab) -> None:
    pad = FakePad(page)
    calibrated(page, lab, pad, view=8)
    lab.state = "trial"
    page.reload()
    visible(page, "page-drive")
    lab.send(tick(0))
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()
    pad.tap(0)  # shows the pad to the new page
    names = [view["name"] for view in CONTENT["trial"]["views"]]
    for hand, name in (("pad", names[1]), ("key", names[2 % len(names)])):
        mark = lab.mark()
        if hand == "pad":
            pad.tap(8)
        else:
            page.keyboard.press("KeyV")
        seen = lab.wait_for(lambda message: message["type"] == "view", after=mark)
        assert seen["name"] == name, "each press goes one further"
    assert lab.inputs() == [], "and moves nothing"
