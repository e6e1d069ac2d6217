"""The pages' own promises, against a lab that only speaks the wire: what is sent, kept, resent, and never sent."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from study.flow.typed_number import numerals
from tests.support.fake_lab import STATIC, FakeLab
from tests.support.fake_pad import PS3_RAW_ID, FakePad
from tests.support.fake_pages import CONTENT, alert, instruction, letter, session_row, tick
from tests.support.typed_numbers import ALPHABET, READ, digits

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


@pytest.fixture
def lab() -> Iterator[FakeLab]:
    with FakeLab() as running:
        yield running


@pytest.fixture
def panel_lab() -> Iterator[FakeLab]:
    with FakeLab(placement="second_device", state="trial") as running:
        yield running


LOUDEST = """() => {
  const samples = new Float32Array(salab.sound.analyser.fftSize);
  salab.sound.analyser.getFloatTimeDomainData(samples);
  return Math.max(...samples.map(Math.abs)) OF;
}"""


def visible(page: Page, testid: str) -> None:
    page.get_by_test_id(testid).wait_for(state="visible")


def opened(page: Page, lab: FakeLab, state: str) -> None:
    """The participant's page in this state, connected."""
    lab.state = state
    page.goto(lab.participant_url)
    driving = {"practice": "page-drive", "trial": "page-drive"}
    visible(page, driving.get(state, f"page-{state}"))
    page.locator("[data-testid=connection][data-state=open]").wait_for()


def driving_by_keyboard(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "trial")
    lab.send(tick(0))
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()


# --- steps, acknowledgement, reconnection ------------------------------------------------------------------------


def test_consent_needs_the_tick_and_sends_the_hash_of_the_text(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "consent")
    page.get_by_test_id("consent-agree").click()
    assert page.get_by_role("alert").inner_text().startswith("Tick the box")
    assert not [message for message in lab.received if message["type"] == "submit"]
    page.get_by_test_id("consent-box").check()
    page.get_by_test_id("consent-agree").click()
    assert lab.wait_submit("consent")["data"] == {"accepted": True, "hash": CONTENT["consent"]["hash"]}
    visible(page, "page-demographics")


def test_unacknowledged_submit_survives_a_lost_connection_and_a_reload(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "break")
    lab.acknowledges = False
    page.get_by_test_id("continue-button").click()
    first = lab.wait_submit("continue")
    mark = lab.mark()
    lab.drop()
    again = lab.wait_submit("continue", after=mark)
    assert again["id"] == first["id"]
    mark = lab.mark()
    page.reload()
    lab.acknowledges = True
    third = lab.wait_submit("continue", after=mark)
    assert third["id"] == first["id"]
    visible(page, "page-practice_ready")
    page.wait_for_function("() => Object.keys(localStorage).every((key) => !key.endsWith(':outbox'))")


