"""No help: the arm does what the person does, and stays while the hands are off."""

from __future__ import annotations

from typing import Any, ClassVar

from app.autonomy.actions import Direction
from app.autonomy.arbiters.weighing import WeighingArbiter, WeightsWithoutInformation
from app.autonomy.belief import Belief
from app.autonomy.interface import Feasible, State


class Teleoperation(WeighingArbiter):
    """u* = u_H. The weights only tell what the sum would have said."""

    Parameters: ClassVar[type[Any]] = WeightsWithoutInformation
    moves_by_itself: ClassVar[bool] = False

    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Direction:
        return user or (0, 0, 0)
