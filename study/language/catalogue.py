"""Translations: gettext files (PO), those that ship and a study's own.

A study's own goes before the one that ships for its language; what neither has is shown in English.
"""

from __future__ import annotations

import gettext
import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from study.language.locales import Language, language
from study.language.words import CONTEXT_END, PLACEHOLDER, Direction, Words

if TYPE_CHECKING:
    from babel.messages.catalog import Message

FOLDER = Path(__file__).with_name("catalogues")
REVIEWED = "X-Reviewed-For-Data"
"""The header that says who has checked a translation, and when; `no` for nobody."""
_LINE = re.compile(r'#|(?:msg(?:ctxt|id|id_plural|str|str\[\d+\])\s+)?"(?:[^"\\]|\\.)*"$')
_TOO_MANY_FORMS = re.compile(r"nplurals\s*=\s*0*[1-9][0-9]")
"""The library makes room for as many as the header names, before it reads one."""
_ENDS_ELSEWHERE = re.compile("[\x0b\x0c\x1c-\x1e\x85\u2028\u2029]")
_TRIED = range(201)
"""Numbers with which a file's plural forms are compared with the language's categories."""


@dataclass(frozen=True)
class Mistake:
    """Something wrong in a translation: the line, 0 for the whole file, and what."""

    line: int
    sentence: str


@dataclass(frozen=True)
class Catalogue:
    """A translation, read."""

    texts: Mapping[str, str] = field(default_factory=dict)
    plurals: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    lines: Mapping[str, int] = field(default_factory=dict)
    """The line of each entry, by key, translated or not."""
    reviewed: str = ""
    """Who has checked it; empty for nobody."""
    mistakes: tuple[Mistake, ...] = ()
    """What keeps it from being used."""


