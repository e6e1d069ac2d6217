from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, UNIT_DIRECTIONS, index_of
from app.autonomy.arbiters.weighing import disagreement, entropy_weights
from app.autonomy.errors import AutonomyError
from app.autonomy.evaluation import Evaluation
from app.autonomy.transition import TransitionModel
from tests.support.arbiter_cases import ArbiterCase, evaluate
from tests.support.autonomy_cases import (
    goals_and_beliefs,
    models,
    momenta,
    points_m,
    rationalities,
    user_actions,
    without_deadline,
)
from tests.support.literal_reference import LiteralEvaluation, evaluate_literal

ORIGIN = (0.0, 0.0, 0.0)
AT_REST = (0.0, 0.0, 0.0)
PLAIN = TransitionModel("mix", step_m=0.1, planning_delay=0.0)
BALANCED = ArbiterCase("balanced", alpha=375.0)
GOAL_ORIENTED = replace(BALANCED, condition="goal_oriented")
TELEOPERATION = replace(BALANCED, condition="teleoperation")
CONDITIONS: Any = ["teleoperation", "goal_oriented", "balanced"]
SIX_GOALS = np.array(
    [[0.80, -0.40, 0.85], [0.78, -0.20, 0.84], [0.82, 0.0, 0.86], [0.79, 0.2, 0.85], [0.81, 0.4, 0.84], [0.8, 0.3, 0.9]]
)
START = (0.70, 0.0, 0.88)


def assert_agree(actual: Evaluation, literal: LiteralEvaluation, tolerance: float) -> None:
    np.testing.assert_allclose(actual.likelihood, literal.likelihood, rtol=0, atol=tolerance)
    np.testing.assert_allclose(actual.posterior, literal.posterior, rtol=0, atol=tolerance)
    assert actual.entropy == pytest.approx(literal.entropy, abs=tolerance)
    np.testing.assert_allclose(actual.information_gain, literal.information_gain, rtol=0, atol=tolerance)
    np.testing.assert_allclose(actual.hindsight_reward, literal.hindsight_reward, rtol=0, atol=tolerance)


# --- against the paper's equations, written out ---


@settings(without_deadline, max_examples=40, phases=(Phase.explicit, Phase.reuse, Phase.generate))  # shrinking: minutes
@given(
    points_m,
    momenta,
    goals_and_beliefs(),
    user_actions,
    models,
    rationalities,
    st.sampled_from(CONDITIONS),
    st.floats(0.0, 10.0),
)
def test_evaluate_is_the_literal_equations(
    position: Any, momentum: Any, goals_belief: Any, user: Any, model: Any, kappa: float, condition: Any, gamma: float
) -> None:
    goals, belief = goals_belief
    parameters = ArbiterCase(condition, 100.0, gamma=gamma, rationality_per_m=kappa, transition=model)
    actual = evaluate(position, momentum, goals, belief, user, parameters)
    literal = evaluate_literal(position, momentum, goals.tolist(), belief.tolist(), user, parameters)
    assert_agree(actual, literal, 5e-12)
    np.testing.assert_allclose(actual.score, literal.score, rtol=0, atol=1e-9)
    # Different rounding may tell ties apart; the choice must be as good as the reference's all the same.
    assert literal.score[actual.chosen] == pytest.approx(literal.score[literal.chosen], abs=1e-9)


