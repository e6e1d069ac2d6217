"""Who fits the study: what is asked for, what is found wanting, and what is said about it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from app.session.interfaces import Role
from app.session.round_trips import LOST_AFTER_S, RoundTrips
from app.wire import Message, Ping, Pong
from study.definition.sections import Eligibility
from study.flow.eligibility import (
    CHECKS,
    LEAST_TONES,
    MOST_TONES,
    Device,
    browser_of,
    checks_of,
    shortcomings,
    tones_of,
)
from study.flow.flow import FLOW
from study.flow.page import Refused, StepContext
from study.flow.protocol import Event
from tests.support.study_samples import shipped_study

ALL = Eligibility(
    gamepad="required",
    sound=True,
    webgl=True,
    keyboard_or_mouse=True,
    max_round_trip_ms=150.0,
    min_window_width_px=1000,
    min_window_height_px=600,
    browsers=("chrome", "firefox"),
)
TONES = (3, 5, 2)
FIREFOX = "Mozilla/5.0 (X11; Linux x86_64; rv:128.0) Gecko/20100101 Firefox/128.0"
FIT = Device(
    user_agent=FIREFOX,
    has_touch_only=False,
    width_px=1000,
    height_px=600,
    has_webgl=True,
    is_secure=True,
    pad_id="a pad",
    tones=5,
    tone_try=1,
)


def lacking(rules: Eligibility = ALL, round_trip_ms: float | None = 150.0, **changes: Any) -> dict[str, str]:
    found = shortcomings(rules, replace(FIT, **changes), round_trip_ms, TONES)
    return {one.check: one.text for one in found}


def test_a_study_that_asks_nothing_checks_nothing() -> None:
    assert checks_of(Eligibility()) == ()
    assert shortcomings(Eligibility(), Device(), None, TONES) == ()


def test_whoever_has_all_that_is_asked_for_passes() -> None:
    assert checks_of(ALL) == CHECKS
    assert lacking() == {}


@pytest.mark.parametrize(
    ("side", "says"),
    [
        ({"min_window_height_px": 0}, "999 pixels wide, and the study needs 1000. Enlarge"),
        ({"min_window_width_px": 0}, "599 pixels high, and the study needs 600. Enlarge"),
    ],
)
def test_a_window_is_held_to_the_side_that_is_asked_for(side: dict[str, int], says: str) -> None:
    assert says in lacking(ALL.model_copy(update=side), width_px=999, height_px=599)["window"]


@pytest.mark.parametrize(
    ("changes", "check", "says"),
    [
        ({"user_agent": "Mozilla/5.0 Chrome/126.0 Safari/537.36 Edg/126.0"}, "browser", "This is Edge."),
        ({"user_agent": "curl/8"}, "browser", "open the same link in Chrome or Firefox"),
        ({"has_touch_only": True}, "touch", "a computer with a keyboard"),
        ({"has_touch_only": None}, "touch", "touch screen"),
        ({"width_px": 999}, "window", "999 × 600 pixels large, and the study needs 1000 × 600"),
        ({"height_px": 599}, "window", "Enlarge the window"),
        ({"has_webgl": False}, "webgl", "hardware acceleration"),
        ({"round_trip_ms": 150.1}, "round_trip", "at most 150 ms"),
        ({"round_trip_ms": None}, "round_trip", "could not be measured"),
        ({"pad_id": None}, "gamepad", "press any of its buttons"),
        ({"pad_id": None, "is_secure": False}, "gamepad", "not loaded over HTTPS"),
        ({"tones": None}, "sound", "Play the tones"),
        ({"tones": 3}, "sound", "not the number of tones"),  # it would have been, in the try before
    ],
)
def test_what_is_missing_is_said_with_what_would_mend_it(changes: dict[str, Any], check: str, says: str) -> None:
    found = lacking(**changes)
    assert list(found) == [check]
    assert says in found[check]


def test_everything_missing_is_said_at_once() -> None:
    assert [one.check for one in shortcomings(ALL, Device(), None, TONES)] == list(CHECKS)


def test_a_gamepad_that_is_only_preferred_is_asked_for_and_never_missed() -> None:
    rules = Eligibility(gamepad="preferred")
    assert checks_of(rules) == ("gamepad",)
    assert lacking(rules, pad_id=None) == {}


def test_tones_differ_between_tries_and_people_and_are_the_same_after_a_restart() -> None:
    tones = tones_of("4f2a")
    assert tones == tones_of("4f2a")
    assert set(tones) <= set(range(LEAST_TONES, MOST_TONES + 1))
    assert len(set(tones)) > 1
    assert len({tones_of(str(number))[0] for number in range(50)}) == MOST_TONES - LEAST_TONES + 1


@pytest.mark.parametrize(
    ("user_agent", "browser"),
    [
        (FIREFOX, "firefox"),
        ("Mozilla/5.0 AppleWebKit/537.36 (KHTML, like Gecko) Chrome/126.0.0.0 Safari/537.36", "chrome"),
        ("Mozilla/5.0 AppleWebKit/537.36 Chrome/126.0.0.0 Safari/537.36 OPR/112.0", "opera"),
        ("Mozilla/5.0 (Macintosh) AppleWebKit/605.1.15 (KHTML, like Gecko) Version/17.5 Safari/605.1.15", "safari"),
        ("Mozilla/5.0 (iPhone) AppleWebKit/605.1.15 CriOS/126.0 Mobile/15E148 Safari/604.1", "chrome"),
        ("", None),
    ],
)
def test_browsers_are_told_apart_though_they_claim_to_be_each_other(user_agent: str, browser: str | None) -> None:
    assert browser_of(user_agent) == browser


# ---- the steps of the page


def take(name: str, data: dict[str, Any], rules: Eligibility, state: Any = "eligibility", **known: Any) -> Any:
    study = shipped_study().model_copy(update={"eligibility": rules})
    session = replace(FLOW.new_session("P001", 3), state=state)
    return FLOW.steps[name](StepContext(study, session, "balanced", "", public_id="4f2a", **known), data)


def test_what_is_recorded_of_a_device_is_what_was_asked_for_and_does_not_tell_it_from_its_like() -> None:
    rules = Eligibility(browsers=("firefox",), max_round_trip_ms=100.0)
    passed = take("eligibility", {"user_agent": FIREFOX, "width_px": 1001}, rules, round_trip_ms=12.34)
    assert passed.event == Event("eligible")
    assert passed.log == {"browser": "firefox", "round_trip_ms": 12.3}
    with pytest.raises(Refused) as refused:
        take("eligibility", {"user_agent": FIREFOX}, rules, round_trip_ms=101.0)
    assert [check for check, _ in refused.value.problems] == ["round_trip"]
    log = {"browser": "firefox", "round_trip_ms": 101.0, "lacking": ["round_trip"]}
    assert refused.value.log == ("device_not_fit", log)


def test_only_somebody_whose_device_was_found_wanting_leaves_by_it() -> None:
    with pytest.raises(Refused, match="has not been checked"):
        take("leave", {}, ALL)
    assert take("leave", {}, ALL, lacking=("webgl", "sound")).event == Event("screened_out", '["webgl", "sound"]')


@pytest.mark.parametrize(
    ("rules", "data", "field"),
    [
        (Eligibility(gamepad="required"), {"device": "keyboard", "sound": True}, "data.device"),
        (Eligibility(sound=True), {"device": "keyboard", "sound": False}, "data.sound"),
    ],
)
def test_the_set_up_holds_to_what_the_check_asked_for(rules: Eligibility, data: dict[str, Any], field: str) -> None:
    with pytest.raises(Refused) as refused:
        take("setup", data, rules, "setup")
    assert [name for name, _ in refused.value.problems] == [field]
    fit = {**data, "device": "gamepad", "sound": True}
    assert take("setup", fit, rules, "setup").event == Event("setup_done")


# ---- round trips


class Page:
    """A page that answers when told to."""

    role: Role = "participant"
    name = "here"
    telemetry = False

    def __init__(self) -> None:
        self.pings: list[Ping] = []

    @property
    def waiting(self) -> int:
        return 0

    def deliver(self, message: Message) -> None:
        assert isinstance(message, Ping)
        self.pings.append(message)

    def end(self) -> None:
        """Nothing to close."""


def test_the_median_of_round_trips_is_by_the_labs_clock() -> None:
    page, now = Page(), [0.0]
    trips = RoundTrips(lambda: now[0])
    trips.measure(page, 3)
    for took_s in (0.04, 0.9, 0.05):
        assert trips.median_ms is None
        now[0] += took_s
        found = trips.answered(page, Pong(n=page.pings[-1].n))
        assert found == pytest.approx(1000 * took_s)
    assert trips.median_ms == pytest.approx(50.0)
    assert [ping.left for ping in page.pings] == [2, 1, 0]


def test_an_answer_counts_once_and_a_lost_ping_is_sent_again() -> None:
    page, now = Page(), [0.0]
    trips = RoundTrips(lambda: now[0])

    def answer(ping: Ping) -> float | None:
        return trips.answered(page, Pong(n=ping.n))

    trips.measure(page, 2)
    trips.probe(page)
    assert len(page.pings) == 1  # the measurement's own ping is on its way
    now[0] = LOST_AFTER_S
    trips.probe(page)
    assert [ping.left for ping in page.pings] == [1, 1]
    assert answer(page.pings[0]) is None
    now[0] += 0.02
    assert answer(page.pings[1]) == pytest.approx(20.0)
    assert answer(page.pings[1]) is None
    assert answer(page.pings[2]) is not None
    assert trips.median_ms is not None
    trips.probe(page)
    assert page.pings[-1].left is None
    assert answer(page.pings[-1]) is not None and answer(page.pings[-1]) is None
