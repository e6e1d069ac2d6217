"""Content and marks of a row made at once are those made one by one."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest

from study.integrity.content import content_and_marks_of, content_of, marks_of
from study.records import TABLES, columns

VALUES: tuple[Any, ...] = (
    *(None, 0, 1, -1, 2**70, True, False),
    *(0.0, -0.0, 1.5, 1e-7, 1e22, math.nan, math.inf, -math.inf),
    *("", "a", "a\r\nb", "\r", 'é\u2028\U0001f600 "q"\\', "\ud83d", "NaN", "None", "x" * 100),
)


def told(made: Any, *arguments: Any) -> Any:
    try:
        return made(*arguments)
    except UnicodeEncodeError:
        return "half a character"


@pytest.mark.parametrize("table", [name for name in TABLES if name != "chain"])
def test_at_once_or_one_by_one(table: str) -> None:
    chosen = random.Random(table)
    for _ in range(300):
        values = {info.name: chosen.choice(VALUES) for info in columns(table) if chosen.random() < 0.95}
        one_by_one = told(content_of, table, values, "salt"), told(marks_of, table, values)
        at_once = told(content_and_marks_of, table, values, "salt")
        assert at_once == (one_by_one if "half a character" not in one_by_one else "half a character")
