"""Driving a robot as its checks do: straight ways, and a pick-and-place along the ways that layouts keep free."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from sim.interface import TICK_S, Robot, SceneSpec, Vector3, WorldState, run_tick, steady, still
from sim.layouts import LIFT_M, Layout

SPEED_M_S = 0.04
SETTLE_TICKS = 12
START_JOINTS_RAD = (0.0, -0.0496075630, 0.0, 1.9569446115, 0.0, -1.9073370485, 0.0)
"""The posture in which every robot starts: that of `sim.ik` at `fetch.START_POSITION_M`."""


def drive(robot: Robot, target_m: Vector3, speed_m_s: float = SPEED_M_S) -> WorldState:
    """Straight to a position, from where the gripper is now; stops trying when blocked or lagging."""
    here_m = robot.observe().position_world_gripper_m
    way_m = math.dist(here_m, target_m)
    ticks = math.ceil(way_m / (speed_m_s * TICK_S) - 1e-9)
    for _ in range(ticks):
        direction = [(there - here) / way_m for here, there in zip(here_m, target_m, strict=True)]
        verdict, state = run_tick(robot, steady(direction, way_m / ticks / TICK_S))
        if verdict.blocked or state.lagging:
            break
    return robot.observe()


def move_gripper(robot: Robot, action: str) -> WorldState:
    """Open or close; takes two ticks."""
    assert action in ("open", "close")
    run_tick(robot, still("open" if action == "open" else "close"))
    return run_tick(robot, still())[1]


def settle(robot: Robot, object_id: str) -> WorldState:
    """Wait until an object has settled, at most `SETTLE_TICKS`."""
    for _ in range(SETTLE_TICKS):
        if robot.observe().object(object_id).settled:
            break
        run_tick(robot, still())
    return robot.observe()


def way_in(layout: Layout, grasp_m: Vector3) -> Iterator[Vector3]:
    """Line up in front of the object in the aisle, then straight in."""
    yield (layout.aisle_x_m, grasp_m[1], grasp_m[2])
    yield grasp_m


def way_out(layout: Layout, grasp_m: Vector3, release_m: Vector3) -> Iterator[Vector3]:
    """Up, back to the aisle, along it, on to the bin."""
    z_m = grasp_m[2] + LIFT_M
    yield (grasp_m[0], grasp_m[1], z_m)
    yield (layout.aisle_x_m, grasp_m[1], z_m)
    yield (layout.aisle_x_m, release_m[1], z_m)
    yield release_m


@dataclass(frozen=True)
class Outcome:
    """What a pick-and-place came to: what was held after closing, lifting and carrying, and the end."""

    grasped: str | None
    lifted_m: float
    carried: str | None
    end: WorldState


def pick_and_place(robot: Robot, layout: Layout, scene: SceneSpec, object_id: str, bin_id: str) -> Outcome:
    """One cycle from a fresh world."""
    robot.reset(scene)
    grasp_m = robot.observe().object(object_id).grasp_world_m
    for target_m in way_in(layout, grasp_m):
        drive(robot, target_m)
    grasped = move_gripper(robot, "close").held
    steps = way_out(layout, grasp_m, scene.bin(bin_id).release_world_m)
    lifted = drive(robot, next(steps)).object(object_id).pose.position_world_m[2]
    for target_m in steps:
        drive(robot, target_m)
    carried = robot.observe().held
    move_gripper(robot, "open")
    rest_m = scene.object(object_id).rest_pose.position_world_m
    return Outcome(grasped, lifted - rest_m[2], carried, settle(robot, object_id))
