"""Data written by an earlier version: it opens, nothing of it is lost, and there is no way back without a sentence."""

from __future__ import annotations

import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sql
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from study.analysis.analysis import analyse
from study.analysis.dataset import load
from study.export.export import export, read_meta, read_table
from study.records import TABLES
from study.store import StoreError, migration, open_store
from study.store.tables import METADATA
from tests.support.lab_server import ROOT, LabServer
from tests.support.recordings import (
    DEMO,
    ERASED,
    FINISHED,
    MIDWAY,
    PILOT,
    ROBOTS,
    TICKS_MIDWAY,
    recorded_data,
    recorded_export,
    study_file,
)
from tests.support.wire_client import asked, events, stored, visit

UTC = "2026-01-01T00:00:00.000Z"
REVISION = """
import os, signal
import sqlalchemy as sql
from alembic import op
revision = "0002"
down_revision = "0001"

def upgrade():
    with op.batch_alter_table("tasks") as table:
        table.add_column(sql.Column("attempt", sql.Integer))
    op.execute("UPDATE tasks SET attempt = 1")
    {then}
"""


def everything(database: Path) -> dict[str, list[tuple[Any, ...]]]:
    """Every row of every table but the version's, as it stands in the file."""
    with closing(sqlite3.connect(database)) as connection:
        names = [row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {
            name: sorted(connection.execute(f"SELECT * FROM {name}").fetchall(), key=repr)
            for name in names
            if name != "alembic_version" and not name.startswith("sqlite_")
        }


@pytest.fixture
def later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Makes this a later version of the lab, with one revision more that does `then` at its end."""

    def become(then: str = "") -> Path:
        folder = tmp_path / "revisions"
        shutil.copytree(migration.REVISIONS, folder)
        (folder / "versions" / "r0002_test.py").write_text(REVISION.format(then=then), encoding="utf-8")
        monkeypatch.setattr(migration, "REVISIONS", folder)
        monkeypatch.setattr(migration, "HEAD", "0002")
        return folder

    return become


# ---- what was written by every version so far


@pytest.mark.parametrize("robot", ROBOTS)
def test_recorded_data_open_and_nothing_in_them_changes(robot: str, tmp_path: Path) -> None:
    data = recorded_data(robot, tmp_path)
    before = everything(data / "lab.sqlite")
    with open_store(data, exclusive=True) as store:
        kinds = {found.participant: (found.kind, found.session.state) for found in store.sessions()}
        assert kinds == {
            FINISHED: ("study", "done"),
            MIDWAY: ("study", "paused"),
            PILOT: ("pilot", "paused"),
            DEMO: ("demo", "paused"),
        }
        assert [who for who, _ in store.erasures()] == [ERASED]
        for who in (MIDWAY, PILOT, DEMO):
            assert [row.tick for row in store.rows_of("ticks", who)] == list(range(TICKS_MIDWAY))
    after = everything(data / "lab.sqlite")
    before["machines"], after["machines"] = [], []  # opening adds the machine it was opened on
    assert after == before
    assert not migration.copies_beside(data / "lab.sqlite")


@pytest.mark.parametrize("robot", ROBOTS)
def test_recorded_data_brought_up_have_the_schema_of_a_new_file(robot: str, tmp_path: Path) -> None:
    data = recorded_data(robot, tmp_path)
    with open_store(data) as store, store._database.read() as connection:
        assert compare_metadata(MigrationContext.configure(connection), METADATA) == []
        assert connection.execute(sql.text("SELECT version_num FROM alembic_version")).scalars().all() == [
            migration.HEAD
        ]


@pytest.mark.parametrize("robot", ROBOTS)
def test_recorded_data_export_as_they_did(robot: str, tmp_path: Path) -> None:
    with open_store(recorded_data(robot, tmp_path), must_exist=True) as store:
        export(store, tmp_path / "now", include_pilot=True)
    then = recorded_export(robot, tmp_path)
    for table in TABLES:
        assert (tmp_path / "now" / f"{table}.csv").read_bytes() == (then / f"{table}.csv").read_bytes(), table


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_recorded_export_is_read_and_analysed(robot: str, tmp_path: Path) -> None:
    folder = recorded_export(robot, tmp_path)
    assert read_meta(folder)["erased_participants"] == 1
    assert {row.participant for row in read_table(folder, "participants")} == {FINISHED, MIDWAY, PILOT}
    assert len(read_table(folder, "tasks")) >= 6
    found = analyse(load(folder))
    assert len(found.data.conditions) == 3
    assert found.comparison("efficiency_ticks", "all") is not None


@pytest.mark.parametrize("robot", ["kinematic", pytest.param("bullet", marks=pytest.mark.bullet)])
async def test_a_recorded_trial_goes_on_with_its_next_tick(
    robot: str, start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    data = recorded_data(robot, tmp_path)
    study = study_file(data, tmp_path)
    lab = start_lab("--robot", robot, "--pace", "lockstep", "--no-scene", "--study", str(study), data_dir=data)
    with stored(lab) as store, store.snapshot() as recorded:
        is_same_machine = len(recorded.machines()) == 1
    for who in (MIDWAY, PILOT, DEMO):
        link = asked(lab, "POST", f"participants/{who}/link").json()["link"]
        async with visit(link) as player:
            await player.page("paused")
            await player.done("resume")
            await player.status("running")
            assert (await player.tick()).tick == TICKS_MIDWAY
        if is_same_machine:  # elsewhere a re-run may differ in the last bits, and says so
            assert not events(lab, who, "replay_mismatch")


# ---- from one schema to the next


def test_there_is_one_line_of_revisions_and_its_end_is_what_new_files_are() -> None:
    scripts = ScriptDirectory.from_config(migration._config())
    assert scripts.get_heads() == [migration.HEAD]
    assert scripts.get_bases() == [migration.FIRST]


@pytest.mark.parametrize("opened_by", ["lab", "export"])
def test_an_older_file_is_copied_and_then_brought_up(
    opened_by: str, later: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = recorded_data("kinematic", tmp_path)
    before = everything(data / "lab.sqlite")
    with monkeypatch.context() as version:
        later()
        open_store(data, exclusive=opened_by == "lab", must_exist=opened_by == "export").close()
        tasks = everything(data / "lab.sqlite")["tasks"]
        assert [row[-1] for row in tasks] == [1] * len(before["tasks"])
        assert sorted(row[:-1] for row in tasks) == sorted(before["tasks"])
        version.undo()
    monkeypatch.undo()
    (copy,) = migration.copies_beside(data / "lab.sqlite")
    assert copy.name == "lab.schema-0001.sqlite"
    assert copy.stat().st_mode & 0o077 == 0
    assert everything(copy) == before
    with pytest.raises(StoreError, match=r"written by a later version .*schema 0002.* copy .*lab\.schema-0001\.sqlite"):
        open_store(data, must_exist=True)
    # What the version before migrations looks at has changed too, so that it refuses as well.
    assert ("store_version", "0002") in everything(data / "lab.sqlite")["meta"]
    (data / "lab.sqlite").unlink()
    copy.rename(data / "lab.sqlite")
    with open_store(data) as store:
        assert len(store.sessions()) == 4


def test_a_file_from_the_future_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with open_store(tmp_path) as store:
        path = store.path
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
    for options in ({"must_exist": True}, {"exclusive": True}):
        with pytest.raises(StoreError, match=r"schema 9999, this version knows those up to 0001.*open it with that"):
            open_store(tmp_path, **options)
    assert everything(path)["sessions"] == []


def test_a_revision_that_fails_changes_nothing(later: Callable[..., Path], tmp_path: Path) -> None:
    data = recorded_data("kinematic", tmp_path)
    before = everything(data / "lab.sqlite")
    later("op.execute('UPDATE absent SET x = 1')")
    with pytest.raises(StoreError, match="from schema 0001 to 0002: no such table: absent; nothing was changed"):
        open_store(data, exclusive=True)
    assert everything(data / "lab.sqlite") == before
    assert everything(data / "lab.schema-0001.sqlite") == before


def test_a_lab_killed_in_mid_migration_finds_its_data_whole(later: Callable[..., Path], tmp_path: Path) -> None:
    data = recorded_data("kinematic", tmp_path)
    before = everything(data / "lab.sqlite")
    folder = later("os.kill(os.getpid(), signal.SIGKILL)")
    code = f"""
from pathlib import Path
from study.store import migration, open_store
migration.REVISIONS, migration.HEAD = Path({str(folder)!r}), "0002"
open_store({str(data)!r}, exclusive=True)
"""
    killed = subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=60)
    assert killed.returncode == -signal.SIGKILL
    assert everything(data / "lab.sqlite") == before
    (folder / "versions" / "r0002_test.py").write_text(REVISION.format(then=""), encoding="utf-8")
    with open_store(data, exclusive=True) as store:
        assert len(store.sessions()) == 4


def test_nothing_is_brought_up_under_a_running_lab(later: Callable[..., Path], tmp_path: Path) -> None:
    data = recorded_data("kinematic", tmp_path)
    with open_store(data, exclusive=True):
        later()
        with pytest.raises(StoreError, match="another lab is running"):
            open_store(data, must_exist=True)
    assert not migration.copies_beside(data / "lab.sqlite")


def test_nothing_is_brought_up_when_the_copy_cannot_be_written(later: Callable[..., Path], tmp_path: Path) -> None:
    data = recorded_data("kinematic", tmp_path)
    before = everything(data / "lab.sqlite")
    later()
    (data / "lab.schema-0001.sqlite.unfinished").mkdir()
    with pytest.raises(StoreError, match=r"needs a copy of it first, and lab\.schema-0001\.sqlite cannot be written"):
        open_store(data, exclusive=True)
    assert everything(data / "lab.sqlite") == before


def test_erasing_somebody_removes_the_copies_that_hold_them(later: Callable[..., Path], tmp_path: Path) -> None:
    data = recorded_data("kinematic", tmp_path)
    later()
    with open_store(data, exclusive=True) as store:
        assert migration.copies_beside(store.path)
        store.erase(FINISHED, UTC)
        assert not migration.copies_beside(store.path)


def test_a_row_read_from_a_recorded_file_is_the_row_of_its_export(tmp_path: Path) -> None:
    with open_store(recorded_data("bullet", tmp_path), must_exist=True) as store:
        rows = [asdict(row) for row in store.rows_of("ticks", MIDWAY)]
    folder = recorded_export("bullet", tmp_path)
    assert rows == [asdict(row) for row in read_table(folder, "ticks") if row.participant == MIDWAY]
