"""What the paper's arbiters maximise (III-E, III-F), and the choice among its 27 values.

    alpha f1(H) I(xi, T(x, u)) + beta f2(H) R_HO(x, u) + gamma D(u),
    f1(H) = max(H, 0.1),  f2 = 1 / f1,  D(u) = -||u - u_H||  (0 without user input).

H and the belief are those after the person's action. The paper lets the person always win; here that is a gamma too
large to be outbid (the default), and a finite gamma blends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal, Union

import numpy as np
from annotated_types import Ge, Gt, Le
from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from app.autonomy.actions import (
    ACTION_COUNT,
    DIRECTIONS,
    NULL_ACTION,
    UNIT_DIRECTIONS,
    Direction,
    index_of,
    nearest_action,
)
from app.autonomy.arrays import FloatArray
from app.autonomy.belief import Belief
from app.autonomy.errors import AutonomyError
from app.autonomy.hindsight import moves_rewards_m
from app.autonomy.interface import Arbiter, Explanation, Feasible, Models, State
from app.autonomy.looking import MAX_LOOK_AHEAD_M, Looking, Place
from app.autonomy.rough_gains import rough_gains

TIE_TOLERANCE = 1e-12
"""Scores this close to the best are equal: the previous direction is kept, else the lowest index wins."""

_NEAREST_OTHER = float(np.sqrt(2.0 - 2.0 * np.sqrt(2.0 / 3.0)))
"""Distance between the two nearest of the 27 unit directions, an edge's and a corner's."""

CALIBRATED = "calibrated"
"""Stands for the alpha that the lab works out from the study's own layout (`app.autonomy.calibration`)."""


def _calibrated_or_number(value: object) -> object:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if value == CALIBRATED or (is_number and 0 <= float(value) < float("inf")):  # type: ignore[arg-type]
        return value
    raise PydanticCustomError("alpha", 'must be a number at least 0, or "calibrated"')


Alpha = Annotated[
    Union[float, Literal["calibrated"]],  # noqa: UP007 - evaluated at run time on 3.10 as well
    BeforeValidator(_calibrated_or_number),
    Field(json_schema_extra={"expected": 'a number or "calibrated"'}),
]
NotNegative = Annotated[float, Ge(0.0)]


@dataclass(frozen=True)
class Weights:
    """How the terms are weighed.

    Raises:
        AutonomyError: a value out of bounds.
    """

    alpha: Alpha
    """Weight of information gain, in metres of R_HO, or `"calibrated"`."""
    beta: NotNegative = 1.0
    """Weight of hindsight reward, of getting closer to the goals."""
    gamma: NotNegative = 1e6
    """Weight of D, of doing what the person does. The default outbids everything as long as alpha is below about 6e5,
    since the nearest other action is 0.6 away from the person's."""
    entropy_floor: Annotated[float, Gt(0.0), Le(1.0)] = 0.1
    """Below this entropy the weights change no more; 0.1 in the paper."""
    stickiness: NotNegative = 0.0
    """Bonus, in units of the score, for continuing the current direction. It acts on the choice when there is no input,
    and is not part of the score."""

    def __post_init__(self) -> None:
        for name in ("alpha", "beta", "gamma", "stickiness"):
            value = getattr(self, name)
            if value != CALIBRATED and not 0.0 <= value < math.inf:
                raise AutonomyError(f"{name} is {value!r}; it must be finite and >= 0")
        if not 0.0 < self.entropy_floor <= 1.0:
            raise AutonomyError(f"entropy_floor is {self.entropy_floor!r}; it must be in (0, 1]")

    @property
    def looking(self) -> Looking:
        """Where information is looked at: as the paper prints it."""
        return PRINTED


PRINTED = Looking()


@dataclass(frozen=True)
class WeightsOfInformation(Weights):
    """Those of an arbiter that looks for information, and where it looks at it (`app.autonomy.looking`)."""

    information: Place = "next"
    """`next`: in the state that an action leads to, the paper's equation. `ahead`: `look_ahead_m` on in its direction.
    `at_rest`: in the same place, at rest. `averaged`: there, over the momentum that the person's next action leaves."""
    look_ahead_m: Annotated[float, Gt(0.0), Le(MAX_LOOK_AHEAD_M)] = 0.20
    """How far on `ahead` looks, in metres."""

    def __post_init__(self) -> None:
        super().__post_init__()
        Looking(self.information, self.look_ahead_m)

    @property
    def looking(self) -> Looking:
        """Where information is looked at."""
        return Looking(self.information, self.look_ahead_m)


