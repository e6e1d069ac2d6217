"""Files that a stranger sends: one line and exit status 1, never a traceback, a hang or somebody else's file."""

from __future__ import annotations

import gzip
import io
import json
import os
import zipfile
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from app.__main__ import main
from app.errors import LabError
from app.replication.studies import Archive
from study.definition.study import load_study, parse_study
from study.definition.toml_reader import StudyFileError
from study.export.export import ExportError, export_zip, read_table
from study.json_text import parse_json
from study.language.catalogue import read as read_po
from study.language.catalogue import shipped_text
from study.store import open_store
from study.text_file import FileProblem, list_rows, opened_table, read_text
from tests.support.recordings import recorded_export
from tests.support.study_samples import lab_text

STUDY = lab_text()
BOMB = gzip.compress(b" " * 60_000_000)
"""Sixty megabytes in sixty kilobytes."""
SECRET = "nobody outside may read this"


def told(*arguments: object) -> list[str]:
    """The lines a command says on stderr; it has to fail, and to say nothing else."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        status = main([str(argument) for argument in arguments])
    assert (status, out.getvalue()) == (1, "")
    lines = err.getvalue().splitlines()
    assert "Traceback" not in err.getvalue() and SECRET not in err.getvalue()
    return lines


# ---- what is put in a file's place --------------------------------------------------------------------------------


def a_pipe(path: Path) -> None:
    os.mkfifo(path)


def a_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def a_folder(path: Path) -> None:
    path.mkdir()


def a_circle(path: Path) -> None:
    path.symlink_to(path.name)


def a_link_out(path: Path) -> None:
    secret = path.parent.parent / "secret"
    secret.write_text(SECRET, encoding="utf-8")
    path.symlink_to(secret)


def a_gap(path: Path) -> None:
    path.touch()
    os.truncate(path, 1 << 40)  # a terabyte that takes no space


def an_endless_file(path: Path) -> None:
    path.symlink_to("/proc/self/maps")


def utf_16(path: Path) -> None:
    path.write_text("title = 1\n", encoding="utf-16")


def latin_1(path: Path) -> None:
    path.write_text("title = 'Ü'\n", encoding="latin-1")


def nul_bytes(path: Path) -> None:
    path.write_bytes(b"title = 1\x00\n")


PLACED = (
    *((a_pipe, "is no regular file"), (a_device, "is no regular file"), (a_folder, "is a folder, not a file")),
    *((a_circle, "cannot be read: Too many levels of symbolic links"), (a_gap, "MB, the most that is read")),
    *((utf_16, "is UTF-16 text; save the file as UTF-8"), (latin_1, "not UTF-8 text (byte 9)")),
    (nul_bytes, "is no text: there is a NUL byte in it (byte 9)"),
)
BESIDE = (*PLACED, (a_link_out, "is a link that leads out of its folder"))
"""Of a file that somebody else named: it may not be a link to any file of this machine."""
each_place = pytest.mark.parametrize(("place", "why"), PLACED, ids=lambda one: getattr(one, "__name__", ""))
each_place_beside = pytest.mark.parametrize(("place", "why"), BESIDE, ids=lambda one: getattr(one, "__name__", ""))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder in which a study file may lie, with room outside of it."""
    inside = tmp_path / "study"
    inside.mkdir()
    return inside


@each_place
def test_a_study_file_is_one_line(folder: Path, place: Callable[[Path], None], why: str) -> None:
    file = folder / "my-study.toml"
    place(file)
    line, count = told("check", file)
    assert line.startswith(f"{file}: ") and why in line and count == f"{file}: 1 problem"
    assert len(told("simulate", "--study", file, "--out", folder / "out")) == 1


@each_place_beside
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("teamwork.toml", 'surveys = ["sus_modified", "tlx_raw"]', 'surveys = ["teamwork"]'),
        ("kitchen.toml", 'layout = "arc"', 'layout = "kitchen"'),
        ("own.de.po", 'language = "en" ', 'language = "de" '),
        ("blend.py", 'arbiter = "balanced"', 'arbiter = "blend.py:Blend"'),
    ],
)
def test_a_file_beside_it_is_one_line(
    folder: Path, place: Callable[[Path], None], why: str, name: str, old: str, new: str
) -> None:
    assert old in STUDY
    file = folder / "my-study.toml"
    text = STUDY.replace(old, new, 1)
    if name.endswith(".po"):
        text = text.replace('translation = "" ', f'translation = "{name}" ', 1)
    file.write_text(text, encoding="utf-8")
    place(folder / name)
    lines = told("check", file)
    if place is a_device:
        why = "is a link that leads out of its folder"
    assert any(name in line and why in line for line in lines), lines


