"""The cameras: what a driver has to see is in the picture, the right way round, and not behind the arm."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from sim import fetch, ik
from sim.interface import SimError, Vector3
from sim.layouts import LIFT_M, Layout
from sim.view.viewpoints import DEFAULT_VIEW, INSET, NARROWEST_ASPECT, VIEWS, CameraView
from tests.support.shipped_world import LAYOUTS, OBJECTS

OVERVIEW = VIEWS[DEFAULT_VIEW]
ASPECTS = (1.3, 1.4, NARROWEST_ASPECT, 1.6, 1.8)
ARM_RADIUS_M = 0.06
"""About that of the Fetch's elbow, the widest part that comes between the camera and the gripper."""
TALLEST_M = max(spec.size_m[2] for spec in OBJECTS.values())
HIGHEST_GRASP_M = max(spec.grasp_height_m for spec in OBJECTS.values())

Array = NDArray[np.float64]


def gripper_positions() -> Iterator[tuple[str, Vector3]]:
    """Where the gripper goes in a trial: start, grasps, on the way, above the bins."""
    for name, layout in LAYOUTS.items():
        yield f"{name}: start", layout.start_world_m
        top_m = layout.table.top_z_m
        for number, (x_m, y_m) in enumerate((*layout.places, layout.practice_place)):
            yield f"{name}: at {number}", (x_m, y_m, top_m + HIGHEST_GRASP_M)
            yield f"{name}: in front of {number}", (x_m - 0.1, y_m, top_m + HIGHEST_GRASP_M)
            yield f"{name}: aisle {number}", (layout.aisle_x_m, y_m, top_m + HIGHEST_GRASP_M + LIFT_M)
        for target in layout.bins:
            yield f"{name}: above {target.id}", target.release_world_m


def things() -> Iterator[tuple[str, Vector3]]:
    """The corners of all that stands on the table and beside it, and of the table."""
    for name, layout in LAYOUTS.items():
        table = layout.table
        for number, (x_m, y_m) in enumerate((*layout.places, layout.practice_place)):
            for side_m in (-0.04, 0.04):
                yield f"{name}: foot of {number}", (x_m, y_m + side_m, table.top_z_m)
                yield f"{name}: top of {number}", (x_m, y_m + side_m, table.top_z_m + TALLEST_M)
        corners = [(sx, sy) for sx in (-0.5, 0.5) for sy in (-0.5, 0.5)]
        for sx, sy in corners:
            x_m, y_m, _ = table.center_world_m
            yield f"{name}: table", (x_m + sx * table.size_m[0], y_m + sy * table.size_m[1], table.top_z_m)
            for target in layout.bins:
                x_m, y_m = target.center_xy_m
                size_m = target.inner_size_m
                yield f"{name}: {target.id}", (x_m + sx * size_m[0], y_m + sy * size_m[1], target.height_m)


def gap_m(a: tuple[Array, Array], b: tuple[Array, Array]) -> float:
    """About the smallest distance between two line segments, to a few millimetres."""
    share = np.linspace(0.0, 1.0, 201)[:, None]
    first, second = (ends[0] + share * (ends[1] - ends[0]) for ends in (a, b))
    return float(np.linalg.norm(first[:, None] - second[None], axis=2).min())


def test_forward_is_up_and_left_is_left() -> None:
    assert abs(OVERVIEW.yaw_rad) <= math.radians(15)
    for name, here in gripper_positions():
        x_m, y_m, z_m = here
        right, up = OVERVIEW.in_picture(here, 1.4)
        ahead = OVERVIEW.in_picture((x_m + 0.05, y_m, z_m), 1.4)
        left = OVERVIEW.in_picture((x_m, y_m + 0.05, z_m), 1.4)
        assert ahead[1] - up > 3 * abs(ahead[0] - right), name
        assert right - left[0] > 3 * abs(left[1] - up), name


@pytest.mark.parametrize("aspect", ASPECTS)
def test_the_start_view_shows_all_that_matters(aspect: float) -> None:
    for name, point in (*gripper_positions(), *things()):
        right, up = OVERVIEW.in_picture(point, aspect)
        assert max(abs(right), abs(up)) < 0.97, f"{name} at {point}: {right:.2f}, {up:.2f}"


def test_the_arm_is_not_between_the_camera_and_the_gripper() -> None:
    eye = np.array(OVERVIEW.position_world_m)
    for name, position in gripper_positions():
        joints_rad, code = ik.solve(position)
        assert code == 0, name
        poses = fetch.link_poses(joints_rad, fetch.MAX_OPENING_M)
        chain = [np.array(poses[link][0]) for link in ("shoulder_lift_link", "elbow_flex_link", "wrist_flex_link")]
        for part in itertools.pairwise(chain):
            assert gap_m((eye, np.array(position)), part) > ARM_RADIUS_M, name


def test_at_the_start_no_object_hides_behind_the_gripper_or_the_arm() -> None:
    eye = np.array(OVERVIEW.position_world_m)
    for name, layout in LAYOUTS.items():
        poses = fetch.link_poses(ik.solve(layout.start_world_m)[0], fetch.MAX_OPENING_M)
        links = ("shoulder_lift_link", "elbow_flex_link", "wrist_flex_link", "gripper_link")
        chain = [np.array(poses[link][0]) for link in links]
        for x_m, y_m in layout.places:
            middle = np.array([x_m, y_m, layout.table.top_z_m + 0.06])
            for part in itertools.pairwise(chain):
                assert gap_m((eye, middle), part) > ARM_RADIUS_M, f"{name}: slot at {(x_m, y_m)}"


