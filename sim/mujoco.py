"""The Fetch in MuJoCo: contact, friction, gravity. The only file that imports mujoco.

A sibling of `sim.bullet`: the same description of the arm, the same objects, bins and rules (`sim.physical`). A world
is a model compiled anew from `sim.urdf` and the scene at every reset, in the same order, which is what makes it repeat
bit for bit. One slice is `STEPS_PER_SLICE` steps; each has a joint target of its own, between the closed-form inverses
of two waypoints, and its velocity.

    contact  by itself MuJoCo takes the greater of two frictions: each pair that may touch is stated (`_TOUCHING`), with
             their product, as in pybullet
    grip     contacts are soft: without `NOSLIP_ITERATIONS` what the fingers hold creeps down by centimetres in minutes
    sleep    what nobody touches is asleep from the beginning, where the scene put it: a quarter of the time
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco

from sim import fetch, ik, urdf
from sim.interface import SLICE_S, PlacedObject, Pose, SceneSpec, SimError, Vector3
from sim.objects import GRAVITY_M_S2
from sim.physical import (
    BIN_FRICTION,
    FINGER_FRICTION,
    FINGER_STOP_M,
    FLOOR_FRICTION,
    TABLE_FRICTION,
    Body,
    PhysicalRobot,
    walls,
)

STEPS_PER_SLICE = 8
IMPEDANCE_RATIO = 10.0
NOSLIP_ITERATIONS = 3
CONTACT_S = 0.01
"""Time constant with which a contact is pushed apart, 2.4 steps: less than two are not stable."""
SPINNING_FRICTION, ROLLING_FRICTION = 0.005, 0.001
"""Of what objects lie on: a cylinder would else roll on and never settle."""
ARM_FRICTION = 0.5
"""Of the arm's links but the fingers."""

STIFFNESS_PER_EFFORT = 200.0
"""Gain of a joint's motor, N m/rad for each N m it can give."""
DAMPING_RATIO = 0.7
ARMATURE_KG_M2 = 0.1
"""Inertia of a joint's motor. Without it the hand tilts by 11 degrees: its joints are too light for steps this long."""
FINGER_STIFFNESS_N_M = 5000.0
FINGER_ARMATURE_KG = 0.1
_FINGER_STEP_M = urdf.FINGER_SPEED_M_S * SLICE_S / STEPS_PER_SLICE

_ALONE = {"contype": 0, "conaffinity": 0}
"""A shape that touches nothing but what a pair says."""


_TOUCHING = frozenset(
    {
        ("object", "object"),
        ("object", "floor"),
        ("object", "room"),
        ("object", "robot"),
        ("arm", "object"),
        ("arm", "room"),
    }
)
"""Kinds of shapes that may touch. The arm does not touch the robot, as in pybullet, and does not reach the floor."""
_LAIN_ON = ("floor", "room")


@dataclass(frozen=True)
class _Surface:
    """A shape by its name, of which kind it is, and its friction."""

    shape: str
    kind: str
    friction: float


