"""The three promises, held against what one page did and heard, what is stored, and what an export holds.

1. acknowledged = stored: every tick and every submission that the lab acknowledged is in the database as it was said,
   and everything stored is in the export;
2. nothing doubled: ticks are numbered without a gap, a press moves the fingers once, words and answers are kept once;
3. nothing stale moved the robot: every direction in the record is one that the hands really had a moment before its
   tick began.

One function, `breaches`, for every fault.
"""

from __future__ import annotations

import bisect
import itertools
import statistics
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from sim.interface import TICK_S
from study.records import EventRow, TickRow, unix_s
from tests.faults.memory import HeardTick, Memory, submitted_words
from tests.support.wire_client import Direction

STALE_S = 2.0 * TICK_S
"""A press between two ticks counts for the next (one tick); a page that was last heard of more than a tick ago counts
for nothing (another)."""
CLOCKS_S = 0.15
"""How far the times of page and lab can be apart: they are matched over the quickest tick that was ever told."""

TOO_EARLY_S = 0.4
"""A tick that was told so long before the others of its life was not the one that is stored."""

Promise = Literal["lost", "doubled", "stale", "export"]


@dataclass(frozen=True)
class Breach:
    """One promise that was not kept."""

    promise: Promise
    text: str


@dataclass(frozen=True)
class Evidence:
    """What the record of one participant holds; `words` is what calls for help said, in the order of the record."""

    ticks: tuple[TickRow, ...]
    events: tuple[EventRow, ...]
    submissions: frozenset[str]
    words: tuple[str, ...]
    exported_ticks: frozenset[tuple[int, int]] | None = None
    """(trial, tick); None where nothing could be exported, which the fault's row says."""
    exported_events: int | None = None
    events_before: int = 2**31
    """How many were stored before the export was asked for; those that come meanwhile may be in it or not."""
    answers: Mapping[tuple[int, int], int] = field(default_factory=dict)
    """How often each (trial, alert) was answered."""


def breaches(memory: Memory, record: Evidence, way_s: float = 0.0) -> list[Breach]:
    """Every promise that was not kept. `way_s` is how long what the page says may take to the lab, in seconds."""
    return [
        *_lost(memory, record),
        *_doubled(memory, record),
        *_run_again(memory, record),
        *_stale(memory, record, way_s),
        *_not_exported(record),
    ]


# ---- acknowledged = stored ------------------------------------------------------------------------------------------


def _lost(memory: Memory, record: Evidence) -> Iterator[Breach]:
    stored = {(row.trial, row.tick): row for row in record.ticks}
    for heard in memory.ticks:
        row = stored.get((heard.trial, heard.tick.tick))
        if row is None:
            yield Breach("lost", f"tick {heard.tick.tick} of trial {heard.trial} was acknowledged and is not stored")
        elif row.input_seq is not None and row.input_seq != heard.tick.seq:
            yield Breach("lost", f"tick {row.tick} acknowledged input {heard.tick.seq} and holds input {row.input_seq}")
    for identifier in memory.acknowledged:
        if identifier not in record.submissions:
            yield Breach("lost", f"submission {identifier} was acknowledged and is not stored")
    kept, said = Counter(record.words), submitted_words(memory)
    for identifier, words in said.items():
        if identifier in memory.acknowledged and not kept[words]:
            yield Breach("lost", f"the words {words!r} were acknowledged and are not stored")
    for stranger in kept.keys() - set(said.values()):
        yield Breach("lost", f"the words {stranger!r} are stored, and nobody said them")


# ---- nothing doubled ------------------------------------------------------------------------------------------------


def _doubled(memory: Memory, record: Evidence) -> Iterator[Breach]:
    for trial in sorted({row.trial for row in record.ticks}):
        numbers = [row.tick for row in record.ticks if row.trial == trial]
        if numbers != list(range(len(numbers))):
            yield Breach("doubled", f"the ticks of trial {trial} are not 0 to {len(numbers) - 1}: {_odd(numbers)}")
    told = Counter((heard.trial, heard.tick.tick) for heard in memory.ticks)
    for (trial, tick), times in told.items():
        if times > 1:
            yield Breach("doubled", f"tick {tick} of trial {trial} was told {times} times")
    for words, times in Counter(record.words).items():
        if times > 1:
            yield Breach("doubled", f"the words {words!r} are stored {times} times")
    for (trial, alert), times in record.answers.items():
        if times > 1:
            yield Breach("doubled", f"alert {alert} of trial {trial} was answered {times} times")
    pressed = Counter(row.input_seq for row in record.ticks if row.gripper_input is not None)
    for seq, times in pressed.items():
        if seq is not None and times > 1:
            yield Breach("doubled", f"the press of input {seq} moved the fingers in {times} ticks")
    presses = Counter(memory.presses.values())
    for gripper, times in Counter(row.gripper_input for row in record.ticks if row.gripper_input is not None).items():
        if times > presses[gripper]:
            yield Breach("doubled", f"{gripper!r} was pressed {presses[gripper]} times and stands in {times} ticks")