@each_place_beside
@pytest.mark.parametrize("name", ["SHA256SUMS", "datapackage.json", "study.toml", "ticks.csv", "ticks.parquet"])
def test_an_export_is_verified_without_waiting(
    tmp_path: Path, place: Callable[[Path], None], why: str, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    package = recorded_export("kinematic", tmp_path)
    (package / name).unlink(missing_ok=True)
    place(package / name)
    assert main(["verify", str(package)]) == 1
    said = capsys.readouterr()
    assert name in said.out + said.err and "Traceback" not in said.err and SECRET not in said.out + said.err


@each_place_beside
@pytest.mark.parametrize("name", ["meta.json", "participants.csv", "ticks.csv", "study.toml"])
def test_an_export_is_one_line(tmp_path: Path, place: Callable[[Path], None], why: str, name: str) -> None:
    package = recorded_export("kinematic", tmp_path)
    (package / name).unlink()
    place(package / name)
    (line,) = told("analyze", package, "--changed", "--out", tmp_path / "report")
    if place is a_device:
        why = "is a link that leads out of its folder"
    assert name in line and why.removesuffix(" (byte 9)") in line
    assert len(told("analyze", package, "--out", tmp_path / "report")) == 1  # it is not the file that was written
    assert not (tmp_path / "report").exists()


# ---- what stands in a file ----------------------------------------------------------------------------------------

DEEP = 5_000
TEXTS = {
    "brackets": ("x = " + "[" * DEEP + "]" * DEEP, "nested too deeply"),
    "tables": ("x = " + "{a = " * DEEP + "1" + "}" * DEEP, "nested too deeply"),
    "a key of many parts": ("a." * 200_000 + "a = 1", "nested too deeply"),
    "a header of many parts": ("[" + "a . " * 200_000 + "a]", "nested too deeply"),
    "quoted parts": ('"a".' * 100_000 + "a = 1", "nested too deeply"),
    "a long number": ("x = " + "9" * 5_000, "a number is too long"),
    "a large number": ("x = " + "9" * 30, "a whole number must fit into 64 bits"),
    "a hexadecimal one": ("x = 0x" + "f" * 3_000, "a whole number must fit into 64 bits"),
    "a sign that is none": ('title = "a\\u0000b"', "the character U+0000 is no text"),
    "a name that is none": ('"a\\u0000b" = 1', "a name has the character U+0000 in it"),
    "half a pair": ('title = "\\ud800"', "not valid TOML"),
}


@pytest.mark.parametrize(("text", "why"), TEXTS.values(), ids=TEXTS.keys())
def test_what_no_study_says_is_one_line(folder: Path, text: str, why: str) -> None:
    file = folder / "my-study.toml"
    file.write_text(f"{text}\n", encoding="utf-8")
    line, _ = told("check", file)
    assert line.startswith(str(file)) and why in line and len(line) < 500


@pytest.mark.parametrize("sign", ["\u2028", "\u2029", "\x85", "\x0c", "\x0b", "\x1c"])
def test_only_line_feeds_end_a_line(folder: Path, sign: str) -> None:
    if sign < "\x20":
        sign = f"\\u{ord(sign):04x}"  # TOML takes these as escapes alone
    text = STUDY.replace("\ntitle = ", f'\ntitle = "a{sign}b"\nold_title = ', 1)
    with pytest.raises(StudyFileError) as error:
        parse_study(text, name="study")
    line = next(number for number, one in enumerate(text.split("\n"), start=1) if one.startswith("old_title"))
    assert any(problem.startswith(f"study:{line}: old_title") for problem in error.value.problems)


@pytest.mark.parametrize(
    "saved",
    [
        pytest.param(lambda text: text.encode("utf-8-sig"), id="Notepad"),
        pytest.param(lambda text: text.replace("\n", "\r\n").encode("utf-8-sig"), id="Notepad of Windows"),
        pytest.param(lambda text: text.encode() + b"\n\n\r\n", id="blank lines at the end"),
    ],
)
def test_what_an_editor_saves_is_read(folder: Path, saved: Callable[[str], bytes]) -> None:
    file = folder / "my-study.toml"
    text = STUDY.replace('language = "en" ', 'language = "de" ', 1).replace(
        'translation = "" ', 'translation = "own.po" ', 1
    )
    text = text.replace('surveys = ["sus_modified", "tlx_raw"]', "surveys = []", 1)
    file.write_bytes(saved(text))
    (folder / "own.po").write_bytes(saved(shipped_text("de")[1]))
    study = load_study(file)
    again = parse_study(study.source_text)  # as it comes back from the database
    assert again.hash == study.hash and study.title == load_study(None).title
    assert not study.source_text.startswith("\ufeff")


@pytest.mark.parametrize(
    "saved",
    [
        pytest.param(lambda raw: b"\xef\xbb\xbf" + raw, id="a byte order mark"),
        pytest.param(lambda raw: raw.replace(b"\n", b"\r\n"), id="line ends of Windows"),
        pytest.param(lambda raw: raw + b"\n\r\n", id="blank lines at the end"),
    ],
)
def test_a_table_saved_by_a_spreadsheet_is_read(tmp_path: Path, saved: Callable[[bytes], bytes]) -> None:
    package = recorded_export("kinematic", tmp_path)
    before = read_table(package, "participants")
    file = package / "participants.csv"
    file.write_bytes(saved(file.read_bytes()))
    assert read_table(package, "participants") == before


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (b",", b";", "a spreadsheet has saved it with ; between the cells"),
        (b"\n", b"\n" + b"9" * 5_000_000, "has a line of more than 4 MB"),
        (b"P001", b'"\xff', "not UTF-8 text"),
        (b"P001", b'"""', "cannot be read"),
        (b"kinematic", b"\x00", "is no text: there is a NUL byte in it"),
    ],
)
def test_a_table_that_cannot_be_read_is_one_line(tmp_path: Path, old: bytes, new: bytes, why: str) -> None:
    package = recorded_export("kinematic", tmp_path)
    for name in ("participants.csv", "ticks.csv"):
        file = package / name
        data = file.read_bytes()
        file.write_bytes(data + new if old == b"kinematic" else data.replace(old, new, -1 if old == b"," else 1))
    (line,) = told("analyze", package, "--changed", "--out", tmp_path / "report")
    assert "participants.csv" in line and (why in line or old == b"P001"), line
    assert len(line) < 1_000


