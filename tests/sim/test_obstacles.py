"""What is told of ways at once is what their samples tell, whatever stands, lies or is carried."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.clearance import clearance
from sim.interface import ObjectState, Pose, SceneSpec, Vector3, WorldState
from sim.kinematic import KinematicRobot
from sim.layouts import scene
from sim.objects import grasp_point
from sim.obstacles import Obstacles
from sim.open_ways import Ways
from tests.support.shipped_world import LAYOUTS

PLACEMENT = ("spray_bottle", "bleach_bottle", "paper_towels", "wipes_tub", "absorbent_can", "sponge_pack")
HELD = "wipes_tub"


def worlds(layout: str, seed: int, held: bool) -> tuple[WorldState, SceneSpec, np.random.Generator]:
    """A world in which some objects lie about, and one may be held."""
    rng = np.random.default_rng(seed)
    spec = scene(LAYOUTS[layout], PLACEMENT)
    robot = KinematicRobot()
    robot.reset(spec)
    world = robot.observe()
    objects = []
    for item in world.objects:
        pose = item.pose
        if held and item.id == HELD:
            x_m, y_m, z_m = world.position_world_gripper_m
            pose = Pose((x_m + 0.01, y_m, z_m - 0.02))
        elif rng.random() < 0.3:
            half, turn = np.sqrt(0.5), rng.uniform(0.0, 2.0 * np.pi)
            x_m, y_m, z_m = pose.position_world_m
            pose = Pose((x_m, y_m, z_m - 0.05), (half, -float(np.sin(turn)) * half, float(np.cos(turn)) * half, 0.0))
        objects.append(ObjectState(item.id, pose, grasp_point(spec.object(item.id).spec, pose), True))
    return replace(world, objects=tuple(objects), held=HELD if held else None), spec, rng


def around(rng: np.random.Generator) -> Vector3:
    x_m, y_m, z_m = rng.uniform((0.55, -0.6, 0.80), (0.95, 0.6, 1.0)).tolist()
    return x_m, y_m, z_m


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("layout", list(LAYOUTS))
def test_ways_are_as_open_as_their_samples_say(layout: str, held: bool) -> None:
    told = []
    for seed in range(12):
        world, spec, rng = worlds(layout, seed, held)
        targets_m = np.array([around(rng) for _ in range(7)])
        ways = Ways(targets_m, Obstacles(world, spec))
        for place_m in (around(rng) for _ in range(12)):
            is_open = ways.open_from(place_m)
            assert [ways.is_open(place_m, which) for which in range(7)] == is_open.tolist()
            assert ways.are_open(place_m, 6) == bool(is_open[:6][ways.possible[:6]].all())
            assert ways.is_any_open(place_m, 6) == bool(is_open[:6][ways.possible[:6]].any())
            assert [ways.is_reached(place_m, which) for which in range(7)] == ways.looked_at_from(place_m)[0].tolist()
            told += is_open.tolist()
    assert 0.02 < np.mean(told) < 0.98


@pytest.mark.parametrize("held", [False, True])
def test_what_surely_pushes_nothing_or_something_is_what_clearance_says(held: bool) -> None:
    told = []
    for seed in range(20):
        world, spec, rng = worlds("arc", seed, held)
        for place_m in (around(rng) for _ in range(20)):
            moved = tuple(there - here for there, here in zip(place_m, world.position_world_gripper_m, strict=True))
            here = replace(
                world,
                position_world_gripper_m=place_m,
                objects=tuple(
                    replace(item, pose=Pose(shifted(item.pose.position_world_m, moved), item.pose.quaternion_wxyz))
                    if item.id == world.held
                    else item
                    for item in world.objects
                ),
            )
            allows, obstacles = clearance(here, spec), Obstacles(here, spec)
            for way in rng.uniform(-0.025, 0.025, (10, 3)).tolist():
                way_m = (way[0], way[1], way[2])
                told.append(obstacles.pushes_nothing(*place_m, way_m))
                assert told[-1] in (None, allows(way_m))
    assert told.count(True) > 0.5 * len(told)
    assert told.count(False) > 50


def test_they_stay_the_same_while_only_the_gripper_moves_with_what_it_holds() -> None:
    world, spec, _ = worlds("arc", 1, held=True)
    before = Obstacles(world, spec)
    by_m = (0.02, -0.01, 0.03)
    carried = [
        replace(item, pose=Pose(shifted(item.pose.position_world_m, by_m), item.pose.quaternion_wxyz))
        if item.id == world.held
        else item
        for item in world.objects
    ]
    there = shifted(world.position_world_gripper_m, by_m)
    moved = replace(world, position_world_gripper_m=there, objects=tuple(carried))
    assert before.as_in(moved, spec) is before
    assert before.as_in(replace(moved, finger_opening_m=0.05), spec) is not before
    assert before.as_in(replace(moved, objects=tuple(carried[1:])), spec) is not before


def shifted(place_m: Vector3, by_m: tuple[float, ...]) -> Vector3:
    return place_m[0] + by_m[0], place_m[1] + by_m[1], place_m[2] + by_m[2]
