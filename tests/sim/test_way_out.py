"""An arm that was pressed against something comes free again: whatever was done before, every way out moves it.

A part of the drives each run, on each physics; all 540 with `SALAB_FULL_SWEEP=1`.
"""

from __future__ import annotations

import contextlib
import math
import os
from dataclasses import dataclass

import pytest

from app.autonomy.actions import Direction
from app.trial.engine import TrialEngine
from tests.support.engine_cases import HANDS_OFF, push
from tests.support.rough_drives import MOVES, Drive, ProbedRobot, driven

FULL = bool(os.environ.get("SALAB_FULL_SWEEP"))

STEPS = {"bullet": 23, "mujoco": 47}
"""Every so many-th drive. They share no factor with the number of combinations: a part has every layout, condition and
beginning."""
JAMMED = {"bullet": (), "mujoco": (276, 414)}
"""Drives that once left the arm a millimetre out of its workspace, where no way out began."""
FREE_M = 0.005
"""In two ticks. What drags a bottle along is pressed, and comes on."""
HELD_TICKS = 8
"""So long each direction is held in the full search; two ticks in the part of it."""
PRESSED_TICKS = 3
ALONE_TICKS = 40


@dataclass
class Found:
    """What one direction did: how far it came in two ticks, and the longest stretch it stood, though it leads away."""

    moved_m: float
    pressed_ticks: int = 0

    @property
    def is_jam(self) -> bool:
        return self.moved_m <= FREE_M or self.pressed_ticks > PRESSED_TICKS


def hold(engine: TrialEngine, robot: ProbedRobot, direction: Direction) -> Found | None:
    """None for a direction that leads into something, or out of reach, or when the task ends with it."""
    if not robot.leads_away(direction):
        return None
    before, found, pressed = engine.world.position_world_gripper_m, Found(math.inf), 0
    for tick in range(HELD_TICKS if FULL else 2):
        leads_away, here = robot.leads_away(direction), engine.world.position_world_gripper_m
        result = engine.tick(push(direction))
        if result.tasks or engine.finished or engine.view().phase != "operating":
            return found if tick > 1 else None
        if result.row.blocked and not engine.world.lagging:
            return found if tick > 1 else None  # the end of its reach
        stands = math.dist(here, engine.world.position_world_gripper_m) <= FREE_M / 2
        pressed = pressed + 1 if result.row.blocked and leads_away and stands else 0
        found.pressed_ticks = max(found.pressed_ticks, pressed)
        if tick == 1:
            found.moved_m = math.dist(before, engine.world.position_world_gripper_m)
    return found


def alone(engine: TrialEngine) -> int:
    """The longest stretch of ticks in which the robot, hands off, went on pressing against something."""
    longest = pressed = 0
    for _ in range(ALONE_TICKS):
        if engine.finished or engine.view().phase != "operating":
            break
        result = engine.tick(HANDS_OFF)
        pressed = pressed + 1 if result.row.source == "robot" and result.row.blocked else 0
        longest = max(longest, pressed)
    return longest


def probed(name: str) -> ProbedRobot:
    """That robot, to be put back."""
    if name == "mujoco":
        from tests.support.probed_mujoco import ProbedMujoco

        return ProbedMujoco()
    from tests.support.probed_bullet import ProbedBullet

    return ProbedBullet()


PARTS = [
    pytest.param(name, part, marks=getattr(pytest.mark, name), id=f"{name}-{part}")
    for name, parts in (("bullet", 6), ("mujoco", 3))
    for part in range(parts)
]


@pytest.mark.parametrize(("name", "part"), PARTS)
def test_every_way_out_moves_the_arm_within_two_ticks_and_alone_it_does_not_press_on(name: str, part: int) -> None:
    parts = sum(1 for one in PARTS if one.values[0] == name)
    seeds = sorted({*range(0, 540, 1 if FULL else STEPS[name]), *JAMMED[name]})[part::parts]
    robot = probed(name)
    jams: list[tuple[Drive, Direction | None, Found]] = []
    ways, least_m, longest, longest_alone = 0, math.inf, 0, 0
    for drive in map(Drive, seeds):
        engine, _ = driven(drive, robot)
        if engine.finished:
            continue
        suspects: list[tuple[Direction, Found]] = []
        with contextlib.closing(robot.states(engine)) as states:
            for direction in MOVES:
                found = hold(next(states), robot, direction)
                if found is not None:
                    ways += 1
                    least_m, longest = min(least_m, found.moved_m), max(longest, found.pressed_ticks)
                    if found.is_jam:
                        suspects.append((direction, found))
            pressed = alone(next(states))
            longest_alone = max(longest_alone, pressed)
            if pressed > PRESSED_TICKS:
                jams.append((drive, None, Found(0.0, pressed)))
        for direction, _ in suspects:  # a state put back is almost the one that was: the drive itself has the last word
            engine, _ = driven(drive, robot)
            again = hold(engine, robot, direction)
            if again is not None and again.is_jam:
                jams.append((drive, direction, again))
    robot.close()
    print(f"{ways} ways out: least moved {least_m * 1e3:.1f} mm, pressed {longest} ticks; alone {longest_alone} ticks")
    assert not jams
    assert ways > len(seeds)
