"""Goal-oriented reward: eq. 1 for each goal, and its expectation under the belief, hindsight optimisation
(eq. 7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from app.autonomy.arrays import (
    FloatArray,
    checked_goals_m,
    checked_points_m,
    checked_probabilities,
    distances_m,
)
from app.autonomy.transition import TransitionModel

_FEW_GOALS = 50
"""With more, an axis at a time stays nearer to the processor."""


def goal_rewards_m(
    position_m: npt.ArrayLike, momentum: npt.ArrayLike, goals_m: npt.ArrayLike, model: TransitionModel
) -> FloatArray:
    """R_phi(x, u) = dist(x, phi) - dist(T(x, u), phi), eq. 1: (..., 3) states, (G, 3) goals -> (..., 27, G),
    metres.

    Goals are taken where they are now; they may move between calls.

    Raises:
        AutonomyError: states or goals that are not finite, or of the wrong shape.
    """
    positions_m = checked_points_m("position_m", position_m)
    goals = checked_goals_m(goals_m)
    from_m = positions_m[..., None, :]
    return rewards_of_moves_m(from_m, from_m + model.displacements(momentum), goals)


def rewards_of_moves_m(from_m: FloatArray, to_m: FloatArray, goals_m: FloatArray) -> FloatArray:
    """Eq. 1 of checked values: how much nearer to each goal a move leads, (..., 3), (..., 3), (G, 3) -> (..., G),
    metres; shapes of ``from_m`` and ``to_m`` broadcast."""
    if from_m.ndim == 1 and to_m.ndim == 2:  # one place, as in every tick: all distances in one go
        distances: FloatArray = distances_m(np.concatenate((from_m[None], to_m)), goals_m)
        rewards_m: FloatArray = distances[0] - distances[1:]
        return rewards_m
    return distances_m(from_m, goals_m) - distances_m(to_m, goals_m)


def moves_rewards_m(position_m: Sequence[float], here_and_next_m: FloatArray, goals_m: FloatArray) -> FloatArray:
    """``rewards_of_moves_m`` of one place and its 27 moves, bit for bit, in fewer steps: ``here_and_next_m`` (3, 28, 1)
    is no move and then each action's, an axis at a time, -> (27, G), metres."""
    places_m = here_and_next_m + np.array(position_m)[:, None, None]
    if goals_m.shape[0] > _FEW_GOALS:
        places_m = places_m[..., 0].T
        return rewards_of_moves_m(places_m[0], places_m[1:], goals_m)
    squares = places_m - goals_m.T[:, None]  # (3, 28, G)
    squares *= squares
    distances, y, z = squares
    distances += y
    distances += z
    np.sqrt(distances, out=distances)
    rewards_m: FloatArray = distances[0] - distances[1:]
    return rewards_m


def hindsight_reward(
    position_m: npt.ArrayLike,
    momentum: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    probabilities: npt.ArrayLike,
    model: TransitionModel,
) -> FloatArray:
    """R_HO(x, u) = sum_phi R_phi(x, u) b(phi), eq. 7, for every action: (..., 3) -> (..., 27), metres.

    Raises:
        AutonomyError: values that are not finite, shapes that do not match, or a belief that does not sum to
            1.
    """
    rewards_m = goal_rewards_m(position_m, momentum, goals_m, model)  # (..., 27, G)
    return rewards_m @ checked_probabilities(probabilities, rewards_m.shape[-1])


def hindsight_reward_at(
    positions_m: npt.ArrayLike,
    from_position_m: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    probabilities: npt.ArrayLike,
) -> FloatArray:
    """Eq. 7 as a map over places (paper Fig. 2B): the expected reward of standing at each of ``positions_m``
    instead of at ``from_position_m``, sum_phi b(phi) (dist(from, phi) - dist(position, phi)): (N, 3) -> (N,),
    metres.

    Raises:
        AutonomyError: values that are not finite, shapes that do not match, or a belief that does not sum to
            1.
    """
    goals = checked_goals_m(goals_m)
    belief = checked_probabilities(probabilities, goals.shape[0])
    places_m = checked_points_m("positions_m", positions_m)
    origin_m = checked_points_m("from_position_m", from_position_m)
    return (distances_m(origin_m, goals) - distances_m(places_m, goals)) @ belief
