"""The language of a study, and its own translation of the lab's texts in a file beside the study file.

The file's text is copied into the study's when it is loaded, so that the text and its hash hold the very words.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from study.definition.field_types import Part, Text
from study.definition.toml_reader import Problem, closest
from study.definition.toml_writer import long_text, toml
from study.language.catalogue import Mistake, read, shipped, shipped_text
from study.language.locales import TAG, language
from study.text_file import FileProblem, read_text

LanguageTag = Annotated[str, Field(pattern=TAG, max_length=35, strict=True)]
TranslationName = Annotated[str, Field(pattern=r"^([A-Za-z0-9_][A-Za-z0-9_.-]*\.po)?$", max_length=100, strict=True)]
MOST_BYTES = 1_000_000


class TranslationFile(Part):
    """A translation that stood beside the study file when it was loaded. Nobody writes this by hand."""

    file: TranslationName
    """The name that `translation` gives."""
    text: Text
    """What stood in it."""


def translation_beside(file: Path, data: Mapping[str, Any], problems: list[str]) -> list[str]:
    """What is added to the study's text for the translation in a file beside it; `problems` gets what is wrong."""
    name = data.get("translation")
    if not isinstance(name, str) or not name.endswith(".po") or Path(name).name != name or data.get("translations"):
        return []
    beside = file.with_name(name)
    if not os.path.lexists(beside):
        return []  # told with the study file's own problems
    try:
        text = read_text(beside, MOST_BYTES, within=file.parent).replace("\r\n", "\n")
    except FileProblem as problem:
        problems.append(str(problem))
    else:
        tag = str(data.get("language", "en"))
        found = read(text, tag).mistakes if language(tag) is not None else ()
        problems += [f"{beside}:{mistake.line}: {mistake.sentence}" for mistake in found]
        if found:
            text = _NOTHING
        lines = ["", f"# {name}, as it stood beside this file", "[[translations]]", f"file = {toml(name)}"]
        return ["\n".join([*lines, f"text = {long_text(text)}"]) + "\n"]
    return ["\n".join(["", "[[translations]]", f"file = {toml(name)}", f"text = {toml(_NOTHING)}"]) + "\n"]


_NOTHING = "# nothing\n"
"""Stands in for a translation that cannot be used, so that the study file's own problems are told beside it."""


def language_problems(data: Mapping[str, Any]) -> Iterator[Problem]:
    """What is wrong with a study's language and translation beyond single fields."""
    tag, name = data.get("language", "en"), data.get("translation", "")
    if not isinstance(tag, str) or not isinstance(name, str):
        return
    if language(tag) is None:
        hint = closest(tag, ("en", *shipped()))
        yield Problem(("language",), f"not known{hint or ';'} give a tag such as de, ar or pt-BR")
        return
    texts = data.get("translations")
    files = [entry for entry in texts if isinstance(entry, Mapping)] if isinstance(texts, list) else []
    if name and not any(entry.get("file") == name for entry in files):
        yield Problem(("translation",), f"no such file beside this one; salab texts --language {tag} writes one")
    elif files and not name:
        yield Problem(("translations", 0, "file"), "is named by no translation; leave it out")
    elif not files and tag.partition("-")[0] != "en" and not shipped_text(tag)[0]:
        there_are = ", ".join(("en", *shipped()))
        yield Problem(
            ("language",),
            f"no translation into it ships with the lab; those that do: {there_are}. Name your own with translation = "
            f'"NAME.po"; salab texts --language {tag} writes one to fill in',
        )
    for position, entry in enumerate(files):
        text = entry.get("text")
        for mistake in _mistakes(text, tag):
            yield Problem(("translations", position, "text"), f"line {mistake.line}: {mistake.sentence}")


def _mistakes(text: object, tag: str) -> tuple[Mistake, ...]:
    return read(text, tag).mistakes if isinstance(text, str) else ()
