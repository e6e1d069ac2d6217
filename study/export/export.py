"""The data package: every table as CSV and Parquet, described, with the study file and where the data came from. And
reading it back.

    datapackage.json     what is in each file (Frictionless): type, unit, levels, keys of every column; see `package`
    participants trials tasks ticks practice_ticks alerts survey_answers events, each as .csv and .parquet
    codebook.csv         every column of every table, described
    questionnaires.json  what was asked: items, anchors, scoring
    study.toml           the study file (with several in use: study-<hash>.toml each, and study.toml is the latest)
    meta.json            schema version, machines with software versions, counts
    SHA256SUMS           of all of these

The same data give the same bytes. Whatever identifies a person is not here: the store keeps it in tables of its own.
"""

from __future__ import annotations

import csv
import json
import math
import os
import reprlib
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from study.definition.questionnaires import asked
from study.definition.toml_reader import parse_toml
from study.export.cell_bounds import bounds_of, within_bounds
from study.export.csv_words import cell_of, excel_safe_cell_of, text_of
from study.export.data_package import CODEBOOK_COLUMNS, described, file_names, write_descriptor
from study.export.parquet import TableBeside, has_parquet, table_beside
from study.export.placing import put_in_place, work_folder
from study.json_text import parse_json, whole_number
from study.records import KEYS, SCHEMA_VERSION, TABLES, ColumnInfo, StudyError, codebook, columns
from study.text_file import FileProblem, opened_table, read_bytes, read_text, table_text

if TYPE_CHECKING:  # simulated studies are exported too, and need no database
    from study.store import Snapshot, Store

META_NAME = "meta.json"
FORMAT = "shared-autonomy-lab export"
WORDS = "json where quoted"
"""How words stand in the CSV (`study.export.csv_words`); exports that do not say so have them bare."""
EXCEL_SAFE = "json where quoted, in every column of text"
"""The same, where `excel_safe` was asked for."""
MOST_META_BYTES = 5_000_000
AS_SAVED = "a spreadsheet has saved it with ; between the cells, and may have changed numbers; export the data again"
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)
"""A fixed time in the archive: equal data give equal bytes."""


def _text(value: object) -> str:
    """Line ends as `\\n` alone: a bare carriage return is not quoted by every version's csv writer."""
    return str(value).replace("\r\n", "\n").replace("\r", "\n")


_WRITERS: Mapping[str, Any] = {"int": int, "float": float, "str": _text}
_AS_IT_IS: Mapping[str, Any] = {**_WRITERS, "str": str}
WITH_PARQUET = "parquet"
"""In `meta.json` false where no Parquet was written beside the CSV; else it is not named."""
_GROUP_ROWS = 20_000
"""The groups of rows in the Parquet files."""
_AT_ONCE = 1_000
"""Rows that are held and written at a time, column by column; groups are whole multiples."""


def whole_cell(cell: str) -> int:
    """As written by an export: Python's own `int` also takes `1_000`, blanks, and other scripts' digits. Raises
    `ValueError`."""
    if not cell.isascii() or not cell.removeprefix("-").isdigit():
        raise ValueError(cell)
    return whole_number(cell)


def finite_cell(cell: str) -> float:
    """A number that is one. Raises `ValueError`."""
    number = float(cell)
    if not math.isfinite(number) or "_" in cell:
        raise ValueError(cell)
    return number


_PARSERS: Mapping[str, Any] = {"int": whole_cell, "float": finite_cell, "str": str}


Told = Callable[[str, int], None]
"""Told what is being written, and how many rows of it are."""
_LITTER = (".DS_Store", "Thumbs.db", "desktop.ini")


class ExportError(StudyError):
    """A folder that cannot be written to or read from as an export; one line with what would help."""


def export(
    store: Store,
    out_dir: Path | str,
    *,
    include_demo: bool = False,
    include_pilot: bool = False,
    excel_safe: bool = False,
    told: Told | None = None,
) -> dict[str, int]:
    """Write everything recorded as a folder; rows per table. Demo and pilot participants only when asked for.

    The folder is there whole or not at all. An earlier export in its place is replaced; raises `ExportError` when
    anything else is there. `excel_safe`: no cell of the CSV begins what a spreadsheet would run. `told` is called with
    what is being written.
    """
    with store.snapshot() as recorded:
        tables, studies, meta = _contents(recorded, include_demo, include_pilot)
        words = EXCEL_SAFE if excel_safe else WORDS
        return _write_whole(Path(out_dir), tables, studies, meta, told, store.folder, words)


