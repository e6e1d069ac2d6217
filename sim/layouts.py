"""Where things stand: tables, slots for six objects, a practice slot, two bins. Pure, validated data.

What every layout promises (`layout_problems` checks it, so a new layout is told what is wrong):

- each slot, and its grasp point at every height an object is grasped at, is within the arm's reach;
- the straight path start → grasp point is within reach, and so are the straight paths to the release point above
  each bin, both from the grasp point itself and from `LIFT_M` above it ("within reach" = `sim.ik.segment_feasible`);
- the aisle, x = `aisle_x_m`, lets an object lifted by `LIFT_M` be carried sideways between the release points in front
  of everything that stands on the table: pulled straight back to it, along it, and on to a bin, it touches nothing;
- neighbours are at least `SPACING_M` apart, and no two in a straight line forward are closer than `LANE_M` sideways,
  so that an open gripper that lines up in front of an object and moves straight in (+x) touches nothing else.
  Diagonal approaches and straight ways to a bin are within reach, but may brush a neighbour.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from types import MappingProxyType

import numpy as np

from sim import fetch, ik
from sim.interface import Bin, PlacedObject, SceneSpec, SimError, Table, Vector3
from sim.objects import OBJECTS, PRACTICE_OBJECT, object_spec

SLOTS = 6
SPACING_M = 0.18
LANE_M = 0.13
"""Half an open gripper (0.065) and half the widest object (0.04), and 25 mm for an unsteady hand."""
EDGE_M = 0.05
"""A slot's centre lies at least this far inside the table's edges."""
LIFT_M = 0.06
GRASP_HEIGHTS_M = tuple(sorted({spec.grasp_height_m for spec in OBJECTS.values()}))

SlotXY = tuple[float, float]


@dataclass(frozen=True)
class Layout:
    """A table with slots (x, y) in the world frame, metres; yaw of whatever stands there is 0."""

    name: str
    table: Table
    slots: tuple[SlotXY, ...]
    practice_slot: SlotXY
    bins: tuple[Bin, ...]
    aisle_x_m: float
    start_world_m: Vector3 = fetch.START_POSITION_M


def layout_problems(layout: Layout) -> tuple[str, ...]:
    """Everything that is wrong with a layout, each with value and bound; empty when it keeps its promises."""
    problems = []
    if not layout.name:
        problems.append("the name is empty")
    if len(layout.slots) != SLOTS:
        problems.append(f"{len(layout.slots)} slots; a layout has {SLOTS}")
    if len(layout.bins) < 2 or len({item.id for item in layout.bins}) != len(layout.bins):
        problems.append(f"bins {[item.id for item in layout.bins]}; at least two are needed, with different ids")
    named = {f"slot {index}": slot for index, slot in enumerate(layout.slots)} | {"practice slot": layout.practice_slot}
    numbers = [*layout.start_world_m, *(value for slot in named.values() for value in slot)]
    numbers += [value for item in layout.bins for value in (*item.center_xy_m, *item.inner_size_m, item.height_m)]
    numbers += [value for item in layout.bins for value in item.release_world_m]
    numbers += [*layout.table.center_world_m, *layout.table.size_m]
    if not all(math.isfinite(number) for number in numbers):
        return (*problems, "a coordinate is not a finite number")  # the rest could not be told
    for (one, a), (other, b) in combinations(named.items(), 2):
        if "practice slot" not in (one, other):
            problems += _too_close(one, a, other, b)
    for item in layout.bins:
        x_m, y_m, z_m = item.release_world_m
        if item.distance_m(x_m, y_m) > 0.0 or z_m <= item.height_m:
            problems.append(f"{item.id} is not below its release point {item.release_world_m}")
        dx_m, dy_m = (abs(item.center_xy_m[axis] - layout.table.center_world_m[axis]) for axis in (0, 1))
        half_x_m, half_y_m = ((item.inner_size_m[axis] + layout.table.size_m[axis]) / 2.0 for axis in (0, 1))
        if dx_m < half_x_m and dy_m < half_y_m and item.height_m > layout.table.center_world_m[2]:
            problems.append(f"{item.id} stands inside the table")
    for name, slot in named.items():
        problems += _off_table(name, slot, layout.table)
        problems += _unreachable_paths(name, slot, layout)
    problems += _aisle_problems(layout)
    return tuple(problems)


def _aisle_problems(layout: Layout) -> list[str]:
    problems = []
    free_m = layout.aisle_x_m + fetch.FINGER_CENTER_X_M + fetch.FINGER_SIZE_M[0] / 2.0
    widest_m = max(max(spec.size_m[:2]) for spec in OBJECTS.values())
    nearest_m = min(x_m for x_m, _ in (*layout.slots, layout.practice_slot))
    if free_m > nearest_m - widest_m / 2.0 or layout.aisle_x_m + widest_m > nearest_m:
        problems.append(f"the aisle at x {layout.aisle_x_m} m is too near the objects, the first at x {nearest_m} m")
    y_m = [item.release_world_m[1] for item in layout.bins]
    along = np.array([[0.0, max(y_m) - min(y_m), 0.0]])
    for height_m in GRASP_HEIGHTS_M:
        z_m = layout.table.top_z_m + height_m + LIFT_M
        if not ik.segment_feasible((layout.aisle_x_m, min(y_m), z_m), along)[0]:
            problems.append(f"the aisle at x {layout.aisle_x_m} m, z {z_m:.2f} m leaves the reach")
    return problems


def _too_close(one: str, a: SlotXY, other: str, b: SlotXY) -> list[str]:
    apart_m = math.dist(a, b)
    if apart_m < SPACING_M:
        return [f"{one} and {other} are {apart_m:.3f} m apart; at least {SPACING_M} m"]
    if abs(a[1] - b[1]) < LANE_M:
        return [f"{one} and {other} are {abs(a[1] - b[1]):.3f} m apart sideways; at least {LANE_M} m"]
    return []


def _off_table(name: str, slot: SlotXY, table: Table) -> list[str]:
    corners = [(slot[0] + dx_m, slot[1] + dy_m) for dx_m in (-EDGE_M, EDGE_M) for dy_m in (-EDGE_M, EDGE_M)]
    if all(table.covers(*corner) for corner in corners):
        return []
    return [f"{name} at {slot} is closer than {EDGE_M} m to the table's edge"]


def _unreachable_paths(name: str, slot: SlotXY, layout: Layout) -> list[str]:
    problems = []
    start = np.array(layout.start_world_m)
    for height_m in GRASP_HEIGHTS_M:
        grasp = np.array([*slot, layout.table.top_z_m + height_m])
        if not ik.segment_feasible(layout.start_world_m, (grasp - start)[None])[0]:
            problems.append(f"the straight path from the start to {name} at z {grasp[2]:.2f} m leaves the reach")
        for lift_m in (0.0, LIFT_M):
            above: Vector3 = (slot[0], slot[1], layout.table.top_z_m + height_m + lift_m)
            ways_m = np.array([item.release_world_m for item in layout.bins]) - np.array(above)
            for item, fits in zip(layout.bins, ik.segment_feasible(above, ways_m), strict=True):
                if not fits:
                    problems.append(
                        f"the straight path from {name} at z {above[2]:.2f} m to {item.id} leaves the reach"
                    )
    return problems


def checked(layout: Layout) -> Layout:
    """The layout itself; `SimError` lists everything that is wrong with it."""
    problems = layout_problems(layout)
    if problems:
        raise SimError(f"layout {layout.name!r}: " + "; ".join(problems))
    return layout


def scene(
    layout: Layout,
    placement: Mapping[int, str] | Sequence[str],
    remaining: Collection[str] | None = None,
) -> SceneSpec:
    """The scene with objects on their slots, created in slot order.

    Args:
        placement: object id by slot index, or the ids in slot order.
        remaining: ids still on the table; None = all that are placed.

    Raises `SimError` for an unknown slot or object, an object placed twice, or a remaining one that is not placed.
    """
    by_slot = dict(placement) if isinstance(placement, Mapping) else dict(enumerate(placement))
    ids = list(by_slot.values())
    unknown = sorted(slot for slot in by_slot if not 0 <= slot < len(layout.slots))
    if unknown:
        raise SimError(f"slot {unknown[0]}; layout {layout.name!r} has slots 0 to {len(layout.slots) - 1}")
    if len(set(ids)) != len(ids):
        raise SimError(f"an object is placed twice: {ids}")
    missing = sorted(set(remaining or ()) - set(ids))
    if missing:
        raise SimError(f"{', '.join(missing)} cannot remain on the table; placed are {', '.join(ids) or 'none'}")
    keep = set(ids) if remaining is None else set(remaining)
    placed = tuple(
        _stand(by_slot[slot], layout.slots[slot], layout) for slot in sorted(by_slot) if by_slot[slot] in keep
    )
    return SceneSpec(layout.table, layout.bins, placed, layout.start_world_m)


def practice_scene(layout: Layout) -> SceneSpec:
    """The practice object alone on the practice slot."""
    block = _stand(PRACTICE_OBJECT.id, layout.practice_slot, layout)
    return SceneSpec(layout.table, layout.bins, (block,), layout.start_world_m)


def _stand(object_id: str, slot: SlotXY, layout: Layout) -> PlacedObject:
    return PlacedObject(object_spec(object_id), (slot[0], slot[1], layout.table.top_z_m))


# The table's front edge leaves the bins between itself and the robot: whatever is carried comes out first, then back.
_TABLE = Table((0.90, 0.0, 0.71), (0.40, 1.16, 0.04))
_BINS = (
    Bin("left_bin", "left bin", (0.52, 0.48), (0.30, 0.30), 0.45, (0.52, 0.48, 0.90)),
    Bin("right_bin", "right bin", (0.52, -0.48), (0.30, 0.30), 0.45, (0.52, -0.48, 0.90)),
)
_PRACTICE_SLOT = (0.82, 0.0)
_AISLE_X_M = 0.67

DEFAULT_LAYOUT = "arc"
# Slots from left to right as the robot sees them.
LAYOUTS: Mapping[str, Layout] = MappingProxyType(
    {
        layout.name: layout
        for layout in (
            Layout(
                "arc",
                _TABLE,
                ((0.772, 0.435), (0.84, 0.268), (0.87, 0.09), (0.87, -0.09), (0.84, -0.268), (0.772, -0.435)),
                _PRACTICE_SLOT,
                _BINS,
                _AISLE_X_M,
            ),
            Layout(
                "rows",
                _TABLE,
                ((0.85, 0.425), (0.78, 0.255), (0.85, 0.085), (0.78, -0.085), (0.85, -0.255), (0.78, -0.425)),
                _PRACTICE_SLOT,
                _BINS,
                _AISLE_X_M,
            ),
        )
    }
)
