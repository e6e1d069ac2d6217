"""What robots with physics share, whichever engine moves the bodies: the path, pressing, the gripper, what is held.

An engine is a class derived from `PhysicalRobot` that builds a world, runs one slice of it, and says where things are.
The arm's target goes along the commanded path, one waypoint a slice; the fingers hold by friction alone.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sim import fetch, ik
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

LAG_M = 0.010
"""A gripper farther than this from where it should be is pressed against something: the command is frozen."""
BACK_SHARES = (0.0, 0.25, 0.5, 0.75)
"""Of the way back to where it was told to be, which is within reach."""
SETTLED_SPEED_M_S = 0.01
SETTLED_TURN_RAD_S = 0.1
SETTLED_SLICES = math.ceil(0.25 / SLICE_S)
TOUCH_SLICES = 4
"""A finger still counts as touching this many slices after the last contact, and must touch that long to hold."""

FINGER_STOP_M = 0.001
"""Their joints' stops lie this far beyond the travel: a finger at its stop costs the solver a row in every step."""
FINGER_FRICTION, TABLE_FRICTION, FLOOR_FRICTION, BIN_FRICTION = 1.0, 0.8, 0.8, 0.5
"""Each times that of the object."""

_Robot = TypeVar("_Robot", bound="PhysicalRobot")


@dataclass
class Body:
    """A placed object, its number in the physics and for how many slices it has been at rest."""

    placed: PlacedObject
    body: int
    rest_slices: int = SETTLED_SLICES


