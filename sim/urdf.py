"""Our own URDF of the Fetch: its published kinematics and masses, simple collision shapes, fingers that move.

Everything is generated from `sim.fetch`, so that the physics and the forward kinematics cannot disagree. Collision
shapes are boxes and cylinders about the size of the parts they stand for; visual shapes are left to the scene.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from sim import fetch
from sim.interface import Vector3

FINGER_FORCE_N = 18.0
"""Firm enough to carry 0.6 kg, gentle enough that a light box does not creep out."""
FINGER_SPEED_M_S = fetch.FINGER_TRAVEL_M  # the whole travel in the second a gripper action lasts

FINGER_JOINTS: Mapping[str, str] = {name: name.replace("_link", "_joint") for name in fetch.FINGERS}


@dataclass(frozen=True)
class _Body:
    """Mass, its centre and the inertia about it (xx, yy, zz, xy, xz, yz), in the link's frame."""

    mass_kg: float
    center_m: Vector3
    inertia_kg_m2: tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class _Collision:
    """A box (x, y, z), or a cylinder (length, radius) along x or, when upright, along z."""

    center_m: Vector3
    box_m: Vector3 | None = None
    cylinder_m: tuple[float, float] | None = None
    upright: bool = False


_BODIES: Mapping[str, _Body] = {
    "base_link": _Body(70.1294, (-0.0036, 0.0, 0.0014), (1.225, 1.2853, 0.987, 0.0099, 0.0062, -0.0034)),
    "torso_fixed_link": _Body(13.2775, (-0.0722, 0.0057, 0.2656), (0.3861, 0.3388, 0.1018, 0.0015, -0.0102, 0.0117)),
    "torso_lift_link": _Body(10.7796, (-0.0013, -0.0009, 0.2935), (0.3354, 0.3354, 0.0954, 0.0, -0.0162, -0.0006)),
    "bellows_link": _Body(0.1694, (0.0191, 0.0, -0.1349), (0.0033, 0.0017, 0.0017, 0.0, 0.0, 0.0)),
    "head_pan_link": _Body(2.2556, (0.0321, 0.0161, 0.0390), (0.0129, 0.0094, 0.0206, 0.0002, 0.0007, 0.0)),
    "head_tilt_link": _Body(0.9087, (0.0081, 0.0025, 0.0113), (0.0061, 0.0014, 0.0061, 0.0, 0.0, 0.0)),
    "shoulder_pan_link": _Body(2.5587, (0.0927, -0.0056, 0.0564), (0.0043, 0.0087, 0.0087, -0.0001, 0.001, -0.0001)),
    "shoulder_lift_link": _Body(2.6615, (0.1432, 0.0072, -0.0001), (0.0028, 0.0111, 0.0112, -0.0021, 0.0, 0.0)),
    "upperarm_roll_link": _Body(2.3311, (0.1165, 0.0014, 0.0), (0.0019, 0.0045, 0.0047, -0.0001, 0.0, 0.0)),
    "elbow_flex_link": _Body(2.1299, (0.1279, 0.0073, 0.0), (0.0024, 0.0082, 0.0084, -0.0016, 0.0, 0.0)),
    "forearm_roll_link": _Body(1.6563, (0.1097, -0.0266, 0.0), (0.0016, 0.003, 0.0035, -0.0003, 0.0, 0.0)),
    "wrist_flex_link": _Body(1.725, (0.0882, 0.0009, -0.0001), (0.0018, 0.0042, 0.0042, -0.0001, 0.0, 0.0)),
    "wrist_roll_link": _Body(0.1354, (0.0095, 0.0004, -0.0002), (0.0001, 0.0001, 0.0001, 0.0, 0.0, 0.0)),
    "gripper_link": _Body(1.5175, (-0.09, -0.0001, -0.0017), (0.0013, 0.0019, 0.0024, 0.0, 0.0, 0.0)),
}


def _finger(side: float) -> tuple[_Body, _Collision]:
    # The published finger has a placeholder inertia that no solid body can have; this is a solid box's.
    x_m, y_m, z_m = fetch.FINGER_SIZE_M
    mass_kg = 0.0798
    center_m = (fetch.FINGER_CENTER_X_M, side * (y_m / 2.0 - fetch.FINGER_ORIGIN_M), 0.0)
    twelfth = mass_kg / 12.0
    moments = (twelfth * (y_m**2 + z_m**2), twelfth * (x_m**2 + z_m**2), twelfth * (x_m**2 + y_m**2))
    return _Body(mass_kg, center_m, (*moments, 0.0, 0.0, 0.0)), _Collision(center_m, box_m=fetch.FINGER_SIZE_M)


_COLLISIONS: Mapping[str, _Collision] = {
    "base_link": _Collision((0.0, 0.0, 0.18), cylinder_m=(0.36, 0.27), upright=True),
    "torso_fixed_link": _Collision((-0.1, 0.0, 0.21), box_m=(0.136, 0.31, 0.46)),
    "torso_lift_link": _Collision((-0.02, 0.0, 0.315), box_m=(0.3, 0.3, 0.57)),
    "head_pan_link": _Collision((0.036, 0.0, 0.055), box_m=(0.32, 0.28, 0.11)),
    "shoulder_pan_link": _Collision((0.06, 0.0, 0.04), box_m=(0.22, 0.11, 0.16)),
    "shoulder_lift_link": _Collision((0.056, 0.0, 0.0), cylinder_m=(0.22, 0.055)),
    "upperarm_roll_link": _Collision((0.068, 0.0, 0.0), cylinder_m=(0.22, 0.052)),
    "elbow_flex_link": _Collision((0.057, 0.0, 0.0), cylinder_m=(0.21, 0.052)),
    "forearm_roll_link": _Collision((0.072, 0.0, 0.0), cylinder_m=(0.2, 0.052)),
    "wrist_flex_link": _Collision((0.032, 0.0, 0.0), cylinder_m=(0.16, 0.052)),
    "wrist_roll_link": _Collision((-0.002, 0.0, 0.0), cylinder_m=(0.042, 0.052)),
    "gripper_link": _Collision(fetch.PALM_CENTER_M, box_m=fetch.PALM_SIZE_M),
}


