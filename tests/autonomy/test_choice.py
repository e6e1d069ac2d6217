"""What a tick asks of inference and arbiter is what `evaluate` says in one go, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from app.autonomy.actions import ACTION_COUNT, DIRECTIONS, NULL_ACTION, UNIT_DIRECTIONS, Direction, index_of
from app.autonomy.belief import Belief
from app.autonomy.evaluation import state_of
from app.autonomy.inference.boltzmann import Boltzmann
from app.autonomy.interface import Feasible
from tests.support.arbiter_cases import CONDITIONS, ArbiterCase, Condition, evaluate


def random_state(rng: np.random.Generator, goals: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    belief = rng.dirichlet(np.ones(goals))
    return rng.uniform(0.4, 1.0, 3), UNIT_DIRECTIONS[rng.integers(ACTION_COUNT)], rng.uniform(0, 1, (goals, 3)), belief


def fits(feasible: np.ndarray) -> Feasible:
    """Whether the arm can do the action of an index, asked one at a time."""
    return lambda action: bool(feasible[index_of(action)])


def choose(
    state: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    user: Direction | None,
    case: ArbiterCase,
    feasible: Feasible,
) -> tuple[np.ndarray, int]:
    """The posterior and the index of the action, asked as a tick asks for them."""
    position, momentum, goals, prior = state
    seen, arbiter = state_of(position, momentum, goals), case.arbiter
    belief = Boltzmann(Boltzmann.Parameters(), arbiter.models).update(seen, Belief(seen.goal_ids, prior), user)
    return belief.probabilities, index_of(arbiter.decide(seen, belief, user, feasible))


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("gamma", [0.0, 0.05, 1e6])
def test_it_chooses_and_believes_as_the_full_evaluation(condition: Condition, gamma: float) -> None:
    rng = np.random.default_rng(3)
    parameters = ArbiterCase(condition, alpha=400.0, gamma=gamma, stickiness=0.003)
    for _ in range(40):
        position, momentum, goals, belief = random_state(rng, int(rng.integers(1, 7)))
        user = None if rng.random() < 0.5 else DIRECTIONS[rng.integers(ACTION_COUNT)]
        feasible = rng.random(ACTION_COUNT) < 0.5
        full = evaluate(position, momentum, goals, belief, user, parameters, feasible)
        posterior, chosen = choose((position, momentum, goals, belief), user, parameters, fits(feasible))
        assert chosen == full.chosen
        np.testing.assert_array_equal(posterior, full.posterior)


def test_with_nothing_feasible_it_stays() -> None:
    state = random_state(np.random.default_rng(5), 4)
    assert choose(state, None, ArbiterCase("balanced", alpha=400.0), lambda action: False)[1] == NULL_ACTION


def test_feasibility_is_asked_only_as_far_as_needed() -> None:
    asked: list[Direction] = []

    def feasible(action: Direction) -> bool:
        asked.append(action)
        return len(asked) == 2

    _, chosen = choose(random_state(np.random.default_rng(6), 4), None, ArbiterCase("goal_oriented", 0.0), feasible)
    assert asked == list(dict.fromkeys(asked)) and len(asked) == 2
    assert DIRECTIONS[chosen] == asked[1]
