"""What MuJoCo alone can be asked: our URDF as it reads it, forces between bodies, a world that diverges."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.contracts.driving import SPEED_M_S, drive, move_gripper, way_in, way_out
from sim import fetch, ik, layouts, urdf
from sim.interface import SLICES_PER_TICK, SimError, Vector3, run_tick, steady, still
from sim.physical import FINGER_FRICTION
from tests.support.robot_cases import reachable
from tests.support.shipped_world import LAYOUTS, STUDY_OBJECTS

mujoco = pytest.importorskip("mujoco", reason="mujoco-core has no wheel for this Python or system")
from sim.mujoco import STEPS_PER_SLICE, MujocoRobot  # noqa: E402

pytestmark = pytest.mark.mujoco

ARC = LAYOUTS["arc"]
IDS = list(STUDY_OBJECTS)


@pytest.fixture
def robot() -> Iterator[MujocoRobot]:
    with MujocoRobot() as made:
        yield made


@pytest.mark.parametrize("static_links", [True, False])
def test_urdf_and_forward_kinematics_agree_on_every_link(static_links: bool) -> None:
    spec = mujoco.MjSpec.from_string(urdf.fetch_urdf(static_links=static_links))
    spec.compiler.fusestatic = False
    model = spec.compile()
    data = mujoco.MjData(model)
    links = [body.name for body in spec.bodies if body.name != "world"]
    static = {frame.name for frame in fetch.FIXED_FRAMES}
    assert set(links) == set(fetch.LINK_NAMES) - (set() if static_links else static)
    rng = np.random.default_rng(0)
    points = rng.uniform(ik.WORKSPACE_LOW_M, ik.WORKSPACE_HIGH_M, size=(20, 3))
    for angles_rad in ik.solve_many(points[reachable(points)])[0]:
        finger_m = float(rng.uniform(0.0, fetch.FINGER_TRAVEL_M))
        for name, angle_rad in zip(fetch.ARM_JOINT_NAMES, angles_rad, strict=True):
            data.joint(name).qpos[0] = angle_rad
        for name in urdf.FINGER_JOINTS.values():
            data.joint(name).qpos[0] = finger_m
        mujoco.mj_kinematics(model, data)
        expected = fetch.link_poses(tuple(angles_rad), 2.0 * finger_m)
        for name in links:
            position, quaternion = expected[name]
            assert data.body(name).xpos == pytest.approx(position, abs=1e-6)
            assert abs(np.dot(data.body(name).xquat, quaternion)) == pytest.approx(1.0, abs=1e-6)


def test_the_published_limits_hold(robot: MujocoRobot) -> None:
    robot.reset(layouts.practice_scene(ARC))
    for joint in fetch.ARM_JOINTS:
        made = robot._model.joint(joint.name)
        assert bool(made.limited[0]) == math.isfinite(joint.upper_rad)
        if math.isfinite(joint.upper_rad):
            assert made.range == pytest.approx((joint.lower_rad, joint.upper_rad))
        assert robot._model.jnt_actfrcrange[made.id] == pytest.approx((-joint.effort_n_m, joint.effort_n_m))
    for name in urdf.FINGER_JOINTS.values():
        number = robot._model.joint(name).id
        assert robot._model.jnt_actfrcrange[number] == pytest.approx((-urdf.FINGER_FORCE_N, urdf.FINGER_FORCE_N))


def test_the_arm_is_on_its_way_in_every_slice(robot: MujocoRobot) -> None:
    """The velocity goes ahead with the target: without it the arm would follow 2.5 mm behind."""
    robot.reset(layouts.practice_scene(ARC))
    x, y, z = robot.observe().position_world_gripper_m
    for tick in range(4):
        robot.command(steady((0.0, 1.0, 0.0), SPEED_M_S))
        for n in range(SLICES_PER_TICK):
            robot.advance()
            expected = (x, y + SPEED_M_S * (tick * SLICES_PER_TICK + n + 1) / 30.0, z)
            assert math.dist(robot.observe().position_world_gripper_m, expected) < 1e-3


def contacts_of(robot: MujocoRobot, item: int = 0) -> list[tuple[set[int], float, float]]:
    """Of the contacts of an object: the two shapes, normal force in N, depth in m."""
    model, data = robot._model, robot._data
    shape, found = int(model.body_geomadr[robot._bodies[item].body]), []
    for number, contact in enumerate(data.contact):
        if shape in (one_two := {int(shape) for shape in contact.geom}):
            force_n = np.zeros(6)
            mujoco.mj_contactForce(model, data, number, force_n)
            found.append((one_two, float(force_n[0]), -float(contact.dist)))
    return found


def pressing_n(robot: MujocoRobot) -> list[float]:
    """How hard each finger presses on the first object."""
    return [sum(force for shapes, force, _ in contacts_of(robot) if pad in shapes) for pad in robot._pads]


def grasped(robot: MujocoRobot, scene: Any) -> Vector3:
    """Grasp the first object and lift it; where it stood."""
    robot.reset(scene)
    grasp_m: Vector3 = robot.observe().objects[0].grasp_world_m
    for target in way_in(ARC, grasp_m):
        drive(robot, target)
    move_gripper(robot, "close")
    drive(robot, (grasp_m[0], grasp_m[1], grasp_m[2] + 0.1))
    return grasp_m


@pytest.mark.parametrize("object_id", ["sponge_pack", "absorbent_can"])
def test_fingers_press_as_hard_as_stated_and_hold_what_friction_holds(robot: MujocoRobot, object_id: str) -> None:
    scene = layouts.scene(ARC, {2: object_id})
    grasped(robot, scene)
    for _ in range(2):
        run_tick(robot, still())
    assert pressing_n(robot) == pytest.approx([urdf.FINGER_FORCE_N] * 2, rel=0.03)
    # Pulled down, 5 N more a second: each finger's friction is its force times the object's coefficient.
    spec, body = scene.objects[0].spec, robot._bodies[0].body
    height_m, pull_n = robot.observe().objects[0].pose.position_world_m[2], 0.0
    while robot.observe().objects[0].pose.position_world_m[2] > height_m - 0.005 and pull_n < 50.0:
        robot._data.xfrc_applied[body, 2] = -pull_n
        mujoco.mj_step(robot._model, robot._data)
        pull_n += 5.0 / (30.0 * STEPS_PER_SLICE)
    held_n = 2.0 * urdf.FINGER_FORCE_N * FINGER_FRICTION * spec.friction
    assert pull_n + 9.81 * spec.mass_kg == pytest.approx(held_n, rel=0.1)


def test_what_falls_into_a_bin_lands_on_the_floor_not_in_it(robot: MujocoRobot) -> None:
    scene = layouts.scene(ARC, {0: "sponge_pack"})
    grasp_m = grasped(robot, scene)
    for target in way_out(ARC, grasp_m, scene.bins[0].release_world_m):
        drive(robot, target)
    fall_m = robot.observe().objects[0].pose.position_world_m[2] - scene.objects[0].spec.size_m[2] / 2.0
    robot.command(still("open"))
    depths_m = []
    for _ in range(3 * SLICES_PER_TICK):
        robot.advance()
        depths_m += [depth_m for _, _, depth_m in contacts_of(robot)]
    assert robot.observe().objects[0].pose.position_world_m[2] < 0.1
    assert 0.0 < max(depths_m) < math.sqrt(2.0 * 9.81 * fall_m) * robot._model.opt.timestep


def test_a_world_that_diverges_is_an_error_and_writes_no_file(
    robot: MujocoRobot, own_folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scene = layouts.scene(ARC, IDS)
    robot.reset(scene)
    run_tick(robot, still())
    robot._data.qvel[0] = math.nan
    with pytest.raises(SimError, match=r"^MuJoCo, 0\.53 s after the reset: .*unstable.* Reset the robot\.$") as caught:
        robot.advance()
    assert "\n" not in str(caught.value)
    with pytest.raises(SimError, match="MuJoCo"):  # it stays so: nothing began anew behind the caller's back
        robot.advance()
    assert not list(own_folder.iterdir())
    assert capfd.readouterr() == ("", "")
    robot.reset(scene)
    assert run_tick(robot, still())[1].time_s == pytest.approx(0.5)
