from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from app.autonomy.belief import belief_entropy
from app.autonomy.calibration import CROSSING_SAMPLES, beliefs_of_entropy, calibrate_alpha
from app.autonomy.errors import AutonomyError
from app.autonomy.transition import TransitionModel
from tests.support.arbiter_cases import ArbiterCase, evaluate

OBJECTS = np.array(
    [[0.80, -0.40, 0.85], [0.78, -0.20, 0.84], [0.82, 0.0, 0.86], [0.79, 0.2, 0.85], [0.81, 0.4, 0.84], [0.8, 0.3, 0.9]]
)
BINS = np.array([[0.62, 0.5, 0.9], [0.62, -0.5, 0.9]])
WORKSPACE = [[0.65, -0.375, 0.83], [0.925, 0.375, 0.93]]
MODEL = TransitionModel()


def test_sampled_beliefs_have_the_wanted_entropy() -> None:
    rng = np.random.default_rng(3)
    for goal_count in (2, 3, 6):
        wanted = rng.uniform(0.01, 0.99, 40)
        beliefs = beliefs_of_entropy(rng, goal_count, wanted)
        np.testing.assert_allclose([belief_entropy(belief) for belief in beliefs], wanted, atol=1e-6)


@pytest.mark.parametrize("kind", ["mix", "replan"])
def test_alpha_makes_information_lead_when_unsure_and_goals_when_sure(kind: Any) -> None:
    result = calibrate_alpha([OBJECTS, BINS], WORKSPACE, TransitionModel(kind), 5.0, seed=1)
    assert result.ratio_quartiles[0] < result.alpha < result.ratio_quartiles[1]
    assert result.shares.information_above_0_7 > 0.8
    assert result.shares.goals_below_0_3 > 0.8
    assert result.samples == CROSSING_SAMPLES


def test_alpha_splits_the_states_at_half_entropy_in_two() -> None:
    # Checked from outside: another sample, through `evaluate` and the ranges of its weighted terms.
    alpha = calibrate_alpha([OBJECTS], WORKSPACE, MODEL, 5.0, seed=1).alpha
    rng = np.random.default_rng(77)
    beliefs = beliefs_of_entropy(rng, 6, rng.uniform(0.47, 0.53, 300))
    low_m, high_m = WORKSPACE
    led_by_information = 0
    for belief in beliefs:
        position = rng.uniform(low_m, high_m)
        result = evaluate(position, (0.0, 0.0, 0.0), OBJECTS, belief, None, ArbiterCase("balanced", alpha))
        information = alpha * result.entropy * np.ptp(result.information_gain)
        led_by_information += bool(information > np.ptp(result.hindsight_reward) / result.entropy)
    # Binomial(300, about 1/2) has a standard deviation of 0.03; starting at rest moves the share somewhat.
    assert 0.35 < led_by_information / 300 < 0.65


def test_the_same_seed_gives_the_same_alpha() -> None:
    first = calibrate_alpha([OBJECTS, BINS], WORKSPACE, MODEL, 5.0, seed=4)
    assert calibrate_alpha([OBJECTS, BINS], WORKSPACE, MODEL, 5.0, seed=4) == first
    assert calibrate_alpha([OBJECTS, BINS], WORKSPACE, MODEL, 5.0, seed=5).alpha != first.alpha


def test_alpha_falls_with_the_square_of_rationality() -> None:
    # Small kappa * step: I grows with kappa squared, R_HO not at all.
    one = calibrate_alpha([OBJECTS], WORKSPACE, MODEL, 0.5, seed=1).alpha
    double = calibrate_alpha([OBJECTS], WORKSPACE, MODEL, 1.0, seed=1).alpha
    assert one / double == pytest.approx(4.0, rel=0.01)


def test_single_goals_and_coincident_goals_tell_nothing() -> None:
    alone = OBJECTS[:1]
    with_others = calibrate_alpha([alone, OBJECTS], WORKSPACE, MODEL, 5.0, seed=1)
    assert with_others == calibrate_alpha([OBJECTS], WORKSPACE, MODEL, 5.0, seed=1)
    with pytest.raises(AutonomyError, match="two goals or more"):
        calibrate_alpha([alone], WORKSPACE, MODEL, 5.0, seed=1)
    with pytest.raises(AutonomyError, match="differ in position"):
        calibrate_alpha([np.vstack([alone, alone])], WORKSPACE, MODEL, 5.0, seed=1)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"workspace_bounds_m": [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]}, "lower and an upper corner"),
        ({"workspace_bounds_m": [0.0, 1.0, 2.0]}, "lower and an upper corner"),
        ({"target_entropy": 0.99}, r"target_entropy is 0\.99"),
        ({"rationality_per_m": 0.0}, r"rationality_per_m is 0\.0"),
        ({"goal_sets": []}, "holds 0 sets"),
    ],
)
def test_bad_input_is_refused(changes: Any, words: str) -> None:
    arguments: Any = {
        "goal_sets": [OBJECTS],
        "workspace_bounds_m": WORKSPACE,
        "model": MODEL,
        "rationality_per_m": 5.0,
        "seed": 1,
    }
    with pytest.raises(AutonomyError, match=words):
        calibrate_alpha(**(arguments | changes))
