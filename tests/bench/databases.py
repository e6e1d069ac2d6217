"""Ticks that are committed, one at a time and by many sessions at once, in a data folder and on a server."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from study.store import Batch, DataPlace, Store, open_store
from tests.bench.figure import Figure
from tests.support import postgres_server
from tests.support.study_samples import UTC, shipped_study, tick_row

AT_ONCE = (1, 8, 24)
FOR_S = 3.0


def database_figures() -> Iterator[Figure]:
    """Of each kind of database that there is."""
    with tempfile.TemporaryDirectory() as folder:
        yield from _figures("data folder", DataPlace(Path(folder)))
    try:
        server = postgres_server.start()
    except postgres_server.NoPostgres as error:
        yield Figure("PostgreSQL", str(error))
        return
    try:
        with tempfile.TemporaryDirectory() as folder:
            yield from _figures("PostgreSQL", DataPlace(Path(folder), server.url(server.database())))
    finally:
        postgres_server.remove(server)


def _figures(name: str, place: DataPlace) -> Iterator[Figure]:
    with open_store(place, exclusive=True) as store:
        tick = 0
        people = [
            store.create_participant(shipped_study(), seed=1, public_id=str(number), utc=UTC).participant
            for number in range(max(AT_ONCE))
        ]
        for count in AT_ONCE:
            lasted_s: list[float] = []
            cpu_s = _cpu_s()
            while sum(lasted_s) < FOR_S:
                lasted_s.append(_one_commit_s(store, people[:count], tick))
                tick += 1
            ticks = count * len(lasted_s)
            rate, middle_ms = ticks / sum(lasted_s), sorted(lasted_s)[len(lasted_s) // 2] * 1e3
            cpu_us = (_cpu_s() - cpu_s) / ticks * 1e6
            yield Figure(f"{name}: ticks of {count} at once", f"{rate:,.0f}/s")
            yield Figure("  a commit, in the middle; of the lab's CPU a tick", f"{middle_ms:.1f} ms; {cpu_us:.0f} us")


def _one_commit_s(store: Store, people: list[str], tick: int) -> float:
    began_s = time.perf_counter()
    assert store.commit_all([Batch(ticks=(tick_row(who, tick),)) for who in people]) == [True] * len(people)
    return time.perf_counter() - began_s


def _cpu_s() -> float:
    used = os.times()
    return used.user + used.system
