"""JSON of others, as the standard means it: what Python's own reader takes beyond it is refused.

`NaN`, a name that stands twice, half a surrogate pair, a number beyond 64 bits: each means one thing to Python, another
to the next reader, and nothing to a database.
"""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn

MOST_DEPTH = 100
MOST_WHOLE = 2**63 - 1
"""The largest whole number that a database, an export and TOML hold."""


def parse_json(text: str | bytes, *, finite: bool = True) -> Any:
    """The value of a text. Raises `ValueError` with the reason in a line.

    `finite`: NaN and the infinite are refused here; without it whoever checks the value's fields can name the one.
    """
    numbers: dict[str, Any] = {"parse_float": _finite, "parse_constant": _no_number} if finite else {}
    try:
        value = json.loads(text, parse_int=whole_number, object_pairs_hook=once, **numbers)
    except RecursionError:
        raise ValueError("is nested too deeply") from None
    check_text(value)
    return value


def whole_number(digits: str) -> int:
    """A whole number of at most 64 bits."""
    if len(digits) > 20 or not -MOST_WHOLE - 1 <= int(digits) <= MOST_WHOLE:
        raise ValueError("has a whole number beyond 64 bits")
    return int(digits)


def _finite(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError("has a number too large to be one")
    return value


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"has {word}, which is no number")


def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose names stand in it once each."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("has a name twice in one object")
    return found


def check_text(value: Any) -> None:
    """Raises `ValueError` where a text in the value is none, or where it is nested too deeply."""
    waiting = [(value, 0)]
    while waiting:
        one, depth = waiting.pop()
        if depth > MOST_DEPTH:
            raise ValueError("is nested too deeply")
        if isinstance(one, str):
            if not one.isascii():
                check_unicode(one)
        elif isinstance(one, dict):
            waiting += [(part, depth + 1) for pair in one.items() for part in pair]
        elif isinstance(one, list):
            waiting += [(part, depth + 1) for part in one]


def check_unicode(text: str) -> None:
    """Raises `ValueError` for half a surrogate pair, which no database and no other program takes."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ValueError("has half a surrogate pair, which is no Unicode text") from None
