"""Recorded rows held against replayed ones, column by column: the first difference, or none."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from study.records import ColumnInfo, TaskRow, TickRow, TrialRow, columns

BY_THE_CLOCK = ("started_utc", "late_ms")
"""Columns of a tick that say when it was: no replay can have them."""
EXACT_ONLY = ("digest",)
"""Hashes: they have no near."""
OF_THE_SETUP = ("condition", "layout", "placement", "parameters")
"""Columns of a trial that follow from study file and participant."""
OTHER_MACHINE_TOLERANCE = 1e-6
"""How far apart numbers may be on another machine: metres, probabilities, shares."""

_CASTS: Mapping[str, Any] = {"int": int, "float": float, "str": str}


@dataclass(frozen=True)
class Difference:
    """Where record and replay first part. `place` is such as `tick 37`."""

    table: str
    place: str
    column: str
    recorded: str
    replayed: str

    def __str__(self) -> str:
        return f"{self.place}: {self.column} is {self.recorded} in the record and {self.replayed} when replayed"


@dataclass(frozen=True)
class Measure:
    """How rows are compared: `tolerance` 0 asks for the very same bits; `lacking` columns were never recorded."""

    tolerance: float = 0.0
    lacking: frozenset[str] = frozenset()

    def columns(self, table: str) -> tuple[ColumnInfo, ...]:
        """The columns that are compared; hashes only where nothing may differ at all."""
        if table == "trials":
            return tuple(info for info in columns(table) if info.name in OF_THE_SETUP)
        passed_over = {*BY_THE_CLOCK, *self.lacking, *(EXACT_ONLY if self.tolerance else ())}
        return tuple(info for info in columns(table) if info.name not in passed_over)


class RowComparison:
    """Compares rows of one table."""

    def __init__(self, table: str, measure: Measure) -> None:
        self._table = table
        self._tolerance = measure.tolerance
        self._columns = measure.columns(table)

    def difference(self, recorded: Any, replayed: Any, place: str) -> Difference | None:
        """The first column, in the table's order, in which two rows differ."""
        for info in self._columns:
            before, after = getattr(recorded, info.name), _as_exported(info, getattr(replayed, info.name))
            if not self._same(info, before, after):
                return Difference(self._table, place, info.name, *_told(info, before, after))
        return None

    def _same(self, info: ColumnInfo, before: Any, after: Any) -> bool:
        if before is None or after is None:
            return before is after
        if info.type == "float":
            return _near(before, after, self._tolerance)
        if info.json and self._tolerance and before != after:
            try:
                return _alike(json.loads(before), json.loads(after), self._tolerance)
            except ValueError:
                return False
        return bool(before == after)


def tick_differences(
    recorded: Sequence[TickRow], replayed: Iterator[TickRow], measure: Measure
) -> Iterator[Difference | None]:
    """What each tick's first difference is, in order; ends with a difference where one has more ticks."""
    comparison = RowComparison("ticks", measure)
    for number, (before, after) in enumerate(zip_longest(recorded, replayed)):
        place = f"tick {number}"
        if before is None:
            return
        if before.tick != number:
            yield Difference("ticks", place, "tick", str(before.tick), str(number))
        elif after is None:
            yield Difference("ticks", place, "tick", str(number), "no tick: the trial is over")
        else:
            yield comparison.difference(before, after, place)


def task_difference(recorded: Sequence[TaskRow], replayed: Sequence[TaskRow], measure: Measure) -> Difference | None:
    """The first difference of two trials' tasks, in the order of their numbers."""
    comparison = RowComparison("tasks", measure)
    before, after = ({row.task: row for row in rows} for rows in (recorded, replayed))
    for task in sorted({*before, *after}):
        place = f"task {task}"
        if task not in before or task not in after:
            here, there = ("a row" if task in rows else "no row" for rows in (before, after))
            return Difference("tasks", place, "task", here, there)
        found = comparison.difference(before[task], after[task], place)
        if found is not None:
            return found
    return None


def trial_difference(recorded: TrialRow, replayed: TrialRow, measure: Measure) -> Difference | None:
    """The first difference of what a trial was set up with."""
    return RowComparison("trials", measure).difference(recorded, replayed, f"trial {recorded.trial}")


def _as_exported(info: ColumnInfo, value: Any) -> Any:
    """A value as an export has it: plain numbers, whatever made them."""
    return None if value is None else _CASTS[info.type](value)


def _near(before: float, after: float, tolerance: float) -> bool:
    if not tolerance:
        return before.hex() == after.hex()
    return abs(before - after) <= tolerance or (math.isnan(before) and math.isnan(after))


def _alike(before: Any, after: Any, tolerance: float) -> bool:
    """Whether two values of JSON are the same but for numbers that are near."""
    if isinstance(before, dict) and isinstance(after, dict):
        return before.keys() == after.keys() and all(_alike(before[key], after[key], tolerance) for key in before)
    if isinstance(before, list) and isinstance(after, list):
        return len(before) == len(after) and all(map(_alike, before, after, [tolerance] * len(before)))
    if isinstance(before, float) or isinstance(after, float):
        numbers = isinstance(before, (int, float)) and isinstance(after, (int, float))
        return numbers and _near(float(before), float(after), tolerance)
    return bool(before == after)


def _told(info: ColumnInfo, before: Any, after: Any) -> tuple[str, str]:
    """Both values for a reader; of long JSON, what differs."""
    if info.json and before is not None and after is not None:
        try:
            parts = _first_unlike(json.loads(before), json.loads(after))
        except ValueError:
            parts = (before, after)
        return _short(parts[0]), _short(parts[1])
    return _short(before), _short(after)


def _first_unlike(before: Any, after: Any) -> tuple[Any, Any]:
    if isinstance(before, dict) and isinstance(after, dict):
        for key in [*before, *(key for key in after if key not in before)]:
            if before.get(key) != after.get(key):
                here, there = ({key: value[key]} if key in value else {} for value in (before, after))
                return here, there
    return before, after


def _short(value: Any) -> str:
    text = "blank" if value is None else value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 120 else text[:119] + "…"
