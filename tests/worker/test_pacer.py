"""Deadlines: on an absolute grid, each at most once, never in a burst."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from app.worker.messages import Ticked
from app.worker.pacer import Deadline, Pacer
from study.records import OVERRUN_MS

PERIOD_S = 0.5


def started(at_s: float = 10.0) -> Pacer:
    pacer = Pacer(PERIOD_S)
    pacer.start(at_s)
    return pacer


def test_nothing_is_due_before_the_start_and_after_a_stop() -> None:
    pacer = Pacer(PERIOD_S)
    assert not pacer.running
    assert (pacer.take(10.0), pacer.wait_s(10.0)) == (None, math.inf)
    pacer.start(10.0)
    pacer.stop()
    assert (pacer.take(99.0), pacer.wait_s(99.0), pacer.running) == (None, math.inf, False)


def test_the_first_deadline_is_the_start() -> None:
    pacer = started()
    assert pacer.running
    assert pacer.wait_s(10.0) == 0.0
    assert pacer.take(10.0) == Deadline(10.0, 0.0, 0)
    assert pacer.take(10.0) is None
    assert pacer.wait_s(10.1) == pytest.approx(0.4)


def test_a_start_that_lies_ahead_is_waited_for() -> None:
    pacer = started(10.3)
    assert pacer.wait_s(10.0) == pytest.approx(0.3)
    assert pacer.take(10.2) is None


def test_a_late_tick_does_not_move_the_grid() -> None:
    pacer = started()
    taken = [pacer.take(now_s) for now_s in (10.0, 10.62, 11.0, 11.75)]
    assert [deadline and deadline.due_s for deadline in taken] == [10.0, 10.5, 11.0, 11.5]
    assert [deadline and deadline.late_s for deadline in taken] == pytest.approx([0.0, 0.12, 0.0, 0.25])


def test_deadlines_that_have_gone_by_are_counted_and_not_made_up_for() -> None:
    pacer = started()
    pacer.take(10.0)
    late = pacer.take(12.1)
    assert late is not None
    assert (late.due_s, late.missed) == (12.0, 3)
    assert pacer.take(12.1) is None
    assert pacer.wait_s(12.1) == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("late_ms", "missed", "overrun"),
    [(0.0, 0, False), (50.0, 0, False), (51.0, 0, True), (0.0, 1, True), (None, 0, False)],
)
def test_fifty_milliseconds_late_or_a_missed_deadline_is_an_overrun(
    late_ms: float | None, missed: int, overrun: bool
) -> None:
    assert OVERRUN_MS == 50.0
    nothing: Any = None
    ticked = Ticked(nothing, nothing, seq=0, started_unix_s=0.0, late_ms=late_ms, missed=missed)
    assert ticked.overrun is overrun


@given(
    start_s=st.floats(0.0, 1e6),
    delays_s=st.lists(st.floats(0.0, 3.0), min_size=1, max_size=60),
)
@example(start_s=1.0430987315109754, delays_s=[3.0])  # the quotient of the delay rounds down
def test_however_late_the_loop_comes_every_deadline_is_on_the_grid_and_taken_at_most_once(
    start_s: float, delays_s: list[float]
) -> None:
    pacer = started(start_s)
    now_s, taken, missed = start_s, [], 0
    for delay_s in delays_s:
        now_s += delay_s
        due_in_s = pacer.wait_s(now_s)
        deadline = pacer.take(now_s)
        assert (deadline is not None) == (due_in_s == 0.0)
        if deadline is not None:
            assert pacer.take(now_s) is None  # never two at once
            assert deadline.late_s == now_s - deadline.due_s
            assert 0.0 <= deadline.late_s <= PERIOD_S + 1e-6
            taken.append(deadline.due_s)
            missed += deadline.missed
            # every grid point up to now was either taken or counted as missed
            assert len(taken) + missed == round((deadline.due_s - start_s) / PERIOD_S) + 1
    steps = [(due_s - start_s) / PERIOD_S for due_s in taken]
    assert steps == pytest.approx([round(step) for step in steps], abs=1e-6)
    assert len({round(step) for step in steps}) == len(steps)
