"""A study file held against this lab's world: its layouts, objects, bins and distractors."""

from __future__ import annotations

from pathlib import Path

from app.trial.distractors import KnownDistractors
from sim.layouts import LAYOUTS
from sim.objects import STUDY_OBJECTS
from study.definition.study import Study, load_study, parse_study


def known_layouts() -> dict[str, int]:
    """The layouts there are and their numbers of slots."""
    return {name: len(layout.slots) for name, layout in LAYOUTS.items()}


def open_study(path: Path | None) -> Study:
    """The study file, or the paper's study, checked against this lab's world."""
    return load_study(
        path,
        layouts=known_layouts(),
        objects=tuple(STUDY_OBJECTS),
        bins=_bins(),
        distractors=KnownDistractors(),
    )


def parse_text(text: str, name: str) -> Study:
    """The study of a file's text; `name` is what errors call it. Raises `StudyFileError`."""
    return parse_study(
        text,
        name=name,
        layouts=known_layouts(),
        objects=tuple(STUDY_OBJECTS),
        bins=_bins(),
        distractors=KnownDistractors(),
    )


def _bins() -> tuple[str, ...]:
    return tuple(item.id for item in next(iter(LAYOUTS.values())).bins)
