"""What a person is told whose arm does not move: what to do, for the situation it is in."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import pytest

from app.trial.hints import LONG_TICKS, Hint, hint_for
from app.trial.values import UserInput
from sim.ik import REASONS
from sim.interface import Vector3, WorldState
from sim.kinematic import KinematicRobot
from tests.support.engine_cases import CLOSE, HANDS_OFF, Person, StagedRobot, opened, push, trial_setup

OPEN_WORLD = opened(trial_setup()).world


def world(*, lagging: bool = True, gripper: str = "open", held: str | None = None) -> WorldState:
    return replace(OPEN_WORLD, lagging=lagging, gripper=gripper, held=held)  # type: ignore[arg-type]


def hint(
    asked: Vector3, here: WorldState, shut: Collection[Vector3] = (), reason: str | None = None, ticks: int = 0
) -> Hint:
    return hint_for(asked, reason, here, lambda way: way not in shut, ticks)


UP, DOWN, FORWARD, BACK = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("asked", "way"),
    [
        (DOWN, "up"),
        (FORWARD, "back"),
        ((0.0, 1.0, 0.0), "right"),
        ((0.0, -1.0, 0.0), "left"),
        (UP, "down"),
        (BACK, "forward"),
        ((0.7, 0.0, -0.7), "up"),
        ((0.7, 0.7, 0.0), "back"),
    ],
)
def test_what_is_pressed_is_told_the_way_back(asked: Vector3, way: str) -> None:
    assert hint(asked, world()) == Hint("touches", (way,))  # type: ignore[arg-type]


def test_a_way_that_is_shut_is_not_told() -> None:
    assert hint((0.7, 0.0, -0.7), world(), shut=[UP]).ways == ("back",)
    assert hint(FORWARD, world(), shut=[BACK]).ways == ("up",)
    assert hint(FORWARD, world(), shut=[BACK, UP]).ways == ("left",)


def test_a_fist_is_told_to_open_once_it_is_away() -> None:
    assert hint(FORWARD, world(gripper="closed")) == Hint("touches_closed", ("back", "open"))


def test_what_is_held_is_let_go_only_when_nothing_else_helps() -> None:
    held = world(gripper="closed", held="wipes_tub")
    assert hint(DOWN, held) == Hint("touches_holding", ("up",))
    assert hint(DOWN, held, ticks=LONG_TICKS) == Hint("touches_holding", ("up", "open"))
    shut = [(x, y, z) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) for z in (-1.0, 0.0, 1.0)]
    assert hint(DOWN, held, shut=shut) == Hint("touches_holding", ("open",))


@pytest.mark.parametrize(
    ("asked", "reason", "told"),
    [
        (DOWN, REASONS[1], Hint("low", ("up",))),
        (UP, REASONS[1], Hint("high", ("down",))),
        (FORWARD, REASONS[2], Hint("limit", ("back",))),
        (BACK, REASONS[3], Hint("near", ("forward",))),
        ((0.0, 1.0, 0.0), REASONS[4], Hint("limit", ("right",))),
        (FORWARD, "a ceiling of a robot from elsewhere", Hint("limit", ("back",))),
    ],
)
def test_the_ends_of_the_reach_are_told_apart(asked: Vector3, reason: str, told: Hint) -> None:
    def can_go(way: Vector3) -> bool:
        return sum(a * b for a, b in zip(way, asked, strict=True)) <= 0.0

    assert hint_for(asked, reason, world(lagging=False), can_go, 0) == told


def test_where_there_is_a_way_around_the_end_of_the_reach_it_is_told() -> None:
    """Before the robot is a hole: whoever goes across it goes out first, not back to where they came from."""
    engine, across = opened(trial_setup(), KinematicRobot()), push((0, -1, 0))
    for given in (*[push((0, 1, 0))] * 9, *[push((-1, 0, 0))] * 8):
        engine.tick(given)
    view = engine.tick(across).view
    while not view.blocked:
        view = engine.tick(across).view
    assert view.hint == Hint("limit", ("forward",))
    for _ in range(8):
        engine.tick(push((1, 0, 0)))
    assert not any(engine.tick(across).view.blocked for _ in range(4))


def test_an_engine_tells_a_hint_with_every_blocked_tick_and_with_no_other() -> None:
    engine = opened(trial_setup(), KinematicRobot())
    told = [engine.tick(push((0, 0, -1))).view for _ in range(8)]
    assert told[-1].hint == Hint("low", ("up",))
    assert all((view.hint is None) == (not view.blocked) for view in told)
    assert engine.tick(push((0, 0, 1))).view.hint is None


def test_the_hint_is_the_same_in_every_condition() -> None:
    """It must not tell who decides."""
    told = []
    for condition in ("teleoperation", "goal_oriented", "balanced"):
        engine = opened(trial_setup(condition), KinematicRobot())
        told.append([engine.tick(push((1, 0, -1))).view.hint for _ in range(24)])
    assert told[0] == told[1] == told[2]
    assert any(told[0])


def test_pressed_for_long_with_an_object_it_is_told_to_open() -> None:
    robot = StagedRobot({0: lambda staged: staged.hold("spray_bottle", 0.01)})
    engine = opened(trial_setup(), robot)
    engine.tick(CLOSE)
    engine.tick(HANDS_OFF)
    robot.gripper, robot.lagging = "closed", True
    told = [engine.tick(UserInput((0, 0, -1))).view.hint for _ in range(LONG_TICKS + 1)]
    assert told[0] == Hint("touches_holding", ("up",))
    assert told[-1] == Hint("touches_holding", ("up", "open"))


def test_what_is_carried_onto_the_table_is_told_to_go_up() -> None:
    engine, person = opened(trial_setup(), KinematicRobot()), Person()
    while engine.world.held is None:
        engine.tick(person(engine))
    told = [engine.tick(push((0, 0, -1))).view.hint for _ in range(3)]
    assert told[-1] is not None
    assert told[-1].ways[0] == "up"
