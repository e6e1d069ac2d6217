"""Which motions would push objects over or press on them: what an arm that moves by itself must not do. Pure.

A person may drive into things; the robot, when the hands are off, plans around what it sees, as the paper's planner
did. In the plane, a standing cylinder is a circle, a box a rectangle as long as it stands square to the table (else
the circle around it), and so is a held object; fingers and palm are boxes. What has fallen is as long, wide and
high as it lies. A motion is clear when every part keeps its margin to every object all the way, or at least does not
come nearer to one that it is too near to already. To what stands, margins are kept in the plane; to what has fallen,
from above too: nothing comes down on it.

    allows = clearance(world, scene)
    allows((0.02, 0.0, 0.0))         whether the gripper may go 2 cm ahead

Plain numbers on purpose: little stands nearby, and few motions are asked about.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

from sim import fetch
from sim.interface import ObjectSpec, Pose, SceneSpec, Vector3, WorldState

FINGER_MARGIN_M = 0.003
PALM_MARGIN_M = 0.003
CARRIED_MARGIN_M = 0.01
MAX_WAY_M = 0.05
"""The longest motion that is asked about: a tick's."""
NEAR_M = 0.35
"""Objects farther away than this, along x or y, cannot be reached by gripper or carried object within a tick."""

_STANDS = math.cos(math.pi / 4.0)
_SHARES = (0.5, 1.0)
"""Where on its way a motion is looked at, besides its start."""
_ROUNDING_M = 1e-9
_WORLD: tuple[Vector3, Vector3, Vector3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_SQUARE = 0.03
"""Of a quaternion's z: about 3.5 degrees of turn."""


class _Outline(NamedTuple):
    """Something upright: a rectangle with a rounded edge of `radius_m` around it; half sizes."""

    length_m: float
    width_m: float
    radius_m: float
    height_m: float


class _Part(NamedTuple):
    """Something that moves with the gripper: where its middle is from there, and the distance it keeps."""

    place_m: Vector3
    outline: _Outline
    margin_m: float


class _Standing(NamedTuple):
    """An object that could be pushed over, and where its middle is from the gripper."""

    place_m: Vector3
    outline: _Outline

    def gap_m(self, part: _Part, x_m: float, y_m: float, z_m: float) -> float:
        """Distance in the plane between a part and this at (x, y, z) from the gripper; infinite above or below."""
        own, its = part.outline, self.outline
        if abs(z_m - part.place_m[2]) >= its.height_m + own.height_m:
            return math.inf
        along_m = max(abs(x_m - part.place_m[0]) - own.length_m - its.length_m, 0.0)
        aside_m = max(abs(y_m - part.place_m[1]) - own.width_m - its.width_m, 0.0)
        return math.hypot(along_m, aside_m) - its.radius_m - own.radius_m


class _Fallen(NamedTuple):
    """An object that lies or leans, and where its middle is from the gripper. `sides` are directions of length 1, the
    world's axes, its own and what is square to both, and half of what it measures along each."""

    place_m: Vector3
    sides: tuple[tuple[Vector3, float], ...]

    def gap_m(self, part: _Part, x_m: float, y_m: float, z_m: float) -> float:
        """How far at least a part and this, at (x, y, z) from the gripper, are apart; below 0, how deep in each other
        they are where it is the shortest way out, so that leading out counts as going away."""
        own, (at_x_m, at_y_m, at_z_m) = part.outline, part.place_m
        x_m, y_m, z_m = x_m - at_x_m, y_m - at_y_m, z_m - at_z_m
        # Two bodies are as far apart as along that direction along which they are farthest apart, or farther.
        return max(
            [
                abs(x_m * x + y_m * y + z_m * z)
                - half_m
                - own.length_m * abs(x)
                - own.width_m * abs(y)
                - own.height_m * abs(z)
                - own.radius_m * math.hypot(x, y)
                for (x, y, z), half_m in self.sides
            ]
        )


def clearance(world: WorldState, scene: SceneSpec) -> Callable[[Vector3], bool]:
    """What tells of a straight displacement of the gripper, of at most 5 cm, whether it pushes nothing over."""
    parts = moving_parts(world, scene)
    near = _near(parts, world, scene)

    def allows(way_m: Vector3) -> bool:
        return all(_passes(parts, thing, way_m) for thing in near)

    return allows


def _passes(parts: Sequence[_Part], thing: _Standing | _Fallen, way_m: Vector3) -> bool:
    on_the_way_m = min([_spare_m(parts, thing, way_m, share) for share in _SHARES])
    return on_the_way_m >= 0.0 or on_the_way_m >= _spare_m(parts, thing, way_m, 0.0) - _ROUNDING_M


def _spare_m(parts: Sequence[_Part], thing: _Standing | _Fallen, way_m: Vector3, share: float) -> float:
    """How much more than its margin the nearest part keeps, at that share of the way."""
    x_m, y_m, z_m = thing.place_m
    x_m, y_m, z_m = x_m - share * way_m[0], y_m - share * way_m[1], z_m - share * way_m[2]
    return min([thing.gap_m(part, x_m, y_m, z_m) - part.margin_m for part in parts])


def moving_parts(world: WorldState, scene: SceneSpec) -> tuple[_Part, ...]:
    """Two fingers, the palm, and what is held."""
    gripper = _gripper(world.finger_opening_m)
    if world.held is None:
        return gripper
    pose = world.object(world.held).pose
    place_m = _offset_m(pose, world.position_world_gripper_m)
    spec = scene.object(world.held).spec
    outline = outline_of(spec, pose)
    return (*gripper, _Part(place_m, outline, CARRIED_MARGIN_M))


@lru_cache(maxsize=64)
def _gripper(opening_m: float) -> tuple[_Part, ...]:
    finger, palm = _box(fetch.FINGER_SIZE_M), _box(fetch.PALM_SIZE_M)
    beside_m = opening_m / 2.0 + finger.width_m
    return (
        _Part((fetch.FINGER_CENTER_X_M, beside_m, 0.0), finger, FINGER_MARGIN_M),
        _Part((fetch.FINGER_CENTER_X_M, -beside_m, 0.0), finger, FINGER_MARGIN_M),
        _Part(fetch.PALM_CENTER_M, palm, PALM_MARGIN_M),
    )


def _near(parts: Sequence[_Part], world: WorldState, scene: SceneSpec) -> list[_Standing | _Fallen]:
    """Everything on the table, except what is held, that a motion could bring nearer than a margin."""
    found: list[_Standing | _Fallen] = []
    for item in world.objects:
        place_m = _offset_m(item.pose, world.position_world_gripper_m)
        if abs(place_m[0]) > NEAR_M or abs(place_m[1]) > NEAR_M or item.id == world.held:
            continue
        if item.pose.position_world_m[2] < scene.table.top_z_m:
            continue
        spec, is_upright = scene.object(item.id).spec, stands(item.pose)
        outline = _outline(spec, item.pose) if is_upright else _box_around(spec, item.pose)
        if any(_within_reach(part, place_m, outline) for part in parts):
            found.append(_Standing(place_m, outline) if is_upright else _fallen(place_m, spec, item.pose))
    return found


def _within_reach(part: _Part, place_m: Vector3, its: _Outline) -> bool:
    own = part.outline
    most_m = own.radius_m + its.radius_m + part.margin_m + MAX_WAY_M
    return (
        abs(place_m[0] - part.place_m[0]) - own.length_m - its.length_m <= most_m
        and abs(place_m[1] - part.place_m[1]) - own.width_m - its.width_m <= most_m
    )


def _offset_m(pose: Pose, from_m: Vector3) -> Vector3:
    x_m, y_m, z_m = pose.position_world_m
    return x_m - from_m[0], y_m - from_m[1], z_m - from_m[2]


def _outline(spec: ObjectSpec, pose: Pose) -> _Outline:
    length_m, width_m, height_m = spec.size_m
    if spec.shape == "cylinder":
        return _Outline(0.0, 0.0, length_m / 2.0, height_m / 2.0)
    if abs(pose.quaternion_wxyz[3]) > _SQUARE:
        return _Outline(0.0, 0.0, math.hypot(length_m, width_m) / 2.0, height_m / 2.0)
    return _box(spec.size_m)


def _box(size_m: Vector3) -> _Outline:
    return _Outline(size_m[0] / 2.0, size_m[1] / 2.0, 0.0, size_m[2] / 2.0)


def stands(pose: Pose) -> bool:
    """Whether it is nearer to standing than to lying. No object is so low and wide that it would still come back."""
    _, x, y, _ = pose.quaternion_wxyz
    return 1.0 - 2.0 * (x * x + y * y) >= _STANDS


def _fallen(place_m: Vector3, spec: ObjectSpec, pose: Pose) -> _Fallen:
    across, aside, along = _columns(pose)
    levels = [_across(along, side) for side in _WORLD]
    # A cylinder is round however it has rolled: its own two short axes mean nothing.
    own = [along] if spec.shape == "cylinder" else [across, aside, along]
    directions = [*_WORLD, *own, *(level for level in levels if level is not None)]
    return _Fallen(place_m, tuple([(direction, _half_m(spec, pose, direction)) for direction in directions]))


def _across(first: Vector3, second: Vector3) -> Vector3 | None:
    """The direction square to both, of length 1; None for parallel ones."""
    x = first[1] * second[2] - first[2] * second[1]
    y = first[2] * second[0] - first[0] * second[2]
    z = first[0] * second[1] - first[1] * second[0]
    length = math.hypot(x, y, z)
    return (x / length, y / length, z / length) if length > 1e-6 else None


def outline_of(spec: ObjectSpec, pose: Pose) -> _Outline:
    """What an object takes up as it stands, or the box around it as it lies."""
    return _outline(spec, pose) if stands(pose) else _box_around(spec, pose)


def _box_around(spec: ObjectSpec, pose: Pose) -> _Outline:
    """The box around an object along the world's axes."""
    length_m, width_m, height_m = (_half_m(spec, pose, along) for along in _WORLD)
    return _Outline(length_m, width_m, 0.0, height_m)


def _half_m(spec: ObjectSpec, pose: Pose, along: Vector3) -> float:
    """Half of what an object measures along a direction of the world."""
    x, y, z = (abs(sum(a * b for a, b in zip(column, along, strict=True))) for column in _columns(pose))
    length_m, width_m, height_m = (side / 2.0 for side in spec.size_m)
    if spec.shape == "cylinder":
        return length_m * math.sqrt(max(1.0 - z * z, 0.0)) + height_m * z
    return length_m * x + width_m * y + height_m * z


def _columns(pose: Pose) -> tuple[Vector3, Vector3, Vector3]:
    """The object's own axes in the world."""
    w, x, y, z = pose.quaternion_wxyz
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
