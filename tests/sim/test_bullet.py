"""What pybullet alone can be asked: our URDF as it reads it, forces between bodies, how deep one is in another."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet
import pytest

from app.contracts.driving import drive, move_gripper, way_in, way_out
from sim import fetch, ik, layouts, urdf
from sim.bullet import BulletRobot
from sim.interface import still
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
        infos = [
            pybullet.getJointInfo(arm, i, physicsClientId=client)
            for i in range(pybullet.getNumJoints(arm, physicsClientId=client))
        ]
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
        infos = [
            pybullet.getJointInfo(arm, i, physicsClientId=client)
            for i in range(pybullet.getNumJoints(arm, physicsClientId=client))
        ]
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


def test_close_ends_the_connection() -> None:
    robot = BulletRobot()
    robot.reset(layouts.practice_scene(ARC))
    client = robot._client
    robot.close()
    assert not pybullet.getConnectionInfo(client)["isConnected"]
