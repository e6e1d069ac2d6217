"""Rough information is as near as it says, and chooses what the exact values choose."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from app.autonomy.actions import DIRECTIONS, UNIT_DIRECTIONS, Direction, index_of
from app.autonomy.arbiters.balanced import Balanced
from app.autonomy.arbiters.weighing import Weighing, WeightsOfInformation, select
from app.autonomy.belief import Belief
from app.autonomy.evaluation import state_of
from app.autonomy.interface import Models, State
from app.autonomy.looking import Looking, Place
from app.autonomy.rough_gains import rough_gains
from app.autonomy.transition import TransitionModel

SCENES = 1_500


def scenes(seed: int) -> Iterator[tuple[Balanced, State, Belief, Direction | None, np.ndarray]]:
    """Arbiters of many kinds in many places: beside a goal, between goals that mirror each other, anywhere."""
    rng = np.random.default_rng(seed)
    for number in range(SCENES):
        goal_count = int(rng.choice([2, 3, 6, 6, 90]))
        model = TransitionModel(
            "mix" if rng.random() < 0.5 else "replan", float(rng.choice([0.02, 0.05])), float(rng.choice([0.2, 0.8]))
        )
        place: Place = ("next", "ahead", "at_rest")[int(rng.integers(3))]
        gamma, stickiness = float(rng.choice([1e6, 0.02])), float(rng.choice([0.0, 0.003]))
        alpha = float(rng.choice([0.5, 60.0, 5000.0]))
        arbiter = Balanced(
            WeightsOfInformation(alpha, 1.0, gamma, 0.1, stickiness, place),
            Models(float(rng.choice([1.0, 6.05, 200.0])), model),
        )
        goals_m = rng.uniform((0.75, -0.42, 0.83), (0.85, 0.42, 0.90), (goal_count, 3))
        place_m = rng.uniform((0.65, -0.35, 0.83), (0.9, 0.35, 0.93))
        belief = rng.dirichlet(np.full(goal_count, 0.5))
        if number % 3 == 0:  # ties
            goals_m = np.column_stack(
                (np.full(goal_count, 0.8), np.linspace(-0.3, 0.3, goal_count), np.full(goal_count, 0.85))
            )
            place_m[1], belief = 0.0, np.full(goal_count, 1.0 / goal_count)
        elif number % 5 == 0:
            place_m = goals_m[0] + rng.uniform(-0.02, 0.02, 3) * (number % 2)
        momentum = UNIT_DIRECTIONS[rng.integers(27)] * float(rng.random() < 0.7)
        state = state_of(place_m, momentum, goals_m)
        user = None if number % 4 else DIRECTIONS[rng.integers(27)]
        yield arbiter, state, Belief(state.goal_ids, belief), user, rng.random(27) < 0.6


def exactly_best(terms: Weighing, user: Direction | None, can: np.ndarray) -> int:
    values = terms.score + terms.selection_bonus
    asked = None if user is None else index_of(user)
    for index in np.flatnonzero(~can).tolist():
        if index != asked:
            values[index] = -np.inf
    return select(values.tolist(), terms.previous)


def test_the_choice_is_that_of_the_exact_values() -> None:
    certain = 0
    for arbiter, state, belief, user, can in scenes(1):
        terms = arbiter.weighing(state, belief, user)

        def feasible(action: Direction, can: np.ndarray = can) -> bool:
            return bool(can[index_of(action)])

        chosen = arbiter.weighing(state, belief, user).best(feasible)
        assert chosen == exactly_best(terms, user, can)
        certain += arbiter.weighing(state, belief, user)._certainly_best(feasible, []) is not None
    assert certain > 0.7 * SCENES


def test_no_value_is_off_by_more_than_it_says() -> None:
    for arbiter, state, belief, _, _ in scenes(2):
        rough = rough_gains(state, belief.probabilities, arbiter.models, arbiter.parameters.looking)
        if rough is not None:
            exact = arbiter.weighing(state, belief, None).information_gain
            found = np.clip(rough.gains, 0.0, belief.entropy)
            assert np.abs(found - exact).max() <= rough.error


@pytest.mark.parametrize(
    ("goals_m", "kappa", "looking"),
    [
        ([[0.8, 0.0, 0.85]], 5.0, Looking()),
        ([[0.8, 0.0, 0.85], [0.8, 0.2, 0.85]], 5.0, Looking("averaged")),
        ([[0.8, 0.0, 0.85], [0.8, 0.2, 0.85]], 1e6, Looking()),
        ([[0.7, 0.0, 0.85], [0.8, 0.2, 0.85]], 5.0, Looking()),
    ],
    ids=["one goal", "averaged", "a very rational person", "next to a goal"],
)
def test_where_it_is_no_way_to_tell_it_tells_nothing(
    goals_m: list[list[float]], kappa: float, looking: Looking
) -> None:
    state = state_of((0.7, 0.0, 0.85), (0.0, 0.0, 0.0), goals_m)
    belief = Belief.uniform(state.goal_ids)
    assert rough_gains(state, belief.probabilities, Models(kappa, TransitionModel()), looking) is None
