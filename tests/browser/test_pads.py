"""Gamepads: nothing counts that was not seen at rest, and of two pads the one that is used is read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pad import PS3_RAW_ID, FakePad
from tests.support.fake_pages import alert
from tests.support.participant_page import driving, running

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


BUTTON = {"kind": "button"}
KINDS: dict[str, tuple[dict[str, Any], float, float]] = {
    # control for "up"; its value at rest, and pushed
    "stick": ({"kind": "axis", "index": 2, "rest": 0, "sign": 1, "span": 1}, 0.0, 1.0),
    "stick_off_centre": ({"kind": "axis", "index": 2, "rest": 0.3, "sign": -1, "span": 0.8}, 0.3, -0.6),
    "trigger_from_-1": ({"kind": "axis", "index": 2, "rest": -1, "sign": 1, "span": 2}, -1.0, 1.0),
    "trigger_from_0": ({"kind": "axis", "index": 2, "rest": 0, "sign": 1, "span": 1}, 0.0, 1.0),
    "cross_on_one_axis": ({"kind": "hat", "index": 2, "value": 0.14286}, 9 / 7, 0.14286),
    "button": ({"kind": "button", "index": 2}, 0.0, 1.0),
    "button_idling_half_way": ({"kind": "button", "index": 2, "rest": 0.5, "span": 0.5}, 0.5, 1.0),
}
EVENTS = ("reload", "replug", "blur", "visibility", "pause", "reading_answered", "dialog", "reconnection", "sleep")


def moved(lab: FakeLab, after: int) -> list[Any]:
    return [message["direction"] for message in lab.inputs(after=after) if message["direction"]]


def move(pad: FakePad, kind: str, value: float) -> None:
    if KINDS[kind][0]["kind"] == "button":
        pad.value(2, value)
    else:
        pad.axis(2, value)
    pad.frames(3)


def with_known_pad(page: Page, lab: FakeLab, kind: str) -> FakePad:
    """In a trial, with a pad that was learned before: `kind` is its way up, everything else are buttons from 5."""
    others = ["forward", "back", "left", "right", "down", "close", "open"]
    mapping = {name: {"kind": "button", "index": 5 + at} for at, name in enumerate(others)}
    mapping["up"] = KINDS[kind][0]
    page.add_init_script(
        f"""localStorage.setItem("salab:pad:{PS3_RAW_ID}", JSON.stringify({{mapping: {mapping!r}, dead_zone: 0.35}}));
        localStorage.setItem("salab:test:device", JSON.stringify({{device: "gamepad", pad_id: "{PS3_RAW_ID}"}}));"""
    )
    pad = FakePad(page)
    driving(page, lab)
    pad.connect(PS3_RAW_ID, "", axes=4, buttons=17)
    pad.tap(16)
    page.locator("[data-testid=device][data-name=gamepad]").wait_for()
    return pad


def happen(page: Page, lab: FakeLab, pad: FakePad, event: str) -> None:
    """The event, and back to where the hands drive."""
    if event == "reload":
        page.reload()
        running(page, lab)
        pad.tap(16)
    elif event == "replug":
        pad.disconnect()
        page.locator("[data-testid=device][data-name=keyboard]").wait_for()
        pad.connect(PS3_RAW_ID, "", axes=4, buttons=17)
        page.locator("[data-testid=device][data-name=gamepad]").wait_for()
    elif event == "blur":
        page.evaluate("() => dispatchEvent(new Event('blur'))")
    elif event == "visibility":
        for hidden in ("true", "false"):
            page.evaluate(
                f"""() => {{ Object.defineProperty(document, "hidden", {{ get: () => {hidden}, configurable: true }});
                    document.dispatchEvent(new Event("visibilitychange")); }}"""
            )
    elif event == "pause":
        lab.show("paused")
        page.get_by_test_id("resume-button").click()
        running(page, lab)
    elif event == "reading_answered":
        lab.send(alert(1))
        page.get_by_test_id("alert").wait_for()
        page.keyboard.type("582.4")
        page.keyboard.press("Enter")
        lab.wait_submit("alert_answer")
        lab.send({"type": "alert_closed", "alert": 1, "status": "answered", "release_in_s": 0.0})
        page.get_by_test_id("alert").wait_for(state="hidden")
    elif event == "dialog":
        page.get_by_test_id("help-button").click()
        page.get_by_test_id("dialog-back").click()
        page.locator(".drive-scene:focus").wait_for()
    elif event == "reconnection":
        lab.drop()
        page.locator("[data-testid=state-sign][data-state=lost]").wait_for()
        running(page, lab)
    elif event == "sleep":
        page.evaluate(
            "() => { const now = Date.now; const late = now() + 60000; Date.now = () => now() + 60000; return late; }"
        )
    pad.frames(3)


@pytest.mark.parametrize("kind", KINDS)
def test_after_anything_that_may_hide_a_release_a_control_counts_once_it_was_seen_at_rest(
    page: Page, lab: FakeLab, kind: str
) -> None:
    pad = with_known_pad(page, lab, kind)
    _, rest, pushed = KINDS[kind]
    for event in EVENTS:
        move(pad, kind, rest)
        untouched = lab.mark()
        happen(page, lab, pad, event)
        move(pad, kind, rest)
        assert moved(lab, untouched) == [], f"nobody touched it, {event}"
        pressed = lab.mark()
        move(pad, kind, pushed)
        lab.wait_for(lambda m: m["type"] == "input" and m.get("direction") == [0, 0, 1], after=pressed)
        held = lab.mark()
        happen(page, lab, pad, event)
        pad.frames(3)
        assert moved(lab, held) == [], f"held over it, {event}"
        assert page.evaluate("salab.input.direction") is None
    move(pad, kind, rest)
    again = lab.mark()
    move(pad, kind, pushed)
    lab.wait_for(lambda m: m.get("direction") == [0, 0, 1], after=again)


def test_what_is_held_since_before_is_named_until_it_was_let_go(page: Page, lab: FakeLab) -> None:
    pad = with_known_pad(page, lab, "stick")
    move(pad, "stick", 1.0)
    page.get_by_test_id("hands").get_by_text("up", exact=True).wait_for()
    page.evaluate("() => dispatchEvent(new Event('blur'))")
    page.get_by_test_id("hands").get_by_text("let go of it once: up").wait_for()
    move(pad, "stick", 0.0)
    page.get_by_test_id("hands").get_by_text("hands off").wait_for()


def test_of_two_pads_with_one_id_the_one_that_is_used_is_read(page: Page, lab: FakeLab) -> None:
    pad = with_known_pad(page, lab, "button")
    pad.connect(PS3_RAW_ID, "", index=1, axes=4, buttons=17)
    pad.frames(3)
    for slot in (1, 0, 1):
        mark = lab.mark()
        pad.press(2, slot)
        lab.wait_for(lambda m: m.get("direction") == [0, 0, 1], after=mark)
        pad.release(2, slot)
        lab.wait_for(lambda m: m["type"] == "input" and m["direction"] is None, after=mark)
    mark = lab.mark()
    pad.press(2, 0)
    pad.frames(3)
    pad.disconnect(0)
    lab.wait_for(lambda m: m["type"] == "input" and m["direction"] is None, after=mark)
    pad.tap(2, slot=1)
    lab.wait_for(lambda m: m.get("direction") == [0, 0, 1], after=mark)
    assert not [m for m in lab.received if m["type"] == "note" and m["name"].startswith("pad_")], "one is always there"


def test_a_browser_that_stops_showing_gamepads_hands_over_to_the_keyboard(page: Page, lab: FakeLab) -> None:
    pad = with_known_pad(page, lab, "button")
    pad.press(2)
    lab.wait_for(lambda m: m.get("direction") == [0, 0, 1])
    mark = lab.mark()
    page.evaluate("() => { Navigator.prototype.getGamepads = () => { throw new Error('gone'); }; }")
    lab.wait_for(lambda m: m["type"] == "input" and m["direction"] is None, after=mark)
    lab.wait_for(lambda m: m["type"] == "note" and m["name"] == "pad_unplugged", after=mark)
    page.keyboard.down("KeyW")
    lab.wait_for(lambda m: m.get("direction") == [1, 0, 0], after=mark)
