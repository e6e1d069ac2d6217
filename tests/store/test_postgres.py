"""What a server does to a store: it is told in one line, tried again, and nothing is lost, or there twice."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from app.config import LabConfig
from study.store import (
    AsyncStore,
    Batch,
    DataPlace,
    Store,
    StoreError,
    StoreTroubled,
    handed_over,
    open_store,
    place_of,
    verify_data,
)
from tests.support import postgres_server
from tests.support.data_places import changed_in, found_in
from tests.support.postgres_server import PostgresServer
from tests.support.study_samples import UTC, append_tick, event_row, shipped_study, tick_row
from tests.support.typed_command import run

WHO = "P001"
WITHIN_S = 20.0


@pytest.fixture
def place(postgres: PostgresServer, tmp_path: Path) -> DataPlace:
    """An empty database."""
    return DataPlace(tmp_path / "own", postgres.url(postgres.database()))


@pytest.fixture
async def served(own_postgres: PostgresServer, tmp_path: Path) -> AsyncIterator[AsyncStore]:
    """A store on it, as a lab has it."""
    place = DataPlace(tmp_path / "own", own_postgres.url(own_postgres.database()))
    opened = open_store(place, exclusive=True)
    enrol(opened)
    store = AsyncStore(opened)
    yield store
    await store.close()
    assert verify_data(place).findings == ()


def enrol(store: Store) -> None:
    store.create_participant(shipped_study(), seed=2**48 - 1, public_id="public", utc=UTC)


# ---- values


def test_numbers_that_are_none_and_zeros_are_kept_as_sqlite_keeps_them(place: DataPlace) -> None:
    with open_store(place) as store:
        enrol(store)
        append_tick(store, tick_row(WHO, late_ms=float("nan"), p_x=-0.0, p_y=float("inf")))
        (row,) = store.rows("ticks")
        assert row.late_ms is None and str(row.p_x) == "0.0" and row.p_y == float("inf")
        assert store.session(WHO).seed == 2**48 - 1
        with pytest.raises(StoreError, match="out of range"):
            append_tick(store, tick_row(WHO, 1, input_seq=2**70))
    assert verify_data(place).findings == ()


def test_no_other_program_writes_what_is_no_number(place: DataPlace) -> None:
    with open_store(place) as store:
        enrol(store)
        append_tick(store, tick_row(WHO))
    with pytest.raises(Exception, match="ticks_p_x_is_a_number"):
        changed_in(place, "UPDATE ticks SET p_x = 'NaN'")


def test_nothing_is_found_by_a_text_that_no_text_can_be(place: DataPlace) -> None:
    with open_store(place) as store:
        enrol(store)
        with pytest.raises(StoreError, match="no participant"):
            store.session(f"{WHO}\0")
        assert store.response(WHO, "a\0b") is None


def test_texts_stand_in_the_order_of_their_bytes(place: DataPlace) -> None:
    open_store(place).close()
    collations = "SELECT DISTINCT collation_name FROM information_schema.columns WHERE data_type = 'text'"
    schema = " AND table_schema = 'public'"
    assert found_in(place, collations + schema) == [("C",)]


def test_what_is_acknowledged_is_on_disk(place: DataPlace) -> None:
    ((name,),) = found_in(place, "SELECT current_database()")
    changed_in(place, f"ALTER DATABASE {name} SET synchronous_commit = off")
    with open_store(place, exclusive=True) as store, store.rewriting() as connection:
        assert connection.exec_driver_sql("SHOW synchronous_commit").scalar() == "on"


def test_a_reader_who_leaves_and_one_who_goes_on_hold_nobody_up(place: DataPlace) -> None:
    with open_store(place) as store:
        enrol(store)
        for number in range(3):
            append_tick(store, tick_row(WHO, number))
        reading = store.rows("ticks")
        assert next(reading).tick == 0
        append_tick(store, tick_row(WHO, 3))
        assert [row.tick for row in reading] == [1, 2]  # one moment
        left_open = iter(store.rows("ticks"))
        next(left_open)
    del left_open
    ours = "application_name = 'shared-autonomy-lab' AND datname = current_database()"
    give_up_s = time.monotonic() + WITHIN_S
    while found_in(place, f"SELECT count(*) FROM pg_stat_activity WHERE {ours}") != [(0,)]:
        assert time.monotonic() < give_up_s  # the server notices in its own time


# ---- addresses that cannot be used


@pytest.fixture(scope="module")
def guarded(postgres: PostgresServer) -> Iterator[PostgresServer]:
    """A server that asks for passwords, and has people with fewer rights."""
    server = postgres_server.start()
    server.run("CREATE ROLE reader LOGIN PASSWORD 'a right one'")
    server.run("CREATE DATABASE study TEMPLATE template0")
    server.run("REVOKE CREATE ON SCHEMA public FROM PUBLIC", "study")
    server.run("CREATE DATABASE others TEMPLATE template0")
    server.run("CREATE TABLE recipes (name text)", "others")
    server.run("CREATE DATABASE latin TEMPLATE template0 ENCODING 'LATIN1' LC_COLLATE 'C' LC_CTYPE 'C'")
    server.ask_for_passwords("reader")
    yield server
    postgres_server.remove(server)


@pytest.mark.parametrize(
    ("user", "password", "database", "said"),
    [
        ("reader", "secret-wrong", "study", 'password authentication failed for user "reader"'),
        ("reader", "a%20right%20one", "study", "permission denied for schema public"),
        ("lab", "", "nowhere", 'database "nowhere" does not exist'),
        ("lab", "", "others", "a database, but not one of this lab"),
        ("lab", "", "latin", "server_encoding is LATIN1, and the lab needs UTF8"),
    ],
)
def test_an_address_that_cannot_be_used_is_one_line_without_the_password(
    guarded: PostgresServer,
    own_folder: Path,
    capsys: pytest.CaptureFixture[str],
    user: str,
    password: str,
    database: str,
    said: str,
) -> None:
    url = guarded.url(database, user, password)
    status, _, error = run(capsys, "serve", "--data", url, "--port", "0", "--robot", "kinematic", "--no-scene")
    assert status == 2 and said in error
    assert error.count("\n") == 1 and "Traceback" not in error
    assert not password or (password not in error and "a right one" not in error)


def test_a_server_that_is_not_there_is_one_line(own_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    url = f"postgresql+psycopg://lab:secret@/study?host={own_folder}"
    for command in (("export", "--out", "out"), ("verify",), ("certificate",), ("erase", "--participant", "P001")):
        status, _, error = run(capsys, *command, "--data", url)
        assert status == 2 and "connection" in error and error.count("\n") == 1
        assert "secret" not in error


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("mysql://lab:secret@db/study", "mysql:// is no database that the lab can use"),
        ("postgresql://lab:secret@db", "names no database"),
        ("postgresql://lab:secret@db:99999/study", "no database that the lab can use"),
        ("postgresql://lab@/study?host=/tmp&colour=secret", 'invalid connection option "colour"'),
    ],
)
def test_an_address_that_is_none_is_one_line(
    url: str, said: str, own_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, _, error = run(capsys, "export", "--out", "out", "--data", url)
    assert status == 2 and said in error and "lab:secret" not in error


def test_a_command_that_takes_no_address_says_so_without_the_password(
    own_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, _, error = run(capsys, "restore", "backup", "--data", "postgresql://lab:secret@db/study")
    assert status == 2 and "an address stands where a file or folder is asked for" in error
    assert "secret" not in error


def test_no_text_of_an_address_has_its_password() -> None:
    place = DataPlace(Path("data"), "postgresql+psycopg://lab:s%40cret@db:5433/study?sslpassword=hush&host=/run/x")
    for text in (str(place), repr(place), repr(LabConfig(database_url=place.url)), str(place.environment.keys())):
        assert "cret" not in text and "hush" not in text
    assert str(place) == "postgresql+psycopg://lab:***@db:5433/study?sslpassword=***&host=/run/x"
    assert place_of(place) is place


def test_a_lab_with_a_folder_hands_no_address_on(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in DataPlace(Path("data")).environment.items():
        monkeypatch.setenv(name, value)
    assert handed_over("data") == DataPlace(Path("data"))


def test_data_of_another_version_are_refused(place: DataPlace, capsys: pytest.CaptureFixture[str]) -> None:
    open_store(place).close()
    changed_in(place, "UPDATE alembic_version SET version_num = '9999'")
    status, _, error = run(capsys, "verify", "--data", place.url or "")
    assert status in (0, 2)  # what it knows can be read
    status, _, error = run(capsys, "certificate", "--data", place.url or "")
    assert status == 2 and "written by a later version of the lab (schema 9999" in error


# ---- a server that goes away


async def until(store: AsyncStore, wanted: Callable[[Any], bool]) -> None:
    changed = asyncio.Event()
    unlisten = store.listen(lambda trouble: changed.set())
    while not wanted(store.trouble):
        await asyncio.wait_for(changed.wait(), WITHIN_S)
        changed.clear()
    unlisten()


async def test_what_happens_while_the_server_is_away_is_kept_and_written_once(
    served: AsyncStore, own_postgres: PostgresServer
) -> None:
    served.watch()
    assert await served.commit(Batch(ticks=(tick_row(WHO, 0),)))
    await asyncio.to_thread(own_postgres.stop)
    kept = asyncio.create_task(served.commit(Batch(ticks=(tick_row(WHO, 1),))))
    await until(served, lambda trouble: trouble is not None and trouble.kind == "unreachable")
    with pytest.raises(StoreTroubled):
        await served.run(lambda store: store.add_identity(WHO, "note", "now"))
    assert not kept.done()
    await asyncio.to_thread(own_postgres.start)
    assert await asyncio.wait_for(kept, WITHIN_S)
    await until(served, lambda trouble: trouble is None)
    assert [row.tick for row in served.store.rows("ticks")] == [0, 1]


async def test_trouble_is_noticed_while_nobody_writes(served: AsyncStore, own_postgres: PostgresServer) -> None:
    served.watch()
    await asyncio.to_thread(own_postgres.stop, "immediate")
    await until(served, lambda trouble: trouble is not None and trouble.kind == "unreachable")
    await asyncio.to_thread(own_postgres.start)
    await until(served, lambda trouble: trouble is None)


def losing(store: Store, where: str) -> threading.Event:
    """From when this is set, the server is lost in the next commit: before it is asked, or after it has answered."""
    lose = threading.Event()
    dialect = store._database.backend.writing.dialect
    commit = dialect.do_commit

    def lost(connection: Any) -> None:
        if not lose.is_set():
            return commit(connection)
        lose.clear()
        if where == "after":
            commit(connection)
        connection.driver_connection.close()
        return commit(connection)  # which raises as a lost connection does

    dialect.do_commit = lost  # type: ignore[method-assign, assignment]
    return lose


@pytest.mark.parametrize("where", ["before", "after"])
@pytest.mark.parametrize("count", [1, 3])
async def test_a_commit_that_was_not_answered_is_looked_for_before_it_is_made_again(
    served: AsyncStore, where: str, count: int
) -> None:
    lose = losing(served.store, where)
    go_on = threading.Event()
    before = asyncio.ensure_future(served.run(lambda store: go_on.wait(WITHIN_S)))
    batches = [Batch(ticks=(tick_row(WHO, n),), events=(event_row(WHO, f"of {n}"),)) for n in range(count)]
    lose.set()
    asked = [asyncio.ensure_future(served.commit(batch)) for batch in batches]
    await asyncio.sleep(0)
    go_on.set()
    assert await asyncio.wait_for(asyncio.gather(*asked), WITHIN_S) == [True] * count
    await before
    assert [row.tick for row in served.store.rows("ticks")] == list(range(count))
    assert [row.kind for row in served.store.rows("events")] == [f"of {n}" for n in range(count)]
    assert served.trouble is None


async def test_other_work_that_was_not_answered_is_not_done_twice(served: AsyncStore) -> None:
    losing(served.store, "after").set()
    with pytest.raises(StoreError, match="whether it was done is not known"):
        await served.keep(lambda store: store.add_identity(WHO, "label", "somebody"))
    assert served.store.identities(WHO) == (("label", "somebody"),)


def test_a_lab_whose_lock_another_has_taken_writes_nothing(place: DataPlace, tmp_path: Path) -> None:
    """As when its connection is cut, and another lab begins before it is back."""
    with open_store(place, exclusive=True) as first:
        enrol(first)
        cut = "SELECT pg_terminate_backend(pid) FROM pg_locks WHERE locktype = 'advisory' AND database = "
        changed_in(place, cut + "(SELECT oid FROM pg_database WHERE datname = current_database())")
        with open_store(DataPlace(tmp_path / "second", place.url), exclusive=True):
            with pytest.raises(StoreTroubled):
                append_tick(first, tick_row(WHO))
            with pytest.raises(StoreTroubled, match="another lab is running"):
                append_tick(first, tick_row(WHO))
        append_tick(first, tick_row(WHO))
        assert len(list(first.rows("ticks"))) == 1


async def test_a_server_that_crashes_again_and_again_loses_nothing_acknowledged_and_doubles_nothing(
    served: AsyncStore, own_postgres: PostgresServer
) -> None:
    people = [WHO, *(f"P{number:03d}" for number in (2, 3, 4))]
    for number in range(1, len(people)):
        served.store.create_participant(shipped_study(), seed=number, public_id=f"public{number}", utc=UTC)
    acknowledged = dict.fromkeys(people, 0)
    ends = asyncio.Event()

    async def drive(who: str) -> None:
        while not ends.is_set():
            number = acknowledged[who]
            assert await served.commit(Batch(ticks=(tick_row(who, number),), events=(event_row(who, f"of {number}"),)))
            acknowledged[who] += 1

    driving = [asyncio.create_task(drive(who)) for who in people]
    for _ in range(4):
        before = dict(acknowledged)
        await asyncio.to_thread(own_postgres.stop, "immediate")
        await asyncio.to_thread(own_postgres.start)
        while any(acknowledged[who] < before[who] + 5 for who in people):
            await asyncio.wait(driving, timeout=0.01)
            assert not any(task.done() for task in driving)
    ends.set()
    await asyncio.wait_for(asyncio.gather(*driving), WITHIN_S)
    for who in people:
        assert [row.tick for row in served.store.rows_of("ticks", who)] == list(range(acknowledged[who]))
        kinds = [row.kind for row in served.store.rows_of("events", who)]
        assert kinds == [f"of {number}" for number in range(acknowledged[who])]
