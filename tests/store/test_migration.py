"""Data written by an earlier version: it opens, nothing of it is lost, and there is no way back without a sentence."""

from __future__ import annotations

import csv
import re
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
from study.store import Batch, DataPlace, StoreError, migration, open_store, verify_data
from study.store.database import Database
from study.store.tables import METADATA
from tests.support import recordings
from tests.support.data_places import found_in
from tests.support.lab_server import ROOT, LabServer
from tests.support.postgres_server import PostgresServer
from tests.support.recordings import DEMO, ERASED, FINISHED, MIDWAY, PILOT, recorded_data, recorded_export, study_file
from tests.support.study_samples import shipped_study, task_row
from tests.support.wire_client import asked, events, stored, visit

UTC = "2026-01-01T00:00:00.000Z"
NEXT = f"{int(migration.HEAD) + 1:04d}"
"""The revision that a later version of the lab would have."""
REVISION = f'''
import os, signal
import sqlalchemy as sql
from alembic import op
revision = "{NEXT}"
down_revision = "{migration.HEAD}"

def upgrade():
    with op.batch_alter_table("tasks") as table:
        table.add_column(sql.Column("made_up", sql.Integer))
    op.execute("UPDATE tasks SET made_up = coalesce(made_up, 0) + 1")
    [then]
'''
OLDEST = recordings.SCHEMAS[0]
Rows = dict[str, list[dict[str, Any]]]


