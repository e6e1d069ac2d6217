"""Closed-form inverse kinematics with the gripper level and pointing forward, and what is within reach. Pure.

With the orientation fixed, the wrist centre follows from the position; the shoulder pan is its bearing, shoulder lift
and elbow are a two-link triangle (elbow up), and the last three joints undo the first ones. The upper-arm roll stays
0. So the posture depends on the position alone: no drift, no elbow flips.

    wrist centre = p - (HAND_M, 0, 0)
    pan          = atan2(y, x - x_pan)
    elbow        = acos((d² - l1² - l2²) / (2 l1 l2)),   d from shoulder to wrist centre
    lift         = slope of that line - atan2(l2 sin elbow, l1 + l2 cos elbow)
    a            = lift + elbow                          pitch of the forearm
    Rx(forearm roll) Ry(wrist flex) Rx(wrist roll) = Ry(-a) Rz(-pan)

What cannot be reached is dropped, axis by axis, or stops (`executable`): both robots decide it here, in one way.
A straight path is within reach when every sample of it, at most `SAMPLE_M` apart, is in the workspace box and within
joint limits. Joint rates need no check of their own: nowhere in the workspace does a joint turn by more than
`MAX_TURN_RAD_PER_M`, so at `MAX_SPEED_M_S` the fastest one is at 88 % of its rated speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from sim import fetch
from sim.interface import (
    SLICE_S,
    SLICES_PER_TICK,
    TICK_S,
    GripperCommand,
    MotionSegment,
    MotionVerdict,
    RobotCommand,
    SimError,
    Vector3,
    steps_m,
)
from sim.reach import ELBOW_RAD as ELBOW_RAD
from sim.reach import ROUNDING_M as ROUNDING_M
from sim.reach import WORKSPACE_HIGH_M as WORKSPACE_HIGH_M
from sim.reach import WORKSPACE_LOW_M as WORKSPACE_LOW_M
from sim.reach import is_sure_around

FloatArray = NDArray[np.float64]
Joints = tuple[float, float, float, float, float, float, float]

SAMPLE_M = 0.01
MAX_STEP_M = 0.05
"""The longest way the gripper may go in one tick (paper III-D: waypoints at most 5 cm apart)."""
MAX_SPEED_M_S = MAX_STEP_M / TICK_S
MAX_TURN_RAD_PER_M = (9.9, 6.6, 0.0, 13.4, 7.0, 8.4, 9.4)
"""Upper bounds of each joint's turn per metre of the gripper's way, over the whole workspace."""

REASONS = (
    "",
    "edge of the workspace",
    "the arm cannot stretch further",
    "the arm cannot fold further",
    "a shoulder joint is at its limit",
    "the wrist is at its limit",
)
"""What stops a motion, by code; 0 is nothing."""
_BOX, _STRETCH, _FOLD, _SHOULDER, _WRIST = range(1, 6)

_GRIPPER_COMMANDS: tuple[str, ...] = get_args(GripperCommand)
_MIN_STRETCH = math.cos(ELBOW_RAD[1])
_MAX_STRETCH = math.cos(ELBOW_RAD[0])
_MIN_WRIST = math.cos(fetch.LOWER_RAD[5])


class _Maths(NamedTuple):
    """The functions the formula needs, for numbers or for arrays: one formula serves both."""

    hypot: Callable[[Any, Any], Any]
    atan2: Callable[[Any, Any], Any]
    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    acos: Callable[[Any], Any]
    """Of the argument clipped to [-1, 1]."""


_NUMBERS = _Maths(math.hypot, math.atan2, math.sin, math.cos, lambda c: math.acos(-1.0 if c < -1.0 else min(c, 1.0)))
_ARRAYS = _Maths(np.hypot, np.arctan2, np.sin, np.cos, lambda c: np.arccos(np.clip(c, -1.0, 1.0)))


def _posture(x_m: Any, y_m: Any, z_m: Any, maths: _Maths) -> tuple[Any, Any, Any, Any, Any, Any, Any]:
    """(pan, lift, elbow, forearm roll, wrist flex, wrist roll, cosine of the elbow before clipping)."""
    hypot, atan2, sin, cos, acos = maths
    upper_m, fore_m = fetch.UPPER_ARM_M, fetch.FOREARM_M
    forward_m = x_m - fetch.HAND_M - fetch.PAN_AXIS_M[0]
    pan = atan2(y_m, forward_m)
    out_m = hypot(forward_m, y_m) - fetch.SHOULDER_FORWARD_M
    down_m = fetch.PAN_AXIS_M[2] + fetch.SHOULDER_UP_M - z_m
    bend = (out_m * out_m + down_m * down_m - upper_m * upper_m - fore_m * fore_m) / (2.0 * upper_m * fore_m)
    elbow = acos(bend)
    lift = atan2(down_m, out_m) - atan2(fore_m * sin(elbow), upper_m + fore_m * cos(elbow))
    pitch = lift + elbow
    sin_a, cos_a, sin_pan, cos_pan = sin(pitch), cos(pitch), sin(pan), cos(pan)
    wrist_flex = -acos(cos_a * cos_pan)
    forearm_roll = atan2(sin_pan, sin_a * cos_pan)
    wrist_roll = atan2(-cos_a * sin_pan, sin_a)
    return pan, lift, elbow, forearm_roll, wrist_flex, wrist_roll, bend


def into_workspace(position_world_gripper_m: Vector3) -> Vector3:
    """The nearest position within the box of the workspace; the arm may still be too short for it."""
    x_m, y_m, z_m = (
        min(max(value_m, low_m), high_m)
        for value_m, low_m, high_m in zip(position_world_gripper_m, WORKSPACE_LOW_M, WORKSPACE_HIGH_M, strict=True)
    )
    return x_m, y_m, z_m


@lru_cache(maxsize=1024)  # an arm at rest and objects that stand are asked about tick after tick
def solve(position_world_gripper_m: Vector3) -> tuple[Joints, int]:
    """Posture at one position, and what is wrong with it: an index of `REASONS`, 0 when it is within reach.

    The joints are only meaningful at 0. Order of joints: `sim.fetch.ARM_JOINT_NAMES`.
    """
    x_m, y_m, z_m = position_world_gripper_m
    pan, lift, elbow, forearm_roll, wrist_flex, wrist_roll, bend = _posture(x_m, y_m, z_m, _NUMBERS)
    code = 0
    low, high = WORKSPACE_LOW_M, WORKSPACE_HIGH_M
    slack_m = ROUNDING_M
    if not (
        low[0] - slack_m <= x_m <= high[0] + slack_m
        and low[1] - slack_m <= y_m <= high[1] + slack_m
        and low[2] - slack_m <= z_m <= high[2] + slack_m
    ):
        code = _BOX
    elif bend > _MAX_STRETCH:
        code = _STRETCH
    elif bend < _MIN_STRETCH:
        code = _FOLD
    elif not (fetch.LOWER_RAD[0] <= pan <= fetch.UPPER_RAD[0] and fetch.LOWER_RAD[1] <= lift <= fetch.UPPER_RAD[1]):
        code = _SHOULDER
    elif wrist_flex < fetch.LOWER_RAD[5]:
        code = _WRIST
    return (pan, lift, 0.0, elbow, forearm_roll, wrist_flex, wrist_roll), code


def solve_many(positions_world_gripper_m: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Postures, shape (N, 7), and codes, shape (N,), at positions of shape (N, 3); as `solve`, for arrays."""
    points = np.asarray(positions_world_gripper_m, dtype=np.float64)
    x_m, y_m, z_m = points.T
    pan, lift, elbow, forearm_roll, wrist_flex, wrist_roll, bend = _posture(x_m, y_m, z_m, _ARRAYS)
    low, high = np.array(WORKSPACE_LOW_M) - ROUNDING_M, np.array(WORKSPACE_HIGH_M) + ROUNDING_M
    inside = np.all((points >= low) & (points <= high), axis=1)
    shoulder_ok = (
        (pan >= fetch.LOWER_RAD[0])
        & (pan <= fetch.UPPER_RAD[0])
        & (lift >= fetch.LOWER_RAD[1])
        & (lift <= fetch.UPPER_RAD[1])
    )
    wrong = [~inside, bend > _MAX_STRETCH, bend < _MIN_STRETCH, ~shoulder_ok, wrist_flex < fetch.LOWER_RAD[5]]
    codes = np.select(wrong, [_BOX, _STRETCH, _FOLD, _SHOULDER, _WRIST], 0)
    joints = np.stack([pan, lift, np.zeros_like(pan), elbow, forearm_roll, wrist_flex, wrist_roll], axis=1)
    return joints, codes


