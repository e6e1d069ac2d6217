"""A number as somebody typed it, in any script: which numbers it can be. `static/common/typed_number.js` reads alike.

Digits of every script count, and so do both decimal marks, thousands marks where they stand in their places, and the
signs that keyboards put for a minus. Marks that nobody sees are passed over. Nothing else is guessed: `1,234` may be
two numbers, `12e`, `1-2` and `10²` are none.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from typing import Literal

from study.language.words import ENGLISH, Words

Flaw = Literal["no_number", "ambiguous", "too_large", "too_small", "not_whole", "below", "above"]

_ALIKE = {
    **dict.fromkeys("．﹒。｡", "."),
    **dict.fromkeys("，﹐、､،", ","),
    **dict.fromkeys("−－﹣‐‑‒–", "-"),
    **dict.fromkeys("＋﹢", "+"),
    **dict.fromkeys("’＇", "'"),
    **dict.fromkeys("ｅＥ", "e"),
}
"""Other forms of the same mark: full width, small, ideographic, Arabic comma, typographic minus and apostrophe."""
_ARABIC_DECIMAL, _ARABIC_THOUSANDS = "\u066b", "\u066c"
_DECIMALS = f".,{_ARABIC_DECIMAL}"
_THOUSANDS = f".,' {_ARABIC_THOUSANDS}"
_VARIATIONS = frozenset(map(chr, (*range(0x180B, 0x180E), 0x180F, *range(0xFE00, 0xFE10), *range(0xE0100, 0xE01F0))))
"""What chooses the look of the character before it."""
_WHOLE = re.compile(rf"([+-]?) *([0-9{re.escape(_DECIMALS + _THOUSANDS)}]*[0-9])(?:[eE]([+-]?[0-9]+))?")
_GROUPED = r"[1-9][0-9]{{0,2}}(?:{0}[0-9]{{3}})+|[1-9][0-9]?(?:{0}[0-9]{{2}})+{0}[0-9]{{3}}"
"""By threes, or as in India: 12,34,567."""
_MAX_EXPONENT_DIGITS = 6


def numerals(typed: str) -> tuple[str, ...]:
    """The plain numerals that this can stand for, such as `("3.5",)` for `３,５`; empty when it is no number.

    Two of them: the mark may be a decimal or a thousands mark; the first takes it for a decimal mark.
    """
    found = _WHOLE.fullmatch("".join(map(_plain, typed)).strip())
    if found is None:
        return ()
    sign, mantissa, exponent = found.groups()
    digits = (exponent or "").lstrip("+-").lstrip("0")
    if len(digits) > _MAX_EXPONENT_DIGITS:
        digits = "9" * _MAX_EXPONENT_DIGITS  # too large or too small either way
    tail = f"e{'-' if (exponent or '').startswith('-') else ''}{digits}" if digits else ""
    return tuple(
        ("-" if sign == "-" and any(part.strip("0") for part in (whole, fraction)) else "")
        + (whole.lstrip("0") or "0")
        + (f".{fraction}" if fraction else "")
        + tail
        for whole, fraction in _read(mantissa, grouped=exponent is None)
    )


def same_number(typed: str, number: str) -> bool:
    """Whether what was typed can stand for this number, itself a plain numeral such as `482.1`."""
    return any(Decimal(numeral) == Decimal(number) for numeral in numerals(typed))


@dataclass(frozen=True)
class Asked:
    """What a question takes for a number."""

    mark: str = "."
    """How the study's language writes it: of two readings of `1.234`, this one is taken."""
    whole: bool = False
    least: float | None = None
    most: float | None = None


def number_of(typed: str, asked: Asked = Asked()) -> tuple[str | None, Flaw | None]:
    """The plain numeral that a question takes, or why it takes none."""
    read = numerals(typed)
    if not read:
        return None, "no_number"
    numeral = read[0]
    if len(read) > 1 and _mark_of(typed) != asked.mark:
        return None, "ambiguous"
    value = float(numeral)
    if math.isinf(value):
        return None, "too_large"
    if value == 0.0 and Decimal(numeral) != 0:
        return None, "too_small"
    flaw = flaw_of(value, asked)
    return (None, flaw) if flaw else (numeral, None)


def flaw_of(value: float, asked: Asked) -> Flaw | None:
    """What is wrong with a finite number for a question; None when nothing is."""
    if asked.whole and value != math.floor(value):
        return "not_whole"
    if asked.least is not None and value < asked.least:
        return "below"
    if asked.most is not None and value > asked.most:
        return "above"
    return None


def sentence(flaw: Flaw, typed: object, asked: Asked, words: Words = ENGLISH) -> str:
    """A flaw in words, for who answers."""
    read = numerals(typed) if flaw == "ambiguous" and isinstance(typed, str) else ()
    said = {
        "no_number": words.t(
            "“{typed}” is not a number. Please write it in digits alone, such as {whole} or {fraction}.",
            typed=str(typed),
            whole=12,
            fraction=3.5,
        ),
        "ambiguous": words.t(
            "“{typed}” could be {numbers}. Please write {mark} for decimals, and no mark between thousands.",
            typed=str(typed),
            numbers=words.either([words.signs.written(numeral) for numeral in reversed(read)] or [""]),
            mark=asked.mark,
        ),
        "too_large": words.t("“{typed}” is too large.", typed=str(typed)),
        "too_small": words.t("“{typed}” is too small.", typed=str(typed)),
        "not_whole": words.t("“{typed}” is not a whole number.", typed=str(typed)),
        "below": words.t(
            "“{typed}” is below {least}, the least that is taken.", typed=str(typed), least=asked.least or 0.0
        ),
        "above": words.t(
            "“{typed}” is above {most}, the most that is taken.", typed=str(typed), most=asked.most or 0.0
        ),
    }
    return said[flaw]


def _plain(character: str) -> str:
    """A character as the plain one it stands for; `` for what nobody sees."""
    category = unicodedata.category(character)
    if category == "Nd":
        return str(unicodedata.decimal(character))
    if category == "Cf" or character in _VARIATIONS:
        return ""
    if category == "Zs" or character in "\t\r\n":
        return " "
    return _ALIKE.get(character, character)


def _mark_of(typed: str) -> str:
    """The first mark in a number."""
    return next((mark for mark in map(_plain, typed) if mark in _DECIMALS), ".")


def _read(mantissa: str, grouped: bool) -> Iterator[tuple[str, str]]:
    """(whole part, fraction) of every way to read digits and marks, decimal marks first."""
    for mark in [mark for mark in _DECIMALS if mantissa.count(mark) == 1]:
        whole, _, fraction = mantissa.partition(mark)
        plain = _ungrouped(whole, grouped)
        if fraction.isdecimal() and plain is not None:
            yield plain, fraction
    plain = _ungrouped(mantissa, grouped)
    if plain:
        yield plain, ""


def _ungrouped(whole: str, grouped: bool) -> str | None:
    """A whole part without its thousands marks, "" for none; None when they do not stand where they belong."""
    if whole == "" or whole.isdecimal():
        return whole
    marks = set(whole) & set(_THOUSANDS)
    if not grouped or len(marks) != 1:
        return None
    (mark,) = marks
    return whole.replace(mark, "") if re.fullmatch(_GROUPED.format(re.escape(mark)), whole) else None