def everything(database: Path) -> Rows:
    """Every row of every table but the version's, as it stands in the file."""
    with closing(sqlite3.connect(database)) as connection:
        connection.row_factory = sqlite3.Row
        names = [row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {
            name: [dict(row) for row in connection.execute(f"SELECT * FROM {name} ORDER BY rowid")]
            for name in names
            if name != "alembic_version"
        }


def kept(before: Rows, after: Rows) -> None:
    """Nothing that stood there is gone or changed; there may be more columns. A revision that changes values on purpose
    says so here."""
    for table, rows in before.items():
        if table in ("meta", "machines"):  # which version and which machine had it open last
            continue
        assert len(after[table]) == len(rows), table
        for old, new in zip(rows, after[table], strict=True):
            assert {name: new[name] for name in old} == old, table


@pytest.fixture
def later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Makes this a later version of the lab, with one revision more that does `then` at its end."""

    def become(then: str = "") -> Path:
        folder = tmp_path / "revisions"
        shutil.copytree(migration.REVISIONS, folder)
        (folder / "versions" / "made_up.py").write_text(REVISION.replace("[then]", then), encoding="utf-8")
        monkeypatch.setattr(migration, "REVISIONS", folder)
        monkeypatch.setattr(migration, "HEAD", NEXT)
        return folder

    return become


@pytest.fixture
def newest(tmp_path: Path) -> Path:
    """The data folder of the oldest schema, as this version has brought it up; without copies."""
    data = recorded_data("kinematic", tmp_path)
    open_store(data, exclusive=True).close()
    for copy in migration.copies_beside(data / "lab.sqlite"):
        copy.unlink()
    return data


# ---- what was written by every version so far


def test_every_schema_that_was_released_is_recorded() -> None:
    assert OLDEST == migration.FIRST
    assert migration._known() - {migration.HEAD} <= set(recordings.SCHEMAS) <= migration._known()


@pytest.mark.parametrize(("schema", "robot"), recordings.CASES)
def test_a_recording_has_a_row_in_every_table(schema: str, robot: str, tmp_path: Path) -> None:
    rows = everything(recorded_data(robot, tmp_path, schema) / "lab.sqlite")
    assert not [table for table, found in rows.items() if not found]


@pytest.mark.parametrize(("schema", "robot"), recordings.CASES)
def test_recorded_data_open_and_nothing_of_them_is_lost(schema: str, robot: str, tmp_path: Path) -> None:
    data = recorded_data(robot, tmp_path, schema)
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
            rows = store.rows_of("ticks", who)
            assert [row.tick for row in rows] == list(range(len(rows)))
            assert rows[-1].cycle == 2
    kept(before, everything(data / "lab.sqlite"))
    copies = [copy.name for copy in migration.copies_beside(data / "lab.sqlite")]
    assert copies == ([] if schema == migration.HEAD else [f"lab.schema-{schema}.sqlite"])


@pytest.mark.parametrize(("schema", "robot"), recordings.CASES)
def test_recorded_data_brought_up_have_the_schema_of_a_new_file(schema: str, robot: str, tmp_path: Path) -> None:
    new = tmp_path / "new"
    with open_store(new) as made, made._database.read() as connection:
        counting = "SELECT name FROM sqlite_master WHERE sql LIKE '%AUTOINCREMENT%'"
        expected = connection.exec_driver_sql(counting).scalars().all()
    with open_store(recorded_data(robot, tmp_path, schema)) as store, store._database.read() as connection:
        assert compare_metadata(MigrationContext.configure(connection), METADATA) == []
        assert connection.exec_driver_sql(counting).scalars().all() == expected
        version = connection.execute(sql.text("SELECT version_num FROM alembic_version")).scalars().all()
        assert version == [migration.HEAD]


@pytest.mark.parametrize(("schema", "robot"), recordings.CASES)
def test_recorded_data_export_as_they_did(schema: str, robot: str, tmp_path: Path) -> None:
    with open_store(recorded_data(robot, tmp_path, schema), must_exist=True) as store:
        export(store, tmp_path / "now", include_pilot=True)
    then = recorded_export(robot, tmp_path, schema)
    for table in (table for table in TABLES if (then / f"{table}.csv").exists()):
        name = f"{table}.csv"
        with (then / name).open(newline="") as old, (tmp_path / "now" / name).open(newline="") as new:
            for was, has in zip(csv.DictReader(old), csv.DictReader(new), strict=True):
                assert {column: has[column] for column in was} == was, table


@pytest.mark.parametrize(("schema", "robot"), recordings.CASES)
def test_a_recorded_export_is_read_and_analysed(schema: str, robot: str, tmp_path: Path) -> None:
    folder = recorded_export(robot, tmp_path, schema)
    assert read_meta(folder)["erased_participants"] == 1
    assert {row.participant for row in read_table(folder, "participants")} == {FINISHED, MIDWAY, PILOT}
    assert len(read_table(folder, "tasks")) >= 12
    found = analyse(load(folder))
    assert len(found.data.conditions) == 3
    assert found.comparison("efficiency_ticks", "all") is not None


@pytest.mark.parametrize(
    ("schema", "robot"),
    [
        pytest.param(*case, marks=pytest.mark.bullet if case[1] == "bullet" else ())
        for case in recordings.CASES
        if case[0] in (OLDEST, recordings.SCHEMAS[-1])  # a lab is started for each
    ],
)
async def test_a_recorded_trial_goes_on_with_its_next_tick(
    schema: str, robot: str, start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    data = recorded_data(robot, tmp_path, schema)
    study = study_file(data, tmp_path)
    lab = start_lab("--robot", robot, "--pace", "lockstep", "--no-scene", "--study", str(study), data_dir=data)
    with stored(lab) as store, store.snapshot() as recorded:
        is_same_machine = len(recorded.machines()) == 1
        ticks = {who: len(store.rows_of("ticks", who)) for who in (MIDWAY, PILOT, DEMO)}
    for who, count in ticks.items():
        link = asked(lab, "POST", f"participants/{who}/link").json()["link"]
        async with visit(link) as player:
            await player.page("paused")
            await player.done("resume")
            await player.status("running")
            assert (await player.tick()).tick == count
        if is_same_machine:  # elsewhere a re-run may differ in the last bits, and says so
            assert not events(lab, who, "replay_mismatch")


# ---- from one schema to the next


def test_there_is_one_line_of_revisions_and_its_end_is_what_new_files_are() -> None:
    scripts = ScriptDirectory.from_config(migration._config())
    assert scripts.get_heads() == [migration.HEAD]
    assert scripts.get_bases() == [migration.FIRST]


@pytest.mark.parametrize("opened_by", ["lab", "export"])
def test_an_older_file_is_copied_and_then_brought_up(
    opened_by: str, newest: Path, later: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = newest / "lab.sqlite"
    before = everything(path)
    later()
    open_store(newest, exclusive=opened_by == "lab", must_exist=opened_by == "export").close()
    after = everything(path)
    kept(before, after)
    assert {row["made_up"] for row in after["tasks"]} == {1}
    monkeypatch.undo()  # back to the version that wrote it
    (copy,) = migration.copies_beside(path)
    assert copy.name == f"lab.schema-{migration.HEAD}.sqlite"
    assert copy.stat().st_mode & 0o077 == 0
    assert everything(copy) == before
    refusal = rf"written by a later version .*schema {NEXT}.* copy .*lab\.schema-{migration.HEAD}\.sqlite"
    with pytest.raises(StoreError, match=refusal):
        open_store(newest, must_exist=True)
    # What the version before migrations looks at has changed too, so that it refuses as well.
    assert {"name": "store_version", "value": NEXT} in after["meta"]
    path.unlink()
    copy.rename(path)
    with open_store(newest) as store:
        assert len(store.sessions()) == 4


def test_a_file_from_the_future_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with open_store(tmp_path) as store:
        path = store.path
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
    ways: tuple[dict[str, Any], ...] = ({"must_exist": True}, {"exclusive": True})
    for options in ways:
        refusal = rf"schema 9999, this version knows those up to {migration.HEAD}.*open it with that"
        with pytest.raises(StoreError, match=refusal):
            open_store(tmp_path, **options)
    assert everything(path)["sessions"] == []


@pytest.mark.parametrize(
    ("then", "complaint"),
    [
        ("op.execute('UPDATE absent SET x = 1')", "OperationalError: no such table: absent"),
        ("{}['gone']", "KeyError: 'gone'"),
        ("op.execute('DELETE FROM studies')", "would refer to a studies that is gone"),
        (
            "with op.batch_alter_table('sessions', recreate='always') as t: t.add_column(sql.Column('x', sql.Text))",
            "would let numbers of sessions be given out again",
        ),
    ],
)
def test_a_revision_that_fails_changes_nothing(
    newest: Path, later: Callable[..., Path], then: str, complaint: str
) -> None:
    before = everything(newest / "lab.sqlite")
    later(then)
    with pytest.raises(StoreError, match=complaint) as caught:
        open_store(newest, exclusive=True)
    assert "\n" not in str(caught.value)
    assert everything(newest / "lab.sqlite") == before
    (copy,) = migration.copies_beside(newest / "lab.sqlite")
    assert everything(copy) == before


def test_a_table_that_others_refer_to_may_be_replaced(newest: Path, later: Callable[..., Path]) -> None:
    before = everything(newest / "lab.sqlite")
    later(
        "with op.batch_alter_table('sessions', recreate='always', table_kwargs={'sqlite_autoincrement': True}) as t: "
        "t.alter_column('pace', type_=sql.String(20))"
    )
    with open_store(newest, exclusive=True) as store:
        with store._database.read() as connection:
            assert connection.exec_driver_sql("PRAGMA foreign_keys").scalar() == 1
        highest = max(row["number"] for row in before["sessions"])
        made = store.create_participant(shipped_study(), seed=1, public_id="new", utc=UTC)
        assert made.participant == f"P{highest + 1:03d}"  # of an erased one no number is given out again
    after = everything(newest / "lab.sqlite")
    assert [row["participant"] for row in after["sessions"][:-1]] == [row["participant"] for row in before["sessions"]]


def test_whoever_comes_second_finds_the_work_done(
    newest: Path, later: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = everything(newest / "lab.sqlite")
    later()
    first: list[bool] = []

    def meanwhile(database: Database) -> None:
        """Between this opener's look at the file and its lock, another one does all the work."""
        if not first:
            first.append(True)
            open_store(newest, must_exist=True).close()
        bring_up(database)

    bring_up = Database._bring_up
    monkeypatch.setattr(Database, "_bring_up", meanwhile)
    open_store(newest, must_exist=True).close()
    assert {row["made_up"] for row in everything(newest / "lab.sqlite")["tasks"]} == {1}
    (copy,) = migration.copies_beside(newest / "lab.sqlite")
    assert everything(copy) == before


def test_a_lab_killed_in_mid_migration_finds_its_data_whole(newest: Path, later: Callable[..., Path]) -> None:
    before = everything(newest / "lab.sqlite")
    folder = later("os.kill(os.getpid(), signal.SIGKILL)")
    code = f"""
from pathlib import Path
from study.store import migration, open_store
migration.REVISIONS, migration.HEAD = Path({str(folder)!r}), {NEXT!r}
open_store({str(newest)!r}, exclusive=True)
"""
    killed = subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=60)
    assert killed.returncode == -signal.SIGKILL
    assert everything(newest / "lab.sqlite") == before
    (folder / "versions" / "made_up.py").write_text(REVISION.replace("[then]", ""), encoding="utf-8")
    with open_store(newest, exclusive=True) as store:
        assert len(store.sessions()) == 4


