"""What every robot promises, and the values that cross between it and the rest of the lab.

World frame: z up, x forward from the robot's base, y left; metres, seconds, radians. Quaternions are (w, x, y, z).

One tick of the lab is `SLICES_PER_TICK` slices. A caller gives one `RobotCommand` for the whole tick and then advances
through it, at once or slice by slice, as slowly as it likes: what happens depends on the commands alone, never on the
pacing.

    robot.reset(scene)                      a fresh world, arm at the start pose, gripper open
    verdict = robot.command(command)        what of the command will be executed, and why not the rest
    robot.advance(SLICES_PER_TICK)
    state = robot.observe()
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

SLICES_PER_TICK = 15
TICK_S = 0.5
SLICE_S = TICK_S / SLICES_PER_TICK

BIN_WALL_M = 0.012
"""Thickness of a bin's walls, outside its inner size."""

Vector3 = tuple[float, float, float]
QuaternionWxyz = tuple[float, float, float, float]
Rgb = tuple[int, int, int]
"""A display colour, 0 to 255 each."""
STEEL: Rgb = (150, 158, 166)
Shape = Literal["cylinder", "box"]
GripperCommand = Literal["hold", "open", "close"]
GripperState = Literal["open", "closed", "moving"]


class SimError(ValueError):
    """A value the simulated world cannot take; the message gives the value, the bound and the choices."""


@dataclass(frozen=True)
class Pose:
    """A body's centre in the world frame (metres) and its orientation (w, x, y, z)."""

    position_world_m: Vector3
    quaternion_wxyz: QuaternionWxyz = (1.0, 0.0, 0.0, 0.0)

    @property
    def tilt_rad(self) -> float:
        """Angle between the body's own z axis and the world's, 0 when upright."""
        _, x, y, _ = self.quaternion_wxyz
        return math.acos(min(max(1.0 - 2.0 * (x * x + y * y), -1.0), 1.0))


@dataclass(frozen=True)
class Look:
    """How an object is drawn: as its shape in its colour, unless it has a drawing or a mesh. No robot reads it."""

    color_rgb: Rgb = STEEL
    drawing: str = ""
    """Name of a drawing of `sim.view.props`; it has colours of its own."""
    mesh_obj: str = ""
    """Text of a Wavefront OBJ file."""


@dataclass(frozen=True)
class ObjectSpec:
    """A graspable object. `size_m` is (x, y, z); a cylinder has x = y = diameter. The origin is the centre."""

    id: str
    label: str
    shape: Shape
    size_m: Vector3
    mass_kg: float
    friction: float
    grasp_height_m: float
    """Height above the object's base at which the fingers close."""
    look: Look = Look()


@dataclass(frozen=True)
class PlacedObject:
    """An object standing on the table, its base centre at `base_world_m`."""

    spec: ObjectSpec
    base_world_m: Vector3
    yaw_rad: float = 0.0

    @property
    def rest_pose(self) -> Pose:
        """The pose of the object's centre when it stands undisturbed."""
        x, y, z = self.base_world_m
        half_yaw_rad = self.yaw_rad / 2.0
        return Pose(
            (x, y, z + self.spec.size_m[2] / 2.0),
            (float(np.cos(half_yaw_rad)), 0.0, 0.0, float(np.sin(half_yaw_rad))),
        )


@dataclass(frozen=True)
class Table:
    """A box whose top face is the work surface."""

    center_world_m: Vector3
    size_m: Vector3

    @property
    def top_z_m(self) -> float:
        """Height of the work surface."""
        return self.center_world_m[2] + self.size_m[2] / 2.0

    def covers(self, x_m: float, y_m: float) -> bool:
        """Whether (x, y) lies over the table top."""
        return (
            abs(x_m - self.center_world_m[0]) <= self.size_m[0] / 2.0
            and abs(y_m - self.center_world_m[1]) <= self.size_m[1] / 2.0
        )