def test_reconnects_by_itself_and_says_so_meanwhile(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
    lab.accepts = False
    lab.drop()
    page.locator("[data-testid=state-sign][data-state=lost]").wait_for()
    assert "Connection lost" in page.get_by_test_id("connection").inner_text()
    mark = lab.mark()
    page.keyboard.down("KeyW")
    page.keyboard.up("KeyW")
    lab.accepts = True
    lab.wait_for(lambda message: message["type"] == "hello", after=mark)
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()
    beat = lab.wait_for(lambda message: message["type"] == "heartbeat", after=mark)
    assert beat["direction"] is None
    assert lab.inputs(after=mark) == [], "what was pressed without a connection is never sent late"


def test_a_second_tab_takes_over_and_the_first_can_take_it_back(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "break")
    second = page.context.new_page()
    second.goto(lab.participant_url)
    visible(second, "page-break")
    visible(page, "page-superseded")
    page.get_by_test_id("take-over").click()
    visible(page, "page-break")
    visible(second, "page-superseded")


def test_typed_refusals_are_shown_and_dismissed(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "break")
    lab.refuses["continue"] = [{"code": "illegal", "field": None, "message": "<b>not now</b>"}]
    page.get_by_test_id("continue-button").click()
    toast = page.get_by_test_id("toast-problem")
    toast.wait_for()
    assert "<b>not now</b>" in toast.inner_text(), "what the lab says is text, never markup"
    toast.get_by_role("button").click()
    toast.wait_for(state="detached")
    assert page.get_by_test_id("continue-button").is_enabled()


def test_pings_are_answered(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "break")
    lab.send({"type": "ping", "n": 41})
    assert lab.wait_for(lambda message: message["type"] == "pong")["n"] == 41


def test_heartbeats_come_from_a_worker_and_carry_the_hands(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
    page.keyboard.down("ArrowUp")
    beat = lab.wait_for(lambda message: message["type"] == "heartbeat" and message["direction"] == [1, 0, 0])
    assert beat["visible"] is True
    assert any(worker.url.endswith("/static/wire/heartbeat_worker.js") for worker in page.workers)


# --- hands ---------------------------------------------------------------------------------------------------------


def test_a_press_and_release_within_one_tick_are_both_sent(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
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
    driving_by_keyboard(page, lab)
    page.keyboard.down("KeyS")
    assert lab.wait_for(lambda message: message["type"] == "input")["seq"] == 701


def test_keys_combine_cancel_and_are_let_go_when_the_window_loses_focus(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
    for key in ("KeyW", "KeyD", "PageUp"):
        page.keyboard.down(key)
    lab.wait_for(lambda message: message.get("direction") == [1, -1, 1])
    page.keyboard.down("KeyS")
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 1])
    page.evaluate("() => window.dispatchEvent(new Event('blur'))")
    lab.wait_for(lambda message: message["type"] == "input" and message["direction"] is None)


def test_a_gripper_key_counts_once_however_long_it_is_held(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
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


# --- readings ------------------------------------------------------------------------------------------------------


def test_a_reading_covers_the_view_takes_the_hands_and_typing_never_drives(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
    page.keyboard.down("KeyW")
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0])
    mark = lab.mark()
    lab.send(alert(1, "582.4"))
    visible(page, "alert")
    lab.wait_for(lambda message: message["type"] == "input" and message["direction"] is None, after=mark)
    assert lab.wait_submit("alert_shown")["data"] == {"alert": 1}
    page.keyboard.up("KeyW")
    covered = lab.mark()
    cover, view = page.get_by_test_id("alert").bounding_box(), page.get_by_test_id("scene").bounding_box()
    assert cover and view
    assert cover["x"] <= view["x"] and cover["y"] <= view["y"]
    assert cover["x"] + cover["width"] >= view["x"] + view["width"]
    assert cover["y"] + cover["height"] >= view["y"] + view["height"]
    page.keyboard.type("wasd 5")
    page.get_by_test_id("alert-input").fill("582.4")
    page.keyboard.press("Enter")
    assert lab.wait_submit("alert_answer")["data"] == {"alert": 1, "value": "582.4"}
    lab.send({"type": "alert_closed", "alert": 1, "status": "answered", "release_in_s": 0.5})
    page.get_by_text("The controls come back", exact=False).wait_for()
    page.get_by_test_id("alert").wait_for(state="hidden")
    assert lab.inputs(after=covered) == []
    page.keyboard.down("KeyD")
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 0], after=covered)


def test_the_alarm_is_heard_where_the_browser_lets_it_and_reported_only_then(page: Page, panel_lab: FakeLab) -> None:
    page.goto(panel_lab.panel_url)
    page.get_by_test_id("panel-start").click()
    visible(page, "panel-waiting")
    page.wait_for_function(LOUDEST.replace("OF", "< 1e-4"))
    panel_lab.send(alert(2, "77.1"), "panel")
    page.wait_for_function(LOUDEST.replace("OF", "> 0.05"))
    assert panel_lab.wait_submit("alert_heard")["data"] == {"alert": 2}
    page.keyboard.type("77.1")
    page.keyboard.press("Enter")
    answer = panel_lab.wait_submit("alert_answer")
    assert (answer["role"], answer["data"]) == ("panel", {"alert": 2, "value": "77.1"})
    panel_lab.send({"type": "alert_closed", "alert": 2, "status": "answered", "release_in_s": 0.0}, "panel")
    visible(page, "panel-waiting")
    assert page.get_by_test_id("panel-last").inner_text() == "Reading saved."
    assert not [message for message in panel_lab.received if message["type"] in ("heartbeat", "input")]


