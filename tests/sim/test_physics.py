"""What the contract leaves to physics, on each engine: friction, pressing, two worlds, the same in another process."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.contracts.driving import SPEED_M_S, drive, move_gripper, settle, way_in, way_out
from app.trial.robots import ROBOTS, make_robot
from sim import fetch, layouts
from sim.interface import Robot, SceneSpec, run_tick, steady, still
from tests.support.shipped_world import LAYOUTS, STUDY_OBJECTS

ROOT = Path(__file__).resolve().parents[2]
ARC = LAYOUTS["arc"]
IDS = list(STUDY_OBJECTS)


@pytest.fixture(params=[pytest.param(name, marks=getattr(pytest.mark, name)) for name in ROBOTS.libraries])
def name(request: pytest.FixtureRequest) -> str:
    """A robot with physics."""
    return str(request.param)


@pytest.fixture
def robot(name: str) -> Iterator[Robot]:
    made = make_robot(name)
    yield made
    made.close()


def test_fingers_centre_an_object_that_stands_to_one_side(robot: Robot) -> None:
    robot.reset(layouts.scene(ARC, {2: "absorbent_can"}))
    x, y, z = robot.observe().objects[0].grasp_world_m
    for target in way_in(ARC, (x, y + 0.012, z)):
        drive(robot, target)
    state = move_gripper(robot, "close")
    assert state.held == "absorbent_can"
    # It may lean a little: pushed at grasp height it tips rather than slides.
    assert state.objects[0].grasp_world_m[1] == pytest.approx(state.position_world_gripper_m[1], abs=0.004)


def test_holding_is_friction_a_slippery_object_stays_on_the_table(robot: Robot) -> None:
    scene = layouts.scene(ARC, {2: "bleach_bottle"})
    (placed,) = scene.objects
    for friction, lifted in ((placed.spec.friction, True), (0.02, False)):
        slippery = replace(placed, spec=replace(placed.spec, friction=friction))
        robot.reset(replace(scene, objects=(slippery,)))
        grasp_m = robot.observe().objects[0].grasp_world_m
        for target in way_in(ARC, grasp_m):
            drive(robot, target)
        move_gripper(robot, "close")
        drive(robot, (grasp_m[0], grasp_m[1], grasp_m[2] + 0.15))
        state = robot.observe()
        assert (state.held == "bleach_bottle") == lifted
        assert (state.objects[0].pose.position_world_m[2] > placed.rest_pose.position_world_m[2] + 0.1) == lifted


@pytest.mark.parametrize("object_id", ["bleach_bottle", "sponge_pack", "absorbent_can"])
def test_a_long_carry_does_not_let_the_object_slip(robot: Robot, object_id: str) -> None:
    scene = layouts.scene(ARC, {2: object_id})
    robot.reset(scene)
    grasp_m = robot.observe().objects[0].grasp_world_m
    for target in way_in(ARC, grasp_m):
        drive(robot, target)
    before = move_gripper(robot, "close")
    for target in way_out(ARC, grasp_m, scene.bins[1].release_world_m):
        drive(robot, target, 0.08)
    after = robot.observe()
    assert after.held == object_id
    offsets = [np.subtract(s.objects[0].pose.position_world_m, s.position_world_gripper_m) for s in (before, after)]
    assert np.linalg.norm(offsets[1] - offsets[0]) < 0.004


def test_pressing_freezes_the_command_instead_of_winding_it_up(robot: Robot) -> None:
    high = replace(ARC.table, center_world_m=(0.90, 0.0, 0.78))  # its top is 1 cm above the lowest gripper position
    robot.reset(SceneSpec(high, (), (), (0.80, 0.0, 0.88)))
    states = [run_tick(robot, steady((0.0, 0.0, -1.0), SPEED_M_S))[1] for _ in range(20)]
    assert states[-1].lagging
    pressed_m = states[-1].position_world_gripper_m[2]
    assert pressed_m == pytest.approx(high.top_z_m + fetch.PALM_SIZE_M[2] / 2.0, abs=0.01)  # it did not go through
    # Moving away takes effect at once, though the reach would have let the command go 5 cm deeper.
    verdict, state = run_tick(robot, steady((0.0, 0.0, 1.0), SPEED_M_S))
    assert (verdict.blocked, state.lagging) == (False, False)
    state = run_tick(robot, steady((0.0, 0.0, 1.0), SPEED_M_S))[1]
    assert state.position_world_gripper_m[2] > pressed_m + 0.015


def test_what_was_pressed_is_not_feasible_until_the_robot_begins_anew(robot: Robot) -> None:
    (x_m, y_m), finger_m = ARC.places[2], fetch.MAX_OPENING_M / 2.0 + fetch.FINGER_SIZE_M[1] / 2.0
    over_m = (x_m, y_m - finger_m, 1.0)
    world = replace(layouts.scene(ARC, tuple(IDS)), start_world_m=over_m)  # a finger is over an object
    robot.reset(world)
    assert any(run_tick(robot, steady((0.0, 0.0, -1.0), 0.04))[1].lagging for _ in range(20)), "nothing stopped it"
    down, up = np.array([[0.0, 0.0, -0.02]]), np.array([[0.0, 0.0, 0.02]])
    assert not robot.feasible(down)[0]
    assert robot.feasible(up)[0]
    robot.reset(world)
    assert robot.feasible(down)[0]


def test_two_worlds_do_not_touch(name: str, robot: Robot) -> None:
    scene = layouts.scene(ARC, IDS)
    command = steady((1.0, 0.0, 0.0), SPEED_M_S)
    robot.reset(scene)
    alone = [run_tick(robot, command)[1].digest() for _ in range(3)]
    robot.reset(scene)
    other = make_robot(name)
    other.reset(layouts.practice_scene(ARC))
    beside = []
    for _ in range(3):
        robot.command(command)
        other.command(still("close"))
        for _ in range(15):
            robot.advance()
            other.advance()
        beside.append(robot.observe().digest())
    other.close()
    assert beside == alone


def test_an_object_on_the_rim_of_a_bin_settles_somewhere(robot: Robot) -> None:
    """Dropped half over the wall, it falls in or out, and is seen to be at rest wherever that is."""
    scene = layouts.scene(ARC, {0: "spray_bottle"})
    robot.reset(scene)
    grasp_m = robot.observe().objects[0].grasp_world_m
    left = scene.bins[0]
    rim_m = (left.center_xy_m[0], left.center_xy_m[1] - left.inner_size_m[1] / 2.0, 0.90)
    for target in way_in(ARC, grasp_m):
        drive(robot, target)
    move_gripper(robot, "close")
    for target in way_out(ARC, grasp_m, rim_m):
        drive(robot, target)
    assert robot.observe().held == "spray_bottle"
    move_gripper(robot, "open")
    end = settle(robot, "spray_bottle").objects[0]
    assert end.settled
    assert end.pose.position_world_m[2] < left.height_m + 0.12


def digests(name: str) -> list[str]:
    """States of a scene in which an object is grasped, lifted, turned over another and dropped."""
    robot = make_robot(name)
    robot.reset(layouts.scene(ARC, IDS))
    grasp_m = robot.observe().object("wipes_tub").grasp_world_m
    for target in way_in(ARC, grasp_m):
        drive(robot, target, 0.08)
    move_gripper(robot, "close")
    seen = [robot.observe().digest()]
    for direction in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0)):
        seen.append(run_tick(robot, steady(direction, 0.08))[1].digest())
    for _ in range(4):
        seen.append(run_tick(robot, still("open"))[1].digest())
    assert robot.observe().object("paper_towels").pose.tilt_rad > 0.01  # the neighbour was hit
    robot.close()
    return seen


def test_same_states_bit_for_bit_in_another_process(name: str) -> None:
    script = f"import json; from tests.sim.test_physics import digests; print(json.dumps(digests({name!r})))"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == digests(name)


def test_what_is_held_stays_where_it_is_held(robot: Robot) -> None:
    robot.reset(layouts.scene(ARC, {2: "sponge_pack"}))
    grasp_m = robot.observe().objects[0].grasp_world_m
    for target in way_in(ARC, grasp_m):
        drive(robot, target)
    move_gripper(robot, "close")
    drive(robot, (grasp_m[0], grasp_m[1], grasp_m[2] + 0.1))
    before_m = run_tick(robot, still())[1].objects[0].pose.position_world_m
    for _ in range(40):
        state = run_tick(robot, still())[1]
    assert state.held == "sponge_pack"
    assert math.dist(before_m, state.objects[0].pose.position_world_m) < 2e-4  # contacts that give would creep for ever


FORKED = """
import json, multiprocessing
import sim.bullet_ready
from tests.sim.test_physics import digests

with multiprocessing.get_context("fork").Pool(2) as pool:
    found = pool.map(digests, ["bullet"] * 2, chunksize=1)
print(json.dumps([*found, digests("bullet")]))
"""


@pytest.mark.bullet
def test_who_is_forked_with_a_connection_that_was_ready_moves_the_robot_the_same() -> None:
    done = subprocess.run([sys.executable, "-c", FORKED], cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == [digests("bullet")] * 3


@pytest.mark.bullet
def test_a_connection_that_was_ready_is_taken_once() -> None:
    import pybullet

    from sim.bullet import Connections

    connections = Connections()
    connections.make_ready()
    taken = [connections.take() for _ in range(3)]
    assert len(set(taken)) == 3
    for client in taken:
        pybullet.disconnect(physicsClientId=client)
