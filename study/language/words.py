"""Texts for a participant: English in the code, another language from a catalogue, placeholders filled in.

    words.t("Pick up the {object}.", object=words.t("spray bottle"))
    words.tn("One question is left.", "{n} questions are left.", n)

`{name}` is a placeholder. Numbers put into a text are written as the language writes them. A text that a catalogue
lacks is shown in English. `static/common/language.js` does the same on the pages.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

Direction = Literal["ltr", "rtl"]
Value = str | int | float

PLACEHOLDER = re.compile(r"\{([a-z_]+)\}")
CONTEXT_END = "\x04"
"""Between a context and a text in a key, as in gettext's compiled files."""
MOST_DECIMALS = 6
"""Of a number put into a text."""
_ISOLATED = "\u2068{}\u2069"
"""Around a value inside a text that runs from right to left: its own direction does not reorder the text around it."""


def phrase(text: str) -> str:
    """The text as it is. Marks one that stands in a table and is translated where it is used."""
    return text


def english_category(n: int) -> str:
    """The plural category of a whole number in English."""
    return "one" if n == 1 else "other"


@dataclass(frozen=True)
class NumberSigns:
    """How a language writes numbers."""

    digits: str = "0123456789"
    """From nought to nine."""
    decimal_mark: str = "."
    minus: str = "-"
    numbering: str = "latn"
    """The digits' name in Unicode's locale data, for browsers."""

    def written(self, numeral: str) -> str:
        """A plain numeral such as `-601.7` in these signs; what is none of it stays."""
        signs = dict(zip("0123456789", self.digits, strict=True))
        return "".join({**signs, ".": self.decimal_mark, "-": self.minus}.get(sign, sign) for sign in numeral)


@dataclass(frozen=True)
class Words:
    """The texts of one study for its participants."""

    language: str = "en"
    """A tag such as `de` or `pt-BR`."""
    direction: Direction = "ltr"
    texts: Mapping[str, str] = field(default_factory=dict)
    """Translations by text, or by context, `CONTEXT_END` and text."""
    plurals: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """Translations of texts about a number by their English singular, then by plural category."""
    category: Callable[[int], str] = english_category
    """The plural category of a whole number."""
    signs: NumberSigns = NumberSigns()

    def t(self, text: str, /, **values: Value) -> str:
        """The text in this language, with its placeholders filled."""
        return self._filled(self.texts.get(text, text), values)

    def tn(self, one: str, many: str, n: int, /, **values: Value) -> str:
        """The text for this number of things; `{n}` is the number."""
        known = self.plurals.get(one)
        if known is None:
            chosen = one if english_category(n) == "one" else many
        else:
            chosen = known.get(self.category(n)) or known["other"]
        return self._filled(chosen, {"n": n, **values})

    def lines(self, texts: tuple[str, ...]) -> list[str]:
        """Each of these texts in this language, such as the paragraphs that a study file leaves as they are."""
        return [self.t(text) for text in texts]

    def either(self, choices: Sequence[str]) -> str:
        """`a, b or c`."""
        *others, last = choices
        return self.t("{some} or {last}", some=", ".join(others), last=last) if others else last

    def number(self, value: float, decimals: int | None = None) -> str:
        """A number as this language writes it, without marks between thousands."""
        if decimals is not None:
            return self.signs.written(f"{value:.{decimals}f}")
        text = f"{value:.{MOST_DECIMALS}f}" if isinstance(value, float) else str(value)
        return self.signs.written(text.rstrip("0").rstrip(".") if "." in text else text)

    def page(self) -> dict[str, Any]:
        """All of it, as JSON, for the pages."""
        return {
            "language": self.language,
            "dir": self.direction,
            "texts": dict(self.texts),
            "plurals": {key: dict(forms) for key, forms in self.plurals.items()},
            "digits": self.signs.digits,
            "decimal": self.signs.decimal_mark,
            "minus": self.signs.minus,
            "numbering": self.signs.numbering,
        }

    def _filled(self, text: str, values: Mapping[str, Value]) -> str:
        def value_of(match: re.Match[str]) -> str:
            value = values.get(match[1])
            if value is None:
                return match[0]
            shown = value if isinstance(value, str) else self.number(value)
            return _ISOLATED.format(shown) if self.direction == "rtl" and isinstance(value, str) else shown

        return PLACEHOLDER.sub(value_of, text)


ENGLISH = Words()
