"""The Fetch in pybullet: contact, friction, gravity. The only file that loads pybullet.

One `DIRECT` client per robot. One slice is `STEPS_PER_SLICE` physics steps, twice as many while something falls; the
arm gets new joint targets twice a slice, from the closed-form inverse of the point where the gripper should be by then.
The fingers hold by friction alone. Every reset builds the world anew, in the same order, which is what makes it repeat
bit for bit.
"""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any

from sim import fetch, ik, urdf
from sim.interface import SLICE_S, PlacedObject, Pose, SceneSpec, Vector3
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
from sim.unprinted import imported

pybullet: Any = imported("pybullet")
"""It prints when it was built."""

STEPS_PER_SLICE = 4
FALLING_STEPS_PER_SLICE = 8
FALLING_M_S = 0.25
"""Steps last 1/120 s, and 1/240 s while an object is faster than this: it falls or tips, since the arm is never as fast
(`ik.MAX_SPEED_M_S`), and what hits the floor at 4 m/s would be deep in it after a long step."""
TARGETS_PER_SLICE = 2
SOLVER_ITERATIONS = 30
SOLVER_RESIDUAL = 1e-5

POSITION_GAIN, VELOCITY_GAIN = 0.5, 1.0
FINGER_GAIN = 0.2
GRIP_SPEED_M_S = 0.3
"""What the fingers' motors ask for while they grip. In each iteration of the solver a motor's impulse grows by no more
than the finger's mass times this speed: at the closing speed it takes all of them to reach the stated force, and none
is left to share it out among the contacts."""
SPINNING_FRICTION, ROLLING_FRICTION = 0.005, 0.0005
"""Of table, floor and bins only: between fingers and object they would cost half the speed and change nothing."""

_STATIC_GROUP, _ARM_GROUP, _FLOOR_GROUP = 2, 64, 128
"""Collision groups; the first is bullet's own."""


class Connections:
    """Connections to pybullet's physics, of which it keeps a table for each process, and so do we.

    One takes 30 MB, nearly all of it never written to. Processes that are forked from one that has a connection ready
    share these; each has the connection for itself, in its first state.
    """

    def __init__(self) -> None:
        self._ready: list[int] = []

    def make_ready(self) -> None:
        """Connect now, for whoever is forked from this process."""
        self._ready.append(pybullet.connect(pybullet.DIRECT))

    def take(self) -> int:
        """One that nobody has used: the one that is ready, else a new one."""
        return self._ready.pop() if self._ready else int(pybullet.connect(pybullet.DIRECT))


CONNECTIONS = Connections()


