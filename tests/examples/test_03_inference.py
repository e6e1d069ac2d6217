"""Another goal inference in a file beside the study file, docs/examples/03_inference."""

from __future__ import annotations

import json

import numpy as np
import pytest

from app.autonomy.belief import Belief
from app.autonomy.interface import State
from app.simulated.participant import Case, simulate_participant
from app.trial.parts import make_inference
from app.trial.robots import make_robot
from app.trial.setup import study_setup
from app.trial.world import open_study
from tests.support.lab_server import ROOT

pytestmark = pytest.mark.slow

STUDY = ROOT / "docs" / "examples" / "03_inference" / "study.toml"
LEFT, RIGHT = (0, 1, 0), (0, -1, 0)


def test_it_follows_who_changes_their_mind_sooner_than_the_papers() -> None:
    setup = study_setup(open_study(STUDY, trust=True), trust=True)
    goals_m = np.array([[0.7, 0.4, 0.9], [0.7, -0.4, 0.9]])
    state = State((0.6, 0.0, 0.9), (0.0, 0.0, 0.0), ("left", "right"), goals_m)
    turns = {}
    for condition in ("keeps_all", "forgets"):
        inference = make_inference(setup.inferences[condition], setup.models(condition))
        belief = Belief.uniform(("left", "right"))
        for _ in range(20):
            belief = inference.update(state, belief, LEFT)
        assert belief.probabilities[0] > 0.75
        assert inference.update(state, belief, None) is belief, "hands off are no evidence"
        for count in range(1, 21):
            belief = inference.update(state, belief, RIGHT)
            if belief.probabilities[1] > 0.5:
                turns[condition] = count
                break
    assert turns["forgets"] < turns.get("keeps_all", 21)


def test_simulated_people_are_understood_by_both_and_their_beliefs_compare() -> None:
    setup = study_setup(open_study(STUDY, trust=True), trust=True)
    record = simulate_participant(Case(setup, 0, 5, ("keeps_all", "forgets")), lambda: make_robot("kinematic"))
    for row in record["ticks"]:
        assert abs(sum(json.loads(row.belief).values()) - 1.0) < 1e-9
    recorded = {row.condition: json.loads(row.parameters) for row in record["trials"]}
    assert recorded["forgets"]["inference"] == {"kind": "fading.py:Fading", "forget": 0.2}
    assert "inference" not in recorded["keeps_all"], "the paper's is not said"
    assert {row.condition for row in record["tasks"]} == {"keeps_all", "forgets"}
