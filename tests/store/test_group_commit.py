"""Batches that wait are committed together: each whole or not at all, in order, answered when it is on disk."""

from __future__ import annotations

import asyncio
import os
import signal
import sqlite3
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sql

from study.store import AsyncStore, Batch, DataPlace, Store, StoreError, Submission, open_store, rows, verify_data
from tests.support.data_places import found_in, locked
from tests.support.study_samples import UTC, event_row, shipped_study, tick_row

REPOSITORY = Path(__file__).resolve().parents[2]
PEOPLE = ("P001", "P002", "P003")
WITHIN_S = 20.0
on_files = pytest.mark.parametrize("place", ["sqlite"], indirect=True)
"""What a disk does to SQLite's file."""


@pytest.fixture
async def store(place: DataPlace) -> AsyncIterator[AsyncStore]:
    opened = open_store(place, exclusive=True)
    for number in range(len(PEOPLE)):
        opened.create_participant(shipped_study(), seed=number, public_id=f"public{number}", utc=UTC)
    served = AsyncStore(opened)
    yield served
    await served.close()
    assert verify_data(place).findings == ()  # whatever was written, the chains are right


def tick(who: str, number: int) -> Batch:
    return Batch(ticks=(tick_row(who, tick=number),), events=(event_row(participant=who, kind=f"of {number}"),))


async def together(store: AsyncStore, *batches: Batch) -> list[Any]:
    """What came of batches that waited while something else was being written."""
    go_on = threading.Event()
    before = asyncio.ensure_future(store.run(lambda opened: go_on.wait(WITHIN_S)))
    asked = [asyncio.ensure_future(store.commit(batch)) for batch in batches]
    await asyncio.sleep(0)  # let each hand its batch over
    go_on.set()
    found = await asyncio.wait_for(asyncio.gather(*asked, return_exceptions=True), WITHIN_S)
    await before
    return found


def ticks_in(place: DataPlace) -> list[tuple[Any, ...]]:
    """In the order they were written."""
    order = "ROWID" if place.url is None else "CTID"
    return found_in(place, f"SELECT participant, tick FROM ticks ORDER BY {order}")


async def test_what_several_sessions_write_meanwhile_is_one_transaction(store: AsyncStore, place: DataPlace) -> None:
    asked = [(who, number) for number in range(4) for who in PEOPLE]
    before = store.store.writes
    assert await together(store, *(tick(who, number) for who, number in asked)) == [True] * len(asked)
    assert store.store.writes == before + 1
    assert ticks_in(place) == asked
    for who in PEOPLE:
        assert [row.kind for row in store.store.rows_of("events", who)] == [f"of {number}" for number in range(4)]


async def test_other_work_stays_in_its_place_among_batches(store: AsyncStore) -> None:
    go_on = threading.Event()
    first = asyncio.ensure_future(store.run(lambda opened: go_on.wait(WITHIN_S)))
    earlier = asyncio.ensure_future(store.commit(tick("P001", 0)))
    look = asyncio.ensure_future(store.run(lambda opened: len(opened.rows_of("ticks", "P001"))))
    later = asyncio.ensure_future(store.commit(tick("P001", 1)))
    await asyncio.sleep(0)
    go_on.set()
    assert await look == 1
    await asyncio.gather(first, earlier, later)


async def test_what_is_wrong_with_one_harms_no_other(store: AsyncStore, place: DataPlace) -> None:
    await store.commit(tick("P001", 0))
    sent = Batch(submission=Submission("P003", "tab.1"), events=(event_row(participant="P003", kind="sent"),))
    wrong: Any = event_row(participant="P002")
    found = await together(
        store,
        tick("P001", 1),
        tick("P001", 0),  # is there
        sent,
        tick("nobody", 0),
        sent,  # a resend
        Batch(ticks=(tick_row("P002", tick=0), wrong)),  # half of it could be written
        tick("P002", 5),
    )
    assert [one if isinstance(one, bool) else type(one) for one in found] == [
        True, StoreError, True, StoreError, False, StoreError, True,
    ]  # fmt: skip
    assert (
        "UNIQUE" in str(found[1]).upper()
        and "FOREIGN KEY" in str(found[3]).upper()
        and "takes TickRow" in str(found[5])
    )
    assert ticks_in(place) == [("P001", 0), ("P001", 1), ("P002", 5)]
    assert [row.kind for row in store.store.rows_of("events", "P003")] == ["sent"]
    assert store.trouble is None


