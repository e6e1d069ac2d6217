"""Straight ways of the gripper through the whole scene: which can be gone to their end. Pure.

Where `sim.clearance` looks one tick ahead, this looks as far as the next place the arm may be wanted in. A way is open
when every sample of it, at most `SAMPLE_M` apart, is within reach and pushes nothing over: every part that moves with
the gripper keeps its margin to every object on the table, or at least does not come nearer to one that it is too near
to where the way begins. What has fallen counts as the box around it.

    ways = Ways(targets_m, Obstacles(world, scene))
    ways.is_open((0.70, 0.0, 0.88), 2)       whether the third target can be gone to from there

Samples are looked at where nothing simpler tells: most ways are certainly open as a whole, or certainly closed at one
place (`sim.obstacles`, `sim.reach`). What is told so is what the samples would tell.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim.ik import within_reach
from sim.interface import Vector3
from sim.obstacles import SURE_M, Obstacles, Pairs
from sim.reach import Place, is_sure_around, is_sure_way, is_surely_within

SAMPLE_M = 0.03
"""Half of what a finger is long: no corner is jumped by more than millimetres."""
_ROUNDING_M = 1e-9
_AXES = np.vstack((np.eye(3), -np.eye(3)))

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class Ways:
    """The ways to some targets (G, 3), world frame, metres, in the world as it is now."""

    def __init__(self, targets_m: FloatArray, obstacles: Obstacles) -> None:
        self._obstacles = obstacles
        self._targets_m = targets_m
        self._sequence = list(range(len(targets_m)))

    # ---- one by one ---------------------------------------------------------------------------------------------

    def is_open(self, place_m: Vector3, which: int) -> bool:
        """Whether target `which` could be gone to straight from there."""
        return self._is_open(Place(place_m), place_m, which)

    def is_reached(self, place_m: Vector3, which: int) -> bool:
        """Whether the way to target `which` is within reach, whatever stands on it."""
        if is_sure_way(Place(place_m), self._places[which]):
            return True
        return bool(self.looked_at_from(place_m, which)[0][0])

    def are_open(self, place_m: Vector3, count: int) -> bool:
        """Whether all of the first `count` targets that the gripper can be at could be gone to straight from there."""
        place, possible = Place(place_m), self._possible
        for which in self._sequence:
            if which >= count or not possible[which]:
                continue
            if not self._is_open(place, place_m, which):
                self._sequence.remove(which)  # it will be closed from the next place too
                self._sequence.insert(0, which)
                return False
        return True

    def is_any_open(self, place_m: Vector3, count: int) -> bool:
        """Whether any of the first `count` targets that the gripper can be at could be gone to straight from there."""
        return any(self._possible[which] and self.is_open(place_m, which) for which in range(count))

    def _is_open(self, place: Place, place_m: Vector3, which: int) -> bool:
        target = self._places[which]
        found = self._surely_open(place, target)
        if found is None:
            found = self._walked(place, target)
        return bool(self.looked_at_from(place_m, which)[1][0]) if found is None else found

    def _surely_open(self, place: Place, target: Place) -> bool | None:
        """None where samples have to be looked at."""
        if not is_sure_way(place, target):
            return None
        for thing in self._obstacles.things:
            if thing.is_surely_off(place.x_m, place.y_m, place.z_m, target.x_m, target.y_m, target.z_m):
                continue
            return False if thing.is_surely_met(place, target, *self._samples(place)) else None
        return True

    def _walked(self, place: Place, target: Place) -> bool | None:
        """As the samples one after the other tell it; None where one of them is a matter of rounding, or the place is
        too near to something already."""
        samples, step = self._samples(place)
        x_m, y_m, z_m, to_x_m, to_y_m, to_z_m = place.x_m, place.y_m, place.z_m, target.x_m, target.y_m, target.z_m
        met = [t for t in self._obstacles.things if not t.is_surely_off(x_m, y_m, z_m, to_x_m, to_y_m, to_z_m)]
        if not samples or any(thing.spare_m(x_m, y_m, z_m) < SURE_M for thing in met):
            return None
        is_within = is_sure_way(place, target)
        dx_m, dy_m, dz_m = to_x_m - x_m, to_y_m - y_m, to_z_m - z_m
        for number in range(1, samples + 1):
            share = 1.0 if number == samples else number * step
            here_m = at_x_m, at_y_m, at_z_m = x_m + share * dx_m, y_m + share * dy_m, z_m + share * dz_m
            if not is_within and not (reached := is_surely_within(here_m)):
                return reached
            for thing in met:
                spare_m = thing.spare_m(at_x_m, at_y_m, at_z_m)
                if spare_m < SURE_M:
                    return False if spare_m < -SURE_M else None
        return True

    def _samples(self, place: Place) -> tuple[int, float]:
        """How many samples the ways from there have, 0 where rounding might make it one more or less; and which share
        of a way lies between two."""
        squares = [
            (target.x_m - place.x_m) ** 2 + (target.y_m - place.y_m) ** 2 + (target.z_m - place.z_m) ** 2
            for target in self._places
        ]
        samples = math.sqrt(max(squares)) / SAMPLE_M
        known = abs(samples - round(samples)) > SURE_M
        return (max(math.ceil(samples), 1) if known else 0), 1.0 / max(samples, 1.0)

    @cached_property
    def _places(self) -> list[Place]:
        return [Place((x_m, y_m, z_m)) for x_m, y_m, z_m in self._targets_m.tolist()]

    @cached_property
    def _possible(self) -> list[bool]:
        possible: list[bool] = self.possible.tolist()
        return possible

    # ---- by their samples ---------------------------------------------------------------------------------------

    @cached_property
    def possible(self) -> BoolArray:
        """Which targets the gripper can be at, within reach and clear of everything, (G,)."""
        reach: BoolArray = within_reach(self._targets_m)
        pairs = self._obstacles.pairs
        if pairs is None:
            return reach
        clear: BoolArray = self._spare_m >= 0.0
        return reach & clear

    @cached_property
    def is_settled(self) -> bool:
        """Whether which targets are possible hangs on no rounding of where what is held is in the hand."""
        return self._obstacles.pairs is None or bool((np.abs(self._spare_m) > SURE_M).all())

    @cached_property
    def _spare_m(self) -> FloatArray:
        """How much more than their margins all parts keep with the gripper at each target, (G,)."""
        assert self._obstacles.pairs is not None
        spare_m: FloatArray = _spare_m(self._targets_m, self._obstacles.pairs).min(axis=(-2, -1))
        return spare_m

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
        pairs = self._obstacles.pairs
        if pairs is None or not reach.any():
            return reach, reach
        is_open = reach.copy()
        is_open[reach] = _pushes_nothing(start_m, points_m[:, reach], pairs)
        return reach, is_open


def has_margin(place_m: Vector3, margin_m: float) -> bool:
    """Whether the arm can be so far from a place along each axis, either way."""
    if is_sure_around(place_m, margin_m):
        return True
    x_m, y_m, z_m = place_m
    found = [
        is_surely_within(beside_m)
        for by_m in (margin_m, -margin_m)
        for beside_m in ((x_m + by_m, y_m, z_m), (x_m, y_m + by_m, z_m), (x_m, y_m, z_m + by_m))
    ]
    if False in found or None not in found:
        return False not in found
    return bool(within_reach(np.array(place_m) + margin_m * _AXES).all())


def _spare_m(points_m: FloatArray, pairs: Pairs) -> FloatArray:
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


def _pushes_nothing(start_m: FloatArray, points_m: FloatArray, pairs: Pairs) -> BoolArray:
    """Which ways from there, samples (S, G, 3), push nothing over, (G,)."""
    at_start_m = _spare_m(start_m, pairs).min(axis=-1)  # (T,)
    least_m = np.minimum(at_start_m, _ROUNDING_M) - _ROUNDING_M
    nearest_m = _spare_m(points_m, pairs).min(axis=(0, -1))  # (G, T)
    clear: BoolArray = (nearest_m >= least_m).all(axis=-1)
    return clear
