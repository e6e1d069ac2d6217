"""What the robot must not do by itself: push standing objects over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.autonomy.actions import ACTION_COUNT, NULL_ACTION, UNIT_DIRECTIONS
from sim.clearance import clearance
from sim.interface import SceneSpec, WorldState, run_tick, steady, still
from sim.kinematic import KinematicRobot
from sim.layouts import scene
from tests.support.shipped_world import LAYOUTS

PLACEMENT = ("spray_bottle", "bleach_bottle", "paper_towels", "wipes_tub", "absorbent_can", "sponge_pack")
STEP_M = 0.02
WAYS_M = STEP_M * UNIT_DIRECTIONS


def table_scene(start_m: tuple[float, float, float]) -> SceneSpec:
    return replace(scene(LAYOUTS["arc"], PLACEMENT), start_world_m=start_m)


def world_at(spec: SceneSpec) -> WorldState:
    robot = KinematicRobot()
    robot.reset(spec)
    return robot.observe()


def clear(world: WorldState, spec: SceneSpec, ways_m: np.ndarray) -> np.ndarray:
    """Which of the displacements, shape (N, 3), push nothing over; shape (N,)."""
    allows = clearance(world, spec)
    return np.array([allows((x_m, y_m, z_m)) for x_m, y_m, z_m in ways_m.tolist()])


def test_far_from_everything_all_is_clear() -> None:
    spec = table_scene((0.65, 0.0, 0.88))
    assert clear(world_at(spec), spec, WAYS_M).all()


def test_beside_an_object_it_does_not_push_into_it() -> None:
    x_m, y_m = LAYOUTS["arc"].places[0]
    spec = table_scene((x_m - 0.04, y_m + 0.105, 0.85))
    fits = clear(world_at(spec), spec, np.array([[0.0, -STEP_M, 0.0], [0.0, STEP_M, 0.0], [-STEP_M, 0.0, 0.0]]))
    assert fits.tolist() == [False, True, True]


def test_lined_up_it_may_move_in() -> None:
    x_m, y_m = LAYOUTS["arc"].places[2]
    spec = table_scene((x_m - 0.08, y_m, 0.85))
    assert clear(world_at(spec), spec, np.array([[STEP_M, 0.0, 0.0]])).all()


def test_above_an_object_there_is_room() -> None:
    x_m, y_m = LAYOUTS["arc"].places[2]
    spec = table_scene((x_m - 0.02, y_m - 0.05, 1.04))
    assert clear(world_at(spec), spec, np.array([[0.0, STEP_M, 0.0]])).all()


def test_what_is_too_near_already_may_always_stay_and_never_come_nearer() -> None:
    x_m, y_m = LAYOUTS["arc"].places[2]
    spec = table_scene((x_m, y_m + 0.09, 0.85))
    fits = clear(world_at(spec), spec, WAYS_M)
    assert fits[NULL_ACTION]
    assert not clear(world_at(spec), spec, np.array([[0.0, -STEP_M / 4, 0.0]])).any()


@pytest.mark.parametrize("seed", range(8))
def test_an_arm_that_only_does_what_is_clear_knocks_nothing_over(seed: int) -> None:
    rng = np.random.default_rng(seed)
    spec = table_scene((0.70, 0.0, 0.88))
    robot = KinematicRobot()
    robot.reset(spec)
    moved = 0
    for _ in range(120):
        world = robot.observe()
        towards = UNIT_DIRECTIONS @ (np.array(world.objects[2].grasp_world_m) - world.position_world_gripper_m)
        fits = clear(world, spec, WAYS_M) & robot.feasible(WAYS_M)
        pick = np.where(fits, towards + 0.3 * rng.standard_normal(ACTION_COUNT), -np.inf).argmax()
        run_tick(robot, steady(UNIT_DIRECTIONS[pick], STEP_M / 0.5))
        moved += bool(np.any(UNIT_DIRECTIONS[pick]))
    assert moved > 30
    assert all(item.pose.tilt_rad == 0.0 for item in robot.observe().objects)


def test_what_is_carried_keeps_away_too() -> None:
    x_m, y_m = LAYOUTS["arc"].places[2]
    spec = table_scene((x_m, y_m, 0.85))
    robot = KinematicRobot()
    robot.reset(spec)
    run_tick(robot, still("close"))
    _, world = run_tick(robot, still())
    assert world.held == PLACEMENT[2]
    sideways = np.array([[0.0, -STEP_M, 0.0]])
    assert clear(world, spec, sideways).all()
    for _ in range(4):
        _, world = run_tick(robot, steady((0.0, -1.0, 0.0), STEP_M / 0.5))
    assert not clear(world, spec, sideways).any()