def within_reach(positions_world_gripper_m: FloatArray) -> NDArray[np.bool_]:
    """Whether each position is within reach, (..., 3) -> (...): code 0 of `solve_many`, in a third of the time."""
    x_m, y_m, z_m = (positions_world_gripper_m[..., axis] for axis in range(3))
    upper_m, fore_m = fetch.UPPER_ARM_M, fetch.FOREARM_M
    (low_x, low_y, low_z), (high_x, high_y, high_z), slack_m = WORKSPACE_LOW_M, WORKSPACE_HIGH_M, ROUNDING_M
    forward_m = x_m - fetch.HAND_M - fetch.PAN_AXIS_M[0]
    level_m = np.hypot(forward_m, y_m)
    out_m = level_m - fetch.SHOULDER_FORWARD_M
    down_m = fetch.PAN_AXIS_M[2] + fetch.SHOULDER_UP_M - z_m
    bend = (out_m * out_m + down_m * down_m - upper_m * upper_m - fore_m * fore_m) / (2.0 * upper_m * fore_m)
    fits: NDArray[np.bool_] = (bend <= _MAX_STRETCH) & (bend >= _MIN_STRETCH)
    fits &= (x_m >= low_x - slack_m) & (x_m <= high_x + slack_m)
    fits &= (y_m >= low_y - slack_m) & (y_m <= high_y + slack_m)
    fits &= (z_m >= low_z - slack_m) & (z_m <= high_z + slack_m)
    pan = np.arctan2(y_m, forward_m)
    fits &= (pan >= fetch.LOWER_RAD[0]) & (pan <= fetch.UPPER_RAD[0])
    elbow = np.arccos(np.clip(bend, -1.0, 1.0))
    lift = np.arctan2(down_m, out_m) - np.arctan2(fore_m * np.sin(elbow), upper_m + fore_m * bend)
    fits &= (lift >= fetch.LOWER_RAD[1]) & (lift <= fetch.UPPER_RAD[1])
    # The wrist bends by the angle between the forearm and straight ahead.
    fits &= np.cos(lift + elbow) * forward_m >= _MIN_WRIST * level_m
    return fits