class PhysicalRobot(ABC):
    """A `Robot` with physics: objects are pushed, tip over, slip out of the fingers and miss the bin.

    `held` names the object that both fingers have touched for `TOUCH_SLICES` while commanded to close.
    When the arm is pressed against something, the rest of the tick's motion is dropped (`lagging`), unless it leads
    away; for a while, what leads there again is not feasible.
    """

    def __init__(self) -> None:
        self._scene: SceneSpec | None = None

    def reset(self, scene: SceneSpec) -> None:
        """Build a fresh world: arm at the start pose, gripper open, objects at rest.

        Raises `SimError` when the start is out of reach.
        """
        joints_rad, code = ik.solve(scene.start_world_m)
        if code:
            raise SimError(f"start position {scene.start_world_m}: {ik.REASONS[code]}")
        self._scene = scene
        self._slice = 0
        self._target = scene.start_world_m
        self._path: list[Vector3] = []
        self._closing = False
        self._gripper_slices_left = 0
        self._gripping = False
        self._fastest_m_s = 0.0
        self._touches: dict[int, list[int]] = {}  # object body -> slices of touch of each finger, + and - as in _feel
        self._held: Body | None = None
        self._lagging = False
        self._touch = Touch()
        self._bodies = self._build(scene, joints_rad)
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

        It begins where the arm is, else every way out would first have to make up for what is missing; and where it was
        pushed a little out of its reach, as near to that as it can be told to be.
        """
        if math.dist(self._gripper_world_m, self._target) > LAG_M:
            x_m, y_m, z_m = ik.into_workspace(self._gripper_world_m)
            to_x_m, to_y_m, to_z_m = self._target
            for share in BACK_SHARES:
                start_m = x_m + share * (to_x_m - x_m), y_m + share * (to_y_m - y_m), z_m + share * (to_z_m - z_m)
                if not ik.solve(start_m)[1]:
                    return start_m
        return self._target

    def advance(self, slices: int = 1) -> None:
        """Advance by so many slices. Raises `SimError` before the first `reset`."""
        self._world()
        for _ in range(slices):
            self._advance_slice()

    def _advance_slice(self) -> None:
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
        self._run_slice(before, after)
        self._target = after
        self._gripper_world_m = self._measure_gripper()
        self._fastest_m_s = self._watch_objects()
        if self._closing:
            self._feel()

    def observe(self) -> WorldState:
        """The world as it is now. Raises `SimError` before the first `reset`."""
        self._world()
        joints_rad, fingers_m = self._measure_joints()
        return WorldState(
            time_s=self._slice * SLICE_S,
            position_world_gripper_m=self._gripper_world_m,
            joint_positions_rad=tuple(joints_rad),
            finger_opening_m=sum(fingers_m),
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
        """Let the world go; may be called twice."""
        self._scene = None

    def __enter__(self: _Robot) -> _Robot:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _world(self) -> None:
        if self._scene is None:
            raise SimError("the robot has no world; call reset(scene) first")

    # What an engine does.

    @abstractmethod
    def _build(self, scene: SceneSpec, joints_rad: ik.Joints) -> list[Body]:
        """A new world, the arm in this posture, the gripper open; the objects in the order of the scene."""

    @abstractmethod
    def _run_slice(self, before_m: Vector3, after_m: Vector3) -> None:
        """Let `SLICE_S` pass while the target of the gripper goes straight from here to there."""

    @abstractmethod
    def _drive_fingers(self) -> None:
        """The fingers begin to close or to open (`_closing`), or touch something while they close (`_gripping`)."""

    @abstractmethod
    def _measure_gripper(self) -> Vector3:
        """Where the gripper is."""

    @abstractmethod
    def _measure_joints(self) -> tuple[Sequence[float], Sequence[float]]:
        """The arm's joints in the order of `sim.fetch.ARM_JOINT_NAMES`, rad, and the fingers', m."""

    @abstractmethod
    def _pose_of(self, body: int) -> Pose:
        """Where an object is."""

    @abstractmethod
    def _speeds_of(self, body: int) -> tuple[float, float]:
        """How fast an object moves, m/s, and turns, rad/s."""

    @abstractmethod
    def _pressing(self, body: int) -> tuple[bool, bool]:
        """Which of the two fingers press on an object."""

    # Measuring.

    def _watch_objects(self) -> float:
        """Count how long each has been at rest; the speed of the fastest, m/s."""
        fastest_m_s = 0.0
        for item in self._bodies:
            speed_m_s, turn_rad_s = self._speeds_of(item.body)
            quiet = speed_m_s < SETTLED_SPEED_M_S and turn_rad_s < SETTLED_TURN_RAD_S
            item.rest_slices = item.rest_slices + 1 if quiet else 0
            fastest_m_s = max(fastest_m_s, speed_m_s)
        return fastest_m_s

    def _feel(self) -> None:
        """Which object both fingers hold. Counts up while a finger touches, down while it does not."""
        gripping = False
        for item in [self._held] if self._held else self._bodies:
            counts = self._touches.setdefault(item.body, [0, 0])
            pressing = self._pressing(item.body)
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

    def _gripper_state(self) -> GripperState:
        if self._gripper_slices_left:
            return "moving"
        return "closed" if self._closing else "open"

    def _object_state(self, item: Body) -> ObjectState:
        pose = self._pose_of(item.body)
        spec = item.placed.spec
        settled = item is not self._held and item.rest_slices >= SETTLED_SLICES
        return ObjectState(spec.id, pose, grasp_point(spec, pose), settled)


def walls(item: Bin) -> Iterator[tuple[Vector3, Vector3]]:
    """Centre and size of a bin's four walls."""
    (x_m, y_m), (inner_x_m, inner_y_m) = item.center_xy_m, item.inner_size_m
    z_m, height_m = item.height_m / 2.0, item.height_m
    for side in (-1.0, 1.0):
        center_x_m = x_m + side * (inner_x_m + BIN_WALL_M) / 2.0
        yield (center_x_m, y_m, z_m), (BIN_WALL_M, inner_y_m + 2.0 * BIN_WALL_M, height_m)
    for side in (-1.0, 1.0):
        center_y_m = y_m + side * (inner_y_m + BIN_WALL_M) / 2.0
        yield (x_m, center_y_m, z_m), (inner_x_m, BIN_WALL_M, height_m)
