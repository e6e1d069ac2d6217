"""Where information is looked at, against the sum over posteriors as eqs. 9 to 11 write it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from app.autonomy.actions import NULL_ACTION
from app.autonomy.arbiters.balanced import Balanced
from app.autonomy.arbiters.weighing import WeightsOfInformation
from app.autonomy.belief import Belief
from app.autonomy.errors import AutonomyError
from app.autonomy.evaluation import state_of
from app.autonomy.interface import Models
from app.autonomy.looking import Looking, look
from app.autonomy.transition import TransitionModel
from tests.support.literal_reference import (
    ACTIONS,
    STAY,
    LiteralState,
    expected_gain,
    likelihoods,
    transition,
)

KAPPA = 6.0


def literal(place: str, ahead_m: float, state: LiteralState, goals: Any, belief: Any, model: Any, index: int) -> float:
    """As the module's text has it, one loop a sum."""
    then = transition(state, index, model)
    if place == "next" or (place == "ahead" and index == NULL_ACTION):
        return expected_gain(then, goals, belief, model, KAPPA)
    if place == "ahead":
        x, y, z = (p + ahead_m * u for p, u in zip(state.position_m, ACTIONS[index], strict=True))
        return expected_gain(LiteralState((x, y, z), ACTIONS[index]), goals, belief, model, KAPPA)
    rest = LiteralState(then.position_m, STAY)
    if place == "at_rest":
        return expected_gain(rest, goals, belief, model, KAPPA)
    table = [likelihoods(rest, goal, model, KAPPA) for goal in goals]
    total = 0.0
    for v in range(27):
        probability = sum(row[v] * b for row, b in zip(table, belief, strict=True))
        total += probability * expected_gain(LiteralState(rest.position_m, ACTIONS[v]), goals, belief, model, KAPPA)
    return total


@pytest.mark.parametrize("kind", ["mix", "replan"])
@pytest.mark.parametrize("place", ["next", "ahead", "at_rest", "averaged"])
def test_each_way_of_looking_is_its_sum_over_posteriors(place: Any, kind: Any) -> None:
    rng = np.random.default_rng(7)
    for goals in (2, 3):
        model = TransitionModel(kind, 0.05, 0.6)
        position_m, goals_m = rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.5, 0.5, (goals, 3))
        momentum, belief = np.array(ACTIONS[int(rng.integers(27))]), rng.dirichlet(np.ones(goals))
        found = look(Looking(place, 0.17), position_m, momentum, goals_m, belief, model, KAPPA)
        x, y, z = position_m.tolist()
        state = LiteralState((x, y, z), ACTIONS[[tuple(a) for a in ACTIONS].index(tuple(momentum.tolist()))])
        for index in rng.choice(27, 4, replace=False).tolist() + [NULL_ACTION]:
            expected = literal(place, 0.17, state, goals_m.tolist(), belief.tolist(), model, index)
            assert found[index] == pytest.approx(expected, abs=1e-12)


def test_at_rest_the_momentum_counts_for_nothing() -> None:
    # Straight on and back again lead to places as far from both goals; only the momentum tells them apart.
    goals_m = np.array([[0.3, 0.0, 0.0], [-0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, -0.3, 0.0]])
    belief, model = np.full(4, 0.25), TransitionModel("replan", 0.03, 0.8)
    spread = {
        place: float(np.ptp(look(Looking(place), np.zeros(3), np.zeros(3), goals_m, belief, model, KAPPA)))
        for place in ("next", "at_rest", "averaged", "ahead")
    }
    assert spread["at_rest"] < spread["next"] / 20.0
    assert spread["averaged"] < spread["next"] / 20.0
    assert spread["ahead"] > spread["next"]


@pytest.mark.parametrize("place", ["next", "ahead", "at_rest", "averaged"])
def test_an_arbiter_weighs_what_it_looks_at(place: Any) -> None:
    model = Models(KAPPA, TransitionModel("replan", 0.03, 0.8))
    arbiter = Balanced(WeightsOfInformation(alpha=300.0, information=place), model)
    state = state_of((0.7, 0.1, 0.9), (0.0, 1.0, 0.0), [[0.8, 0.3, 0.9], [0.8, -0.2, 0.9], [0.9, 0.0, 0.85]])
    terms = arbiter.weighing(state, Belief(state.goal_ids, np.array([0.5, 0.3, 0.2])), None)
    given = np.array(state.position_m), np.array(state.momentum), state.goals_m, np.array([0.5, 0.3, 0.2])
    np.testing.assert_allclose(
        terms.information_gain, look(Looking(place), *given, model.transition, KAPPA), rtol=0, atol=1e-15
    )


def test_values_out_of_bounds_are_told_with_their_bound() -> None:
    for wrong in (0.0, -0.1, 1.01, float("nan")):
        with pytest.raises(AutonomyError, match=r"look_ahead_m is .*; it must be in \(0, 1\] metres"):
            WeightsOfInformation(1.0, look_ahead_m=wrong)
    with pytest.raises(AutonomyError, match="choose one of next, ahead, at_rest, averaged"):
        WeightsOfInformation(1.0, information="there")  # type: ignore[arg-type]
