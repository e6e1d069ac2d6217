"""The checker of the faults finds what it is there to find: each promise broken once, in a record made by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from app.wire import Instruction, Submit, Tick
from study.records import utc_text
from tests.faults.checker import Evidence, breaches
from tests.faults.memory import Hands, HeardTick, Memory
from tests.support.study_samples import tick_row

BEGAN_UNIX_S = 1_700_000_000.0
OFFSET_S = 5_000.0 - BEGAN_UNIX_S
"""From the session's time to the page's, which began at 5000."""
UP, LEFT = (0, 0, 1), (0, 1, 0)


def told(tick: int) -> Tick:
    instruction = Instruction(text="", kind="pickup", object=None, object_label=None, bin=None, bin_label=None)
    return Tick(
        tick=tick, seq=tick, status="running", instruction=instruction, done_tasks=0, tasks=2, gripper="open",
        holding=False, blocked=False,
    )  # fmt: skip


def row(tick: int, direction: tuple[int, int, int] | None = None, **values: Any) -> Any:
    x, y, z = direction or (None, None, None)
    started = utc_text(BEGAN_UNIX_S + 0.5 * tick)
    given = {"user_x": x, "user_y": y, "user_z": z, "input_seq": tick, "started_utc": started, "trial": 1}
    return tick_row("P001", tick, **{**given, **values})


def whole() -> tuple[Memory, Evidence]:
    """Ten ticks: up for the first five, then hands off; one call for help."""
    memory = Memory(
        hands=[Hands(0.0, None), Hands(4_999.8, UP), Hands(5_002.4, None)],
        ticks=[HeardTick(5_000.5 + 0.5 * tick + 0.02, 1, 1, told(tick)) for tick in range(10)],
        sent={"a.1": Submit.model_validate({"id": "a.1", "step": "help", "data": {"text": "help me"}})},
        acknowledged={"a.1": 5_001.0},
    )
    rows = tuple(row(tick, UP if tick < 5 else None) for tick in range(10))
    keys = frozenset((1, tick) for tick in range(10))
    return memory, Evidence(rows, (), frozenset({"a.1"}), ("help me",), keys, 0)


def test_a_record_that_holds_everything_breaks_nothing() -> None:
    assert breaches(*whole()) == []


def changed(**values: Any) -> Callable[[Evidence], Evidence]:
    return lambda record: replace(record, **values)


def with_row(tick: int, *args: Any, **values: Any) -> Callable[[Evidence], Evidence]:
    return lambda record: replace(
        record, ticks=tuple(row(tick, *args, **values) if one.tick == tick else one for one in record.ticks)
    )


BROKEN: dict[str, tuple[Callable[[Evidence], Evidence], str, str]] = {
    "a tick that was acknowledged is gone": (
        lambda record: replace(record, ticks=record.ticks[:-1], exported_ticks=None), "lost", "tick 9 of trial 1"),
    "it holds another input": (with_row(4, UP, input_seq=3), "lost", "acknowledged input 4 and holds input 3"),
    "a submission is gone": (changed(submissions=frozenset()), "lost", "submission a.1"),
    "words are gone": (changed(words=()), "lost", "'help me' were acknowledged"),
    "words that nobody said": (changed(words=("help me", "hm")), "lost", "'hm' are stored"),
    "words twice": (changed(words=("help me", "help me")), "doubled", "stored 2 times"),
    "a tick twice": (lambda record: replace(record, ticks=(*record.ticks, row(9))), "doubled", "9 after 9"),
    "a gap": (
        lambda record: replace(record, ticks=(*record.ticks[:5], *record.ticks[6:])), "doubled", "6 after 4"),
    "an answer twice": (changed(answers={(1, 1): 2}), "doubled", "alert 1 of trial 1 was answered 2 times"),
    "a press that was never made": (with_row(7, gripper_input="close"), "doubled", "'close' was pressed 0 times"),
    "a tick that was run again": (
        with_row(6, started_utc=utc_text(BEGAN_UNIX_S + 5.0)), "doubled", "was acknowledged 2.0 s before it ended"),
    "what was held before": (with_row(9, UP), "stale", "tick 9 of trial 1 moved by (0, 0, 1)"),
    "what was never done": (with_row(2, LEFT), "stale", "the hands never had"),
    "a tick that is not exported": (changed(exported_ticks=frozenset({(1, 0)})), "export", "9 ticks are not exported"),
    "an event that is not exported": (changed(exported_events=1), "export", "0 events are stored and 1 exported"),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN)
def test_what_is_broken_is_found(what: str) -> None:
    change, promise, text = BROKEN[what]
    memory, record = whole()
    found = breaches(memory, change(record))
    assert promise in {breach.promise for breach in found}
    assert any(text in breach.text for breach in found), found


def test_a_tick_that_began_late_and_made_up_for_it_moves_no_clock() -> None:
    memory, record = whole()
    late = row(4, UP, started_utc=utc_text(BEGAN_UNIX_S + 2.38), late_ms=380.0)
    assert breaches(memory, replace(record, ticks=(*record.ticks[:4], late, *record.ticks[5:]))) == []
    in_time = replace(late, late_ms=0.0)
    assert breaches(memory, replace(record, ticks=(*record.ticks[:4], in_time, *record.ticks[5:]))) != []


def test_the_clocks_of_page_and_lab_may_be_far_apart_and_change_with_each_start_of_the_lab() -> None:
    memory, record = whole()
    later = tuple(
        replace(one, started_utc=utc_text(BEGAN_UNIX_S + 0.5 * one.tick + (3600.0 if one.tick >= 6 else 0.0)))
        for one in record.ticks
    )
    memory.ticks = [replace(heard, life=2 if heard.tick.tick >= 6 else 1) for heard in memory.ticks]
    assert breaches(memory, replace(record, ticks=later)) == []
