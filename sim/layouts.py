"""Where things stand: a table with places for objects, a practice place, bins. Pure, validated data.

What every layout promises (`layout_problems` checks it for the objects of the layout, so that a new layout is told
what is wrong):

- each place, and its grasp point at every height an object is grasped at, is within the arm's reach;
- the straight path start → grasp point is within reach, and so are the straight paths to the release point above
  each bin, both from the grasp point itself and from `LIFT_M` above it ("within reach" = `sim.ik.segment_feasible`);
- the aisle, x = `aisle_x_m`, lets an object lifted by `LIFT_M` be carried sideways between the release points in front
  of everything that stands on the table: pulled straight back to it, along it, and on to a bin, it touches nothing;
- neighbours are at least `spacing_m` apart, and no two in a straight line forward are closer than `lane_m` sideways,
  so that an open gripper that lines up in front of an object and moves straight in (+x) touches nothing else.
  Diagonal approaches and straight ways to a bin are within reach, but may brush a neighbour;
- the level gripper clears the table, and nothing stands inside anything else.

Any object may stand on any place: the widest and the tallest decide.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sim import fetch, ik
from sim.interface import BIN_WALL_M, Bin, ObjectSpec, PlacedObject, SceneSpec, SimError, Table, Vector3
from sim.objects import WorldProblem, object_problems

HAND_M = 0.025
"""For an unsteady hand: what is left free beside an open gripper that moves straight in."""
GAP_M = 0.10
"""Between neighbours: room for a finger and a hand that is off."""
OPEN_HALF_M = 0.065
"""Half an open gripper, fingers and palm."""
EDGE_M = 0.05
"""A place's centre lies at least this far inside the table's edges."""
LIFT_M = 0.06
RIM_M = 0.02
"""What a lifted object's base keeps above a bin's rim."""
BASE_RADIUS_M = 0.29
"""The robot stands on a round base of so much."""
HIGHEST_TABLE_M = round(ik.WORKSPACE_LOW_M[2] - fetch.PALM_SIZE_M[2] / 2.0, 6)
"""The palm clears a table top up to here wherever the arm may go."""

PlaceXY = tuple[float, float]


@dataclass(frozen=True)
class Layout:
    """A table with places (x, y) in the world frame, metres; yaw of whatever stands there is 0."""

    name: str
    table: Table
    places: tuple[PlaceXY, ...]
    practice_place: PlaceXY
    bins: tuple[Bin, ...]
    aisle_x_m: float
    objects: tuple[ObjectSpec, ...]
    """What may stand on the places, any of it on any of them."""
    practice_object: ObjectSpec
    start_world_m: Vector3 = fetch.START_POSITION_M

    @property
    def widest_m(self) -> float:
        """Of the objects."""
        return max(max(spec.size_m[:2]) for spec in self.objects)

    @property
    def lane_m(self) -> float:
        """What two places in a line keep sideways: half an open gripper, half an object, and `HAND_M`."""
        return round(OPEN_HALF_M + self.widest_m / 2.0 + HAND_M, 6)

    @property
    def spacing_m(self) -> float:
        """What two neighbours keep from middle to middle."""
        return round(self.widest_m + GAP_M, 6)


def layout_problems(layout: Layout) -> tuple[WorldProblem, ...]:
    """Everything that is wrong with a layout, each with value and bound; empty when it keeps its promises."""
    problems = []
    if not layout.name:
        problems.append(WorldProblem(("name",), "is empty"))
    if not layout.objects:
        problems.append(WorldProblem(("objects",), "has no entries; a layout has objects"))
    if not layout.bins:
        problems.append(WorldProblem(("bins",), "has no entries; at least one is needed"))
    problems += _repeated("objects", [spec.id for spec in layout.objects])
    problems += _repeated("bins", [item.id for item in layout.bins])
    numbers = [*layout.start_world_m, layout.aisle_x_m]
    numbers += [value for place in (*layout.places, layout.practice_place) for value in place]
    numbers += [value for item in layout.bins for value in (*item.center_xy_m, *item.inner_size_m, item.height_m)]
    numbers += [value for item in layout.bins for value in item.release_world_m]
    numbers += [*layout.table.center_world_m, *layout.table.size_m]
    numbers += [
        value
        for spec in (*layout.objects, layout.practice_object)
        for value in (*spec.size_m, spec.grasp_height_m, spec.mass_kg, spec.friction)
    ]
    if not all(math.isfinite(number) for number in numbers):
        return (*problems, WorldProblem((), "a coordinate is not a finite number"))  # the rest could not be told
    for number, spec in enumerate(layout.objects):
        problems += [WorldProblem(("objects", number, *each.place), each.sentence) for each in object_problems(spec)]
    if not layout.objects:
        return tuple(problems)
    problems += [
        *_table_problems(layout.table),
        *_start_problems(layout),
        *(problem for number in range(len(layout.bins)) for problem in _bin_problems(number, layout)),
        *_bins_apart(layout.bins),
        *_places_apart(layout),
        *(problem for named in _named_places(layout) for problem in _place_problems(*named, layout)),
        *_aisle_problems(layout),
    ]
    return tuple(problems)


def _repeated(field: str, ids: Sequence[str]) -> Iterator[WorldProblem]:
    for number, one in enumerate(ids):
        if one in ids[:number]:
            yield WorldProblem((field, number, "id"), f"{one!r} stands there twice; ids must be different")


def _table_problems(table: Table) -> Iterator[WorldProblem]:
    if table.top_z_m > HIGHEST_TABLE_M + ik.ROUNDING_M:
        yield WorldProblem(
            ("table",), f"its top is {table.top_z_m:g} m high; the palm clears one of at most {HIGHEST_TABLE_M:g} m"
        )
    near_m = table.center_world_m[0] - table.size_m[0] / 2.0
    if near_m < BASE_RADIUS_M:
        yield WorldProblem(
            ("table",), f"it begins at x {near_m:g} m; the robot's base reaches to x {BASE_RADIUS_M:g} m"
        )


def _start_problems(layout: Layout) -> Iterator[WorldProblem]:
    where = ("start_world_m",)
    start_m = layout.start_world_m
    reason = ik.solve(start_m)[1]
    if reason:
        yield WorldProblem(where, f"out of the arm's reach: {ik.REASONS[reason]}")
    tallest_m = max(spec.size_m[2] for spec in (*layout.objects, layout.practice_object))
    if start_m[2] - fetch.PALM_SIZE_M[2] / 2.0 > layout.table.top_z_m + tallest_m:
        return
    widest_m = max(layout.widest_m, *layout.practice_object.size_m[:2])
    ahead_m = fetch.FINGER_CENTER_X_M + fetch.FINGER_SIZE_M[0] / 2.0
    behind_m = fetch.PALM_SIZE_M[0] / 2.0 - fetch.PALM_CENTER_M[0]
    for _, name, (x_m, y_m), _ in _named_places(layout):
        in_line = -behind_m < x_m - start_m[0] + widest_m / 2.0 and x_m - widest_m / 2.0 - start_m[0] < ahead_m
        if in_line and abs(y_m - start_m[1]) < OPEN_HALF_M + widest_m / 2.0:
            yield WorldProblem(where, f"the gripper at {_spell(start_m)} m stands in an object on {name}")


def _bin_problems(number: int, layout: Layout) -> Iterator[WorldProblem]:
    item, table = layout.bins[number], layout.table
    x_m, y_m, z_m = item.release_world_m
    if item.distance_m(x_m, y_m) > 0.0:
        yield WorldProblem(
            ("bins", number, "release_world_m"), f"{item.id} is not below its release point {_spell((x_m, y_m, z_m))} m"
        )
    reason = ik.solve(item.release_world_m)[1]
    if reason:
        yield WorldProblem(
            ("bins", number, "release_world_m"),
            f"{_spell((x_m, y_m, z_m))} m, over {item.id}, is out of the arm's reach: {ik.REASONS[reason]}",
        )
    highest_m = round(min(table.top_z_m, z_m - max(spec.grasp_height_m for spec in layout.objects)) - RIM_M, 6)
    if item.height_m > highest_m:
        yield WorldProblem(
            ("bins", number, "height_m"),
            f"{item.height_m:g} m; objects are carried over {item.id} to its release point: at most {highest_m:g} m",
        )
    if min(item.inner_size_m) < layout.widest_m + 2.0 * HAND_M:
        yield WorldProblem(
            ("bins", number, "inner_size_m"),
            f"{_spell(item.inner_size_m)} m; the widest object is {layout.widest_m:g} m: at least "
            f"{layout.widest_m + 2.0 * HAND_M:g} m both ways",
        )
    if _overlap(item.center_xy_m, item.inner_size_m, table.center_world_m[:2], table.size_m[:2], BIN_WALL_M):
        yield WorldProblem(("bins", number, "center_xy_m"), f"{item.id} stands inside the table")
    off_m = [max(abs(item.center_xy_m[axis]) - item.inner_size_m[axis] / 2.0 - BIN_WALL_M, 0.0) for axis in (0, 1)]
    if math.hypot(*off_m) < BASE_RADIUS_M:
        yield WorldProblem(
            ("bins", number, "center_xy_m"),
            f"{item.id} is {math.hypot(*off_m):.3f} m from the robot's middle; its base needs {BASE_RADIUS_M:g} m",
        )


def _bins_apart(bins: Sequence[Bin]) -> Iterator[WorldProblem]:
    for (_, one), (number, other) in combinations(enumerate(bins), 2):
        if _overlap(one.center_xy_m, one.inner_size_m, other.center_xy_m, other.inner_size_m, 2.0 * BIN_WALL_M):
            yield WorldProblem(("bins", number, "center_xy_m"), f"{other.id} stands inside {one.id}")


def _overlap(
    center_m: Sequence[float],
    size_m: Sequence[float],
    other_m: Sequence[float],
    other_size_m: Sequence[float],
    gap_m: float,
) -> bool:
    """Whether two rectangles are nearer than `gap_m`."""
    return all(
        abs(center_m[axis] - other_m[axis]) < (size_m[axis] + other_size_m[axis]) / 2.0 + gap_m for axis in (0, 1)
    )


def _named_places(
    layout: Layout,
) -> Iterator[tuple[tuple[str | int, ...], str, PlaceXY, tuple[float, ...]]]:
    """Every place: its field, what it is called, where it is, and the heights objects are grasped at there."""
    heights_m = tuple(sorted({spec.grasp_height_m for spec in layout.objects}))
    for number, place in enumerate(layout.places):
        yield ("places", number), f"place {number + 1}", place, heights_m
    yield ("practice_place",), "the practice place", layout.practice_place, (layout.practice_object.grasp_height_m,)


def _places_apart(layout: Layout) -> Iterator[WorldProblem]:
    for (one, a), (other, b) in combinations(enumerate(layout.places), 2):
        apart_m, sideways_m = math.dist(a, b), abs(a[1] - b[1])
        between = f"place {one + 1} and place {other + 1} are"
        if apart_m < layout.spacing_m - ik.ROUNDING_M:
            sentence = (
                f"{between} {apart_m:.3f} m apart; objects {layout.widest_m:g} m wide need {layout.spacing_m:g} m"
            )
        elif sideways_m < layout.lane_m - ik.ROUNDING_M:
            sentence = (
                f"{between} {sideways_m:.3f} m apart sideways; to pass objects {layout.widest_m:g} m wide the open "
                f"gripper needs {layout.lane_m:g} m"
            )
        else:
            continue
        yield WorldProblem(("places", other), sentence)


def _place_problems(
    where: tuple[str | int, ...], name: str, place: PlaceXY, heights_m: Sequence[float], layout: Layout
) -> Iterator[WorldProblem]:
    corners = [(place[0] + dx_m, place[1] + dy_m) for dx_m in (-EDGE_M, EDGE_M) for dy_m in (-EDGE_M, EDGE_M)]
    if not all(layout.table.covers(*corner) for corner in corners):
        yield WorldProblem(where, f"{name} at {_spell(place)} m is closer than {EDGE_M:g} m to the table's edge")
    grasps_m = np.array([[*place, layout.table.top_z_m + height_m] for height_m in heights_m])
    for point_m in (*grasps_m, *(grasps_m + [0.0, 0.0, LIFT_M])):
        reason = ik.solve((float(point_m[0]), float(point_m[1]), float(point_m[2])))[1]
        if reason:
            yield WorldProblem(where, f"{name} is out of the arm's reach at z {point_m[2]:.2f} m: {ik.REASONS[reason]}")
            return
    if not ik.solve(layout.start_world_m)[1]:
        far = ~ik.segment_feasible(layout.start_world_m, grasps_m - np.array(layout.start_world_m))
        if far.any():
            yield WorldProblem(
                where, f"the straight path from the start to {name} at z {_heights(grasps_m[far])} m leaves the reach"
            )
    for item in layout.bins:
        if ik.solve(item.release_world_m)[1]:
            continue
        lost_m = [
            above_m
            for above_m in (*grasps_m, *(grasps_m + [0.0, 0.0, LIFT_M]))
            if not ik.segment_feasible(
                (float(above_m[0]), float(above_m[1]), float(above_m[2])),
                (np.array(item.release_world_m) - above_m)[None],
            )[0]
        ]
        if lost_m:
            yield WorldProblem(
                where,
                f"the straight path from {name} at z {_heights(np.array(lost_m))} m to {item.id} leaves the reach",
            )


def _heights(points_m: np.ndarray) -> str:
    return ", ".join(f"{z_m:.2f}" for z_m in sorted(set(points_m[:, 2].tolist())))


def _aisle_problems(layout: Layout) -> Iterator[WorldProblem]:
    where = ("aisle_x_m",)
    free_m = layout.aisle_x_m + fetch.FINGER_CENTER_X_M + fetch.FINGER_SIZE_M[0] / 2.0
    widest_m = max(layout.widest_m, *layout.practice_object.size_m[:2])
    nearest_m = min(x_m for x_m, _ in (*layout.places, layout.practice_place))
    last_m = nearest_m - max(widest_m / 2.0 + free_m - layout.aisle_x_m, widest_m)
    if layout.aisle_x_m > last_m + ik.ROUNDING_M:
        yield WorldProblem(
            where,
            f"the aisle at x {layout.aisle_x_m:g} m is too near the objects, the first at x {nearest_m:g} m: at most "
            f"{last_m:.3f} m",
        )
    y_m = [item.release_world_m[1] for item in layout.bins if not ik.solve(item.release_world_m)[1]]
    if not y_m:
        return
    along = np.array([[0.0, max(y_m) - min(y_m), 0.0]])
    heights_m = sorted({spec.grasp_height_m for spec in (*layout.objects, layout.practice_object)})
    carried_z_m = [layout.table.top_z_m + height_m + LIFT_M for height_m in heights_m]
    lost = [z_m for z_m in carried_z_m if not ik.segment_feasible((layout.aisle_x_m, min(y_m), z_m), along)[0]]
    if lost:
        spelt = ", ".join(f"{z_m:.2f}" for z_m in lost)
        yield WorldProblem(where, f"the aisle at x {layout.aisle_x_m:g} m, z {spelt} m leaves the reach")


def _spell(numbers: Sequence[float]) -> str:
    return f"({', '.join(f'{number:g}' for number in numbers)})"


def checked(layout: Layout) -> Layout:
    """The layout itself; `SimError` lists everything that is wrong with it."""
    problems = layout_problems(layout)
    if problems:
        sentences = [
            ": ".join([*[".".join(map(str, each.place))] * bool(each.place), each.sentence]) for each in problems
        ]
        raise SimError(f"layout {layout.name!r}: " + "; ".join(sentences))
    return layout


def scene(
    layout: Layout,
    placement: Mapping[int, str] | Sequence[str],
    remaining: Collection[str] | None = None,
) -> SceneSpec:
    """The scene with objects on their places, created in the order of the places.

    Args:
        placement: object id by index of the place, or the ids in the order of the places.
        remaining: ids still on the table; None = all that are placed.

    Raises `SimError` for an unknown place or object, an object placed twice, or a remaining one that is not placed.
    """
    by_place = dict(placement) if isinstance(placement, Mapping) else dict(enumerate(placement))
    ids = list(by_place.values())
    unknown = sorted(place for place in by_place if not 0 <= place < len(layout.places))
    if unknown:
        raise SimError(f"place {unknown[0]}; layout {layout.name!r} has places 0 to {len(layout.places) - 1}")
    if len(set(ids)) != len(ids):
        raise SimError(f"an object is placed twice: {ids}")
    missing = sorted(set(remaining or ()) - set(ids))
    if missing:
        raise SimError(f"{', '.join(missing)} cannot remain on the table; placed are {', '.join(ids) or 'none'}")
    known = {spec.id: spec for spec in layout.objects}
    strange = sorted(set(ids) - set(known))
    if strange:
        raise SimError(f"no object {strange[0]!r}; objects are {', '.join(known)}")
    keep = set(ids) if remaining is None else set(remaining)
    placed = tuple(
        _stand(known[by_place[place]], layout.places[place], layout)
        for place in sorted(by_place)
        if by_place[place] in keep
    )
    gone = tuple(known[name] for name in ids if name not in keep)
    return SceneSpec(layout.table, layout.bins, placed, layout.start_world_m, gone)


def practice_scene(layout: Layout) -> SceneSpec:
    """The practice object alone on the practice place."""
    block = _stand(layout.practice_object, layout.practice_place, layout)
    return SceneSpec(layout.table, layout.bins, (block,), layout.start_world_m)


def _stand(spec: ObjectSpec, place: PlaceXY, layout: Layout) -> PlacedObject:
    return PlacedObject(spec, (place[0], place[1], layout.table.top_z_m))
