"""When a task is over and how it went, from worlds set up by hand."""

from __future__ import annotations

import math

import pytest

from app.trial.verdicts import (
    BIN_MARGIN_M,
    LIFT_M,
    Verdict,
    dropoff_verdict,
    pickup_verdict,
    practice_verdict,
    release_points,
)
from sim.interface import SceneSpec, Vector3, WorldState
from sim.layouts import practice_scene
from sim.layouts import scene as layout_scene
from tests.support.engine_cases import ARC, PLACEMENT, StagedRobot

NAME = "spray_bottle"
SCENE = layout_scene(ARC, PLACEMENT)
REST_M = SCENE.object(NAME).rest_pose.position_world_m
LEFT_BIN = SCENE.bin("left_bin")


def world(
    position_m: Vector3,
    *,
    held: str | None = None,
    tilt_rad: float = 0.0,
    settled: bool = True,
    scene: SceneSpec = SCENE,
    name: str = NAME,
) -> WorldState:
    robot = StagedRobot()
    robot.reset(scene)
    robot.held = held
    robot.put(name, position_m, tilt_rad=tilt_rad, settled=settled)
    return robot.observe()


def raised(by_m: float) -> Vector3:
    return (REST_M[0], REST_M[1], REST_M[2] + by_m)


def failure(reason: str) -> Verdict:
    return Verdict("failure", reason)


@pytest.mark.parametrize(
    ("lifted_m", "verdict"),
    [(0.0, None), (LIFT_M - 0.001, None), (LIFT_M + 1e-9, Verdict("success")), (0.2, Verdict("success"))],
)
def test_a_pickup_is_done_three_centimetres_above_the_rest(lifted_m: float, verdict: Verdict | None) -> None:
    assert pickup_verdict(SCENE, world(raised(lifted_m), held=NAME, settled=False), NAME) == verdict


def test_the_lift_is_three_centimetres() -> None:
    assert LIFT_M == 0.03  # the contract of the export


def test_an_object_in_the_air_that_nobody_holds_is_not_picked_up() -> None:
    assert pickup_verdict(SCENE, world(raised(0.1), settled=False), NAME) is None
    assert pickup_verdict(SCENE, world(raised(0.1), held="sponge_pack", settled=False), NAME) is None


def test_a_pickup_goes_on_while_the_object_stands_within_reach() -> None:
    assert pickup_verdict(SCENE, world(REST_M), NAME) is None
    nudged = (REST_M[0] - 0.02, REST_M[1] - 0.03, REST_M[2])
    assert pickup_verdict(SCENE, world(nudged, tilt_rad=0.1), NAME) is None


def test_what_lies_cannot_be_picked_up_any_more_once_it_lies_still() -> None:
    lying = (REST_M[0], REST_M[1], SCENE.table.top_z_m + 0.034)
    assert pickup_verdict(SCENE, world(lying, tilt_rad=math.pi / 2), NAME) == failure("knocked_over")
    assert pickup_verdict(SCENE, world(lying, tilt_rad=math.pi / 2, settled=False), NAME) is None
    assert pickup_verdict(SCENE, world(lying, tilt_rad=math.pi / 2, settled=False), NAME, waited_out=True) == failure(
        "knocked_over"
    )


@pytest.mark.parametrize("settled", [True, False])
def test_what_fell_off_the_table_is_lost_at_once(settled: bool) -> None:
    beside = (REST_M[0], 0.70, SCENE.table.top_z_m - 0.01)
    assert pickup_verdict(SCENE, world(beside, settled=settled), NAME) == failure("off_table")


def test_what_was_pushed_away_upright_is_out_of_reach() -> None:
    far = (1.05, 0.55, REST_M[2])
    assert SCENE.table.covers(*far[:2])
    assert pickup_verdict(SCENE, world(far), NAME) == failure("out_of_reach")
    assert pickup_verdict(SCENE, world(far, settled=False), NAME) is None


def test_an_object_still_held_cannot_be_lost() -> None:
    low = (REST_M[0], REST_M[1], SCENE.table.top_z_m - 0.01)
    assert pickup_verdict(SCENE, world(low, held=NAME, tilt_rad=1.0), NAME) is None


def by_the_bin(gap_m: float) -> Vector3:
    """On the floor, beyond the left bin's far edge by that much."""
    x_m, y_m = LEFT_BIN.center_xy_m
    return (x_m, y_m + LEFT_BIN.inner_size_m[1] / 2.0 + gap_m, 0.05)


@pytest.mark.parametrize(
    ("where", "verdict"),
    [
        ((*LEFT_BIN.center_xy_m, 0.12), Verdict("success")),
        (by_the_bin(-0.001), Verdict("success")),
        (by_the_bin(BIN_MARGIN_M - 0.001), Verdict("success")),
        (by_the_bin(BIN_MARGIN_M + 0.001), failure("outside_bin")),
        ((*SCENE.bin("right_bin").center_xy_m, 0.12), failure("wrong_bin")),
        ((0.45, 0.0, 0.05), failure("outside_bin")),
        ((0.80, 0.30, REST_M[2]), failure("left_on_table")),
    ],
)
def test_a_dropoff_is_judged_where_the_object_lies(where: Vector3, verdict: Verdict) -> None:
    assert dropoff_verdict(SCENE, world(where), NAME, "left_bin") == verdict


def test_ten_centimetres_beside_the_bin_count_as_in_it_also_across_a_corner() -> None:
    assert BIN_MARGIN_M == 0.10
    x_m, y_m = (center + size / 2.0 for center, size in zip(LEFT_BIN.center_xy_m, LEFT_BIN.inner_size_m, strict=True))
    near, far = 0.0999 / math.sqrt(2.0), 0.1001 / math.sqrt(2.0)
    assert dropoff_verdict(SCENE, world((x_m + near, y_m + near, 0.05)), NAME, "left_bin").outcome == "success"
    assert dropoff_verdict(SCENE, world((x_m + far, y_m + far, 0.05)), NAME, "left_bin") == failure("outside_bin")


@pytest.mark.parametrize(
    ("moved_m", "verdict"),
    [
        ((0.0, 0.0), failure("not_moved")),
        ((0.0, 0.099), failure("not_moved")),
        ((0.0, 0.101), Verdict("success")),
        ((-0.072, -0.072), Verdict("success")),
    ],
)
def test_practice_asks_for_ten_centimetres(moved_m: tuple[float, float], verdict: Verdict) -> None:
    scene = practice_scene(ARC)
    x_m, y_m, z_m = scene.object("practice_block").rest_pose.position_world_m
    there = (x_m + moved_m[0], y_m + moved_m[1], z_m)
    assert practice_verdict(scene, world(there, scene=scene, name="practice_block"), "practice_block") == verdict


def test_the_goals_of_a_dropoff_are_the_places_to_let_go_at() -> None:
    points = release_points(SCENE.bins)
    assert list(points) == ["left_bin", "right_bin"]
    for name, (x_m, y_m, z_m) in points.items():
        assert SCENE.bin(name).distance_m(x_m, y_m) == 0.0
        assert z_m > SCENE.bin(name).height_m
