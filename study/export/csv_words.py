"""Words in a CSV cell so that no reader makes something else of them.

pandas takes `NA`, `null` and `None` for nothing, `007` for 7 and `True` for a truth value, R takes `NA`, spreadsheets
run `=1+1` and make a date of `1-2`. Such a text stands in its cell as JSON, in double quotes: what begins with `"` is
JSON, everything else is the text itself.

    text = frame["value"].map(lambda cell: json.loads(cell) if str(cell)[:1] == '"' else cell)
"""

from __future__ import annotations

import json
import math
import re
from functools import lru_cache

from study.json_text import parse_json

HOW_TO_READ = (
    "In the CSV a text that readers take for something else (NA, null, 007, True, =1) stands as JSON, in double quotes"
)
_NOTHING = frozenset(
    (
        *("NA", "N/A", "n/a", "#N/A", "#N/A N/A", "#NA", "<NA>", "NULL", "null", "None"),
        *("NaN", "nan", "-NaN", "-nan", "1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN"),
    )
)
"""What pandas reads as nothing, beside an empty cell."""
_TRUTH = frozenset({"true", "false"})
_FORMULA = tuple("=+-@＝＋－＠")
_FORMULA_AT_THE_START = re.compile(r"[\t\r\n]|[\s\"']*[=+\-@＝＋－＠]")
_FORMULA_INSIDE = re.compile(r"[;|\t\r\n][\s\"']*[=+\-@＝＋－＠]")
_ESCAPED = {ord(one): f"\\u{ord(one):04x}" for one in _FORMULA}
_DATE_LIKE = re.compile(r"[0-9][0-9\s./:,-]*")
"""Digits and marks: a date, a time or a number in one country or another."""
MAX_PLAIN_DIGITS = 15
"""Of a number: more of them a floating-point number does not hold."""


@lru_cache(maxsize=65_536)  # ids and readings come again and again
def cell_of(text: str) -> str:
    """The cell of a text."""
    return json.dumps(text, ensure_ascii=False) if _is_misread(text) else text


@lru_cache(maxsize=65_536)
def excel_safe_cell_of(text: str, words: bool = True) -> str:
    """The cell of a text in an export that spreadsheets open: nothing in it is run, whatever its column, whatever
    character this spreadsheet parts cells at. `words`: the column's texts are quoted for other readers too.

    What would begin with a formula's character does not: it is quoted as JSON. Where such a character follows a
    semicolon, a tab, a bar or a line end, at which some spreadsheets part cells even within quotes, it is escaped as
    JSON has it. `text_of` reads both back.
    """
    quoted = words and _is_misread(text)
    begins = bool(_FORMULA_AT_THE_START.match(text)) and not _is_plain_number(text)
    inside = bool(_FORMULA_INSIDE.search(text))
    if not (quoted or begins or inside or text.startswith('"')):
        return text
    cell = json.dumps(text, ensure_ascii=False)
    return cell.translate(_ESCAPED) if inside else cell


def text_of(cell: str) -> str:
    """The text of a cell. Raises `ValueError` for a cell in double quotes that is no text in JSON."""
    if not cell.startswith('"'):
        return cell
    text = parse_json(cell)
    if not isinstance(text, str):
        raise ValueError(cell)
    return text


def _is_misread(text: str) -> bool:
    if _is_plain_number(text):
        return False
    return (
        text in _NOTHING
        or text.casefold() in _TRUTH
        or text != text.strip()
        or text.startswith(('"', *_FORMULA))
        or any(not one.isprintable() and one in _CONTROLS for one in text)
        or _DATE_LIKE.fullmatch(text) is not None
        or text == ""
        or _is_number(text)
    )


_CONTROLS = frozenset(map(chr, (*range(0x09), 0x0B, 0x0C, *range(0x0D, 0x20), 0x7F)))
"""But for tab and line feed, which a quoted cell holds."""


def _is_plain_number(text: str) -> bool:
    """Whether a reader gets the very same number, written the same way."""
    if not _is_number(text) or sum(one.isdigit() for one in text) > MAX_PLAIN_DIGITS or "e" in text:
        return False
    value = float(text)
    return math.isfinite(value) and text in (repr(value), str(int(value)))


def _is_number(text: str) -> bool:
    if "_" in text:  # which Python takes and nobody else
        return False
    try:
        float(text)
    except ValueError:
        return False
    return True
