"""The Fetch as numbers: joints, limits, frames and forward kinematics. Pure.

Kinematics, limits and masses are those Fetch Robotics published (fetch_description, `fetch.urdf`); the torso is
fixed at `TORSO_M` and the fingers move as on the real gripper, each from 0 to `FINGER_TRAVEL_M`.
World frame = `base_link`: z up, x forward, y left; metres, radians; quaternions (w, x, y, z).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from sim.interface import SLICES_PER_TICK, QuaternionWxyz, SimError, Vector3

TORSO_M = 0.38
"""Height of the torso lift, which the lab never moves."""

HEAD_TILT_RAD = 0.55
"""The head looks down at the table."""


@dataclass(frozen=True)
class ArmJoint:
    """One rotating joint. `lower_rad`/`upper_rad` are infinite for the continuous rolls."""

    name: str
    child: str
    origin_m: Vector3
    axis: Vector3
    lower_rad: float
    upper_rad: float
    velocity_rad_s: float
    effort_n_m: float


_INF = float("inf")
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

ARM_JOINTS = (
    ArmJoint("shoulder_pan_joint", "shoulder_pan_link", (0.119525, 0.0, 0.34858), _Z, -1.6056, 1.6056, 1.256, 33.82),
    ArmJoint("shoulder_lift_joint", "shoulder_lift_link", (0.117, 0.0, 0.06), _Y, -1.221, 1.518, 1.454, 131.76),
    ArmJoint("upperarm_roll_joint", "upperarm_roll_link", (0.219, 0.0, 0.0), _X, -_INF, _INF, 1.571, 76.94),
    ArmJoint("elbow_flex_joint", "elbow_flex_link", (0.133, 0.0, 0.0), _Y, -2.251, 2.251, 1.521, 66.18),
    ArmJoint("forearm_roll_joint", "forearm_roll_link", (0.197, 0.0, 0.0), _X, -_INF, _INF, 1.571, 29.35),
    ArmJoint("wrist_flex_joint", "wrist_flex_link", (0.1245, 0.0, 0.0), _Y, -2.16, 2.16, 2.268, 25.7),
    ArmJoint("wrist_roll_joint", "wrist_roll_link", (0.1385, 0.0, 0.0), _X, -_INF, _INF, 2.268, 7.36),
)
ARM_JOINT_NAMES = tuple(joint.name for joint in ARM_JOINTS)
LOWER_RAD = tuple(joint.lower_rad for joint in ARM_JOINTS)
UPPER_RAD = tuple(joint.upper_rad for joint in ARM_JOINTS)
EFFORT_N_M = tuple(joint.effort_n_m for joint in ARM_JOINTS)

TORSO_ORIGIN_M: Vector3 = (-0.086875, 0.0, 0.37743 + TORSO_M)
GRIPPER_OFFSET_M = 0.16645
"""From `wrist_roll_link` forward to `gripper_link`, whose origin lies between the fingertips."""

# Derived lengths of the chain, for the closed-form inverse.
PAN_AXIS_M: Vector3 = (TORSO_ORIGIN_M[0] + 0.119525, 0.0, TORSO_ORIGIN_M[2] + 0.34858)
SHOULDER_FORWARD_M, SHOULDER_UP_M = 0.117, 0.06
UPPER_ARM_M = 0.219 + 0.133
FOREARM_M = 0.197 + 0.1245
HAND_M = 0.1385 + GRIPPER_OFFSET_M
"""From the wrist centre (`wrist_flex_link`) forward to `gripper_link`."""

FINGER_TRAVEL_M = 0.05
"""Each finger's inner face moves this far from the middle; the opening is twice a finger's position."""
MAX_OPENING_M = 2.0 * FINGER_TRAVEL_M
GRIPPER_SLICES = 2 * SLICES_PER_TICK
"""Opening or closing takes 1 s; a free finger crosses its whole travel in that time."""
FINGER_ORIGIN_M = 0.015425
"""Finger frame's distance from the middle when closed."""
FINGER_SIZE_M: Vector3 = (0.06, 0.0144, 0.0264)
FINGER_CENTER_X_M = 0.001
PALM_SIZE_M: Vector3 = (0.122, 0.126, 0.0795)
PALM_CENTER_M: Vector3 = (-0.093, 0.0, 0.0)
"""The palm ends 32 mm behind `gripper_link`."""