@on_files
async def test_where_sqlite_undoes_the_whole_transaction_only_the_one_that_caused_it_is_refused(
    store: AsyncStore, place: DataPlace, monkeypatch: pytest.MonkeyPatch
) -> None:
    add = rows.add

    def runs_out(connection: sql.Connection, table: str, given: Any) -> None:
        add(connection, table, given)
        if table == "events" and any(row.kind == "of 7" for row in given):
            driver: Any = connection.connection.driver_connection
            driver.execute("ROLLBACK")
            raise sqlite3.OperationalError("out of memory")

    monkeypatch.setattr(rows, "add", runs_out)
    found = await together(store, tick("P001", 0), tick("P002", 7), tick("P003", 0))
    assert found[0] is True and found[2] is True and isinstance(found[1], StoreError)
    assert ticks_in(place) == [("P001", 0), ("P003", 0)]


# ---- while the disk does not do


@contextmanager
def little_room(store: Store, pages: int) -> Iterator[None]:
    """Room for so many pages more than there are, on every connection, until the block ends."""
    with closing(sqlite3.connect(store.path)) as connection:
        has = connection.execute("PRAGMA page_count").fetchone()[0]
    most = [has + pages]
    engine = store._database.engine
    said = lambda connection, *_: connection.execute(f"PRAGMA max_page_count={most[0]}").fetchall()  # noqa: E731
    sql.event.listen(engine, "checkout", said)
    yield
    most[0] = 1_000_000


@on_files
async def test_of_what_waits_for_a_full_disk_everything_that_fits_is_written_and_the_rest_once_there_is_room(
    store: AsyncStore, place: DataPlace
) -> None:
    large = event_row(participant="P002", kind="large", data=f'{{"text": "{"x" * 400_000}"}}')
    full = asyncio.Event()
    store.listen(lambda trouble: full.set())
    with little_room(store.store, pages=20):
        waiting = asyncio.ensure_future(together(store, tick("P001", 0), Batch(events=(large,)), tick("P003", 0)))
        await asyncio.wait_for(full.wait(), WITHIN_S)
        assert store.trouble is not None and store.trouble.kind == "full"
        assert ("P001", 0) in ticks_in(place)
        assert not waiting.done()
    assert await waiting == [True, True, True]
    assert sorted(ticks_in(place)) == [("P001", 0), ("P003", 0)]
    assert [row.kind for row in store.store.rows_of("events", "P002")] == ["large"]


async def test_what_waits_for_a_locked_database_is_all_written_once(store: AsyncStore, place: DataPlace) -> None:
    told = asyncio.Event()
    store.listen(lambda trouble: told.set())
    with locked(place):
        waiting = asyncio.ensure_future(together(store, *(tick(who, 0) for who in PEOPLE)))
        await asyncio.wait_for(told.wait(), WITHIN_S)
        assert ticks_in(place) == [] and not waiting.done()
    assert await waiting == [True] * len(PEOPLE)
    assert sorted(ticks_in(place)) == [(who, 0) for who in PEOPLE]


@on_files
async def test_nobody_is_answered_whose_batch_went_to_a_file_without_a_name(
    store: AsyncStore, place: DataPlace
) -> None:
    told = asyncio.Event()
    store.listen(lambda trouble: told.set())
    place.folder.rename(place.folder.with_name("elsewhere"))
    waiting = asyncio.ensure_future(together(store, *(tick(who, 0) for who in PEOPLE)))
    await asyncio.wait_for(told.wait(), WITHIN_S)
    assert store.trouble is not None and store.trouble.kind == "gone" and not waiting.done()
    place.folder.with_name("elsewhere").rename(place.folder)
    assert await waiting == [True] * len(PEOPLE)
    assert sorted(ticks_in(place)) == [(who, 0) for who in PEOPLE]


def test_a_killed_lab_has_every_acknowledged_tick_of_every_session(place: DataPlace) -> None:
    with open_store(place) as opened:
        for number in range(len(PEOPLE)):
            opened.create_participant(shipped_study(), seed=number, public_id=f"public{number}", utc=UTC)
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.support.store_writer", str(place.folder), *PEOPLE],
        cwd=REPOSITORY,
        env={**os.environ, **place.environment},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    said = [process.stdout.readline() for _ in range(60)]
    os.kill(process.pid, signal.SIGKILL)
    said += process.stdout.read().splitlines()
    process.stdout.close()
    assert process.wait() == -signal.SIGKILL
    acknowledged: dict[str, list[int]] = {who: [] for who in PEOPLE}
    for who, told in map(str.split, said):
        acknowledged[who].append(int(told))
    with open_store(place, exclusive=True) as opened:
        for who in PEOPLE:
            kept = [row.tick for row in opened.rows_of("ticks", who)]
            assert kept[: len(acknowledged[who])] == acknowledged[who] == list(range(len(acknowledged[who])))
            assert len(kept) - len(acknowledged[who]) in (0, 1)  # at most the one that was not acknowledged yet
    assert verify_data(place).findings == ()
