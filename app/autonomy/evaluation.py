"""One tick's whole reasoning as a function of numbers: belief, terms, score, choice. For the API, and for tests.

In order: the person's action, if there is one, updates the belief; everything after it uses that posterior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.autonomy.actions import ACTION_COUNT, DIRECTIONS, index_of
from app.autonomy.arbiters.weighing import WeighingArbiter
from app.autonomy.arrays import (
    BoolArray,
    FloatArray,
    checked_goals_m,
    checked_momentum,
    checked_points_m,
    checked_probabilities,
    frozen,
)
from app.autonomy.belief import Belief
from app.autonomy.errors import AutonomyError
from app.autonomy.inference.boltzmann import Boltzmann, log_likelihoods
from app.autonomy.interface import State


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What the arbiter thought in one tick. Arrays are read-only; (27,) follows ``actions.DIRECTIONS``.

    ``score`` is the weighted sum for all 27 actions, feasible or not (under ``teleoperation`` it tells what the sum
    would have said); ``selection_bonus`` is the stickiness added to it for the choice; ``chosen`` is an index into
    ``DIRECTIONS``.
    """

    likelihood: FloatArray  # (27, G), P(u | phi, x)
    posterior: FloatArray  # (G,)
    entropy: float  # of the posterior, base |Phi|
    information_gain: FloatArray  # (27,), at T(x, u)
    hindsight_reward: FloatArray  # (27,), metres
    score: FloatArray  # (27,)
    selection_bonus: FloatArray  # (27,)
    chosen: int


def state_of(
    position_m: npt.ArrayLike, momentum: npt.ArrayLike, goals_m: npt.ArrayLike, goal_ids: Sequence[str] | None = None
) -> State:
    """A state from a caller's numbers: (3,), (3,), (G, 3). Goals without names are called 0, 1, ...

    Raises:
        AutonomyError: values that are not finite, of the wrong shape or out of bounds.
    """
    goals = checked_goals_m(goals_m)
    point = checked_points_m("position_m", position_m)
    if point.shape != (3,):
        raise AutonomyError(f"position_m has shape {point.shape}; it must be (3,)")
    x, y, z = point.tolist()
    m_x, m_y, m_z = checked_momentum(momentum).tolist()
    names = tuple(goal_ids) if goal_ids is not None else tuple(str(number) for number in range(len(goals)))
    return State((x, y, z), (m_x, m_y, m_z), names, goals)


def evaluate(
    position_m: npt.ArrayLike,
    momentum: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    prior: npt.ArrayLike | None,
    user_action: Sequence[int] | None,
    arbiter: WeighingArbiter,
    feasible: npt.ArrayLike | None = None,
) -> Evaluation:
    """Update the belief by ``user_action`` and weigh all 27 actions with the posterior.

    Args:
        position_m: (3,), gripper in the world frame, metres.
        momentum: (3,), the direction executed in the last tick, length <= 1, 0 after any stop.
        goals_m: (G, 3), where the goals are now, world frame, metres.
        prior: b(phi) before this tick, (G,); None is uniform.
        user_action: the person's direction, each of -1, 0, 1; None is no input and no evidence.
        arbiter: whose weights count, and who chooses.
        feasible: (27,), False for what the arm cannot do; such actions are chosen only if the person commands
            them. None: all can be done. With nothing left, the choice is to stay.

    Raises:
        AutonomyError: values that are not finite, of the wrong shape or out of bounds.
    """
    state = state_of(position_m, momentum, goals_m)
    user = None if user_action is None else DIRECTIONS[index_of(user_action)]
    belief = Belief.uniform(state.goal_ids)
    if prior is not None:
        belief = Belief(state.goal_ids, checked_probabilities(prior, len(state.goal_ids)))
    allowed = _allowed(feasible)
    belief = Boltzmann(Boltzmann.Parameters(), arbiter.models).update(state, belief, user)
    terms = arbiter.weighing(state, belief, user)
    chosen = arbiter.decide(state, belief, user, lambda action: bool(allowed[index_of(action)]))
    return Evaluation(
        likelihood=frozen(np.exp(log_likelihoods(state, arbiter.models))),
        posterior=belief.probabilities,
        entropy=belief.entropy,
        information_gain=frozen(terms.information_gain),
        hindsight_reward=frozen(terms.hindsight_reward),
        score=frozen(terms.score),
        selection_bonus=frozen(terms.selection_bonus),
        chosen=index_of(chosen),
    )


def _allowed(feasible: npt.ArrayLike | None) -> BoolArray:
    if feasible is None:
        return np.ones(ACTION_COUNT, dtype=np.bool_)
    allowed = np.array(feasible)
    if allowed.shape != (ACTION_COUNT,) or allowed.dtype != np.bool_:
        raise AutonomyError(f"feasible is {feasible!r}; it must be {ACTION_COUNT} booleans")
    return allowed
