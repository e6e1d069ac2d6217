"""Figures of the arm and the grip on each physics: how near the way, how far objects slip. See tests/bench."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from app.contracts.driving import drive, move_gripper, way_in, way_out
from app.contracts.robot import tilt_rad
from app.trial.robots import ROBOTS, make_robot
from sim import ik, layouts
from sim.interface import SLICES_PER_TICK, TICK_S, Robot, SceneSpec, WorldState, run_tick, steady, still
from tests.bench.figure import Figure
from tests.support.shipped_world import ARC, STUDY_OBJECTS

TICKS = 400
TICKS_A_WAY = 6
CARRY_M_S = 0.08
HOLD_S = 60.0
SEED = 7


def physics_figures() -> Iterator[Figure]:
    """Random ways through the whole reach; each object carried to a bin, and held for a minute."""
    for name in ROBOTS.libraries:
        if lacking := ROBOTS.lacking(name):
            yield Figure(f"{name}: {lacking}", "")
            continue
        robot = make_robot(name)
        for speed_m_s in (0.04, ik.MAX_SPEED_M_S):
            away_m, most_rad = _walk(robot, speed_m_s)
            median_mm, p99_mm, max_mm = (1e3 * float(value) for value in np.percentile(away_m, (50, 99, 100)))
            yield Figure(
                f"{name}: off the way at {speed_m_s:g} m/s, median, p99, max",
                f"{median_mm:.2f}, {p99_mm:.2f}, {max_mm:.2f} mm",
            )
            yield Figure(f"{name}: tilt of the hand at {speed_m_s:g} m/s, max", f"{math.degrees(most_rad):.3f} deg")
        slips = [_slip_mm(robot, layouts.scene(ARC, {2: object_id})) for object_id in STUDY_OBJECTS]
        carry_mm, hold_mm = zip(*slips, strict=True)
        yield Figure(
            f"{name}: slip over a carry at {CARRY_M_S:g} m/s", f"{min(carry_mm):.2f} to {max(carry_mm):.2f} mm"
        )
        yield Figure(f"{name}: slip in {HOLD_S:.0f} s of holding", f"{min(hold_mm):.2f} to {max(hold_mm):.2f} mm")
        robot.close()


def _walk(robot: Robot, speed_m_s: float) -> tuple[list[float], float]:
    """How far off its way the gripper is after each slice, and how far it ever tilts."""
    rng = np.random.default_rng(SEED)
    robot.reset(SceneSpec(ARC.table, ARC.bins, (), layouts.practice_scene(ARC).start_world_m))
    expected_m = np.array(robot.observe().position_world_gripper_m)
    away_m, most_rad = [], 0.0
    for tick in range(TICKS):
        if tick % TICKS_A_WAY == 0:
            direction = rng.integers(-1, 2, size=3).astype(float)
            direction /= max(float(np.linalg.norm(direction)), 1.0)
        verdict = robot.command(steady(direction.tolist(), speed_m_s))
        for segment in verdict.executed:
            for _ in range(segment.slices):
                expected_m = expected_m + np.array(segment.direction) * speed_m_s * TICK_S / SLICES_PER_TICK
                robot.advance()
                away_m.append(math.dist(robot.observe().position_world_gripper_m, expected_m.tolist()))
        most_rad = max(most_rad, tilt_rad(robot.observe()))
    return away_m, most_rad


def _slip_mm(robot: Robot, scene: SceneSpec) -> tuple[float, float]:
    """How far the object moved in the fingers over a carry, and while it was held."""
    robot.reset(scene)
    grasp_m = robot.observe().objects[0].grasp_world_m
    for target_m in way_in(ARC, grasp_m):
        drive(robot, target_m)
    closed = move_gripper(robot, "close")
    for target_m in way_out(ARC, grasp_m, scene.bins[1].release_world_m):
        drive(robot, target_m, CARRY_M_S)
    carried = robot.observe()
    for _ in range(round(HOLD_S / TICK_S)):
        run_tick(robot, still())
    return _moved_mm(closed, carried), _moved_mm(carried, robot.observe())


def _moved_mm(before: WorldState, after: WorldState) -> float:
    held = [np.subtract(s.objects[0].pose.position_world_m, s.position_world_gripper_m) for s in (before, after)]
    return 1e3 * float(np.linalg.norm(held[1] - held[0]))
