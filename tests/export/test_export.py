"""The data package: the same bytes every time, nobody's name in it, and read back as it was written."""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import json
import sqlite3
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from study.definition.study import parse_study
from study.export.export import ExportError, export, export_zip, read_meta, read_table, write_tables
from study.flow.flow import FLOW
from study.records import SCHEMA_VERSION, TABLES, StudyError, columns
from study.store import Batch, ConsentGiven, Store, open_store
from tests.support.study_samples import (
    UTC,
    alert_row,
    answer_row,
    event_row,
    shipped_study,
    task_row,
    tick_row,
    trial_row,
)

FILES = {
    *(f"{table}.{extension}" for table in TABLES for extension in ("csv", "parquet")),
    *("codebook.csv", "questionnaires.json", "study.toml", "meta.json", "datapackage.json", "SHA256SUMS"),
}


def fill(store: Store, public_id: str, **options: Any) -> str:
    """A participant with something in every table."""
    session = store.create_participant(
        options.pop("study", shipped_study()), seed=5, public_id=public_id, utc=UTC, **options
    )
    who = session.participant
    store.commit(
        Batch(
            session=FLOW.advance(session.session, "consent_given", 0.0)[0],
            consent=ConsentGiven(UTC, "c" * 64),
            finished_utc=UTC,
            ticks=tuple(tick_row(who, n, p_x=n / 3, late_ms=None) for n in range(3)),
            practice_ticks=(tick_row(who, 0),),
            trials=(dataclasses.replace(trial_row(who), outcome="completed", ticks=3),),
            tasks=(task_row(who, 1), task_row(who, 2, reason="wrong bin, “really”", outcome="failure")),
            alerts=(alert_row(who),),
            answers=(answer_row(who), answer_row(who, "comments", 'one, "two"\r\nthree\rfour\n=5')),
            events=(event_row(who, data=json.dumps({"text": "äöü"})),),
        )
    )
    return who


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "data") as opened:
        yield opened


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_every_table_is_there_in_its_columns_order(store: Store, tmp_path: Path) -> None:
    fill(store, "a")
    counts = export(store, tmp_path / "out")
    assert set(contents(tmp_path / "out")) == FILES
    assert (counts["ticks"], counts["tasks"], counts["participants"]) == (3, 2, 1)
    for table in TABLES:
        with (tmp_path / "out" / f"{table}.csv").open(encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        assert header == [info.name for info in columns(table)]
        assert len(rows) == counts[table]


def test_what_is_read_back_is_what_was_stored(store: Store, tmp_path: Path) -> None:
    fill(store, "a")
    fill(store, "b")
    export(store, tmp_path / "out")
    for table in TABLES:
        expected = list(store.rows(table))
        assert read_table(tmp_path / "out", table) == expected
        assert expected


def test_the_same_data_give_the_same_bytes(store: Store, tmp_path: Path) -> None:
    fill(store, "a")
    export(store, tmp_path / "one")
    export(store, tmp_path / "two")
    assert contents(tmp_path / "one") == contents(tmp_path / "two")
    for name in ("one.zip", "two.zip", "two.zip"):  # an earlier archive is replaced
        assert export_zip(store, tmp_path / "zips" / name)["ticks"] == 3
    assert len(set(contents(tmp_path / "zips").values())) == 1
    with zipfile.ZipFile(tmp_path / "zips" / "one.zip") as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == contents(tmp_path / "one")


def test_names_and_demo_participants_stay_in_the_lab(store: Store, tmp_path: Path) -> None:
    fill(store, "public-id-a", identities={"name": "Ada Lovelace"}, tokens={"participant": "ab" * 32})
    demo = fill(store, "demo", kind="demo")
    export(store, tmp_path / "out")
    everything = b"".join(contents(tmp_path / "out").values())
    for hidden in (b"Lovelace", b"ab" * 32, b"public-id-a", f"\n{demo},".encode()):
        assert hidden not in everything
    export(store, tmp_path / "out", include_demo=True)
    assert [row.participant for row in read_table(tmp_path / "out", "participants")] == ["P001", demo]
    pilot = fill(store, "pilot", kind="pilot")
    export(store, tmp_path / "out")
    assert [row.participant for row in read_table(tmp_path / "out", "participants")] == ["P001"]
    export(store, tmp_path / "out", include_pilot=True)
    people = read_table(tmp_path / "out", "participants")
    assert [(row.participant, row.kind) for row in people] == [("P001", "study"), (pilot, "pilot")]


def test_a_trial_that_still_runs_has_the_ticks_of_so_far(store: Store, tmp_path: Path) -> None:
    who = fill(store, "running")
    begun = dataclasses.replace(trial_row(who), outcome="running", ticks=0, overruns=0)
    over = dataclasses.replace(begun, trial=2, outcome="completed", ticks=9, overruns=8)
    late_ms = (0.1, 50.0, 50.1, None, 700.0)
    later = [tick_row(who, 3 + n, late_ms=late) for n, late in enumerate(late_ms)]
    store.commit(Batch(trials=(begun, over), ticks=(*later, tick_row(who, 0, trial=2))))
    fill(store, "somebody else")
    export(store, tmp_path / "out")
    first, second, *_ = read_table(tmp_path / "out", "trials")
    assert first == dataclasses.replace(begun, ticks=8, overruns=2)
    assert second == over


def test_every_column_is_in_the_codebook(store: Store, tmp_path: Path) -> None:
    export(store, tmp_path / "out")
    with (tmp_path / "out" / "codebook.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert [(line["table"], line["column"]) for line in lines] == [
        (table, info.name) for table in TABLES for info in columns(table)
    ]
    assert all(line["description"] for line in lines)
    levels = {(line["table"], line["column"]): line["levels"] for line in lines}
    assert levels["ticks", "source"] == "user|blend|robot|idle|gripper|reset|free"


def test_the_study_file_comes_along_unchanged(store: Store, tmp_path: Path) -> None:
    fill(store, "a")
    export(store, tmp_path / "out")
    assert (tmp_path / "out" / "study.toml").read_text(encoding="utf-8") == shipped_study().source_text
    later = parse_study(shipped_study().source_text + "\n# typo mended\n")
    fill(store, "b", study=later)
    export(store, tmp_path / "out")
    names = {f"study-{study.hash[:12]}.toml" for study in (shipped_study(), later)}
    assert set(contents(tmp_path / "out")) == FILES | names
    assert (tmp_path / "out" / "study.toml").read_text(encoding="utf-8") == later.source_text
    meta = read_meta(tmp_path / "out")
    assert meta["studies"] == [shipped_study().hash, later.hash]
    assert meta["machines"][0]["numpy"] == np.__version__


def test_a_folder_with_something_else_in_it_is_left_alone(store: Store, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ExportError, match="not empty and not an earlier export"):
        export(store, tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"
    with pytest.raises(ExportError, match="cannot be written"):
        export(store, tmp_path / "thesis.tex" / "out")
    with pytest.raises(ExportError, match="there already, and not an earlier export"):
        export_zip(store, tmp_path / "thesis.tex")
    with pytest.raises(ExportError, match="cannot be written"):
        export_zip(store, tmp_path / "thesis.tex" / "out.zip")
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_an_earlier_export_is_replaced_unless_something_beside_it_would_be_lost(store: Store, tmp_path: Path) -> None:
    out = tmp_path / "out"
    export(store, out)
    (out / "study-0123456789ab.toml").write_text("of an earlier study")
    (out / ".DS_Store").touch()
    fill(store, "a")
    export(store, out)
    assert len(read_table(out, "ticks")) == 3
    assert set(contents(out)) == FILES
    (out / "notes.txt").write_text("mine")
    with pytest.raises(ExportError, match=r"and notes\.txt beside it, which would be lost; move that elsewhere"):
        export(store, out)
    assert (out / "notes.txt").read_text() == "mine"


def test_an_export_that_a_version_of_before_left_half_done_says_so_and_is_replaced(
    store: Store, tmp_path: Path
) -> None:
    fill(store, "a")
    out = tmp_path / "out"
    export(store, out)
    meta = json.loads((out / "meta.json").read_text(encoding="utf-8"))
    (out / "meta.json").write_text(json.dumps({**meta, "complete": False}), encoding="utf-8")
    with pytest.raises(ExportError, match="interrupted"):
        read_table(out, "ticks")
    export(store, out)
    assert len(read_table(out, "ticks")) == 3


def test_simulated_rows_are_written_the_same_way(tmp_path: Path) -> None:
    numpy_row = tick_row("S001", 0, p_x=np.float64(0.1), blocked=np.bool_(False), user_x=np.int64(1))
    counts = write_tables(tmp_path, {"ticks": iter([numpy_row])}, studies={"h": "title = 1"}, meta={"seed": 7})
    assert counts["ticks"] == 1
    assert read_table(tmp_path, "ticks") == [tick_row("S001", 0, p_x=0.1)]
    assert read_table(tmp_path, "alerts") == []
    assert read_meta(tmp_path)["seed"] == 7
    with pytest.raises(ExportError, match="no tables"):
        write_tables(tmp_path, {"tick": []})


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        ("ticks.csv", ",p_x,", ",px,", r"ticks\.csv: columns missing: p_x"),
        ("ticks.csv", "P001,balanced,1,1,pickup,1,", "P001,balanced,1,1,pickup,one,", r"ticks\.csv:3: tick is 'one'"),
        ("ticks.csv", "P001,balanced,1,1,pickup,1,", "P001,balanced,1,1,pickup,,", r"ticks\.csv:3: tick is blank"),
        ("ticks.csv", "P001,balanced,1,1,pickup,2,", "P001,balanced\n,", r"ticks\.csv:4: the row ends before column"),
        ("meta.json", f'"schema_version": {SCHEMA_VERSION}', '"schema_version": 99', "schema version 99, this version"),
        ("meta.json", "shared-autonomy-lab", "another", "not the meta.json of an export"),
        ("meta.json", "{", "", "cannot be read"),
    ],
)
def test_a_data_set_that_does_not_fit_says_what_is_wrong(
    store: Store, tmp_path: Path, file: str, old: str, new: str, says: str
) -> None:
    fill(store, "a")
    export(store, tmp_path / "out")
    path = tmp_path / "out" / file
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ExportError, match=says):
        read_table(tmp_path / "out", "ticks")