@dataclass(frozen=True)
class Bin:
    """An open box on the floor; `inner_size_m` is (x, y), `release_world_m` the gripper position above it."""

    id: str
    label: str
    center_xy_m: tuple[float, float]
    inner_size_m: tuple[float, float]
    height_m: float
    release_world_m: Vector3
    color_rgb: Rgb = STEEL
    letter: str = ""
    """What is written on it."""

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Horizontal distance from (x, y) to the bin's opening, 0 inside."""
        dx_m = max(abs(x_m - self.center_xy_m[0]) - self.inner_size_m[0] / 2.0, 0.0)
        dy_m = max(abs(y_m - self.center_xy_m[1]) - self.inner_size_m[1] / 2.0, 0.0)
        return float(np.hypot(dx_m, dy_m))


@dataclass(frozen=True)
class SceneSpec:
    """Everything a robot needs to build a fresh world. The order of `objects` is the order of creation."""

    table: Table
    bins: tuple[Bin, ...]
    objects: tuple[PlacedObject, ...]
    start_world_m: Vector3
    gone: tuple[ObjectSpec, ...] = ()
    """What stood there in earlier cycles; for pictures, no robot reads it."""

    def object(self, object_id: str) -> PlacedObject:
        """The placed object of that id; `SimError` names the ones there are."""
        for placed in self.objects:
            if placed.spec.id == object_id:
                return placed
        raise SimError(f"no object {object_id!r} in the scene; it has {[p.spec.id for p in self.objects]}")

    def bin(self, bin_id: str) -> Bin:
        """The bin of that id; `SimError` names the ones there are."""
        for candidate in self.bins:
            if candidate.id == bin_id:
                return candidate
        raise SimError(f"no bin {bin_id!r} in the scene; it has {[b.id for b in self.bins]}")


@dataclass(frozen=True)
class MotionSegment:
    """Move along `direction` (norm ≤ 1, world frame; zero = stand still) for a number of slices."""

    direction: Vector3
    slices: int


@dataclass(frozen=True)
class RobotCommand:
    """One tick's command: segments that fill the tick, at `speed_m_s` times each direction, and the gripper's."""

    segments: tuple[MotionSegment, ...]
    speed_m_s: float
    gripper: GripperCommand = "hold"

    @cached_property
    def fills_a_tick(self) -> bool:
        """Whether its segments are as long as a tick, each with a direction of length 1 at most."""
        lengths = [segment.slices for segment in self.segments]
        squares = [x * x + y * y + z * z for x, y, z in (segment.direction for segment in self.segments)]
        is_whole = sum(lengths) == SLICES_PER_TICK and min(lengths) >= 1
        return is_whole and all(math.sqrt(square) <= 1.0 + 1e-9 for square in squares)

    @cached_property
    def all_of_it(self) -> MotionVerdict:
        """The verdict that nothing stands against it."""
        return MotionVerdict(self.segments, False)

    @cached_property
    def steps_m(self) -> tuple[tuple[Vector3, ...], ...]:
        """How far the gripper has come after each slice of each segment, from where the segment begins."""
        return steps_m(self.segments, self.speed_m_s)

    @cached_property
    def moves(self) -> bool:
        """Whether it asks for any motion."""
        return self.speed_m_s > 0.0 and any(any(segment.direction) for segment in self.segments)

    @cached_property
    def goes_down(self) -> bool:
        """Whether any of it leads downwards."""
        return any(segment.direction[2] < 0.0 for segment in self.segments)


def steps_m(segments: Sequence[MotionSegment], speed_m_s: float) -> tuple[tuple[Vector3, ...], ...]:
    """How far the gripper has come after each slice of each of these segments, from where the segment begins."""
    step_m = speed_m_s * SLICE_S
    return tuple(
        tuple((step_m * count * x, step_m * count * y, step_m * count * z) for count in range(1, segment.slices + 1))
        for segment in segments
        for x, y, z in (segment.direction,)
    )


