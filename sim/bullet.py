"""The Fetch in pybullet: contact, friction, gravity. The only file that imports pybullet.

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
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pybullet
from numpy.typing import NDArray

from sim import fetch, ik, urdf
from sim.interface import (
    BIN_WALL_M,
    SLICE_S,
    Bin,
    GripperState,
    MotionVerdict,
    ObjectState,
    PlacedObject,
    Pose,
    RobotCommand,
    SceneSpec,
    SimError,
    Vector3,
    WorldState,
)
from sim.objects import grasp_point
from sim.touch import Touch

STEPS_PER_SLICE = 4
FALLING_STEPS_PER_SLICE = 8
FALLING_M_S = 0.25
"""Steps last 1/120 s, and 1/240 s while an object is faster than this: it falls or tips, since the arm is never as fast
(`ik.MAX_SPEED_M_S`), and what hits the floor at 4 m/s would be deep in it after a long step."""
TARGETS_PER_SLICE = 2
SOLVER_ITERATIONS = 30
SOLVER_RESIDUAL = 1e-5

LAG_M = 0.010
"""A gripper farther than this from where it should be is pressed against something: the command is frozen."""
SETTLED_SPEED_M_S = 0.01
SETTLED_TURN_RAD_S = 0.1
SETTLED_SLICES = math.ceil(0.25 / SLICE_S)
TOUCH_SLICES = 4
"""A finger still counts as touching this many slices after the last contact, and must touch that long to hold."""

POSITION_GAIN, VELOCITY_GAIN = 0.5, 1.0
FINGER_GAIN = 0.2
GRIP_SPEED_M_S = 0.3
"""What the fingers' motors ask for while they grip. In each iteration of the solver a motor's impulse grows by no more
than the finger's mass times this speed: at the closing speed it takes all of them to reach the stated force, and none
is left to share it out among the contacts."""
FINGER_STOP_M = 0.001
"""Their joints' stops lie this far beyond the travel: a finger at its stop costs the solver a row in every step."""
FINGER_FRICTION, TABLE_FRICTION, FLOOR_FRICTION, BIN_FRICTION = 1.0, 0.8, 0.8, 0.5
SPINNING_FRICTION, ROLLING_FRICTION = 0.005, 0.0005
"""Of table, floor and bins only: between fingers and object they would cost half the speed and change nothing."""

_STATIC_GROUP, _ARM_GROUP, _FLOOR_GROUP = 2, 64, 128
"""Collision groups; the first is bullet's own."""


@dataclass
class _Body:
    """A placed object, its body in the physics and for how many slices it has been at rest."""

    placed: PlacedObject
    body: int
    rest_slices: int = SETTLED_SLICES


