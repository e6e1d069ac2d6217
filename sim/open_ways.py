"""Straight ways of the gripper through the whole scene: which can be gone to their end. Pure.

Where `sim.clearance` looks one tick ahead, this looks as far as the next place the arm may be wanted in. A way is open
when every sample of it, at most `SAMPLE_M` apart, is within reach and pushes nothing over: every part that moves with
the gripper keeps its margin to every object on the table, or at least does not come nearer to one that it is too near
to where the way begins. What has fallen counts as the box around it.

    ways = Ways(world, scene, targets_m)
    ways.open_from((0.70, 0.0, 0.88))        which targets can be gone to from there, (G,)
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.clearance import moving_parts, outline_of
from sim.ik import within_reach
from sim.interface import SceneSpec, Vector3, WorldState

SAMPLE_M = 0.03
"""Half of what a finger is long: no corner is jumped by more than millimetres."""
_ROUNDING_M = 1e-9
_AXES = np.vstack((np.eye(3), -np.eye(3)))

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class _Pairs(NamedTuple):
    """Every object with every part that moves: from the part's place at the gripper to the object, half of what both
    measure, each an axis at a time; what both are round by, and the margin. (T, P)."""

    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    half_x_m: FloatArray
    half_y_m: FloatArray
    half_z_m: FloatArray
    least_m: FloatArray


class Ways:
    """The ways to some targets (G, 3), world frame, metres, in the world as it is now."""

    def __init__(self, world: WorldState, scene: SceneSpec, targets_m: FloatArray) -> None:
        self._world, self._scene, self._targets_m = world, scene, targets_m

    @cached_property
    def possible(self) -> BoolArray:
        """Which targets the gripper can be at, within reach and clear of everything, (G,)."""
        reach: BoolArray = within_reach(self._targets_m)
        if self._pairs is None:
            return reach
        clear: BoolArray = _spare_m(self._targets_m, self._pairs).min(axis=(-2, -1)) >= 0.0
        return reach & clear

    def open_from(self, place_m: Vector3, which: int | None = None) -> BoolArray:
        """Which targets, or whether target `which`, could be gone to straight from there, (G,) or (1,)."""
        return self.looked_at_from(place_m, which)[1]

    def looked_at_from(self, place_m: Vector3, which: int | None = None) -> tuple[BoolArray, BoolArray]:
        """Of each way, whether it is within reach, whatever stands on it, and whether it is open."""
        start_m = np.array(place_m)
        ways_m = self._targets_m - start_m  # (G, 3)
        longest_m = math.sqrt(float(np.max(np.einsum("gi,gi->g", ways_m, ways_m), initial=0.0)))
        shares = np.arange(1, max(math.ceil(longest_m / SAMPLE_M), 1) + 1) * (SAMPLE_M / max(longest_m, SAMPLE_M))
        shares[-1] = 1.0
        points_m = start_m + shares[:, None, None] * (ways_m if which is None else ways_m[which, None])  # (S, G, 3)
        reach: BoolArray = np.all(within_reach(points_m), axis=0)
        if self._pairs is None or not reach.any():
            return reach, reach
        is_open = reach.copy()
        is_open[reach] = _pushes_nothing(start_m, points_m[:, reach], self._pairs)
        return reach, is_open

    @cached_property
    def _pairs(self) -> _Pairs | None:
        """None when nothing stands on the table."""
        world, scene = self._world, self._scene
        things = [
            (item.pose.position_world_m, outline_of(scene.object(item.id).spec, item.pose))
            for item in world.objects
            if item.id != world.held and item.pose.position_world_m[2] >= scene.table.top_z_m
        ]
        if not things:
            return None
        parts = moving_parts(world, scene)
        places_m = np.array([place_m for place_m, _ in things])[:, None] - np.array([part.place_m for part in parts])
        sizes = np.array([outline for _, outline in things])[:, None] + np.array([part.outline for part in parts])
        margins_m = np.array([part.margin_m for part in parts])
        along, aside, up = np.moveaxis(places_m, -1, 0)  # (T, P) each
        length, width, radius, height = np.moveaxis(sizes, -1, 0)
        return _Pairs(along, aside, up, length, width, height, radius + margins_m)


def has_margin(place_m: Vector3, margin_m: float) -> bool:
    """Whether the arm can be so far from a place along each axis, either way."""
    return bool(within_reach(np.array(place_m) + margin_m * _AXES).all())


def _spare_m(points_m: FloatArray, pairs: _Pairs) -> FloatArray:
    """How much more than its margin each part keeps to each object, (..., 3) -> (..., T, P)."""
    aside_x = np.abs(pairs.x_m - points_m[..., 0, None, None])
    aside_y = np.abs(pairs.y_m - points_m[..., 1, None, None])
    beside = np.abs(pairs.z_m - points_m[..., 2, None, None]) >= pairs.half_z_m
    aside_x -= pairs.half_x_m
    aside_y -= pairs.half_y_m
    np.maximum(aside_x, 0.0, out=aside_x)
    np.maximum(aside_y, 0.0, out=aside_y)
    aside_x *= aside_x
    aside_y *= aside_y
    aside_x += aside_y
    spare_m = np.sqrt(aside_x, out=aside_x)
    spare_m -= pairs.least_m
    spare_m[beside] = np.inf
    return spare_m


def _pushes_nothing(start_m: FloatArray, points_m: FloatArray, pairs: _Pairs) -> BoolArray:
    """Which ways from there, samples (S, G, 3), push nothing over, (G,)."""
    at_start_m = _spare_m(start_m, pairs).min(axis=-1)  # (T,)
    least_m = np.minimum(at_start_m, _ROUNDING_M) - _ROUNDING_M
    nearest_m = _spare_m(points_m, pairs).min(axis=(0, -1))  # (G, T)
    clear: BoolArray = (nearest_m >= least_m).all(axis=-1)
    return clear