@pytest.mark.parametrize("kind", ["mix", "replan"])
@pytest.mark.parametrize("condition", CONDITIONS)
def test_whole_episodes_agree_with_the_literal_equations_to_the_choice(kind: Any, condition: Any) -> None:
    rng = np.random.default_rng(11)
    parameters = ArbiterCase(
        condition, 375.0, gamma=0.02, transition=TransitionModel(kind), stickiness=0.003, rationality_per_m=8.0
    )
    position, momentum, prior = np.array(START), np.zeros(3), None
    for tick in range(8):
        user = None if tick % 3 == 0 else DIRECTIONS[rng.integers(27)]
        feasible = rng.uniform(size=27) < 0.8
        goals = SIX_GOALS + 0.01 * tick  # they move
        actual = evaluate(position, momentum, goals, prior, user, parameters, feasible)
        literal = evaluate_literal(
            position.tolist(),
            momentum.tolist(),
            goals.tolist(),
            None if prior is None else prior.tolist(),
            user,
            parameters,
            feasible.tolist(),
        )
        assert_agree(actual, literal, 1e-12)
        np.testing.assert_allclose(actual.score, literal.score, rtol=0, atol=1e-10)
        assert actual.chosen == literal.chosen
        prior = actual.posterior
        position = parameters.transition.next_positions(position, momentum)[actual.chosen]
        momentum = UNIT_DIRECTIONS[actual.chosen]


def test_extremes_agree_with_the_literal_equations() -> None:
    # kappa = 1000: log-likelihoods down to -100. The floor of 1e-12 shows in what is compared, hence 1e-10.
    parameters = ArbiterCase("balanced", 1.0, rationality_per_m=1000.0)
    belief = [0.0, 0.5, 0.2, 0.3, 0.0, 0.0]
    actual = evaluate(START, (0.0, 1.0, 0.0), SIX_GOALS, belief, (0, 1, 0), parameters)
    literal = evaluate_literal(START, (0.0, 1.0, 0.0), SIX_GOALS.tolist(), belief, (0, 1, 0), parameters)
    assert_agree(actual, literal, 1e-10)
    assert actual.posterior[[0, 4, 5]].tolist() == [0.0, 0.0, 0.0]


# --- by hand ---


def test_the_weights_cross_and_have_a_floor() -> None:
    assert entropy_weights(0.5) == (0.5, 2.0)
    assert entropy_weights(0.1) == (0.1, 10.0)
    assert entropy_weights(0.0) == (0.1, 10.0)
    assert entropy_weights(1.0) == (1.0, 1.0)


def test_disagreement_is_between_unit_directions() -> None:
    d = disagreement(index_of((1, 0, 0)))
    assert d[index_of((1, 0, 0))] == 0.0
    assert d[index_of((-1, 0, 0))] == -2.0
    assert d[index_of((0, 1, 0))] == pytest.approx(-math.sqrt(2.0))
    assert d[NULL_ACTION] == -1.0
    # 45 degrees apart: 2 sin(22.5 deg) = 0.765367
    assert d[index_of((1, 1, 0))] == pytest.approx(-0.765367, abs=1e-6)
    assert not disagreement(None).any()


def test_the_score_is_assembled_as_printed() -> None:
    parameters = ArbiterCase("balanced", alpha=200.0, beta=3.0, gamma=0.5)
    result = evaluate(START, AT_REST, SIX_GOALS, None, (1, 0, 0), parameters)
    h = result.entropy
    index = index_of((0, 0, -1))
    by_hand = (
        200.0 * h * result.information_gain[index]
        + 3.0 / h * result.hindsight_reward[index]
        - 0.5 * math.sqrt(2.0)  # from (1, 0, 0) to (0, 0, -1)
    )
    assert result.score[index] == pytest.approx(by_hand, abs=1e-14)


def test_with_a_sure_belief_the_robot_goes_there() -> None:
    # H = 0, f2 = 10: 10 * 0.1 straight ahead, nothing to learn.
    result = evaluate(ORIGIN, AT_REST, [[0.0, 2.0, 0.0]], None, None, replace(BALANCED, transition=PLAIN))
    assert result.entropy == 0.0
    assert not result.information_gain.any()
    assert DIRECTIONS[result.chosen] == (0, 1, 0)
    assert result.score[result.chosen] == pytest.approx(1.0, abs=1e-12)


# --- evidence ---


@without_deadline
@given(points_m, momenta, goals_and_beliefs(), st.sampled_from(CONDITIONS))
def test_no_input_is_no_evidence(position: Any, momentum: Any, goals_belief: Any, condition: Any) -> None:
    goals, belief = goals_belief
    posterior = belief
    for _ in range(3):
        result = evaluate(position, momentum, goals, posterior, None, replace(BALANCED, condition=condition))
        posterior = result.posterior
    np.testing.assert_array_equal(posterior, belief)


