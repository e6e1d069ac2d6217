"""Layouts keep what they promise, and say everything that is wrong with them."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from app.autonomy.actions import DIRECTIONS
from sim import fetch, ik, layouts, objects, straight_ways
from sim.interface import SimError, Table, Vector3
from sim.layouts import Layout
from tests.support.robot_cases import reachable
from tests.support.shipped_world import LAYOUTS, OBJECTS, STUDY_OBJECTS

IDS = tuple(STUDY_OBJECTS)
BIN = LAYOUTS["arc"].bins[0]
SPRAY = STUDY_OBJECTS["spray_bottle"]
EVERY = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=list(LAYOUTS))


def follow(*points: Vector3) -> bool:
    """Whether the straight ways from point to point are within reach, tried 1 mm by 1 mm."""
    for start, end in pairwise(points):
        count = math.ceil(math.dist(start, end) / 0.001) + 1
        if not reachable(np.linspace(start, end, count)).all():
            return False
    return True


def picks(layout: Layout) -> list[Vector3]:
    """Every grasp point there can be: each place with each object's grasp height."""
    heights = {spec.grasp_height_m for spec in OBJECTS.values()}
    places = (*layout.places, layout.practice_place)
    return [(x, y, layout.table.top_z_m + height) for x, y in places for height in sorted(heights)]


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


def test_no_straight_way_in_the_crescent_ends_where_the_arm_cannot_fold_further() -> None:
    """From start and grasps to releases and to all between them, and back. In `arc` some do."""
    assert straight_ways.lost_ways(LAYOUTS["crescent"]) == ()
    assert {reason for *_, reason in straight_ways.lost_ways(LAYOUTS["arc"])} == {
        "the arm cannot fold further",
        "the wrist is at its limit",
    }


def test_between_start_places_and_bins_of_the_crescent_nothing_folds_before_it_is_past_the_goals() -> None:
    """Nor within a tick of the fitted arm (13.4 mm) behind the bins, or above what is carried."""
    a_tick_m = 0.0134
    assert len(straight_ways.folded_points(LAYOUTS["crescent"], spare_m=a_tick_m)) == 0
    assert len(straight_ways.folded_points(LAYOUTS["arc"])) > 0


@pytest.mark.parametrize("direction", [each for each in DIRECTIONS if any(each)], ids=str)
def test_straight_on_in_the_crescent_until_past_all_goals(direction: tuple[int, int, int]) -> None:
    """Millimetre by millimetre, from everywhere between start, grasps and releases, as long as every coordinate that
    changes still has a goal ahead."""
    layout = LAYOUTS["crescent"]
    bases = np.array([*straight_ways.carried_from(layout), *straight_ways.carried_to(layout)])
    rng = np.random.default_rng(11)
    shares = rng.dirichlet(np.full(len(bases), 0.1), size=40)
    along = np.array(direction) / math.sqrt(sum(map(abs, direction)))
    goals = bases[1:]
    ahead_m = np.where(along > 0, goals.max(axis=0), goals.min(axis=0))
    for here in (*bases, *(shares @ bases)):
        lengths = [(ahead_m[axis] - here[axis]) / along[axis] for axis in range(3) if along[axis]]
        way_m = here + np.arange(0.0, max(min(lengths), 0.0), 0.001)[:, None] * along
        codes = ik.solve_many(way_m)[1] if len(way_m) else np.zeros(0)
        assert not np.isin(codes, straight_ways.FOLDED).any(), (here, direction)


