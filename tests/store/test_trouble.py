"""What the disk does to a store is a state: told at once, tried again, over by itself; nothing is lost, or twice."""

from __future__ import annotations

import asyncio
import shutil
import sqlite3
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
import sqlalchemy as sql

from study.store import AsyncStore, Batch, DataPlace, Store, StoreTroubled, Trouble, TroubleKind, open_store
from study.store.database import Database
from tests.support.data_places import found_in, locked
from tests.support.study_samples import UTC, event_row, shipped_study

PARTICIPANT = "P001"
WITHIN_S = 5.0
on_files = pytest.mark.parametrize("place", ["sqlite"], indirect=True)
"""What a disk does to SQLite's file."""


class Told:
    """What listeners were told, to wait for."""

    def __init__(self, store: AsyncStore) -> None:
        self._store = store
        self._changed = asyncio.Event()
        store.listen(lambda trouble: self._changed.set())

    async def until(self, wanted: Callable[[Trouble | None], bool]) -> Trouble | None:
        while not wanted(self._store.trouble):
            self._changed.clear()
            await asyncio.wait_for(self._changed.wait(), WITHIN_S)
        return self._store.trouble


@pytest.fixture
async def store(place: DataPlace) -> AsyncIterator[AsyncStore]:
    opened = open_store(place, exclusive=True)
    opened.create_participant(shipped_study(), seed=1, public_id="public", utc=UTC)
    served = AsyncStore(opened)
    yield served
    await served.close()


def one_event(kind: str) -> Callable[[Store], bool]:
    return lambda store: store.commit(Batch(events=(event_row(participant=PARTICIPANT, kind=kind),)))


def kinds_in(place: DataPlace | Path) -> list[str]:
    return [kind for (kind,) in found_in(place, "SELECT kind FROM events ORDER BY row_id")]


# ---- disks that do not do, each with what makes it do again


@contextmanager
def full(store: Store) -> Iterator[None]:
    """As many pages as it has, and no room in those for more."""
    with on_every_connection(store, "PRAGMA max_page_count=1", "PRAGMA max_page_count=1000000"):
        yield


@contextmanager
def read_only(store: Store) -> Iterator[None]:
    with on_every_connection(store, "PRAGMA query_only=ON", "PRAGMA query_only=OFF"):
        yield


@contextmanager
def on_every_connection(store: Store, before: str, after: str) -> Iterator[None]:
    engine = store._database.engine
    said = [before]
    sql.event.listen(engine, "checkout", lambda connection, *_: connection.execute(said[0]).fetchall())
    yield
    said[0] = after


@contextmanager
def moved(store: Store) -> Iterator[None]:
    folder = store.path.parent
    elsewhere = folder.with_name("elsewhere")
    folder.rename(elsewhere)
    yield
    elsewhere.rename(folder)


TROUBLES = {"full": full, "read_only": read_only, "gone": moved}


@on_files
@pytest.mark.parametrize("kind", TROUBLES)
async def test_what_must_be_kept_waits_for_the_disk_and_is_written_once(
    store: AsyncStore, kind: TroubleKind, place: DataPlace
) -> None:
    await kept_meanwhile(store, place, kind, TROUBLES[kind](store.store))


async def test_what_must_be_kept_waits_for_another_program_and_is_written_once(
    store: AsyncStore, place: DataPlace
) -> None:
    await kept_meanwhile(store, place, "locked", locked(place))


async def kept_meanwhile(
    store: AsyncStore, place: DataPlace, kind: TroubleKind, trouble_of_it: AbstractContextManager[None]
) -> None:
    told = Told(store)
    big = "x" * 20_000
    work = lambda opened: opened.commit(  # noqa: E731
        Batch(events=(event_row(participant=PARTICIPANT, kind="kept", data=f'{{"big": "{big}"}}'),))
    )
    with trouble_of_it:
        kept = asyncio.create_task(store.keep(work))
        trouble = await told.until(lambda trouble: trouble is not None)
        assert trouble is not None and trouble.kind == kind
        with pytest.raises(StoreTroubled):
            await store.run(work)
        assert not kept.done()
    await asyncio.wait_for(kept, WITHIN_S)
    assert store.trouble is None
    assert kinds_in(place) == ["kept"]


async def test_what_takes_long_is_told_and_blames_nobody(store: AsyncStore) -> None:
    told = Told(store)
    loop = asyncio.get_running_loop()
    on = asyncio.run_coroutine_threadsafe

    def slowly(opened: Store) -> bool:
        on(told.until(lambda trouble: trouble is not None and trouble.kind == "slow"), loop).result(WITHIN_S)
        return one_event("slow")(opened)

    assert await store.run(slowly)
    assert store.trouble is None


