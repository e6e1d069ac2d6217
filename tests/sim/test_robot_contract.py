"""The robots that ship keep the contract of every robot, with every object from every slot into every bin."""

from __future__ import annotations

import os

import pytest

from app.contracts.robot import IDS, RobotContract, check_pick_and_place
from app.trial.robots import ROBOTS
from sim import layouts
from sim.interface import Robot
from sim.kinematic import KinematicRobot
from tests.support.shipped_world import LAYOUTS


class Shipped(RobotContract):
    """A robot of the lab."""

    @pytest.mark.slow
    @pytest.mark.parametrize("layout", LAYOUTS.values(), ids=list(LAYOUTS))
    @pytest.mark.parametrize("object_id", IDS)
    def test_every_object_from_every_place_into_every_bin(
        self, robot: Robot, layout: layouts.Layout, object_id: str
    ) -> None:
        """With physics one place an object, so that each is tried once; all 144 with SALAB_FULL_SWEEP=1 (minutes)."""
        whole = isinstance(robot, KinematicRobot) or bool(os.environ.get("SALAB_FULL_SWEEP"))
        for place in range(len(layout.places)) if whole else (IDS.index(object_id),):
            shift = (IDS.index(object_id) - place) % len(IDS)
            scene = layouts.scene(layout, IDS[shift:] + IDS[:shift])
            for item in scene.bins:
                check_pick_and_place(robot, layout, scene, object_id, item.id)


class TestKinematic(Shipped):
    robot_name = "kinematic"


@pytest.mark.bullet
class TestBullet(Shipped):
    robot_name = "bullet"


def test_every_robot_that_ships_is_held_to_it() -> None:
    assert {shipped.robot_name for shipped in Shipped.__subclasses__()} == set(ROBOTS.shipped)


@pytest.mark.mujoco
class TestMujoco(Shipped):
    robot_name = "mujoco"
