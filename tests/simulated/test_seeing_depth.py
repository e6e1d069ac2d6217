"""Depth can be seen: somebody who steers by the pictures alone grasps what they aim at, with no help from the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.trial.values import TrialSetup
from sim.bullet import BulletRobot
from sim.layouts import scene as layout_scene
from tests.support.engine_cases import opened, trial_setup
from tests.support.picture_person import PicturePerson
from tests.support.shipped_world import LAYOUTS, STUDY_OBJECTS

pytestmark = pytest.mark.bullet

SEEDS = range(16)
MOST_TICKS = 120


def task(seed: int) -> TrialSetup:
    """Each layout in turn, the objects placed at random, one of them asked for; teleoperation."""
    rng = np.random.default_rng(seed)
    placed = [str(name) for name in rng.permutation(list(STUDY_OBJECTS))]
    target = placed[int(rng.integers(len(placed)))]
    setup = trial_setup("teleoperation", [(target, "left_bin")])
    layout = list(LAYOUTS.values())[seed % len(LAYOUTS)]
    return replace(setup, cycles=(replace(setup.cycles[0], scene=layout_scene(layout, placed)),))


def picks_up(seed: int, inset: bool) -> bool:
    """Whether the object is lifted, not knocked over, in a minute."""
    robot = BulletRobot()
    try:
        engine, person = opened(task(seed), robot), PicturePerson(seed, inset)
        for _ in range(MOST_TICKS):
            result = engine.tick(person.act(engine))
            if result.tasks:
                return result.tasks[0].outcome == "success"
        return False
    finally:
        robot.close()


def test_with_the_shipped_view_what_is_aimed_at_is_grasped_and_without_the_inset_mostly_not() -> None:
    both = {inset: sum(picks_up(seed, inset) for seed in SEEDS) for inset in (True, False)}
    assert both[True] >= 14, both
    assert both[False] <= len(SEEDS) / 2, both
