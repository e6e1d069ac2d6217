"""What is read off a lab that runs: its metrics, its processes, and the ticks it has put on disk."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from app.processes import tree_cpu_s
from app.sizing.own_lab import OwnLab
from study.records import utc_text
from study.store import open_store

COMMITS = "salab_commit_seconds_bucket"


def parsed(text: str) -> dict[str, float]:
    """Prometheus' text format as values by name and labels, as they stand: `salab_sessions{state="done"}`."""
    lines = (line.rpartition(" ") for line in text.splitlines() if line and not line.startswith("#"))
    return {name: float(value) for name, _, value in lines}


@dataclass(frozen=True)
class Reading:
    """A moment of a lab: metrics, and the processor time of its own process and of the sessions', in seconds."""

    metrics: Mapping[str, float]
    web_cpu_s: float
    workers_cpu_s: float

    def metric(self, name: str) -> float:
        """A metric without labels; 0 where there is none."""
        return self.metrics.get(name, 0.0)

    def buckets(self, name: str) -> dict[float, float]:
        """A histogram: how many were at most so large, by the bound."""
        begin = f'{name}{{le="'
        named = {key[len(begin) : -2]: value for key, value in self.metrics.items() if key.startswith(begin)}
        return {math.inf if bound == "+Inf" else float(bound): value for bound, value in named.items()}


def read(lab: OwnLab) -> Reading:
    """A lab as it is now. Raises `LabError` when it does not answer."""
    metrics = parsed(lab.get("metrics").decode())
    return Reading(metrics, *tree_cpu_s(lab.pid))


def late_ms(lab: OwnLab, from_unix_s: float, to_unix_s: float) -> list[float]:
    """How late each tick began, of those that began between two times; from the smallest."""
    first, last = utc_text(from_unix_s), utc_text(to_unix_s)
    found = []
    with open_store(lab.data, must_exist=True) as store:
        for stored in store.sessions():
            for table in ("ticks", "practice_ticks"):
                rows = store.rows_of(table, stored.participant)
                found += [
                    row.late_ms for row in rows if row.late_ms is not None and first <= (row.started_utc or "") < last
                ]
    return sorted(found)


def share(values: Sequence[float], of: float) -> float:
    """The value that a share of them does not exceed, of values from the smallest; 0 of none."""
    return values[min(len(values) - 1, int(of * len(values)))] if values else 0.0


def bucket_share(before: Mapping[float, float], after: Mapping[float, float], of: float) -> float:
    """The same of what a histogram took in between two readings: as Prometheus does, by a straight line within the
    bucket; the last finite bound where it lies above."""
    counts = [(bound, after[bound] - before.get(bound, 0.0)) for bound in sorted(after)]
    total = counts[-1][1] if counts else 0.0
    if not total:
        return 0.0
    wanted = of * total
    for (low, below), (high, reached) in pairwise([(0.0, 0.0), *counts]):
        if reached >= wanted:
            return low if math.isinf(high) else low + (high - low) * (wanted - below) / (reached - below)
    return 0.0


def most(readings: Iterable[Reading], name: str) -> int:
    """The largest value that a metric had."""
    return int(max((reading.metric(name) for reading in readings), default=0.0))
