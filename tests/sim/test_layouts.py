"""Layouts keep what they promise, and say everything that is wrong with them."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sim import fetch, layouts, objects
from sim.interface import SimError, Vector3
from sim.layouts import LAYOUTS, Layout
from tests.support.robot_cases import reachable

IDS = tuple(objects.STUDY_OBJECTS)
EVERY = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=list(LAYOUTS))


def follow(*points: Vector3) -> bool:
    """Whether the straight ways from point to point are within reach, tried 1 mm by 1 mm."""
    for start, end in pairwise(points):
        count = math.ceil(math.dist(start, end) / 0.001) + 1
        if not reachable(np.linspace(start, end, count)).all():
            return False
    return True


def picks(layout: Layout) -> list[Vector3]:
    """Every grasp point there can be: each slot with each object's grasp height."""
    heights = {spec.grasp_height_m for spec in objects.OBJECTS.values()}
    slots = (*layout.slots, layout.practice_slot)
    return [(x, y, layout.table.top_z_m + height) for x, y in slots for height in sorted(heights)]


@EVERY
def test_shipped_layouts_have_no_problems(layout: Layout) -> None:
    assert layouts.layout_problems(layout) == ()
    assert layouts.checked(layout) is layout


@EVERY
def test_straight_way_from_start_to_every_pick(layout: Layout) -> None:
    for pick in picks(layout):
        assert follow(layout.start_world_m, pick), pick


@EVERY
@pytest.mark.parametrize("lift_m", [0.0, layouts.LIFT_M])
def test_straight_way_from_every_pick_to_above_every_bin(layout: Layout, lift_m: float) -> None:
    for x, y, z in picks(layout):
        for item in layout.bins:
            assert follow((x, y, z + lift_m), item.release_world_m), (x, y, z + lift_m, item.id)


@EVERY
def test_free_way_by_the_aisle(layout: Layout) -> None:
    """Straight in from the aisle; and up, back to the aisle, along it and on to each bin."""
    for x, y, z in picks(layout):
        above_m = z + layouts.LIFT_M
        assert follow((layout.aisle_x_m, y, z), (x, y, z), (x, y, above_m), (layout.aisle_x_m, y, above_m))
        for item in layout.bins:
            along: Vector3 = (layout.aisle_x_m, item.release_world_m[1], above_m)
            assert follow((layout.aisle_x_m, y, above_m), along, item.release_world_m)


@EVERY
def test_neighbours_leave_room_for_an_open_gripper(layout: Layout) -> None:
    open_half_m = fetch.FINGER_TRAVEL_M + fetch.FINGER_SIZE_M[1]
    widest_half_m = max(max(spec.size_m[:2]) for spec in objects.OBJECTS.values()) / 2.0
    for index, a in enumerate(layout.slots):
        for b in layout.slots[index + 1 :]:
            assert math.dist(a, b) >= 0.18
            assert abs(a[1] - b[1]) > open_half_m + widest_half_m


@EVERY
def test_bins_stand_clear_of_table_and_robot(layout: Layout) -> None:
    wall_m = 0.012
    for item in layout.bins:
        far_x_m = item.center_xy_m[0] + item.inner_size_m[0] / 2.0 + wall_m
        assert far_x_m < layout.table.center_world_m[0] - layout.table.size_m[0] / 2.0
        near_x_m = item.center_xy_m[0] - item.inner_size_m[0] / 2.0 - wall_m
        assert near_x_m > 0.29  # the base's rim


def test_objects_fit_the_fingers_and_the_brief() -> None:
    assert list(objects.OBJECTS) == [*IDS, "practice_block"]
    for spec in objects.OBJECTS.values():
        x_m, y_m, z_m = spec.size_m
        assert max(x_m, y_m) <= fetch.MAX_OPENING_M - 2 * 0.013
        assert min(x_m, y_m) >= 0.05
        assert 0.12 <= z_m <= 0.25
        assert 0.1 <= spec.mass_kg <= 0.6
        assert spec.grasp_height_m < z_m
        assert spec.shape == "box" or x_m == y_m
    with pytest.raises(SimError, match=r"no object 'cup'.*spray_bottle"):
        objects.object_spec("cup")


