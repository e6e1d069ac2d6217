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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
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
PresetName = Literal["paper", "lab"]

TIE_TOLERANCE = 1e-12
"""Scores this close to the best are equal: the previous direction is kept, else the lowest index wins."""

_NEAREST_OTHER = float(np.sqrt(2.0 - 2.0 * np.sqrt(2.0 / 3.0)))
"""Distance between the two nearest of the 27 unit directions, an edge's and a corner's."""


@dataclass(frozen=True)
class Preset:
    """The coefficients the paper leaves open."""

    rationality_per_m: float
    stickiness: float


PRESETS: Mapping[PresetName, Preset] = MappingProxyType(
    {
        # The paper's eq. 2 as printed, in metres.
        "paper": Preset(rationality_per_m=1.0, stickiness=0.0),
        # With 1.0 a belief over six goals hardly moves in a whole pickup; the stickiness stops dithering.
        "lab": Preset(rationality_per_m=5.0, stickiness=0.003),
    }
)


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
    rationality_per_m: float = PRESETS["lab"].rationality_per_m
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

    @classmethod
    def from_preset(
        cls,
        name: PresetName,
        condition: Condition,
        alpha: float,
        transition: TransitionModel | None = None,
    ) -> ArbiterParameters:
        """Parameters with a preset's coefficients; ``transition`` defaults to ``TransitionModel()``.

        Raises:
            AutonomyError: an unknown preset, or a value out of bounds.
        """
        if name not in PRESETS:
            raise AutonomyError(f"preset is {name!r}; choose one of {', '.join(PRESETS)}")
        preset = PRESETS[name]
        return cls(
            condition,
            alpha,
            rationality_per_m=preset.rationality_per_m,
            transition=transition if transition is not None else TransitionModel(),
            stickiness=preset.stickiness,
        )


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


