"""What people do beyond driving well: trying again, going to the wrong side, lifting high, brushing things."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from app.simulated.driver import MOST_TRIES, Driver
from app.simulated.participant import Case, simulate_trial
from app.simulated.pilot import Sight
from app.simulated.traits import OFF, Population, Traits, draw_traits
from app.simulated.variants import FIRST_PEOPLE, changed_study, preset_changes
from app.trial.setup import study_setup
from app.trial.values import UserInput
from app.trial.world import open_study, parse_text
from sim.interface import TICK_S, run_tick, still
from sim.kinematic import KinematicRobot
from sim.layouts import scene
from tests.simulated.test_traits import command
from tests.support.shipped_world import LAYOUTS
from tests.support.study_samples import OBJECTS

STEP_M = 0.03 * TICK_S
OBJECT, BIN_M = OBJECTS[4], (0.645, 0.53, 0.88)
"""It stands to the right, the bin to the left."""
AS_BEFORE = (978, "7f99197a29bc7cde")
"""Ticks, and the beginning of the SHA-256 over all inputs, as version 0.1 drove."""


@cache
def person(**traits: float) -> Traits:
    """Somebody average, with nothing of all this but those traits."""
    means = {**OFF, "slip": 0.0, **traits}
    return draw_traits(Population(means, spread_scale=0.0), np.random.default_rng(0))


def task(traits: Traits, seed: int = 1) -> tuple[list[Sight], list[UserInput], KinematicRobot]:
    """A pickup and its dropoff in the crescent, up to the first time it is let go."""
    robot = KinematicRobot()
    robot.reset(scene(LAYOUTS["crescent"], OBJECTS))
    driver = Driver(traits, np.random.default_rng(seed), STEP_M, LAYOUTS["crescent"].aisle_x_m)
    sights: list[Sight] = []
    inputs: list[UserInput] = []
    had = False
    for _ in range(900):
        world = robot.observe()
        if had and world.held is None:
            break
        had = had or world.held == OBJECT
        position_m, object_m = world.position_world_gripper_m, world.object(OBJECT).grasp_world_m
        sights.append(Sight(position_m, world.held, world.gripper, object_m, BIN_M))
        inputs.append(driver.act(OBJECT, sights[-1]))
        run_tick(robot, command(inputs[-1]) if inputs[-1] != UserInput() else still())
    return sights, inputs, robot


def test_who_has_none_of_these_habits_drives_as_in_version_0_1() -> None:
    """The inputs of a whole trial under teleoperation, as they were before there was any of these traits."""
    study = changed_study(open_study(None), preset_changes("fitted"))
    text = study.source_text.replace('alpha = "calibrated"', "alpha = 1.0")
    case = Case(
        study_setup(parse_text(text, "the study")),
        0,
        11,
        ("teleoperation", "goal_oriented", "balanced"),
        Population({**OFF, **FIRST_PEOPLE}),
    )
    rows = simulate_trial(case, 1, KinematicRobot)["ticks"]
    pressed = repr([(row.user_x, row.user_y, row.user_z, row.gripper_input) for row in rows])
    assert (len(rows), hashlib.sha256(pressed.encode()).hexdigest()[:16]) == AS_BEFORE


def test_who_does_not_like_what_is_seen_backs_out_and_comes_again() -> None:

    def arrivals(second_try: float) -> int:
        sights, _, _ = task(replace(person(), second_try=second_try))
        near = [sight.held is None and abs(sight.position_m[0] - sight.object_m[0]) < 0.04 for sight in sights]
        return sum(now and not before for before, now in pairwise([False, *near]))

    assert (arrivals(0.0), arrivals(1.0)) == (1, 1 + MOST_TRIES)


def test_who_is_mixed_up_goes_to_the_other_side_first_and_still_gets_it() -> None:
    sights, _, _ = task(person(mix_up=1.0))
    ways_m = [sight.position_m[1] for sight in sights if sight.held is None]
    assert sights[0].object_m[1] < 0.0 < max(ways_m) - 0.05
    assert any(sight.held == OBJECT for sight in sights)


@pytest.mark.parametrize("lift_m", [0.0, 0.05])
def test_things_are_lifted_as_high_as_the_habit_has_it(lift_m: float) -> None:
    sights, _, _ = task(person(lift_m=lift_m))
    highest_m = max(sight.position_m[2] for sight in sights if sight.held == OBJECT)
    least_m = max(BIN_M[2], sights[0].object_m[2] + 0.06 + lift_m)
    assert least_m - 0.015 <= highest_m <= least_m + 2.0 * STEP_M


def test_a_wrong_button_lets_a_carried_object_fall() -> None:
    """Of many, some let go before they are at the bin; nobody does whose fingers never err."""

    def dropped(wrong_button: float) -> int:
        ends = [task(person(wrong_button=wrong_button), seed)[0][-1].position_m for seed in range(6)]
        return sum(abs(y_m - BIN_M[1]) > 0.15 for _, y_m, _ in ends)

    assert dropped(0.1) > 0 == dropped(0.0)


def test_who_is_firm_holds_on_where_the_arm_undoes_every_tap() -> None:
    """Two centimetres beside the object, with an arm that goes back by itself whenever the hands are off."""

    def presses(firmness: float) -> int:
        driver = Driver(person(firmness=firmness, look=0.0, fine_pause=3.0), np.random.default_rng(1), STEP_M)
        y_m, longest, held = 0.03, 0, 0
        for _ in range(40):
            act = driver.act(OBJECT, Sight((0.80, y_m, 0.85), None, "open", (0.88, 0.0, 0.85), BIN_M))
            held = held + 1 if act.direction is not None and act.direction[1] else 0
            longest = max(longest, held)
            y_m += 0.002 if act.direction is None else 0.002 * act.direction[1]
        return longest

    assert presses(0.0) == 1 < presses(1.0)