START_POSITION_M: Vector3 = (0.70, 0.0, 0.88)


@dataclass(frozen=True)
class FixedFrame:
    """A link that never moves against its parent."""

    name: str
    parent: str
    origin_m: Vector3
    pitch_rad: float = 0.0


FIXED_FRAMES = (
    FixedFrame("torso_fixed_link", "base_link", (-0.086875, 0.0, 0.377425)),
    FixedFrame("torso_lift_link", "base_link", TORSO_ORIGIN_M),
    FixedFrame("bellows_link", "torso_lift_link", (0.0, 0.0, 0.0)),
    FixedFrame("head_pan_link", "torso_lift_link", (0.053125, 0.0, 0.603001417713939)),
    FixedFrame("head_tilt_link", "head_pan_link", (0.14253, 0.0, 0.057999), HEAD_TILT_RAD),
)
FINGERS: Mapping[str, float] = MappingProxyType({"r_gripper_finger_link": 1.0, "l_gripper_finger_link": -1.0})
"""Finger link -> the side of the gripper's y axis it is on (Fetch's own names: "right" is at +y)."""

LINK_NAMES = (
    "base_link",
    *(frame.name for frame in FIXED_FRAMES),
    *(joint.child for joint in ARM_JOINTS),
    "gripper_link",
    *FINGERS,
)

LinkPose = tuple[Vector3, QuaternionWxyz]
_Matrix = NDArray[np.float64]


def link_poses(joints_rad: Sequence[float], finger_opening_m: float) -> dict[str, LinkPose]:
    """Pose of every link in the world frame: name -> (position in metres, quaternion wxyz).

    `joints_rad` has 7 values in the order of `ARM_JOINT_NAMES`; `finger_opening_m` is the distance between the pads.
    Raises `SimError` when there are not 7 joints.
    """
    if len(joints_rad) != len(ARM_JOINTS):
        raise SimError(
            f"{len(joints_rad)} joint positions; the arm has {len(ARM_JOINTS)}: {', '.join(ARM_JOINT_NAMES)}"
        )
    identity = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    frames: dict[str, tuple[_Matrix, _Matrix]] = {"base_link": identity}
    for fixed in FIXED_FRAMES:
        frames[fixed.name] = _attach(frames[fixed.parent], fixed.origin_m, _turn(_Y, fixed.pitch_rad))
    here = frames["torso_lift_link"]
    for joint, angle_rad in zip(ARM_JOINTS, joints_rad, strict=True):
        here = frames[joint.child] = _attach(here, joint.origin_m, _turn(joint.axis, float(angle_rad)))
    gripper = frames["gripper_link"] = _attach(here, (GRIPPER_OFFSET_M, 0.0, 0.0))
    for name, side in FINGERS.items():
        frames[name] = _attach(gripper, (0.0, side * (FINGER_ORIGIN_M + finger_opening_m / 2.0), 0.0))
    return {name: (_triple(position), _quadruple(quaternion)) for name, (position, quaternion) in frames.items()}


def _turn(axis: Vector3, angle_rad: float) -> _Matrix:
    half_rad = angle_rad / 2.0
    return np.array([np.cos(half_rad), *(np.sin(half_rad) * np.array(axis))])


def _attach(parent: tuple[_Matrix, _Matrix], origin_m: Vector3, turn: _Matrix | None = None) -> tuple[_Matrix, _Matrix]:
    position, (w, x, y, z) = parent
    # v + 2 q × (q × v + w v): the vector turned by the unit quaternion.
    vector = np.array([x, y, z])
    offset = np.array(origin_m)
    turned = offset + 2.0 * np.cross(vector, np.cross(vector, offset) + w * offset)
    if turn is None:
        return position + turned, parent[1]
    a, b, c, d = turn
    product = np.array(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ]
    )
    return position + turned, product


def _triple(values: _Matrix) -> Vector3:
    return float(values[0]), float(values[1]), float(values[2])


def _quadruple(values: _Matrix) -> QuaternionWxyz:
    return float(values[0]), float(values[1]), float(values[2]), float(values[3])
