from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, index_of
from app.autonomy.belief import PROBABILITY_FLOOR, Belief, belief_entropy, log_likelihood
from app.autonomy.errors import AutonomyError
from app.autonomy.transition import TransitionModel
from tests.support.autonomy_cases import goal_sets, models, momenta, points_m, rationalities, updated, without_deadline

ORIGIN = (0.0, 0.0, 0.0)
AT_REST = (0.0, 0.0, 0.0)
LEFT_AND_RIGHT = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
PLAIN = TransitionModel("mix", step_m=0.1, planning_delay=0.0)


def test_one_observation_worked_by_hand() -> None:
    # Towards A: R_A = 0.1, R_B = -0.1; by symmetry both goals have the same sum in eq. 3, so with kappa = 2
    # P(u|A) / P(u|B) = exp(2 * 0.2) and b(A) = 1 / (1 + exp(-0.4)) = 0.598687660112452.
    rows = log_likelihood(ORIGIN, AT_REST, LEFT_AND_RIGHT, PLAIN, 2.0)
    after = updated(Belief.uniform(("A", "B")), rows[index_of((1, 0, 0))])
    assert after.as_dict() == pytest.approx({"A": 0.598687660112452, "B": 0.401312339887548}, abs=1e-14)
    # -(0.598688 log2 0.598688 + 0.401312 log2 0.401312) = 0.598688 * 0.740125 + 0.401312 * 1.317203 = 0.971713
    assert after.entropy == pytest.approx(0.971713, abs=1e-6)


def test_three_observations_multiply() -> None:
    # eq. 4: the same action seen three times from the same place, 1 / (1 + exp(-1.2))
    row = log_likelihood(ORIGIN, AT_REST, LEFT_AND_RIGHT, PLAIN, 2.0)[index_of((1, 0, 0))]
    belief = Belief.uniform(("A", "B"))
    for _ in range(3):
        belief = updated(belief, row)
    assert belief.probabilities[0] == pytest.approx(1.0 / (1.0 + math.exp(-1.2)), abs=1e-14)


def test_staying_is_one_of_the_27_actions() -> None:
    # The null action has R = 0, so it takes its share of eq. 3: exp(0) / Z, with Z over all 27.
    rows = log_likelihood(ORIGIN, AT_REST, LEFT_AND_RIGHT, PLAIN, 2.0)
    z = sum(math.exp(2.0 * (1.0 - math.dist(p, (1.0, 0.0, 0.0)))) for p in PLAIN.next_positions(ORIGIN, AT_REST))
    np.testing.assert_allclose(np.exp(rows[NULL_ACTION]), [1.0 / z, 1.0 / z], atol=1e-15)


def test_goals_may_move_between_updates() -> None:
    # The same action is evidence for A while A lies ahead, and against it once A has moved behind.
    action = index_of((1, 0, 0))
    belief = Belief.uniform(("A", "B"))
    ahead = log_likelihood(ORIGIN, AT_REST, LEFT_AND_RIGHT, PLAIN, 2.0)[action]
    behind = log_likelihood(ORIGIN, AT_REST, -LEFT_AND_RIGHT, PLAIN, 2.0)[action]
    assert updated(belief, ahead).probabilities[0] > 0.59
    np.testing.assert_allclose(updated(updated(belief, ahead), behind).probabilities, [0.5, 0.5], atol=1e-15)


def test_a_diagonal_is_not_stronger_evidence_than_an_axis() -> None:
    # Straight at a goal on the diagonal and straight at one on the axis: both step 0.1 closer.
    diagonal = np.full(3, 1.0 / math.sqrt(3.0))
    goals = np.array([[1.0, 0.0, 0.0], diagonal])
    rows = log_likelihood(ORIGIN, AT_REST, goals, PLAIN, 1.0)
    straight = rows[index_of((1, 0, 0)), 0] - rows[NULL_ACTION, 0]
    slanted = rows[index_of((1, 1, 1)), 1] - rows[NULL_ACTION, 1]
    assert straight == pytest.approx(0.1, abs=1e-14)
    assert slanted == pytest.approx(straight, abs=1e-14)


@without_deadline
@given(points_m, momenta, goal_sets(), models, rationalities)
def test_likelihoods_are_a_distribution_over_actions(
    position: Any, momentum: Any, goals: Any, model: TransitionModel, kappa: float
) -> None:
    rows = log_likelihood(position, momentum, goals, model, kappa)
    assert rows.shape == (27, len(goals))
    np.testing.assert_allclose(np.exp(rows).sum(axis=0), 1.0, atol=1e-12)


@without_deadline
@given(points_m, goal_sets(), models, rationalities, st.lists(st.sampled_from(DIRECTIONS), max_size=12))
def test_a_belief_sums_to_one_and_no_goal_is_lost(
    position: Any, goals: Any, model: TransitionModel, kappa: float, actions: list[tuple[int, int, int]]
) -> None:
    rows = log_likelihood(position, AT_REST, goals, model, kappa)
    belief = Belief.uniform([f"goal {index}" for index in range(len(goals))])
    for action in actions:
        belief = updated(belief, rows[index_of(action)])
    assert belief.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
    assert belief.probabilities.min() >= 0.9 * PROBABILITY_FLOOR
    assert 0.0 <= belief.entropy <= 1.0


