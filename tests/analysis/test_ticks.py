"""Ticks of an export: Parquet that is as it was written says what the CSV says, and whatever is wrong the CSV tells."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from study.analysis import ticks
from study.analysis.dataset import DataSet, load
from study.analysis.ticks import LightTick, Ticks
from study.export.export import read_table, write_tables
from study.records import TABLES, StudyError
from tests.support.analysis_samples import data_set

pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return data_set(3).write(tmp_path_factory.mktemp("export"))


def packed_alone(folder: Path, to: Path, **changed: Any) -> Path:
    """The export again with other rows of ticks in it, and no CSV of them that anybody could read."""
    tables = {table: read_table(folder, table) for table in TABLES}
    write_tables(to, {**tables, **changed})
    (to / "ticks.csv").write_text("nothing\n")
    return to


def names(folder: Path) -> set[tuple[str, int]]:
    return {(row.participant, row.trial) for row in read_table(folder, "trials")}


def told(data: DataSet) -> tuple[Any, ...]:
    return data.measures, data.scores, data.quality.ticks, data.quality.pauses


def test_both_have_the_same_ticks_and_the_same_measures(export: Path) -> None:
    packed, read = Ticks(export, names(export), names(export)), Ticks(export, names(export), names(export))
    found = list(packed.packed())
    assert found == list(read.read()) and all(type(tick) is LightTick for tick in found)
    assert {tuple(map(type, tick)) for tick in found} == {(str, int, int, int, str, int, str, float, int)}
    assert (packed.count, packed.pauses) == (read.count, read.pauses) == (len(found), sum(t.after_pause for t in found))
    assert told(load(export, as_written=True)) == told(load(export))


def test_what_is_as_it_was_written_needs_no_csv_of_ticks(
    export: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = packed_alone(export, tmp_path / "packed")
    monkeypatch.setattr("study.export.parquet._READ_ROWS", 37)  # a trial goes on in the next rows
    assert told(load(folder, as_written=True)) == told(load(export))
    with pytest.raises(StudyError, match=r"ticks\.csv"):
        load(folder)


def test_only_trials_that_are_kept_pass(export: Path) -> None:
    kept = set(sorted(names(export))[:2])
    packed, read = Ticks(export, kept, names(export)), Ticks(export, kept, names(export))
    assert list(packed.packed()) == list(read.read()) and packed.count == read.count > 0


def _again(rows: list[Any]) -> list[Any]:
    return [*rows[:5], rows[4], *rows[5:]]


def _apart(rows: list[Any]) -> list[Any]:
    return [*rows[3:], *rows[:3]]


def _backwards(rows: list[Any]) -> list[Any]:
    return [*rows[:3], rows[4], rows[3], *rows[5:]]


def _strange(rows: list[Any]) -> list[Any]:
    return [*rows, replace(rows[-1], participant="P999", task=1)]


def _not_finite(rows: list[Any]) -> list[Any]:
    return [replace(rows[0], entropy=float("nan")), *rows[1:]]


def _negative(rows: list[Any]) -> list[Any]:
    return [replace(rows[0], tick=-1), *rows[1:]]


@pytest.mark.parametrize("wrong", [_again, _apart, _backwards, _strange, _not_finite, _negative])
def test_what_is_not_in_order_the_csv_tells(export: Path, tmp_path: Path, wrong: Any) -> None:
    folder = tmp_path / "wrong"
    rows = wrong(read_table(export, "ticks"))
    write_tables(folder, {**{table: read_table(export, table) for table in TABLES}, "ticks": rows})
    with pytest.raises(ValueError, match="not in order"):
        list(Ticks(folder, names(folder), names(folder)).packed())
    with pytest.raises(StudyError) as packed:
        load(folder, as_written=True)
    with pytest.raises(StudyError) as read:
        load(folder)
    assert str(packed.value) == str(read.value)


def test_a_file_that_is_no_parquet_is_passed_over(export: Path, tmp_path: Path) -> None:
    folder = tmp_path / "broken"
    write_tables(folder, {table: read_table(export, table) for table in TABLES})
    (folder / "ticks.parquet").write_bytes(b"PAR1 and no more")
    assert told(load(folder, as_written=True)) == told(load(export))


def test_without_what_reads_it_the_csv_is_read(export: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ticks, "has_parquet", lambda: False)
    monkeypatch.setattr(ticks.Ticks, "packed", lambda _: pytest.fail("it cannot be read"))
    assert told(load(export, as_written=True)) == told(load(export))
