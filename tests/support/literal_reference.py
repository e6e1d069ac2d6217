"""Eqs. 1-11 and the choice of an action as the paper writes them: plain Python, one loop a sum, every posterior formed.

Slow on purpose, and independent of ``app.autonomy``: it only reads the fields of the parameters it is given. Tests
compare the real arbiter with it, and ``make bench`` measures both in the same run.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

Vector = tuple[float, float, float]

RAW_ACTIONS = list(itertools.product((-1, 0, 1), repeat=3))
STAY = (0.0, 0.0, 0.0)


class LiteralEvaluation(NamedTuple):
    likelihood: list[list[float]]  # [27][G]
    posterior: list[float]
    entropy: float
    information_gain: list[float]
    hindsight_reward: list[float]
    score: list[float]
    chosen: int


class LiteralState(NamedTuple):
    position_m: Vector
    momentum: Vector


def unit(raw: Sequence[float]) -> Vector:
    length = math.sqrt(sum(component * component for component in raw))
    if length == 0.0:
        return STAY
    return (raw[0] / length, raw[1] / length, raw[2] / length)


ACTIONS = [unit(raw) for raw in RAW_ACTIONS]


@cache  # it is asked again for every action and goal
def continued_action(momentum: Vector) -> int | None:
    """The move at the smallest angle to the momentum, None at rest."""
    if math.sqrt(sum(component * component for component in momentum)) < 1e-9:
        return None
    best, best_cosine = None, -math.inf
    for index, action in enumerate(ACTIONS):
        cosine = sum(a * m for a, m in zip(action, momentum, strict=True))
        if action != STAY and cosine > best_cosine:
            best, best_cosine = index, cosine
    return best


def transition(state: LiteralState, index: int, model: Any) -> LiteralState:
    """T(x, u)."""
    action = ACTIONS[index]
    if model.kind == "mix":
        delay = model.planning_delay
        move = [model.step_m * (delay * m + (1 - delay) * u) for m, u in zip(state.momentum, action, strict=True)]
    else:
        share = 1.0 if continued_action(state.momentum) == index else 1 - model.planning_delay
        move = [model.step_m * share * u for u in action]
    moved = [p + d for p, d in zip(state.position_m, move, strict=True)]
    return LiteralState((moved[0], moved[1], moved[2]), action)


def reward(state: LiteralState, index: int, goal_m: Sequence[float], model: Any) -> float:
    """Eq. 1."""
    return math.dist(state.position_m, goal_m) - math.dist(transition(state, index, model).position_m, goal_m)


def likelihoods(state: LiteralState, goal_m: Sequence[float], model: Any, rationality_per_m: float) -> list[float]:
    """Eq. 3 for every action, given one goal."""
    rewards = [rationality_per_m * reward(state, index, goal_m, model) for index in range(27)]
    largest = max(rewards)
    weights = [math.exp(value - largest) for value in rewards]
    return [weight / sum(weights) for weight in weights]


def posterior_after(prior: Sequence[float], given_goal: Sequence[float]) -> list[float]:
    """Eqs. 5-6, one observation: ``given_goal`` is P(u | phi, x) for each goal."""
    joint = [p * b for p, b in zip(given_goal, prior, strict=True)]
    total = sum(joint)
    # An action no possible goal explains: never the person's, and weighted 0 in eq. 10.
    return [value / total for value in joint] if total > 0.0 else list(prior)


def entropy(belief: Sequence[float]) -> float:
    """Eq. 8."""
    if len(belief) == 1:
        return 0.0
    return -sum(b * math.log(b, len(belief)) for b in belief if b > 0.0)


def expected_gain(
    state: LiteralState, goals_m: Sequence[Sequence[float]], belief: Sequence[float], model: Any, kappa: float
) -> float:
    """Eqs. 9-11 at x' = ``state``."""
    table = [likelihoods(state, goal, model, kappa) for goal in goals_m]  # [G][27]
    expected = 0.0
    for index in range(27):
        given_goal = [row[index] for row in table]
        after = entropy(posterior_after(belief, given_goal))
        for probability, b in zip(given_goal, belief, strict=True):
            expected += probability * b * after
    return entropy(belief) - expected


def evaluate_literal(
    position_m: Sequence[float],
    momentum: Sequence[float],
    goals_m: Sequence[Sequence[float]],
    prior: Sequence[float] | None,
    user_action: Sequence[int] | None,
    parameters: Any,
    feasible: Sequence[bool] | None = None,
) -> LiteralEvaluation:
    """The arguments and meaning of ``tests.support.arbiter_cases.evaluate``."""
    state = LiteralState(
        (float(position_m[0]), float(position_m[1]), float(position_m[2])),
        (float(momentum[0]), float(momentum[1]), float(momentum[2])),
    )
    goals = [[float(component) for component in goal] for goal in goals_m]
    model, kappa = parameters.transition, parameters.rationality_per_m
    belief = [1.0 / len(goals)] * len(goals) if prior is None else [float(b) for b in prior]
    user_index = None if user_action is None else RAW_ACTIONS.index(tuple(user_action))

    by_goal = [likelihoods(state, goal, model, kappa) for goal in goals]
    likelihood = [[row[index] for row in by_goal] for index in range(27)]
    if user_index is not None:
        belief = posterior_after(belief, likelihood[user_index])
    h = entropy(belief)

    gains, rewards = [], []
    for index in range(27):
        gains.append(expected_gain(transition(state, index, model), goals, belief, model, kappa))
        rewards.append(sum(reward(state, index, goal, model) * b for goal, b in zip(goals, belief, strict=True)))

    f1 = h if h >= parameters.entropy_floor else parameters.entropy_floor
    f2 = 1 / f1
    alpha = 0.0 if parameters.condition == "goal_oriented" else parameters.alpha
    score = []
    for index in range(27):
        d = 0.0 if user_index is None else -math.dist(ACTIONS[index], ACTIONS[user_index])
        score.append(alpha * f1 * gains[index] + parameters.beta * f2 * rewards[index] + parameters.gamma * d)

    if parameters.condition == "teleoperation":
        chosen = 13 if user_index is None else user_index
    else:
        chosen = choose(score, continued_action(state.momentum), user_index, feasible, parameters.stickiness)
    return LiteralEvaluation(likelihood, belief, h, gains, rewards, score, chosen)


def choose(
    score: Sequence[float],
    previous: int | None,
    user_index: int | None,
    feasible: Sequence[bool] | None,
    stickiness: float,
) -> int:
    """argmax over what can be done, ties within 1e-12 to the previous direction, else to the lowest index."""
    value = {}
    for index in range(27):
        if feasible is None or feasible[index] or index == user_index:
            bonus = stickiness if index == previous and user_index is None else 0.0
            value[index] = score[index] + bonus
    if not value:
        return 13
    best = [index for index in value if value[index] >= max(value.values()) - 1e-12]
    return previous if previous in best else best[0]
