"""One of the paper's arbiters with all its numbers, as a single value that tests vary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy.typing as npt

from app.autonomy import evaluation
from app.autonomy.arbiters.balanced import Balanced
from app.autonomy.arbiters.goal_oriented import GoalOriented
from app.autonomy.arbiters.teleoperation import Teleoperation
from app.autonomy.arbiters.weighing import WeighingArbiter, Weights
from app.autonomy.interface import RATIONALITY_PER_M, Models
from app.autonomy.transition import TransitionModel

Condition = Literal["teleoperation", "goal_oriented", "balanced"]
CONDITIONS: tuple[Condition, ...] = ("teleoperation", "goal_oriented", "balanced")
_KINDS: dict[Condition, type[WeighingArbiter]] = {
    "teleoperation": Teleoperation,
    "goal_oriented": GoalOriented,
    "balanced": Balanced,
}


@dataclass(frozen=True)
class ArbiterCase:
    """See the module's text. Raises `AutonomyError` as `Weights` and `Models` do; alpha counts as 0 where it must."""

    condition: Condition
    alpha: float
    beta: float = 1.0
    gamma: float = 1e6
    rationality_per_m: float = RATIONALITY_PER_M
    transition: TransitionModel = field(default_factory=TransitionModel)
    entropy_floor: float = 0.1
    stickiness: float = 0.0

    def __post_init__(self) -> None:
        Weights(self.alpha)
        _ = self.arbiter

    @property
    def arbiter(self) -> WeighingArbiter:
        """Made anew."""
        alpha = 0.0 if self.condition == "goal_oriented" else self.alpha
        weights = Weights(alpha, self.beta, self.gamma, self.entropy_floor, self.stickiness)
        return _KINDS[self.condition](weights, Models(self.rationality_per_m, self.transition))


def case_of(condition: Condition, arbiter: WeighingArbiter) -> ArbiterCase:
    """The numbers of an arbiter that was made."""
    weights, models = arbiter.parameters, arbiter.models
    assert not isinstance(weights.alpha, str)
    return ArbiterCase(
        condition,
        weights.alpha,
        weights.beta,
        weights.gamma,
        models.rationality_per_m,
        models.transition,
        weights.entropy_floor,
        weights.stickiness,
    )


def evaluate(
    position_m: npt.ArrayLike,
    momentum: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    prior: npt.ArrayLike | None,
    user_action: Sequence[int] | None,
    case: ArbiterCase,
    feasible: npt.ArrayLike | None = None,
) -> evaluation.Evaluation:
    """`app.autonomy.evaluation.evaluate` for a case."""
    return evaluation.evaluate(position_m, momentum, goals_m, prior, user_action, case.arbiter, feasible)
