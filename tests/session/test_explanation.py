"""What the experimenter's page is told about a tick agrees with what the arbiter did in it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from app.autonomy.actions import DIRECTIONS
from app.session.explanation import explain_tick, plane_of
from tests.support.arbiter_cases import Condition, evaluate
from tests.support.engine_cases import (
    FORWARD,
    HANDS_OFF,
    LEFT,
    opened,
    paper_study,
    parameters,
    push,
    rows_of,
    run,
    trial_setup,
)

LABELS = paper_study().labels()


@pytest.mark.parametrize("condition", ["goal_oriented", "balanced"])
def test_when_the_robot_chose_no_other_action_it_can_do_scores_more(condition: Condition) -> None:
    setup = trial_setup(condition)
    engine = opened(setup)
    row = rows_of(run(engine, [push(FORWARD)] * 6 + [HANDS_OFF]))[6]
    assert row.source == "robot"
    scores = {name: float(value) for name, value in engine.explain().items()}
    assert scores["score"] == pytest.approx(scores["weighted_information"] + scores["weighted_reward"])
    places, belief = json.loads(row.goals), json.loads(row.belief)
    every = evaluate(
        (row.p_x, row.p_y, row.p_z),
        (row.m_x, row.m_y, row.m_z),
        list(places.values()),
        [belief[name] for name in places],
        None,
        parameters(condition),
    )
    chosen = DIRECTIONS.index((row.action_x, row.action_y, row.action_z))
    assert scores["score"] == pytest.approx(every.score[chosen])
    assert (scores["information"], scores["reward_m"]) == (
        every.information_gain[chosen],
        every.hindsight_reward[chosen],
    )
    if condition == "goal_oriented":
        assert scores["weighted_information"] == 0.0 and scores["weighted_reward"] == scores["score"]


def test_where_nothing_was_chosen_nothing_is_scored() -> None:
    setup = trial_setup("teleoperation")
    engine = opened(setup)
    (row,) = rows_of(run(engine, [HANDS_OFF]))
    assert row.source == "idle" and explain_tick(row, engine.explain(), setup, LABELS).explanation == {}


def test_a_thought_names_the_goals_in_words_with_their_probability() -> None:
    setup = trial_setup("balanced")
    row = rows_of(run(opened(setup), [push(LEFT)] * 5))[-1]
    explanation = explain_tick(row, {}, setup, LABELS)
    assert {goal.id: goal.probability for goal in explanation.goals} == json.loads(row.belief)
    assert [goal.id for goal in explanation.goals if goal.instructed] == [row.goal]
    assert all(goal.label == LABELS.objects[goal.id] for goal in explanation.goals)
    assert (explanation.user, explanation.action, explanation.source) == (LEFT, LEFT, "user")


def test_both_planes_are_highest_near_goals_that_are_believed_in() -> None:
    setup = trial_setup("balanced")
    row = rows_of(run(opened(setup), [push(LEFT)] * 8))[-1]
    likely = max(json.loads(row.belief).items(), key=lambda item: item[1])[0]
    unlikely = min(json.loads(row.belief).items(), key=lambda item: item[1])[0]
    plane = plane_of(row, setup, LABELS, "reward")
    values, goals = np.array(plane.values), json.loads(row.goals)
    assert values.shape == (len(plane.x_m), len(plane.y_m))

    def at(name: str) -> float:
        x, y, _ = goals[name]
        i = int(np.abs(np.array(plane.x_m) - x).argmin())
        j = int(np.abs(np.array(plane.y_m) - y).argmin())
        return float(values[i, j])

    assert at(likely) > at(unlikely)
    gains = np.array(plane_of(row, setup, LABELS, "information").values)
    assert gains.shape == values.shape and gains.min() >= 0.0 and gains.max() <= row.entropy
    assert gains.max() > gains.min()


def test_while_the_arm_goes_back_the_plane_shows_the_new_goals_alike() -> None:
    setup = trial_setup("balanced")
    row = rows_of(run(opened(setup), [push(LEFT)]))[-1]
    places = json.loads(row.goals)
    returning = replace(row, source="reset", belief=json.dumps({"left_bin": 0.9, "right_bin": 0.1}))
    plane = plane_of(returning, setup, LABELS, "reward")
    assert {goal.probability for goal in plane.goals} == {1.0 / len(places)}
    explanation = explain_tick(returning, {}, setup, LABELS)
    assert [(goal.id, goal.position_m) for goal in explanation.goals] == [("left_bin", None), ("right_bin", None)]
