"""What is learned of gamepads, odd ones too: pure, on made-up pads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from tests.support.fake_lab import FakeLab

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


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
    assert held == ["up", "Axis 3 is held at 1.0"]
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
    assert named == "Button 3 is held at 0.5"
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
    assert blocked == "Axis 2 is held at 0.8"
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
    assert stuck == ["Button 2 is held at 1.0", {"kind": "button", "index": 0}]
    assert moving == "Axis 3 moves"
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
    assert held == "Axis 2 is held at 0.8"
    assert went_on == {"kind": "button", "index": 1}


def test_a_stick_at_its_edge_does_not_flutter(pure: Page) -> None:
    on = told(
        pure,
        """const reader = new PadReader({ forward: { kind: "axis", index: 0, rest: 0, sign: 1, span: 1 } }, 0.35);
        return [0, 0.36, 0.33, 0.2, 0.33].map((value) => reader.read({ axes: [value], buttons: [] }).size);""",
    )
    assert on == [0, 1, 1, 0, 0]