def export_zip(
    store: Store,
    zip_path: Path | str,
    *,
    include_demo: bool = False,
    include_pilot: bool = False,
    excel_safe: bool = False,
    told: Told | None = None,
) -> dict[str, int]:
    """The same files as one archive, which replaces an earlier one; rows per table.

    Raises `ExportError` when there is a file of that name that is no archive of an export.
    """
    path = Path(zip_path)
    if path.exists() and not _is_archive(path):
        raise ExportError(f"{path}: there already, and not an earlier export; choose another name")
    try:
        with work_folder(path.absolute().parent, store.folder) as work, store.snapshot() as recorded:
            folder, archive = work / "files", work / "archive.zip"
            folder.mkdir(mode=0o700)
            tables, studies, meta = _contents(recorded, include_demo, include_pilot)
            counts = _write(folder, tables, studies, meta, told, EXCEL_SAFE if excel_safe else WORDS)
            if told is not None:
                told("the archive", 0)
            archive.touch(0o600)
            _pack(folder, archive)
            put_in_place(archive, path)
    except OSError as error:
        raise ExportError(f"{path}: cannot be written: {error.strerror or error}") from None
    return counts


def _contents(
    recorded: Snapshot, include_demo: bool, include_pilot: bool
) -> tuple[dict[str, Iterator[Any]], dict[str, str], dict[str, Any]]:
    tables = {table: recorded.rows(table, include_demo, include_pilot) for table in TABLES}
    tables["trials"] = recorded.trials(include_demo, include_pilot)
    meta = {"machines": recorded.machines(), "erased_participants": len(recorded.erasures())}
    return tables, recorded.study_texts(include_demo, include_pilot), meta


def write_tables(
    out_dir: Path | str,
    tables: Mapping[str, Iterable[Any]],
    *,
    studies: Mapping[str, str] | None = None,
    meta: Mapping[str, Any] | None = None,
) -> dict[str, int]:
    """Write rows (of the types in `records.TABLES`) as an export, whole or not at all; tables that are not given are
    empty.

    `studies` maps the hash of a study file to its text, `meta` is added to `meta.json`. Returns rows per table.
    """
    unknown = [name for name in tables if name not in TABLES]
    if unknown:
        raise ExportError(f"no tables {unknown}; tables are {list(TABLES)}")
    return _write_whole(Path(out_dir), tables, studies or {}, meta or {})


def read_table(in_dir: Path | str, table: str) -> list[Any]:
    """All rows of an exported table; as `rows_of_table`."""
    return list(rows_of_table(in_dir, table))


def columns_in(in_dir: Path | str, table: str) -> tuple[str, ...]:
    """The names of the columns that an exported table has. Raises `ExportError`."""
    path = Path(in_dir) / f"{table}.csv"
    try:
        with opened_table(path, within=path.parent) as raw, table_text(raw) as file:
            return tuple(next(csv.reader(file), []))
    except FileProblem as problem:
        raise ExportError(str(problem)) from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ExportError(f"{path}: cannot be read: {error}") from None