@pytest.mark.slow
def test_killed_at_any_statement_of_its_way_up_a_folder_is_whole_at_the_next_start(tmp_path: Path) -> None:
    data, kills = recorded_data("kinematic", tmp_path), 9
    before = everything(data / "lab.sqlite")
    command = [sys.executable, "-m", "tests.support.killed_migrations", str(data), str(tmp_path), str(kills)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 60
    changed = 0
    for number in range(kills):
        folder = tmp_path / str(number)
        left = everything(folder / "lab.sqlite")
        changed += left != before  # only the last ones: from the commit on
        if left != before:
            assert set(left) > set(before)
        with open_store(folder, exclusive=True) as store:
            assert len(store.sessions()) == 4
        kept(before, everything(folder / "lab.sqlite"))
        assert not verify_data(folder).findings
    assert 0 < changed < kills / 2


def test_nothing_is_brought_up_under_a_running_lab(newest: Path, later: Callable[..., Path]) -> None:
    with open_store(newest, exclusive=True):
        later()
        with pytest.raises(StoreError, match="another lab is running"):
            open_store(newest, must_exist=True)
    assert not migration.copies_beside(newest / "lab.sqlite")


def test_nothing_is_brought_up_when_the_copy_cannot_be_written(newest: Path, later: Callable[..., Path]) -> None:
    before = everything(newest / "lab.sqlite")
    later()
    wanted = f"lab.schema-{int(NEXT) - 1:04d}.sqlite"
    (newest / f"{wanted}.unfinished").mkdir()
    with pytest.raises(StoreError, match=f"needs a copy of it first, and {re.escape(wanted)} cannot be written"):
        open_store(newest, exclusive=True)
    assert everything(newest / "lab.sqlite") == before


def test_a_lock_that_cannot_be_made_is_one_line(newest: Path, later: Callable[..., Path]) -> None:
    later()
    (newest / "lab.lock").unlink()
    (newest / "lab.lock").mkdir()
    with pytest.raises(StoreError, match="cannot be used as data folder: Is a directory"):
        open_store(newest, must_exist=True)


def test_erasing_somebody_removes_the_copies_that_hold_them(newest: Path, later: Callable[..., Path]) -> None:
    later()
    with open_store(newest, exclusive=True) as store:
        assert migration.copies_beside(store.path)
        store.erase(FINISHED, UTC)
        assert not migration.copies_beside(store.path)


@pytest.mark.parametrize(("schema", "robot"), recordings.CASES)
def test_a_row_read_from_a_recorded_file_is_the_row_of_its_export(schema: str, robot: str, tmp_path: Path) -> None:
    with open_store(recorded_data(robot, tmp_path, schema), must_exist=True) as store:
        rows = [asdict(row) for row in store.rows_of("ticks", MIDWAY)]
    folder = recorded_export(robot, tmp_path, schema)
    with (folder / "ticks.csv").open(newline="") as file:
        names = next(csv.reader(file))  # of columns that came later, a revision may know what the export does not say
    exported = [asdict(row) for row in read_table(folder, "ticks") if row.participant == MIDWAY]
    assert [{name: row[name] for name in names} for row in rows] == [
        {name: row[name] for name in names} for row in exported
    ]


@pytest.mark.parametrize("table", ["ticks", "practice_ticks"])
def test_ticks_of_before_say_who_decided(table: str, tmp_path: Path) -> None:
    data = recorded_data("kinematic", tmp_path, "0001")
    with closing(sqlite3.connect(data / "lab.sqlite")) as connection, connection:
        given = f"SELECT rowid FROM {table} WHERE source = 'user' LIMIT 2"
        (turned,), (halted,) = connection.execute(given).fetchall()
        for row, user, action in ((turned, (0, -1, -1), (0, 0, 1)), (halted, (1, 0, 0), (0, 0, 0))):
            connection.execute(
                f"UPDATE {table} SET user_x = ?, user_y = ?, user_z = ?, action_x = ?, action_y = ?, action_z = ? "
                "WHERE rowid = ?",
                (*user, *action, row),
            )
    with open_store(data, must_exist=True):
        pass
    after = everything(data / "lab.sqlite")[table]
    assert {row["departure"] for row in after if row["source"] == "user"} == {0.0}
    assert {row["departure"] for row in after if row["source"] not in ("user", "blend")} == {None}
    departures = sorted(row["departure"] for row in after if row["source"] == "blend")
    assert departures == pytest.approx([1.0, (2 + 2**0.5) ** 0.5])


# ---- on a server


@pytest.fixture
def on_server(postgres: PostgresServer, tmp_path: Path) -> DataPlace:
    """A database of this version, with somebody in it."""
    place = DataPlace(tmp_path / "own", postgres.url(postgres.database()))
    with open_store(place, exclusive=True) as store:
        made = store.create_participant(shipped_study(), seed=1, public_id="first", utc=UTC)
        store.commit(Batch(tasks=(task_row(made.participant),)))
    return place


@pytest.mark.parametrize("opened_by", ["lab", "export"])
def test_an_older_database_on_a_server_is_brought_up(
    opened_by: str, on_server: DataPlace, later: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    later()
    open_store(on_server, exclusive=opened_by == "lab", must_exist=opened_by == "export").close()
    assert found_in(on_server, "SELECT made_up FROM tasks") == [(1,)]
    assert found_in(on_server, "SELECT version_num FROM alembic_version") == [(NEXT,)]
    with open_store(on_server) as store:
        assert store.create_participant(shipped_study(), seed=1, public_id="new", utc=UTC).participant == "P002"
    monkeypatch.undo()
    with pytest.raises(StoreError, match=f"written by a later version .*schema {NEXT}"):
        open_store(on_server, must_exist=True)


def test_a_revision_that_fails_on_a_server_changes_nothing(on_server: DataPlace, later: Callable[..., Path]) -> None:
    all_of_them = "SELECT table_name, column_name FROM information_schema.columns WHERE table_schema = 'public'"
    columns = f"{all_of_them} ORDER BY 1, 2"
    before = found_in(on_server, columns)
    later("op.execute('UPDATE absent SET x = 1')")
    with pytest.raises(StoreError, match='relation "absent" does not exist; nothing was changed') as caught:
        open_store(on_server, exclusive=True)
    assert "\n" not in str(caught.value)
    assert found_in(on_server, columns) == before


def test_no_export_brings_up_what_a_lab_has_open(on_server: DataPlace, later: Callable[..., Path]) -> None:
    with open_store(on_server, exclusive=True):
        later()
        with pytest.raises(StoreError, match="another lab is running"):
            open_store(on_server, must_exist=True)
