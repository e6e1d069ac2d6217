"""The stated rules of the robot without physics, each at its edge."""

from __future__ import annotations

import math

import pytest

from app.contracts.driving import SPEED_M_S, drive, move_gripper
from sim import ik, kinematic
from sim.interface import (
    SLICES_PER_TICK,
    ObjectState,
    PlacedObject,
    SceneSpec,
    Vector3,
    run_tick,
    steady,
    still,
)
from sim.kinematic import KinematicRobot
from tests.support.shipped_world import LAYOUTS, OBJECTS

ARC = LAYOUTS["arc"]
TOP_M = ARC.table.top_z_m
WIPES = OBJECTS["wipes_tub"]


def standing_at(x_m: float, y_m: float, *more: PlacedObject) -> SceneSpec:
    """The tub of wipes somewhere on the table, and what else is given."""
    return SceneSpec(ARC.table, ARC.bins, (PlacedObject(WIPES, (x_m, y_m, TOP_M)), *more), ARC.start_world_m)


def close_at(offset_m: Vector3) -> tuple[KinematicRobot, str | None]:
    """Close with the grasp point at `offset_m` from the gripper. The arm starts there: nothing is touched before."""
    robot = KinematicRobot()
    grasp_m = (0.80, 0.0, TOP_M + WIPES.grasp_height_m)
    there = tuple(value - offset for value, offset in zip(grasp_m, offset_m, strict=True))
    scene = standing_at(0.80, 0.0)
    robot.reset(SceneSpec(scene.table, scene.bins, scene.objects, (there[0], there[1], there[2])))
    return robot, move_gripper(robot, "close").held


@pytest.mark.parametrize(
    ("offset_m", "held"),
    [
        ((0.0, 0.0, 0.0), True),
        ((kinematic.GRASP_X_M - 0.001, 0.0, 0.0), True),
        ((kinematic.GRASP_X_M + 0.001, 0.0, 0.0), False),
        ((0.0, 0.013, 0.0), True),
        ((0.0, -0.013, 0.0), True),
        ((0.0, 0.0, kinematic.GRASP_Z_M - 0.001), True),
        ((0.0, 0.0, -kinematic.GRASP_Z_M - 0.001), False),
    ],
)
def test_grasp_tolerances(offset_m: Vector3, held: bool) -> None:
    robot, grasped = close_at(offset_m)
    tub = robot.observe().objects[0]
    assert grasped == ("wipes_tub" if held else None)
    assert (tub.pose.tilt_rad > 1.0) == (not held)  # closing beside it knocks it over
    if held:
        assert robot.observe().finger_opening_m == WIPES.size_m[1]
        assert tub.pose.position_world_m[1] == robot.observe().position_world_gripper_m[1]  # centred
        assert not tub.settled


def test_closing_beyond_the_object_leaves_it_alone() -> None:
    robot, grasped = close_at((0.08, 0.0, 0.0))
    assert grasped is None
    assert robot.observe().objects[0].pose == standing_at(0.80, 0.0).objects[0].rest_pose
    assert robot.observe().finger_opening_m == pytest.approx(0.0, abs=1e-9)


def sweep(scene: SceneSpec, start_m: Vector3, direction: Vector3, ticks: int) -> KinematicRobot:
    """A robot that has moved in one direction from a start in free space."""
    robot = KinematicRobot()
    robot.reset(SceneSpec(scene.table, scene.bins, scene.objects, start_m))
    for _ in range(ticks):
        run_tick(robot, steady(direction, SPEED_M_S))
    return robot


def test_a_touch_within_the_tolerance_leaves_the_object_standing() -> None:
    # Finger's outer face ends at 0.0644 beside the gripper; the tub's radius is 0.036.
    start_m = (0.80, -0.16, TOP_M + 0.10)
    ticks = round((0.16 - 0.0644 - 0.036 + kinematic.KNOCK_DEPTH_M) / (SPEED_M_S * 0.5) - 0.5)
    standing = sweep(standing_at(0.80, 0.0), start_m, (0.0, 1.0, 0.0), ticks).observe().objects[0]
    fallen = sweep(standing_at(0.80, 0.0), start_m, (0.0, 1.0, 0.0), ticks + 1).observe().objects[0]
    assert standing.pose.tilt_rad == 0.0
    assert fallen.pose.tilt_rad == pytest.approx(math.pi / 2)


