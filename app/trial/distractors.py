"""Which distractors there are, by name, and the one a study asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from app.errors import LabError
from app.registry import Registry
from study.definition.sections import DistractorSettings
from study.flow.distractors.contract import broken_promise
from study.flow.distractors.interface import Distractor
from study.records import StudyError

DISTRACTORS = Registry(
    noun="distractor",
    group="salab.distractors",
    shipped={
        "readings": "study.flow.distractors.readings:Readings",
        "nback": "study.flow.distractors.nback:NBack",
    },
    methods=("Parameters", "due_s", "deadline_s", "stimulus", "right_answer", "is_right", "simulated_answer"),
)
"""Every distractor is a row of this table, or registered by an installed package under `salab.distractors`."""


def make_distractor(settings: DistractorSettings) -> Distractor[Any]:
    """The distractor of a study that `open_study` or `parse_text` has read. Raises `LabError` with one line."""
    kind = DISTRACTORS.load(settings.kind)
    try:
        made: Distractor[Any] = kind(settings.parameters, settings)
    except Exception as error:  # somebody else's code may raise whatever it likes
        place = DISTRACTORS.place_of(settings.kind)
        raise LabError(
            f"distractor {settings.kind!r} ({place}) cannot be made: {type(error).__name__}: {error}"
        ) from error
    return made


@dataclass(frozen=True)
class KnownDistractors:
    """What a study file is held against (see `study.definition.distractor_kinds.DistractorKinds`)."""

    @property
    def names(self) -> tuple[str, ...]:
        """Every kind there is."""
        return DISTRACTORS.names

    def parameters(self, kind: str) -> type:
        """The dataclass of a kind's own fields. Raises `StudyError` with one line."""
        try:
            parameters: type = DISTRACTORS.load(kind).Parameters
        except LabError as error:
            raise StudyError(str(error)) from error
        return parameters

    def broken_promise(self, settings: DistractorSettings) -> str | None:
        """What is wrong with the distractor of these settings, in one line."""
        try:
            distractor = make_distractor(settings)
        except LabError as error:
            return str(error)
        broken = broken_promise(distractor)
        place = DISTRACTORS.place_of(settings.kind)
        return None if broken is None else f"distractor {settings.kind!r} ({place}): {broken}"
