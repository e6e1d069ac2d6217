"""An arbiter with a memory in a file beside the study file, docs/examples/02_arbiter_with_memory."""

from __future__ import annotations

import json

import numpy as np
import pytest

from app.autonomy.belief import Belief
from app.autonomy.interface import State
from app.simulated.participant import Case, simulate_participant
from app.trial.engine import TrialEngine
from app.trial.robots import make_robot
from app.trial.setup import study_setup
from app.trial.values import CycleStart, UserInput
from app.trial.world import open_study
from study.definition.study import orders, plan_session
from tests.support.lab_server import ROOT
from tests.support.outside_package import salab

pytestmark = pytest.mark.slow

STUDY = ROOT / "docs" / "examples" / "02_arbiter_with_memory" / "study.toml"
ORDER = ("yielding", "teleoperation")


def test_check_names_its_code_and_runs_it_when_it_is_trusted() -> None:
    told, trusted = salab("check", str(STUDY)), salab("check", str(STUDY), "--trust")
    assert told.returncode == trusted.returncode == 0
    assert "would run arbiter yielding.py:Yielding from " in told.stdout
    assert f"Not run, and so not checked: that code. Read it, then: salab check {STUDY} --trust" in told.stdout
    assert "runs arbiter yielding.py:Yielding from " in trusted.stdout.replace("would run", "")


def test_each_correction_makes_it_surer_before_it_moves() -> None:
    arbiter = study_setup(open_study(STUDY, trust=True), trust=True).arbiter("yielding")
    goals_m = np.array([[0.7, 0.0, 0.9], [0.7, 0.5, 0.9]])
    state = State((0.5, 0.0, 0.9), (0.0, 0.0, 0.0), ("near", "far"), goals_m)
    belief = Belief(("near", "far"), np.array([0.4, 0.6]))
    needed = []
    for _ in range(20):
        action = arbiter.decide(state, belief, None, lambda action: True)
        needed.append(arbiter.explain(state, belief, None, action)["needed"])
        against = (-action[0], -action[1], -action[2])
        assert arbiter.decide(state, belief, against, lambda action: True) == against
    assert needed[0] == 0.25 and needed == sorted(needed) and 0.6 < float(needed[-1]) < 0.7
    assert arbiter.memory["corrections"] == arbiter.memory["moves"] < 20
    assert arbiter.decide(state, belief, None, lambda action: True) == (0, 0, 0), "it is not sure enough any more"


def test_what_it_learnt_lasts_over_cycles_and_a_cycle_runs_again_from_its_memory_alone() -> None:
    study = open_study(STUDY, trust=True)
    setup = study_setup(study, trust=True)
    plan = plan_session(study, orders(study)[orders(study).index(ORDER)], seed=3)
    inputs: list[UserInput] = []
    for row in simulate_participant(Case(setup, 0, 3, ORDER), lambda: make_robot("kinematic"))["ticks"]:
        if row.trial == 1:
            direction = None if row.user_x is None else (row.user_x, row.user_y, row.user_z)
            inputs.append(UserInput(direction, row.gripper_input, after_pause=bool(row.after_pause)))
    whole = TrialEngine(setup.trial_setup("P001", plan, 1, "trial"), make_robot("kinematic"))
    whole.open()
    results = [whole.tick(each) for each in inputs]
    starts = [result.cycle_start for result in results if result.cycle_start is not None]
    memories = [json.loads(start.arbiter_memory) for start in starts]
    assert len(starts) == 2 and memories[0]["moves"] > 0
    assert all(memories[0][name] <= memories[1][name] for name in ("moves", "corrections"))
    last: CycleStart = starts[-1]
    again = TrialEngine(whole.setup, make_robot("kinematic"), last)
    again.open()
    rows = [again.tick(each).row for each in inputs[last.first_tick :]]
    assert rows == [result.row for result in results[last.first_tick :]]
