"""Where the gripper may be, and what is certainly within reach: told by a few comparisons where `sim.ik` works out a
posture. Pure.

In the box of the workspace the arm reaches a place unless

- it is too far or too near: the wrist's distance from the shoulder (`span_m`) is that of a stretched or a folded arm;
- it is low before the robot's chest, where the wrist may be at its limit (`_CHEST_M` holds all such places).

No other joint is ever at its limit in there (`tests/sim/test_reach.py` tries). A span changes by no more than the
gripper moves, so that one place tells of all around it. What is nearer to a bound than `SURE_M` is not certain, and
whoever asks has to ask `sim.ik`: the answers are the same, at once or worked out.
"""

from __future__ import annotations

import math

from sim import fetch
from sim.interface import Vector3

WORKSPACE_LOW_M: Vector3 = (0.40, -0.62, 0.79)
WORKSPACE_HIGH_M: Vector3 = (0.95, 0.62, 1.06)
"""The box that `gripper_link` never leaves: 6 cm above the table at the lowest."""
ROUNDING_M = 1e-9
"""Steps that add up to the box's edge but for rounding are within it."""
ELBOW_RAD = (0.45, 2.20)
"""Away from the stretched and the folded arm, where a short way takes a joint long turns."""

SURE_M = 0.4 * ROUNDING_M
"""No rounding comes to so much, and what rounding adds up to at the box's edge is well inside of it."""
FORWARD_M = fetch.HAND_M + fetch.PAN_AXIS_M[0]
RING_M = fetch.SHOULDER_FORWARD_M
HEIGHT_M = fetch.PAN_AXIS_M[2] + fetch.SHOULDER_UP_M
"""The shoulder goes round a ring of that radius, at that height, around a point so far ahead in the gripper's frame."""


def _span_m(elbow_rad: float) -> float:
    upper_m, fore_m = fetch.UPPER_ARM_M, fetch.FOREARM_M
    return math.sqrt(upper_m * upper_m + fore_m * fore_m + 2.0 * upper_m * fore_m * math.cos(elbow_rad))


SHORTEST_M, LONGEST_M = _span_m(ELBOW_RAD[1]) + SURE_M, _span_m(ELBOW_RAD[0]) - SURE_M
_CHEST_M: Vector3 = (0.635, 0.155, 0.92)
"""The wrist's limit is only met where x, the distance from the middle, and z are all below these."""
_LOW_M: Vector3 = (
    WORKSPACE_LOW_M[0] - ROUNDING_M + SURE_M,
    WORKSPACE_LOW_M[1] - ROUNDING_M + SURE_M,
    WORKSPACE_LOW_M[2] - ROUNDING_M + SURE_M,
)
_HIGH_M: Vector3 = (
    WORKSPACE_HIGH_M[0] + ROUNDING_M - SURE_M,
    WORKSPACE_HIGH_M[1] + ROUNDING_M - SURE_M,
    WORKSPACE_HIGH_M[2] + ROUNDING_M - SURE_M,
)


def span_m(place_m: Vector3) -> float:
    """How far the wrist is from the shoulder with the gripper there."""
    forward_m, y_m, down_m = place_m[0] - FORWARD_M, place_m[1], HEIGHT_M - place_m[2]
    out_m = math.sqrt(forward_m * forward_m + y_m * y_m) - RING_M
    return math.sqrt(out_m * out_m + down_m * down_m)


def is_sure_around(place_m: Vector3, radius_m: float) -> bool:
    """Whether everything up to that far from a place is certainly within reach."""
    x_m, y_m, z_m = place_m
    if not (
        _LOW_M[0] <= x_m - radius_m
        and x_m + radius_m <= _HIGH_M[0]
        and _LOW_M[1] <= y_m - radius_m
        and y_m + radius_m <= _HIGH_M[1]
        and _LOW_M[2] <= z_m - radius_m
        and z_m + radius_m <= _HIGH_M[2]
    ):
        return False
    span = span_m(place_m)
    if not span - radius_m >= SHORTEST_M or not span + radius_m <= LONGEST_M:
        return False
    return x_m - radius_m > _CHEST_M[0] or abs(y_m) - radius_m > _CHEST_M[1] or z_m - radius_m > _CHEST_M[2]


def is_surely_within(place_m: Vector3) -> bool | None:
    """Whether a place is within reach, where no rounding and no joint but the elbow decides; else None."""
    if is_sure_around(place_m, 0.0):
        return True
    x_m, y_m, z_m = place_m
    beyond_m = -2.0 * SURE_M
    if (
        x_m - _LOW_M[0] < beyond_m
        or _HIGH_M[0] - x_m < beyond_m
        or y_m - _LOW_M[1] < beyond_m
        or _HIGH_M[1] - y_m < beyond_m
        or z_m - _LOW_M[2] < beyond_m
        or _HIGH_M[2] - z_m < beyond_m
    ):
        return False
    span = span_m(place_m)
    return False if span - SHORTEST_M < beyond_m or LONGEST_M - span < beyond_m else None


class Place:
    """What ways that begin or end at a place have to know of it.

    Attributes:
        is_sure: whether the place itself is certainly within reach.
        free_m: from so far ahead of the shoulder's ring on, no place at its height or lower is too near.
    """

    __slots__ = ("free_m", "is_sure", "x_m", "y_m", "z_m")

    def __init__(self, place_m: Vector3) -> None:
        self.x_m, self.y_m, self.z_m = place_m
        self.is_sure = is_sure_around(place_m, 0.0)
        down_m = HEIGHT_M - self.z_m
        self.free_m = RING_M + math.sqrt(max(SHORTEST_M * SHORTEST_M - down_m * down_m, 0.0)) + SURE_M


def is_sure_way(one: Place, other: Place) -> bool:
    """Whether the whole straight way between two places is certainly within reach.

    The box is convex, and so is what the stretched arm reaches: both ends tell of all between them. The way is nowhere
    too near when it stays far enough from the shoulder's axis for the highest place on it.
    """
    if not (one.is_sure and other.is_sure):
        return False
    x_m, x_2_m, y_m, y_2_m = one.x_m, other.x_m, one.y_m, other.y_m
    nearest_x_m = x_m if x_m < x_2_m else x_2_m
    if not (
        nearest_x_m > _CHEST_M[0]
        or (one.z_m > _CHEST_M[2] and other.z_m > _CHEST_M[2])
        or (y_m > _CHEST_M[1] and y_2_m > _CHEST_M[1])
        or (y_m < -_CHEST_M[1] and y_2_m < -_CHEST_M[1])
    ):
        return False
    free_m = one.free_m if one.free_m > other.free_m else other.free_m
    if nearest_x_m - FORWARD_M >= free_m:
        return True
    return _from_axis_m(x_m - FORWARD_M, y_m, x_2_m - FORWARD_M, y_2_m) >= free_m


def _from_axis_m(x_m: float, y_m: float, x_2_m: float, y_2_m: float) -> float:
    """How near a way in the plane comes to the origin."""
    dx_m, dy_m = x_2_m - x_m, y_2_m - y_m
    square = dx_m * dx_m + dy_m * dy_m
    share = 0.0 if square == 0.0 else min(max(-(x_m * dx_m + y_m * dy_m) / square, 0.0), 1.0)
    return math.hypot(x_m + share * dx_m, y_m + share * dy_m)
