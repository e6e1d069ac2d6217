"""An arbiter that learns from being corrected: the more often people drive against it, the surer it wants to be.

A file beside the study file is enough: no package, nothing to install. `study.toml` names it as
`arbiter = "yielding.py:Yielding"`. It runs only if you say that you trust it:

    salab check study.toml --trust
    salab simulate --study study.toml --trust --participants 2 --out pilot
    salab serve --study study.toml --trust

What it learns has to outlive a pick-and-place cycle, so it is its *memory*: a value of JSON, which the lab keeps at
the start of each cycle. Within a cycle an ordinary attribute will do. A worker that is replaced makes the same arbiter
again, gives it its memory back, and asks the same questions from the start of the cycle on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Le

from app.autonomy.actions import DIRECTIONS, Direction
from app.autonomy.belief import Belief
from app.autonomy.interface import Arbiter, Explanation, Feasible, Models, State

STAY: Direction = (0, 0, 0)


@dataclass(frozen=True)
class Manners:
    """How ready the arbiter is to move, and how fast it learns that it is not wanted to."""

    confidence: Annotated[float, Ge(0.0), Le(1.0)] = 0.3
    """How probable a goal must be before the first correction."""
    patience: Annotated[float, Gt(0.0), Le(1000.0)] = 10.0
    """How many corrections bring that half the way up to certainty."""


class Yielding(Arbiter):
    """Goes to the likeliest goal, if it is probable enough; how much that is, corrections decide."""

    Parameters: ClassVar[type[Any]] = Manners
    parameters: Manners

    def __init__(self, parameters: Manners, models: Models) -> None:
        super().__init__(parameters, models)
        self.memory = {"moves": 0, "corrections": 0}  # before the first cycle of a trial
        self._last = STAY  # of this cycle alone

    @property
    def needed(self) -> float:
        """How probable a goal must be by now."""
        corrections: int = self.memory["corrections"]
        learnt = corrections / (corrections + self.parameters.patience)
        return self.parameters.confidence + (1.0 - self.parameters.confidence) * learnt

    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Direction:
        moves, corrections = self.memory["moves"], self.memory["corrections"]
        if user is not None:
            # The arm moved by itself, and the person drives against it.
            if np.dot(user, self._last) < 0:
                self.memory = {"moves": moves, "corrections": corrections + 1}
            self._last = STAY
            return user
        self._last = self._own(state, belief, feasible)
        if self._last != STAY:
            self.memory = {"moves": moves + 1, "corrections": corrections}
        return self._last

    def explain(self, state: State, belief: Belief, user: Direction | None, action: Direction) -> Explanation:
        # Asked after `decide`. It tells the memory, and must not change it.
        return {"likeliest": float(belief.probabilities.max()), "needed": self.needed, **self.memory}

    def _own(self, state: State, belief: Belief, feasible: Feasible) -> Direction:
        goal = int(belief.probabilities.argmax())
        if belief.probabilities[goal] < self.needed:
            return STAY
        ends_m = np.array(state.position_m) + self.models.transition.displacements(state.momentum)
        distances_m = np.linalg.norm(ends_m - state.goals_m[goal], axis=1)
        ordered = (DIRECTIONS[index] for index in distances_m.argsort(kind="stable"))
        return next(action for action in ordered if action == STAY or feasible(action))
