"""What an arm remembers of having been pressed against something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.autonomy.actions import DIRECTIONS, UNIT_DIRECTIONS
from sim import fetch
from sim.bullet import BulletRobot
from sim.interface import run_tick, steady
from sim.layouts import scene
from sim.touch import NEAR_M, REMEMBERED_SLICES, Touch
from tests.support.shipped_world import LAYOUTS, STUDY_OBJECTS

HERE = (0.8, 0.1, 0.85)
WAYS_M = 0.02 * UNIT_DIRECTIONS


def test_what_leads_where_it_was_pressed_is_known_and_nothing_else() -> None:
    touch = Touch()
    assert not touch.leads_into(HERE, WAYS_M, 0).any()
    touch.feel(HERE, (0.8, 0.1, 0.838), 7)
    assert touch.leads_into(HERE, WAYS_M, 8).tolist() == [z < 0 for _, _, z in DIRECTIONS]


def test_two_contacts_count_both() -> None:
    touch = Touch()
    touch.feel(HERE, (0.8, 0.1, 0.838), 7)
    touch.feel(HERE, (0.812, 0.1, 0.85), 9)
    assert touch.leads_into(HERE, WAYS_M, 10).tolist() == [z < 0 or x > 0 for x, _, z in DIRECTIONS]


def test_a_contact_is_forgotten_elsewhere_and_after_a_while() -> None:
    touch = Touch()
    touch.feel(HERE, (0.8, 0.1, 0.838), 7)
    away = (HERE[0], HERE[1] + NEAR_M + 0.001, HERE[2])
    assert not touch.leads_into(away, WAYS_M, 8).any()
    assert touch.leads_into(HERE, WAYS_M, 6 + REMEMBERED_SLICES).any()
    assert not touch.leads_into(HERE, WAYS_M, 7 + REMEMBERED_SLICES).any()


@pytest.mark.bullet
def test_a_robot_that_was_pressed_does_not_call_it_feasible_until_it_begins_anew() -> None:
    (x_m, y_m), finger_m = LAYOUTS["arc"].places[2], fetch.MAX_OPENING_M / 2.0 + fetch.FINGER_SIZE_M[1] / 2.0
    over_m = (x_m, y_m - finger_m, 1.0)
    world = replace(scene(LAYOUTS["arc"], tuple(STUDY_OBJECTS)), start_world_m=over_m)  # a finger is over an object
    robot = BulletRobot()
    robot.reset(world)
    assert any(run_tick(robot, steady((0.0, 0.0, -1.0), 0.04))[1].lagging for _ in range(20)), "nothing stopped it"
    down, up = np.array([[0.0, 0.0, -0.02]]), np.array([[0.0, 0.0, 0.02]])
    assert not robot.feasible(down)[0]
    assert robot.feasible(up)[0]
    robot.reset(world)
    assert robot.feasible(down)[0]
    robot.close()