def test_a_missing_folder_table_or_name_says_so(store: Store, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="no export here"):
        read_table(tmp_path / "nothing", "ticks")
    export(store, tmp_path / "out")
    (tmp_path / "out" / "tasks.csv").unlink()
    with pytest.raises(ExportError, match=r"tasks\.csv: missing"):
        read_table(tmp_path / "out", "tasks")
    with pytest.raises(StudyError, match="tables are"):
        read_table(tmp_path / "out", "identities")


def test_columns_of_a_later_version_are_passed_over(store: Store, tmp_path: Path) -> None:
    who = fill(store, "a")
    export(store, tmp_path / "out")
    path = tmp_path / "out" / "events.csv"
    header, row = path.read_text(encoding="utf-8").splitlines()
    path.write_text(f"note,{header}\nhello,{row}\n", encoding="utf-8")
    assert [event.participant for event in read_table(tmp_path / "out", "events")] == [who]


def test_a_row_that_cannot_be_written_takes_no_other_with_it_and_is_counted(store: Store, tmp_path: Path) -> None:
    damaged, whole = fill(store, "a"), fill(store, "b")
    store.commit(Batch(events=(event_row(damaged, utc="yesterday"),)))
    with contextlib.closing(sqlite3.connect(store.path)) as file:
        file.execute("UPDATE ticks SET p_x = 'far' WHERE participant = ? AND tick = 1", (damaged,))
        file.execute("UPDATE studies SET text = 'title = '")
        file.commit()
    counts = export(store, tmp_path / "out")
    assert (counts["ticks"], counts["events"]) == (5, 2)
    meta = read_meta(tmp_path / "out")
    assert meta["unwritten_rows"] == {"events": {damaged: 1}, "ticks": {damaged: 1}}
    assert meta["unreadable_studies"] == meta["studies"]
    assert [row.participant for row in read_table(tmp_path / "out", "ticks")] == [damaged] * 2 + [whole] * 3
