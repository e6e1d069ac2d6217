"""The things on the table, as the physics sees them: six for cleaning up a spill and one to practise with. Pure.

All fit between the open fingers (`sim.fetch.MAX_OPENING_M`) with at least 13 mm to spare on each side, whichever way
they stand, and are grasped at a height where the level gripper clears the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from sim.interface import ObjectSpec, Pose, SimError, Vector3

FRICTION = 0.65
"""Of every object's surface; bullet multiplies it by the finger's 1.0 and the table's."""


def _by_id(*specs: ObjectSpec) -> Mapping[str, ObjectSpec]:
    return MappingProxyType({spec.id: spec for spec in specs})


# Columns: id, label, shape, size (x, y, z) in m, mass in kg, friction, grasp height in m.
STUDY_OBJECTS: Mapping[str, ObjectSpec] = _by_id(
    ObjectSpec("spray_bottle", "spray bottle", "cylinder", (0.068, 0.068, 0.24), 0.40, FRICTION, 0.12),
    ObjectSpec("bleach_bottle", "bleach bottle", "box", (0.074, 0.066, 0.23), 0.55, FRICTION, 0.12),
    ObjectSpec("paper_towels", "paper towel roll", "cylinder", (0.074, 0.074, 0.22), 0.20, FRICTION, 0.12),
    ObjectSpec("wipes_tub", "tub of wipes", "cylinder", (0.072, 0.072, 0.15), 0.35, FRICTION, 0.11),
    ObjectSpec("absorbent_can", "absorbent powder", "cylinder", (0.060, 0.060, 0.17), 0.45, FRICTION, 0.11),
    ObjectSpec("sponge_pack", "pack of sponges", "box", (0.070, 0.070, 0.12), 0.10, FRICTION, 0.10),
)
PRACTICE_OBJECT = ObjectSpec("practice_block", "practice block", "box", (0.06, 0.06, 0.16), 0.25, FRICTION, 0.11)

OBJECTS: Mapping[str, ObjectSpec] = _by_id(*STUDY_OBJECTS.values(), PRACTICE_OBJECT)
"""Every object, by id."""


def object_spec(object_id: str) -> ObjectSpec:
    """The object of that id; `SimError` names the ones there are."""
    if object_id not in OBJECTS:
        raise SimError(f"no object {object_id!r}; objects are {', '.join(OBJECTS)}")
    return OBJECTS[object_id]


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