def fetch_urdf(*, static_links: bool = True) -> str:
    """The robot as URDF text; `base_link` is the root, its frame the world's. Fingers: 0 = closed, both move outwards.

    Without `static_links`, torso and head are no links of their own and `base_link` has their collision shapes: on a
    fixed base that is the same robot, and a quarter cheaper to simulate.
    """
    fingers = {name: _finger(side) for name, side in fetch.FINGERS.items()}
    bodies = {**_BODIES, **{name: body for name, (body, _) in fingers.items()}}
    collisions = {**_COLLISIONS, **{name: collision for name, (_, collision) in fingers.items()}}
    lines = ['<?xml version="1.0"?>', '<robot name="fetch">']
    static = {frame.name for frame in fetch.FIXED_FRAMES}
    if static_links:
        lines += [_link(name, bodies[name], _shape(collisions.get(name))) for name in fetch.LINK_NAMES]
        for frame in fetch.FIXED_FRAMES:
            origin = _origin(frame.origin_m, (0.0, frame.pitch_rad, 0.0))
            lines.append(_joint(frame.name.replace("_link", "_joint"), "fixed", frame.parent, frame.name, origin))
    else:
        placed_m = {name: position_m for name, (position_m, _) in fetch.link_poses((0.0,) * 7, 0.0).items()}
        shapes = "".join(
            _shape(collisions.get(name), placed_m[name]) for name in fetch.LINK_NAMES if name in static | {"base_link"}
        )
        moving = [name for name in fetch.LINK_NAMES if name not in static and name != "base_link"]
        lines.append(_link("base_link", bodies["base_link"], shapes))
        lines += [_link(name, bodies[name], _shape(collisions.get(name))) for name in moving]
    parent, from_parent_m = (
        ("torso_lift_link", (0.0, 0.0, 0.0)) if static_links else ("base_link", fetch.TORSO_ORIGIN_M)
    )
    for joint in fetch.ARM_JOINTS:
        continuous = math.isinf(joint.upper_rad)
        bounds = "" if continuous else f' lower="{joint.lower_rad}" upper="{joint.upper_rad}"'
        limit = f'<limit effort="{joint.effort_n_m}" velocity="{joint.velocity_rad_s}"{bounds}/>'
        kind = "continuous" if continuous else "revolute"
        inside = _origin(_sum(from_parent_m, joint.origin_m)) + _axis(joint.axis) + limit
        lines.append(_joint(joint.name, kind, parent, joint.child, inside))
        parent, from_parent_m = joint.child, (0.0, 0.0, 0.0)
    offset = _origin((fetch.GRIPPER_OFFSET_M, 0.0, 0.0))
    lines.append(_joint("gripper_axis", "fixed", parent, "gripper_link", offset))
    for name, side in fetch.FINGERS.items():
        limit = (
            f'<limit effort="{FINGER_FORCE_N}" velocity="{FINGER_SPEED_M_S}" '
            f'lower="0" upper="{fetch.FINGER_TRAVEL_M}"/>'
        )
        inside = _origin((0.0, side * fetch.FINGER_ORIGIN_M, 0.0)) + _axis((0.0, side, 0.0)) + limit
        lines.append(_joint(FINGER_JOINTS[name], "prismatic", "gripper_link", name, inside))
    return "\n".join([*lines, "</robot>", ""])


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _origin(position_m: Vector3, rpy_rad: Vector3 = (0.0, 0.0, 0.0)) -> str:
    return f'<origin xyz="{_numbers(position_m)}" rpy="{_numbers(rpy_rad)}"/>'


def _axis(axis: Vector3) -> str:
    return f'<axis xyz="{_numbers(axis)}"/>'


def _joint(name: str, kind: str, parent: str, child: str, inside: str) -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def _sum(a_m: Vector3, b_m: Vector3) -> Vector3:
    return a_m[0] + b_m[0], a_m[1] + b_m[1], a_m[2] + b_m[2]


def _link(name: str, body: _Body, shapes: str) -> str:
    xx, yy, zz, xy, xz, yz = body.inertia_kg_m2
    inertial = (
        f'<inertial>{_origin(body.center_m)}<mass value="{body.mass_kg}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="{xz}" iyz="{yz}"/></inertial>'
    )
    return f'<link name="{name}">{inertial}{shapes}</link>'


def _shape(collision: _Collision | None, link_m: Vector3 = (0.0, 0.0, 0.0)) -> str:
    if collision is None:
        return ""
    if collision.box_m is not None:
        geometry = f'<box size="{_numbers(collision.box_m)}"/>'
    elif collision.cylinder_m is not None:
        length_m, radius_m = collision.cylinder_m
        geometry = f'<cylinder length="{length_m}" radius="{radius_m}"/>'
    rpy_rad = (0.0, 0.0 if collision.upright or collision.box_m else math.pi / 2.0, 0.0)
    origin = _origin(_sum(link_m, collision.center_m), rpy_rad)
    return f"<collision>{origin}<geometry>{geometry}</geometry></collision>"