@dataclass(frozen=True)
class WeightsWithoutInformation(Weights):
    """Those of an arbiter that looks for no information."""

    alpha: Alpha = 0.0
    """0: information weighs nothing."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.alpha != 0.0:
            raise AutonomyError(f"alpha is {self.alpha!r}; it must be 0 (or left out) with this arbiter")


def entropy_weights(entropy: float, entropy_floor: float = 0.1) -> tuple[float, float]:
    """f1 = max(H, floor) and f2 = 1 / f1 (paper III-F)."""
    information_weight = max(entropy, entropy_floor)
    return information_weight, 1.0 / information_weight


def disagreement(user_index: int | None) -> FloatArray:
    """D(u) = -||u - u_H|| between unit directions (paper III-E), for every action (27,); 0 without input."""
    if user_index is None:
        return np.zeros(ACTION_COUNT)
    offsets = UNIT_DIRECTIONS - UNIT_DIRECTIONS[user_index]
    distances: FloatArray = np.sqrt(np.einsum("ui,ui->u", offsets, offsets))
    return -distances


class Weighing:
    """The terms of one tick's sum, each worked out when it is asked for. Arrays follow ``actions.DIRECTIONS``."""

    def __init__(self, state: State, belief: Belief, user: Direction | None, weights: Weights, models: Models) -> None:
        self._state, self._belief, self._weights, self._models = state, belief, weights, models
        self.user_index = None if user is None else index_of(user)

    @cached_property
    def previous(self) -> int | None:
        """The action that continues the current direction; None at rest."""
        return nearest_action(self._state.momentum)

    @cached_property
    def _position_m(self) -> FloatArray:  # (3,)
        return np.array(self._state.position_m)

    @cached_property
    def _next_positions_m(self) -> FloatArray:  # (27, 3), T(x, u)
        displacements_m = self._models.transition.displacements(self._state.momentum)
        next_positions_m: FloatArray = self._position_m + displacements_m
        return next_positions_m

    @cached_property
    def information_gain(self) -> FloatArray:  # eq. 11, at T(x, u) where nothing else is said
        """I, (27,), in units of log |goals|."""
        return self._weights.looking.gains(
            self._position_m,
            self._next_positions_m,
            self._state.goals_m,
            self._belief.probabilities,
            self._models.transition,
            self._models.rationality_per_m,
        )

    @cached_property
    def hindsight_reward(self) -> FloatArray:  # eq. 7
        """R_HO, (27,), metres."""
        ways_m = self._models.transition.here_and_next(self._state.momentum)
        rewards_m = moves_rewards_m(self._state.position_m, ways_m, self._state.goals_m)  # eq. 1, (27, G)
        reward_m: FloatArray = rewards_m @ self._belief.probabilities
        return reward_m

    @cached_property
    def score(self) -> FloatArray:
        """The whole sum, (27,); without a weight, information is not looked at."""
        f1, f2 = entropy_weights(self._belief.entropy, self._weights.entropy_floor)
        score = self._weights.beta * f2 * self.hindsight_reward
        alpha = number(self._weights.alpha)
        if alpha > 0.0:
            score += alpha * f1 * self.information_gain
        if self.user_index is not None:
            score += self._weights.gamma * disagreement(self.user_index)
        return score

    @cached_property
    def selection_bonus(self) -> FloatArray:
        """The stickiness, (27,)."""
        bonus = np.zeros(ACTION_COUNT)
        if self.previous is not None and self.user_index is None:
            bonus[self.previous] = self._weights.stickiness
        return bonus

    def best(self, feasible: Feasible) -> int:
        """u*, an index into ``DIRECTIONS``: the best action that can be done; the person's needs not to be.

        Nothing is weighed when the person's action cannot be outbid.
        """
        if self.user_index is not None and _cannot_be_outbid(self._weights, self._models):
            return self.user_index
        impossible: list[int] = []
        if (best := self._certainly_best(feasible, impossible)) is not None:
            return best
        values: list[float] = (self.score + self.selection_bonus).tolist()
        for index in impossible:
            values[index] = -math.inf
        while True:
            chosen = select(values, self.previous)
            nothing_left = values[chosen] == -math.inf
            if nothing_left or chosen == self.user_index or feasible(DIRECTIONS[chosen]):
                return chosen
            values[chosen] = -math.inf

    def _certainly_best(self, feasible: Feasible, impossible: list[int]) -> int | None:
        """The best action as far as rough values tell it for certain, in a third of the time; None where they do not.
        What was found that cannot be done is added to ``impossible``."""
        alpha = number(self._weights.alpha)
        rough = None
        if alpha > 0.0:
            rough = rough_gains(self._state, self._belief.probabilities, self._models, self._weights.looking)
        if rough is None:
            return None
        f1, f2 = entropy_weights(self._belief.entropy, self._weights.entropy_floor)
        gains = np.minimum(np.maximum(rough.gains, 0.0), self._belief.entropy)
        score = self._weights.beta * f2 * self.hindsight_reward + alpha * f1 * gains
        if self.user_index is not None:
            score += self._weights.gamma * disagreement(self.user_index)
        if self._weights.stickiness:
            score += self.selection_bonus
        values: list[float] = score.tolist()
        most = max(values)
        apart = TIE_TOLERANCE + 2.0 * alpha * f1 * rough.error + 1e-14 * (1.0 + abs(most))
        while most > -math.inf:
            chosen = values.index(most)
            values[chosen] = -math.inf
            following = max(values)
            if not most - following > apart:
                return None
            if chosen == self.user_index or feasible(DIRECTIONS[chosen]):
                return chosen
            impossible.append(chosen)
            most = following
        return None