def test_ids_and_labels_are_those_of_the_study() -> None:
    assert {spec.id: spec.label for spec in objects.OBJECTS.values()} == {
        "spray_bottle": "spray bottle",
        "bleach_bottle": "bleach bottle",
        "paper_towels": "paper towel roll",
        "wipes_tub": "tub of wipes",
        "absorbent_can": "absorbent powder",
        "sponge_pack": "pack of sponges",
        "practice_block": "practice block",
    }
    for layout in LAYOUTS.values():
        assert [(item.id, item.label) for item in layout.bins] == [("left_bin", "left bin"), ("right_bin", "right bin")]
        assert layout.bins[0].center_xy_m[1] > 0.0 > layout.bins[1].center_xy_m[1]  # left as the robot sees it
    assert layouts.DEFAULT_LAYOUT in LAYOUTS


def test_scene_stands_objects_on_their_slots_in_slot_order() -> None:
    layout = LAYOUTS["arc"]
    by_slot = dict(reversed(list(enumerate(IDS))))  # given backwards: the order of creation must not follow
    scene = layouts.scene(layout, by_slot)
    assert scene == layouts.scene(layout, IDS)
    assert [placed.spec.id for placed in scene.objects] == list(IDS)
    for slot, placed in zip(layout.slots, scene.objects, strict=True):
        assert placed.base_world_m == (*slot, layout.table.top_z_m)


def test_scene_with_some_objects_left_keeps_the_others_where_they_are() -> None:
    layout = LAYOUTS["rows"]
    full = layouts.scene(layout, IDS)
    some = layouts.scene(layout, IDS, ["sponge_pack", "bleach_bottle"])
    assert some.objects == (full.object("bleach_bottle"), full.object("sponge_pack"))
    assert layouts.scene(layout, IDS, []).objects == ()


def test_practice_scene_has_the_practice_object_alone() -> None:
    scene = layouts.practice_scene(LAYOUTS["arc"])
    assert [placed.spec.id for placed in scene.objects] == ["practice_block"]
    assert scene.table.covers(*scene.objects[0].base_world_m[:2])


@pytest.mark.parametrize(
    ("placement", "remaining", "words"),
    [
        ({6: "sponge_pack"}, None, "slot 6; layout 'arc' has slots 0 to 5"),
        (["cup"], None, "no object 'cup'"),
        (["sponge_pack", "sponge_pack"], None, "placed twice"),
        (["sponge_pack"], ["wipes_tub"], "wipes_tub cannot remain.*sponge_pack"),
    ],
)
def test_scene_errors(placement: dict[int, str] | list[str], remaining: list[str] | None, words: str) -> None:
    with pytest.raises(SimError, match=words):
        layouts.scene(LAYOUTS["arc"], placement, remaining)


def test_every_problem_is_listed_at_once() -> None:
    good = LAYOUTS["arc"]
    left, right = good.bins
    bad = replace(
        good,
        name="",
        slots=((0.90, 0.10), (0.90, 0.02), (1.20, 0.0), *good.slots[3:5]),
        bins=(left, replace(right, release_world_m=(0.50, 0.0, 0.90))),
        aisle_x_m=0.75,
    )
    with pytest.raises(SimError) as error:
        layouts.checked(bad)
    for words in (
        "the name is empty",
        "5 slots; a layout has 6",
        "slot 0 and slot 1 are 0.080 m apart; at least 0.18 m",
        "slot 2 at (1.2, 0.0) is closer than 0.05 m to the table's edge",
        "the straight path from the start to slot 2",
        "right_bin is not below its release point",
        "to right_bin leaves the reach",
        "the aisle at x 0.75 m is too near the objects",
    ):
        assert words in str(error.value)


def test_a_coordinate_that_is_no_number_is_told() -> None:
    bad = replace(LAYOUTS["arc"], practice_slot=(math.nan, 0.0))
    assert "a coordinate is not a finite number" in layouts.layout_problems(bad)
