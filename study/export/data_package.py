"""A folder of tables as a Frictionless data package: `datapackage.json` and checksums.

The package follows version 1 of the standard (https://specs.frictionlessdata.io), which readers in Python and R take.
Every table is one resource with a schema: a type, a description, a unit and the levels of every column, its primary
key, and the table its rows belong to. Everything else in the folder is a resource without one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from study.export.csv_words import HOW_TO_READ
from study.integrity.checksums import SUMS_NAME, sums_of
from study.json_text import parse_json
from study.records import DESCRIPTIONS, KEYS, REFERENCES, TABLES, UTC, YES_NO, ColumnInfo, columns
from study.text_file import read_text

DESCRIPTOR_NAME = "datapackage.json"
MOST_DESCRIPTOR_BYTES = 10_000_000
CODEBOOK_COLUMNS: Mapping[str, str] = {
    "table": "Table the column is in",
    "column": "Name of the column",
    "type": "int, float or str",
    "may_be_blank": "Whether a cell may be blank: yes or no",
    "unit": "Unit; blank = none",
    "levels": "All values there can be, joined by '|'; blank = any",
    "description": "What the column says, and what blank means in it",
}
_FILES: Mapping[str, str] = {
    "meta.json": "Schema version, machines with the versions of the software, counts of rows",
    "questionnaires.json": "Items, anchors, direction, scoring and source of every questionnaire and form",
}

_FRICTIONLESS_TYPES: Mapping[str, str] = {"int": "integer", "float": "number", "str": "string"}


def table_schema(table: str) -> dict[str, Any]:
    """The Table Schema of a recorded table."""
    schema: dict[str, Any] = {"fields": [_field(info) for info in columns(table)], "missingValues": [""]}
    if table in KEYS:
        schema["primaryKey"] = list(KEYS[table])
    if table in REFERENCES:
        target = REFERENCES[table]
        key = list(KEYS[target])
        schema["foreignKeys"] = [{"fields": key, "reference": {"resource": target, "fields": key}}]
    return schema


def described(info: ColumnInfo) -> str:
    """What a column says, and how its CSV is read."""
    return f"{info.description}. {HOW_TO_READ}" if info.words else info.description


def _field(info: ColumnInfo) -> dict[str, Any]:
    kind = _FRICTIONLESS_TYPES[info.type]
    if info.unit == UTC:
        kind = "datetime"
    elif info.json:
        kind = info.json
    limits: dict[str, Any] = {}
    if not info.optional:
        limits["required"] = True
    if info.levels:
        limits["enum"] = list(info.levels)
    elif info.unit == YES_NO:
        limits["enum"] = [0, 1]
    if info.least is not None:
        limits["minimum"] = info.least
    if info.most is not None:
        limits["maximum"] = info.most
    field = {"name": info.name, "type": kind, "description": described(info)}
    if info.unit:
        field["unit"] = info.unit
    return {**field, "constraints": limits} if limits else field


def write_descriptor(folder: Path, written: Sequence[str], later: Mapping[str, str], title: str) -> None:
    """Write `SHA256SUMS` and `datapackage.json` for the files written so far, and for `later`: name to text of those
    that will be written afterwards."""
    sums: dict[str, tuple[str, int]] = {name: _digest(folder / name) for name in written}
    for name, text in later.items():
        sums[name] = (hashlib.sha256(text.encode()).hexdigest(), len(text.encode()))
    resources = [_resource(name, *sums[name]) for name in sums]
    descriptor = {
        "profile": "data-package",
        "name": "shared-autonomy-study",
        "title": title,
        "description": "A shared-autonomy study, recorded by Shared Autonomy Lab",
        "resources": resources,
    }
    text = json.dumps(descriptor, indent=2, ensure_ascii=False) + "\n"
    (folder / DESCRIPTOR_NAME).write_text(text, encoding="utf-8", newline="")
    sums[DESCRIPTOR_NAME] = _digest(folder / DESCRIPTOR_NAME)
    text = sums_of({name: sha256 for name, (sha256, _) in sums.items()})
    (folder / SUMS_NAME).write_text(text, encoding="utf-8", newline="")


def descriptor_sums(folder: Path) -> dict[str, str]:
    """File to SHA-256 as the descriptor has it; empty when it cannot be read."""
    try:
        resources = parse_json(read_text(folder / DESCRIPTOR_NAME, MOST_DESCRIPTOR_BYTES, within=folder))["resources"]
        return {str(one["path"]): str(one["hash"]).removeprefix("sha256:") for one in resources}
    except (ValueError, KeyError, TypeError):
        return {}


def _digest(path: Path) -> tuple[str, int]:
    sha256, size = hashlib.sha256(), 0
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            sha256.update(block)
            size += len(block)
    return sha256.hexdigest(), size


def _resource(name: str, sha256: str, size: int) -> dict[str, Any]:
    stem, _, extension = name.rpartition(".")
    integrity = {"hash": f"sha256:{sha256}", "bytes": size}
    if extension == "csv":
        return {
            "profile": "tabular-data-resource",
            "name": stem,
            "path": name,
            "description": DESCRIPTIONS.get(stem, "Every column of every table, described"),
            "format": "csv",
            "mediatype": "text/csv",
            "encoding": "utf-8",
            "dialect": {
                "delimiter": ",",
                "quoteChar": '"',
                "doubleQuote": True,
                "lineTerminator": "\n",
                "header": True,
            },
            **integrity,
            "schema": table_schema(stem) if stem in TABLES else _codebook_schema(),
        }
    media = {"parquet": "application/vnd.apache.parquet", "json": "application/json", "toml": "application/toml"}
    description = _FILES.get(name, "The study file" if extension == "toml" else f"{stem}.csv as Parquet")
    return {
        # `type` is not of the standard: it keeps the validator from reading Parquet as one more table.
        "type": "json" if extension == "json" else "file",
        "profile": "data-resource",
        "name": name.lower(),
        "path": name,
        "description": description,
        "format": extension,
        "mediatype": media[extension],
        **integrity,
    }


def _codebook_schema() -> dict[str, Any]:
    fields = [{"name": name, "type": "string", "description": text} for name, text in CODEBOOK_COLUMNS.items()]
    return {"fields": fields, "missingValues": [""], "primaryKey": ["table", "column"]}


def file_names() -> Iterator[str]:
    """Names of the files of a package that every export has, its study files left out."""
    for table in TABLES:
        yield f"{table}.csv"
        yield f"{table}.parquet"
    yield from ("codebook.csv", "questionnaires.json", "meta.json", DESCRIPTOR_NAME, SUMS_NAME)