def _odd(numbers: Sequence[int]) -> str:
    """Where the numbers are not the next."""
    steps = itertools.pairwise([-1, *numbers])
    return ", ".join([f"{here} after {before}" for before, here in steps if here != before + 1][:5])


# ---- nothing stale --------------------------------------------------------------------------------------------------


def _stale(memory: Memory, record: Evidence, way_s: float) -> Iterator[Breach]:
    clocks = _clocks(memory.ticks, record.ticks)
    lives = _lives(memory.ticks)
    times_s = [hands.at_s for hands in memory.hands]
    for row in record.ticks:
        direction = _direction(row)
        life = lives.get((row.trial, row.tick))
        if direction is None or row.started_utc is None or life not in clocks:
            continue
        began_s = unix_s(row.started_utc) + clocks[life]
        oldest_s, newest_s = began_s - STALE_S - way_s - CLOCKS_S, began_s + CLOCKS_S
        first = max(0, bisect.bisect_right(times_s, oldest_s) - 1)
        had = {hands.direction for hands in memory.hands[first : bisect.bisect_right(times_s, newest_s)]}
        if direction not in had:
            last_s = max((hands.at_s for hands in memory.hands if hands.direction == direction), default=None)
            ago = f"last began {began_s - last_s:.1f} s before" if last_s is not None else "never had"
            yield Breach("stale", f"tick {row.tick} of trial {row.trial} moved by {direction}, which the hands {ago}")


def _direction(row: TickRow) -> Direction | None:
    if row.user_x is None or row.user_y is None or row.user_z is None:
        return None
    return (row.user_x, row.user_y, row.user_z)


def _lives(heard: Sequence[HeardTick]) -> dict[tuple[int, int], int]:
    """In which life of the lab each tick was run: one that nobody was told of, in that of the one told before it."""
    told = {(one.trial, one.tick.tick): one.life for one in heard}
    lives: dict[tuple[int, int], int] = {}
    for trial in {trial for trial, _ in told}:
        life: int | None = None
        for tick in range(max(tick for at, tick in told if at == trial) + 50):
            life = told.get((trial, tick), life)
            if life is not None:
                lives[trial, tick] = life
    return lives


def _clocks(heard: Sequence[HeardTick], rows: Sequence[TickRow]) -> dict[int, float]:
    """What makes this machine's monotonic time of the session's time, in each life of the lab, in seconds: from the
    tick that was told the quickest, of those that can have been."""
    offsets_s: dict[int, list[float]] = {}
    for one, ended_s in _ended(heard, rows):
        offsets_s.setdefault(one.life, []).append(one.at_s - ended_s)
    return {
        life: min(one for one in found if one > statistics.median(found) - TOO_EARLY_S)
        for life, found in offsets_s.items()
    }


def _ended(heard: Sequence[HeardTick], rows: Sequence[TickRow]) -> Iterator[tuple[HeardTick, float]]:
    """The ticks that were told, and when they ended by the session's time: one that began late makes up for it."""
    ended = {
        (row.trial, row.tick): unix_s(row.started_utc) - (row.late_ms or 0.0) / 1e3 + TICK_S
        for row in rows
        if row.started_utc is not None
    }
    for one in heard:
        ended_s = ended.get((one.trial, one.tick.tick))
        if ended_s is not None:
            yield one, ended_s


def _run_again(memory: Memory, record: Evidence) -> Iterator[Breach]:
    """Ticks that were told before they ended: what is stored is of another run than what was acknowledged."""
    clocks = _clocks(memory.ticks, record.ticks)
    for one, ended_s in _ended(memory.ticks, record.ticks):
        early_s = ended_s + clocks[one.life] - one.at_s
        if early_s > TOO_EARLY_S / 2:
            yield Breach(
                "doubled", f"tick {one.tick.tick} of trial {one.trial} was acknowledged {early_s:.1f} s before it ended"
            )


# ---- the export -----------------------------------------------------------------------------------------------------


def _not_exported(record: Evidence) -> Iterator[Breach]:
    if record.exported_ticks is not None:
        stored = {(row.trial, row.tick) for row in record.ticks}
        exported = record.exported_ticks
        for what, missing in (("not exported", stored - exported), ("not stored", exported - stored)):
            if missing:
                yield Breach("export", f"{len(missing)} ticks are {what}, the first {min(missing)}")
    if record.exported_events is not None and record.exported_events not in range(
        min(record.events_before, len(record.events)), len(record.events) + 1
    ):
        yield Breach("export", f"{len(record.events)} events are stored and {record.exported_events} exported")


def counts(found: Sequence[Breach]) -> dict[Promise, int]:
    """How many of each kind."""
    of: Any = Counter(breach.promise for breach in found)
    return {promise: of[promise] for promise in ("lost", "doubled", "stale", "export")}
