"""The parts a study may name, and how they are made: arbiters, goal inferences, distractors, questionnaires.

Every one is a row of a table, or registered by an installed package, or in a file beside the study file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app.autonomy.interface import Arbiter, GoalInference, Models
from study.definition.part_fields import field_names, made, parameter_problems
from study.definition.sections import DistractorSettings
from study.definition.toml_reader import spell
from study.flow.distractors.contract import broken_promise
from study.flow.distractors.interface import Distractor
from study.parts.code import Code
from study.parts.errors import PartError, one_line
from study.parts.registry import Registry
from study.parts.shelf import Named, Shelf, code_among

ARBITERS = Registry(
    noun="arbiter",
    group="salab.arbiters",
    shipped={
        "teleoperation": "app.autonomy.arbiters.teleoperation:Teleoperation",
        "goal_oriented": "app.autonomy.arbiters.goal_oriented:GoalOriented",
        "balanced": "app.autonomy.arbiters.balanced:Balanced",
    },
    methods=("decide",),
    base="app.autonomy.interface:Arbiter",
)
INFERENCES = Registry(
    noun="inference",
    group="salab.inference",
    shipped={"boltzmann": "app.autonomy.inference.boltzmann:Boltzmann"},
    methods=("update",),
    base="app.autonomy.interface:GoalInference",
)
DISTRACTORS = Registry(
    noun="distractor",
    group="salab.distractors",
    shipped={
        "readings": "study.flow.distractors.readings:Readings",
        "nback": "study.flow.distractors.nback:NBack",
    },
    methods=("Parameters", "due_s", "deadline_s", "stimulus", "right_answer", "is_right", "simulated_answer"),
)
QUESTIONNAIRES = Registry(
    noun="questionnaire",
    group="salab.questionnaires",
    shipped={
        "sus_modified": "study.definition.builtin_questionnaires:SUS_MODIFIED",
        "tlx_raw": "study.definition.builtin_questionnaires:TLX_RAW",
    },
    methods=(),
)
REGISTRIES: Mapping[str, Registry] = {
    "arbiter": ARBITERS,
    "inference": INFERENCES,
    "distractor": DISTRACTORS,
    "questionnaire": QUESTIONNAIRES,
}


def shelf(trust: bool = False) -> Shelf:
    """What a study file may name; `trust`: its own code may run."""
    return Shelf(REGISTRIES, trust, _TRIALS)


def named(kind: str, name: str, given: Mapping[str, Any], codes: Sequence[Code], shelf: Shelf) -> Named:
    """A part of a study with everything it takes. Raises `PartError` with one line: unknown, not trusted, not the
    source it was, broken, or given what it does not take."""
    code = code_among(codes, kind, name)
    part = shelf.load(kind, name, code)
    found = parameter_problems(part.Parameters, given)
    if found:
        raise PartError(f"{kind} {name!r}: {spell(found[0].path)}: {found[0].sentence}")
    whole = made(part.Parameters, given)
    return Named(kind, name, {field: getattr(whole, field) for field in field_names(part.Parameters)}, code)


def make_arbiter(part: Named, models: Models) -> Arbiter:
    """An arbiter as a study names it. Raises `PartError` as `Shelf.load`, and for one that cannot be made.

    The code of a set-up is trusted: whoever made the set-up had to say so.
    """
    arbiter: Arbiter = _make(part, models)
    return arbiter


def make_inference(part: Named, models: Models) -> GoalInference:
    """A goal inference as a study names it; raises as `make_arbiter`."""
    inference: GoalInference = _make(part, models)
    return inference


def make_distractor(settings: DistractorSettings, codes: Sequence[Code] = (), trust: bool = False) -> Distractor[Any]:
    """The distractor of a study; raises as `make_arbiter`, and for one that does not keep to its contract."""
    part = named("distractor", settings.kind, settings.parameters, codes, shelf(trust))
    distractor: Distractor[Any] = _make(part, settings)
    broken = broken_promise(distractor)
    if broken is not None:
        raise PartError(f"distractor {settings.kind!r}: {broken}")
    return distractor


def _make(part: Named, given: Models | DistractorSettings) -> Any:
    loaded = shelf(trust=True).load(part.kind, part.name, part.code)
    return _made(f"{part.kind} {part.name!r}", loaded, part.parameters, given)


def _made(called: str, loaded: Any, table: Mapping[str, Any], given: Models | DistractorSettings) -> Any:
    try:
        return loaded(made(loaded.Parameters, table), given)
    except (Exception, SystemExit) as error:  # somebody else's code may raise whatever it likes
        raise PartError(f"{called} cannot be made: {type(error).__name__}: {one_line(error)}") from error


# ---- tried out while a study file is read -------------------------------------------------------------------------


def _try_with_models(kind: str) -> Callable[[Any, Mapping[str, Any]], str | None]:
    def tried(loaded: Any, table: Mapping[str, Any]) -> str | None:
        _made(f"{kind} {loaded.__name__}", loaded, table, Models())
        return None

    return tried


def _try_distractor(loaded: Any, table: Mapping[str, Any]) -> str | None:
    settings = DistractorSettings.model_validate(table)
    return broken_promise(_made(f"distractor {loaded.__name__}", loaded, table, settings))


_TRIALS: Mapping[str, Callable[[Any, Mapping[str, Any]], str | None]] = {
    "arbiter": _try_with_models("arbiter"),
    "inference": _try_with_models("inference"),
    "distractor": _try_distractor,
}