@pytest.mark.parametrize("number", ["9" * 5_000, "9" * 30, "1_0", "١", " 1", "nan", "inf", "1e999", "-"])
def test_a_cell_that_is_no_number_is_named(tmp_path: Path, number: str) -> None:
    package = recorded_export("kinematic", tmp_path)
    file = package / "trials.csv"
    lines = file.read_text(encoding="utf-8").split("\n")
    header = lines[0].split(",")
    for column in ("trial", "round_trip_ms"):
        if column == "round_trip_ms" and number in ("9" * 5_000, "9" * 30, " 1", "١"):
            continue  # a number that is not whole may be so large, and the others float() reads as they are meant
        cells = [*csv_cells(lines[1])]
        cells[header.index(column)] = number
        file.write_text("\n".join([lines[0], joined(cells), *lines[2:]]), encoding="utf-8")
        with pytest.raises(ExportError) as error:
            read_table(package, "trials")
        assert f"trials.csv:2: {column} is " in str(error.value) and len(str(error.value)) < 500


@pytest.mark.parametrize("number", ["inf", "nan", "1e999", "-9" + "9" * 30, "1.5"])
def test_a_tick_that_is_no_number_is_one_line(tmp_path: Path, number: str) -> None:
    package = recorded_export("kinematic", tmp_path)
    file = package / "ticks.csv"
    header, first, rest = file.read_text(encoding="utf-8").split("\n", 2)
    cells = [*csv_cells(first)]
    cells[header.split(",").index("tick")] = number
    file.write_text("\n".join([header, joined(cells), rest]), encoding="utf-8")
    (line,) = told("analyze", package, "--changed", "--out", tmp_path / "report")
    assert "ticks.csv:2: tick is " in line


def csv_cells(line: str) -> list[str]:
    import csv

    return next(csv.reader([line]))


def joined(cells: list[str]) -> str:
    import csv

    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(cells)
    return text.getvalue()