@EVERY
def test_neighbours_leave_room_for_an_open_gripper(layout: Layout) -> None:
    open_half_m = fetch.FINGER_TRAVEL_M + fetch.FINGER_SIZE_M[1]
    widest_half_m = max(max(spec.size_m[:2]) for spec in OBJECTS.values()) / 2.0
    for index, a in enumerate(layout.places):
        for b in layout.places[index + 1 :]:
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
    assert list(OBJECTS) == [*IDS, "practice_block"]
    for spec in OBJECTS.values():
        x_m, y_m, z_m = spec.size_m
        assert max(x_m, y_m) <= fetch.MAX_OPENING_M - 2 * 0.013
        assert min(x_m, y_m) >= 0.05
        assert 0.12 <= z_m <= 0.25
        assert 0.1 <= spec.mass_kg <= 0.6
        assert spec.grasp_height_m < z_m
        assert spec.shape == "box" or x_m == y_m
        assert not list(objects.object_problems(spec))


def test_ids_and_labels_are_those_of_the_study() -> None:
    assert {spec.id: spec.label for spec in OBJECTS.values()} == {
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
    assert list(LAYOUTS) == ["arc", "crescent", "rows"]


def test_scene_stands_objects_on_their_places_in_place_order() -> None:
    layout = LAYOUTS["arc"]
    by_place = dict(reversed(list(enumerate(IDS))))  # given backwards: the order of creation must not follow
    scene = layouts.scene(layout, by_place)
    assert scene == layouts.scene(layout, IDS)
    assert [placed.spec.id for placed in scene.objects] == list(IDS)
    for place, placed in zip(layout.places, scene.objects, strict=True):
        assert placed.base_world_m == (*place, layout.table.top_z_m)


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
        ({6: "sponge_pack"}, None, "place 6; layout 'arc' has places 0 to 5"),
        (["cup"], None, "no object 'cup'.*spray_bottle"),
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
        places=((0.90, 0.10), (0.90, 0.02), (1.20, 0.0), good.places[0], good.places[5]),
        bins=(
            replace(left, release_world_m=(0.50, 0.0, 0.90)),
            replace(right, release_world_m=(0.45, -0.25, 0.90)),
        ),
        aisle_x_m=0.75,
        start_world_m=(0.50, 0.40, 0.90),
    )
    with pytest.raises(SimError) as error:
        layouts.checked(bad)
    for words in (
        "name: is empty",
        "places.1: place 1 and place 2 are 0.080 m apart; objects 0.074 m wide need 0.174 m",
        "places.2: place 3 at (1.2, 0) m is closer than 0.05 m to the table's edge",
        "places.2: place 3 is out of the arm's reach at z 0.83 m: edge of the workspace",
        "places.4: the straight path from the start to place 5 at z 0.83, 0.84, 0.85 m leaves the reach",
        "places.3: the straight path from place 4 at z 0.83, 0.84, 0.85, 0.89, 0.90, 0.91 m to right_bin leaves the",
        "bins.0.release_world_m: left_bin is not below its release point (0.5, 0, 0.9) m",
        "bins.0.release_world_m: (0.5, 0, 0.9) m, over left_bin, is out of the arm's reach: the arm cannot fold",
        "bins.1.release_world_m: right_bin is not below its release point (0.45, -0.25, 0.9) m",
        "aisle_x_m: the aisle at x 0.75 m is too near the objects, the first at x 0.772 m: at most 0.698 m",
    ):
        assert words in str(error.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"table": Table((0.90, 0.0, 0.74), (0.40, 1.16, 0.04))}, "table: its top is 0.76 m high; the palm clears one"),
        ({"table": Table((0.60, 0.0, 0.71), (0.80, 1.16, 0.04))}, "table: it begins at x 0.2 m; the robot's base"),
        ({"start_world_m": (2.0, 0.0, 0.9)}, "start_world_m: out of the arm's reach: edge of the workspace"),
        ({"start_world_m": (0.82, 0.0, 0.88)}, "(0.82, 0, 0.88) m stands in an object on the practice place"),
        ({"aisle_x_m": 0.50}, "aisle_x_m: the aisle at x 0.5 m, z 0.89, 0.90, 0.91 m leaves the reach"),
        ({"places": ((0.78, 0.1), (0.90, 0.0))}, "place 1 and place 2 are 0.156 m apart"),
        (
            {"places": ((0.72, 0.1), (0.90, 0.0))},
            "0.100 m apart sideways; to pass objects 0.074 m wide the open gripper",
        ),
        ({"bins": ()}, "bins: has no entries; at least one is needed"),
        ({"bins": (BIN, BIN)}, "bins.1.id: 'left_bin' stands there twice"),
        ({"bins": (BIN, replace(BIN, id="other"))}, "bins.1.center_xy_m: other stands inside left_bin"),
        (
            {"bins": (BIN, replace(BIN, center_xy_m=(0.7, -0.5)))},
            "bins.1.center_xy_m: left_bin stands inside the table",
        ),
        (
            {"bins": (BIN, replace(BIN, center_xy_m=(0.3, -0.1)))},
            "0.138 m from the robot's middle; its base needs 0.29",
        ),
        ({"bins": (BIN, replace(BIN, height_m=0.72))}, "bins.1.height_m: 0.72 m; objects are carried over left_bin to"),
        (
            {"bins": (BIN, replace(BIN, inner_size_m=(0.3, 0.1)))},
            "(0.3, 0.1) m; the widest object is 0.074 m: at least 0.124",
        ),
        ({"objects": ()}, "objects: has no entries"),
        ({"objects": (SPRAY, SPRAY)}, "objects.1.id: 'spray_bottle' stands there twice"),
        (
            {"objects": (replace(SPRAY, size_m=(0.12, 0.12, 0.24)),)},
            "objects.0.size_m: 0.12 m wide; the gripper opens 0.1 m",
        ),
    ],
)
def test_a_layout_that_breaks_a_promise_is_told_so(changes: dict[str, Any], words: str) -> None:
    problems = [str(problem) for problem in layouts.layout_problems(replace(LAYOUTS["arc"], **changes))]
    assert any(words in problem for problem in problems), problems


