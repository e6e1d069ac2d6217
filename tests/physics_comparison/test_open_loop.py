"""Recorded inputs on two robots: what is apart is told to the micrometre, and where the two part, why."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from app.physics_comparison.choices import why_otherwise
from app.physics_comparison.open_loop import Followed, angle_rad, follow, pooled
from app.physics_comparison.recorded import Recorded, read_export
from app.physics_comparison.rule import rule
from app.replay.recording import CannotReplay
from app.trial.robots import ROBOTS
from sim.interface import SLICE_S, Robot, RobotCommand, SceneSpec, WorldState
from sim.kinematic import KinematicRobot
from study.export.export import ExportError
from study.parts.errors import PartError
from study.records import TickRow
from tests.support.engine_cases import (
    BACK,
    CLOSE,
    FORWARD,
    HANDS_OFF,
    LEFT,
    RIGHT,
    UP,
    opened,
    pick_up,
    push,
    run,
    trial_setup,
)
from tests.support.recordings import recorded_export

SPEED_M_S = 0.04
WAY = (push(LEFT), push(LEFT), push(LEFT), HANDS_OFF, HANDS_OFF, push(UP))


class Trailing(KinematicRobot):
    """Is seen where it was a slice ago."""

    def reset(self, scene: SceneSpec) -> None:
        super().reset(scene)
        self._was = self._position

    def advance(self, slices: int = 1) -> None:
        self._was = self._position
        super().advance(slices)

    def observe(self) -> WorldState:
        return replace(super().observe(), position_world_gripper_m=self._was)


class Stiff(KinematicRobot):
    """Does not go up."""

    def command(self, command: RobotCommand):  # type: ignore[no-untyped-def]
        if any(segment.direction[2] > 0.0 for segment in command.segments):
            verdict = super().command(replace(command, speed_m_s=0.0))
            return replace(verdict, blocked=True, reason="stiff")
        return super().command(command)


@cache
def recorded() -> Recorded:
    setup = trial_setup()
    return Recorded(setup, tuple(result.row for result in run(opened(setup), WAY)))


def beside(other: Callable[[], Robot], what: Recorded | None = None) -> Followed:
    (found,) = follow(what or recorded(), {"plain": KinematicRobot, "other": other})
    return found


def test_a_robot_that_trails_by_a_slice_is_behind_by_a_slices_way_and_not_beside() -> None:
    found = beside(Trailing)
    (paths,) = pooled([found], 0.99)
    assert (found.ticks, found.ended) == (len(WAY), "recording")
    assert len(found.apart_mm) == 15 * len(WAY) and len(found.turned_deg) == len(WAY)
    slice_mm = SPEED_M_S * SLICE_S * 1000.0
    assert paths.behind_mm == pytest.approx(slice_mm, rel=1e-6)
    assert paths.beside_mm == pytest.approx(0.0, abs=1e-6)
    assert paths.apart_mm[100] == pytest.approx(slice_mm, rel=1e-6)
    assert math.isnan(paths.same_share), "nobody moved by itself"


@pytest.mark.parametrize(
    "name", [pytest.param("bullet", marks=pytest.mark.bullet), pytest.param("mujoco", marks=pytest.mark.mujoco)]
)
def test_an_arm_with_physics_keeps_to_the_way_by_the_rule(name: str) -> None:
    try:
        robot = ROBOTS.load(name)
    except PartError as error:
        pytest.skip(str(error))
    (paths,) = pooled([beside(robot)], rule().quantile)
    assert paths.ticks == len(WAY)
    assert 0.0 < paths.apart_mm[100] < rule().apart_mm and paths.turned_deg[2] < rule().turned_deg
    assert abs(paths.behind_mm) > paths.beside_mm, "it is on the way, earlier or later"


def test_the_same_robot_is_nowhere_apart_and_its_arbiter_chooses_the_same() -> None:
    setup = trial_setup("goal_oriented")
    rows = tuple(result.row for result in run(opened(setup), (push(LEFT), *[HANDS_OFF] * 6)))
    found = beside(KinematicRobot, Recorded(setup, rows))
    assert set(found.apart_mm) == {0.0} and max(found.turned_deg) < 1e-12
    assert found.choices == found.same_choices == 6
    assert pooled([found], 0.99)[0].same_share == 1.0


def alone() -> TickRow:
    """A tick in which the arbiter took the best of all actions."""
    setup = trial_setup("goal_oriented")
    return run(opened(setup), (push(LEFT), HANDS_OFF, HANDS_OFF))[-1].row


def test_what_the_arbiter_scored_higher_and_did_not_take_was_not_to_be_done() -> None:
    setup, best = trial_setup("goal_oriented"), alone()
    worse = replace(best, action_x=-1, action_y=-1, action_z=1)
    assert why_otherwise(setup, best, worse) == why_otherwise(setup, worse, best) == "not allowed"
    assert why_otherwise(setup, *[replace(row, source="user") for row in (best, worse)]) == "unknown"
    assert why_otherwise(setup, best, replace(worse, action_x=None)) == "unknown"


def test_where_each_prefers_its_own_the_states_have_tipped_it() -> None:
    setup = trial_setup("goal_oriented")
    here, there = (run(opened(setup), (*[push(side)] * 8, *[HANDS_OFF] * 3))[-1].row for side in (LEFT, RIGHT))
    assert (here.action_x, here.action_y, here.action_z) != (there.action_x, there.action_y, there.action_z)
    assert why_otherwise(setup, here, there) == "tipped"


def test_they_part_where_a_motion_is_refused_on_one() -> None:
    found = beside(Stiff)
    assert (found.ended, found.ticks) == ("refusal", WAY.index(push(UP)))


def test_a_button_or_a_touch_is_the_end_and_every_attempt_is_run_by_itself() -> None:
    setup = trial_setup(pickups=(("spray_bottle", "left_bin"),))
    engine = opened(setup)
    grasped = pick_up(engine)
    before = next(number for number, result in enumerate(grasped) if result.row.gripper_input == "close")
    freed = run(engine, [replace(HANDS_OFF, free=True), *[HANDS_OFF] * 3, push(FORWARD), push(BACK), CLOSE, HANDS_OFF])
    rows = tuple(result.row for result in (*grasped, *freed))
    first, again = follow(Recorded(setup, rows), {"plain": KinematicRobot, "other": Trailing})
    assert (first.attempt, first.ended, first.ticks) == (1, "gripper", before)
    assert (again.attempt, again.ended, again.ticks) == (2, "gripper", 6)
    knocked = opened(setup)
    object_m = knocked.world.object("spray_bottle").grasp_world_m
    aside = [push(LEFT if object_m[1] > 0.0 else (0, -1, 0))] * 12
    rows = tuple(result.row for result in run(knocked, [*aside, *[push(FORWARD)] * 12]))
    assert beside(KinematicRobot, Recorded(setup, rows)).ended in ("contact", "recording")


def test_a_small_angle_keeps_its_digits() -> None:
    half_rad = 0.5e-9
    turned = (math.cos(half_rad), 0.0, math.sin(half_rad), 0.0)
    assert angle_rad((1.0, 0.0, 0.0, 0.0), turned) == pytest.approx(1e-9, rel=1e-6)
    assert angle_rad(turned, tuple(-value for value in turned)) == 0.0  # type: ignore[arg-type]


# ---- recorded by others


def test_what_people_did_is_read_from_an_export(tmp_path: Path) -> None:
    export = read_export(recorded_export("kinematic", tmp_path), 1, trust=False)
    assert (export.people, export.robots) == (1, ()), "the first exports do not name a robot"
    assert export.trials and all(one.rows for one in export.trials)
    trial = export.trials[0]
    attempts = list(trial.attempts())
    assert sum(map(len, attempts)) == len(trial.rows)
    first = replace(trial, rows=attempts[0])
    found = beside(KinematicRobot, first)
    assert found.ticks and max(found.apart_mm) == 0.0


@pytest.mark.parametrize(("place", "says"), [("missing", "no such folder"), (".", "meta.json")])
def test_what_is_no_export_is_said_in_one_line(tmp_path: Path, place: str, says: str) -> None:
    with pytest.raises((CannotReplay, ExportError)) as caught:
        read_export(tmp_path / place, 6, trust=False)
    assert says in str(caught.value) and "\n" not in str(caught.value)
