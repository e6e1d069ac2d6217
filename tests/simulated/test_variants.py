"""Presets, and the defaults that two houses must agree on since neither imports the other."""

from __future__ import annotations

from dataclasses import fields

import pytest

from app.autonomy.arbiters.weighing import Weights
from app.autonomy.transition import TransitionModel
from app.errors import LabError
from app.simulated.variants import _replaced, changed_study, preset_changes
from app.trial.values import RobotTiming
from app.trial.world import open_study
from sim.interface import TICK_S
from study import records
from study.definition.sections import ArbiterSettings, RobotSettings
from tests.support.arbiter_cases import ArbiterCase


def test_presets() -> None:
    assert preset_changes(None) == preset_changes("shipped") == {}
    with pytest.raises(LabError, match="shipped, paper, lab, fitted"):
        preset_changes("home")


KNOWN: dict[str, dict[str, object]] = {
    "lab": {"rationality_per_m": 5.0, "step_m": 0.05, "planning_delay": 0.2, "transition": "mix", "stickiness": 0.003},
    "paper": {"rationality_per_m": 1.0, "step_m": 0.05, "planning_delay": 0.2, "transition": "mix", "stickiness": 0.0},
    "fitted": {
        "rationality_per_m": 6.31,
        "step_m": 0.03,
        "planning_delay": 0.8,
        "transition": "replan",
        "stickiness": 0.003,
    },
}
SPEED_M_S = {"lab": 0.04, "paper": 0.04, "fitted": 0.02687}
PLACEMENT = {"lab": "same_page_away", "paper": "same_page_away", "fitted": "second_device"}


@pytest.mark.parametrize("name", KNOWN)
def test_a_preset_that_was_published_keeps_its_values_whatever_ships(name: str) -> None:
    study = changed_study(open_study(None), preset_changes(name))
    arbiter = study.arbiter.model_dump()
    assert {key: arbiter[key] for key in KNOWN[name]} == KNOWN[name]
    assert study.robot.speed_m_s == SPEED_M_S[name]
    assert study.distractor.placement == PLACEMENT[name]
    assert study.layout == "arc"


def test_a_preset_leaves_the_layout_of_a_file_of_ones_own() -> None:
    rows = changed_study(open_study(None), {"": {"layout": "rows"}})
    assert changed_study(rows, preset_changes("fitted", layout=False)).layout == "rows"


def test_the_mathematics_and_the_study_file_have_the_same_defaults() -> None:
    settings = ArbiterSettings()
    parameters, model = ArbiterCase("balanced", alpha=1.0), TransitionModel()
    assert parameters.rationality_per_m == settings.rationality_per_m
    assert parameters.entropy_floor == settings.entropy_floor
    assert Weights(1.0).entropy_floor == settings.entropy_floor
    assert (model.kind, model.step_m, model.planning_delay) == (
        settings.transition,
        settings.step_m,
        settings.planning_delay,
    )


def test_the_robot_s_timing_is_the_study_file_s() -> None:
    timing, settings = RobotTiming(), RobotSettings()
    for item in fields(timing):
        assert getattr(timing, item.name) == getattr(settings, item.name), item.name


def test_robot_and_study_have_one_tick() -> None:
    assert records.TICK_S == TICK_S


def test_a_file_that_holds_code_takes_several_changes_of_a_section_it_has_not() -> None:
    text = "title = 1\n\n[[code]]\nkind = 'arbiter'\n"
    for key in ("step_m", "stickiness"):
        text = _replaced(text, "arbiter", key, 0.02)
    assert text.index("stickiness = 0.02") < text.index("[[code]]") and text.count("[arbiter]") == 1


@pytest.mark.parametrize(
    ("name", "differs"),
    [
        ("ahead", {"information": "ahead"}),
        ("at_rest", {"information": "at_rest"}),
        ("averaged", {"information": "averaged"}),
        ("steady", {"stickiness": 0.06}),
    ],
)
def test_a_preset_of_the_study_that_ships_says_everything_it_stands_for(name: str, differs: dict[str, object]) -> None:
    first = changed_study(open_study(None), preset_changes("lab"))
    study, shipped = changed_study(first, preset_changes(name)), open_study(None)
    assert study.arbiter.model_dump() == {**shipped.arbiter.model_dump(), **differs}
    assert (study.robot, study.layout) == (shipped.robot, shipped.layout)
    assert study.distractor.placement == shipped.distractor.placement
