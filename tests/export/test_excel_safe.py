"""An export that is opened in a spreadsheet runs nothing, in whatever way that spreadsheet parts cells; and nothing is
lost by it."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from study.export.csv_words import excel_safe_cell_of, text_of
from study.export.export import EXCEL_SAFE, export, read_meta, read_table
from study.records import EventRow, columns
from study.store import Batch, open_store
from study.store.store import Store
from tests.support.study_samples import shipped_study

FORMULAS = ("=", "+", "-", "@", "＝", "＋", "－", "＠")
HOSTILE = [
    *(f"{one}cmd|' /C calc'!A0" for one in FORMULAS),
    "\t=1+1",
    "\r=1+1",
    "\n=1+1",
    "  =1+1",
    '"=1+1',
    "'=1+1",
    "a;=HYPERLINK(1);",
    'a;"=1+1"',
    "a\t@SUM(1)",
    "a\n+1+cmd",
    "a|-2+3",
    '{"a": "b;=1+1"}',
    "-left",
]


def spreadsheet(text: str, separator: str) -> list[str]:
    """The cells of a line as a spreadsheet gets them that parts cells here, wherever quotes stand."""
    return next(csv.reader(io.StringIO(text), delimiter=separator))


def runs(cell: str) -> bool:
    stripped = cell.lstrip(" \t\r\n\"'")
    if re.fullmatch(r"[+-]?[0-9.]+(e[+-]?[0-9]+)?", stripped):
        return False  # a number
    return cell[:1] in ("\t", "\r") or (cell.lstrip()[:1] in FORMULAS)


@pytest.mark.parametrize("words", [True, False])
@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_begins_a_formula_in_any_spreadsheet(text: str, words: bool) -> None:
    cell = excel_safe_cell_of(text, words)
    assert text_of(cell) == text
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerow(["P001", cell, "1.5"])
    for separator in (",", ";", "\t", "|"):
        for line in file.getvalue().splitlines() or [""]:
            assert not [found for found in spreadsheet(line, separator) if runs(found)], (separator, line)


@given(st.text(), st.booleans())
def test_every_text_comes_back(text: str, words: bool) -> None:
    cell = excel_safe_cell_of(text, words)
    assert text_of(cell) == text
    assert not runs(cell) or cell == text.strip()


@pytest.mark.parametrize("number", ["-3", "-0.5", "7", "0"])
def test_numbers_that_were_typed_stay_numbers(number: str) -> None:
    assert excel_safe_cell_of(number, True) == number


def test_an_export_for_spreadsheets_is_read_back_and_its_numbers_are_numbers(tmp_path: Path) -> None:
    with open_store(tmp_path / "data", exclusive=True) as store:
        _fill(store)
        export(store, tmp_path / "plain")
        export(store, tmp_path / "safe", excel_safe=True)
    assert read_meta(tmp_path / "safe")["words"] == EXCEL_SAFE
    for table in ("participants", "events", "trials"):
        assert read_table(tmp_path / "safe", table) == read_table(tmp_path / "plain", table)
        plain, safe = (pd.read_parquet(tmp_path / name / f"{table}.parquet") for name in ("plain", "safe"))
        pd.testing.assert_frame_equal(plain, safe)
    events = pd.read_csv(tmp_path / "safe" / "events.csv", keep_default_na=False)
    texts = {info.name for info in columns("events") if info.type == "str"}
    assert not [cell for name in texts for cell in events[name] if runs(str(cell))]
    hostile = next(row for row in read_table(tmp_path / "safe", "events") if row.kind.startswith("="))
    assert hostile.kind == "=cmd" and json.loads(hostile.data) == {"a": "b;=1+1"}


def _fill(store: Store) -> None:
    made: Any = store.create_participant(shipped_study(), seed=1, public_id="a", utc="2026-01-01T00:00:00Z", tokens={})
    event = EventRow(made.participant, None, None, "2026-01-01T00:00:00.000Z", "=cmd", "lab", '{"a": "b;=1+1"}')
    store.commit(Batch(events=(event, replace(event, kind="noted", data="{}"))))
