"""Gamepads: what is learned of odd ones, that nothing counts which was not seen at rest, and which of two is read."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pad import PS3_RAW_ID, STANDARD_ID, FakePad
from tests.support.fake_pages import alert, tick

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


@pytest.fixture
def lab() -> Iterator[FakeLab]:
    with FakeLab() as running:
        yield running


# --- what is learned: pure, on made-up pads ------------------------------------------------------------------------

HAND = """
const { Learning } = await import("/static/hands/learning.js");
const { PadReader, directionOf } = await import("/static/hands/mapping.js");
// A hand on a pad polled sixty times a second: `then(values, ms)` moves axes (a0…) and buttons (b0…), and waits.
class Hand {
  constructor(axes, buttons = [0, 0, 0, 0]) {
    this.learning = new Learning(); this.now = { axes: [...axes], buttons: [...buttons] }; this.ms = 0;
    this.seen = [];
  }
  then(values = {}, ms = 300) {
    for (const [name, value] of Object.entries(values))
      (name[0] === "a" ? this.now.axes : this.now.buttons)[Number(name.slice(1))] = value;
    for (const end = this.ms + ms; this.ms < end; this.ms += 16)
      this.learning.feed({ axes: [...this.now.axes], buttons: [...this.now.buttons] }, this.ms);
    return this;
  }
  get blocking() { return this.learning.blocking.join(); }
  get map() { return this.learning.mapping; }
  get step() { return this.learning.step; }
}
const stick = (hand) => hand.then({ a1: -1 }).then({ a1: 0 }).then({ a0: -1 }).then({ a0: 0 });
"""


@pytest.fixture(scope="module")
def pure(browser: Browser) -> Iterator[Page]:
    """A page that loads the modules, and shows nothing."""
    with FakeLab() as running:
        context = browser.new_context()
        page = context.new_page()
        page.goto(running.base_url)
        yield page
        context.close()


def told(page: Page, script: str) -> Any:
    """What a script around the made-up hand returns."""
    return page.evaluate(f"async () => {{ {HAND} {script} }}")


def test_a_plain_stick_gives_both_ways_and_buttons_are_buttons(pure: Page) -> None:
    mapping, step = told(
        pure,
        """const hand = stick(new Hand([0, 0]).then());
        for (const button of ["b0", "b1", "b2", "b3"]) hand.then({ [button]: 1 }).then({ [button]: 0 });
        return [hand.map, hand.step];""",
    )
    assert {name: (one["index"], one["sign"]) for name, one in mapping.items() if one["kind"] == "axis"} == {
        "forward": (1, -1),
        "back": (1, 1),
        "left": (0, -1),
        "right": (0, 1),
    }
    assert [mapping[name] for name in ("up", "down", "close", "open")] == [
        {"kind": "button", "index": index} for index in range(4)
    ]
    assert step == "view"


@pytest.mark.parametrize("first", [-1, 0], ids=["reported", "reads_0_first"])
@pytest.mark.parametrize("pace", ["slow", "sudden"])
def test_a_trigger_from_minus_one_is_learned_with_its_rest(pure: Page, first: int, pace: str) -> None:
    control, both = told(
        pure,
        f"""const hand = stick(new Hand([0, 0, {first}]).then());
        if ("{pace}" === "slow") for (const value of [-0.97, -0.5, 0.1, 0.7]) hand.then({{ a2: value }}, 32);
        hand.then({{ a2: 1 }}, 400).then({{ a2: -1 }}, 700);
        return [hand.map.up, "down" in hand.map];""",
    )
    assert control == {"kind": "axis", "index": 2, "rest": -1, "sign": 1, "span": 2}
    assert not both, "a trigger is no two-way stick"


def test_a_trigger_that_comes_by_0_while_it_is_pulled_was_not_let_go_there(pure: Page) -> None:
    control = told(
        pure,
        """const hand = stick(new Hand([0, 0, 0]).then());
        for (const value of [-0.75, -0.5, -0.25, 0, 0.25, 0.5, 0.75]) hand.then({ a2: value }, 32);
        return hand.then({ a2: 1 }, 100).then({ a2: -1 }, 700).map.up;""",
    )
    assert control == {"kind": "axis", "index": 2, "rest": -1, "sign": 1, "span": 2}


def test_the_other_way_of_a_stick_keeps_the_meaning_it_has(pure: Page) -> None:
    mapping, message = told(
        pure,
        """const push = (hand, name, value) => hand.then({ [name]: value }).then({ [name]: 0 });
        const hand = push(push(new Hand([0, 0]).then(), "b0", 1), "a0", 1);  // forward: a button; back: a stick
        push(push(hand, "b1", 1), "a1", 1);  // left: a button; right: another stick
        push(push(hand, "a1", -1), "b2", 1);  // up: the other way of that stick; down: a button
        return [hand.map, hand.learning.message];""",
    )
    assert {"forward", "back", "left", "right", "up", "down"} <= set(mapping), message
    controls = [(one["kind"], one["index"], one.get("sign")) for one in mapping.values()]
    assert len(set(controls)) == len(controls), mapping


def test_a_trigger_that_reads_0_and_is_held_is_not_learned_upside_down(pure: Page) -> None:
    held, control = told(
        pure,
        """const hand = stick(new Hand([0, 0, 0]).then()).then({ a2: -0.97 }, 32).then({ a2: 1 }, 3000);
        const held = [hand.step, hand.blocking];
        return [held, hand.then({ a2: -1 }, 700).map.up];""",
    )
    assert held == ["up", "Axis 2 is held at 1.0"]
    assert (control["rest"], control["sign"]) == (-1, 1)


@pytest.mark.parametrize("released", [9 / 7, 3.28571, -1.2857])
@pytest.mark.parametrize("first", ["released", "reads_0_first"])
def test_a_cross_on_one_axis_is_learned_by_its_values(pure: Page, first: str, released: float) -> None:
    values, diagonal, off, unreported = told(
        pure,
        f"""const hand = new Hand([{released if first == "released" else 0}]).then();
        for (const value of [-1, 0.14286, 0.71429, -0.42857]) hand.then({{ a0: value }}).then({{ a0: {released} }});
        const read = (value) => {{
          const reader = new PadReader(hand.map, 0.35);
          reader.read({{ axes: [{released}], buttons: [] }});
          return directionOf(reader.read({{ axes: [value], buttons: [] }}));
        }};
        const fresh = new PadReader(hand.map, 0.35);
        const values = Object.fromEntries(Object.entries(hand.map).map(([name, one]) => [name, one.value]));
        return [values, read(-0.71429), read({released}), directionOf(fresh.read({{ axes: [0], buttons: [] }}))];""",
    )
    assert values == {"forward": -1, "back": 0.14286, "left": 0.71429, "right": -0.42857}
    assert diagonal == [1, -1, 0]
    assert off == [0, 0, 0]
    assert unreported == [0, 0, 0], "0 is near the value for back, and was not reported yet"


def test_a_cross_that_reads_0_and_is_pressed_at_its_lowest_value_is_learned(pure: Page) -> None:
    control = told(pure, "return new Hand([0]).then().then({ a0: 0.14286 }).then({ a0: 1.2857 }).map.forward;")
    assert control == {"kind": "hat", "index": 0, "value": 0.14286}


def test_a_trigger_that_idles_half_way_is_learned_from_there(pure: Page) -> None:
    named, after_ignore, by_itself = told(
        pure,
        """const pull = (hand) => hand.then({ b2: 1 }).then({ b2: 0.5 }).map.forward;
        const hand = new Hand([0, 0], [0, 0, 0.5]).then();
        const named = hand.blocking;
        hand.learning.ignore();
        return [named, pull(hand.then()), pull(new Hand([0, 0], [0, 0, 0.5]).then({}, 4500))];""",
    )
    assert named == "Button 2 is held at 0.5"
    assert after_ignore == by_itself == {"kind": "button", "index": 2, "rest": 0.5, "span": 0.5}


def test_a_stick_held_while_waking_is_named_and_never_learned_upside_down(pure: Page) -> None:
    blocked, held_fully, flicked = told(
        pure,
        """const blocked = new Hand([0, 0.8]).then();
        const fully = new Hand([0, -1]).then({}, 600);  // as a trigger rests, so it is believed at first
        fully.then({ a1: 0 }, 700).then({ a1: -1 }).then({ a1: 0 });
        const quick = new Hand([0, -1]).then({}, 600).then({ a1: 0 }, 100).then({ a1: -1 }, 300);
        return [blocked.blocking, fully.map, [quick.map, quick.learning.message]];""",
    )
    assert blocked == "Axis 1 is held at 0.8"
    assert (held_fully["forward"]["sign"], held_fully["forward"]["rest"]) == (-1, 0)
    assert flicked == [{}, "Push it all the way, then let go."]


def test_a_stick_that_comes_back_beside_its_middle_is_learned_and_does_not_drift(pure: Page) -> None:
    learned, zone, on = told(
        pure,
        """const hand = new Hand([0, 0.01]).then().then({ a1: -1 }).then({ a1: -0.27 });
        const { deadZone } = hand.learning;
        const reader = new PadReader(hand.map, deadZone);
        const read = (value) => [...reader.read({ axes: [0, value], buttons: [] })];
        return [hand.map, deadZone, [0.01, -0.27, 0.27, -0.9, -0.27, 0.9, 0.27].map(read)];""",
    )
    assert learned["forward"]["sign"] == -1
    assert 0.35 < zone < 0.5
    assert on == [[], [], [], ["forward"], [], ["back"], []]


def test_what_never_changes_or_never_keeps_still_is_left_out(pure: Page) -> None:
    stuck, moving, learned = told(
        pure,
        """const stuck = new Hand([0, 0], [0, 1]).then({}, 1000);
        const named = stuck.blocking;
        stuck.then({}, 3500).then({ b0: 1 }).then({ b0: 0 });
        const noisy = new Hand([0, 0, 0]);
        const shake = () => { for (let i = 0; i < 60; i++) noisy.then({ a2: (i % 2) - 0.5 }, 32); };
        shake();
        const moving = noisy.blocking;
        noisy.learning.ignore();
        shake();
        noisy.then({ a1: -1 }); shake(); noisy.then({ a1: 0 });
        return [[named, stuck.map.forward], moving, noisy.map.forward.index];""",
    )
    assert stuck == ["Button 1 is held at 1.0", {"kind": "button", "index": 0}]
    assert moving == "Axis 2 moves"
    assert learned == 1


def test_a_trigger_reported_as_axis_and_button_is_its_button_and_a_stick_with_its_click_is_the_stick(
    pure: Page,
) -> None:
    trigger, click = told(
        pure,
        """const both = new Hand([0, 0, -1]).then().then({ b1: 1 }, 32).then({ a2: 1 }).then({ b1: 0, a2: -1 });
        const click = new Hand([0, 0]).then().then({ a1: -0.9 }, 64).then({ b3: 1 });
        click.then({ b3: 0 }, 16).then({ a1: 0 });
        return [both.map.forward, click.map.forward.kind];""",
    )
    assert trigger == {"kind": "button", "index": 1}
    assert click == "axis"


def test_a_first_report_that_comes_while_a_button_is_pressed_is_not_taken_for_it(pure: Page) -> None:
    control = told(pure, "return new Hand([0, 0, 0]).then().then({ b0: 1, a2: -1 }).then({ b0: 0 }, 1200).map.forward;")
    assert control == {"kind": "button", "index": 0}


def test_one_control_means_one_thing_and_what_is_held_for_long_is_named(pure: Page) -> None:
    message, held, went_on = told(
        pure,
        """const hand = new Hand([0, -0.02]).then();
        for (let i = 0; i < 2; i++) hand.then({ b0: 1 }).then({ b0: 0 });
        const message = hand.learning.message;
        hand.then({ a1: 0.8 }, 3000);
        const held = hand.blocking;
        hand.learning.ignore();
        return [message, held, hand.then({ b1: 1 }).then({ b1: 0 }).map.back];""",
    )
    assert "already means “forward”" in message
    assert held == "Axis 1 is held at 0.8"
    assert went_on == {"kind": "button", "index": 1}


def test_a_stick_at_its_edge_does_not_flutter(pure: Page) -> None:
    on = told(
        pure,
        """const reader = new PadReader({ forward: { kind: "axis", index: 0, rest: 0, sign: 1, span: 1 } }, 0.35);
        return [0, 0.36, 0.33, 0.2, 0.33].map((value) => reader.read({ axes: [value], buttons: [] }).size);""",
    )
    assert on == [0, 1, 1, 0, 0]


# --- nothing counts that was not seen at rest ----------------------------------------------------------------------

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
    lab.state = "trial"
    page.goto(lab.participant_url)
    running(page, lab)
    pad.connect(PS3_RAW_ID, "", axes=4, buttons=17)
    pad.tap(16)
    page.locator("[data-testid=device][data-name=gamepad]").wait_for()
    return pad


def running(page: Page, lab: FakeLab) -> None:
    page.get_by_test_id("page-drive").wait_for()
    page.locator("[data-testid=connection][data-state=open]").wait_for()
    lab.send(tick(0))
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()


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


# --- which pad -----------------------------------------------------------------------------------------------------


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
    page.get_by_test_id("calibration-blocking").get_by_text("Button 3 of A lap-top's strange device").wait_for()
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
    page.get_by_test_id("calibration-blocking").get_by_text("Axis 3 is held at 0.8: let go, or press Ignore").wait_for()
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
