"""Which motions would push standing objects over: what an arm that moves by itself must not do. Pure.

A person may drive into things; the robot, when the hands are off, plans around what it sees, as the paper's planner
did. In the plane, a standing cylinder is a circle, a box a rectangle as long as it stands square to the table (else
the circle around it), and so is a held object; the gripper is two finger boxes and a palm box. A motion is clear when
every part keeps its margin to every standing object all the way, or at least does not come nearer to one that it is
too near to already.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim import fetch
from sim.interface import ObjectSpec, Pose, SceneSpec, Vector3, WorldState

FloatArray = NDArray[np.float64]

FINGER_MARGIN_M = 0.003
PALM_MARGIN_M = 0.003
CARRIED_MARGIN_M = 0.01
NEAR_M = 0.35
"""Objects farther away than this cannot be reached by gripper or carried object within a tick."""

_STANDS = math.cos(math.pi / 4.0)
_SHARES = np.array([0.0, 0.5, 1.0])  # a tick's way is at most 5 cm
_ROUNDING_M = 1e-9
_SQUARE = 0.03
"""Of a quaternion's z: about 3.5 degrees of turn."""


def clear(world: WorldState, scene: SceneSpec, displacements_m: FloatArray) -> NDArray[np.bool_]:
    """Which straight displacements, shape (N, 3) in metres, of the gripper as it is now push nothing over; (N,)."""
    centers, outlines_m = [], []
    here_m = world.position_world_gripper_m
    for item in world.objects:
        x_m, y_m, z_m = item.pose.position_world_m
        _, qx, qy, _ = item.pose.quaternion_wxyz
        if item.id == world.held or z_m < scene.table.top_z_m or 1.0 - 2.0 * (qx * qx + qy * qy) < _STANDS:
            continue
        if abs(x_m - here_m[0]) < NEAR_M and abs(y_m - here_m[1]) < NEAR_M:
            centers.append((x_m, y_m, z_m))
            outlines_m.append(_outline_m(scene.object(item.id).spec, item.pose))
    if not centers:
        return np.ones(len(displacements_m), dtype=np.bool_)
    points_m = np.asarray(here_m) + _SHARES[:, None] * displacements_m[:, None, :]  # (N, S, 3)
    offsets_m = np.array(centers) - points_m[:, :, None, :]  # (N, S, O, 3)
    spare_m = _spare_m(offsets_m, np.array(outlines_m), world, scene)
    start_m, way_m = spare_m[:, 0], spare_m[:, 1:].min(axis=1)  # (N, O)
    fits: NDArray[np.bool_] = ((way_m >= 0.0) | (way_m >= start_m - _ROUNDING_M)).all(axis=1)
    return fits


def _outline_m(spec: ObjectSpec, pose: Pose) -> tuple[float, float, float, float]:
    """(half length, half width, radius around that rectangle, half height) of something upright."""
    length_m, width_m, height_m = spec.size_m
    if spec.shape == "cylinder":
        return 0.0, 0.0, length_m / 2.0, height_m / 2.0
    if abs(pose.quaternion_wxyz[3]) > _SQUARE:
        return 0.0, 0.0, math.hypot(length_m, width_m) / 2.0, height_m / 2.0
    return length_m / 2.0, width_m / 2.0, 0.0, height_m / 2.0


def _spare_m(offsets_m: FloatArray, outlines_m: FloatArray, world: WorldState, scene: SceneSpec) -> FloatArray:
    """How much more than its margin the nearest part keeps, (..., O, 3) offsets from gripper to object -> (..., O)."""
    x_m, y_m, z_m = offsets_m[..., 0], offsets_m[..., 1], offsets_m[..., 2]
    finger_m, palm_m = fetch.FINGER_SIZE_M, fetch.PALM_SIZE_M
    beside_m = np.abs(y_m) - (world.finger_opening_m / 2.0 + finger_m[1] / 2.0)
    spare_m = _gap_m(x_m - fetch.FINGER_CENTER_X_M, beside_m, z_m, finger_m, outlines_m) - FINGER_MARGIN_M
    gap_m = _gap_m(x_m - fetch.PALM_CENTER_M[0], y_m, z_m, palm_m, outlines_m) - PALM_MARGIN_M
    spare_m = np.minimum(spare_m, gap_m)
    if world.held is not None:
        held, here_m = world.object(world.held), world.position_world_gripper_m
        length_m, width_m, radius_m, half_m = _outline_m(scene.object(world.held).spec, held.pose)
        dx_m, dy_m, dz_m = (there - here for there, here in zip(held.pose.position_world_m, here_m, strict=True))
        box_m = (2.0 * length_m, 2.0 * width_m, 2.0 * half_m)
        gap_m = _gap_m(x_m - dx_m, y_m - dy_m, z_m - dz_m, box_m, outlines_m) - radius_m - CARRIED_MARGIN_M
        spare_m = np.minimum(spare_m, gap_m)
    return spare_m


def _gap_m(x_m: FloatArray, y_m: FloatArray, z_m: FloatArray, box_m: Vector3, outlines_m: FloatArray) -> FloatArray:
    """Distance in the plane between a box around the origin and each outline (O, 4); infinite above or below it."""
    along_m = np.maximum(np.abs(x_m) - box_m[0] / 2.0 - outlines_m[:, 0], 0.0)
    aside_m = np.maximum(np.abs(y_m) - box_m[1] / 2.0 - outlines_m[:, 1], 0.0)
    gap_m: FloatArray = np.hypot(along_m, aside_m) - outlines_m[:, 2]
    gap_m[np.abs(z_m) >= outlines_m[:, 3] + box_m[2] / 2.0] = np.inf
    return gap_m