def path_code(start_world_m: Vector3, end_world_m: Vector3) -> int:
    """What stops a straight path: an index of `REASONS`, 0 when it can be followed to its end.

    A start out of reach does not count by itself, so that an arm never gets stuck by rounding.
    """
    x_m, y_m, z_m = start_world_m
    dx_m, dy_m, dz_m = end_world_m[0] - x_m, end_world_m[1] - y_m, end_world_m[2] - z_m
    length_m = math.sqrt(dx_m * dx_m + dy_m * dy_m + dz_m * dz_m)
    if length_m == 0.0:
        return 0
    if is_sure_around((x_m + dx_m / 2.0, y_m + dy_m / 2.0, z_m + dz_m / 2.0), length_m / 2.0):
        return 0
    samples = math.ceil(length_m / SAMPLE_M)
    for index in range(1, samples + 1):
        share = index / samples
        code = solve((x_m + share * dx_m, y_m + share * dy_m, z_m + share * dz_m))[1]
        if code:
            return code
    return 0


def segment_feasible(start_world_m: Vector3, displacements_m: FloatArray) -> NDArray[np.bool_]:
    """Which straight displacements, shape (N, 3), from one position stay within reach all the way; shape (N,).

    Samples every path as finely as the longest one needs. Zero displacements are always feasible.
    """
    moves = np.asarray(displacements_m, dtype=np.float64).reshape(-1, 3)
    if len(moves) == 1:
        x_m, y_m, z_m = start_world_m
        dx_m, dy_m, dz_m = moves[0].tolist()
        return np.array([path_code(start_world_m, (x_m + dx_m, y_m + dy_m, z_m + dz_m)) == 0])
    lengths_m = np.linalg.norm(moves, axis=1)
    longest_m = float(lengths_m.max(initial=0.0))
    if longest_m == 0.0:
        return np.ones(len(moves), dtype=np.bool_)
    samples = math.ceil(longest_m / SAMPLE_M)
    shares = np.arange(1, samples + 1) / samples  # (S,)
    points = np.asarray(start_world_m) + shares[None, :, None] * moves[:, None, :]  # (N, S, 3)
    codes = solve_many(points.reshape(-1, 3))[1].reshape(len(moves), samples)
    fits: NDArray[np.bool_] = (lengths_m == 0.0) | np.all(codes == 0, axis=1)
    return fits


