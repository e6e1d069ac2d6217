"""Names in braces in the participant's texts, and the facts of the study that are put in their place.

A text that says a number by itself goes on saying it when the study has another one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from study.definition.toml_reader import FieldPath, Problem
from study.language.words import PLACEHOLDER

FACTS: Mapping[str, str] = {
    "minutes": "about how long a participant takes, as `salab check` estimates it",
    "rounds": "how many trials there are",
    "tasks": "tasks in a trial",
    "objects": "objects to be moved in a trial",
    "bins": "bins in use",
    "answer_seconds": "how long a reading, or another stimulus of the second task, can be answered",
}
"""Every name, and what stands for it."""

_TEXTS: tuple[FieldPath, ...] = (
    ("consent", "text"),
    ("consent", "contact"),
    ("instructions",),
    ("texts",),
    ("recruitment", "welcome"),
    ("recruitment", "full"),
)
"""Where participants read what a study file says."""


def filled_text(text: str, facts: Mapping[str, str]) -> str:
    """The text with its facts. What is no fact stays as it stands."""
    return PLACEHOLDER.sub(lambda found: facts.get(found.group(1), found.group(0)), text)


def filled_texts(data: Any, facts: Mapping[str, str]) -> Any:
    """The same for every text in nested data; ids have no braces."""
    if isinstance(data, str):
        return filled_text(data, facts)
    if isinstance(data, Mapping):
        return {name: filled_texts(value, facts) for name, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [filled_texts(value, facts) for value in data]
    return data


def text_problems(data: Mapping[str, Any]) -> Iterator[Problem]:
    """Names in braces that are no fact, in a study file's unchecked data."""
    for path in _TEXTS:
        value: Any = data
        for part in path:
            value = value.get(part) if isinstance(value, Mapping) else None
        for place, text in _texts_of(value, path):
            for name in PLACEHOLDER.findall(text):
                if name not in FACTS:
                    yield Problem(place, f"{{{name}}} is none of the facts a text may name: {', '.join(FACTS)}")


def _texts_of(value: Any, path: FieldPath) -> Iterator[tuple[FieldPath, str]]:
    if isinstance(value, str):
        yield path, value
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _texts_of(inner, (*path, name))
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from _texts_of(inner, (*path, number))
