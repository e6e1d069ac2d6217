"""Which motions would push standing objects over: what an arm that moves by itself must not do. Pure.

A person may drive into things; the robot, when the hands are off, plans around what it sees, as the paper's planner
did. Standing objects are taken as upright circles of their larger side, the gripper as two finger boxes and a palm
box, a held object as a circle. A motion is clear when every part keeps its margin to every standing object all the
way, or at least does not come nearer to one that it is too near to already.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim import fetch
from sim.interface import SceneSpec, WorldState

FloatArray = NDArray[np.float64]

FINGER_MARGIN_M = 0.003
PALM_MARGIN_M = -0.01
"""Less than nothing: at a grasp point the palm touches what the fingers are around."""
CARRIED_MARGIN_M = 0.01
NEAR_M = 0.35
"""Objects farther away than this cannot be reached by gripper or carried object within a tick."""

_STANDS = math.cos(math.pi / 4.0)
_SHARES = np.array([0.0, 0.5, 1.0])  # a tick's way is at most 5 cm
_ROUNDING_M = 1e-9


def clear(world: WorldState, scene: SceneSpec, displacements_m: FloatArray) -> NDArray[np.bool_]:
    """Which straight displacements, shape (N, 3) in metres, of the gripper as it is now push nothing over; (N,)."""
    centers, radii_m, halves_m = [], [], []
    here_m = world.position_world_gripper_m
    for item in world.objects:
        x_m, y_m, z_m = item.pose.position_world_m
        _, qx, qy, _ = item.pose.quaternion_wxyz
        if item.id == world.held or z_m < scene.table.top_z_m or 1.0 - 2.0 * (qx * qx + qy * qy) < _STANDS:
            continue
        if abs(x_m - here_m[0]) < NEAR_M and abs(y_m - here_m[1]) < NEAR_M:
            size_m = scene.object(item.id).spec.size_m
            centers.append((x_m, y_m, z_m))
            radii_m.append(max(size_m[0], size_m[1]) / 2.0)
            halves_m.append(size_m[2] / 2.0)
    if not centers:
        return np.ones(len(displacements_m), dtype=np.bool_)
    points_m = np.asarray(here_m) + _SHARES[:, None] * displacements_m[:, None, :]  # (N, S, 3)
    offsets_m = np.array(centers) - points_m[:, :, None, :]  # (N, S, O, 3)
    spare_m = _spare_m(offsets_m, np.array(radii_m), np.array(halves_m), world, scene)
    start_m, way_m = spare_m[:, 0], spare_m[:, 1:].min(axis=1)  # (N, O)
    fits: NDArray[np.bool_] = ((way_m >= 0.0) | (way_m >= start_m - _ROUNDING_M)).all(axis=1)
    return fits


def _spare_m(
    offsets_m: FloatArray, radii_m: FloatArray, halves_m: FloatArray, world: WorldState, scene: SceneSpec
) -> FloatArray:
    """How much more than its margin the nearest part keeps, (..., O, 3) offsets from gripper to object -> (..., O)."""
    x_m, y_m, z_m = offsets_m[..., 0], np.abs(offsets_m[..., 1]), offsets_m[..., 2]
    half_width_m = fetch.FINGER_SIZE_M[1] / 2.0
    aside_m = np.abs(y_m - (world.finger_opening_m / 2.0 + half_width_m)) - half_width_m
    fingers_m = _box_gap_m(x_m - fetch.FINGER_CENTER_X_M, fetch.FINGER_SIZE_M[0] / 2.0, aside_m) - FINGER_MARGIN_M
    fingers_m[np.abs(z_m) >= halves_m + fetch.FINGER_SIZE_M[2] / 2.0] = np.inf
    aside_m = y_m - fetch.PALM_SIZE_M[1] / 2.0
    palm_m = _box_gap_m(x_m - fetch.PALM_CENTER_M[0], fetch.PALM_SIZE_M[0] / 2.0, aside_m) - PALM_MARGIN_M
    palm_m[np.abs(z_m) >= halves_m + fetch.PALM_SIZE_M[2] / 2.0] = np.inf
    spare_m: FloatArray = np.minimum(fingers_m, palm_m) - radii_m
    if world.held is not None:
        here_m, there_m = world.position_world_gripper_m, world.object(world.held).pose.position_world_m
        carried = scene.object(world.held).spec
        dx_m, dy_m, dz_m = (there - here for there, here in zip(there_m, here_m, strict=True))
        between_m = np.hypot(x_m - dx_m, offsets_m[..., 1] - dy_m) - radii_m - CARRIED_MARGIN_M
        between_m -= max(carried.size_m[0], carried.size_m[1]) / 2.0
        between_m[np.abs(z_m - dz_m) >= halves_m + carried.size_m[2] / 2.0] = np.inf
        spare_m = np.minimum(spare_m, between_m)
    return spare_m


def _box_gap_m(along_m: FloatArray, half_length_m: float, aside_m: FloatArray) -> FloatArray:
    """Distance in the plane from a point to a box, given its way along and its distance aside (negative = beside)."""
    gap_m: FloatArray = np.hypot(np.maximum(np.abs(along_m) - half_length_m, 0.0), np.maximum(aside_m, 0.0))
    return gap_m
