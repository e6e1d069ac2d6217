"""The scripted operator gets every task done, from what is seen alone."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from app.simulated.pilot import Pilot, Sight
from app.trial.values import RobotTiming, UserInput
from sim.layouts import scene as layout_scene
from tests.support.arbiter_cases import CONDITIONS
from tests.support.engine_cases import (
    PLACEMENT,
    Person,
    drive,
    opened,
    practice_setup,
    tasks_of,
    trial_setup,
)
from tests.support.shipped_world import LAYOUTS

SEEN = Sight((0.70, 0.0, 0.88), None, "open", (0.80, 0.20, 0.85), (0.52, 0.48, 0.90))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("bin_id", ["left_bin", "right_bin"])
def test_every_object_from_every_slot_gets_into_either_bin(layout: str, bin_id: str) -> None:
    for turn in range(len(PLACEMENT)):
        placement = PLACEMENT[turn:] + PLACEMENT[:turn]
        setup = trial_setup("balanced", [(placement[0], bin_id)])
        (cycle,) = setup.cycles
        scene = layout_scene(LAYOUTS[layout], placement)
        for target in placement[:: 2 if turn % 2 else 3]:
            engine = opened(replace(setup, cycles=(replace(cycle, scene=scene, object=target),)))
            outcomes = [task.outcome for task in tasks_of(drive(engine, Person()))]
            assert outcomes == ["success", "success"], (layout, bin_id, placement, target)


@pytest.mark.parametrize("condition", CONDITIONS)
def test_practice_is_done_at_the_first_try(condition: str) -> None:
    tasks = tasks_of(drive(opened(practice_setup(condition)), Person()))
    assert [task.outcome for task in tasks] == ["success", "success"]


def test_it_waits_while_the_fingers_move_and_opens_them_when_they_closed_on_nothing() -> None:
    assert Pilot().act("wipes_tub", replace(SEEN, gripper="moving")) == UserInput()
    assert Pilot().act("wipes_tub", replace(SEEN, gripper="closed")) == UserInput(gripper="open")


def test_it_lets_go_of_the_wrong_object() -> None:
    assert Pilot().act("wipes_tub", replace(SEEN, held="sponge_pack", gripper="closed")) == UserInput(gripper="open")


def test_it_closes_only_around_the_object() -> None:
    positions = itertools.product((0.60, 0.70, 0.80), (0.0, 0.20), (0.85, 0.90))
    closing = [p for p in positions if Pilot().act("wipes_tub", replace(SEEN, position_m=p)).gripper == "close"]
    assert closing == [SEEN.object_m]


def test_a_slower_robot_is_steered_too() -> None:
    setup = trial_setup("teleoperation", [("wipes_tub", "right_bin")], timing=RobotTiming(speed_m_s=0.02))
    engine = opened(setup)
    pilot = Pilot(step_m=0.01)

    def policy(_: object) -> UserInput:
        world = engine.world
        grasp_m = world.object("wipes_tub").grasp_world_m
        release_m = engine.scene.bin("right_bin").release_world_m
        seen = Sight(world.position_world_gripper_m, world.held, world.gripper, grasp_m, release_m)
        return pilot.act("wipes_tub", seen)

    assert [task.outcome for task in tasks_of(drive(engine, policy))] == ["success", "success"]