class BulletRobot:
    """A `Robot` with physics: objects are pushed, tip over, slip out of the fingers and miss the bin.

    `held` names the object that both fingers have touched for `TOUCH_SLICES` while commanded to close.
    When the arm is pressed against something, the rest of the tick's motion is dropped (`lagging`), unless it leads
    away; for a while, what leads there again is not feasible.
    """

    def __init__(self) -> None:
        self._client: int | None = None
        self._urdf_path: str | None = None
        self._scene: SceneSpec | None = None

    def reset(self, scene: SceneSpec) -> None:
        """Build a fresh world: arm at the start pose, gripper open, objects at rest.

        Raises `SimError` when the start is out of reach.
        """
        joints_rad, code = ik.solve(scene.start_world_m)
        if code:
            raise SimError(f"start position {scene.start_world_m}: {ik.REASONS[code]}")
        if self._client is None:
            self._client = pybullet.connect(pybullet.DIRECT)
        self._scene = scene
        self._slice = 0
        self._target = scene.start_world_m
        self._path: list[Vector3] = []
        self._closing = False
        self._gripper_slices_left = 0
        self._gripping = False
        self._falling = False
        self._steps = STEPS_PER_SLICE
        self._touches: dict[int, list[int]] = {}  # object body -> slices of touch of each finger, + and - as in _feel
        self._held: _Body | None = None
        self._lagging = False
        self._touch = Touch()
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
        self._bodies = [self._build_object(placed) for placed in scene.objects]
        # Sleep begins at the end of a step: this one is without gravity, or they would sink into the table in it.
        pybullet.stepSimulation(physicsClientId=self._client)
        pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=self._client)
        self._gripper_world_m = self._measure_gripper()

    def command(self, command: RobotCommand) -> MotionVerdict:
        """Take the next tick's command; drops or stops what cannot be reached, never jumps.

        Raises `SimError` before the first `reset`, and for a command outside its bounds (`sim.ik.check_command`).
        """
        self._world()
        if command.speed_m_s > 0.0 and any(any(segment.direction) for segment in command.segments):
            self._target = self._start()
        verdict = ik.executable(self._target, command)
        moving = command.speed_m_s > 0.0 and any(any(segment.direction) for segment in verdict.executed)
        # Reversed, so that the next waypoint is the cheap one to take.
        self._path = ik.waypoints(self._target, verdict, command.speed_m_s)[::-1] if moving else []
        self._lagging = False
        if command.gripper != "hold" and self._closing != (command.gripper == "close"):
            self._closing = command.gripper == "close"
            self._gripper_slices_left = fetch.GRIPPER_SLICES
            self._touches.clear()
            self._held = None
            self._gripping = False
            self._drive_fingers()
        return verdict

    def _start(self) -> Vector3:
        """Where a motion begins: an arm that is pressed against something has not come to where it was told to be.

        It begins where the arm is: else every way out would first have to make up for what is missing.
        """
        if math.dist(self._gripper_world_m, self._target) > LAG_M and not ik.solve(self._gripper_world_m)[1]:
            return self._gripper_world_m
        return self._target

    def advance(self, slices: int = 1) -> None:
        """Advance by so many slices. Raises `SimError` before the first `reset`."""
        client = self._world()
        for _ in range(slices):
            self._advance_slice(client)

    def _advance_slice(self, client: int) -> None:
        self._step_by(FALLING_STEPS_PER_SLICE if self._falling else STEPS_PER_SLICE)
        self._slice += 1
        self._gripper_slices_left = max(self._gripper_slices_left - 1, 0)
        before = self._target
        after = self._path.pop() if self._path else before
        lag_m = math.dist(self._gripper_world_m, before)
        # By value: standing still for the planning delay makes waypoints that are equal, and stops no way out.
        if after != before and lag_m > LAG_M and math.dist(self._gripper_world_m, after) >= lag_m:
            self._lagging = True
            self._touch.feel(self._gripper_world_m, after, self._slice)
            self._path.clear()
            after = before
        for part in range(1, TARGETS_PER_SLICE + 1):
            if after != before:
                share = part / TARGETS_PER_SLICE
                self._target = (
                    before[0] + share * (after[0] - before[0]),
                    before[1] + share * (after[1] - before[1]),
                    before[2] + share * (after[2] - before[2]),
                )
                self._drive_arm(ik.solve(self._target)[0])
            for _ in range(self._steps // TARGETS_PER_SLICE):
                pybullet.stepSimulation(physicsClientId=client)
        self._target = after
        self._gripper_world_m = self._measure_gripper()
        self._falling = self._watch_objects() > FALLING_M_S
        if self._closing:
            self._feel()

    def observe(self) -> WorldState:
        """The world as it is now. Raises `SimError` before the first `reset`."""
        client = self._world()
        joints = pybullet.getJointStates(self._arm, [*self._arm_joints, *self._fingers], physicsClientId=client)
        angles_rad = tuple(state[0] for state in joints)
        return WorldState(
            time_s=self._slice * SLICE_S,
            position_world_gripper_m=self._gripper_world_m,
            joint_positions_rad=angles_rad[: len(fetch.ARM_JOINTS)],
            finger_opening_m=sum(angles_rad[len(fetch.ARM_JOINTS) :]),
            gripper=self._gripper_state(),
            held=self._held.placed.spec.id if self._held else None,
            lagging=self._lagging,
            objects=tuple(self._object_state(item) for item in self._bodies),
        )

    def feasible(self, displacements_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which straight displacements, shape (N, 3), from the present position stay reachable; shape (N,).

        What leads into what stopped the arm a short while ago does not.
        """
        self._world()
        felt = self._touch.leads_into(self._gripper_world_m, displacements_m, self._slice)
        return ik.segment_feasible(self._start(), displacements_m) & ~felt

    def close(self) -> None:
        """Disconnect from the physics; may be called twice."""
        self._scene = None
        if self._client is not None:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = None

    def __enter__(self) -> BulletRobot:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _world(self) -> int:
        if self._scene is None or self._client is None:
            raise SimError("the robot has no world; call reset(scene) first")
        return self._client

    # Building. The order of creation is part of what makes runs repeat.

    def _build_room(self, scene: SceneSpec) -> None:
        floor = self._static(pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client))
        table = self._static(self._box(scene.table.size_m), scene.table.center_world_m)
        self._surface(floor, FLOOR_FRICTION)
        pybullet.setCollisionFilterGroupMask(floor, -1, _FLOOR_GROUP, ~_STATIC_GROUP, physicsClientId=self._client)
        self._surface(table, TABLE_FRICTION)
        for item in scene.bins:
            for center_m, size_m in _walls(item):
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

    def _build_object(self, placed: PlacedObject) -> _Body:
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
        return _Body(placed, body)

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

    def _watch_objects(self) -> float:
        """Count how long each has been at rest; the speed of the fastest, m/s."""
        fastest_m_s = 0.0
        for item in self._bodies:
            velocity, turn = pybullet.getBaseVelocity(item.body, physicsClientId=self._client)
            speed_m_s = math.hypot(*velocity)
            quiet = speed_m_s < SETTLED_SPEED_M_S and math.hypot(*turn) < SETTLED_TURN_RAD_S
            item.rest_slices = item.rest_slices + 1 if quiet else 0
            fastest_m_s = max(fastest_m_s, speed_m_s)
        return fastest_m_s

    def _feel(self) -> None:
        """Which object both fingers hold. Counts up while a finger touches, down while it does not."""
        gripping = False
        for item in [self._held] if self._held else self._bodies:
            counts = self._touches.setdefault(item.body, [0, 0])
            pressing = [self._presses(finger, item) for finger in self._fingers]
            for side, presses in enumerate(pressing):
                counts[side] = min(counts[side] + 1, TOUCH_SLICES) if presses else max(counts[side] - 1, 0)
            gripping = any(pressing) and (self._held is item or min(counts) == TOUCH_SLICES)
            if min(counts) == TOUCH_SLICES:
                self._held = item
                break
            if min(counts) == 0 and self._held is item:
                self._held = None
                self._touches.clear()
        if gripping != self._gripping:
            self._gripping = gripping
            self._drive_fingers()

    def _presses(self, finger: int, item: _Body) -> bool:
        contacts = pybullet.getContactPoints(
            bodyA=self._arm, bodyB=item.body, linkIndexA=finger, physicsClientId=self._client
        )
        return any(contact[9] > 0.0 for contact in contacts)

    def _gripper_state(self) -> GripperState:
        if self._gripper_slices_left:
            return "moving"
        return "closed" if self._closing else "open"

    def _object_state(self, item: _Body) -> ObjectState:
        position, (x, y, z, w) = pybullet.getBasePositionAndOrientation(item.body, physicsClientId=self._client)
        pose = Pose(position, (w, x, y, z))
        spec = item.placed.spec
        settled = item is not self._held and item.rest_slices >= SETTLED_SLICES
        return ObjectState(spec.id, pose, grasp_point(spec, pose), settled)


def _walls(item: Bin) -> Iterator[tuple[Vector3, Vector3]]:
    """Centre and size of a bin's four walls."""
    (x_m, y_m), (inner_x_m, inner_y_m) = item.center_xy_m, item.inner_size_m
    z_m, height_m = item.height_m / 2.0, item.height_m
    for side in (-1.0, 1.0):
        center_x_m = x_m + side * (inner_x_m + BIN_WALL_M) / 2.0
        yield (center_x_m, y_m, z_m), (BIN_WALL_M, inner_y_m + 2.0 * BIN_WALL_M, height_m)
    for side in (-1.0, 1.0):
        center_y_m = y_m + side * (inner_y_m + BIN_WALL_M) / 2.0
        yield (x_m, center_y_m, z_m), (inner_x_m, BIN_WALL_M, height_m)


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