def check_command(command: RobotCommand) -> None:
    """Raises `SimError` when the segments do not fill a tick, or a number or choice is out of its bounds."""
    if command.fills_a_tick and 0.0 <= command.speed_m_s <= MAX_SPEED_M_S and command.gripper in _GRIPPER_COMMANDS:
        return
    lengths = [segment.slices for segment in command.segments]
    if sum(lengths) != SLICES_PER_TICK or min(lengths) < 1:
        raise SimError(f"segments of {lengths} slices; positive lengths must add up to {SLICES_PER_TICK}")
    if not 0.0 <= command.speed_m_s <= MAX_SPEED_M_S:
        raise SimError(f"speed {command.speed_m_s} m/s; it must be from 0 to {MAX_SPEED_M_S} m/s")
    for segment in command.segments:
        x, y, z = segment.direction
        norm = math.sqrt(x * x + y * y + z * z)
        if not norm <= 1.0 + 1e-9:  # also refuses NaN
            raise SimError(f"direction {segment.direction} has length {norm}; at most 1")
    if command.gripper not in _GRIPPER_COMMANDS:
        raise SimError(f"gripper command {command.gripper!r}; choices are {', '.join(_GRIPPER_COMMANDS)}")


def executable(start_world_m: Vector3, command: RobotCommand) -> MotionVerdict:
    """What of a tick's command can be executed from that position.

    Each segment in turn keeps the most of its direction that is within reach: all of it, else without one axis, else
    without two (the longest rest first, then x before y before z), else it stands still. Raises `SimError` as
    `check_command`.
    """
    check_command(command)
    if not command.moves or is_sure_around(start_world_m, command.speed_m_s * TICK_S):
        return command.all_of_it
    here = start_world_m
    executed: list[MotionSegment] = []
    first_code = 0
    for segment in command.segments:
        length_m = command.speed_m_s * segment.slices * SLICE_S
        kept, code = _most_of(here, segment.direction, length_m)
        first_code = first_code or code
        executed.append(segment if kept == segment.direction else MotionSegment(kept, segment.slices))
        here = _moved(here, kept, length_m)
    asked, left = command.segments[-1].direction, executed[-1].direction
    return MotionVerdict(tuple(executed), any(asked) and not any(left), REASONS[first_code] or None)


def _most_of(start_world_m: Vector3, direction: Vector3, length_m: float) -> tuple[Vector3, int]:
    """The part of the direction that is within reach, and what stopped the rest (an index of `REASONS`)."""
    if length_m == 0.0 or not any(direction):
        return direction, 0
    code = path_code(start_world_m, _moved(start_world_m, direction, length_m))
    if not code:
        return direction, 0
    axes = [axis for axis in range(3) if direction[axis]]
    rests = [keep for size in range(len(axes) - 1, 0, -1) for keep in combinations(axes, size)]
    rests.sort(key=lambda keep: -sum(direction[axis] ** 2 for axis in keep))
    for keep in rests:
        x, y, z = (direction[axis] if axis in keep else 0.0 for axis in range(3))
        if not path_code(start_world_m, _moved(start_world_m, (x, y, z), length_m)):
            return (x, y, z), code
    return (0.0, 0.0, 0.0), code


def _moved(start_world_m: Vector3, direction: Vector3, length_m: float) -> Vector3:
    return (
        start_world_m[0] + length_m * direction[0],
        start_world_m[1] + length_m * direction[1],
        start_world_m[2] + length_m * direction[2],
    )


def waypoints(start_world_m: Vector3, verdict: MotionVerdict, speed_m_s: float) -> list[Vector3]:
    """Where the gripper is to be after each slice of the tick; `SLICES_PER_TICK` positions."""
    return along(start_world_m, steps_m(verdict.executed, speed_m_s))


def along(start_world_m: Vector3, steps: Sequence[Sequence[Vector3]]) -> list[Vector3]:
    """Every position along those steps of one segment after the other."""
    points: list[Vector3] = []
    x_m, y_m, z_m = start_world_m
    for of_segment in steps:
        points += [(x_m + dx_m, y_m + dy_m, z_m + dz_m) for dx_m, dy_m, dz_m in of_segment]
        x_m, y_m, z_m = points[-1]
    return points


def end_of(start_world_m: Vector3, steps: Sequence[Sequence[Vector3]]) -> Vector3:
    """The last of the positions `along` them."""
    x_m, y_m, z_m = start_world_m
    for of_segment in steps:
        dx_m, dy_m, dz_m = of_segment[-1]
        x_m, y_m, z_m = x_m + dx_m, y_m + dy_m, z_m + dz_m
    return x_m, y_m, z_m
