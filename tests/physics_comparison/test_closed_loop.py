"""The same people on a robot: who they are, and what is kept of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from app.errors import LabError
from app.physics_comparison.closed_loop import (
    BLOCKED,
    CONTROL,
    MEASURES,
    OUTCOMES,
    REFUSED,
    People,
    run_people,
    values_of,
)
from app.physics_comparison.watched import WatchedRobot
from app.replication.studies import Values
from app.simulated.participant import Record, simulate_trials
from app.simulated.study import Plan
from app.trial.robots import make_robot
from sim.interface import SLICES_PER_TICK, steady, still
from sim.kinematic import KinematicRobot
from study.analysis.measures import CONTROL_SOURCES
from tests.support.engine_cases import trial_setup
from tests.support.study_samples import small_study

PEOPLE = People(Plan(small_study().source_text, 3), studies=1, participants=2)


@cache
def driven() -> tuple[Record, list[WatchedRobot]]:
    watched: list[WatchedRobot] = []

    def make() -> WatchedRobot:
        watched.append(WatchedRobot(make_robot("kinematic")))
        return watched[-1]

    return simulate_trials(PEOPLE.case(0), make), watched


def values(record: Record) -> Values:
    return values_of(PEOPLE.case(0), record, driven()[1], "00000")


def test_a_person_is_told_by_every_measure_outcome_and_reason() -> None:
    record, _ = driven()
    found = values(record)
    assert set(found.observations) == {*MEASURES, *OUTCOMES, *BLOCKED}
    assert {one.participant for of in found.observations.values() for one in of} == {"00000"}
    assert len(found.observations["picked", "pickup"]) == 3
    assert found.counts[CONTROL] == sum(row.source in CONTROL_SOURCES for row in record["ticks"])
    blocked = sum(of.value for key in BLOCKED for of in found.observations[key])
    assert blocked <= sum(count for name, count in found.counts.items() if name.startswith(REFUSED))


def test_what_is_lost_from_closed_fingers_was_dropped() -> None:
    record, _ = driven()
    assert {one.value for one in values(record).observations["dropped", "carry"]} == {0.0}
    carried = next(number for number, row in enumerate(record["ticks"]) if row.held)
    lost = [
        replace(row, held=None) if number == carried + 1 and row.gripper == "closed" else row
        for number, row in enumerate(record["ticks"])
    ]
    dropped = values({**record, "ticks": lost}).observations["dropped", "carry"]
    assert sum(one.value for one in dropped) == 1.0


def test_who_gives_up_has_no_values() -> None:
    record, _ = driven()
    found = values({**record, "tasks": record["tasks"][:-1]})
    assert found.counts["gave_up"] == 1
    assert not any(found.observations.values())


def test_what_is_knocked_over_was_pushed_and_what_is_held_was_not() -> None:
    scene = trial_setup().cycles[0].scene
    robot = WatchedRobot(KinematicRobot())
    robot.reset(scene)
    there = scene.objects[0].rest_pose.position_world_m
    here = robot.observe().position_world_gripper_m
    for axis in (0, 1):  # level with it, then sideways into it
        way = [0.0, 0.0, 0.0]
        way[axis] = 1.0 if there[axis] > here[axis] else -1.0
        for _ in range(round(abs(there[axis] - here[axis]) / 0.04)):
            robot.command(steady(way, 0.08))
            robot.advance(SLICES_PER_TICK)
            robot.observe()
    assert robot.worlds[-1].pushed >= 1
    robot.reset(scene)
    robot.command(still("close"))
    robot.advance(SLICES_PER_TICK)
    robot.observe()
    assert (len(robot.worlds), robot.worlds[-1].pushed) == (2, 0)


def test_people_are_kept_and_not_run_again(tmp_path: Path) -> None:
    first = run_people(PEOPLE, ("kinematic",), 1, tmp_path)
    kept = sorted((tmp_path / "kinematic").glob("person-*"))
    assert len(kept) == PEOPLE.number
    made = [path.stat().st_mtime_ns for path in kept]
    assert run_people(PEOPLE, ("kinematic",), 1, tmp_path) == first
    assert [path.stat().st_mtime_ns for path in kept] == made
    other = replace(PEOPLE, plan=replace(PEOPLE.plan, seed=4))
    with pytest.raises(LabError, match="another seed"):
        run_people(other, ("kinematic",), 1, tmp_path)