class BulletRobot(PhysicalRobot):
    """The `Robot` with pybullet's physics."""

    def __init__(self) -> None:
        super().__init__()
        self._client: int | None = None

    def close(self) -> None:
        """Disconnect from the physics; may be called twice."""
        super().close()
        if self._client is not None:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = None

    # Building. The order of creation is part of what makes runs repeat.

    def _build(self, scene: SceneSpec, joints_rad: ik.Joints) -> list[Body]:
        if self._client is None:
            self._client = CONNECTIONS.take()
        self._steps = STEPS_PER_SLICE
        pybullet.resetSimulation(physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=SLICE_S / self._steps,
            numSolverIterations=SOLVER_ITERATIONS,
            solverResidualThreshold=SOLVER_RESIDUAL,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )
        self._build_room(scene)
        self._build_arm(joints_rad)
        bodies = [self._build_object(placed) for placed in scene.objects]
        # Sleep begins at the end of a step: this one is without gravity, or they would sink into the table in it.
        pybullet.stepSimulation(physicsClientId=self._client)
        pybullet.setGravity(0.0, 0.0, -GRAVITY_M_S2, physicsClientId=self._client)
        return bodies

    def _build_room(self, scene: SceneSpec) -> None:
        floor = self._static(pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client))
        table = self._static(self._box(scene.table.size_m), scene.table.center_world_m)
        self._surface(floor, FLOOR_FRICTION)
        pybullet.setCollisionFilterGroupMask(floor, -1, _FLOOR_GROUP, ~_STATIC_GROUP, physicsClientId=self._client)
        self._surface(table, TABLE_FRICTION)
        for item in scene.bins:
            for center_m, size_m in walls(item):
                self._surface(self._static(self._box(size_m), center_m), BIN_FRICTION)

    def _build_arm(self, joints_rad: ik.Joints) -> None:
        client = self._client
        with _urdf_file() as path:
            self._arm = pybullet.loadURDF(
                path,
                useFixedBase=True,
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_IGNORE_VISUAL_SHAPES,
                physicsClientId=client,
            )
        joint_index, self._link_index = {}, {}
        for index in range(pybullet.getNumJoints(self._arm, physicsClientId=client)):
            info = pybullet.getJointInfo(self._arm, index, physicsClientId=client)
            joint_index[info[1].decode()] = index
            self._link_index[info[12].decode()] = index
            # The floor is out of the arm's reach, yet an endless plane: every link would be tested against it.
            pybullet.setCollisionFilterGroupMask(self._arm, index, _ARM_GROUP, ~_FLOOR_GROUP, physicsClientId=client)
        self._arm_joints = [joint_index[name] for name in fetch.ARM_JOINT_NAMES]
        self._fingers = [joint_index[name] for name in urdf.FINGER_JOINTS.values()]
        self._gripper_link = self._link_index["gripper_link"]
        for index, angle_rad in zip(self._arm_joints, joints_rad, strict=True):
            pybullet.resetJointState(self._arm, index, angle_rad, physicsClientId=client)
        for index in self._fingers:
            pybullet.resetJointState(self._arm, index, fetch.FINGER_TRAVEL_M, physicsClientId=client)
            pybullet.changeDynamics(
                self._arm,
                index,
                lateralFriction=FINGER_FRICTION,
                restitution=0.0,
                frictionAnchor=1,
                jointLowerLimit=-FINGER_STOP_M,
                jointUpperLimit=fetch.FINGER_TRAVEL_M + FINGER_STOP_M,
                physicsClientId=client,
            )
        # Both fingers' joints point outwards, so that equal positions keep the middle between them.
        gear = pybullet.createConstraint(
            self._arm,
            self._fingers[0],
            self._arm,
            self._fingers[1],
            pybullet.JOINT_GEAR,
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            physicsClientId=client,
        )
        pybullet.changeConstraint(gear, gearRatio=-1, maxForce=1000.0, erp=0.2, physicsClientId=client)
        self._drive_arm(joints_rad)
        self._drive_fingers()

    def _build_object(self, placed: PlacedObject) -> Body:
        spec, pose = placed.spec, placed.rest_pose
        if spec.shape == "cylinder":
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_CYLINDER,
                radius=spec.size_m[0] / 2.0,
                height=spec.size_m[2],
                physicsClientId=self._client,
            )
        else:
            shape = self._box(spec.size_m)
        w, x, y, z = pose.quaternion_wxyz
        body = pybullet.createMultiBody(
            spec.mass_kg, shape, -1, pose.position_world_m, (x, y, z, w), physicsClientId=self._client
        )
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=spec.friction,
            restitution=0.0,
            # It stands still until something touches it.
            activationState=pybullet.ACTIVATION_STATE_ENABLE_SLEEPING | pybullet.ACTIVATION_STATE_SLEEP,
            physicsClientId=self._client,
        )
        return Body(placed, body)

    def _box(self, size_m: Vector3) -> int:
        half_m = [side / 2.0 for side in size_m]
        shape: int = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half_m, physicsClientId=self._client)
        return shape

    def _static(self, shape: int, position_m: Vector3 = (0.0, 0.0, 0.0)) -> int:
        body: int = pybullet.createMultiBody(
            0.0, shape, -1, position_m, useMaximalCoordinates=True, physicsClientId=self._client
        )
        return body

    def _surface(self, body: int, friction: float) -> None:
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=friction,
            spinningFriction=SPINNING_FRICTION,
            rollingFriction=ROLLING_FRICTION,
            restitution=0.0,
            # What stands still on something asleep is not even tested against it.
            activationState=pybullet.ACTIVATION_STATE_SLEEP,
            physicsClientId=self._client,
        )

    # Driving.

    def _run_slice(self, before_m: Vector3, after_m: Vector3) -> None:
        self._step_by(FALLING_STEPS_PER_SLICE if self._fastest_m_s > FALLING_M_S else STEPS_PER_SLICE)
        for part in range(1, TARGETS_PER_SLICE + 1):
            if after_m != before_m:
                share = part / TARGETS_PER_SLICE
                target_m = (
                    before_m[0] + share * (after_m[0] - before_m[0]),
                    before_m[1] + share * (after_m[1] - before_m[1]),
                    before_m[2] + share * (after_m[2] - before_m[2]),
                )
                self._drive_arm(ik.solve(target_m)[0])
            for _ in range(self._steps // TARGETS_PER_SLICE):
                pybullet.stepSimulation(physicsClientId=self._client)

    def _drive_arm(self, joints_rad: ik.Joints) -> None:
        self._joints_rad = joints_rad
        pybullet.setJointMotorControlArray(
            self._arm,
            self._arm_joints,
            pybullet.POSITION_CONTROL,
            targetPositions=joints_rad,
            forces=fetch.EFFORT_N_M,
            positionGains=[POSITION_GAIN] * len(joints_rad),
            velocityGains=[VELOCITY_GAIN] * len(joints_rad),
            physicsClientId=self._client,
        )

    def _drive_fingers(self) -> None:
        for index in self._fingers:
            pybullet.setJointMotorControl2(
                self._arm,
                index,
                pybullet.POSITION_CONTROL,
                targetPosition=0.0 if self._closing else fetch.FINGER_TRAVEL_M,
                positionGain=FINGER_GAIN,
                force=urdf.FINGER_FORCE_N,
                maxVelocity=GRIP_SPEED_M_S if self._gripping else urdf.FINGER_SPEED_M_S,
                physicsClientId=self._client,
            )

    def _step_by(self, steps: int) -> None:
        """So many steps a slice from now on."""
        # Bullet turns a motor's force into an impulse of the step's length when it is commanded: command it again.
        if steps != self._steps:
            self._steps = steps
            pybullet.setPhysicsEngineParameter(fixedTimeStep=SLICE_S / steps, physicsClientId=self._client)
            self._drive_arm(self._joints_rad)
            self._drive_fingers()

    # Measuring.

    def _measure_gripper(self) -> Vector3:
        state = pybullet.getLinkState(
            self._arm, self._gripper_link, computeForwardKinematics=1, physicsClientId=self._client
        )
        x_m, y_m, z_m = state[4]
        return x_m, y_m, z_m

    def _measure_joints(self) -> tuple[Sequence[float], Sequence[float]]:
        states = pybullet.getJointStates(self._arm, [*self._arm_joints, *self._fingers], physicsClientId=self._client)
        positions = [state[0] for state in states]
        return positions[: len(self._arm_joints)], positions[len(self._arm_joints) :]

    def _pose_of(self, body: int) -> Pose:
        position, (x, y, z, w) = pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client)
        return Pose(position, (w, x, y, z))

    def _speeds_of(self, body: int) -> tuple[float, float]:
        velocity, turn = pybullet.getBaseVelocity(body, physicsClientId=self._client)
        return math.hypot(*velocity), math.hypot(*turn)

    def _pressing(self, body: int) -> tuple[bool, bool]:
        one, other = self._fingers
        return self._presses(one, body), self._presses(other, body)

    def _presses(self, finger: int, body: int) -> bool:
        contacts = pybullet.getContactPoints(
            bodyA=self._arm, bodyB=body, linkIndexA=finger, physicsClientId=self._client
        )
        return any(contact[9] > 0.0 for contact in contacts)


@contextlib.contextmanager
def _urdf_file() -> Iterator[str]:
    """The URDF as a file, for as long as pybullet reads it: it takes no text."""
    handle, path = tempfile.mkstemp(suffix=".urdf", prefix="fetch-")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(urdf.fetch_urdf(static_links=False))
        yield path
    finally:
        os.unlink(path)
