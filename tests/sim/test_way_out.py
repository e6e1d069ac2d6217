"""An arm that was pressed against something comes free again: whatever was done before, a way out moves it.

A part of the drives each run; all 500 with `SALAB_FULL_SWEEP=1`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

import numpy as np
import pytest

from app.autonomy.actions import DIRECTIONS, Direction
from app.trial.engine import TrialEngine
from app.trial.values import UserInput
from sim.bullet import BulletRobot
from tests.support.arbiter_cases import CONDITIONS, Condition
from tests.support.engine_cases import CLOSE, HANDS_OFF, opened, push, trial_setup

pytestmark = pytest.mark.bullet

DRIVES = 500 if os.environ.get("SALAB_FULL_SWEEP") else 24
WAYS_OUT: Sequence[Direction] = ((0, 0, 1), (-1, 0, 0), (-1, 0, 1))
"""Up, back to the robot, and both: away from the table and from what stands on it."""
FREE_M = 0.005


def drive(engine: TrialEngine, rng: np.random.Generator) -> None:
    """To a side, into the row of objects, hands off; then more pushes into things, at times with the gripper closed."""
    aside = (0, 1 if rng.random() < 0.5 else -1, 0)
    pushes = [push(aside)] * int(rng.integers(0, 11)) + [push((1, 0, 0))] * int(rng.integers(8, 13)) + [HANDS_OFF] * 12
    for _ in range(int(rng.integers(0, 3))):
        direction = DIRECTIONS[int(rng.integers(len(DIRECTIONS)))]
        pushes += [push((1, direction[1], min(direction[2], 0)))] * int(rng.integers(4, 12))
        pushes += [CLOSE] if rng.random() < 0.2 else [HANDS_OFF] * int(rng.integers(0, 13))
    for given in pushes:
        if not engine.finished:
            engine.tick(given)


def way_m(engine: TrialEngine, direction: Direction) -> float:
    """How far the gripper comes in two ticks of that direction, the fingers and the arm's own business over."""
    while not engine.finished and engine.view().phase != "operating":
        engine.tick(UserInput())
    before = engine.world.position_world_gripper_m
    for _ in range(2):
        if engine.finished or engine.view().phase != "operating":
            return math.inf
        engine.tick(push(direction))
    return math.dist(before, engine.world.position_world_gripper_m)


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_way_out_moves_the_arm_within_two_ticks(condition: Condition) -> None:
    robot = BulletRobot()
    for seed in range(DRIVES // len(CONDITIONS)):
        engine = opened(trial_setup(condition), robot)
        drive(engine, np.random.default_rng((seed, CONDITIONS.index(condition))))
        moved_m = [way_m(engine, direction) for direction in WAYS_OUT]
        assert max(moved_m) > FREE_M, f"seed {seed}: {moved_m}"
    robot.close()
