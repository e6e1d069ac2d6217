"""Predict, then act: stay until one goal is probable enough, then go there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le

from app.autonomy.actions import DIRECTIONS, Direction
from app.autonomy.belief import Belief
from app.autonomy.interface import Arbiter, Explanation, Feasible, State

STAY: Direction = (0, 0, 0)


@dataclass(frozen=True)
class Threshold:
    """How sure the arm has to be. The study file says it beside `arbiter = "predict_then_act"`."""

    confidence: Annotated[float, Ge(0.0), Le(1.0)] = 0.6
    """The least probability of the likeliest goal at which the arm moves by itself."""


class PredictThenAct(Arbiter):
    """The likeliest goal, or nothing."""

    Parameters: ClassVar[type[Any]] = Threshold
    parameters: Threshold

    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Direction:
        if user is not None:
            return user  # the person always wins, as in the paper
        goal = int(belief.probabilities.argmax())
        if belief.probabilities[goal] < self.parameters.confidence:
            return STAY
        return self._towards(state, goal, feasible)

    def explain(self, state: State, belief: Belief, user: Direction | None, action: Direction) -> Explanation:
        goal = int(belief.probabilities.argmax())
        return {
            "likeliest": belief.goal_ids[goal],
            "probability": float(belief.probabilities[goal]),
            "needed": self.parameters.confidence,
            "distance_m": float(np.linalg.norm(state.goals_m[goal] - state.position_m)),
        }

    def _towards(self, state: State, goal: int, feasible: Feasible) -> Direction:
        """The action that ends nearest to the goal, of those the arm can do from here."""
        # What each of the 27 actions would do, as the study's model of the arm has it: (27, 3), metres.
        ends_m = np.array(state.position_m) + self.models.transition.displacements(state.momentum)
        distances_m = np.linalg.norm(ends_m - state.goals_m[goal], axis=1)
        for index in distances_m.argsort(kind="stable"):  # stable: ties go the same way every time
            action = DIRECTIONS[index]
            # Asking is dear, and most often the first answer is yes: ask one by one.
            if action == STAY or feasible(action):
                return action
        return STAY
