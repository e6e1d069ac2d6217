"""Data go into a database on a server and back, and are the same: every row, every chain, every number given out."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from study.export.export import export
from study.integrity.signing import KEY_NAME
from study.store import DataPlace, Store, StoreError, copy, open_store, verify_data
from study.store.tables import METADATA
from tests.store.test_verification import fill
from tests.support.data_places import changed_in, found_in, typed
from tests.support.postgres_server import PostgresServer
from tests.support.study_samples import UTC, event_row, shipped_study
from tests.support.typed_command import run

OWN = ("meta", "alembic_version")
SUMMED = ("datapackage.json", "meta.json", "SHA256SUMS")
"""Files of an export that hold the hashes of others."""


@pytest.fixture
def folder(tmp_path: Path) -> DataPlace:
    """A data folder with something in every table, and somebody erased who had the highest number."""
    place = DataPlace(tmp_path / "data")
    with open_store(place, exclusive=True) as store:
        fill(store)
        last = store.create_participant(shipped_study(), seed=2**47 + 1, public_id="last", utc=UTC).participant
        store.erase(last, UTC)
    return place


@pytest.fixture
def on_server(postgres: PostgresServer, tmp_path: Path) -> DataPlace:
    return DataPlace(tmp_path / "own", postgres.url(postgres.database()))


def everything(place: DataPlace) -> dict[str, list[tuple[object, ...]]]:
    """Every row of every table but those that tell of the database itself."""
    with open_store(place, must_exist=True) as store, store.reading() as connection:
        return {
            table.name: sorted(map(tuple, connection.execute(table.select())), key=str)
            for table in METADATA.sorted_tables
            if table.name not in OWN
        }


def enrolled(store: Store, number: int) -> str:
    return store.create_participant(shipped_study(), seed=1, public_id=f"new{number}", utc=UTC).participant


def test_there_and_back_it_is_the_same_and_goes_on(folder: DataPlace, on_server: DataPlace, tmp_path: Path) -> None:
    before = everything(folder)
    copied = copy(folder, on_server)
    assert copied.verdict.findings == () and copied.rows == sum(map(len, before.values()))
    assert everything(on_server) == before
    assert (on_server.folder / KEY_NAME).read_text() == (folder.folder / KEY_NAME).read_text()

    with open_store(on_server, exclusive=True) as store:
        who = enrolled(store, 1)
        assert who == "P004"  # after the one who was erased
        store.add_identity(who, "label", "somebody")
        store.reject(who, event_row(who, "rejected"))
    there = everything(on_server)

    back = DataPlace(tmp_path / "back")
    copy(on_server, back)
    assert everything(back) == there
    assert verify_data(back).findings == ()
    with closing(sqlite3.connect(back.folder / "lab.sqlite")) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    with open_store(back, exclusive=True) as store:
        assert enrolled(store, 2) == "P005"
        store.add_identity("P005", "label", "another")


def test_what_holds_data_or_is_not_as_recorded_is_refused(
    folder: DataPlace, on_server: DataPlace, tmp_path: Path
) -> None:
    copy(folder, on_server)
    there = everything(on_server)
    with pytest.raises(StoreError, match="holds data already"):
        copy(folder, on_server)
    assert everything(on_server) == there
    with pytest.raises(StoreError, match="there already"):
        copy(on_server, folder)
    with open_store(folder, exclusive=True), pytest.raises(StoreError, match="another lab is running"):
        copy(folder, DataPlace(tmp_path / "x"))
    changed_in(on_server, "UPDATE ticks SET digest = 'x' WHERE participant = 'P002' AND tick = 3")
    with pytest.raises(StoreError, match=r"not as recorded: ticks of P002, trial 1, tick 3.*nothing was copied"):
        copy(on_server, DataPlace(tmp_path / "back"))
    assert not (tmp_path / "back").exists()


def test_a_copy_that_fails_on_the_way_leaves_nothing(
    folder: DataPlace, on_server: DataPlace, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_store(on_server).close()
    changed_in(on_server, "ALTER TABLE events ADD CONSTRAINT short CHECK (length(kind) < 4)")
    with pytest.raises(StoreError, match="violates check constraint"):
        copy(folder, on_server)
    changed_in(on_server, "ALTER TABLE events DROP CONSTRAINT short")
    assert found_in(on_server, "SELECT count(*) FROM ticks") == [(0,)]
    assert copy(folder, on_server).verdict.findings == ()


def test_the_command_says_what_it_did(
    folder: DataPlace, on_server: DataPlace, capsys: pytest.CaptureFixture[str]
) -> None:
    own = ("--folder", str(folder.folder))  # the lab goes on in its folder, with the database elsewhere
    status, said, _ = run(capsys, "copy", typed(folder), typed(on_server), *own)
    assert status == 0 and "2 participants" in said and "every chain ends as in the original" in said
    status, _, error = run(capsys, "copy", typed(folder), typed(on_server), *own)
    assert status == 1 and "holds data already" in error
    status, _, error = run(capsys, "copy", typed(folder), str(on_server.folder))
    assert status == 1 and "one of the two must be the URL" in error


def test_the_same_inputs_are_exported_as_the_same_bytes(on_server: DataPlace, tmp_path: Path) -> None:
    for name, place in (("file", DataPlace(tmp_path / "data")), ("server", on_server)):
        with open_store(place, exclusive=True) as store:
            fill(store)
            export(store, tmp_path / name)
    differing = {  # what is salted, signed, or a sum of those
        path.name
        for path in (tmp_path / "file").iterdir()
        if path.read_bytes() != (tmp_path / "server" / path.name).read_bytes()
    }
    salted = {"chain", "certificates"}
    assert differing <= {*(f"{name}.{ending}" for name in salted for ending in ("csv", "parquet")), *SUMMED}
    assert (tmp_path / "server" / "ticks.csv").stat().st_size > 1000
