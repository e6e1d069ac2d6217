"""Whatever somebody answers, `pandas.read_csv` with nothing said gets it back, and no spreadsheet runs it."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pandas._libs.parsers import STR_NA_VALUES

from study.export.csv_words import HOW_TO_READ, cell_of, text_of
from study.export.export import read_table, write_tables
from study.records import AlertRow, SurveyAnswerRow
from tests.support.study_samples import UTC

NUMBER_LIKE = [
    *("007", "00", "0482.1", "482.10", "1e5", "1E5", "1e400", "+5", "5.", ".5", "-.5", "- 5", "1_000", "0x10", "1,234"),
    *("12345678901234567890", "0.1234567890123456789", "inf", "-inf", "Infinity", "nan", "-nan", "1.#QNAN", "1e", "-0"),
    *("3,5", "1-2", "1/2", "10:30", "2026-01-31", "31.12.2026", "0123 456789", "\uff15", "\u0665"),
]
WORDS = [
    *(
        "NA",
        "null",
        "None",
        "none",
        "N.A.",
        "True",
        "TRUE",
        "true",
        "False",
        "false",
        "yes",
        "",
        " ",
        "  a",
        "a  ",
        "\t",
    ),
    *('"', '""', '"a"', "'", "'5", ",", ";", "a,b", "a\nb", "a\r\nb", "a\rb", "\n", "a\tb", "\\", "\\n", "#", "# a"),
    *(
        "=1+1",
        "=cmd|' /C calc'!A0",
        "+1+1",
        "-1+1",
        "@SUM(A1)",
        "-",
        "-a",
        "\uff1d1",
        "=",
        "\t=1",
        "👍",
        "é",
        "e\u0301",
    ),
    *("\u202eabc", "a\u2028b", "a\x85b", "\ufeffa", "\u00a0", "18_24", "no_answer", "spray_bottle", "x" * 4000),
]
EVERY = sorted({*STR_NA_VALUES, *NUMBER_LIKE, *WORDS})
PLAIN = ["5", "0", "-3", "482.1", "482.0", "1", "no_answer", "spray_bottle", "18_24", "Fine, thanks.", "different"]


def read(cells: list[str]) -> list[Any]:
    """Each cell alone in a column, as pandas reads it with nothing said: no other cell decides on its type."""
    file = io.StringIO()
    lines = csv.writer(file, lineterminator="\n")
    lines.writerow(f"c{number}" for number in range(len(cells)))
    lines.writerow(cells)
    frame = pd.read_csv(io.StringIO(file.getvalue(), newline=""))
    return [frame[name].tolist()[0] for name in frame.columns]


def decoded(cell: Any) -> Any:
    """The line of the codebook and of *Read an export*."""
    return json.loads(cell) if str(cell)[:1] == '"' else cell


def test_every_word_comes_back_as_it_was_typed() -> None:
    found = [decoded(cell) for cell in read([cell_of(text) for text in EVERY])]
    assert {text: str(has) for text, has in zip(EVERY, found, strict=True)} == {text: text for text in EVERY}
    assert all(isinstance(has, str) for has in found)


def test_bare_many_of_them_would_not() -> None:
    """How many depends on the version of pandas: it was 41 of 101, and is 35."""
    found = read(EVERY)
    assert sum(str(has) != text for text, has in zip(EVERY, found, strict=True)) > len(EVERY) / 4


def test_what_nobody_misreads_stands_bare() -> None:
    assert [cell_of(text) for text in PLAIN] == PLAIN
    assert [str(has) for has in read(PLAIN)] == PLAIN


ALPHABET = "0123456789.,eE+- nNaAulOoie_infTrueFals#<>/\"'=@\t\n\r"


@settings(deadline=None, max_examples=20)
@given(st.lists(st.text(ALPHABET, max_size=8), min_size=1, max_size=60))
def test_random_words_come_back(texts: list[str]) -> None:
    found = [decoded(cell) for cell in read([cell_of(text) for text in texts])]
    assert [str(has) for has in found] == texts
    assert [text_of(cell_of(text)) for text in texts] == texts


@settings(deadline=None, max_examples=20)
@given(st.lists(st.decimals(-(10**8), 10**8, places=4).map(str), min_size=1, max_size=60))
def test_numbers_come_back_digit_by_digit(texts: list[str]) -> None:
    found = [decoded(cell) for cell in read([cell_of(text) for text in texts])]
    assert [str(has) for has in found] == texts


def test_no_cell_begins_with_what_a_spreadsheet_runs() -> None:
    for text in EVERY:
        assert not cell_of(text).startswith(("=", "+", "@", "\t", "\r")), text
        assert not cell_of(text).startswith("-") or float(cell_of(text)) < 0


def answer(item: str, value: str, typed: str | None = None) -> SurveyAnswerRow:
    return SurveyAnswerRow("P001", None, None, "demographics", item, value, UTC, typed)


def test_a_whole_export_holds_them_and_is_read_back(tmp_path: Path) -> None:
    rows = [answer(f"q{number}", text, text or None) for number, text in enumerate(EVERY)]
    rows.append(answer("null", "5"))
    alerts = [
        AlertRow("P001", "nan", 1, number, "second_device", text, 10.0, None, None, None, None, text, 0, "answered")
        for number, text in enumerate(EVERY, start=1)
    ]
    write_tables(tmp_path, {"survey_answers": rows, "alerts": alerts})
    assert read_table(tmp_path, "survey_answers") == rows
    assert read_table(tmp_path, "alerts") == alerts
    frame = pd.read_csv(tmp_path / "survey_answers.csv")
    assert [decoded(cell) for cell in frame["value"]] == [row.value for row in rows]
    assert [decoded(cell) for cell in frame["item"]] == [row.item for row in rows]
    typed = frame["typed"].astype(object).where(frame["typed"].notna(), None)
    assert [decoded(cell) for cell in typed] == [row.typed for row in rows]
    assert {decoded(cell) for cell in pd.read_csv(tmp_path / "alerts.csv")["condition"]} == {"nan"}
    assert pd.read_parquet(tmp_path / "survey_answers.parquet")["value"].tolist() == [row.value for row in rows]
    codebook = pd.read_csv(tmp_path / "codebook.csv").set_index(["table", "column"]).description
    for column in (("survey_answers", "value"), ("survey_answers", "typed"), ("alerts", "answer"), ("ticks", "goal")):
        assert HOW_TO_READ in codebook[column]
    assert HOW_TO_READ not in codebook["events", "data"]


def test_an_export_of_before_has_its_words_bare(tmp_path: Path) -> None:
    write_tables(tmp_path, {"survey_answers": [answer("a", "fine")]})
    path, meta = tmp_path / "survey_answers.csv", tmp_path / "meta.json"
    path.write_text(path.read_text().replace("fine", '"""quoted"""'))
    assert read_table(tmp_path, "survey_answers")[0].value == "quoted"
    meta.write_text(meta.read_text().replace('"words"', '"then"'))
    assert read_table(tmp_path, "survey_answers")[0].value == '"quoted"'


@pytest.mark.parametrize("cell", ['"', '"a', '"a" b'])
def test_a_cell_in_quotes_that_is_no_text_is_named(cell: str) -> None:
    with pytest.raises(ValueError):
        text_of(cell)