def test_input_is_evidence_in_every_condition_and_staying_on_purpose_is_too() -> None:
    beliefs = [
        evaluate(START, AT_REST, SIX_GOALS, None, (0, 1, 0), replace(BALANCED, condition=condition)).posterior
        for condition in CONDITIONS
    ]
    assert beliefs[0][4] > beliefs[0][0]
    np.testing.assert_array_equal(beliefs[0], beliefs[1])
    np.testing.assert_array_equal(beliefs[0], beliefs[2])
    stayed = evaluate(START, AT_REST, SIX_GOALS, None, (0, 0, 0), BALANCED).posterior
    assert np.ptp(stayed) > 0.0


def test_everything_after_the_input_uses_the_posterior() -> None:
    told = evaluate(START, AT_REST, SIX_GOALS, None, (0, 1, 0), BALANCED)
    afterwards = evaluate(START, AT_REST, SIX_GOALS, told.posterior, None, BALANCED)
    np.testing.assert_array_equal(told.information_gain, afterwards.information_gain)
    np.testing.assert_array_equal(told.hindsight_reward, afterwards.hindsight_reward)
    assert told.entropy == afterwards.entropy < 1.0


# --- conditions ---


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("user", DIRECTIONS)
def test_the_person_always_wins_by_default(condition: Any, user: Any) -> None:
    parameters = ArbiterCase(condition, alpha=13_000.0, rationality_per_m=1.0)
    sure = [0.0, 0.0, 0.0, 0.0, 0.02, 0.98]
    nothing_else = np.zeros(27, dtype=bool)
    for prior in (None, sure):
        for feasible in (None, nothing_else):
            chosen = evaluate(START, (0.0, 0.0, 1.0), SIX_GOALS, prior, user, parameters, feasible).chosen
            assert chosen == index_of(user)
            assert DIRECTIONS[chosen] == user


def test_a_finite_gamma_blends() -> None:
    # One goal far ahead (+x), the person says +y, H = 0, f2 = 10, step 0.05. Value of going ...
    #   +x:   10 * 0.05         - gamma * 1.414
    #   +x+y: 10 * 0.05 * 0.707 - gamma * 0.765
    #   +y:   0
    # so the diagonal is best between gamma = 0.226 and 0.462.
    model = TransitionModel("mix", step_m=0.05, planning_delay=0.0)

    def chosen(gamma: float) -> tuple[int, int, int]:
        parameters = ArbiterCase("goal_oriented", 0.0, gamma=gamma, transition=model)
        return DIRECTIONS[evaluate(ORIGIN, AT_REST, [[1000.0, 0.0, 0.0]], None, (0, 1, 0), parameters).chosen]

    assert chosen(0.0) == (1, 0, 0)
    assert chosen(0.21) == (1, 0, 0)
    assert chosen(0.24) == (1, 1, 0)
    assert chosen(0.45) == (1, 1, 0)
    assert chosen(0.48) == (0, 1, 0)


@without_deadline
@given(points_m, momenta, goals_and_beliefs(), user_actions, models, rationalities)
def test_alpha_zero_is_goal_oriented(
    position: Any, momentum: Any, goals_belief: Any, user: Any, model: Any, kappa: float
) -> None:
    goals, belief = goals_belief
    balanced = ArbiterCase("balanced", 0.0, rationality_per_m=kappa, transition=model)
    goal_oriented = ArbiterCase("goal_oriented", 500.0, rationality_per_m=kappa, transition=model)
    one = evaluate(position, momentum, goals, belief, user, balanced)
    other = evaluate(position, momentum, goals, belief, user, goal_oriented)
    np.testing.assert_array_equal(one.score, other.score)
    assert one.chosen == other.chosen


