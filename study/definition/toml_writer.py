"""Writing a file that stands beside the study file into the study's text, as tables of it."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")


def as_table(field: str, name: str, data: Mapping[str, Any], origin: str = "as it stood beside this file") -> str:
    """The data of `NAME.toml` as one more `[[field]]` with `id = "NAME"`, with a blank line before it.

    `origin` says where it is from.
    """
    lines = ["", f"# {name}.toml, {origin}", f"[[{field}]]", f"id = {toml(name)}"]
    return "\n".join([*lines, *_table(field, data)]) + "\n"


def _table(header: str, data: Mapping[str, Any]) -> Iterator[str]:
    """Lines of a table: its own keys first, as TOML wants it, then the tables in it."""
    inner = {key: value for key, value in data.items() if _is_table(value) or _is_array(value)}
    for key, value in data.items():
        if key not in inner:
            yield f"{_key(key)} = {toml(value)}"
    for key, value in inner.items():
        name = f"{header}.{_key(key)}"
        for entry in value if _is_array(value) else (value,):
            yield ""
            yield f"[[{name}]]" if _is_array(value) else f"[{name}]"
            yield from _table(name, entry)


def toml(value: object) -> str:
    """A value as TOML writes it."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(key)} = {toml(inner)}' for key, inner in value.items())} }}" if value else "{}"
    if isinstance(value, list):
        return f"[{', '.join(toml(inner) for inner in value)}]"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else ("inf" if value > 0 else "-inf")
    if isinstance(value, (str, bool, int, float)):
        # JSON's numbers, booleans and strings are TOML's, but for the one control character that JSON leaves as it is.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value)  # dates and times


def long_text(text: str) -> str:
    """A text of many lines, each on a line of its own where TOML can hold it so."""
    plain = "'''" not in text and not text.endswith("'") and all(sign in "\n\t" or sign >= " " for sign in text)
    return f"'''\n{text}'''" if plain and "\x7f" not in text else toml(text)


def _key(key: str) -> str:
    return key if _BARE.match(key) else toml(key)


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping)


def _is_array(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(entry, Mapping) for entry in value)
