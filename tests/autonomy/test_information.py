from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from app.autonomy.actions import UNIT_DIRECTIONS, index_of
from app.autonomy.belief import belief_entropy
from app.autonomy.errors import AutonomyError
from app.autonomy.hindsight import hindsight_reward, hindsight_reward_at
from app.autonomy.information import expected_information_gain, information_gain_at
from app.autonomy.transition import TransitionModel
from tests.support.autonomy_cases import goals_and_beliefs, momenta, points_m, rationalities, without_deadline
from tests.support.autonomy_cases import models as transition_models

ORIGIN = (0.0, 0.0, 0.0)
AT_REST = (0.0, 0.0, 0.0)
LEFT_AND_RIGHT = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
EVEN = np.array([0.5, 0.5])


def two_way_entropy(p: float) -> float:
    return -(p * math.log2(p) + (1.0 - p) * math.log2(1.0 - p))


def test_hindsight_reward_worked_by_hand() -> None:
    # 0.75 * (1 - 0.9) + 0.25 * (1 - 1.1) = 0.05
    model = TransitionModel("mix", step_m=0.1, planning_delay=0.0)
    rewards = hindsight_reward(ORIGIN, AT_REST, LEFT_AND_RIGHT, [0.75, 0.25], model)
    assert rewards[index_of((1, 0, 0))] == pytest.approx(0.05, abs=1e-15)
    assert rewards[index_of((-1, 0, 0))] == pytest.approx(-0.05, abs=1e-15)
    assert rewards[index_of((0, 0, 0))] == 0.0
    # aside: 1 - sqrt(1.01) for both goals
    assert rewards[index_of((0, 1, 0))] == pytest.approx(1.0 - math.sqrt(1.01), abs=1e-15)


def test_information_gain_worked_by_hand() -> None:
    # A model in which only continuing moves (all of any other step goes to planning), so that from x' = (p, u) one
    # action counts and 26 leave the arm where it is. With kappa * step = ln 2 and x' = (origin, +x):
    #   P(+x|A) = 2 / 28 = 1/14, any other 1/28;   P(+x|B) = (1/2) / 26.5 = 1/53, any other 2/53.
    # Even odds: p(+x) = (1/14 + 1/53) / 2 = 67/1484 and leaves b(A) = (1/14) / (1/14 + 1/53) = 53/67;
    # each other: p = (1/28 + 2/53) / 2 = 109/2968 and leaves b(A) = (1/28) / (1/28 + 2/53) = 53/109.
    model = TransitionModel("replan", step_m=0.1, planning_delay=1.0)
    gains = expected_information_gain(ORIGIN, AT_REST, LEFT_AND_RIGHT, EVEN, model, math.log(2.0) / 0.1)
    expected = 1.0 - 67 / 1484 * two_way_entropy(53 / 67) - 26 * 109 / 2968 * two_way_entropy(53 / 109)
    assert gains[index_of((1, 0, 0))] == pytest.approx(expected, abs=1e-14)
    assert gains[index_of((-1, 0, 0))] == pytest.approx(expected, abs=1e-14)
    # Aside, continuing brings both goals nearer by the same amount: nothing to learn.
    assert gains[index_of((0, 1, 0))] == 0.0
    # At rest nothing moves at all.
    assert gains[index_of((0, 0, 0))] == 0.0


def test_a_wholly_rational_person_tells_everything() -> None:
    gains = expected_information_gain(ORIGIN, AT_REST, LEFT_AND_RIGHT, [0.3, 0.7], TransitionModel(), 1e5)
    np.testing.assert_allclose(gains, two_way_entropy(0.3), atol=1e-12)


def test_a_random_person_tells_nothing() -> None:
    assert not expected_information_gain(ORIGIN, AT_REST, LEFT_AND_RIGHT, EVEN, TransitionModel(), 0.0).any()


@settings(without_deadline, max_examples=150)
@given(points_m, momenta, goals_and_beliefs(), transition_models, rationalities)
def test_gain_is_never_negative_nor_more_than_there_is_to_know(
    position: Any, momentum: Any, goals_belief: Any, model: TransitionModel, kappa: float
) -> None:
    goals, belief = goals_belief
    gains = expected_information_gain(position, momentum, goals, belief, model, kappa)
    assert gains.shape == (27,)
    assert (gains >= 0.0).all()
    assert (gains <= belief_entropy(belief)).all()