def in_a_dropoff(layout: Layout) -> Iterator[tuple[Vector3, int | None]]:
    """Where the gripper goes with an object, and the place that the object is from."""
    high_m = layout.table.top_z_m + HIGHEST_GRASP_M + LIFT_M
    for number, (x_m, y_m) in enumerate(layout.places):
        yield (x_m, y_m, high_m), number
        yield (layout.aisle_x_m, y_m, high_m), number
    for target in layout.bins:
        yield target.release_world_m, None


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=list(LAYOUTS))
def test_in_a_dropoff_the_arm_hides_no_object_and_not_much_more_than_half_of_a_bin(layout: Layout) -> None:
    eye = np.array(OVERVIEW.position_world_m)
    links = ("shoulder_lift_link", "elbow_flex_link", "wrist_flex_link", "gripper_link")
    top_m = layout.table.top_z_m
    for gripper_m, taken in in_a_dropoff(layout):
        poses = fetch.link_poses(ik.solve(gripper_m)[0], fetch.MAX_OPENING_M)
        arm = list(itertools.pairwise(np.array(poses[link][0]) for link in links))

        def seen(points: Array, arm: list[tuple[Array, Array]] = arm) -> float:
            return float(np.mean([min(gap_m((eye, point), part) for part in arm) > ARM_RADIUS_M for point in points]))

        for number, (x_m, y_m) in enumerate(layout.places):
            if number != taken:
                around = itertools.product(
                    (x_m - 0.03, x_m + 0.03), (y_m - 0.03, y_m + 0.03), (top_m + 0.06, top_m + 0.12)
                )
                assert seen(np.array(list(around))) == 1.0, f"{gripper_m}: an object at {(x_m, y_m)}"
        for target in layout.bins:
            (x_m, y_m), (long_m, wide_m) = target.center_xy_m, target.inner_size_m
            shares = np.linspace(-0.5, 0.5, 5)
            opening = itertools.product(x_m + shares * long_m, y_m + shares * wide_m, (target.height_m,))
            assert seen(np.array(list(opening))) >= 0.4, f"{gripper_m}: {target.id}"


def test_a_narrow_picture_shows_as_much_from_left_to_right() -> None:
    for view in VIEWS.values():
        wide = math.tan(view.vertical_fov_rad(NARROWEST_ASPECT) / 2.0) * NARROWEST_ASPECT
        assert math.tan(view.vertical_fov_rad(0.8) / 2.0) * 0.8 == pytest.approx(wide)
        assert view.vertical_fov_rad(2.0) == view.fov_rad


@pytest.mark.parametrize("aspect", [0.0, -1.0, math.nan, math.inf])
def test_a_picture_without_a_shape_is_refused(aspect: float) -> None:
    with pytest.raises(SimError, match="aspect"):
        OVERVIEW.vertical_fov_rad(aspect)


def test_the_default_comes_first_and_labels_differ() -> None:
    assert next(iter(VIEWS)) == DEFAULT_VIEW
    assert all(name == view.name for name, view in VIEWS.items())
    assert len({view.label for view in VIEWS.values()}) == len(VIEWS)


@pytest.mark.parametrize("size_px", [(304, 236), (304, 200), (220, 157)])
def test_in_the_inset_forward_is_right_and_up_is_up_and_both_are_as_large(size_px: tuple[int, int]) -> None:
    wide_px, high_px = size_px
    for name, (x_m, y_m, z_m) in gripper_positions():
        view = INSET.at((x_m, y_m, z_m), wide_px / high_px)

        def pixels(point_m: Vector3, view: CameraView = view) -> Array:
            right, up = view.in_picture(point_m, wide_px / high_px)
            return np.array([right * wide_px / 2.0, up * high_px / 2.0])

        here, forward, up = (
            pixels(point) for point in ((x_m, y_m, z_m), (x_m + 0.01, y_m, z_m), (x_m, y_m, z_m + 0.01))
        )
        a_centimetre_px = wide_px / 44.0
        assert forward - here == pytest.approx([a_centimetre_px, 0.0], abs=0.03 * a_centimetre_px), name
        assert up - here == pytest.approx([0.0, a_centimetre_px], abs=0.03 * a_centimetre_px), name


def test_the_inset_shows_the_fingers_and_cuts_the_neighbours_away() -> None:
    fingers_m = fetch.MAX_OPENING_M / 2.0 + fetch.FINGER_SIZE_M[1]
    cut_m = -INSET.eye_from_gripper_m[1] - INSET.near_m
    assert fingers_m < cut_m
    for name, layout in LAYOUTS.items():
        for x_m, y_m in layout.places:
            for other_x_m, other_y_m in layout.places:
                in_line = abs(other_x_m - x_m) < 0.10  # it would stand before the object
                if in_line and other_y_m < y_m:
                    assert other_y_m + layout.widest_m / 2.0 < y_m - cut_m, f"{name}: {other_y_m} before {y_m}"


def test_what_is_behind_a_camera_is_not_in_its_picture() -> None:
    with pytest.raises(SimError, match="behind the camera"):
        OVERVIEW.in_picture((-1.0, 0.0, 5.0), 1.4)
