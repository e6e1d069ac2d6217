"""Why an arbiter chose otherwise on one robot than on another, though the arms were nearly in one place."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Literal

import numpy as np

from app.autonomy.actions import Direction, index_of
from app.autonomy.arbiters.weighing import WeighingArbiter
from app.autonomy.belief import Belief
from app.autonomy.interface import State
from app.trial.parts import make_arbiter
from app.trial.values import TrialSetup
from study.records import TickRow

Why = Literal["not allowed", "tipped", "unknown"]
WHYS: Mapping[Why, str] = {
    "not allowed": "the action that scored higher was not to be done on one of them",
    "tipped": "each scored its own action higher",
    "unknown": "the arbiter does not say",
}


def why_otherwise(setup: TrialSetup, first: TickRow, other: TickRow) -> Why:
    """By what the arbiter itself gives both actions on either robot: where it gives the one it took less than the other
    one, that other one could not be done there (out of reach, or something in the way); where it prefers on either what
    it took, the states have tipped the balance."""
    one, two = _action(first), _action(other)
    if one is None or two is None or "robot" not in (first.source, other.source):
        return "unknown"
    margins = (_margin(setup, first, one, two), _margin(setup, other, two, one))
    if any(map(math.isnan, margins)):
        return "unknown"
    return "not allowed" if min(margins) < 0.0 else "tipped"


def _action(row: TickRow) -> Direction | None:
    if row.action_x is None or row.action_y is None or row.action_z is None:
        return None
    return (row.action_x, row.action_y, row.action_z)


def _margin(setup: TrialSetup, row: TickRow, taken: Direction, left: Direction) -> float:
    """How much higher the arbiter scores what it took; NaN where it does not say."""
    goals = json.loads(row.goals)
    belief = json.loads(row.belief)
    state = State(
        position_m=(row.p_x, row.p_y, row.p_z),
        momentum=(row.m_x, row.m_y, row.m_z),
        goal_ids=tuple(goals),
        goals_m=np.array(list(goals.values())),
        held=row.held,
        tick=row.tick,
    )
    held = Belief(tuple(belief), np.array(list(belief.values())))
    arbiter = make_arbiter(setup.arbiter, setup.models)
    if isinstance(arbiter, WeighingArbiter):
        weighed = arbiter.weighing(state, held, None)
        values = weighed.score + weighed.selection_bonus
        return float(values[index_of(taken)] - values[index_of(left)])
    scores = [arbiter.explain(state, held, None, action).get("score") for action in (taken, left)]
    high, low = (score if isinstance(score, float) else math.nan for score in scores)
    return high - low