def rows_of_table(in_dir: Path | str, table: str, participant: str | None = None) -> Iterator[Any]:
    """The rows of an exported table as their type, one after the other; of one participant alone, if named.

    A column that came later, and so has a default, may be missing: the rows have the default. Raises `ExportError` for
    a folder that is no export, another schema version, missing columns, a cell that is not of its column's type or
    beyond its bounds, or a key that is there twice (with file and line). Columns that are not known are ignored.
    """
    known = columns(table)
    later = {item.name for item in fields(TABLES[table]) if item.default is not MISSING}
    folder = Path(in_dir)
    words = str(read_meta(folder).get("words", ""))
    path = folder / f"{table}.csv"
    try:
        with opened_table(path, within=folder) as raw, table_text(raw) as file:
            reader = csv.reader(file)
            header = next(reader, [])
            if len(header) == 1 and ";" in header[0]:
                raise ExportError(f"{path}: {AS_SAVED}")
            infos = tuple(info for info in known if info.name in header or info.name not in later)
            missing = [info.name for info in infos if info.name not in header]
            if missing:
                raise ExportError(f"{path}: columns missing: {', '.join(missing)}; export the data again")
            row_type = TABLES[table]
            cells = [(info.name, header.index(info.name), _reader(info, words)) for info in infos]
            whose, keys = header.index("participant"), set()
            for line in reader:
                if not line:
                    continue  # a blank line, as some editors leave at the end
                try:
                    if participant is not None and line[whose] != participant:
                        continue
                    row = row_type(**{name: parse(line[position]) for name, position, parse in cells})
                except (ValueError, IndexError):
                    # `line_num` is the last line of the row: cells may hold line breaks.
                    raise ExportError(f"{path}:{reader.line_num}: {_complaint(infos, header, line, words)}") from None
                key = tuple(getattr(row, name) for name in KEYS.get(table, ()))
                if key and key in keys:
                    named = ", ".join(f"{name} {value}" for name, value in zip(KEYS[table], key, strict=True))
                    raise ExportError(f"{path}:{reader.line_num}: {named} is there twice")
                keys.add(key)
                yield row
    except FileProblem as problem:
        if not os.path.lexists(path):
            raise ExportError(f"{path}: missing; export the data again") from None
        raise ExportError(str(problem)) from None
    except UnicodeDecodeError as error:
        raise ExportError(f"{path}: not UTF-8 text ({error.reason}); export the data again") from None
    except (OSError, csv.Error) as error:
        raise ExportError(f"{path}: cannot be read: {error}") from None


def read_meta(in_dir: Path | str) -> dict[str, Any]:
    """`meta.json` of an export, checked to be of this schema version."""
    path = Path(in_dir) / META_NAME
    if not os.path.lexists(path):
        raise ExportError(f"{path.parent}: no export here ({META_NAME} is missing)")
    try:
        meta = parse_json(read_text(path, MOST_META_BYTES, within=path.parent))
    except FileProblem as problem:
        raise ExportError(str(problem)) from None
    except ValueError as error:
        raise ExportError(f"{path}: cannot be read: {error}") from None
    if not isinstance(meta, dict) or meta.get("format") != FORMAT:
        raise ExportError(f"{path}: not the {META_NAME} of an export of this lab")
    if meta.get("complete") is not True:
        raise ExportError(f"{path.parent}: this export was interrupted; export the data again")
    if meta.get("schema_version") != SCHEMA_VERSION:
        raise ExportError(
            f"{path}: schema version {meta.get('schema_version')}, this version of the lab reads {SCHEMA_VERSION}; "
            "export the data again, or read them with the version that wrote them"
        )
    return meta


def _pack(folder: Path, archive: Path) -> None:
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for path in sorted(folder.iterdir()):
            info = zipfile.ZipInfo(path.name, _ZIP_TIME)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            with path.open("rb") as source, packed.open(info, "w", force_zip64=True) as target:
                while block := source.read(1 << 20):
                    target.write(block)


