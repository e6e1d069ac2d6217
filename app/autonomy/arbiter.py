"""Which of the 27 actions to take (paper III-E and III-F).

    u* = argmax_u  alpha f1(H) I(xi, T(x, u)) + beta f2(H) R_HO(x, u) + gamma D(u),
    f1(H) = max(H, 0.1),  f2 = 1 / f1,  D(u) = -||u - u_H||  (0 without user input).

One evaluation, in order: the person's action, if there is one, updates the belief; everything after it uses
that posterior. No action is no evidence. The paper lets the person always win; here that is a gamma too large
to be outbid (the default), and a finite gamma blends.

The three conditions differ only at the end: ``teleoperation`` takes the person's action or stays,
``goal_oriented`` is alpha = 0, ``balanced`` is the whole sum.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from app.autonomy.actions import (
    ACTION_COUNT,
    DIRECTIONS,
    NULL_ACTION,
    UNIT_DIRECTIONS,
    Direction,
    index_of,
    nearest_action,
)
from app.autonomy.arrays import (
    BoolArray,
    FloatArray,
    check_rationality,
    checked_goals_m,
    checked_momentum,
    checked_point_m,
    checked_probabilities,
    frozen,
)
from app.autonomy.belief import bayes_update, belief_entropy, log_softmax
from app.autonomy.errors import AutonomyError
from app.autonomy.hindsight import rewards_of_moves_m
from app.autonomy.information import information_gain_ahead
from app.autonomy.transition import TransitionModel

Condition = Literal["teleoperation", "goal_oriented", "balanced"]

RATIONALITY_PER_M = 5.0
"""kappa where nothing else is said. With the paper's eq. 2 as printed, 1.0 in metres, a belief over six goals hardly
moves in a whole pickup."""

TIE_TOLERANCE = 1e-12
"""Scores this close to the best are equal: the previous direction is kept, else the lowest index wins."""

_NEAREST_OTHER = float(np.sqrt(2.0 - 2.0 * np.sqrt(2.0 / 3.0)))
"""Distance between the two nearest of the 27 unit directions, an edge's and a corner's."""


@dataclass(frozen=True)
class ArbiterParameters:
    """Everything a decision depends on besides state, belief and input.

    Args:
        condition: ``teleoperation``, ``goal_oriented`` (alpha counts as 0) or ``balanced``.
        alpha: weight of information gain, in metres of R_HO; one a study, see ``calibration``.
        beta: weight of hindsight reward.
        gamma: weight of D. The default outbids everything as long as alpha is below about 6e5, since the
            nearest other action is 0.6 away from the person's.
        rationality_per_m: kappa of the user model, per metre, in [0, 1e6].
        transition: T(x, u).
        entropy_floor: below it f1 is constant, in (0, 1]; 0.1 in the paper.
        stickiness: bonus, in units of the score, for continuing the current direction. It acts on the choice
            when there is no input, and is not part of ``Evaluation.score``.

    Raises:
        AutonomyError: a value out of bounds.
    """

    condition: Condition
    alpha: float
    beta: float = 1.0
    gamma: float = 1e6
    rationality_per_m: float = RATIONALITY_PER_M
    transition: TransitionModel = field(default_factory=TransitionModel)
    entropy_floor: float = 0.1
    stickiness: float = 0.0

    def __post_init__(self) -> None:
        if self.condition not in get_args(Condition):
            raise AutonomyError(f"condition is {self.condition!r}; choose one of {', '.join(get_args(Condition))}")
        for name in ("alpha", "beta", "gamma", "stickiness"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise AutonomyError(f"{name} is {value!r}; it must be finite and >= 0")
        check_rationality(self.rationality_per_m)
        if not 0.0 < self.entropy_floor <= 1.0:
            raise AutonomyError(f"entropy_floor is {self.entropy_floor!r}; it must be in (0, 1]")


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What the arbiter thought in one tick. Arrays are read-only; (27,) follows ``actions.DIRECTIONS``.

    ``score`` is the formula above for all 27 actions, feasible or not, whatever the condition (in
    ``teleoperation`` it tells what the sum would have said); ``selection_bonus`` is the stickiness added to
    it for the choice; ``chosen`` is an index into ``DIRECTIONS``.
    """

    likelihood: FloatArray  # (27, G), P(u | phi, x)
    posterior: FloatArray  # (G,)
    entropy: float  # of the posterior, base |Phi|
    information_gain: FloatArray  # (27,), at T(x, u)
    hindsight_reward: FloatArray  # (27,), metres
    score: FloatArray  # (27,)
    selection_bonus: FloatArray  # (27,)
    chosen: int


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