def test_a_pause_hides_the_reading_and_leaves_going_on_in_reach(page: Page, lab: FakeLab) -> None:
    lab.state = "paused"
    page.goto(lab.participant_url)  # as after a reload in mid-trial
    visible(page, "resume-button")
    lab.send(alert(4, "33.3", elapsed_s=6.0))
    lab.send({"type": "ping", "n": 1})
    lab.wait_for(lambda message: message["type"] == "pong")
    assert page.get_by_test_id("alert").is_hidden()
    assert not [message for message in lab.received if message.get("step") == "alert_shown"]
    page.get_by_test_id("resume-button").click()
    visible(page, "alert")
    assert lab.wait_submit("alert_shown")["data"] == {"alert": 4}
    assert page.get_by_test_id("alert-countdown").inner_text() == "14 s left", "time stood still meanwhile"


def test_an_unanswered_reading_goes_away_when_the_lab_says_so(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
    lab.send(alert(3, "10.0", elapsed_s=19.0))
    visible(page, "alert")
    assert page.get_by_test_id("alert-countdown").inner_text() in ("1 s left", "0 s left")
    page.keyboard.press("Enter")
    page.get_by_text("Type the number shown above first.").wait_for()
    lab.send({"type": "alert_closed", "alert": 3, "status": "expired", "release_in_s": 0.0})
    page.get_by_test_id("alert").wait_for(state="hidden")
    assert "Time ran out" in page.get_by_test_id("notice").inner_text()
    assert not [message for message in lab.received if message.get("step") == "alert_answer"]


def test_what_became_of_one_reading_is_not_said_of_the_next(page: Page, panel_lab: FakeLab) -> None:
    panel_lab.state = "trial"
    page.goto(panel_lab.panel_url)
    page.get_by_test_id("panel-start").click()
    visible(page, "panel-waiting")
    panel_lab.send(alert(5, "10.0", elapsed_s=19.0), "panel")
    visible(page, "alert")
    panel_lab.send({"type": "alert_closed", "alert": 5, "status": "expired", "release_in_s": 0.0}, "panel")
    visible(page, "panel-waiting")
    assert page.get_by_test_id("panel-last").inner_text() == "Time ran out for the last reading."
    panel_lab.send(alert(6, "20.0"), "panel")
    visible(page, "alert")
    panel_lab.show("survey")  # the study went on without it
    visible(page, "panel-waiting")
    assert page.get_by_test_id("panel-last").inner_text() == ""


# --- another kind of distractor ------------------------------------------------------------------------------------


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
    driving_by_keyboard(page, lab)
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
    driving_by_keyboard(page, lab)
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


# --- forms ---------------------------------------------------------------------------------------------------------


def test_wrong_comprehension_answers_are_told_beside_their_questions(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "instructions")
    for question in CONTENT["instructions"]["questions"]:
        page.get_by_test_id(f"question-{question['id']}").get_by_role("radio").first.check()
    lab.refuses["instructions"] = [
        {"code": "invalid", "field": f"answers.{name}", "message": "Not quite: please read the text again."}
        for name in ("which_object", "on_sound")
    ]
    page.get_by_test_id("instructions-submit").click()
    for name, wrong in (("which_object", True), ("on_sound", True), ("robot_moves", False)):
        error = page.get_by_test_id(f"question-{name}").locator(".field-error")
        error.wait_for(state="visible" if wrong else "hidden")
    assert page.get_by_test_id("toast-problem").count() == 0
    page.get_by_label("The one named on the page").check()
    page.get_by_label("Type the reading within 20 seconds").check()
    mark = lab.mark()
    page.get_by_test_id("instructions-submit").click()
    given = lab.wait_submit("instructions", after=mark)["data"]["answers"]
    assert given == {"which_object": "named", "on_sound": "log", "robot_moves": "obeys"}
    visible(page, "page-practice_ready")


def test_demographics_asks_for_what_is_required_and_leaves_the_rest(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "demographics")
    page.get_by_label("25 to 34").check()
    page.get_by_test_id("demographics-submit").click()
    missing = page.get_by_test_id("question-gaming_experience")
    missing.locator(".field-error").wait_for(state="visible")
    assert missing.evaluate("(element) => element.contains(document.activeElement)")
    page.get_by_label("Every week").check()
    page.get_by_label(re.compile("Hours of games")).fill("3.5")
    page.get_by_test_id("demographics-submit").click()
    given = lab.wait_submit("demographics")["data"]["answers"]
    assert given == {"age_group": "b", "gaming_experience": "weekly", "hours": "3.5"}


def test_the_pages_read_numbers_as_the_lab_does(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "consent")
    read = """async (all) => {
      const { numerals } = await import("/static/common/typed_number.js");
      return all.map(numerals);
    }"""
    rng = random.Random(1)
    strings = ["".join(rng.choices(ALPHABET, k=rng.randint(1, 9))) for _ in range(3000)]
    every = [*READ, *strings, *(f"{one}.5" for one in digits())]
    assert sum(bool(numerals(one)) for one in strings) > 100
    told = dict(zip(every, page.evaluate(read, every), strict=True))
    assert told == {one: list(numerals(one)) for one in every}


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("12e", "“12e” is not a number. Please write it in digits alone"),
        ("1-2", "“1-2” is not a number."),
        ("1e400", "“1e400” is too large."),
        ("1,234", "“1,234” could be 1234 or 1.234."),
        (" ", "This holds blanks alone."),
        ("-1", "“-1” is below 0, the least that is taken."),
        ("169", "“169” is above 168, the most that is taken."),
    ],
)
def test_a_number_is_never_changed_it_is_taken_or_refused_beside_it(
    page: Page, lab: FakeLab, typed: str, said: str
) -> None:
    opened(page, lab, "demographics")
    page.get_by_label("25 to 34").check()
    page.get_by_label("Every week").check()
    hours = page.get_by_label(re.compile("Hours of games"))
    hours.press_sequentially(typed)
    page.get_by_test_id("demographics-submit").click()
    error = page.get_by_test_id("question-hours").locator(".field-error")
    error.wait_for(state="visible")
    assert said in error.inner_text()
    assert hours.input_value() == typed
    assert not lab.submits("demographics")
    page.reload()
    visible(page, "page-demographics")
    assert hours.input_value() == typed
    hours.fill("")
    hours.press_sequentially("3,5")
    page.get_by_test_id("demographics-submit").click()
    assert lab.wait_submit("demographics")["data"]["answers"]["hours"] == "3,5"


