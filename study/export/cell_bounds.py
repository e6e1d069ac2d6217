"""What a cell of an export may hold: the bounds, levels and kinds of number that the codebook gives its column."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from study.records import YES_NO, ColumnInfo

_NOUNS = {"int": "a whole number", "float": "a number", "str": "text"}


def within_bounds(info: ColumnInfo, parse: Callable[[str], Any]) -> Callable[[str], Any]:
    """`parse`, which then raises `ValueError` for what the column cannot hold too: nan, -1 of what is counted."""
    least, most = _limits(info)
    if info.levels:
        levels = frozenset(info.levels)

        def level(cell: str) -> Any:
            if (value := parse(cell)) not in levels:
                raise ValueError(cell)
            return value

        return level
    if info.type == "str":
        return parse

    def number(cell: str) -> Any:
        value = parse(cell)
        if not math.isfinite(value) or not least <= value <= most:
            raise ValueError(cell)
        return value

    return number


def bounds_of(info: ColumnInfo) -> str:
    """What a cell of this column must be, in words."""
    if info.levels:
        return f"one of {', '.join(info.levels)}"
    least, most = _limits(info)
    bounds = [f"at least {least}"] if least != -math.inf else []
    bounds += [f"at most {most}"] if most != math.inf else []
    return f"{_NOUNS[info.type]}{', ' if bounds else ''}{' and '.join(bounds)}"


def _limits(info: ColumnInfo) -> tuple[float, float]:
    if info.unit == YES_NO:
        return 0, 1
    return -math.inf if info.least is None else info.least, math.inf if info.most is None else info.most
