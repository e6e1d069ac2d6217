"""The ticks of an export, as a stream of what is measured of them: a thousand trials are a third of a gigabyte.

Of a table that is as it was written the Parquet is read, which has the same values in a quarter of the time. Whatever
is not in order there, or looks wrong, is read from the CSV, whose errors name the line and the cell.
"""

from __future__ import annotations

import csv
from collections.abc import Generator, Iterable, Iterator, Sequence, Set
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import lru_cache
from math import isfinite
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from study.analysis.measures import Measures, measure
from study.export.export import read_table, whole_cell
from study.export.parquet import has_parquet, parquet_columns
from study.records import StudyError, TaskRow
from study.text_file import opened_table, table_text

_FIRST_ATTEMPT = "attempt"
"""The column that exports had not before the arm could be freed: everything in them is a first attempt."""
_whole = lru_cache(maxsize=16_384)(whole_cell)  # few numbers stand in many cells
_TOGETHER = 200_000
"""So many ticks are remembered, to find one that is there twice."""
Trial = tuple[str, int]
"""Participant and number."""


class AnalysisError(StudyError):
    """Data that cannot be analysed: what is wrong, and what would mend it."""


class LightTick(NamedTuple):
    """The part of a tick that is measured."""

    participant: str
    trial: int
    task: int
    tick: int
    source: str
    after_pause: int
    belief: str
    entropy: float
    attempt: int = 1


_light_tick = LightTick._make
_PAUSES = LightTick._fields.index("after_pause")


@dataclass(frozen=True)
class Measured:
    """What is measured of all tasks, and how many ticks and pauses passed."""

    measures: Measures
    ticks: int
    pauses: int


def measured(
    folder: Path, tasks: Sequence[TaskRow], kept: Set[Trial], known: Set[Trial], *, as_written: bool = False
) -> Measured:
    """Measure the tasks, from the ticks of the trials `kept` among those `known`, which are all that the export has.

    `as_written`: the files are known to be as they were written. Raises `AnalysisError`, and what `read_table` and
    `measure` raise.
    """
    ticks = Ticks(folder, kept, known)
    if as_written and has_parquet():
        with suppress(ValueError, StudyError), closing(ticks.packed()) as stream:
            return Measured(measure(tasks, stream), ticks.count, ticks.pauses)
        ticks = Ticks(folder, kept, known)
    with closing(ticks.read()) as stream:
        return Measured(measure(tasks, stream), ticks.count, ticks.pauses)


class Ticks:
    """The ticks of the trials `kept`, as a stream in the order of the export; counts them and their pauses."""

    def __init__(self, folder: Path, kept: Set[Trial], known: Set[Trial]) -> None:
        self._folder, self._kept, self._known = folder, kept, known
        self.count = 0
        self.pauses = 0

    def packed(self) -> Generator[LightTick, None, None]:
        """From the Parquet. Raises `ValueError` where anything is not in order; `read` tells what it is."""
        before, last, seen = None, -1, set[Trial]()
        for columns in parquet_columns(self._folder / "ticks.parquet", LightTick._fields, given="task"):
            who, trial, _, tick, _, _, _, entropy, _ = columns
            runs = np.flatnonzero((who[1:] != who[:-1]) | (trial[1:] != trial[:-1])) + 1
            firsts = [0, *runs.tolist()]
            trials: list[Trial] = list(zip(who[firsts], trial[firsts].tolist(), strict=True))
            rises = np.diff(tick, prepend=last) > 0
            for first, of in zip(firsts, trials, strict=True):
                if of != before:
                    rises[first], before = of not in seen and tick[first] >= 0, of
                    seen.add(of)
            last = tick[-1]
            if not rises.all() or not np.isfinite(entropy).all() or not self._known >= set(trials):
                raise ValueError("ticks are not in order")
            is_kept = np.repeat([of in self._kept for of in trials], np.diff([*firsts, len(who)]))
            found = [column[is_kept].tolist() for column in columns]
            self.count += len(found[0])
            self.pauses += sum(found[_PAUSES])
            yield from map(_light_tick, zip(*found, strict=True))

    def read(self) -> Generator[LightTick, None, None]:
        """From the CSV."""
        path = self._folder / "ticks.csv"
        try:
            with opened_table(path, within=self._folder) as raw, table_text(raw) as file:
                lines = csv.reader(file)
                header = next(lines, [])
                missing = [name for name in LightTick._fields if name not in header and name != _FIRST_ATTEMPT]
                if missing:
                    raise AnalysisError(f"{path}: columns missing: {', '.join(missing)}; export the data again")
                found = [name for name in LightTick._fields if name in header]
                cells_of = itemgetter(*map(header.index, found))
                yield from self._of(map(cells_of, filter(None, lines)))  # some editors leave a blank one at the end
        except AnalysisError:
            raise
        except (ValueError, IndexError, OSError, csv.Error) as error:
            read_table(self._folder, "ticks")  # names the line and the cell
            raise AnalysisError(f"{path}: cannot be read: {error}; export the data again") from None

    def _of(self, lines: Iterable[tuple[str, ...]]) -> Iterator[LightTick]:
        """What the cells of lines say, without what is not measured."""
        seen: dict[tuple[str, str], set[str]] = {}
        remembered = 0
        before: tuple[str, str] | None = None
        own, of_trial, is_kept, is_known = "", 0, False, False
        ticks_seen: set[str] = set()
        for participant, trial, task, tick, source, after_pause, belief, entropy, *rest in lines:
            number, value = _whole(tick), float(entropy)
            if number < 0 or not isfinite(value) or "_" in entropy:
                raise ValueError("a tick is negative, or an entropy is none")
            if (participant, trial) != before:
                before = own, _ = participant, trial
                ticks_seen = seen.setdefault(before, set())
                of_trial = _whole(trial)
                is_known, is_kept = (own, of_trial) in self._known, (own, of_trial) in self._kept
            if tick in ticks_seen:
                raise ValueError("a tick is there twice")
            if remembered == _TOGETHER:
                seen, remembered = {before: set()}, 0
                ticks_seen = seen[before]
            ticks_seen.add(tick)
            remembered += 1
            pauses, attempts = _whole(after_pause), _whole(rest[0]) if rest else 1
            if not task:
                continue  # resets have no task and are not measured
            if not is_known:
                raise AnalysisError(
                    f"{self._folder / 'ticks.csv'}: participant {participant}, trial {of_trial} is not in trials.csv; "
                    "export the data again"
                )
            if not is_kept:
                continue
            self.count += 1
            self.pauses += pauses
            yield _light_tick((own, of_trial, _whole(task), number, source, pauses, belief, value, attempts))