def test_an_archive_that_unpacks_without_end_is_no_earlier_export(tmp_path: Path) -> None:
    bomb = tmp_path / "out.zip"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("meta.json", "w") as meta:
        for _ in range(2_000):
            meta.write(b" " * 1_000_000)  # two gigabytes in two megabytes
    before = bomb.read_bytes()
    with open_store(tmp_path / "data") as store, pytest.raises(ExportError, match="not an earlier export"):
        export_zip(store, bomb)
    assert bomb.read_bytes() == before


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"a": NaN}', "has NaN, which is no number"),
        ('{"a": 1e999}', "has a number too large"),
        ('{"a": ' + "9" * 5_000 + "}", "has a whole number beyond 64 bits"),
        ('{"a": 1, "a": 2}', "has a name twice"),
        ('{"a": "\\ud800"}', "has half a surrogate pair"),
        ('{"\\udfff": 1}', "has half a surrogate pair"),
        ("[" * 100_000 + "]" * 100_000, "is nested too deeply"),
        ("[" * 500 + "]" * 500, "is nested too deeply"),
        ("{", "Expecting property name"),
    ],
)
def test_json_means_what_the_standard_says(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        parse_json(text)
    (tmp_path / "meta.json").write_text(text, encoding="utf-8")
    (line,) = told("analyze", tmp_path, "--out", tmp_path / "report")
    assert "meta.json: cannot be read: " in line and len(line) < 500


def test_json_that_means_something_is_read() -> None:
    value = {"a": [1, -(2**63), 2**63 - 1, 0.5, None, True, "ü\u2028😀"]}
    assert parse_json(json.dumps(value)) == parse_json(json.dumps(value, ensure_ascii=False)) == value


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_list_is_read_whatever_a_spreadsheet_puts_between(tmp_path: Path, separator: str) -> None:
    file = tmp_path / "list.csv"
    rows = [["id", "status"], ["5f,3", "APPROVED"], ["x", "ret;urned"]]
    text = "\r\n".join(separator.join(f'"{cell}"' for cell in row) for row in rows)
    file.write_bytes(b"\xef\xbb\xbf" + text.encode() + b"\r\n;\r\n\r\n")
    assert [list(row) for number, row in list_rows(file, 10_000) if number < 4] == rows


def test_a_file_that_nobody_may_read_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "study.toml"
    file.write_text("", encoding="utf-8")

    def refused(*_: object) -> int:
        raise PermissionError(13, "Permission denied", str(file))

    monkeypatch.setattr(os, "open", refused)  # root may read everything
    with pytest.raises(FileProblem, match=r"study\.toml: cannot be read: Permission denied"):
        read_text(file, 10)
    with pytest.raises(FileProblem, match="cannot be read: Permission denied"):
        opened_table(file)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("nplurals=2", "nplurals=999999999999", "no language has more than nine"),
        ("nplurals=2", "nplurals=" + "9" * 5_000, "no language has more than nine"),
        ('msgstr "', 'msgstr "a\u2028b', "holds U+2028, which the library takes for the end of a line"),
        ("charset=UTF-8", "charset=zlib", "not a valid PO file"),
        ("charset=UTF-8", "charset=utf-16", "not a valid PO file"),
    ],
)
def test_a_translation_that_costs_too_much_or_would_be_changed_is_one_line(old: str, new: str, why: str) -> None:
    text = shipped_text("de")[1][:6_000].rpartition("\n\n")[0]
    assert old.lower() in text.lower()
    place = text.lower().index(old.lower())
    (first, *_) = read_po(f"{text[:place]}{new}{text[place + len(old) :]}", "de").mistakes
    assert why in first.sentence and "\n" not in first.sentence


@pytest.mark.parametrize(
    "raw",
    [b"", b"no gzip", gzip.compress(b"{}"), gzip.compress(b"[" * 9_999), BOMB],
    ids=["nothing", "no gzip", "no study", "deep", "bomb"],  # gzip's bytes have the time of day in them
)
def test_a_kept_study_that_is_none_is_one_line(tmp_path: Path, raw: bytes) -> None:
    (tmp_path / "study-0000.json.gz").write_bytes(raw)
    with pytest.raises(LabError, match=r"study-0000\.json\.gz: is no finished study: .*; remove it"):
        Archive(tmp_path, {}).load(0)