def test_words_are_sent_as_they_stand_and_too_many_are_not_cut_off(page: Page, lab: FakeLab) -> None:
    lab.welcome["words_limit"] = 30
    opened(page, lab, "demographics")
    page.get_by_label("25 to 34").check()
    page.get_by_label("Every week").check()
    job = page.get_by_label(re.compile("What do you do"))
    error = page.get_by_test_id("question-job").locator(".field-error")
    for words, said in (("👍" * 31, "31 characters, and at most 30"), ("a\x1bb", "U+001B"), ("   ", "blanks alone")):
        job.fill(words)
        page.get_by_test_id("demographics-submit").click()
        error.get_by_text(said).wait_for()
        assert job.input_value() == words
    words = f"  {'👍' * 26}  "
    job.fill(words)
    page.get_by_test_id("demographics-submit").click()
    assert lab.wait_submit("demographics")["data"]["answers"]["job"] == words
    page.get_by_test_id("help-button").click()
    box = page.get_by_test_id("help-dialog").get_by_role("textbox")
    box.fill("x" * 31)
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_test_id("help-dialog").get_by_text("31 characters, and at most 30").wait_for()
    box.fill(" two\nlines ")
    page.get_by_test_id("dialog-confirm").click()
    assert lab.wait_submit("help")["data"] == {"text": " two\nlines "}


