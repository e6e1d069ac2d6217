"""The data package as its readers take it: the Frictionless validator, pandas, Parquet, checksums."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from weakref import WeakSet

import pandas as pd
import pyarrow.parquet as parquet
import pytest
from frictionless import Package, Report, validate
from frictionless.resources import TableResource

from study.definition.builtin_questionnaires import INSTRUMENTS
from study.export.csv_words import HOW_TO_READ, text_of
from study.export.export import export, write_tables
from study.records import KEYS, TABLES, TickRow, columns
from study.store import open_store
from tests.export.test_export import fill
from tests.support.study_samples import answer_row, shipped_study, task_row, tick_row, trial_row


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An export of two participants with something in every table."""
    folder = tmp_path_factory.mktemp("package")
    with open_store(folder / "data") as store:
        for public_id in ("a", "b"):
            fill(store, public_id)
        export(store, folder / "out")
    return folder / "out"


def descriptor(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "datapackage.json").read_text(encoding="utf-8"))
    return found


def schema(folder: Path, table: str) -> dict[str, Any]:
    found: dict[str, Any] = next(r for r in descriptor(folder)["resources"] if r["name"] == table)["schema"]
    return found


def complaints(report: Report) -> list[str]:
    """Errors and warnings of the validator, of the package and of each file in it."""
    found = [*(error.message for error in report.errors), *report.warnings]
    for task in report.tasks:
        found += [f"{task.name}: {text}" for text in (*(error.message for error in task.errors), *task.warnings)]
    return found


def test_the_validator_accepts_it_without_a_warning(package: Path) -> None:
    report = validate(str(package / "datapackage.json"))
    assert complaints(report) == []
    assert report.valid
    assert {task.name for task in report.tasks if task.type == "table"} == {*TABLES, "codebook"}


def test_a_package_without_participants_is_valid_too(tmp_path: Path) -> None:
    with open_store(tmp_path / "data") as store:
        export(store, tmp_path / "out")
    assert complaints(validate(str(tmp_path / "out" / "datapackage.json"))) == []


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        ("ticks.csv", ",user,0,", ",nobody,0,", "nobody"),
        ("tasks.csv", "P002,", "P009,", "P009"),
        ("ticks.csv", "P001,balanced,1,1,pickup,2,", "P001,balanced,1,1,pickup,1,", "primary key"),
        ("study.toml", "title", "titel", "hash"),
    ],
)
def test_the_validator_finds_what_was_changed_afterwards(
    package: Path, tmp_path: Path, file: str, old: str, new: str, says: str
) -> None:
    for path in package.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    text = (tmp_path / file).read_text(encoding="utf-8")
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new, 1), encoding="utf-8")
    assert any(says in complaint for complaint in complaints(validate(str(tmp_path / "datapackage.json"))))


def test_every_column_of_every_table_is_described(package: Path) -> None:
    for table in TABLES:
        fields = schema(package, table)["fields"]
        assert [field["name"] for field in fields] == [info.name for info in columns(table)]
        assert all(field["description"] and field["type"] for field in fields)
    ticks = {field["name"]: field for field in schema(package, "ticks")["fields"]}
    assert ticks["p_x"]["unit"] == "m"
    assert ticks["source"]["constraints"] == {
        "required": True,
        "enum": ["user", "blend", "robot", "idle", "gripper", "reset", "free"],
    }
    assert (ticks["user_x"]["constraints"]["minimum"], ticks["user_x"]["constraints"]["maximum"]) == (-1, 1)
    assert (ticks["belief"]["type"], ticks["started_utc"]["type"]) == ("object", "datetime")
    assert schema(package, "ticks")["primaryKey"] == list(KEYS["ticks"])
    assert schema(package, "ticks")["foreignKeys"][0]["reference"] == {
        "resource": "trials",
        "fields": ["participant", "trial"],
    }


def test_every_file_has_its_checksum(package: Path) -> None:
    lines = (package / "SHA256SUMS").read_text().splitlines()
    sums = {name: digest for digest, name in (line.split("  ") for line in lines)}
    files = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in package.iterdir()}
    assert sums == {name: digest for name, digest in files.items() if name != "SHA256SUMS"}
    in_package = {resource["path"]: resource["hash"] for resource in descriptor(package)["resources"]}
    assert in_package == {
        name: f"sha256:{digest}" for name, digest in sums.items() if name not in ("SHA256SUMS", "datapackage.json")
    }


TO_THE_LAST_DIGIT: dict[str, Any] = {"float_precision": "round_trip"} if pd.__version__ < "3" else {}
"""As pandas reads anyway from version 3 on, where to ask for it is a warning."""


