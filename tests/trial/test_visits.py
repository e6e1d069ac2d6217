"""Alpha on the states in which hands leave the controls."""

from __future__ import annotations

import json

import numpy as np
import pytest

from app.autonomy.belief import belief_entropy
from app.autonomy.calibration import Visit, calibrate_on_visits
from app.autonomy.errors import AutonomyError
from app.autonomy.hindsight import hindsight_reward
from app.autonomy.information import expected_information_gain
from app.simulated.variants import Changes, changed_study, preset_changes
from app.trial.setup import StudySetup, calibration_text, study_setup
from app.trial.visits import visits
from app.trial.world import layout_of, open_study
from sim.ik import solve
from study.definition.study import Study


def study(**arbiter: object) -> Study:
    changes: Changes = {"arbiter": arbiter}
    return changed_study(changed_study(open_study(None), preset_changes("fitted")), changes)


def visited(of: Study, setup: StudySetup) -> list[Visit]:
    models = setup.models("balanced")
    return visits(layout_of(of), of.objects, of.bins, of.pickups_per_trial, models, of.robot.speed_m_s / 2.0, 2020)


def test_alpha_is_the_median_over_visits_near_half_entropy() -> None:
    of = study(calibrated_on="visited")
    setup = study_setup(of)
    found, models, ratios = setup.calibration, setup.models("balanced"), []
    for visit in visited(of, setup):
        entropy = belief_entropy(visit.belief)
        if 0.4 <= entropy <= 0.6:
            information = np.ptp(expected_information_gain(*visit, models.transition, models.rationality_per_m))
            ratios.append(np.ptp(hindsight_reward(*visit, models.transition)) / (entropy**2 * information))
    assert found is not None
    assert found.alpha == pytest.approx(np.median(ratios), rel=1e-12)
    assert found.samples == len(ratios) > 200
    assert found.alpha < study_setup(study(calibrated_on="sampled")).arbiters["balanced"].parameters["alpha"] / 1.5
    assert sum(band.states for band in found.shares.in_use) == pytest.approx(1.0)
    assert study_setup(of).calibration == found, "another worker has another number"


def test_visits_lie_where_an_arm_can_be() -> None:
    of = study(calibrated_on="visited")
    found = visited(of, study_setup(of))
    out = [visit for visit in found if solve((*visit.position_m.tolist(),))[1]]
    assert len(out) < 0.02 * len(found)
    assert {len(visit.goals_m) for visit in found} == {2, 4, 5, 6}
    assert 0.1 < np.mean([any(visit.momentum) for visit in found]) < 0.5


def test_what_alpha_rests_on_is_in_the_record_and_in_what_check_prints() -> None:
    setup = study_setup(study(calibrated_on="visited"))
    assert setup.calibration is not None
    told = calibration_text(setup.calibration)
    assert f"on {setup.calibration.samples} states in which hands leave the controls" in told
    assert "0.7 to 1: " in told and "0.3 to 0.7: " in told and "0 to 0.3: " in told
    recorded = json.loads(json.dumps(setup.parameters_json("balanced")))
    assert recorded["calibrated_on"] == "visited"
    assert recorded["alpha"] == setup.calibration.alpha


def test_a_file_that_names_none_of_it_leaves_the_record_as_it_was() -> None:
    text = study().source_text
    for key in ("information", "look_ahead_m", "calibrated_on", "keep_way_on"):
        lines = [line for line in text.split("\n") if not line.startswith(f"{key} = ")]
        text = "\n".join(lines)
    assert "calibrated_on" not in text
    from app.trial.world import parse_text

    before, now = study_setup(parse_text(text, "of before")), study_setup(study())
    for name in before.arbiters:
        assert before.parameters_json(name) == now.parameters_json(name)
        assert not {"information", "look_ahead_m", "calibrated_on", "keep_way_on"} & set(before.parameters_json(name))


def test_alpha_is_calibrated_for_what_the_arbiter_looks_at() -> None:
    alphas = {
        name: study_setup(study(calibrated_on="visited", information=name)).arbiters["balanced"].parameters["alpha"]
        for name in ("next", "ahead", "at_rest")
    }
    assert alphas["at_rest"] > 3.0 * alphas["next"]
    assert len(set(alphas.values())) == 3


def test_too_few_visits_near_half_entropy_are_told() -> None:
    of = study(calibrated_on="visited")
    few = visited(of, study_setup(of))[:20]
    models = study_setup(of).models("balanced")
    with pytest.raises(AutonomyError, match="of 20 visited states have an entropy"):
        calibrate_on_visits(few, models.transition, models.rationality_per_m)


def test_with_one_goal_at_a_time_a_number_is_asked_for() -> None:
    of = study(calibrated_on="visited")
    models = study_setup(of).models("balanced")
    alone = [
        Visit(visit.position_m, visit.momentum, visit.goals_m[:1], np.ones(1)) for visit in visited(of, study_setup(of))
    ]
    with pytest.raises(AutonomyError, match="with one goal at a time there is nothing to find out: give a number"):
        calibrate_on_visits(alone, models.transition, models.rationality_per_m)