def test_narrow_objects_may_stand_closer() -> None:
    slim = tuple(replace(spec, size_m=(0.05, 0.05, spec.size_m[2])) for spec in LAYOUTS["arc"].objects)
    close = replace(LAYOUTS["arc"], places=((0.85, 0.075), (0.85, -0.075)))
    assert (close.spacing_m, close.lane_m) == (0.174, 0.127)
    assert "place 1 and place 2 are 0.150 m apart" in str(layouts.layout_problems(close)[0])
    assert layouts.layout_problems(replace(close, objects=slim)) == ()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"size_m": (0.08, 0.06, 0.2), "shape": "box"},
            "size_m: 0.08 m wide; the gripper opens 0.1 m and needs 0.013 m",
        ),
        ({"size_m": (0.06, 0.05, 0.2)}, "size_m: 0.06 m by 0.05 m; a cylinder is as long as it is wide"),
        ({"size_m": (0.06, 0.06, 0.07)}, "size_m: 0.07 m high; the gripper closes at least 0.06 m above the table"),
        (
            {"grasp_height_m": 0.05},
            "grasp_height_m: 0.05 m; must be from 0.06 m, where the gripper clears the table, to",
        ),
        ({"grasp_height_m": 0.23}, "to 0.2268 m, where the fingers are on the object whole"),
        ({"mass_kg": 1.3}, "mass_kg: 1.3 kg; two fingers press with 18 N and hold, at friction 0.65, at most 1.19 kg"),
        ({"mass_kg": 0.4, "friction": 0.2}, "at friction 0.2, at most 0.37 kg"),
    ],
)
def test_an_object_that_the_robot_cannot_pick_up_is_told(changes: dict[str, Any], words: str) -> None:
    assert any(words in str(problem) for problem in objects.object_problems(replace(SPRAY, **changes)))


def test_a_coordinate_that_is_no_number_is_told() -> None:
    bad = replace(LAYOUTS["arc"], practice_place=(math.nan, 0.0))
    assert "a coordinate is not a finite number" in map(str, layouts.layout_problems(bad))