def test_teleoperation_does_what_it_is_told_or_stays() -> None:
    sure = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    idle = evaluate(START, (0.0, 1.0, 0.0), SIX_GOALS, sure, None, TELEOPERATION).chosen
    assert DIRECTIONS[idle] == (0, 0, 0)
    assert idle == NULL_ACTION
    told = index_of((0, -1, 1))
    for parameters in (TELEOPERATION, replace(TELEOPERATION, gamma=0.0)):
        assert evaluate(START, AT_REST, SIX_GOALS, sure, (0, -1, 1), parameters).chosen == told


def test_balanced_explores_when_unsure_and_assists_when_sure() -> None:
    unsure = evaluate(START, AT_REST, SIX_GOALS, None, None, BALANCED)
    assert unsure.information_gain[unsure.chosen] == unsure.information_gain.max()
    sure = evaluate(START, AT_REST, SIX_GOALS, [0.002, 0.002, 0.002, 0.002, 0.002, 0.99], None, BALANCED)
    assert sure.chosen == sure.hindsight_reward.argmax()


# --- choosing ---


def tied(momentum: Any = AT_REST, feasible: Any = None) -> tuple[int, int, int]:
    """Goals on either side: R_HO is 0 for staying and for both ways along y, and less for all else."""
    parameters = ArbiterCase("goal_oriented", 0.0, transition=PLAIN)
    goals = [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]
    return DIRECTIONS[evaluate(ORIGIN, momentum, goals, None, None, parameters, feasible).chosen]


def test_ties_keep_the_direction_else_take_the_lowest_index() -> None:
    assert tied() == (0, -1, 0)
    assert tied((0.0, 1.0, 0.0)) == (0, 1, 0)
    assert tied((0.0, 0.3, 0.0)) == (0, 1, 0)
    assert tied((1.0, 0.0, 0.0)) == (0, -1, 0)  # the previous direction is not among the best


def test_infeasible_actions_are_never_the_arbiters_choice() -> None:
    feasible = np.ones(27, dtype=bool)
    feasible[index_of((0, 1, 0))] = False
    assert tied((0.0, 1.0, 0.0), feasible) == (0, -1, 0)
    feasible[index_of((0, -1, 0))] = False
    assert tied((0.0, 1.0, 0.0), feasible) == (0, 0, 0)
    assert tied(AT_REST, np.zeros(27, dtype=bool)) == (0, 0, 0)


def test_infeasible_actions_keep_their_score() -> None:
    masked = evaluate(START, AT_REST, SIX_GOALS, None, None, BALANCED, np.zeros(27, dtype=bool))
    np.testing.assert_array_equal(masked.score, evaluate(START, AT_REST, SIX_GOALS, None, None, BALANCED).score)


def test_the_callers_mask_is_left_alone() -> None:
    feasible = np.zeros(27, dtype=bool)
    evaluate(START, AT_REST, SIX_GOALS, None, (1, 0, 0), BALANCED, feasible)
    assert not feasible.any()


def test_stickiness_keeps_going_unless_another_direction_is_clearly_better() -> None:
    # H = 0, f2 = 10, step 0.1: straight on (+y) scores 1 and the present diagonal 10 * (1 - dist), about 0.705.
    diagonal = (math.sqrt(0.5), math.sqrt(0.5), 0.0)

    def result(stickiness: float, user: Any = None) -> Evaluation:
        parameters = ArbiterCase("goal_oriented", 0.0, transition=PLAIN, stickiness=stickiness)
        return evaluate(ORIGIN, diagonal, [[0.0, 100.0, 0.0]], None, user, parameters)

    assert DIRECTIONS[result(0.0).chosen] == (0, 1, 0)
    assert DIRECTIONS[result(0.28).chosen] == (0, 1, 0)
    assert DIRECTIONS[result(0.30).chosen] == (1, 1, 0)
    # It is told apart from the score ...
    np.testing.assert_array_equal(result(0.3).score, result(0.0).score)
    assert result(0.3).selection_bonus[index_of((1, 1, 0))] == 0.3
    assert np.count_nonzero(result(0.3).selection_bonus) == 1
    # ... and is for hands off: against a person it has no say.
    assert not result(0.3, user=(0, 0, 1)).selection_bonus.any()


