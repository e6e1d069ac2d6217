"""What a language is, by Unicode's locale data (CLDR), which Babel brings."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from study.language.words import Direction, NumberSigns, english_category

TAG = r"^[a-z]{2,3}(-[A-Za-z0-9]{2,8})*$"
"""How a study file names a language: `de`, `pt-BR`."""
FIRST_DIGITS = {
    "latn": "0",
    "adlm": "𞥐",
    "arab": "٠",
    "arabext": "۰",
    "beng": "০",
    "cakm": "𑄶",
    "deva": "०",
    "hmnp": "𞅀",
    "mtei": "꯰",
    "mymr": "၀",
    "nkoo": "߀",
    "olck": "᱐",
    "rohg": "𐴰",
    "tibt": "༠",
}
"""The nought of the numbering systems that some language writes unless told otherwise."""


@dataclass(frozen=True)
class Language:
    """A language of which something is known."""

    tag: str
    name: str
    """In English."""
    direction: Direction
    category: Callable[[int], str]
    """The plural category of a whole number."""
    categories: frozenset[str]
    """All there are."""
    signs: NumberSigns


@lru_cache(maxsize=32)
def language(tag: str) -> Language | None:
    """What is known of the language with this tag, such as `de` or `pt-BR`; None for an unknown one."""
    if tag == "en":  # what every lab speaks takes no library
        return Language(tag, "English", "ltr", english_category, frozenset({"one", "other"}), NumberSigns())
    if not re.match(TAG, tag):
        return None
    from babel import Locale, UnknownLocaleError

    try:
        locale = Locale.parse(tag, sep="-")
    except (UnknownLocaleError, ValueError):
        return None
    numbering = locale.default_numbering_system
    numbering = numbering if numbering in FIRST_DIGITS else "latn"
    first = ord(FIRST_DIGITS[numbering])
    digits = "".join(chr(first + value) for value in range(10))
    assert [unicodedata.digit(digit) for digit in digits] == list(range(10)), numbering
    symbols = {**locale.number_symbols["latn"], **locale.number_symbols.get(numbering, {})}
    return Language(
        tag,
        locale.english_name or tag,
        "rtl" if locale.text_direction == "rtl" else "ltr",
        locale.plural_form,
        locale.plural_form.tags | {"other"},
        NumberSigns(digits, str(symbols["decimal"]), str(symbols["minusSign"]), numbering),
    )
