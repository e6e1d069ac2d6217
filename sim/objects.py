"""What the robot can pick up: the bounds every object keeps, and where the fingers close on it. Pure.

An object fits between the open fingers with room on each side, whichever way it stands; the level gripper clears the
table where it grasps; and the fingers hold it by friction alone (`sim.physical`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sim import fetch, urdf
from sim.interface import ObjectSpec, Pose, Vector3

BESIDE_M = 0.013
"""Room on each side of an object between the open fingers."""
WIDEST_M = round(fetch.MAX_OPENING_M - 2.0 * BESIDE_M, 6)
LOWEST_GRASP_M = 0.06
"""Above the table: half the palm's height, and 2 cm."""
BELOW_TOP_M = round(fetch.FINGER_SIZE_M[2] / 2.0, 6)
"""Half a finger's height: all of it is on the object."""
GRAVITY_M_S2 = 9.81
GRIP_MARGIN = 2.0
"""Friction holds so many times the weight: for jerks, and for a grasp off the middle."""


@dataclass(frozen=True)
class WorldProblem:
    """Something wrong with an object or a layout: its field, and a sentence with value and bound."""

    place: tuple[str | int, ...]
    sentence: str

    def __str__(self) -> str:
        return f"{'.'.join(map(str, self.place))}: {self.sentence}" if self.place else self.sentence


def object_problems(spec: ObjectSpec) -> Iterator[WorldProblem]:
    """Everything that keeps the robot from picking it up."""
    x_m, y_m, height_m = spec.size_m
    if spec.shape == "cylinder" and x_m != y_m:
        yield WorldProblem(("size_m",), f"{x_m:g} m by {y_m:g} m; a cylinder is as long as it is wide")
    if max(x_m, y_m) > WIDEST_M:
        yield WorldProblem(
            ("size_m",),
            f"{max(x_m, y_m):g} m wide; the gripper opens {fetch.MAX_OPENING_M:g} m and needs {BESIDE_M:g} m on each "
            f"side: at most {WIDEST_M:g} m both ways",
        )
    highest_m = round(height_m - BELOW_TOP_M, 6)
    if highest_m < LOWEST_GRASP_M:
        yield WorldProblem(
            ("size_m",),
            f"{height_m:g} m high; the gripper closes at least {LOWEST_GRASP_M:g} m above the table and "
            f"{BELOW_TOP_M:g} m below the top: at least {LOWEST_GRASP_M + BELOW_TOP_M:g} m high",
        )
    elif not LOWEST_GRASP_M <= spec.grasp_height_m <= highest_m:
        yield WorldProblem(
            ("grasp_height_m",),
            f"{spec.grasp_height_m:g} m; must be from {LOWEST_GRASP_M:g} m, where the gripper clears the table, to "
            f"{highest_m:g} m, where the fingers are on the object whole",
        )
    heaviest_kg = heaviest(spec.friction)
    if spec.mass_kg > heaviest_kg:
        yield WorldProblem(
            ("mass_kg",),
            f"{spec.mass_kg:g} kg; two fingers press with {urdf.FINGER_FORCE_N:g} N and hold, at friction "
            f"{spec.friction:g}, at most {heaviest_kg:g} kg with a margin of {GRIP_MARGIN:g}",
        )


def heaviest(friction: float) -> float:
    """The heaviest object of that friction that the fingers carry, kg."""
    return round(2.0 * urdf.FINGER_FORCE_N * friction / (GRAVITY_M_S2 * GRIP_MARGIN), 2)


def grasp_point(spec: ObjectSpec, pose: Pose) -> Vector3:
    """Where the fingers should close on an object whose centre is at `pose`; world frame, metres."""
    x_m, y_m, z_m = pose.position_world_m
    w, x, y, z = pose.quaternion_wxyz
    up_m = spec.grasp_height_m - spec.size_m[2] / 2.0
    # Times the third column of the rotation matrix: the object's own z axis.
    return (
        x_m + up_m * 2.0 * (x * z + w * y),
        y_m + up_m * 2.0 * (y * z - w * x),
        z_m + up_m * (1.0 - 2.0 * (x * x + y * y)),
    )
