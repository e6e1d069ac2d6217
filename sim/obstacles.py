"""What stands in the way of the gripper, as places where the gripper must not be. Pure.

Every part that moves with the gripper (fingers, palm, what is held) keeps a margin to every object on the table. Seen
from the gripper, each such pair is an upright box with a rounded edge; what has fallen counts as the box around it.

    obstacles = Obstacles(world, scene)
    obstacles.pushes_nothing(0.7, 0.0, 0.86, (0.02, 0.0, 0.0))     whether that way certainly pushes nothing over

A way is certainly off a pair when some direction parts them by more than `SURE_M`, and certainly meets it when one of
its samples is in it by more. In between nothing is certain, and whoever asks looks at all samples (`sim.open_ways`,
`sim.clearance`), whose answers these are, at once.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.clearance import moving_parts, outline_of, stands
from sim.interface import ObjectState, SceneSpec, Vector3, WorldState
from sim.reach import Place

SURE_M = 1e-8
"""What no rounding comes to, and no bound of `sim.clearance` and `sim.open_ways` on it."""
_SAME_M = 1e-11
"""What is held is where it was in the hand, but for rounding."""

FloatArray = NDArray[np.float64]


class Pairs(NamedTuple):
    """Every object with every part that moves: from the part's place at the gripper to the object, half of what both
    measure, each an axis at a time; what both are round by, and the margin. (T, P)."""

    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    half_x_m: FloatArray
    half_y_m: FloatArray
    half_z_m: FloatArray
    least_m: FloatArray


class _Part(NamedTuple):
    """One pair: its middle, half of what it measures, and how far around that the gripper must not come either.
    `off_z_m` is how far above or below the middle it certainly does not matter."""

    x_m: float
    y_m: float
    z_m: float
    half_x_m: float
    half_y_m: float
    half_z_m: float
    least_m: float
    off_z_m: float


class Thing:
    """One object, with all parts that move.

    Attributes:
        stands: whether it is nearer to standing than to lying.
    """

    def __init__(self, parts: list[_Part], stands: bool) -> None:
        self._parts, self.stands = parts, stands
        self._low_x_m = min([part.x_m - part.half_x_m - part.least_m for part in parts]) - SURE_M
        self._high_x_m = max([part.x_m + part.half_x_m + part.least_m for part in parts]) + SURE_M
        self._low_y_m = min([part.y_m - part.half_y_m - part.least_m for part in parts]) - SURE_M
        self._high_y_m = max([part.y_m + part.half_y_m + part.least_m for part in parts]) + SURE_M
        self._low_z_m = min([part.z_m - part.off_z_m for part in parts]) - SURE_M
        self._high_z_m = max([part.z_m + part.off_z_m for part in parts]) + SURE_M

    def is_surely_off(self, x_m: float, y_m: float, z_m: float, to_x_m: float, to_y_m: float, to_z_m: float) -> bool:
        """Whether the straight way from one place to another certainly keeps off it."""
        if (
            (x_m < self._low_x_m and to_x_m < self._low_x_m)
            or (y_m < self._low_y_m and to_y_m < self._low_y_m)
            or (y_m > self._high_y_m and to_y_m > self._high_y_m)
            or (x_m > self._high_x_m and to_x_m > self._high_x_m)
            or (z_m > self._high_z_m and to_z_m > self._high_z_m)
            or (z_m < self._low_z_m and to_z_m < self._low_z_m)
        ):
            return True
        for part in self._parts:  # noqa: SIM110 - asked dozens of times a tick: a generator takes twice as long
            if not self._is_apart(part, x_m, y_m, z_m, to_x_m, to_y_m, to_z_m):
                return False
        return True

    def _is_apart(
        self, part: _Part, x_m: float, y_m: float, z_m: float, to_x_m: float, to_y_m: float, to_z_m: float
    ) -> bool:
        at_x_m, at_y_m, at_z_m, half_x_m, half_y_m, _, least_m, off_z_m = part
        off_m = off_z_m + SURE_M
        if (z_m - at_z_m > off_m and to_z_m - at_z_m > off_m) or (at_z_m - z_m > off_m and at_z_m - to_z_m > off_m):
            return True
        x_m, to_x_m, y_m, to_y_m = x_m - at_x_m, to_x_m - at_x_m, y_m - at_y_m, to_y_m - at_y_m
        least_m += SURE_M
        off_m = half_x_m + least_m
        if (x_m > off_m and to_x_m > off_m) or (x_m < -off_m and to_x_m < -off_m):
            return True
        off_m = half_y_m + least_m
        if (y_m > off_m and to_y_m > off_m) or (y_m < -off_m and to_y_m < -off_m):
            return True
        if not self.stands:
            return False  # `sim.clearance` looks at it along directions of its own
        dx_m, dy_m = to_x_m - x_m, to_y_m - y_m
        across = abs(dx_m * y_m - dy_m * x_m)
        return across > abs(dy_m) * half_x_m + abs(dx_m) * half_y_m + least_m * math.hypot(dx_m, dy_m)

    def spare_m(self, x_m: float, y_m: float, z_m: float) -> float:
        """How much more than their margins the pairs keep with the gripper there, as `_spare_m` of each."""
        return min([_spare_m(part, x_m, y_m, z_m) for part in self._parts])

    def is_surely_met(self, place: Place, target: Place, samples: int, step_m: float) -> bool:
        """Whether one of the way's samples, `step_m` apart and the target, certainly comes too near to it, and the
        place does not; 0 `samples`: nothing is known of them."""
        if not samples or self.spare_m(place.x_m, place.y_m, place.z_m) < SURE_M:
            return False
        dx_m, dy_m, dz_m = target.x_m - place.x_m, target.y_m - place.y_m, target.z_m - place.z_m
        square = dx_m * dx_m + dy_m * dy_m
        for part in self._parts:
            nearest = 1.0
            if square:
                nearest = ((part.x_m - place.x_m) * dx_m + (part.y_m - place.y_m) * dy_m) / square
            first = min(max(math.floor(nearest / step_m), 1), samples)
            for number in (first, min(first + 1, samples)):
                share = 1.0 if number == samples else number * step_m
                spare = _spare_m(part, place.x_m + share * dx_m, place.y_m + share * dy_m, place.z_m + share * dz_m)
                if spare < -SURE_M:
                    return True
        return False


def _spare_m(part: _Part, x_m: float, y_m: float, z_m: float) -> float:
    """How much more than its margin the pair keeps with the gripper there; of two answers that height could give, the
    larger one. Never below -`SURE_M` where that is uncertain."""
    at_x_m, at_y_m, at_z_m, half_x_m, half_y_m, half_z_m, least_m, _ = part
    above_m = abs(at_z_m - z_m)
    if above_m >= half_z_m - SURE_M:
        return math.inf if above_m > half_z_m + SURE_M else 0.0
    aside_x_m, aside_y_m = abs(at_x_m - x_m) - half_x_m, abs(at_y_m - y_m) - half_y_m
    if aside_x_m <= 0.0:
        return (aside_y_m if aside_y_m > 0.0 else 0.0) - least_m
    return (math.hypot(aside_x_m, aside_y_m) if aside_y_m > 0.0 else aside_x_m) - least_m


class Obstacles:
    """Everything on the table but what is held, around the gripper as it is."""

    def __init__(self, world: WorldState, scene: SceneSpec) -> None:
        self._world, self._scene = world, scene
        self._others = _others(world)
        self._held_m = _held_m(world)

    def as_in(self, world: WorldState, scene: SceneSpec) -> Obstacles:
        """Those of another world: these ones, if nothing has moved but the gripper, with what it holds."""
        if world is self._world and scene is self._scene:
            return self
        before, held_m = self._world, _held_m(world)
        if (
            world.finger_opening_m != before.finger_opening_m
            or world.held != before.held
            or (scene is not self._scene and scene != self._scene)
            or _others(world) != self._others
            or math.dist(held_m, self._held_m) > _SAME_M
        ):
            return Obstacles(world, scene)
        self._world = world
        if world.held is not None:
            self.__dict__.pop("pairs", None)  # its place in the hand is another by rounding
        return self

    def pushes_nothing(self, x_m: float, y_m: float, z_m: float, way_m: Vector3) -> bool | None:
        """What `sim.clearance` says of a way within a tick, from what stands; None where rounding, what has fallen, or
        something that is too near already may decide."""
        dx_m, dy_m, dz_m = way_m
        to_x_m, to_y_m, to_z_m = x_m + dx_m, y_m + dy_m, z_m + dz_m
        for thing in self.things:
            if thing.is_surely_off(x_m, y_m, z_m, to_x_m, to_y_m, to_z_m):
                continue
            if not thing.stands:
                return None
            half_m = thing.spare_m(x_m + 0.5 * dx_m, y_m + 0.5 * dy_m, z_m + 0.5 * dz_m)
            spare_m = min(half_m, thing.spare_m(to_x_m, to_y_m, to_z_m))
            if spare_m < SURE_M:
                return False if spare_m < -SURE_M and thing.spare_m(x_m, y_m, z_m) >= SURE_M else None
        return True

    @cached_property
    def things(self) -> list[Thing]:
        """One by one."""
        pairs = self.pairs
        if pairs is None:
            return []
        found = []
        upright = [stands(item.pose) for item in self._on_table]
        for is_upright, *rows in zip(upright, *(array.tolist() for array in pairs), strict=True):
            # Nothing comes down on what has fallen: it keeps its margin above and below too.
            parts = [
                _Part(x, y, z, half_x, half_y, half_z, least, half_z if is_upright else half_z + least)
                for x, y, z, half_x, half_y, half_z, least in zip(*rows, strict=True)
            ]
            found.append(Thing(parts, is_upright))
        return found

    @property
    def _on_table(self) -> list[ObjectState]:
        return [item for item in self._others if item.pose.position_world_m[2] >= self._scene.table.top_z_m]

    @cached_property
    def pairs(self) -> Pairs | None:
        """As arrays; None when nothing stands on the table."""
        world, scene = self._world, self._scene
        things = [
            (item.pose.position_world_m, outline_of(scene.object(item.id).spec, item.pose)) for item in self._on_table
        ]
        if not things:
            return None
        parts = moving_parts(world, scene)
        places_m = np.array([place_m for place_m, _ in things])[:, None] - np.array([part.place_m for part in parts])
        sizes = np.array([outline for _, outline in things])[:, None] + np.array([part.outline for part in parts])
        margins_m = np.array([part.margin_m for part in parts])
        along, aside, up = np.moveaxis(places_m, -1, 0)  # (T, P) each
        length, width, radius, height = np.moveaxis(sizes, -1, 0)
        return Pairs(along, aside, up, length, width, height, radius + margins_m)


def _others(world: WorldState) -> list[ObjectState]:
    """All but what is held."""
    return [item for item in world.objects if item.id != world.held]


def _held_m(world: WorldState) -> Vector3:
    """Where what is held is from the gripper."""
    if world.held is None:
        return (0.0, 0.0, 0.0)
    x_m, y_m, z_m = world.object(world.held).pose.position_world_m
    gripper_m = world.position_world_gripper_m
    return x_m - gripper_m[0], y_m - gripper_m[1], z_m - gripper_m[2]