class WeighingArbiter(Arbiter):
    """An arbiter whose parameters are weights of the sum."""

    parameters: Weights

    def weighing(self, state: State, belief: Belief, user: Direction | None) -> Weighing:
        """The terms of one tick."""
        return Weighing(state, belief, user, self.parameters, self.models)

    def explain(self, state: State, belief: Belief, user: Direction | None, action: Direction) -> Explanation:
        """The two rewards of III-F for the action, what they weigh, and their sum.

        What agreement with the person adds (gamma) is left out: it decides, and hides the rest.
        """
        terms, chosen = self.weighing(state, belief, user), index_of(action)
        f1, f2 = entropy_weights(belief.entropy, self.parameters.entropy_floor)
        information, reward_m = float(terms.information_gain[chosen]), float(terms.hindsight_reward[chosen])
        weighted_information = number(self.parameters.alpha) * f1 * information
        weighted_reward = self.parameters.beta * f2 * reward_m
        return {
            "information": information,
            "reward_m": reward_m,
            "weighted_information": weighted_information,
            "weighted_reward": weighted_reward,
            "score": weighted_information + weighted_reward,
        }


def number(alpha: float | str) -> float:
    """The weight itself. Raises `AutonomyError` while it is still to be calibrated."""
    if isinstance(alpha, str):
        raise AutonomyError(f"alpha is {alpha!r}; calibrate it first (app.autonomy.calibration)")
    return alpha


def _cannot_be_outbid(weights: Weights, models: Models) -> bool:
    """Whether gamma alone decides: a gain is at most 1, a reward at most a step either way."""
    most = number(weights.alpha) + weights.beta / weights.entropy_floor * 2.0 * models.transition.step_m
    return weights.gamma * _NEAREST_OTHER > 2.0 * most + TIE_TOLERANCE


def select(values: Sequence[float], previous: int | None) -> int:
    """The best of 27 ``values``, -inf for what cannot be done: ties go to ``previous``, else to the lowest index; with
    nothing left, stay."""
    most = max(values)
    if most == -math.inf:
        return NULL_ACTION
    least = most - TIE_TOLERANCE
    if previous is not None and values[previous] >= least:
        return previous
    return next(index for index, value in enumerate(values) if value >= least)