class MujocoRobot(PhysicalRobot):
    """The `Robot` with MuJoCo's physics. `advance` raises `SimError` when the physics diverges; then `reset` it."""

    def __init__(self) -> None:
        super().__init__()
        self._model: Any = None
        self._data: Any = None

    def close(self) -> None:
        """Let the world go; may be called twice."""
        super().close()
        self._model = self._data = None

    # Building. The order of creation is part of what makes runs repeat.

    def _build(self, scene: SceneSpec, joints_rad: ik.Joints) -> list[Body]:
        _keep_silent()
        spec = mujoco.MjSpec.from_string(urdf.fetch_urdf(static_links=False))
        spec.compiler.fusestatic = False  # it would take `gripper_link` away
        _set_solver(spec.option)
        surfaces = [*_furnish(spec, scene), *_motorise(spec)]
        surfaces += [_add_object(spec, placed, f"object {n}") for n, placed in enumerate(scene.objects)]
        for one, other in itertools.combinations(surfaces, 2):
            _let_touch(spec, one, other)
        self._model = model = spec.compile()
        self._data = data = mujoco.MjData(model)
        self._gripper = model.body("gripper_link").id
        self._arm = [int(model.joint(name).qposadr[0]) for name in fetch.ARM_JOINT_NAMES]
        self._fingers = [int(model.joint(name).qposadr[0]) for name in urdf.FINGER_JOINTS.values()]
        self._pads = [int(model.body(name).geomadr[0]) for name in urdf.FINGER_JOINTS]
        # A motor's force is kp (target - q) - kv q': with so much of the velocity in the target, kv (q'target - q').
        arm = slice(len(self._arm))
        self._lead_s = (-model.actuator_biasprm[arm, 2] / model.actuator_gainprm[arm, 0]).tolist()
        data.qpos[self._arm] = joints_rad
        data.qpos[self._fingers] = fetch.FINGER_TRAVEL_M
        mujoco.mj_kinematics(model, data)
        self._solved = (scene.start_world_m, joints_rad)
        self._finger_m = self._finger_goal_m = fetch.FINGER_TRAVEL_M
        return [Body(placed, model.body(f"object {n}").id) for n, placed in enumerate(scene.objects)]

    # Driving.

    def _run_slice(self, before_m: Vector3, after_m: Vector3) -> None:
        start_rad, end_rad = self._solve(before_m), self._solve(after_m)
        if after_m == before_m and self._finger_m == self._finger_goal_m:
            self._step(end_rad, STEPS_PER_SLICE)
        else:
            turns_rad = [end - start for start, end in zip(start_rad, end_rad, strict=True)]
            for step in range(1, STEPS_PER_SLICE + 1):
                self._finger_m += min(max(self._finger_goal_m - self._finger_m, -_FINGER_STEP_M), _FINGER_STEP_M)
                share = step / STEPS_PER_SLICE
                self._step(
                    [
                        start + (share + lead_s / SLICE_S) * turn
                        for start, turn, lead_s in zip(start_rad, turns_rad, self._lead_s, strict=True)
                    ]
                )
        mujoco.mj_kinematics(self._model, self._data)  # a step ends with new joints, and links where they were before
        if self._data.warning.number.any():
            raise SimError(self._trouble())

    def _step(self, targets_rad: Sequence[float], times: int = 1) -> None:
        self._data.ctrl[:] = (*targets_rad, self._finger_m, self._finger_m)
        mujoco.mj_step(self._model, self._data, times)

    def _solve(self, position_m: Vector3) -> ik.Joints:
        if position_m != self._solved[0]:
            self._solved = (position_m, ik.solve(position_m)[0])
        return self._solved[1]

    def _trouble(self) -> str:
        """What MuJoCo warned of."""
        warnings = self._data.warning
        told = [mujoco.mju_warningText(n, warnings[n].lastinfo) for n in range(len(warnings)) if warnings[n].number]
        return f"MuJoCo, {self._slice * SLICE_S:.2f} s after the reset: {' '.join(told)} Reset the robot."

    def _drive_fingers(self) -> None:
        goal_m = 0.0 if self._closing else fetch.FINGER_TRAVEL_M
        if goal_m != self._finger_goal_m:
            self._finger_goal_m = goal_m
            self._finger_m = float(self._data.qpos[self._fingers].mean())

    # Measuring.

    def _measure_gripper(self) -> Vector3:
        x_m, y_m, z_m = self._data.xpos[self._gripper].tolist()
        return x_m, y_m, z_m

    def _measure_joints(self) -> tuple[Sequence[float], Sequence[float]]:
        return self._data.qpos[self._arm].tolist(), self._data.qpos[self._fingers].tolist()

    def _pose_of(self, body: int) -> Pose:
        start = self._model.jnt_qposadr[self._model.body_jntadr[body]]
        x_m, y_m, z_m, w, x, y, z = self._data.qpos[start : start + 7].tolist()
        return Pose((x_m, y_m, z_m), (w, x, y, z))

    def _speeds_of(self, body: int) -> tuple[float, float]:
        start = self._model.body_dofadr[body]
        speeds = self._data.qvel[start : start + 6].tolist()
        return math.hypot(*speeds[:3]), math.hypot(*speeds[3:])

    def _pressing(self, body: int) -> tuple[bool, bool]:
        contacts, shape = self._data.contact, int(self._model.body_geomadr[body])
        pressing = {
            one if other == shape else other
            for (one, other), row in zip(contacts.geom.tolist(), contacts.efc_address.tolist(), strict=True)
            if shape in (one, other) and row >= 0 and self._data.efc_force[row] > 0.0
        }
        one, other = self._pads
        return one in pressing, other in pressing


