"""A robot without physics: the arm is where it is told to be, and a few stated rules decide what objects do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim import fetch, ik
from sim.interface import (
    SLICE_S,
    SLICES_PER_TICK,
    TICK_S,
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
    steps_m,
)
from sim.objects import grasp_point

FINGER_STEP_M = fetch.MAX_OPENING_M / fetch.GRIPPER_SLICES
GRASP_X_M = 0.03
GRASP_Z_M = 0.03
KNOCK_DEPTH_M = 0.02
STAND_DROP_M = 0.05
SETTLE_SLICES = 30

_FINGER_BACK_M = fetch.FINGER_CENTER_X_M - fetch.FINGER_SIZE_M[0] / 2.0
_FINGER_FRONT_M = fetch.FINGER_CENTER_X_M + fetch.FINGER_SIZE_M[0] / 2.0
_FINGER_HALF_HEIGHT_M = fetch.FINGER_SIZE_M[2] / 2.0
_PALM_BACK_M = fetch.PALM_CENTER_M[0] - fetch.PALM_SIZE_M[0] / 2.0
_PALM_FRONT_M = fetch.PALM_CENTER_M[0] + fetch.PALM_SIZE_M[0] / 2.0
_PALM_HALF_WIDTH_M = fetch.PALM_SIZE_M[1] / 2.0
_PALM_HALF_HEIGHT_M = fetch.PALM_SIZE_M[2] / 2.0
_OPEN_M = fetch.FINGER_TRAVEL_M + fetch.FINGER_SIZE_M[1]
_REACH_INTO_M = 0.03
"""How far beyond the gripper's outline a carried object or another's footprint may matter, less `KNOCK_DEPTH_M`."""


@dataclass
class _Thing:
    """An object now. `busy_until` is the slice at which it has settled, infinite while held."""

    placed: PlacedObject
    pose: Pose
    standing: bool = True
    busy_until: float = 0.0
    shown: ObjectState | None = None
    """What was last observed, as long as it still holds."""

    def state(self, now: int) -> ObjectState:
        settled = now >= self.busy_until
        if self.shown is None or self.shown.settled != settled:
            spec = self.placed.spec
            self.shown = ObjectState(spec.id, self.pose, grasp_point(spec, self.pose), settled)
        return self.shown

    def put(self, pose: Pose) -> None:
        self.pose = pose
        self.shown = None


class KinematicRobot:
    """A `Robot` in plain numbers: same inputs, same states, on any machine with the same floating point.

    Motion: the gripper is exactly on its path; reach and limits are those of `sim.ik`, as for every robot.

    Grasping: closing fingers hold a standing object when they meet it with its grasp point within `GRASP_X_M` along x
    and `GRASP_Z_M` in height of the gripper, and its middle between the pads. It is then centred between the pads and
    moves with the gripper until they open. A carried object cannot be pushed into the table: the arm stops (`lagging`).

    Knocking over: a standing object falls when a finger, the palm or a carried object reaches more than
    `KNOCK_DEPTH_M` into its footprint (taken as a circle), or when closing fingers meet it outside those tolerances.
    It lies in the direction of the motion at once and settles after `SETTLE_SLICES`; one whose middle is then off the
    table lies on the floor. What lies can neither be touched nor grasped.

    Dropping: over a bin's opening the object stands on the bin's floor; over the table it stands when its base is at
    most `STAND_DROP_M` above it, else it lies; anywhere else it lies on the floor. It settles after `SETTLE_SLICES`.
    """

    def __init__(self) -> None:
        self._scene: SceneSpec | None = None
        self._things: tuple[_Thing, ...] = ()
        self._near: tuple[_Thing, ...] = ()
        self._position: Vector3 = fetch.START_POSITION_M
        self._path: list[Vector3] = []
        """What is left of the way, its end first: the next waypoint is the cheap one to take."""
        self._steps_m: Sequence[Sequence[Vector3]] = ()
        """The steps of a whole tick's way of which no slice has been gone; the path is made of them when it matters."""
        self._goes_down = False
        self._slice = 0
        self._opening_m = fetch.MAX_OPENING_M
        self._closing = False
        self._gripper_slices_left = 0
        self._held: _Thing | None = None
        self._held_offset_m: Vector3 = (0.0, 0.0, 0.0)
        self._lagging = False

    def reset(self, scene: SceneSpec) -> None:
        """Build a fresh world: arm at the start pose, gripper open, objects at rest.

        Raises `SimError` when the start is out of reach.
        """
        code = ik.solve(scene.start_world_m)[1]
        if code:
            raise SimError(f"start position {scene.start_world_m}: {ik.REASONS[code]}")
        self._scene = scene
        self._things = tuple(_Thing(placed, placed.rest_pose) for placed in scene.objects)
        self._near = ()
        self._position = scene.start_world_m
        self._path, self._steps_m = [], ()
        self._slice = 0
        self._opening_m = fetch.MAX_OPENING_M
        self._closing = False
        self._gripper_slices_left = 0
        self._held = None
        self._lagging = False

    def command(self, command: RobotCommand) -> MotionVerdict:
        """Take the next tick's command; drops or stops what cannot be reached, never jumps.

        Raises `SimError` before the first `reset`, and for a command outside its bounds (`sim.ik.check_command`).
        """
        self._world()
        verdict = ik.executable(self._position, command)
        self._lagging = False
        self._path, self._steps_m = [], ()
        if verdict is command.all_of_it:
            if command.moves:
                self._steps_m, self._goes_down = command.steps_m, command.goes_down
        elif command.speed_m_s > 0.0 and any(any(segment.direction) for segment in verdict.executed):
            self._steps_m, self._goes_down = steps_m(verdict.executed, command.speed_m_s), True
        if command.gripper != "hold" and self._closing != (command.gripper == "close"):
            self._closing = command.gripper == "close"
            self._gripper_slices_left = fetch.GRIPPER_SLICES
            if not self._closing:
                self._release()
        self._near = self._within_reach(command.speed_m_s * TICK_S) if self._steps_m else ()
        return verdict

    def advance(self, slices: int = 1) -> None:
        """Advance by so many slices. Raises `SimError` before the first `reset`."""
        self._world()
        end = self._slice + slices
        meets_nothing = not (self._near or self._gripper_slices_left or (self._held and self._goes_down))
        if self._steps_m:
            if meets_nothing and slices == SLICES_PER_TICK:  # only the end of the way matters
                self._slice, self._position, self._steps_m = end, ik.end_of(self._position, self._steps_m), ()
                return
            self._path, self._steps_m = ik.along(self._position, self._steps_m)[::-1], ()
        if self._path and meets_nothing:
            self._slice, self._position = end, self._path[-slices:][0]
            del self._path[-slices:]
        while self._slice < end and (self._path or self._gripper_slices_left):
            self._slice += 1
            if self._path:
                self._move(self._path.pop())
            if self._gripper_slices_left:
                self._gripper_slices_left -= 1
                self._move_fingers()
        self._slice = end

    def observe(self) -> WorldState:
        """The world as it is now. Raises `SimError` before the first `reset`."""
        self._world()
        self._carry()
        return WorldState(
            time_s=self._slice * SLICE_S,
            position_world_gripper_m=self._position,
            joint_positions_rad=ik.solve(self._position)[0],
            finger_opening_m=self._opening_m,
            gripper=self._gripper_state(),
            held=self._held.placed.spec.id if self._held else None,
            lagging=self._lagging,
            objects=tuple([thing.state(self._slice) for thing in self._things]),
        )

    def feasible(self, displacements_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which straight displacements, shape (N, 3), from the present position stay reachable; shape (N,)."""
        return ik.segment_feasible(self._position, displacements_m)

    def close(self) -> None:
        """Forget the world; may be called twice."""
        self._scene = None

    def __enter__(self) -> KinematicRobot:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _world(self) -> SceneSpec:
        if self._scene is None:
            raise SimError("the robot has no world; call reset(scene) first")
        return self._scene

    def _gripper_state(self) -> GripperState:
        if self._gripper_slices_left:
            return "moving"
        return "closed" if self._closing else "open"

    def _move(self, target: Vector3) -> None:
        if self._held and target[2] < self._position[2] and self._meets_table(self._held, target):
            self._lagging = True
            self._path.clear()
            return
        before, self._position = self._position, target
        for thing in self._near:
            if thing.standing and thing is not self._held and self._depth_m(thing) > KNOCK_DEPTH_M:
                self._knock_over(thing, (target[0] - before[0], target[1] - before[1]))

    def _meets_table(self, held: _Thing, target: Vector3) -> bool:
        """Whether the held object would be pushed into the table with the gripper there."""
        table = self._world().table
        x_m, y_m, z_m = _plus(target, self._held_offset_m)
        return z_m - held.placed.spec.size_m[2] / 2.0 < table.top_z_m - 1e-9 and table.covers(x_m, y_m)

    def _carry(self) -> None:
        """The held object goes where the gripper went; nobody looks at it on the way."""
        if self._held:
            place = _plus(self._position, self._held_offset_m)
            if place != self._held.pose.position_world_m:
                self._held.put(Pose(place, self._held.pose.quaternion_wxyz))

    def _move_fingers(self) -> None:
        if not self._closing:
            self._opening_m = min(self._opening_m + FINGER_STEP_M, fetch.MAX_OPENING_M)
            return
        if self._held:
            return
        self._opening_m = max(self._opening_m - FINGER_STEP_M, 0.0)
        for thing in self._things:
            x_m, y_m, z_m = self._offset_m(thing)
            spec = thing.placed.spec
            half_m = spec.size_m[1] / 2.0
            touched = abs(y_m) + half_m >= self._opening_m / 2.0 and abs(y_m) <= self._opening_m / 2.0
            if not thing.standing or not touched or abs(z_m) > spec.size_m[2] / 2.0 + _FINGER_HALF_HEIGHT_M:
                continue
            high_m = spec.grasp_height_m - spec.size_m[2] / 2.0
            if abs(x_m) <= GRASP_X_M and abs(z_m + high_m) <= GRASP_Z_M:
                self._opening_m = spec.size_m[1]
                self._held = thing
                self._held_offset_m = (x_m, 0.0, z_m)
                thing.busy_until = math.inf
                self._carry()
                return
            if _FINGER_BACK_M - half_m < x_m < _FINGER_FRONT_M + half_m:
                self._knock_over(thing, (x_m, y_m))

    def _within_reach(self, way_m: float) -> tuple[_Thing, ...]:
        """The standing objects that gripper or carried object can knock over during a tick of that way."""
        x_m, y_m, _ = self._position
        most_m = way_m + ik.ROUNDING_M
        more_m = most_m + _REACH_INTO_M
        behind_m, ahead_m, beside_m = _PALM_BACK_M - more_m, _FINGER_FRONT_M + more_m, _OPEN_M + more_m
        found = []
        for thing in self._things:
            there = thing.pose.position_world_m
            if (
                -beside_m < there[1] - y_m < beside_m
                and behind_m < there[0] - x_m < ahead_m
                and thing.standing
                and thing is not self._held
                # Fingers that move may reach further than the way.
                and (self._gripper_slices_left or self._depth_m(thing, at_any_height=True) > KNOCK_DEPTH_M - most_m)
            ):
                found.append(thing)
        return tuple(found)

    def _offset_m(self, thing: _Thing) -> Vector3:
        """From the gripper to the object's centre."""
        here, there = self._position, thing.pose.position_world_m
        return there[0] - here[0], there[1] - here[1], there[2] - here[2]

    def _depth_m(self, thing: _Thing, at_any_height: bool = False) -> float:
        """How far gripper or carried object reach into a standing object's footprint; negative = clear of it, as they
        are above it or below, unless that does not count."""
        x_m, y_m, z_m = self._offset_m(thing)
        size_x_m, size_y_m, size_z_m = thing.placed.spec.size_m
        radius_m, half_z_m = min(size_x_m, size_y_m) / 2.0, size_z_m / 2.0
        gap_m = math.inf
        if at_any_height or abs(z_m) < half_z_m + _FINGER_HALF_HEIGHT_M:
            beside_m = (
                abs(abs(y_m) - self._opening_m / 2.0 - fetch.FINGER_SIZE_M[1] / 2.0) - fetch.FINGER_SIZE_M[1] / 2.0
            )
            gap_m = math.hypot(max(_FINGER_BACK_M - x_m, x_m - _FINGER_FRONT_M, 0.0), max(beside_m, 0.0))
        if at_any_height or abs(z_m) < half_z_m + _PALM_HALF_HEIGHT_M:
            along_m = max(_PALM_BACK_M - x_m, x_m - _PALM_FRONT_M, 0.0)
            gap_m = min(gap_m, math.hypot(along_m, max(abs(y_m) - _PALM_HALF_WIDTH_M, 0.0)))
        if self._held:
            carried = self._held.placed.spec
            dx_m, dy_m, dz_m = self._held_offset_m
            if at_any_height or abs(z_m - dz_m) < half_z_m + carried.size_m[2] / 2.0:
                between_m = math.hypot(x_m - dx_m, y_m - dy_m) - min(carried.size_m[0], carried.size_m[1]) / 2.0
                gap_m = min(gap_m, between_m)
        return radius_m - gap_m

    def _knock_over(self, thing: _Thing, push: tuple[float, float]) -> None:
        """Lay an object down in the direction of the push (away from the gripper when that has no direction)."""
        x_m, y_m, _ = self._offset_m(thing)
        length = math.hypot(*push)
        along = push if length > 1e-9 else (x_m, y_m)
        length = math.hypot(*along)
        direction = (along[0] / length, along[1] / length) if length > 1e-9 else (1.0, 0.0)
        size_x_m, size_y_m, size_z_m = thing.placed.spec.size_m
        reach_m = size_z_m / 2.0 + min(size_x_m, size_y_m) / 2.0
        there = thing.pose.position_world_m
        self._lay(thing, there[0] + reach_m * direction[0], there[1] + reach_m * direction[1], direction)

    def _lay(self, thing: _Thing, x_m: float, y_m: float, direction: tuple[float, float]) -> None:
        table = self._world().table
        below_m = table.top_z_m if table.covers(x_m, y_m) else 0.0
        half_thick_m = min(thing.placed.spec.size_m[0], thing.placed.spec.size_m[1]) / 2.0
        half = math.sqrt(0.5)
        # A quarter turn about the horizontal axis across the direction.
        turn = (half, -direction[1] * half, direction[0] * half, 0.0)
        thing.standing = False
        thing.busy_until = self._slice + SETTLE_SLICES
        thing.put(Pose((x_m, y_m, below_m + half_thick_m), turn))

    def _release(self) -> None:
        self._carry()
        thing, self._held = self._held, None
        if thing is None:
            return
        scene = self._world()
        x_m, y_m, z_m = thing.pose.position_world_m
        half_z_m = thing.placed.spec.size_m[2] / 2.0
        upright = thing.pose.quaternion_wxyz
        thing.busy_until = self._slice + SETTLE_SLICES
        if any(item.distance_m(x_m, y_m) == 0.0 for item in scene.bins):
            thing.put(Pose((x_m, y_m, half_z_m), upright))
        elif scene.table.covers(x_m, y_m) and z_m - half_z_m - scene.table.top_z_m <= STAND_DROP_M:
            thing.put(Pose((x_m, y_m, scene.table.top_z_m + half_z_m), upright))
        else:
            self._lay(thing, x_m, y_m, (1.0, 0.0))


def _plus(first_m: Vector3, second_m: Vector3) -> Vector3:
    return first_m[0] + second_m[0], first_m[1] + second_m[1], first_m[2] + second_m[2]