@dataclass(frozen=True)
class MotionVerdict:
    """What of a command is executed. `executed` holds the segments after limits; `reason` says what stopped the rest.

    `blocked` is true when motion was asked for and nothing of the last segment's direction is left.
    """

    executed: tuple[MotionSegment, ...]
    blocked: bool
    reason: str | None = None


@dataclass(frozen=True)
class ObjectState:
    """An object as it is now. `settled` means below 0.01 m/s and 0.1 rad/s for 0.25 s."""

    id: str
    pose: Pose
    grasp_world_m: Vector3
    settled: bool

    @cached_property
    def packed(self) -> bytes:
        """Its pose, and whether it has settled, as a digest takes them."""
        return struct.pack("<8d", *self.pose.position_world_m, *self.pose.quaternion_wxyz, float(self.settled))


@dataclass(frozen=True)
class WorldState:
    """The world after a slice. `position_world_gripper_m` is the gripper_link origin between the fingertips."""

    time_s: float
    position_world_gripper_m: Vector3
    joint_positions_rad: tuple[float, ...]
    """In the order of `sim.fetch.ARM_JOINT_NAMES` (7 values); the torso is fixed."""
    finger_opening_m: float
    """Distance between the finger pads."""
    gripper: GripperState
    held: str | None
    """Id of the object both fingers hold, if any."""
    lagging: bool
    """Whether the arm is pressed against something and the command is frozen."""
    objects: tuple[ObjectState, ...]

    def object(self, object_id: str) -> ObjectState:
        """The state of one object; `SimError` names the ones there are."""
        for state in self.objects:
            if state.id == object_id:
                return state
        raise SimError(f"no object {object_id!r} in the world; it has {[o.id for o in self.objects]}")

    def digest(self) -> str:
        """A hash of every number, bit for bit: equal digests mean equal states."""
        lagging = float(self.lagging)
        numbers = (
            self.time_s,
            *self.position_world_gripper_m,
            *self.joint_positions_rad,
            self.finger_opening_m,
            lagging,
        )
        packed = [struct.pack(f"<{len(numbers)}d", *numbers), *[item.packed for item in self.objects]]
        packed.append("|".join([self.gripper, self.held or "", *[item.id for item in self.objects]]).encode())
        return hashlib.sha256(b"".join(packed)).hexdigest()[:16]


class Robot(Protocol):
    """A Fetch arm and the table in front of it, simulated or real."""

    def reset(self, scene: SceneSpec) -> None:
        """Build a fresh world: arm at the start pose, gripper open, objects at rest."""

    def command(self, command: RobotCommand) -> MotionVerdict:
        """Take the next tick's command; drops or stops what cannot be reached, never jumps.

        Raises `SimError` when the segments do not fill a tick or a direction is longer than 1.
        """

    def advance(self, slices: int = 1) -> None:
        """Advance by so many slices (1/30 s each), at least one, to the very state that as many calls lead to."""

    def observe(self) -> WorldState:
        """The world as it is now."""

    def feasible(self, displacements_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which straight displacements, shape (N, 3), from the present position stay reachable; shape (N,)."""

    def close(self) -> None:
        """Release the world; may be called twice."""


def run_tick(robot: Robot, command: RobotCommand) -> tuple[MotionVerdict, WorldState]:
    """Command one whole tick and advance through it."""
    verdict = robot.command(command)
    robot.advance(SLICES_PER_TICK)
    return verdict, robot.observe()


def still(gripper: GripperCommand = "hold") -> RobotCommand:
    """A tick without motion."""
    return RobotCommand((MotionSegment((0.0, 0.0, 0.0), SLICES_PER_TICK),), 0.0, gripper)


def steady(direction: Sequence[float], speed_m_s: float) -> RobotCommand:
    """A whole tick along one direction."""
    x, y, z = (float(value) for value in direction)
    return RobotCommand((MotionSegment((x, y, z), SLICES_PER_TICK),), speed_m_s)
