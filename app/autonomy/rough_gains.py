"""Expected information of all 27 actions to within a stated error, in a third of the time.

Eq. 11 as `app.autonomy.information` works it out is exact to the last digits, which a record of it has to be. To tell
which action is best, less will do as long as it is known how much less. Two things save most:

- all distances at once, as one product of matrices: |o - v|² = o·o - 2 o·v + v·v, with o from the arm to where two
  actions lead, the same wherever the arm is, and v from the arm to the goals. That loses digits next to a goal, by an
  amount that is known;
- log P(u' | phi, x') = z - log S with z = -kappa distance and S = sum exp z, so that of each exponential one is enough:
  I = sum_phi b (sum_u' P z - log S) - sum_u' p log p.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from app.autonomy.actions import ACTION_COUNT, NULL_ACTION, UNIT_DIRECTIONS
from app.autonomy.arrays import FloatArray, frozen
from app.autonomy.belief import log_of_count
from app.autonomy.interface import Models, State
from app.autonomy.looking import Looking
from app.autonomy.transition import TransitionModel

_EPS = float(np.finfo(np.float64).eps)
_GOALS_AT_ONCE = 20
"""More, and the numbers of a step do not stay near the processor, nor their memory with the process."""
_NEAREST_M = 1e-3
"""Nearer to a goal than this the product of matrices says too little."""
_MOST_EXPONENT = 300.0


class RoughGains(NamedTuple):
    """Information of each action, (27,), in units of log |goals|, and by how much any of it may be off."""

    gains: FloatArray
    error: float


class _Offsets(NamedTuple):
    """From the arm to where each of the person's 27 actions leads after each of the arm's, as rows of the product,
    (27 of the person * 27 of the arm, 5), and the longest of them, metres."""

    rows: FloatArray
    longest_m: float


def rough_gains(state: State, probabilities: FloatArray, models: Models, looking: Looking) -> RoughGains | None:
    """None where this is no way to tell: one goal, a goal next to the arm, a person too rational for one exponential,
    or information averaged over momenta."""
    goal_count, kappa = probabilities.shape[0], models.rationality_per_m
    if goal_count == 1 or looking.place == "averaged" or kappa <= 0.0:
        return None
    offsets = _offsets(models.transition, state.momentum, looking, kappa)
    ways_m = state.goals_m - np.array(state.position_m)  # (G, 3)
    squares = np.add.reduce(ways_m * ways_m, 1)
    of_goals = squares.tolist()
    farthest_m, nearest_m = math.sqrt(max(of_goals)) + offsets.longest_m, math.sqrt(min(of_goals)) - offsets.longest_m
    if kappa * farthest_m > _MOST_EXPONENT:
        return None
    columns = np.ones((5, goal_count))
    columns[:3], columns[4] = ways_m.T, squares
    ones = np.ones(goal_count)
    nats, marginals = np.zeros(ACTION_COUNT), np.zeros(ACTION_COUNT * ACTION_COUNT)
    for start in range(0, goal_count, _GOALS_AT_ONCE):
        part = slice(start, start + _GOALS_AT_ONCE)
        belief = probabilities[part]
        scores = offsets.rows @ columns[:, part]  # (27 * 27, G): (kappa distance)²
        if nearest_m < 10.0 * _NEAREST_M:
            nearest_m = math.sqrt(max(float(scores.min()), 0.0)) / kappa
            if nearest_m < _NEAREST_M:
                return None
        np.negative(np.sqrt(scores, out=scores), out=scores)
        shares = np.exp(scores)
        by_action = shares.reshape(ACTION_COUNT, -1)  # (27 of the person, 27 of the arm * G)
        sums = np.add.reduce(by_action, 0).reshape(ACTION_COUNT, -1)
        by_action *= (belief / sums).reshape(-1)  # b P(u' | phi, x')
        marginals += shares @ ones[part]
        scores *= shares
        nats += np.add.reduce(scores.reshape(by_action.shape), 0).reshape(sums.shape) @ ones[part]
        nats -= np.log(sums) @ belief
    marginals *= np.log(marginals)
    nats -= np.add.reduce(marginals.reshape(ACTION_COUNT, ACTION_COUNT), 0)
    unit = log_of_count(goal_count)
    return RoughGains(nats / unit, _error(kappa, goal_count, offsets.longest_m, farthest_m, nearest_m) / unit)


def _error(kappa: float, goals: int, longest_m: float, farthest_m: float, nearest_m: float) -> float:
    """In nats: what the squares lose, times what a score can do; and what sums of so many terms lose."""
    of_score = kappa * 8.0 * _EPS * farthest_m * farthest_m / nearest_m + 16.0 * _EPS * (1.0 + kappa * farthest_m)
    return 8.0 * of_score * (1.0 + 2.0 * kappa * longest_m) + _EPS * (64.0 + 4.0 * goals) * (8.0 + kappa * farthest_m)


@lru_cache(maxsize=64)  # few momenta, the same ones tick after tick
def _offsets(model: TransitionModel, momentum: tuple[float, float, float], looking: Looking, kappa: float) -> _Offsets:
    places_m = np.array(model.displacements(momentum))  # (27 of the arm, 3)
    if looking.place == "ahead":
        staying_m = places_m[NULL_ACTION].copy()
        places_m = looking.look_ahead_m * UNIT_DIRECTIONS
        places_m[NULL_ACTION] = staying_m
    moves_m = model.displacements_ahead()
    if looking.place == "at_rest" or looking.at_rest:
        moves_m = model.displacements(np.zeros(3))[:, None]
    offsets_m = (places_m + moves_m).reshape(-1, 3)
    squares = np.add.reduce(offsets_m * offsets_m, 1)
    rows = kappa * kappa * np.column_stack((-2.0 * offsets_m, squares, np.ones(len(squares))))
    return _Offsets(frozen(rows), math.sqrt(float(squares.max())))
