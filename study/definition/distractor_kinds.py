"""The table `[distractor]` of a study file: fields common to all kinds, and those of the kind it names.

Which kinds there are is not known here: whoever reads a study file says so, as with layouts and objects.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from study.definition.part_fields import made, parameter_problems
from study.definition.sections import DistractorSettings
from study.definition.toml_reader import Problem, choices_sentence, model_problems
from study.records import StudyError

_TABLE = "distractor"


class DistractorKinds(Protocol):
    """The kinds of distractor there are."""

    @property
    def names(self) -> tuple[str, ...]:
        """Every kind there is."""

    def parameters(self, kind: str) -> type:
        """The frozen dataclass of a kind's own fields. Raises `StudyError` with one line when it cannot be loaded."""

    def broken_promise(self, settings: DistractorSettings) -> str | None:
        """What is wrong with the distractor of these settings, in one line; None when it can be used."""


def read_distractor(
    table: Mapping[str, Any], kinds: DistractorKinds | None
) -> tuple[DistractorSettings | None, tuple[Problem, ...]]:
    """The settings of a table `[distractor]`, or everything that is wrong with it.

    Without `kinds` only the common fields are looked at, and there are no parameters.
    """
    hidden = DistractorSettings.NOT_IN_FILE
    problems = [Problem((name,), "unknown field; it is computed from the file") for name in hidden if name in table]
    table = {name: value for name, value in table.items() if name not in hidden}
    common = {name: value for name, value in table.items() if name in DistractorSettings.model_fields}
    kind = common.get("kind", DistractorSettings().kind)
    parameters: type | None = None
    if kinds is not None and isinstance(kind, str):
        if kind not in kinds.names:
            problems.append(Problem(("kind",), choices_sentence(kind, kinds.names, "kinds")))
        else:
            try:
                parameters = kinds.parameters(kind)
                problems += parameter_problems(parameters, table, DistractorSettings)
            except StudyError as error:
                parameters = None
                problems.append(Problem(("kind",), str(error)))
    if parameters is None:
        problems += model_problems(DistractorSettings, common)
    if problems:
        return None, _placed(problems)
    own = made(parameters, table) if parameters is not None else None
    settings = DistractorSettings.model_validate({**common, "parameters": own})
    broken = kinds.broken_promise(settings) if kinds is not None else None
    return (settings, ()) if broken is None else (None, _placed([Problem(("kind",), broken)]))


def _placed(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """The problems as the whole file has them."""
    return tuple(Problem((_TABLE, *problem.path), problem.sentence) for problem in problems)
