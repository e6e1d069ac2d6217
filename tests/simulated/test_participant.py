"""A whole simulated study: the rows of a live one, from the same engine."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from functools import cache
from typing import Any

import pytest

from app.simulated.participant import Case, Record, simulate_participant, simulate_trial, simulate_trials
from app.simulated.traits import Population
from app.simulated.variants import Changes, changed_study
from app.trial.engine import TrialEngine
from app.trial.setup import StudySetup, study_setup
from app.trial.values import inputs_of
from app.trial.world import open_study
from sim.interface import TICK_S
from sim.kinematic import KinematicRobot
from study.definition.study import plan_session
from study.flow.answers import validate_surveys
from study.flow.distractors.state import from_rows
from study.flow.facts import as_read
from study.records import TABLES, TickRow

pytestmark = pytest.mark.slow

ORDER = ("balanced", "teleoperation", "goal_oriented")


@cache
def setup(placement: str = "second_device") -> StudySetup:
    changes: Changes = {
        "": {"pickups_per_trial": 2},
        "distractor": {"placement": placement},
        "eligibility": {"webgl": True},
        "arbiter": {"transition": "replan", "planning_delay": 0.8, "step_m": 0.03},
    }
    return study_setup(changed_study(open_study(None), changes))


def case(placement: str = "second_device", seed: int = 11, **means: float) -> Case:
    return Case(setup(placement), 0, seed, ORDER, Population(means))


@cache
def whole() -> Record:
    return simulate_participant(case(), KinematicRobot)


def test_it_goes_from_consent_to_thanks_and_leaves_every_table() -> None:
    record = whole()
    person = record["participants"][0]
    assert (person.state, person.condition_order) == ("done", ">".join(ORDER))
    assert person.consent_hash == as_read(setup().study).consent.hash
    assert [row.outcome for row in record["trials"]] == ["completed"] * 3
    assert [row.condition for row in record["trials"]] == list(ORDER)
    assert [(row.trial, row.task) for row in record["tasks"]] == [(t, k) for t in (1, 2, 3) for k in (1, 2, 3, 4)]
    assert all(record[table] for table in TABLES if table not in ("chain", "certificates"))


def test_states_follow_one_another_as_in_the_lab() -> None:
    states = [json.loads(row.data)["to"] for row in whole()["events"] if row.kind == "state"]
    trial = ["practice", "trial_ready", "trial", "survey"]
    assert states == [
        *("consent", "demographics", "setup", "instructions", "practice_ready"),
        *trial,
        *("break", "practice_ready"),
        *trial,
        *("break", "practice_ready"),
        *trial,
        *("debrief", "done"),
    ]


def test_ticks_are_numbered_and_agree_with_tasks_and_trials() -> None:
    record = whole()
    for trial in record["trials"]:
        ticks = [row for row in record["ticks"] if row.trial == trial.trial]
        assert [row.tick for row in ticks] == list(range(trial.ticks))
        for task in (row for row in record["tasks"] if row.trial == trial.trial and row.first_tick is not None):
            inside = [row for row in ticks if row.task == task.task]
            assert (inside[0].tick, inside[-1].tick) == (task.first_tick, task.last_tick)
            assert {row.goal for row in inside} == {task.goal}


def test_the_logged_inputs_re_run_to_the_same_states() -> None:
    """What was simulated can be verified like what was lived."""
    record = whole()
    plan = plan_session(setup().study, ORDER, 11)
    engine = TrialEngine(setup().trial_setup("S001", plan, 1, "trial"), KinematicRobot())
    engine.open()
    for row in (row for row in record["ticks"] if row.trial == 1):
        assert engine.tick(inputs_of(row)).row == row


def test_trials_alone_have_the_rows_they_have_in_the_whole_study() -> None:
    record = whole()

    def without_seq(rows: list[TickRow]) -> list[dict[str, Any]]:
        return [{**vars(row), "input_seq": None} for row in rows]

    alone = simulate_trial(case(), 2, KinematicRobot)
    assert without_seq(alone["ticks"]) == without_seq([row for row in record["ticks"] if row.trial == 2])
    assert alone["tasks"] == [row for row in record["tasks"] if row.trial == 2]
    trials = simulate_trials(case(), KinematicRobot)
    assert without_seq(trials["ticks"]) == without_seq(record["ticks"])
    surveys = [(r.instrument, r.item, r.value) for r in record["survey_answers"] if r.condition]
    assert [(r.instrument, r.item, r.value) for r in trials["survey_answers"]] == surveys


def test_readings_come_on_time_and_most_are_answered_right() -> None:
    record = whole()
    settings = setup().study.distractor
    for trial in record["trials"]:
        rows = [row for row in record["alerts"] if row.trial == trial.trial]
        state = from_rows(setup().distractor, case().seed, rows)
        assert [row.due_trial_s for row in rows] == [state.due_s(row.alert) for row in rows]
        assert len(rows) == 1 + int((trial.ticks * TICK_S - settings.first_s) // settings.every_s)
        assert rows[-1].status in ("answered", "trial_ended", "expired")
    answered = [row for row in record["alerts"] if row.status == "answered"]
    assert len(answered) > 0.7 * len(record["alerts"])
    assert sum(row.correct for row in answered) > 0.8 * len(answered)


def test_a_reading_empties_the_hands() -> None:
    record = whole()
    for alert in (row for row in record["alerts"] if row.status == "answered"):
        ticks = {row.tick: row for row in record["ticks"] if row.trial == alert.trial}
        before = ticks[int(alert.answered_trial_s / TICK_S) - 1]
        assert before.user_x is None
        assert before.gripper_input is None


def test_on_one_screen_nobody_drives_while_a_reading_is_open() -> None:
    record = simulate_trial(case("same_page_away"), 1, KinematicRobot)
    for alert in record["alerts"]:
        end_s = alert.answered_trial_s or alert.due_trial_s
        locked = range(int(alert.due_trial_s / TICK_S), int(max(end_s, alert.due_trial_s + 5.0) / TICK_S))
        for row in record["ticks"]:
            if row.tick in locked:
                assert row.source != "user"


def test_who_never_answers_leaves_readings_open_and_goes_on() -> None:
    record = simulate_trial(case(miss=0.5), 2, KinematicRobot)
    assert Counter(row.status for row in record["alerts"])["expired"] > 0
    assert record["trials"][0].outcome == "completed"


def test_answers_would_pass_the_pages_checks() -> None:
    study = setup().study
    for trial in (1, 2, 3):
        answers: dict[str, dict[str, int]] = {}
        for row in whole()["survey_answers"]:
            if row.trial == trial:
                answers.setdefault(row.instrument, {})[row.item] = int(row.value)
        assert validate_surveys(study, answers) == ()


def test_the_same_seed_is_the_same_person_and_another_is_not() -> None:
    one, same = (simulate_trial(case(), 2, KinematicRobot)["ticks"] for _ in range(2))
    assert one == same
    assert one != simulate_trial(case(seed=12), 2, KinematicRobot)["ticks"]


def test_someone_who_gets_nowhere_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.simulated.participant.GIVES_UP_TICKS", 50)
    record = simulate_participant(case(), KinematicRobot)
    assert record["participants"][0].state == "withdrawn"
    withdrawn = [json.loads(row.data) for row in record["events"] if row.kind == "state"][-1]
    assert "gave up after" in withdrawn["reason"]


def test_who_presses_in_vain_frees_the_arm_and_every_task_keeps_one_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.simulated.participant.FREES_AFTER_TICKS", 1)
    in_arc = study_setup(changed_study(setup().study, {"": {"layout": "arc"}}))  # nowhere in crescent is one held up
    record = simulate_trial(replace(case(seed=8), setup=in_arc), 3, KinematicRobot)
    frees = [row for row in record["events"] if row.kind == "arm_freed"]
    assert frees
    assert {row.source for row in frees} == {"participant"}
    assert len(frees) == sum(row.source == "free" for row in record["ticks"])
    assert len(frees) == sum(row.attempts - 1 for row in record["tasks"] if row.kind == "pickup")
    assert Counter(row.task for row in record["tasks"]) == Counter(range(1, setup().study.tasks_per_trial + 1))
    plan = plan_session(in_arc.study, ORDER, 8)
    engine = TrialEngine(in_arc.trial_setup("S001", plan, 3, "trial"), KinematicRobot())
    engine.open()
    assert [engine.tick(inputs_of(row)).row for row in record["ticks"]] == record["ticks"]


def test_a_limit_ends_simulated_tasks_as_it_ends_those_of_people() -> None:
    limited = study_setup(changed_study(setup().study, {"": {"task_limit_s": 25.0, "trial_limit_s": 45.0}}))
    record = simulate_trial(Case(limited, 0, 11, ORDER), 1, KinematicRobot)
    (trial,) = record["trials"]
    assert (trial.outcome, trial.ticks <= 90 + limited.study.robot.settle_timeout_ticks) == ("completed", True)
    reasons = {(row.outcome, row.reason) for row in record["tasks"] if row.outcome != "success"}
    assert reasons <= {("failure", "time_limit"), ("not_run", "time_limit"), ("not_run", "pickup_failed")}
    assert ("not_run", "time_limit") in reasons
    assert len(record["tasks"]) == limited.study.tasks_per_trial