async def test_reading_does_not_wait_for_what_is_being_written(store: AsyncStore, place: DataPlace) -> None:
    with locked(place):
        kept = asyncio.create_task(store.keep(one_event("kept")))
        assert await store.read(lambda opened: opened.session(PARTICIPANT).participant) == PARTICIPANT
        assert not kept.done()
    await asyncio.wait_for(kept, WITHIN_S)


async def test_a_mistake_of_ours_is_no_trouble_of_the_disk(store: AsyncStore) -> None:
    with pytest.raises(ValueError, match="no participant"):
        await store.keep(lambda opened: opened.session("P999"))
    assert store.trouble is None


@on_files
async def test_trouble_is_noticed_while_nobody_writes(store: AsyncStore, tmp_path: Path) -> None:
    told = Told(store)
    store.watch()
    with moved(store.store):
        trouble = await told.until(lambda trouble: trouble is not None)
        assert trouble is not None and trouble.kind == "gone"
    await told.until(lambda trouble: trouble is None)


def write_over(path: Path) -> None:
    """All but its first page."""
    with path.open("r+b") as file:
        size = file.seek(0, 2)
        file.seek(4096)
        file.write(bytes(size - 4096))


@on_files
async def test_a_file_that_is_written_over_is_noticed_and_nothing_acknowledged(store: AsyncStore) -> None:
    """SQLite itself goes on, from what it remembers of the file."""
    await store.run(one_event("before"))
    told = Told(store)
    store.watch()
    for ending in ("", "-wal"):
        write_over(Path(f"{store.store.path}{ending}"))
    trouble = await told.until(lambda trouble: trouble is not None)
    assert trouble is not None and trouble.kind == "corrupt"
    with pytest.raises(StoreTroubled):
        await store.run(one_event("after"))


# ---- a data folder that is gone


async def deleted(store: AsyncStore) -> Trouble:
    """Delete the folder under the lab's hands; what it says once the rescue copy stands."""
    told = Told(store)
    shutil.rmtree(store.store.path.parent)
    kept = asyncio.create_task(store.keep(one_event("in hand")))
    trouble = await told.until(lambda trouble: trouble is not None and trouble.rescue is not None)
    assert not kept.done()
    kept.cancel()
    assert trouble is not None
    return trouble


@on_files
async def test_a_deleted_folder_is_noticed_and_all_of_it_copied_with_what_is_in_hand(
    store: AsyncStore, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    await store.run(one_event("before"))
    trouble = await deleted(store)
    assert trouble.kind == "gone" and trouble.rescue is not None
    assert trouble.rescue.parent == tmp_path
    assert str(trouble.rescue) in caplog.text
    assert not (tmp_path / "data").exists()
    with open_store(trouble.rescue, exclusive=True) as copy:  # a data folder like any other
        assert [row.kind for row in copy.rows_of("events", PARTICIPANT)] == ["before", "in hand"]
    assert (trouble.rescue / "lab.sqlite").stat().st_mode & 0o077 == 0


@on_files
async def test_a_folder_put_in_its_place_is_neither_written_nor_taken_for_it(store: AsyncStore, tmp_path: Path) -> None:
    await store.run(one_event("before"))
    shutil.move(tmp_path / "data", tmp_path / "elsewhere")
    with open_store(tmp_path / "data"):
        pass
    with pytest.raises(StoreTroubled, match="moved, deleted or replaced"):
        await store.run(one_event("after"))
    assert kinds_in(tmp_path / "data") == []
    assert kinds_in(tmp_path / "elsewhere") == ["before"]


@on_files
async def test_a_place_that_takes_no_copy_is_passed_by(
    store: AsyncStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    mkdir = Path.mkdir

    def refuse(path: Path, *arguments: object, **options: object) -> None:
        if path.parent == tmp_path:
            raise PermissionError(13, "Permission denied")
        mkdir(path, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(Path, "mkdir", refuse)
    trouble = await deleted(store)
    assert trouble.rescue is not None and trouble.rescue.parent == home


@on_files
async def test_half_a_copy_is_taken_away(store: AsyncStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    copy_out = Database.copy_out

    def half(database: Database, path: Path) -> None:
        if path.parent.parent == tmp_path:
            path.write_bytes(b"half")
            raise sqlite3.DatabaseError("database disk image is malformed")
        copy_out(database, path)

    monkeypatch.setattr(Database, "copy_out", half)
    trouble = await deleted(store)
    assert trouble.rescue is not None and trouble.rescue.parent == home
    assert sorted(path.name for path in await asyncio.to_thread(lambda: list(tmp_path.iterdir()))) == ["home"]