@without_deadline
@given(points_m, momenta, transition_models, rationalities)
def test_one_goal_leaves_nothing_to_learn(position: Any, momentum: Any, model: Any, kappa: float) -> None:
    assert not expected_information_gain(position, momentum, [[0.3, 0.2, 0.1]], [1.0], model, kappa).any()


@without_deadline
@given(points_m, momenta, points_m, transition_models, rationalities)
def test_coincident_goals_leave_nothing_to_learn(
    position: Any, momentum: Any, goal: Any, model: Any, kappa: float
) -> None:
    gains = expected_information_gain(position, momentum, [goal, goal], [0.4, 0.6], model, kappa)
    np.testing.assert_allclose(gains, 0.0, atol=1e-15)


@without_deadline
@given(points_m, momenta, goals_and_beliefs(2), transition_models, rationalities)
def test_neither_value_depends_on_the_order_of_goals(
    position: Any, momentum: Any, goals_belief: Any, model: TransitionModel, kappa: float
) -> None:
    goals, belief = goals_belief
    np.testing.assert_allclose(
        expected_information_gain(position, momentum, goals, belief, model, kappa),
        expected_information_gain(position, momentum, goals[::-1], belief[::-1], model, kappa),
        atol=1e-13,
    )
    np.testing.assert_allclose(
        hindsight_reward(position, momentum, goals, belief, model),
        hindsight_reward(position, momentum, goals[::-1], belief[::-1], model),
        atol=1e-13,
    )


def test_mirrored_actions_gain_the_same_to_far_below_the_tie_tolerance() -> None:
    # The largest alpha a study is likely to have is about 1e4: it must not turn rounding into preference.
    goals = np.array([[0.3, 0.2, 0.0], [0.3, -0.2, 0.0], [0.5, 0.1, 0.0], [0.5, -0.1, 0.0]])
    gains = expected_information_gain(ORIGIN, AT_REST, goals, [0.3, 0.3, 0.2, 0.2], TransitionModel(), 1.0)
    for x in (-1, 0, 1):
        assert gains[index_of((x, 1, 0))] == pytest.approx(gains[index_of((x, -1, 0))], abs=5e-17)


@pytest.mark.parametrize("kind", ["mix", "replan"])
def test_the_map_agrees_with_the_actions(kind: Any) -> None:
    # What an action gains is what the map says about where it leads, with the momentum it leaves.
    rng = np.random.default_rng(5)
    goals, belief, model = rng.uniform(-1, 1, (5, 3)), rng.dirichlet(np.ones(5)), TransitionModel(kind)
    position, momentum = (0.1, 0.2, 0.3), (0.0, 0.0, 1.0)
    gains = expected_information_gain(position, momentum, goals, belief, model, 5.0)
    rewards = hindsight_reward(position, momentum, goals, belief, model)
    for index, place in enumerate(model.next_positions(position, momentum)):
        gain = information_gain_at([place], UNIT_DIRECTIONS[index], goals, belief, model, 5.0)
        assert gain == pytest.approx([gains[index]], abs=1e-15)
        reward = hindsight_reward_at([place], position, goals, belief)
        assert reward == pytest.approx([rewards[index]], abs=1e-15)


def test_a_large_map_is_one_value_a_place() -> None:
    places = np.random.default_rng(2).uniform(-1, 1, (5000, 3))
    gains = information_gain_at(places, AT_REST, LEFT_AND_RIGHT, EVEN, TransitionModel(), 5.0)
    rewards = hindsight_reward_at(places, ORIGIN, LEFT_AND_RIGHT, EVEN)
    assert gains.shape == rewards.shape == (5000,)
    alone = information_gain_at(places[4321:4322], AT_REST, LEFT_AND_RIGHT, EVEN, TransitionModel(), 5.0)
    assert gains[4321] == pytest.approx(alone[0], abs=1e-15)


def test_a_belief_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(AutonomyError, match="belief has shape"):
        expected_information_gain(ORIGIN, AT_REST, LEFT_AND_RIGHT, [1.0], TransitionModel(), 5.0)
    with pytest.raises(AutonomyError, match="belief has shape"):
        hindsight_reward(ORIGIN, AT_REST, LEFT_AND_RIGHT, [0.2, 0.2, 0.6], TransitionModel())