@without_deadline
@given(points_m, goal_sets(2), models, rationalities, st.sampled_from(DIRECTIONS), st.randoms())
def test_a_belief_does_not_depend_on_the_order_of_goals(
    position: Any, goals: Any, model: TransitionModel, kappa: float, action: Any, random: Any
) -> None:
    order = list(range(len(goals)))
    random.shuffle(order)

    def seen(indices: list[int]) -> dict[str, float]:
        rows = log_likelihood(position, AT_REST, goals[indices], model, kappa)
        return updated(Belief.uniform([str(index) for index in indices]), rows[index_of(action)]).as_dict()

    assert seen(order) == pytest.approx(seen(sorted(order)), abs=1e-12)


def test_coincident_goals_cannot_be_told_apart() -> None:
    goals = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    row = log_likelihood(ORIGIN, AT_REST, goals, PLAIN, 5.0)[index_of((1, 0, 0))]
    probabilities = updated(Belief(("A", "B", "C"), np.array([0.2, 0.4, 0.4])), row).probabilities
    assert probabilities[1] / probabilities[0] == pytest.approx(2.0, abs=1e-12)


def test_overwhelming_evidence_stops_at_the_floor_and_can_be_taken_back() -> None:
    belief = updated(Belief.uniform(("A", "B")), np.array([0.0, -1000.0]))
    assert belief.probabilities[1] == pytest.approx(PROBABILITY_FLOOR, rel=1e-9)
    assert updated(belief, np.array([-1000.0, 0.0])).probabilities.argmax() == 1


def test_a_goal_ruled_out_beforehand_stays_out() -> None:
    belief = updated(Belief(("A", "B", "C"), np.array([0.5, 0.5, 0.0])), np.array([0.0, -1000.0, 5.0]))
    assert belief.probabilities[2] == 0.0
    assert math.isfinite(belief.entropy)


def test_far_goals_and_high_rationality_stay_finite() -> None:
    goals = np.array([[1e6, 0.0, 0.0], [0.0, -1e9, 0.0], [1e90, 1e90, 0.0], [0.0, 0.0, 0.0]])
    rows = log_likelihood(ORIGIN, (0.0, 1.0, 0.0), goals, TransitionModel(), 1000.0)
    assert np.isfinite(rows).all()
    np.testing.assert_allclose(np.exp(rows).sum(axis=0), 1.0, atol=1e-12)


def test_entropy_is_to_the_base_of_the_number_of_goals() -> None:
    assert Belief.uniform(("A",)).entropy == 0.0
    for count in (2, 3, 6):
        assert Belief.uniform([str(i) for i in range(count)]).entropy == pytest.approx(1.0, abs=1e-15)
    # two of four goals: log_4 2
    assert belief_entropy(np.array([0.5, 0.5, 0.0, 0.0])) == pytest.approx(0.5, abs=1e-15)
    assert str(belief_entropy(np.array([0.0, 1.0, 0.0]))) == "0.0"  # not -0.0, which is what an export would say


def test_a_belief_is_a_value() -> None:
    source = np.array([0.25, 0.75])
    belief = Belief(("A", "B"), source)
    source[0] = 9.0
    assert belief.as_dict() == {"A": 0.25, "B": 0.75}
    with pytest.raises(ValueError, match="read-only"):
        belief.probabilities[0] = 1.0
    assert belief == Belief(("A", "B"), np.array([0.25, 0.75]))
    assert belief != Belief(("A", "C"), np.array([0.25, 0.75]))
    assert len({belief, Belief(("A", "B"), np.array([0.25, 0.75]))}) == 1


@pytest.mark.parametrize(
    ("goal_ids", "probabilities", "words"),
    [
        ((), [], "at least one"),
        (("A", "A"), [0.5, 0.5], "each once"),
        (("A", "B"), [1.0], r"shape \(1,\)"),
        (("A", "B"), [0.6, 0.6], r"sum 1\.2"),
        (("A", "B"), [1.5, -0.5], ">= 0"),
        (("A", "B"), [math.nan, 1.0], "nan"),
        (("A", "B"), ["x", "y"], "one probability for each goal"),
    ],
)
def test_what_is_no_distribution_is_refused(goal_ids: Any, probabilities: Any, words: str) -> None:
    with pytest.raises(AutonomyError, match=words):
        Belief(goal_ids, probabilities)


def test_a_uniform_belief_needs_a_goal() -> None:
    with pytest.raises(AutonomyError, match="at least one"):
        Belief.uniform(())


@pytest.mark.parametrize("kappa", [-1.0, math.nan, math.inf, 2e6])
def test_rationality_is_bounded(kappa: float) -> None:
    with pytest.raises(AutonomyError, match="rationality_per_m"):
        log_likelihood(ORIGIN, AT_REST, LEFT_AND_RIGHT, PLAIN, kappa)


@pytest.mark.parametrize("goals", [[], [1.0, 0.0, 0.0], [[1.0, 0.0]], [[math.nan, 0.0, 0.0]], [[1e101, 0.0, 0.0]]])
def test_bad_goals_are_refused(goals: Any) -> None:
    with pytest.raises(AutonomyError, match="goals_m"):
        log_likelihood(ORIGIN, AT_REST, goals, PLAIN, 1.0)