@dataclass(frozen=True, eq=False)
class Decision:
    """The action to execute in this tick, and why."""

    action_index: int
    direction: Direction
    evaluation: Evaluation


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
    position = checked_point_m("position_m", position_m)
    moving = checked_momentum(momentum)
    goals = checked_goals_m(goals_m)
    goal_count = goals.shape[0]
    belief = np.full(goal_count, 1.0 / goal_count) if prior is None else checked_probabilities(prior, goal_count)
    user_index = None if user_action is None else index_of(user_action)
    allowed = _allowed(feasible, user_index)
    model, rationality_per_m = parameters.transition, parameters.rationality_per_m

    next_positions_m = position + model.displacements(moving)  # (27, 3)
    rewards_m = rewards_of_moves_m(position, next_positions_m, goals)  # R_phi(x, u), eq. 1: (27, G)
    log_likelihoods = log_softmax(rationality_per_m * rewards_m, axis=0)
    posterior = belief.copy() if user_index is None else bayes_update(belief, log_likelihoods[user_index])
    entropy = belief_entropy(posterior)

    information_gain = information_gain_ahead(next_positions_m, goals, posterior, model, rationality_per_m)
    hindsight_reward = rewards_m @ posterior  # R_HO(x, u), eq. 7
    score = _score(hindsight_reward, information_gain, entropy, user_index, parameters)
    previous = nearest_action(moving)
    selection_bonus = np.zeros(ACTION_COUNT)
    if previous is not None and user_index is None:
        selection_bonus[previous] = parameters.stickiness
    if parameters.condition == "teleoperation":
        chosen = NULL_ACTION if user_index is None else user_index
    else:
        chosen = select(np.where(allowed, score + selection_bonus, -np.inf), previous)
    return Evaluation(
        likelihood=frozen(np.exp(log_likelihoods)),
        posterior=frozen(posterior),
        entropy=entropy,
        information_gain=frozen(information_gain),
        hindsight_reward=frozen(hindsight_reward),
        score=frozen(score),
        selection_bonus=frozen(selection_bonus),
        chosen=chosen,
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

    Nothing is weighed under ``teleoperation``, nor when gamma is so large that the person's action cannot be outbid;
    without a weight, information is not looked at; nothing is learned from no action.

    Args:
        feasible: whether the arm can do the action of that index; asked only for those that come first.
        others: as for ``evaluate``, errors too.
    """
    user_index = None if user_action is None else index_of(user_action)
    goals = checked_goals_m(goals_m)
    goal_count = goals.shape[0]
    belief = np.full(goal_count, 1.0 / goal_count) if prior is None else checked_probabilities(prior, goal_count)
    if parameters.condition == "teleoperation" and user_index is None:
        return Choice(frozen(belief.copy()), NULL_ACTION)
    model, rationality_per_m = parameters.transition, parameters.rationality_per_m
    position = checked_point_m("position_m", position_m)
    next_positions_m = position + model.displacements(momentum)
    rewards_m = rewards_of_moves_m(position, next_positions_m, goals)
    if user_index is not None:
        belief = bayes_update(belief, log_softmax(rationality_per_m * rewards_m, axis=0)[user_index])
        if parameters.condition == "teleoperation" or _cannot_be_outbid(parameters):
            return Choice(frozen(belief), user_index)
    information_gain = None
    if _information_weight(parameters) > 0.0:
        information_gain = information_gain_ahead(next_positions_m, goals, belief, model, rationality_per_m)
    values = _score(rewards_m @ belief, information_gain, belief_entropy(belief), user_index, parameters)
    previous = nearest_action(momentum)
    if previous is not None and user_index is None:
        values[previous] += parameters.stickiness
    while True:
        chosen = select(values, previous)
        nothing_left = values[chosen] == -np.inf
        if nothing_left or chosen == user_index or feasible is None or feasible(chosen):
            return Choice(frozen(belief.copy()), chosen)
        values[chosen] = -np.inf


def _information_weight(parameters: ArbiterParameters) -> float:
    """alpha, which ``goal_oriented`` takes for 0."""
    return 0.0 if parameters.condition == "goal_oriented" else parameters.alpha


def _score(
    hindsight_reward: FloatArray,
    information_gain: FloatArray | None,
    entropy: float,
    user_index: int | None,
    parameters: ArbiterParameters,
) -> FloatArray:
    """The whole sum for all 27 actions; information is not looked at when it has no weight."""
    f1, f2 = entropy_weights(entropy, parameters.entropy_floor)
    score = parameters.beta * f2 * hindsight_reward
    alpha = _information_weight(parameters)
    if alpha > 0.0 and information_gain is not None:
        score += alpha * f1 * information_gain
    if user_index is not None:
        score += parameters.gamma * disagreement(user_index)
    return score


def _cannot_be_outbid(parameters: ArbiterParameters) -> bool:
    """Whether gamma alone decides: a gain is at most 1, a reward at most a step either way."""
    most = parameters.alpha + parameters.beta / parameters.entropy_floor * 2.0 * parameters.transition.step_m
    return parameters.gamma * _NEAREST_OTHER > 2.0 * most + TIE_TOLERANCE


def decide(
    position_m: npt.ArrayLike,
    momentum: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    prior: npt.ArrayLike | None,
    user_action: Sequence[int] | None,
    parameters: ArbiterParameters,
    feasible: npt.ArrayLike | None = None,
) -> Decision:
    """One tick's decision; arguments and errors as for ``evaluate``. Keeps nothing: the caller carries
    ``decision.evaluation.posterior`` into the next tick as its prior."""
    evaluation = evaluate(position_m, momentum, goals_m, prior, user_action, parameters, feasible)
    return Decision(evaluation.chosen, DIRECTIONS[evaluation.chosen], evaluation)


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


def _allowed(feasible: npt.ArrayLike | None, user_index: int | None) -> BoolArray:
    if feasible is None:
        return np.ones(ACTION_COUNT, dtype=np.bool_)
    allowed = np.array(feasible)
    if allowed.shape != (ACTION_COUNT,) or allowed.dtype != np.bool_:
        raise AutonomyError(f"feasible is {feasible!r}; it must be {ACTION_COUNT} booleans")
    if user_index is not None:
        allowed[user_index] = True
    return allowed