def test_a_reading_that_is_no_number_stays_in_its_field_and_time_goes_on(page: Page, panel_lab: FakeLab) -> None:
    page.goto(panel_lab.panel_url)
    visible(page, "panel-locked")
    page.locator("[data-testid=connection][data-state=open]").wait_for()
    panel_lab.send(alert(1, elapsed_s=3.0), "panel")
    field = page.get_by_test_id("alert-input")
    field.wait_for()
    assert field.get_attribute("inputmode") == "decimal"
    for typed in ("58a.4", "582.4.", "5-8"):
        field.fill(typed)
        page.get_by_test_id("alert-submit").click()
        page.get_by_text(f"“{typed}” is not a number. Type the number shown above.").wait_for()
        assert field.input_value() == typed
        assert field.evaluate("(element) => element === document.activeElement")
    assert not panel_lab.submits("alert_answer")
    page.get_by_test_id("alert-countdown").get_by_text(re.compile("^1[0-6] s left")).wait_for()
    field.fill("\u200e ５８２，４0 ")
    page.get_by_test_id("alert-submit").click()
    assert panel_lab.wait_submit("alert_answer")["data"] == {"alert": 1, "value": "\u200e ５８２，４0 "}


def test_a_survey_skips_nothing_silently_and_keeps_answers_over_a_reload(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "survey")
    items = [
        (instrument["id"], item["id"])
        for instrument in CONTENT["survey"]["instruments"]
        for item in instrument["items"]
    ]
    for index, (instrument, item) in enumerate(items):
        if index != 3:
            page.locator(f"input[name='{instrument}.{item}'][value='{index % 7 + 1}']").check()
    page.reload()
    visible(page, "page-survey")
    assert page.get_by_test_id("survey-progress").inner_text() == "15 of 16 answered"
    page.get_by_test_id("survey-submit").click()
    assert "One question is not answered yet" in page.get_by_test_id("survey-missing").inner_text()
    gap = page.get_by_test_id(f"item-{items[3][0]}.{items[3][1]}")
    assert gap.get_by_text("Please choose an answer.").is_visible()
    assert gap.evaluate("(element) => element.contains(document.activeElement)")
    page.keyboard.press("ArrowRight")  # from the first, focused and not chosen, to the second: by keyboard alone
    page.get_by_test_id("survey-submit").click()
    answers = lab.wait_submit("survey")["data"]["answers"]
    assert {(instrument, item) for instrument, given in answers.items() for item in given} == set(items)
    for index, (instrument, item) in enumerate(items):
        assert answers[instrument][item] == (2 if index == 3 else index % 7 + 1)


