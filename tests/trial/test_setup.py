"""From a participant's plan to a trial's set-up: the instructed things stand where the plan puts them."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest

from app.autonomy.arbiters.balanced import Balanced
from app.autonomy.arbiters.goal_oriented import GoalOriented
from app.autonomy.arbiters.teleoperation import Teleoperation
from app.autonomy.interface import Models
from app.autonomy.transition import TransitionModel
from app.trial.setup import study_setup
from app.trial.values import RobotTiming
from app.trial.world import layout_of
from study.definition.study import Study, parse_study, plan_session
from study.flow.distractors.interface import Stimulus
from study.flow.distractors.state import of_practice
from tests.support.arbiter_cases import CONDITIONS
from tests.support.engine_cases import paper_study
from tests.support.shipped_world import PRACTICE_OBJECT
from tests.support.study_samples import lab_study

ORDER = ("balanced", "teleoperation", "goal_oriented")
PLAN = plan_session(lab_study(), ORDER, seed=11)


def changed(old: str, new: str) -> Study:
    text = lab_study().source_text
    assert old in text
    return parse_study(text.replace(old, new))


@pytest.mark.parametrize("trial", [1, 2, 3])
def test_a_trial_follows_its_plan(trial: int) -> None:
    drawn = PLAN.trial(trial)
    setup = paper_study().trial_setup("p01", PLAN, trial, "trial")
    assert (setup.participant, setup.trial, setup.condition) == ("p01", trial, ORDER[trial - 1])
    assert setup.arbiter == paper_study().arbiters[ORDER[trial - 1]]
    assert setup.models == paper_study().models(ORDER[trial - 1])
    assert [(cycle.object, cycle.bin) for cycle in setup.cycles] == [(p.object, p.bin) for p in drawn.pickups]


@pytest.mark.parametrize("trial", [1, 2, 3])
def test_every_object_stays_on_its_slot_until_it_was_instructed(trial: int) -> None:
    drawn = PLAN.trial(trial)
    setup = paper_study().trial_setup("p01", PLAN, trial, "trial")
    places = dict(zip(drawn.placement, paper_study().layout.places, strict=True))
    left = list(drawn.placement)
    for cycle in setup.cycles:
        assert [placed.spec.id for placed in cycle.scene.objects] == left
        assert all(placed.base_world_m[:2] == places[placed.spec.id] for placed in cycle.scene.objects)
        assert cycle.object in left
        left.remove(cycle.object)
    assert [len(cycle.scene.objects) for cycle in setup.cycles] == [6, 5, 4]


@pytest.mark.parametrize("trial", [1, 2, 3])
def test_practice_has_one_object_of_its_own_under_the_trial_s_condition(trial: int) -> None:
    setup = paper_study().trial_setup("p01", PLAN, trial, "practice")
    (cycle,) = setup.cycles
    assert [placed.spec for placed in cycle.scene.objects] == [PRACTICE_OBJECT]
    assert (cycle.object, cycle.bin) == (PRACTICE_OBJECT.id, ("left_bin", "right_bin", "left_bin")[trial - 1])
    assert abs(cycle.scene.objects[0].base_world_m[1] - cycle.scene.start_world_m[1]) > 0.1, (
        "no sideways aim is asked for"
    )
    assert (setup.kind, setup.condition) == ("practice", ORDER[trial - 1])


def test_numbers_of_the_study_file_reach_the_trial() -> None:
    study = changed(
        "gripper_ticks = 2             # a tick is 0.5 s\nsettle_timeout_ticks = 12\nreset_ticks = 4",
        "gripper_ticks = 3\nsettle_timeout_ticks = 20\nreset_ticks = 9",
    )
    setup = replace(paper_study(), study=study).trial_setup("p01", PLAN, 1, "trial")
    assert setup.timing == RobotTiming(0.04, gripper_ticks=3, settle_timeout_ticks=20, reset_ticks=9)
    assert paper_study().trial_setup("p01", PLAN, 1, "trial").timing == RobotTiming()


def test_each_condition_has_its_arbiter_and_all_share_the_model() -> None:
    setup = paper_study()
    made = {name: setup.arbiter(name) for name in CONDITIONS}
    assert {name: type(arbiter) for name, arbiter in made.items()} == {
        "teleoperation": Teleoperation,
        "goal_oriented": GoalOriented,
        "balanced": Balanced,
    }
    assert {arbiter.models for arbiter in made.values()} == {Models(5.0, TransitionModel("mix", 0.05, 0.2))}
    assert setup.calibration is not None
    assert made["balanced"].parameters.alpha == setup.calibration.alpha > 0.0
    assert made["goal_oriented"].parameters.alpha == 0.0


def test_alpha_is_the_same_in_every_lab_that_runs_the_same_file() -> None:
    assert study_setup(lab_study()).arbiters == paper_study().arbiters


def test_alpha_given_as_a_number_is_taken_and_nothing_is_calibrated() -> None:
    setup = study_setup(changed('alpha = "calibrated"', "alpha = 0.25"))
    assert setup.calibration is None
    assert setup.arbiter("balanced").parameters.alpha == 0.25


def test_alpha_depends_on_the_model_the_study_chooses() -> None:
    sharp = study_setup(changed("rationality_per_m = 5.0", "rationality_per_m = 50.0"))
    assert sharp.arbiters["balanced"] != paper_study().arbiters["balanced"]


def test_everything_that_can_be_instructed_has_words() -> None:
    labels = paper_study().labels()
    assert set(labels.objects) >= {*lab_study().objects, PRACTICE_OBJECT.id}
    assert set(labels.bins) >= set(lab_study().bins)
    assert all(labels.objects.values()) and all(labels.bins.values())


def test_the_record_holds_every_parameter_as_json() -> None:
    stored = json.loads(json.dumps(paper_study().parameters_json("balanced")))
    parameters = paper_study().arbiter("balanced").parameters
    assert stored["alpha"] == parameters.alpha
    assert stored["transition"] == {"kind": "mix", "step_m": 0.05, "planning_delay": 0.2}
    printed = {"information", "look_ahead_m"}  # the paper's equation goes without saying, as before there was another
    assert set(stored) == {"condition", "rationality_per_m", "transition", *vars(parameters)} - printed


def test_a_trial_s_row_says_how_it_was_laid_out() -> None:
    row = paper_study().trial_row("p01", PLAN, 2)
    assert (row.participant, row.trial, row.condition, row.layout) == ("p01", 2, "teleoperation", "arc")
    assert tuple(json.loads(row.placement)) == PLAN.trial(2).placement
    assert json.loads(row.parameters) == json.loads(json.dumps(paper_study().parameters_json("teleoperation")))
    assert (row.outcome, row.ticks, row.started_utc) == ("running", 0, None)


def test_a_study_file_of_before_goes_on_meaning_what_it_did() -> None:
    text = lab_study().source_text
    for younger in re.findall(r"^.* \[(?:false|\"table\")\]$", text, flags=re.MULTILINE):
        text = text.replace(f"{younger}\n", "")
    study = parse_study(text)
    setup = replace(paper_study(), study=study, layout=layout_of(study))
    (cycle,) = setup.trial_setup("p01", PLAN, 1, "practice").cycles
    assert (cycle.bin, cycle.scene.objects[0].base_world_m[:2]) == (None, (0.82, 0.0))
    assert of_practice(setup.distractor, study).advance(600.0, lambda _: Stimulus("1"))[1] == ()
    assert (study.view.inset, study.view.ring, study.view.drop_mark) == (False, False, True)
    assert parse_study(text.replace('look = "own"', "")).view.look == "installed"