class _Weighing:
    """One tick's decision, worked out as far as somebody asks: `evaluate` asks for everything, `choose` for what
    decides. Arguments and errors as for `evaluate`."""

    def __init__(
        self,
        position_m: npt.ArrayLike,
        momentum: npt.ArrayLike,
        goals_m: npt.ArrayLike,
        prior: npt.ArrayLike | None,
        user_action: Sequence[int] | None,
        parameters: ArbiterParameters,
    ) -> None:
        self.parameters = parameters
        self.user_index = None if user_action is None else index_of(user_action)
        self._given_position_m, self._momentum = position_m, momentum  # checked by whatever asks for them
        self._goals_m = checked_goals_m(goals_m)
        goal_count = self._goals_m.shape[0]
        self._prior: FloatArray
        if prior is None:
            self._prior = np.full(goal_count, 1.0 / goal_count)
        else:
            self._prior = checked_probabilities(prior, goal_count)

    @cached_property
    def _position_m(self) -> FloatArray:  # (3,)
        return checked_point_m("position_m", self._given_position_m)

    @cached_property
    def previous(self) -> int | None:
        """The action that continues the current direction; None at rest."""
        return nearest_action(self._momentum)

    @cached_property
    def _next_positions_m(self) -> FloatArray:  # (27, 3), T(x, u)
        next_positions_m: FloatArray = self._position_m + self.parameters.transition.displacements(self._momentum)
        return next_positions_m

    @cached_property
    def _rewards_m(self) -> FloatArray:  # (27, G), R_phi(x, u), eq. 1
        return rewards_of_moves_m(self._position_m, self._next_positions_m, self._goals_m)

    @cached_property
    def log_likelihoods(self) -> FloatArray:  # (27, G), eqs. 2-3
        return log_softmax(self.parameters.rationality_per_m * self._rewards_m, axis=0)

    @cached_property
    def posterior(self) -> FloatArray:  # (G,); no action is no evidence
        if self.user_index is None:
            unchanged: FloatArray = self._prior.copy()
            return unchanged
        return bayes_update(self._prior, self.log_likelihoods[self.user_index])

    @cached_property
    def entropy(self) -> float:
        return belief_entropy(self.posterior)

    @cached_property
    def information_gain(self) -> FloatArray:  # (27,), eq. 11 at T(x, u)
        model, rationality_per_m = self.parameters.transition, self.parameters.rationality_per_m
        return information_gain_ahead(self._next_positions_m, self._goals_m, self.posterior, model, rationality_per_m)

    @cached_property
    def hindsight_reward(self) -> FloatArray:  # (27,), R_HO(x, u), eq. 7, metres
        reward_m: FloatArray = self._rewards_m @ self.posterior
        return reward_m

    @cached_property
    def score(self) -> FloatArray:  # (27,), the whole sum; without a weight, information is not looked at
        f1, f2 = entropy_weights(self.entropy, self.parameters.entropy_floor)
        score = self.parameters.beta * f2 * self.hindsight_reward
        alpha = 0.0 if self.parameters.condition == "goal_oriented" else self.parameters.alpha
        if alpha > 0.0:
            score += alpha * f1 * self.information_gain
        if self.user_index is not None:
            score += self.parameters.gamma * disagreement(self.user_index)
        return score

    @cached_property
    def selection_bonus(self) -> FloatArray:  # (27,), the stickiness
        bonus = np.zeros(ACTION_COUNT)
        if self.previous is not None and self.user_index is None:
            bonus[self.previous] = self.parameters.stickiness
        return bonus

    def choice(self, feasible: Callable[[int], bool]) -> int:
        """u*, an index into ``DIRECTIONS``: the best action that can be done; the person's needs not to be.

        Nothing is weighed under ``teleoperation``, nor when the person's action cannot be outbid.
        """
        if self.parameters.condition == "teleoperation":
            return NULL_ACTION if self.user_index is None else self.user_index
        if self.user_index is not None and _cannot_be_outbid(self.parameters):
            return self.user_index
        values = self.score + self.selection_bonus
        while True:
            chosen = select(values, self.previous)
            nothing_left = values[chosen] == -np.inf
            if nothing_left or chosen == self.user_index or feasible(chosen):
                return chosen
            values[chosen] = -np.inf