def test_a_fallen_object_lies_in_the_direction_of_the_push_and_settles_in_a_second() -> None:
    robot = sweep(standing_at(0.80, 0.0), (0.80, -0.12, TOP_M + 0.10), (0.0, 1.0, 0.0), 2)
    tub = robot.observe().objects[0]
    assert tub.pose.position_world_m == pytest.approx((0.80, 0.036 + 0.075, TOP_M + 0.036))
    assert tub.grasp_world_m[1] > tub.pose.position_world_m[1]  # its head points away from the push
    assert not tub.settled
    for _ in range(kinematic.SETTLE_SLICES // SLICES_PER_TICK):
        tub = run_tick(robot, still())[1].objects[0]
    assert tub.settled


def test_an_object_that_falls_past_the_edge_lies_on_the_floor() -> None:
    edge_m = ARC.table.center_world_m[1] + ARC.table.size_m[1] / 2.0
    y_m = edge_m - 0.06
    robot = sweep(standing_at(0.72, y_m), (0.72, y_m - 0.12, TOP_M + 0.12), (0.0, 1.0, 0.0), 2)
    assert robot.observe().objects[0].pose.position_world_m[2] == pytest.approx(0.036)


def test_moving_above_or_far_from_an_object_leaves_it_alone() -> None:
    above = sweep(standing_at(0.75, 0.0), (0.75, -0.15, TOP_M + 0.15 + 0.05), (0.0, 1.0, 0.0), 15)
    assert above.observe().position_world_gripper_m[1] > 0.1
    assert above.observe().objects[0].pose.tilt_rad == 0.0


def test_the_palm_pushes_what_stands_too_deep_between_the_fingers() -> None:
    robot = sweep(standing_at(0.80, 0.0), (0.70, 0.0, TOP_M + 0.11), (1.0, 0.0, 0.0), 8)
    assert robot.observe().objects[0].pose.tilt_rad > 1.0


def carrying(*more: PlacedObject) -> KinematicRobot:
    """A robot that holds the tub of wipes 6 cm above the table at (0.80, 0)."""
    robot = KinematicRobot()
    robot.reset(standing_at(0.80, 0.0, *more))
    x, y, z = robot.observe().objects[0].grasp_world_m
    drive(robot, (0.68, y, z))
    drive(robot, (x, y, z))
    assert move_gripper(robot, "close").held == "wipes_tub"
    drive(robot, (x, y, z + 0.06))
    return robot


def dropped(robot: KinematicRobot) -> ObjectState:
    """The tub after opening the gripper; it takes a second to settle."""
    run_tick(robot, still("open"))
    assert not robot.observe().objects[0].settled
    tub = run_tick(robot, still())[1].objects[0]
    assert tub.settled
    return tub


def test_a_carried_object_moves_with_the_gripper_and_knocks_over_what_is_in_its_way() -> None:
    towels = PlacedObject(OBJECTS["paper_towels"], (0.80, 0.20, TOP_M))
    robot = carrying(towels)
    x, y, z = robot.observe().objects[0].pose.position_world_m
    drive(robot, (0.80, 0.16, robot.observe().position_world_gripper_m[2]))
    tub, roll = robot.observe().objects
    assert tub.pose.position_world_m == pytest.approx((x, y + 0.16, z))
    assert roll.pose.tilt_rad > 1.0


def test_a_drop_from_low_stands_and_from_high_lies() -> None:
    low = carrying()
    drive(low, (0.80, 0.0, TOP_M + WIPES.grasp_height_m + kinematic.STAND_DROP_M - 0.002))
    tub, rest = dropped(low), standing_at(0.80, 0.0).objects[0].rest_pose
    assert tub.pose.position_world_m == pytest.approx(rest.position_world_m)
    assert tub.pose.tilt_rad == 0.0
    high = carrying()
    assert dropped(high).pose.tilt_rad > 1.0


def test_a_drop_over_the_bin_stands_on_its_floor() -> None:
    robot = carrying()
    for target in ((0.67, 0.0, 0.90), (0.67, 0.48, 0.90), ARC.bins[0].release_world_m):
        drive(robot, target)
    tub = dropped(robot)
    assert tub.pose.position_world_m == pytest.approx((0.52, 0.48, WIPES.size_m[2] / 2.0))
    assert tub.pose.tilt_rad == 0.0


def test_a_carried_object_is_not_pushed_into_the_table() -> None:
    robot = carrying()
    lagging = [run_tick(robot, steady((0.0, 0.0, -1.0), SPEED_M_S))[1].lagging for _ in range(4)]
    state = robot.observe()
    assert lagging == [False, False, False, True]
    assert state.objects[0].pose.position_world_m[2] == pytest.approx(TOP_M + WIPES.size_m[2] / 2.0, abs=1e-6)
    verdict, state = run_tick(robot, steady((0.0, 0.0, 1.0), SPEED_M_S))
    assert not verdict.blocked
    assert not state.lagging


def test_reach_is_that_of_the_arm() -> None:
    robot = KinematicRobot()
    robot.reset(standing_at(0.80, 0.0))
    for _ in range(40):
        verdict, state = run_tick(robot, steady((0.0, -1.0, 0.0), SPEED_M_S))
    assert verdict.blocked
    assert verdict.reason == "the arm cannot stretch further"
    assert ik.solve(state.position_world_gripper_m)[1] == 0
