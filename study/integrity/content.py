"""What stands in a row, as a hash that the database, the CSV and the Parquet of an export all lead to.

    content = SHA-256 of JSON ["ticks", {"action_x": 1, "belief": "{...}", ...}]

The object holds the row's columns in the order of their names, without those that are blank or have their default: a
column that comes later, with a default, changes no content of before. JSON is ASCII, without spaces, floats in Python's
shortest form.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any
from zlib import crc32

from study.records import KEYS, TABLES, columns

OWN_KEYS: Mapping[str, tuple[str, ...] | None] = {
    "sessions": (),
    "cycles": ("trial", "practice", "cycle"),
    "submissions": ("message_id",),
    "tokens": ("sha256",),
    "identities": None,
}
"""The lab's own tables that are chained too: what tells a participant's rows apart; None = their order of arrival."""
_ROW_TABLES = tuple(name for name in TABLES if name != "chain")
CHAINED = (*_ROW_TABLES, *OWN_KEYS)
"""Every table whose rows are chained; the chain does not hold itself."""
_KEY_CHARACTERS = 12
"""Of a token's hash, which the chain need not spell out."""
_NUMBER = "id"
"""What SQLite numbers rows by that have no key."""
_encode = json.JSONEncoder(separators=(",", ":")).encode


def _defaults(table: str) -> dict[str, Any]:
    found = {item.name: item.default for item in dataclasses.fields(TABLES[table])}
    return {name: None if value is dataclasses.MISSING else value for name, value in found.items()}


def _plain(value: Any) -> Any:
    """As SQLite keeps it: no minus before zero, nothing for what is no number."""
    if isinstance(value, float):
        return None if value != value else value + 0.0
    return value


def _text(value: Any) -> Any:
    """As an export writes what is no one's words: line ends as `\\n`, and nothing for a text of nothing."""
    return value.replace("\r\n", "\n").replace("\r", "\n") or None if isinstance(value, str) else value


_COLUMNS: Mapping[str, tuple[tuple[str, Callable[[Any], Any], Any], ...]] = {
    table: tuple(
        (info.name, _text if info.type == "str" and not info.words else _plain, _defaults(table)[info.name])
        for info in columns(table)
    )
    for table in _ROW_TABLES
}


_KEYED: Mapping[str, tuple[tuple[str, Callable[[Any], Any], Any, str], ...]] = {
    table: tuple((name, read, default, f"{_encode(name)}:") for name, read, default in of)
    for table, of in _COLUMNS.items()
}
_SORTED: Mapping[str, tuple[int, ...]] = {
    table: tuple(sorted(range(len(of)), key=lambda place, of=of: of[place][0]))  # type: ignore[misc]
    for table, of in _COLUMNS.items()
}
"""The places of a table's columns, in the order of their names."""
_MARKS = tuple(f"{number:02x}" for number in range(256))
_MARK_OF_NONE = _MARKS[crc32(b"None") & 0xFF]
_SHORT = 40
"""Characters of a text that may well come again: names, ids, sources."""
_quoted = json.encoder.encode_basestring_ascii


@lru_cache(maxsize=4096)
def _mark_of(text: str) -> str:
    return _MARKS[crc32(text.encode()) & 0xFF]


def content_of(table: str, values: Mapping[str, Any], salt: str = "") -> str:
    """The hash of a row, in hex. `salt` goes before it where the hash is published and the row is not."""
    if table in _COLUMNS:
        found = ((name, read(values.get(name)), default) for name, read, default in _COLUMNS[table])
        kept = {name: value for name, value, default in found if value is not None and value != default}
    else:
        kept = {name: value for name, value in values.items() if value is not None and name != _NUMBER}
    text = _encode([table, dict(sorted(kept.items()))])
    return hashlib.sha256(f"{salt}{text}".encode()).hexdigest()


def marks_of(table: str, values: Mapping[str, Any]) -> str:
    """Two hex digits for each column, by which one that changed is found; "" for the lab's own tables."""
    found = (str(read(values.get(name))) for name, read, _ in _COLUMNS.get(table, ()))
    return "".join(f"{crc32(text.encode()) & 0xFF:02x}" for text in found)


def content_and_marks_of(table: str, values: Mapping[str, Any], salt: str = "") -> tuple[str, str]:
    """Both at once, in half the time, since each value is put into words once for both."""
    if table not in _COLUMNS:
        return content_of(table, values, salt), ""
    try:
        return _content_and_marks_of(table, values, salt)
    except (TypeError, ValueError):  # one of them may be had
        return content_of(table, values, salt), marks_of(table, values)


def _content_and_marks_of(table: str, values: Mapping[str, Any], salt: str) -> tuple[str, str]:
    parts: list[str | None] = []
    marks: list[str] = []
    add, mark = parts.append, marks.append
    for name, read, default, key in _KEYED[table]:
        value = values.get(name)
        kind = type(value)
        if value is None:
            add(None)
            mark(_MARK_OF_NONE)
        elif kind is float and read is _plain and -math.inf < value < math.inf:
            value += 0.0
            text = repr(value)
            add(None if value == default else key + text)
            mark(_MARKS[crc32(text.encode()) & 0xFF])
        elif kind is int:
            text = repr(value)
            add(None if value == default else key + text)
            mark(_mark_of(text))
        elif kind is str and (read is _plain or "\r" not in value) and (value or read is _plain):
            add(None if value == default else key + _quoted(value))
            mark(_mark_of(value) if len(value) < _SHORT else _MARKS[crc32(value.encode()) & 0xFF])
        else:
            value = read(value)
            add(None if value is None or value == default else key + _encode(value))
            mark(_MARKS[crc32(str(value).encode()) & 0xFF])
    kept = [part for part in [parts[place] for place in _SORTED[table]] if part is not None]
    text = f'{salt}["{table}",{{{",".join(kept)}}}]'
    return hashlib.sha256(text.encode()).hexdigest(), "".join(marks)


def changed_columns(table: str, values: Mapping[str, Any], marks: str) -> list[str]:
    """The columns whose marks are others; none when that cannot be told."""
    now = marks_of(table, values)
    names = [name for name, _, _ in _COLUMNS.get(table, ())]
    pairs = range(0, min(len(now), len(marks)), 2)
    return [names[place // 2] for place in pairs if now[place : place + 2] != marks[place : place + 2]]


def keys_of(table: str) -> tuple[str, ...] | None:
    """The columns that tell a participant's rows of a table apart; None when only their order does."""
    if table in OWN_KEYS:
        return OWN_KEYS[table]
    return KEYS[table][1:] if table in KEYS else None


def key_of(table: str, values: Mapping[str, Any]) -> str:
    """Which row of the participant this is, as a link names it."""
    if table == "tokens":
        return str(values["sha256"])[:_KEY_CHARACTERS]
    return "_".join(str(values[name]) for name in keys_of(table) or ())