def evaluate(
    position_m: npt.ArrayLike,
    momentum: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    prior: npt.ArrayLike | None,
    user_action: Sequence[int] | None,
    parameters: ArbiterParameters,
    feasible: npt.ArrayLike | None = None,
) -> Evaluation:
    """Update the belief by ``user_action`` and weigh all 27 actions with the posterior.

    Args:
        position_m: (3,), gripper in the world frame, metres.
        momentum: (3,), the direction executed in the last tick, length <= 1, 0 after any stop.
        goals_m: (G, 3), where the goals are now, world frame, metres.
        prior: b(phi) before this tick, (G,); None is uniform.
        user_action: the person's direction, each of -1, 0, 1; None is no input and no evidence.
        parameters: condition and coefficients.
        feasible: (27,), False for what the arm cannot do; such actions are chosen only if the person commands
            them. None: all can be done. With nothing left, the choice is to stay.

    Raises:
        AutonomyError: values that are not finite, of the wrong shape or out of bounds.
    """
    checked_momentum(momentum)  # one state, where a transition model would take many
    weighing = _Weighing(position_m, momentum, goals_m, prior, user_action, parameters)
    allowed = _allowed(feasible)
    return Evaluation(
        likelihood=frozen(np.exp(weighing.log_likelihoods)),
        posterior=frozen(weighing.posterior),
        entropy=weighing.entropy,
        information_gain=frozen(weighing.information_gain),
        hindsight_reward=frozen(weighing.hindsight_reward),
        score=frozen(weighing.score),
        selection_bonus=frozen(weighing.selection_bonus),
        chosen=weighing.choice(lambda index: bool(allowed[index])),
    )


@dataclass(frozen=True, eq=False)
class Choice:
    """What a tick needs of an evaluation: the belief after it (G,), read-only, and an index into ``DIRECTIONS``."""

    posterior: FloatArray
    chosen: int

    @property
    def direction(self) -> Direction:
        """The chosen action."""
        return DIRECTIONS[self.chosen]


def choose(
    position_m: npt.ArrayLike,
    momentum: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    prior: npt.ArrayLike | None,
    user_action: Sequence[int] | None,
    parameters: ArbiterParameters,
    feasible: Callable[[int], bool] | None = None,
) -> Choice:
    """Posterior and choice of ``evaluate``, bit for bit, without working out what they do not rest on.

    Args:
        feasible: whether the arm can do the action of that index; asked only for those that come first.
        others: as for ``evaluate``, errors too; what a choice does not rest on is not checked.
    """
    weighing = _Weighing(position_m, momentum, goals_m, prior, user_action, parameters)
    chosen = weighing.choice(feasible or (lambda index: True))
    return Choice(frozen(weighing.posterior), chosen)


def _cannot_be_outbid(parameters: ArbiterParameters) -> bool:
    """Whether gamma alone decides: a gain is at most 1, a reward at most a step either way."""
    most = parameters.alpha + parameters.beta / parameters.entropy_floor * 2.0 * parameters.transition.step_m
    return parameters.gamma * _NEAREST_OTHER > 2.0 * most + TIE_TOLERANCE


def select(values: FloatArray, previous: int | None) -> int:
    """The best of ``values`` (27,), -inf for what cannot be done: ties go to ``previous``, else to the lowest
    index; with nothing left, stay."""
    most = values.max()
    if most == -np.inf:
        return NULL_ACTION
    best = values >= most - TIE_TOLERANCE
    if previous is not None and best[previous]:
        return previous
    return int(best.argmax())


def _allowed(feasible: npt.ArrayLike | None) -> BoolArray:
    if feasible is None:
        return np.ones(ACTION_COUNT, dtype=np.bool_)
    allowed = np.array(feasible)
    if allowed.shape != (ACTION_COUNT,) or allowed.dtype != np.bool_:
        raise AutonomyError(f"feasible is {feasible!r}; it must be {ACTION_COUNT} booleans")
    return allowed
