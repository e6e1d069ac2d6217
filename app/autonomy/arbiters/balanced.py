"""The paper's arbiter (III-F): goal-oriented help, and actions after which the person's next input tells more."""

from __future__ import annotations

from typing import Any, ClassVar

from app.autonomy.actions import DIRECTIONS, Direction
from app.autonomy.arbiters.weighing import WeighingArbiter, WeightsOfInformation
from app.autonomy.belief import Belief
from app.autonomy.interface import Feasible, State


class Balanced(WeighingArbiter):
    """u* = argmax_u  alpha f1(H) I(xi, T(x, u)) + beta f2(H) R_HO(x, u) + gamma D(u)."""

    Parameters: ClassVar[type[Any]] = WeightsOfInformation

    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Direction:
        return DIRECTIONS[self.weighing(state, belief, user).best(feasible)]