def _is_archive(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive, archive.open(META_NAME) as meta:
            return _is_ours(meta.read(MOST_META_BYTES))  # no more, however much it says it unpacks to
    except (OSError, KeyError, RuntimeError, NotImplementedError, zlib.error, EOFError, zipfile.BadZipFile):
        return False


def check_place(out_dir: Path | str) -> Path:
    """Where an export to that folder goes. Raises `ExportError` when it cannot go there: it takes the folder's place,
    so that nothing but an earlier export may be lost."""
    folder = Path(out_dir)
    try:
        place = folder.resolve()
        if not place.exists():
            return place
        present = sorted(path.name for path in place.iterdir())
    except OSError as error:
        raise ExportError(f"{folder}: cannot be written: {error.strerror or error}") from None
    if present and not _is_export(place):
        raise ExportError(f"{folder}: not empty and not an earlier export; choose another folder")
    others = [name for name in present if not _is_of_export(name)]
    if others:
        more = f" and {len(others) - 1} more" if len(others) > 1 else ""
        raise ExportError(
            f"{folder}: an earlier export, which would be replaced, and {others[0]}{more} beside it, which would be "
            "lost; move that elsewhere, or choose another folder"
        )
    if place.is_mount() or place in (here := _here(), *here.parents):
        what = "where another disk is mounted" if place.is_mount() else "the folder you are in"
        raise ExportError(f"{folder}: {what}, and an export takes a folder's place; name one in it: {folder}/export")
    return place


def _here() -> Path:
    try:
        return Path.cwd()
    except OSError:  # it was removed
        return Path("/nowhere")


def _is_export(folder: Path) -> bool:
    """Whether the folder holds an export of any schema version, or one that was interrupted."""
    try:
        return _is_ours(read_bytes(folder / META_NAME, MOST_META_BYTES, within=folder))
    except FileProblem:
        return False


def _is_ours(meta_json: bytes) -> bool:
    try:
        meta = parse_json(meta_json)
    except ValueError:
        return False
    return isinstance(meta, dict) and meta.get("format") == FORMAT


def _is_of_export(name: str) -> bool:
    """Whether a file is one of an export, or what file managers leave."""
    is_study = name.startswith("study-") and name.endswith(".toml")
    return is_study or name in {*file_names(), "study.toml", *_LITTER}


def _write_whole(
    out_dir: Path,
    tables: Mapping[str, Iterable[Any]],
    studies: Mapping[str, str],
    meta: Mapping[str, Any],
    told: Told | None = None,
    data_dir: Path | None = None,
    words: str = WORDS,
) -> dict[str, int]:
    place = check_place(out_dir)
    try:
        with work_folder(place.parent, data_dir) as work:
            folder = work / "files"
            folder.mkdir(mode=0o700)
            counts = _write(folder, tables, studies, meta, told, words)
            put_in_place(folder, place)
    except OSError as error:
        raise ExportError(f"{out_dir}: cannot be written: {error.strerror or error}") from None
    return counts


def _write(
    folder: Path,
    tables: Mapping[str, Iterable[Any]],
    studies: Mapping[str, str],
    meta: Mapping[str, Any],
    told: Told | None,
    words: str,
) -> dict[str, int]:
    head = {"format": FORMAT, "schema_version": SCHEMA_VERSION, "words": words}
    unwritten: dict[str, dict[str, int]] = {}
    counts = {table: _write_table(folder, table, tables.get(table, ()), unwritten, told, words) for table in TABLES}
    extensions = ("csv", "parquet") if has_parquet() else ("csv",)
    written = [f"{table}.{extension}" for extension in extensions for table in TABLES]
    with (folder / "codebook.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(_codebook_lines())
    texts = {"study.toml" if len(studies) == 1 else f"study-{key[:12]}.toml": text for key, text in studies.items()}
    if len(studies) > 1:
        texts["study.toml"] = list(studies.values())[-1]
    data, questions, unreadable = {}, {}, []
    for key, text in studies.items():
        try:
            data[key] = parse_toml(text.encode(), f"study {key[:12]}")[0]
            questions[key] = asked(data[key])
        except (StudyError, TypeError, KeyError, AttributeError, UnicodeEncodeError):
            unreadable.append(key)  # what was stored of it has been damaged; the data are as they are
    texts["questionnaires.json"] = json.dumps({"studies": questions}, indent=2, ensure_ascii=False) + "\n"
    for name, text in texts.items():
        _put(folder, name, text)
    complete = {**head, "complete": True, "rows": counts, "studies": list(studies), **meta}
    if unwritten:
        complete["unwritten_rows"] = unwritten
    if not has_parquet():
        complete[WITH_PARQUET] = False
    if unreadable:
        complete["unreadable_studies"] = unreadable
    meta_json = json.dumps(complete, indent=2, sort_keys=True) + "\n"
    titles = {str(study.get("title")): None for study in data.values()}
    title = "; ".join(titles) or "No participants yet"
    write_descriptor(folder, [*written, "codebook.csv", *texts], {META_NAME: meta_json}, title)
    _put(folder, META_NAME, meta_json)
    return counts


def _put(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(text, encoding="utf-8", newline="")


def _write_table(
    folder: Path,
    table: str,
    rows: Iterable[Any],
    unwritten: dict[str, dict[str, int]],
    told: Told | None,
    words: str,
) -> int:
    """Write the rows as CSV, and as Parquet where it can be, while they stream by; how many there were.

    A row that cannot be is left out, so that it takes nobody else's with it: `unwritten` counts them by table and
    participant, and `meta.json` says so.
    """
    row_type = TABLES[table]
    infos = columns(table)
    names, casts = [info.name for info in infos], [(_AS_IT_IS if info.words else _WRITERS)[info.type] for info in infos]
    fields, stream, count = attrgetter(*names), iter(rows), 0
    if told is not None:
        told(table, 0)
    with (
        (folder / f"{table}.csv").open("w", encoding="utf-8", newline="") as file,
        table_beside(folder / f"{table}.parquet", table) as parquet,
    ):
        lines = csv.writer(file, lineterminator="\n")
        lines.writerow(names)
        read = 0
        while batch := list(islice(stream, _AT_ONCE)):
            if read and read % _GROUP_ROWS == 0:
                parquet.end_group()
                if told is not None:
                    told(table, count)
            read += len(batch)
            for row in batch:
                if not isinstance(row, row_type):
                    raise ExportError(f"table {table} takes {row_type.__name__}, not {type(row).__name__}")
            try:
                cells = _cells(batch, fields, casts)
                arrays = parquet.arrays(cells)
            except _NOT_WRITTEN:
                batch = list(_writable(batch, fields, casts, parquet, unwritten.setdefault(table, {})))
                if not batch:
                    continue
                cells = _cells(batch, fields, casts)
                arrays = parquet.arrays(cells)
            shown = [_shown(info, column, words) for info, column in zip(infos, cells, strict=True)]
            lines.writerows(zip(*shown, strict=True))
            parquet.add(arrays)
            count += len(batch)
    if told is not None and read:
        told(table, count)
    return count


_NOT_WRITTEN = (ValueError, TypeError, OverflowError)
"""What comes of a cell that is not what its column holds: the file was damaged, or somebody has been at it."""


def _cells(batch: list[Any], fields: Callable[[Any], tuple[Any, ...]], casts: list[Any]) -> list[list[Any]]:
    """The rows column by column, each value through the column's own type, so that a numpy number or a bool is written
    as the number it is."""
    return [_cast(column, cast) for cast, column in zip(casts, zip(*map(fields, batch), strict=True), strict=True)]


def _cast(column: Sequence[Any], cast: Any) -> list[Any]:
    kinds = set(map(type, column)) - {type(None)}
    if kinds <= {str if cast is _text else cast} and not (
        cast is _text and any("\r" in text for text in column if text)
    ):
        return list(column)  # each is what the cast would make of it
    return [None if value is None else cast(value) for value in column]


def _writable(
    batch: list[Any],
    fields: Callable[[Any], tuple[Any, ...]],
    casts: list[Any],
    parquet: TableBeside,
    unwritten: dict[str, int],
) -> Iterator[Any]:
    for row in batch:
        try:
            parquet.arrays(_cells([row], fields, casts))
        except _NOT_WRITTEN:
            name = str(row.participant)
            unwritten[name] = unwritten.get(name, 0) + 1
        else:
            yield row


def _shown(info: ColumnInfo, column: list[Any], words: str) -> list[Any]:
    """A column's cells as they stand in the CSV."""
    if words == EXCEL_SAFE and info.type == "str":
        return [None if text is None else excel_safe_cell_of(text, info.words) for text in column]
    return [None if text is None else cell_of(text) for text in column] if info.words else column


def _is_quoted(info: ColumnInfo, words: str) -> bool:
    """Whether cells of this column may be JSON, in an export whose `meta.json` says this of its words."""
    return (info.words and words in (WORDS, EXCEL_SAFE)) or (info.type == "str" and words == EXCEL_SAFE)


def _codebook_lines() -> Iterator[tuple[str, ...]]:
    yield tuple(CODEBOOK_COLUMNS)
    for info in codebook():
        yield (
            info.table,
            info.name,
            info.type,
            "yes" if info.optional else "no",
            info.unit or "",
            "|".join(info.levels),
            described(info),
        )


def _reader(info: ColumnInfo, words: str = WORDS) -> Callable[[str], Any]:
    """What turns a cell of this column into its value; blank is None where it may be. `words`: as `meta.json` says."""
    parse = within_bounds(info, text_of if _is_quoted(info, words) else _PARSERS[info.type])
    return (lambda cell: None if cell == "" else parse(cell)) if info.optional else parse


def _complaint(infos: tuple[ColumnInfo, ...], header: list[str], line: list[str], words: str) -> str:
    """What is wrong with a row that could not be read."""
    for info in infos:
        position = header.index(info.name)
        if position >= len(line):
            return f"the row ends before column {info.name}; export the data again"
        try:
            _reader(info, words)(line[position])
        except ValueError:
            value = reprlib.repr(line[position]) if line[position] else "blank"
            return f"{info.name} is {value}, must be {bounds_of(info)}"
    return "cannot be read"
