"""`choose` is `evaluate` without the parts a tick does not need: same belief, same action, bit for bit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.autonomy.actions import ACTION_COUNT, DIRECTIONS, NULL_ACTION, UNIT_DIRECTIONS
from app.autonomy.arbiter import ArbiterParameters, Condition, choose, evaluate

CONDITIONS: tuple[Condition, ...] = ("teleoperation", "goal_oriented", "balanced")


def random_state(rng: np.random.Generator, goals: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    belief = rng.dirichlet(np.ones(goals))
    return rng.uniform(0.4, 1.0, 3), UNIT_DIRECTIONS[rng.integers(ACTION_COUNT)], rng.uniform(0, 1, (goals, 3)), belief


def fits(feasible: np.ndarray) -> Callable[[int], bool]:
    """Whether the arm can do the action of an index, asked one at a time."""
    return lambda index: bool(feasible[index])


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("gamma", [0.0, 0.05, 1e6])
def test_it_chooses_and_believes_as_the_full_evaluation(condition: Condition, gamma: float) -> None:
    rng = np.random.default_rng(3)
    parameters = ArbiterParameters(condition, alpha=400.0, gamma=gamma, stickiness=0.003)
    for _ in range(40):
        position, momentum, goals, belief = random_state(rng, int(rng.integers(1, 7)))
        user = None if rng.random() < 0.5 else DIRECTIONS[rng.integers(ACTION_COUNT)]
        feasible = rng.random(ACTION_COUNT) < 0.5
        full = evaluate(position, momentum, goals, belief, user, parameters, feasible)
        choice = choose(position, momentum, goals, belief, user, parameters, fits(feasible))
        assert choice.chosen == full.chosen
        np.testing.assert_array_equal(choice.posterior, full.posterior)


def test_with_nothing_feasible_it_stays() -> None:
    position, momentum, goals, belief = random_state(np.random.default_rng(5), 4)
    parameters = ArbiterParameters("balanced", alpha=400.0)
    assert choose(position, momentum, goals, belief, None, parameters, lambda index: False).chosen == NULL_ACTION


def test_feasibility_is_asked_only_as_far_as_needed() -> None:
    position, momentum, goals, belief = random_state(np.random.default_rng(6), 4)
    asked: list[int] = []

    def feasible(index: int) -> bool:
        asked.append(index)
        return len(asked) == 2

    choice = choose(position, momentum, goals, belief, None, ArbiterParameters("goal_oriented", 0.0), feasible)
    assert asked == list(dict.fromkeys(asked)) and len(asked) == 2
    assert choice.chosen == asked[1]
