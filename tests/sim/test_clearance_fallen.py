"""What the robot must not do by itself with objects that have fallen: come down on one, or drive into one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from app.autonomy.actions import NULL_ACTION, UNIT_DIRECTIONS
from sim import fetch
from sim.clearance import clearance
from sim.interface import ObjectState, Pose, Vector3, WorldState
from sim.kinematic import KinematicRobot
from sim.layouts import scene
from sim.objects import grasp_point
from tests.support.shipped_world import LAYOUTS, STUDY_OBJECTS

Points = NDArray[np.float64]

STEP_M = 0.02
WAYS_M = STEP_M * UNIT_DIRECTIONS
SCENE = scene(LAYOUTS["arc"], tuple(STUDY_OBJECTS))
TOP_M = SCENE.table.top_z_m
MIDDLE_M = (0.85, 0.0)
DOWN, UP, BACK = (0.0, 0.0, -STEP_M), (0.0, 0.0, STEP_M), (-STEP_M, 0.0, 0.0)
APART_M = 0.006
"""The points of an object are as dense as that."""
CARRIED = "sponge_pack"


def fallen(name: str, yaw_rad: float, tilt_rad: float = math.pi / 2.0) -> Pose:
    """At the middle of the table, tilted towards `yaw_rad`."""
    spec = STUDY_OBJECTS[name]
    turn, lean = yaw_rad / 2.0, tilt_rad / 2.0
    quaternion = (
        math.cos(turn) * math.cos(lean),
        -math.sin(turn) * math.sin(lean),
        math.cos(turn) * math.sin(lean),
        math.sin(turn) * math.cos(lean),
    )
    half_m = spec.size_m[0] / 2.0 * math.sin(tilt_rad) + spec.size_m[2] / 2.0 * abs(math.cos(tilt_rad))
    return Pose((*MIDDLE_M, TOP_M + half_m), quaternion)


def world_with(name: str, pose: Pose, gripper_m: Vector3, held: bool = False) -> WorldState:
    """One fallen object, and the gripper somewhere, with something in it or not."""
    robot = KinematicRobot()
    robot.reset(replace(SCENE, start_world_m=gripper_m))
    things = [ObjectState(name, pose, grasp_point(STUDY_OBJECTS[name], pose), True)]
    if held:
        spec = STUDY_OBJECTS[CARRIED]
        x_m, y_m, z_m = gripper_m
        things.append(
            ObjectState(CARRIED, Pose((x_m, y_m, z_m + spec.size_m[2] / 2.0 - spec.grasp_height_m)), gripper_m, False)
        )
    return replace(robot.observe(), objects=tuple(things), held=CARRIED if held else None)


def skin_m(name: str, pose: Pose) -> Points:
    """Points all over an object, shape (N, 3), in the world frame."""
    spec = STUDY_OBJECTS[name]
    half = np.array(spec.size_m) / 2.0
    grid = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, count) for count in (13, 13, 41)]), axis=-1).reshape(-1, 3)
    if spec.shape == "cylinder":
        grid = grid[np.hypot(grid[:, 0], grid[:, 1]) <= 1.0]
    w, *xyz = pose.quaternion_wxyz
    local, vector = grid * half, np.array(xyz)
    turned = local + 2.0 * np.cross(vector, np.cross(vector, local) + w * local)
    points: Points = turned + np.array(pose.position_world_m)
    return points


def depth_m(points: Points, world: WorldState, way_m: Vector3) -> float:
    """How deep the deepest point is inside gripper or carried box after a motion; below 0, how far away it is."""
    here = np.array(world.position_world_gripper_m) + np.array(way_m)
    beside_m = world.finger_opening_m / 2.0 + fetch.FINGER_SIZE_M[1] / 2.0
    boxes = [
        ((fetch.FINGER_CENTER_X_M, beside_m, 0.0), fetch.FINGER_SIZE_M),
        ((fetch.FINGER_CENTER_X_M, -beside_m, 0.0), fetch.FINGER_SIZE_M),
        (fetch.PALM_CENTER_M, fetch.PALM_SIZE_M),
    ]
    if world.held:
        spec = STUDY_OBJECTS[world.held]
        boxes.append(((0.0, 0.0, spec.size_m[2] / 2.0 - spec.grasp_height_m), spec.size_m))
    return max(
        float((np.array(size) / 2.0 - np.abs(points - here - np.array(middle))).min(axis=1).max())
        for middle, size in boxes
    )


def some_worlds(seed: int, count: int) -> list[tuple[str, Pose, WorldState]]:
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        name = str(rng.choice(["spray_bottle", "bleach_bottle", "absorbent_can"]))
        pose = fallen(name, rng.uniform(0.0, 2.0 * math.pi), rng.choice([rng.uniform(0.9, 2.2), math.pi / 2.0]))
        at = (rng.uniform(0.68, 0.93), rng.uniform(-0.25, 0.25), rng.uniform(0.79, 0.95))
        found.append((name, pose, world_with(name, pose, at, held=bool(rng.random() < 0.3))))
    return found


@pytest.mark.parametrize("seed", range(4))
def test_what_is_allowed_touches_nothing_that_has_fallen_and_what_stays_away_is_allowed(seed: int) -> None:
    refused = free = 0
    for name, pose, world in some_worlds(seed, 300):
        points, allows = skin_m(name, pose), clearance(world, SCENE)
        if not -STEP_M < depth_m(points, world, (0.0, 0.0, 0.0)) < -APART_M:
            continue
        for x_m, y_m, z_m in WAYS_M.tolist():
            deepest_m = max(depth_m(points, world, (s * x_m, s * y_m, s * z_m)) for s in (0.5, 1.0))
            if deepest_m > 0.0:
                assert not allows((x_m, y_m, z_m)), (name, pose, world.position_world_gripper_m, (x_m, y_m, z_m))
                refused += 1
            elif deepest_m < -STEP_M:  # more than any margin
                assert allows((x_m, y_m, z_m)), (name, pose, world.position_world_gripper_m, (x_m, y_m, z_m))
                free += 1
    assert min(refused, free) > 30, (refused, free)


@pytest.mark.parametrize("seed", range(4))
def test_an_arm_beside_on_or_in_what_has_fallen_may_stay_and_may_leave(seed: int) -> None:
    """Wherever it is, however it came there, it is never frozen; where a gripper can be in physics, it may go up."""
    beside = 0
    for name, pose, world in some_worlds(seed + 100, 100):
        allows, where = clearance(world, SCENE), (name, pose, world.position_world_gripper_m)
        fits = np.array([allows((x_m, y_m, z_m)) for x_m, y_m, z_m in WAYS_M.tolist()])
        assert fits[NULL_ACTION]
        assert fits.sum() > 1, where
        if -STEP_M < depth_m(skin_m(name, pose), world, (0.0, 0.0, 0.0)) < 0.0 and not world.held:
            beside += 1
            assert fits.sum() >= 9, where
    assert beside > 5


@pytest.mark.parametrize("name", ["spray_bottle", "bleach_bottle"])
@pytest.mark.parametrize("yaw_deg", [0, 30, 90, 135, 200, 300])
def test_over_what_lies_it_goes_everywhere_but_down(name: str, yaw_deg: int) -> None:
    top_m = TOP_M + STUDY_OBJECTS[name].size_m[0]
    palm_on_it_m = MIDDLE_M[0] - fetch.PALM_CENTER_M[0], MIDDLE_M[1], top_m + fetch.PALM_SIZE_M[2] / 2.0 + 0.01
    allows = clearance(world_with(name, fallen(name, math.radians(yaw_deg)), palm_on_it_m), SCENE)
    assert [way for way in WAYS_M.tolist() if not allows((way[0], way[1], way[2]))] == [
        way for way in WAYS_M.tolist() if way[2] < 0.0
    ]


def test_a_finger_that_rests_on_what_lies_is_not_pressed_further_and_is_free_to_go() -> None:
    name = "spray_bottle"
    finger_m = fetch.MAX_OPENING_M / 2.0 + fetch.FINGER_SIZE_M[1] / 2.0
    for into_m in (-0.0005, 0.0, 0.0005, 0.004):
        z_m = TOP_M + STUDY_OBJECTS[name].size_m[0] + fetch.FINGER_SIZE_M[2] / 2.0 - into_m
        on_it_m = (MIDDLE_M[0], MIDDLE_M[1] - finger_m, z_m)
        allows = clearance(world_with(name, fallen(name, 0.0), on_it_m), SCENE)
        assert not allows(DOWN)
        assert allows(UP)


def test_what_is_carried_lying_is_as_long_as_it_lies() -> None:
    """A bottle held across the fingers' way meets what stands beside it long before the fingers do."""
    held, other = "spray_bottle", "wipes_tub"
    gripper_m = (0.80, 0.0, 0.90)
    robot = KinematicRobot()
    robot.reset(replace(SCENE, start_world_m=gripper_m))
    lies = Pose(gripper_m, (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0))
    half_m, radius_m = STUDY_OBJECTS[held].size_m[2] / 2.0, STUDY_OBJECTS[other].size_m[0] / 2.0
    x_m = gripper_m[0] + half_m + radius_m + 0.02
    stands = Pose((x_m, 0.0, gripper_m[2]))
    things = (ObjectState(held, lies, gripper_m, False), ObjectState(other, stands, (x_m, 0.0, 0.9), True))
    allows = clearance(replace(robot.observe(), objects=things, held=held), SCENE)
    assert not allows((STEP_M, 0.0, 0.0))
    assert allows(BACK)
