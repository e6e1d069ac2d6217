"""Hindsight optimisation (III-C, eq. 7): the action that leads nearest to the goals, weighed by their probability."""

from __future__ import annotations

from typing import Any, ClassVar

from app.autonomy.actions import DIRECTIONS, Direction
from app.autonomy.arbiters.weighing import WeighingArbiter, WeightsWithoutInformation
from app.autonomy.belief import Belief
from app.autonomy.interface import Feasible, State


class GoalOriented(WeighingArbiter):
    """u* = argmax_u  beta f2(H) R_HO(x, u) + gamma D(u)."""

    Parameters: ClassVar[type[Any]] = WeightsWithoutInformation

    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Direction:
        return DIRECTIONS[self.weighing(state, belief, user).best(feasible)]