def test_csv_and_parquet_hold_the_same_in_pandas(package: Path) -> None:
    for table in TABLES:
        fields = {field["name"]: field["type"] for field in schema(package, table)["fields"]}
        described = {field["name"]: field["description"] for field in schema(package, table)["fields"]}
        whole = {name: "Int64" for name, kind in fields.items() if kind == "integer"}
        times = [name for name, kind in fields.items() if kind == "datetime"]
        text = {name: "string" for name, kind in fields.items() if kind in ("string", "object", "array")}
        read = pd.read_csv(
            package / f"{table}.csv",
            dtype={**whole, **text},
            keep_default_na=False,
            na_values=[""],
            **TO_THE_LAST_DIGIT,
        )
        packed = pd.read_parquet(package / f"{table}.parquet")
        assert list(packed.columns) == list(read.columns)
        assert len(packed) == len(read) > 0
        for name in read.columns:
            left, right = read[name], packed[name]
            if HOW_TO_READ in described[name]:
                left = left.map(text_of, na_action="ignore")
            if name in times:
                assert str(right.dtype).startswith("datetime64")
                left = pd.to_datetime(left, utc=True)
            for a, b in zip(left, right, strict=True):
                assert (pd.isna(a) and pd.isna(b)) or a == b, (table, name, a, b)


def test_parquet_says_what_its_columns_are(package: Path) -> None:
    field = parquet.read_schema(package / "ticks.parquet").field("late_ms")
    assert field.metadata[b"unit"] == b"ms"
    assert b"deadline" in field.metadata[b"description"]
    assert field.nullable
    assert not parquet.read_schema(package / "ticks.parquet").field("tick").nullable


def test_frictionless_reads_json_and_times_as_what_they_are(package: Path) -> None:
    ticks = Package(str(package / "datapackage.json")).get_resource("ticks")
    assert isinstance(ticks, TableResource)
    row = ticks.read_rows()[0]
    assert row["goals"] == {"spray_bottle": [0.8, 0.2, 0.85]}
    assert row["started_utc"].utcoffset().total_seconds() == 0
    assert (row["late_ms"], row["user_z"]) == (None, -1)


def test_what_was_asked_comes_along_with_anchors_and_scoring(package: Path) -> None:
    told = json.loads((package / "questionnaires.json").read_text(encoding="utf-8"))
    (study,) = told["studies"].values()
    assert list(told["studies"]) == [shipped_study().hash]
    sus, tlx = study["surveys"]
    assert sus["scoring"] == INSTRUMENTS["sus_modified"].scoring
    assert [item["reversed"] for item in sus["items"]] == [False, True] * 5
    assert tlx["items"][3]["anchors"] == {"1": "Perfect", "7": "Failure"}
    assert [item["id"] for item in study["demographics"]] == [item.id for item in shipped_study().demographics]
    assert study["comprehension"][0]["correct"] == "named"
    assert [item["id"] for item in study["debrief"]] == ["comments", "problems"]


@pytest.mark.parametrize("count", [100, 1000])
def test_a_table_is_written_without_being_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    monkeypatch.setattr("study.export.export._AT_ONCE", 10)
    monkeypatch.setattr("study.export.export._GROUP_ROWS", 30)
    alive: WeakSet[TickRow] = WeakSet()
    most = 0

    def rows() -> Iterator[TickRow]:
        nonlocal most
        for number in range(count):
            row = tick_row("P001", number)
            alive.add(row)
            most = max(most, len(alive))
            yield row

    write_tables(tmp_path, {"ticks": rows(), "trials": [trial_row("P001")], "tasks": [task_row("P001", 1)]})
    assert most <= 2 * 10 + 1, "those being written, and those that come"
    groups = parquet.ParquetFile(tmp_path / "ticks.parquet").metadata
    assert {groups.row_group(group).num_rows for group in range(groups.num_row_groups)} == {30, count % 30}


def test_a_table_longer_than_a_batch_is_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("study.export.export._AT_ONCE", 3)
    monkeypatch.setattr("study.export.export._GROUP_ROWS", 6)
    rows = [tick_row("P001", n, started_utc="2026-01-01T10:00:00Z") for n in range(8)]
    write_tables(tmp_path, {"ticks": rows, "trials": [trial_row("P001")], "tasks": [task_row("P001", 1)]})
    packed = pd.read_parquet(tmp_path / "ticks.parquet")
    assert packed["tick"].tolist() == list(range(8))
    assert packed["started_utc"].iloc[7] == pd.Timestamp("2026-01-01T10:00:00Z")


def test_text_is_kept_as_it_was_typed(tmp_path: Path) -> None:
    typed = 'Größe; "5,0"\n=1+1 \U0001f916'
    write_tables(tmp_path, {"survey_answers": [answer_row("P001", "comments", typed)]})
    assert pd.read_parquet(tmp_path / "survey_answers.parquet")["value"].tolist() == [typed]
    assert pd.read_csv(tmp_path / "survey_answers.csv")["value"].tolist() == [typed]