def test_at_rest_there_is_nothing_to_stick_to() -> None:
    result = evaluate(START, AT_REST, SIX_GOALS, None, None, replace(BALANCED, stickiness=0.5))
    assert not result.selection_bonus.any()


@pytest.mark.parametrize("kind", ["mix", "replan"])
def test_nothing_is_nan_at_the_extremes(kind: Any) -> None:
    goals = [[1e9, 0.0, 0.0], [*START], [0.0, -1e40, 0.0], [*START]]
    for kappa in (0.0, 1000.0, 1e6):
        parameters = ArbiterCase("balanced", 1e4, rationality_per_m=kappa, transition=TransitionModel(kind))
        for prior in (None, [1.0, 0.0, 0.0, 0.0], [0.0, 0.5, 0.5, 0.0]):
            for user in (None, (1, 1, 1)):
                result = evaluate(START, (0.0, 0.0, -1.0), goals, prior, user, parameters)
                for values in (
                    result.likelihood,
                    result.posterior,
                    result.information_gain,
                    result.hindsight_reward,
                    result.score,
                ):
                    assert np.isfinite(values).all()
                assert 0.0 <= result.entropy <= 1.0


def test_results_are_read_only_and_the_prior_is_not_touched() -> None:
    prior = np.full(6, 1.0 / 6.0)
    result = evaluate(START, AT_REST, SIX_GOALS, prior, None, BALANCED)
    with pytest.raises(ValueError, match="read-only"):
        result.posterior[0] = 1.0
    prior[0] = 0.5  # still the caller's own
    assert result.posterior[0] == 1.0 / 6.0


# --- parameters and bad input ---


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"alpha": -1.0}, r"alpha is -1\.0.*>= 0"),
        ({"beta": math.nan}, "beta is nan"),
        ({"gamma": math.inf}, "gamma is inf.*finite"),
        ({"stickiness": -0.1}, "stickiness"),
        ({"rationality_per_m": -5.0}, r"rationality_per_m is -5\.0.*\[0, 1e6\]"),
        ({"entropy_floor": 0.0}, r"entropy_floor is 0\.0.*\(0, 1\]"),
    ],
)
def test_bad_parameters_are_refused_with_value_and_bound(changes: Any, words: str) -> None:
    with pytest.raises(AutonomyError, match=words):
        replace(BALANCED, **changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"position_m": (0.0, math.nan, 0.0)}, "position_m"),
        ({"position_m": [[0.0, 0.0, 0.0]]}, r"position_m has shape \(1, 3\)"),
        ({"momentum": (1.0, 1.0, 0.0)}, "momentum.*length <= 1"),
        ({"momentum": [[0.0, 0.0, 1.0]]}, "momentum has shape"),
        ({"momentum": [0.0, 1.0]}, "momentum has shape"),
        ({"goals_m": np.zeros((0, 3))}, "at least one goal"),
        ({"prior": [0.5, 0.5]}, r"belief has shape \(2,\)"),
        ({"prior": [1.0, 1.0, 0.0, 0.0, 0.0, 0.0]}, r"sum 2\.0"),
        ({"user_action": (0, 2, 0)}, r"\(0, 2, 0\).*-1, 0 or 1"),
        ({"feasible": [True] * 26}, "27 booleans"),
        ({"feasible": [1.0] * 27}, "27 booleans"),
    ],
)
def test_bad_input_is_refused(changes: Any, words: str) -> None:
    arguments: Any = {
        "position_m": START,
        "momentum": AT_REST,
        "goals_m": SIX_GOALS,
        "prior": None,
        "user_action": None,
        "case": BALANCED,
        "feasible": None,
    }
    with pytest.raises(AutonomyError, match=words):
        evaluate(**(arguments | changes))
