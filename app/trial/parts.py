"""The parts a study may name, and how they are made: arbiters, goal inferences, questionnaires.

Every one is a row of a table, or registered by an installed package, or in a file beside the study file.
"""

from __future__ import annotations

from typing import Any

from app.autonomy.interface import Arbiter, GoalInference, Models
from study.definition.part_fields import made
from study.parts.errors import PartError
from study.parts.registry import Registry
from study.parts.shelf import Named, Shelf

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
QUESTIONNAIRES = Registry(
    noun="questionnaire",
    group="salab.questionnaires",
    shipped={
        "sus_modified": "study.definition.builtin_questionnaires:SUS_MODIFIED",
        "tlx_raw": "study.definition.builtin_questionnaires:TLX_RAW",
    },
    methods=(),
)

REGISTRIES = {"arbiter": ARBITERS, "inference": INFERENCES, "questionnaire": QUESTIONNAIRES}


def shelf(trust: bool = False) -> Shelf:
    """What a study file may name; `trust`: its own code may run."""
    return Shelf(REGISTRIES, trust)


def make_arbiter(named: Named, models: Models) -> Arbiter:
    """An arbiter as a study names it. Raises `PartError` as `Shelf.load`, and for one that cannot be made.

    The code of a set-up is trusted: whoever made the set-up had to say so.
    """
    arbiter: Arbiter = _make(named, models)
    return arbiter


def make_inference(named: Named, models: Models) -> GoalInference:
    """A goal inference as a study names it; raises as `make_arbiter`."""
    inference: GoalInference = _make(named, models)
    return inference


def _make(named: Named, models: Models) -> Any:
    loaded = shelf(trust=True).load(named.kind, named.name, named.code)
    try:
        return loaded(made(loaded.Parameters, named.parameters), models)
    except Exception as error:  # somebody else's code may raise whatever it likes
        text = " ".join(str(error).split())
        raise PartError(f"{named.kind} {named.name!r} cannot be made: {type(error).__name__}: {text}") from error