def test_stopping_asks_once_and_ends_with_thanks(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
    page.get_by_test_id("stop-button").click()
    page.get_by_test_id("dialog-back").click()
    page.get_by_test_id("stop-button").click()
    page.get_by_test_id("dialog-confirm").click()
    visible(page, "page-withdrawn")
    withdrawals = [message for message in lab.received if message.get("step") == "withdraw"]
    assert [message["data"] for message in withdrawals] == [{"reason": None}]
    assert page.get_by_test_id("stop-button").is_hidden()


def test_the_card_draws_things_of_a_layout_of_ones_own(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)

    def look(**looks: Any) -> None:
        lab.send(tick(1, instruction=instruction("pickup", "wipes_tub")))  # so that it draws anew
        page.get_by_text("Pick up the tub of wipes.").wait_for()
        dropoff = instruction("dropoff", "spray_bottle", "left_bin")
        content = {**CONTENT["trial"], "looks": looks, "instruction": dropoff}
        lab.send({"type": "page", "state": "trial", "trial": 1, "trials": 3, "content": content})
        page.get_by_text("Drop the spray bottle into the left bin.").wait_for()

    def colours(thing: str) -> list[str]:
        found: list[str] = page.locator(f"[data-drawing={thing}] [fill]").evaluate_all(
            "(all) => all.map((one) => one.getAttribute('fill'))"
        )
        return found

    carton = {"shape": "box", "color": "#123456", "size_m": [0.05, 0.06, 0.2], "drawing": ""}
    look(spray_bottle=carton, left_bin={"shape": "bin", "color": "#fedcba", "letter": "Q"})
    assert colours("spray_bottle") == ["#123456", "#f6f6f2"]
    assert colours("left_bin")[0] == "#fedcba"
    assert page.locator("[data-drawing=left_bin] text").text_content() == "Q"
    look(spray_bottle={**carton, "shape": "cylinder", "color": "#fafafa"})
    assert colours("spray_bottle") == ["#fafafa", "#2c323a", "#fafafa"], "a dark band on what is nearly white"
    look(spray_bottle={**carton, "outline": "M0 0H100v100H0z"})
    assert colours("spray_bottle") == ["#123456"]
    shape = page.locator("[data-drawing=spray_bottle] path")
    assert shape.get_attribute("d") == "M0 0H100v100H0z"
    look(spray_bottle={**carton, "drawing": "sponge_pack"})
    assert "#cc79a7" in colours("spray_bottle")
    look(left_bin={"shape": "bin", "color": "#fedcba", "letter": ""})
    assert "#56b4e9" in colours("spray_bottle"), "without a look, as it ships"


def test_the_drive_page_tells_what_to_do_and_what_is_happening(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
    assert page.get_by_test_id("instruction").inner_text() == "Pick up the spray bottle."
    assert page.locator("[data-drawing=spray_bottle]").is_visible()
    assert page.get_by_test_id("progress").inner_text() == "Task 1 of 6 · Round 1 of 3"
    assert page.get_by_test_id("assisting").is_hidden()
    lab.send(tick(1, blocked=True, assisting=True))
    page.get_by_text("Cannot move further that way. Go another way.").wait_for()
    for cause, ways, words in (
        ("touches_closed", ["back", "open"], "The closed gripper touches something. Go back. Open the gripper."),
        ("low", ["up"], "The gripper is as low as it goes. Go up."),
        ("touches_holding", ["up"], "The gripper, or what it holds, touches something. Go up."),
        ("limit", [], "The arm reaches no further that way."),
    ):
        lab.send(tick(1, blocked=True, assisting=True, hint={"cause": cause, "ways": ways}))
        page.get_by_test_id("drive-hint").get_by_text(words, exact=True).wait_for()
    assert page.get_by_test_id("assisting").inner_text() == "The robot is assisting"
    for status, words in (("resetting", "Resetting"), ("gripper", "Gripper moving"), ("finished", "Finished")):
        lab.send(tick(2, status=status))
        page.get_by_test_id("state-sign").get_by_text(words, exact=True).wait_for()
    for status, words in (("held", "On hold"), ("recovering", "Recovering")):
        lab.send({"type": "status", "status": status})
        page.get_by_test_id("state-sign").get_by_text(words, exact=True).wait_for()
    page.get_by_test_id("view-side").click()
    assert lab.wait_for(lambda message: message["type"] == "view")["name"] == "side"
    mark = lab.mark()
    page.reload()
    assert lab.wait_for(lambda message: message["type"] == "view", after=mark)["name"] == "side", "kept over a reload"
    assert page.get_by_test_id("view-side").get_attribute("aria-pressed") == "true"


def test_paused_page_goes_on_when_the_participant_says_so(page: Page, lab: FakeLab) -> None:
    driving_by_keyboard(page, lab)
    lab.show("paused")
    page.get_by_test_id("resume-button").click()
    lab.wait_submit("resume")
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()


# --- the experimenter ------------------------------------------------------------------------------------------------


def test_dashboard_signs_in_from_the_link_and_hides_the_token(page: Page, lab: FakeLab) -> None:
    lab.sessions = [session_row("p001", "trial", label="R 17"), session_row("p002", "done")]
    page.goto(f"{lab.base_url}/dashboard#token=wrong")
    visible(page, "login-error")
    page.get_by_test_id("token-input").fill("right-token")
    page.get_by_test_id("login-button").click()
    visible(page, "sessions")
    page.goto(f"{lab.base_url}/#")
    page.goto(f"{lab.base_url}/dashboard#token=right-token")
    visible(page, "sessions")
    assert "token" not in page.url
    row = page.locator("[data-testid=session-row][data-participant=p001]")
    assert "In a trial" in row.inner_text() and "R 17" in row.inner_text()
    assert page.get_by_test_id("last-updated").inner_text().startswith("Updated")


def test_dashboard_creates_links_and_acts_on_sessions(page: Page, lab: FakeLab) -> None:
    lab.sessions = [session_row("p001", "trial"), session_row("p003", "done")]
    page.goto(f"{lab.base_url}/dashboard#token=right-token")
    visible(page, "sessions")
    page.get_by_test_id("create-count").fill("2")
    page.get_by_test_id("create-demo").click()
    page.get_by_test_id("new-link").nth(1).wait_for()
    assert lab.commands[0] == ("create", {"demo": True, "count": 2})
    assert "/p/secret" in page.get_by_test_id("participant-link").first.input_value()
    row = page.locator("[data-participant=p001]")
    row.get_by_test_id("abort").click()
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_text("Give a reason.").wait_for()
    page.get_by_test_id("abort-dialog").get_by_role("textbox").fill("fire alarm")
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_text("p001: the session is aborted.").wait_for()
    assert lab.commands[1] == ("p001 abort", {"reason": "fire alarm"})
    over = page.locator("[data-participant=p003]").get_by_test_id("pause")
    assert over.get_attribute("aria-disabled") == "true"
    assert over.get_attribute("title") == "The session is over."
    with page.expect_download() as download:
        page.get_by_test_id("download-export").click()
    assert download.value.suggested_filename == "export.zip"


# --- all of them -----------------------------------------------------------------------------------------------------


def test_pages_fit_both_screens_without_scrolling_sideways(page: Page, lab: FakeLab) -> None:
    page.goto(lab.participant_url)
    for width, height in ((1280, 720), (1920, 1080)):
        page.set_viewport_size({"width": width, "height": height})
        for state in CONTENT:
            lab.show(state)
            name = "page-drive" if state in ("practice", "trial") else f"page-{state}"
            visible(page, name)
            if state == "practice":  # the longest words
                longest = "Practice: move the practice block to another place on the table and let go."
                told = {**CONTENT["practice"]["instruction"], "text": longest}
                lab.send(told)
                page.get_by_text(longest).wait_for()
            wide, tall, side = page.evaluate(
                """() => { const e = document.documentElement, s = document.querySelector(".side");
                     return [e.scrollWidth, e.scrollHeight, s ? s.scrollHeight - s.clientHeight : 0]; }"""
            )
            assert wide <= width, f"{state} is {wide} wide"
            if page.get_by_test_id("page-drive").count():
                assert tall <= height and side <= 0, f"{state} does not fit {width}x{height}"


def test_no_page_makes_markup_from_strings_or_asks_another_host() -> None:
    for path in sorted(path for path in STATIC.rglob("*") if path.is_file()):
        text = path.read_text(encoding="utf-8")
        assert len(text.splitlines()) < 400, path.name
        found = re.findall(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(", text)
        assert found == [], path.name
        hosts = set(re.findall(r"https?://([\w.-]+)", text)) - {"www.w3.org"}
        assert hosts == set(), path.name