def _keep_silent() -> None:
    """MuJoCo writes what it warns of into a file in the working folder: `advance` raises it instead."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = config.logto_console = False
    config.set()


def _set_solver(option: Any) -> None:
    option.timestep = SLICE_S / STEPS_PER_SLICE
    option.gravity = (0.0, 0.0, -GRAVITY_M_S2)
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.impratio = IMPEDANCE_RATIO
    option.noslip_iterations = NOSLIP_ITERATIONS
    option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a world that diverged would begin anew, silently


def _furnish(spec: Any, scene: SceneSpec) -> Iterator[_Surface]:
    """Floor, table, walls of the bins."""
    world = spec.worldbody
    world.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(1.0, 1.0, 1.0), **_ALONE)
    yield _Surface("floor", "floor", FLOOR_FRICTION)
    boxes = [("table", scene.table.center_world_m, scene.table.size_m, TABLE_FRICTION)]
    for item in scene.bins:
        boxes += [(f"{item.id} wall {n}", *wall, BIN_FRICTION) for n, wall in enumerate(walls(item))]
    for name, center_m, size_m, friction in boxes:
        world.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, pos=center_m, size=_half(size_m), **_ALONE)
        yield _Surface(name, "room", friction)


def _motorise(spec: Any) -> Iterator[_Surface]:
    """Motors for the joints, which begin with the arm's; names for the links' shapes."""
    for joint in fetch.ARM_JOINTS:
        spec.joint(joint.name).armature = ARMATURE_KG_M2
        _add_motor(spec, joint.name, STIFFNESS_PER_EFFORT * joint.effort_n_m)
    for name in urdf.FINGER_JOINTS.values():
        spec.joint(name).armature = FINGER_ARMATURE_KG
        spec.joint(name).range = (-FINGER_STOP_M, fetch.FINGER_TRAVEL_M + FINGER_STOP_M)
        _add_motor(spec, name, FINGER_STIFFNESS_N_M)
    # Both fingers' joints point outwards, so that equal positions keep the middle between them.
    one, other = urdf.FINGER_JOINTS.values()
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=one,
        name2=other,
        data=[0.0, 1.0, *[0.0] * 10],
        solref=(CONTACT_S, 1.0),
    )
    for body in spec.bodies:
        if body.name == "world":
            continue
        body.gravcomp = 1.0
        for number, shape in enumerate(body.geoms):
            shape.name = f"{body.name} {number}"
            shape.contype = shape.conaffinity = 0
            kind = "robot" if body.name == "base_link" else "arm"
            yield _Surface(shape.name, kind, FINGER_FRICTION if body.name in urdf.FINGER_JOINTS else ARM_FRICTION)


def _add_motor(spec: Any, joint: str, stiffness: float) -> None:
    """One that goes to a position; the description of the arm bounds what it gives."""
    motor = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.set_to_position(stiffness, dampratio=DAMPING_RATIO)


def _add_object(spec: Any, placed: PlacedObject, name: str) -> _Surface:
    """It stands still until something touches it."""
    size_m, pose = placed.spec.size_m, placed.rest_pose
    body = spec.worldbody.add_body(
        name=name, pos=pose.position_world_m, quat=pose.quaternion_wxyz, sleep=mujoco.mjtSleepPolicy.mjSLEEP_INIT
    )
    body.add_freejoint()
    if placed.spec.shape == "cylinder":
        kind, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [size_m[0] / 2.0, size_m[2] / 2.0, 0.0]
    else:
        kind, size = mujoco.mjtGeom.mjGEOM_BOX, _half(size_m)
    body.add_geom(name=name, type=kind, size=size, mass=placed.spec.mass_kg, **_ALONE)
    return _Surface(name, "object", placed.spec.friction)


def _let_touch(spec: Any, one: _Surface, other: _Surface) -> None:
    """Two shapes touch from now on, if their kinds may."""
    kinds = {(one.kind, other.kind), (other.kind, one.kind)}
    if not kinds & _TOUCHING:
        return
    slides = one.friction * other.friction
    lies = "object" in (one.kind, other.kind) and (one.kind in _LAIN_ON or other.kind in _LAIN_ON)
    spec.add_pair(
        geomname1=one.shape,
        geomname2=other.shape,
        condim=6 if lies else 3,
        friction=(slides, slides, SPINNING_FRICTION, ROLLING_FRICTION, ROLLING_FRICTION),
        solref=(CONTACT_S, 1.0),
    )


def _half(size_m: Vector3) -> list[float]:
    return [side / 2.0 for side in size_m]