def shipped() -> tuple[str, ...]:
    """The languages that a translation ships for, beside English."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.po")))


def shipped_text(tag: str) -> tuple[str, str]:
    """(the language, the text) of the translation that ships for a language or, of `pt-BR`, for `pt`; empty if none."""
    for name in dict.fromkeys((tag, tag.partition("-")[0])):
        file = FOLDER / f"{name}.po"
        if name in shipped():
            return name, file.read_text(encoding="utf-8")
    return "", ""


@lru_cache(maxsize=16)
def read(text: str, tag: str) -> Catalogue:
    """A translation into this language, from the text of its file."""
    from babel.messages.pofile import PoFileError, read_po

    known = language(tag)
    if known is None:
        return Catalogue(mistakes=(Mistake(0, f"no language {tag!r} is known"),))
    named = _TOO_MANY_FORMS.search(text)
    if named:
        return Catalogue(mistakes=(Mistake(_line_of(text, named), "Plural-Forms: no language has more than nine"),))
    ends = _ENDS_ELSEWHERE.search(text)
    if ends:
        sentence = f"holds U+{ord(ends[0]):04X}, which the library takes for the end of a line; leave it out"
        return Catalogue(mistakes=(Mistake(_line_of(text, ends), sentence),))
    try:
        found = read_po(io.BytesIO(text.encode()), abort_invalid=True)
    except (PoFileError, ValueError, LookupError) as error:
        line = getattr(error, "lineno", None)
        sentence = re.sub(r" on \d+$", "", str(error))
        return Catalogue(mistakes=(Mistake(int(line or 0) + 1, f"not a valid PO file: {sentence}"),))
    mistakes = [
        Mistake(number, "not a valid PO file: a text has to begin and end with a quotation mark on its line")
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip() and not _LINE.match(line.strip())
    ]
    written = str(found.locale_identifier or "").replace("_", "-")
    if written and written.partition("-")[0] != tag.partition("-")[0]:
        mistakes.append(Mistake(1, f"its header says Language: {written}, and the study's language is {tag}"))
    texts: dict[str, str] = {}
    plurals: dict[str, Mapping[str, str]] = {}
    lines: dict[str, int] = {}
    headers = _headers(text)
    places: Mapping[str, int] | None = None
    for message in found:
        if not message.id:
            continue
        one = message.id if isinstance(message.id, str) else message.id[0]
        key = f"{message.context}{CONTEXT_END}{one}" if message.context else one
        line = message.lineno or 0
        lines[key] = line
        forms = [message.string] if isinstance(message.string, str) else list(message.string or ())
        if "fuzzy" in message.flags or not any(forms):
            continue
        mistakes += _placeholder_mistakes(message, forms, line)
        if isinstance(message.id, str):
            texts[key] = forms[0]
            continue
        if places is None:
            places, wrong = _places(headers.get("plural-forms", ""), known)
            mistakes += wrong
        if places and all(place < len(forms) and forms[place] for place in places.values()):
            plurals[key] = {category: forms[place] for category, place in places.items()}
        elif places:
            needed, there = len(set(places.values())), sum(map(bool, forms))
            mistakes.append(Mistake(line, f"{one!r} has {there} plural forms, {known.name} has {needed}"))
    reviewed = headers.get(REVIEWED.lower(), "")
    return Catalogue(texts, plurals, lines, "" if reviewed.lower() == "no" else reviewed, tuple(mistakes))


def _line_of(text: str, found: re.Match[str]) -> int:
    return text.count("\n", 0, found.start()) + 1


def _headers(text: str) -> Mapping[str, str]:
    """The headers of a file by their names in small letters. Editors break a long one over several lines."""
    from babel.messages.pofile import denormalize

    found = re.search(r'^msgid ""\s*\nmsgstr ((?:"(?:[^"\\]|\\.)*"\s*)+)', text, re.MULTILINE)
    lines = denormalize(found[1].rstrip()).split("\n") if found else ()
    return {name.strip().lower(): said.strip() for name, _, said in (line.partition(":") for line in lines)}


def _places(header: str, known: Language) -> tuple[Mapping[str, int], list[Mistake]]:
    """The place of each plural category among a file's forms: `Plural-Forms` has to divide numbers as the language."""
    formula = re.search(r"plural\s*=\s*([^;]+)", header)
    try:
        place_of = gettext.c2py(formula[1] if formula else "")
        places: dict[str, int] = {}
        for number in _TRIED:
            if places.setdefault(known.category(number), place_of(number)) != place_of(number):
                sentence = f"Plural-Forms puts {number} elsewhere than other numbers that {known.name} treats like it"
                return {}, [Mistake(1, sentence)]
    except (ValueError, ZeroDivisionError) as error:
        return {}, [Mistake(1, f"Plural-Forms cannot be read: {error}")]
    places.setdefault("other", max(places.values()))
    return places, []


def _placeholder_mistakes(message: Message, forms: list[str], line: int) -> Iterator[Mistake]:
    """Placeholders that a translation lacks, or that nothing fills. A plural form may leave out `{n}`: "one"."""
    ids = [message.id] if isinstance(message.id, str) else list(message.id)
    known = {name for text in ids for name in PLACEHOLDER.findall(text)} | ({"n"} if len(ids) > 1 else set())
    needed = set.intersection(*(set(PLACEHOLDER.findall(text)) for text in ids)) - {"n" if len(ids) > 1 else ""}
    for form in forms:
        there = set(PLACEHOLDER.findall(form))
        for name in sorted(needed - there):
            yield Mistake(line, f"{form!r} lacks {{{name}}}")
        for name in sorted(there - known):
            choices = ", ".join(f"{{{one}}}" for one in sorted(known)) or "none"
            yield Mistake(line, f"{form!r} has {{{name}}}, which nothing fills; there are: {choices}")


@lru_cache(maxsize=16)
def words_for(tag: str, direction: Direction | None = None, own: str = "") -> Words:
    """The words of a study in this language, with its own translation's text before the one that ships."""
    known = language(tag)
    assert known is not None, f"the language {tag!r} is checked with the study file"
    name, text = shipped_text(tag)
    base = read(text, name) if name else Catalogue()
    first = read(own, tag) if own else Catalogue()
    return Words(
        language=tag,
        direction=direction or known.direction,
        texts={**base.texts, **first.texts},
        plurals={**base.plurals, **first.plurals},
        category=known.category,
        signs=known.signs,
    )
