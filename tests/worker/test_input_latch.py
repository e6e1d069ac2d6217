"""The hands between two ticks: what counts, once, and what never does."""

from __future__ import annotations

from typing import Literal

import pytest

from app.autonomy.actions import Direction
from app.trial.values import UserInput
from app.worker.input_latch import InputLatch
from app.worker.messages import ControlsState
from tests.support.engine_cases import FORWARD, LEFT

NOW_S = 100.0
FRESH_S, STALE_S = 0.5, 0.5


def latch(*messages: ControlsState, at_s: float = NOW_S) -> InputLatch:
    made = InputLatch(FRESH_S, STALE_S)
    for message in messages:
        made.put(message, at_s)
    return made


def press(
    seq: int, direction: Direction | None = None, button: Literal["open", "close"] | None = None
) -> ControlsState:
    return ControlsState(seq, direction, button)


def beat(seq: int, direction: Direction | None = None) -> ControlsState:
    return ControlsState(seq, direction, beat=True)


def test_nothing_heard_is_no_input() -> None:
    assert latch().take(NOW_S) == UserInput(None, None, 0)
    assert not latch().fresh(NOW_S)


def test_a_direction_held_down_counts_in_every_tick() -> None:
    hands = latch(press(1, FORWARD))
    assert [hands.take(NOW_S + 0.1 * k).direction for k in range(4)] == [FORWARD] * 4


def test_a_press_and_release_between_two_ticks_counts_once() -> None:
    hands = latch(press(1, LEFT), press(2))
    assert hands.take(NOW_S) == UserInput(LEFT, None, 2)
    assert hands.take(NOW_S) == UserInput(None, None, 2)


def test_the_newest_direction_counts() -> None:
    assert latch(press(1, LEFT), press(2, FORWARD)).take(NOW_S).direction == FORWARD
    assert latch(press(1, LEFT), press(2, FORWARD), press(3)).take(NOW_S).direction == FORWARD
    held_then_tapped = latch(press(1, LEFT), press(2), press(3, FORWARD))
    assert [held_then_tapped.take(NOW_S).direction for _ in range(2)] == [FORWARD, FORWARD]


def test_a_release_counts_from_the_next_tick_on() -> None:
    hands = latch(press(1, FORWARD))
    hands.take(NOW_S)
    hands.put(press(2), NOW_S + 0.1)
    assert hands.take(NOW_S + 0.2).direction is None


def test_a_heartbeat_says_again_what_the_last_input_said() -> None:
    hands = latch(press(4, FORWARD), beat(4, FORWARD))
    assert hands.take(NOW_S) == UserInput(FORWARD, None, 4)


def test_a_heartbeat_older_than_the_last_input_is_a_sign_of_life_only() -> None:
    hands = latch(press(5))
    hands.put(beat(4, FORWARD), NOW_S + 0.4)
    assert hands.fresh(NOW_S + 0.8)
    assert hands.take(NOW_S + 0.8) == UserInput(None, None, 5)


def test_an_input_that_comes_late_does_not_undo_a_newer_one() -> None:
    assert latch(press(5), press(3, FORWARD, "close")).take(NOW_S) == UserInput(None, None, 5)


def test_a_heartbeat_brings_back_what_is_held_down_after_a_drop() -> None:
    hands = latch(press(1, FORWARD))
    hands.drop()
    hands.put(beat(1, FORWARD), NOW_S)
    assert hands.take(NOW_S).direction == FORWARD


def test_a_gripper_press_counts_once_and_survives_heartbeats() -> None:
    hands = latch(press(1, None, "close"), beat(1), beat(1))
    assert [hands.take(NOW_S).gripper for _ in range(2)] == ["close", None]


def test_of_two_presses_the_last_counts() -> None:
    assert latch(press(1, None, "close"), press(2, None, "open")).take(NOW_S).gripper == "open"


def test_dropped_presses_never_come_back() -> None:
    hands = latch(press(1, FORWARD, "close"), press(2))
    hands.drop()
    assert hands.take(NOW_S) == UserInput(None, None, 2)


def test_forgetting_presses_keeps_what_is_held_down_now() -> None:
    hands = latch(press(1, LEFT, "close"), press(2, FORWARD))
    hands.forget_presses()
    assert hands.take(NOW_S) == UserInput(FORWARD, None, 2)
    tapped = latch(press(1, LEFT), press(2))
    tapped.forget_presses()
    assert tapped.take(NOW_S).direction is None


@pytest.mark.parametrize(("age_s", "fresh"), [(0.0, True), (0.5, True), (0.51, False), (60.0, False)])
def test_the_page_is_fresh_for_a_while_after_every_message(age_s: float, fresh: bool) -> None:
    assert latch(press(1)).fresh(NOW_S + age_s) is fresh
    assert latch(beat(0)).fresh(NOW_S + age_s) is fresh


def test_what_is_older_than_a_tick_is_neutral_even_if_the_page_may_be_silent_longer() -> None:
    patient = InputLatch(fresh_s=30.0, stale_s=STALE_S)
    patient.put(press(1, FORWARD, "close"), NOW_S)
    assert patient.fresh(NOW_S + 2.0)
    assert patient.take(NOW_S + 2.0) == UserInput(None, None, 1)
    patient.put(beat(1, FORWARD), NOW_S + 2.0)
    assert patient.take(NOW_S + 2.0) == UserInput(FORWARD, None, 1)  # the press stays forgotten
