"""Presets, and the defaults that two houses must agree on since neither imports the other."""

from __future__ import annotations

from dataclasses import fields

import pytest

from app.autonomy.arbiters.weighing import Weights
from app.autonomy.transition import TransitionModel
from app.errors import LabError
from app.simulated.variants import preset_changes
from app.trial.values import RobotTiming
from sim.interface import TICK_S
from study import records
from study.definition.sections import ArbiterSettings, RobotSettings
from tests.support.arbiter_cases import ArbiterCase


def test_presets() -> None:
    assert preset_changes("paper") == {"arbiter": {"rationality_per_m": 1.0, "stickiness": 0.0}}
    assert preset_changes("lab") == {"arbiter": {"rationality_per_m": 5.0, "stickiness": 0.003}}
    assert preset_changes("fitted")["arbiter"]["transition"] == "replan"
    assert preset_changes(None) == {}
    with pytest.raises(LabError, match="paper, lab, fitted"):
        preset_changes("home")


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
