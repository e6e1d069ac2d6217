"""The physics behind the contract: our URDF, contact, pressing, separate worlds, repeatability in another process."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet
import pytest

from app.contracts.driving import SPEED_M_S, drive, move_gripper, settle, way_in, way_out
from sim import fetch, ik, layouts, urdf
from sim.bullet import BulletRobot
from sim.interface import SceneSpec, run_tick, steady, still
from sim.physical import FINGER_FRICTION
from tests.support.robot_cases import reachable
from tests.support.shipped_world import LAYOUTS, STUDY_OBJECTS

pytestmark = pytest.mark.bullet

ROOT = Path(__file__).resolve().parents[2]
ARC = LAYOUTS["arc"]
IDS = list(STUDY_OBJECTS)


@pytest.fixture
def robot() -> Iterator[BulletRobot]:
    with BulletRobot() as made:
        yield made


@pytest.mark.parametrize("static_links", [True, False])
def test_urdf_and_forward_kinematics_agree_on_every_link(tmp_path: Path, static_links: bool) -> None:
    file = tmp_path / "fetch.urdf"
    file.write_text(urdf.fetch_urdf(static_links=static_links), encoding="utf-8")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        arm = pybullet.loadURDF(str(file), useFixedBase=True, physicsClientId=client)
        infos = [pybullet.getJointInfo(arm, i, physicsClientId=client) for i in range(pybullet.getNumJoints(arm))]
        joint = {info[1].decode(): info[0] for info in infos}
        link = {info[12].decode(): info[0] for info in infos}
        static = {frame.name for frame in fetch.FIXED_FRAMES}
        assert set(link) == set(fetch.LINK_NAMES) - {"base_link"} - (set() if static_links else static)
        rng = np.random.default_rng(0)
        points = rng.uniform(ik.WORKSPACE_LOW_M, ik.WORKSPACE_HIGH_M, size=(20, 3))
        for angles_rad in ik.solve_many(points[reachable(points)])[0]:
            finger_m = float(rng.uniform(0.0, fetch.FINGER_TRAVEL_M))
            for name, angle_rad in zip(fetch.ARM_JOINT_NAMES, angles_rad, strict=True):
                pybullet.resetJointState(arm, joint[name], angle_rad, physicsClientId=client)
            for name in urdf.FINGER_JOINTS.values():
                pybullet.resetJointState(arm, joint[name], finger_m, physicsClientId=client)
            expected = fetch.link_poses(tuple(angles_rad), 2.0 * finger_m)
            for name, index in link.items():
                state = pybullet.getLinkState(arm, index, computeForwardKinematics=1, physicsClientId=client)
                x, y, z, w = state[5]
                position, quaternion = expected[name]
                assert state[4] == pytest.approx(position, abs=1e-6)
                assert abs(np.dot((w, x, y, z), quaternion)) == pytest.approx(1.0, abs=1e-6)
    finally:
        pybullet.disconnect(physicsClientId=client)


def test_urdf_states_the_published_limits(tmp_path: Path) -> None:
    file = tmp_path / "fetch.urdf"
    file.write_text(urdf.fetch_urdf(), encoding="utf-8")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        arm = pybullet.loadURDF(str(file), useFixedBase=True, physicsClientId=client)
        infos = [pybullet.getJointInfo(arm, i, physicsClientId=client) for i in range(pybullet.getNumJoints(arm))]
    finally:
        pybullet.disconnect(physicsClientId=client)
    by_name = {info[1].decode(): info for info in infos}
    for joint in fetch.ARM_JOINTS:
        info = by_name[joint.name]
        if math.isfinite(joint.upper_rad):
            assert info[8:10] == pytest.approx((joint.lower_rad, joint.upper_rad))
        assert info[10:12] == pytest.approx((joint.effort_n_m, joint.velocity_rad_s))
    for name in urdf.FINGER_JOINTS.values():
        assert by_name[name][2] == pybullet.JOINT_PRISMATIC
        assert by_name[name][8:10] == pytest.approx((0.0, fetch.FINGER_TRAVEL_M))


def test_fingers_centre_an_object_that_stands_to_one_side(robot: BulletRobot) -> None:
    scene = layouts.scene(ARC, {2: "absorbent_can"})
    robot.reset(scene)
    x, y, z = robot.observe().objects[0].grasp_world_m
    for target in way_in(ARC, (x, y + 0.012, z)):
        drive(robot, target)
    state = move_gripper(robot, "close")
    assert state.held == "absorbent_can"
    # It may lean a little: pushed at grasp height it tips rather than slides.
    assert state.objects[0].grasp_world_m[1] == pytest.approx(state.position_world_gripper_m[1], abs=0.004)


def test_holding_is_friction_a_slippery_object_stays_on_the_table(robot: BulletRobot) -> None:
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
def test_a_long_carry_does_not_let_the_object_slip(robot: BulletRobot, object_id: str) -> None:
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


def pressing_n(robot: BulletRobot) -> list[float]:
    """How hard each finger presses on the first object."""
    body, client = robot._bodies[0].body, robot._client
    return [
        sum(contact[9] for contact in pybullet.getContactPoints(robot._arm, body, finger, physicsClientId=client))
        for finger in robot._fingers
    ]


def test_the_grip_is_as_firm_while_something_else_falls(robot: BulletRobot) -> None:
    robot.reset(layouts.scene(ARC, {2: "wipes_tub", 5: "spray_bottle"}))
    for target in way_in(ARC, robot.observe().objects[0].grasp_world_m):
        drive(robot, target)
    move_gripper(robot, "close")
    robot.command(still())
    other, client = robot._bodies[1].body, robot._client
    pybullet.changeDynamics(other, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP, physicsClientId=client)
    robot.advance()  # awake from its end on
    pybullet.resetBaseVelocity(other, (0.0, -1.0, 1.5), physicsClientId=client)
    forces_n = []
    for _ in range(30):
        robot.advance()
        forces_n += pressing_n(robot)
    assert robot.observe().objects[1].pose.position_world_m[2] < ARC.table.top_z_m
    assert forces_n == pytest.approx([urdf.FINGER_FORCE_N] * 60, rel=0.1)


@pytest.mark.parametrize("object_id", ["sponge_pack", "absorbent_can"])
def test_fingers_press_as_hard_as_stated_and_hold_what_friction_holds(robot: BulletRobot, object_id: str) -> None:
    scene = layouts.scene(ARC, {2: object_id})
    robot.reset(scene)
    grasp_m = robot.observe().objects[0].grasp_world_m
    for target in way_in(ARC, grasp_m):
        drive(robot, target)
    move_gripper(robot, "close")
    drive(robot, (grasp_m[0], grasp_m[1], grasp_m[2] + 0.1))
    body, client = robot._bodies[0].body, robot._client
    assert pressing_n(robot) == pytest.approx([urdf.FINGER_FORCE_N] * 2, rel=0.03)
    # Pulled down, 5 N more a second: each finger's friction is its force times the object's coefficient.
    spec = scene.objects[0].spec
    height_m = robot.observe().objects[0].pose.position_world_m[2]
    pull_n = 0.0
    while (here_m := robot.observe().objects[0].pose.position_world_m)[2] > height_m - 0.005 and pull_n < 50.0:
        pybullet.applyExternalForce(body, -1, (0.0, 0.0, -pull_n), here_m, pybullet.WORLD_FRAME, physicsClientId=client)
        pybullet.stepSimulation(physicsClientId=client)
        pull_n += 5.0 / 120.0
    held_n = 2.0 * urdf.FINGER_FORCE_N * FINGER_FRICTION * spec.friction
    assert pull_n + 9.81 * spec.mass_kg == pytest.approx(held_n, rel=0.1)


def test_what_falls_into_a_bin_lands_on_the_floor_not_in_it(robot: BulletRobot) -> None:
    scene = layouts.scene(ARC, {0: "sponge_pack"})
    robot.reset(scene)
    grasp_m = robot.observe().objects[0].grasp_world_m
    for target in way_in(ARC, grasp_m):
        drive(robot, target)
    move_gripper(robot, "close")
    for target in way_out(ARC, grasp_m, scene.bins[0].release_world_m):
        drive(robot, target)
    fall_m = robot.observe().objects[0].pose.position_world_m[2] - scene.objects[0].spec.size_m[2] / 2.0
    robot.command(still("open"))
    depths_m = []
    for _ in range(3 * 15):
        robot.advance()
        contacts = pybullet.getContactPoints(robot._bodies[0].body, physicsClientId=robot._client)
        depths_m += [-contact[8] for contact in contacts]
    assert robot.observe().objects[0].pose.position_world_m[2] < 0.1
    # No deeper than it falls in one of the short steps.
    assert 0.0 < max(depths_m) < math.sqrt(2.0 * 9.81 * fall_m) / 240.0


def test_pressing_freezes_the_command_instead_of_winding_it_up(robot: BulletRobot) -> None:
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


def test_two_worlds_do_not_touch(robot: BulletRobot) -> None:
    scene = layouts.scene(ARC, IDS)
    command = steady((1.0, 0.0, 0.0), SPEED_M_S)
    robot.reset(scene)
    alone = [run_tick(robot, command)[1].digest() for _ in range(3)]
    robot.reset(scene)
    with BulletRobot() as other:
        other.reset(layouts.practice_scene(ARC))
        beside = []
        for _ in range(3):
            robot.command(command)
            other.command(still("close"))
            for _ in range(15):
                robot.advance()
                other.advance()
            beside.append(robot.observe().digest())
    assert beside == alone


def test_close_ends_the_connection() -> None:
    robot = BulletRobot()
    robot.reset(layouts.practice_scene(ARC))
    client = robot._client
    robot.close()
    assert not pybullet.getConnectionInfo(client)["isConnected"]


def test_an_object_on_the_rim_of_a_bin_settles_somewhere(robot: BulletRobot) -> None:
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


SCRIPT = """
import json
from sim import layouts, objects
from sim.bullet import BulletRobot
from tests.sim.test_bullet import digests
print(json.dumps(digests()))
"""


def digests() -> list[str]:
    """States of a scene in which an object is grasped, lifted, turned over another and dropped."""
    scene: SceneSpec = layouts.scene(ARC, IDS)
    with BulletRobot() as robot:
        robot.reset(scene)
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
    return seen


def test_same_states_bit_for_bit_in_another_process() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == digests()
