"""A study file held against this lab's world: its layouts, objects and bins."""

from __future__ import annotations

from pathlib import Path

from app.trial.parts import shelf
from sim.layouts import LAYOUTS
from sim.objects import STUDY_OBJECTS
from study.definition.study import Study, load_study, parse_study


def known_layouts() -> dict[str, int]:
    """The layouts there are and their numbers of slots."""
    return {name: len(layout.slots) for name, layout in LAYOUTS.items()}


def open_study(path: Path | None, trust: bool = False) -> Study:
    """The study file, or the paper's study, checked against this lab's world and its parts.

    `trust`: code in files beside it may run; else it becomes a part of the study all the same, but is not looked at.
    """
    world = {"layouts": known_layouts(), "objects": tuple(STUDY_OBJECTS), "bins": _bins()}
    return load_study(path, **world, shelf=shelf(trust))


def parse_text(text: str, name: str, trust: bool = False) -> Study:
    """The study of a file's text; `name` is what errors call it. Raises `StudyFileError`."""
    world = {"layouts": known_layouts(), "objects": tuple(STUDY_OBJECTS), "bins": _bins()}
    return parse_study(text, name=name, **world, shelf=shelf(trust))


def parse_stored(text: str, name: str) -> Study:
    """The study of a stored text, whose parts were looked at when it was stored: they may be gone by now, and whoever
    only reads what people agreed to needs none of them. Raises `StudyFileError`."""
    return parse_study(text, name=name, layouts=known_layouts(), objects=tuple(STUDY_OBJECTS), bins=_bins())


def _bins() -> tuple[str, ...]:
    return tuple(item.id for item in next(iter(LAYOUTS.values())).bins)
