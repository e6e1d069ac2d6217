"""Tasks: when they end, what they are said to have come to, and what is restored afterwards."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

import pytest

from app.trial.values import RobotTiming, TickResult, UserInput
from sim.interface import Vector3
from study.records import TaskRow
from tests.support.engine_cases import (
    CLOSE,
    HANDS_OFF,
    OPEN,
    PICKUPS,
    PLACEMENT,
    UP,
    Person,
    Stage,
    StagedRobot,
    drive,
    events_of,
    fly_to,
    opened,
    pick_up,
    practice_setup,
    push,
    rows_of,
    run,
    tasks_of,
    trial_setup,
)

ONE = [("spray_bottle", "left_bin")]
TARGET = "spray_bottle"
DONE = [(1, "pickup", "success", None), (2, "dropoff", "success", None)]


def summary(task: TaskRow) -> tuple[int, str, str, str | None]:
    return task.task, task.kind, task.outcome, task.reason


def lifts(height_m: float) -> Stage:
    """The target is held, that far above its rest."""
    return lambda world: world.hold(TARGET, height_m)


def slips(position_m: Vector3, *, settled: bool = True) -> Stage:
    """The target leaves the hand and is there."""

    def stage(world: StagedRobot) -> None:
        world.hold(None)
        world.put(TARGET, position_m, settled=settled)

    return stage


def idle_until_over(robot: StagedRobot, pickups: list[tuple[str, str]] = ONE) -> list[TickResult]:
    """Nobody drives; things happen as staged."""
    return drive(opened(trial_setup(pickups=pickups), robot), lambda _: HANDS_OFF, at_most=60)


# ---- the whole of a trial -------------------------------------------------------------------------------------------


def test_a_trial_is_six_tasks_pickups_odd_each_with_its_ticks_and_goals() -> None:
    results = drive(opened(trial_setup("balanced")), Person())
    tasks, rows = tasks_of(results), rows_of(results)
    assert [summary(task) for task in tasks] == [
        (number, "pickup" if number % 2 else "dropoff", "success", None) for number in range(1, 7)
    ]
    assert [task.goal for task in tasks] == [name for pickup in PICKUPS for name in pickup]
    assert [task.object for task in tasks] == [name for name, _ in PICKUPS for _ in range(2)]
    assert [task.goals for task in tasks] == [6, 2, 5, 2, 4, 2]
    for task in tasks:
        ticks = [row.tick for row in rows if row.task == task.task]
        assert ticks == list(range(task.first_tick or 0, (task.last_tick or 0) + 1))
        assert {(row.kind, row.goal) for row in rows if row.task == task.task} == {(task.kind, task.goal)}
    assert sum(row.source == "reset" for row in rows) == 2 * RobotTiming().reset_ticks
    assert [result.view.done_tasks for result in results if result.tasks] == [1, 2, 3, 4, 5, 6]
    assert {result.view.tasks for result in results} == {6}


def test_a_delivered_object_is_no_goal_any_more() -> None:
    results = drive(opened(trial_setup()), Person())
    goals = {row.task: set(json.loads(row.goals)) for row in reversed(rows_of(results)) if row.kind == "pickup"}
    assert goals == {1: set(PLACEMENT), 3: set(PLACEMENT) - {PICKUPS[0][0]}, 5: set(PLACEMENT) - set(dict(PICKUPS[:2]))}


def test_a_pickup_ends_with_the_tick_that_lifts_the_object_three_centimetres() -> None:
    heights = (0.0, 0.02, 0.0299, 0.03, 0.1)
    robot = StagedRobot({tick: lifts(height + 1e-9 * (height == 0.03)) for tick, height in enumerate(heights)})
    results = run(opened(trial_setup(), robot), [HANDS_OFF] * 5)
    assert [bool(result.tasks) for result in results] == [False, False, False, True, False]
    assert [result.row.kind for result in results] == ["pickup"] * 4 + ["dropoff"]
    ended = results[3].view.ended
    assert ended is not None and ended.outcome == "success"


def test_a_dropoff_ends_when_the_object_has_come_to_rest() -> None:
    engine = opened(trial_setup(pickups=ONE))
    pick_up(engine)
    fly_to(engine, engine.scene.bin("left_bin").release_world_m)
    results = drive(engine, lambda _: OPEN)
    assert [result.row.source for result in results] == ["gripper"] * len(results)
    assert [bool(result.tasks) for result in results] == [False] * (len(results) - 1) + [True]
    assert {result.view.phase for result in results[1:-1]} <= {"settling", "gripper"}
    assert engine.delivered.keys() == {TARGET}


# ---- failed pickups -------------------------------------------------------------------------------------------------

LYING = (0.77, 0.43, 0.76)


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        (lambda world: world.put(TARGET, LYING, tilt_rad=math.pi / 2), "knocked_over"),
        (lambda world: world.put(TARGET, (0.77, 0.70, 0.10)), "off_table"),
        (lambda world: world.put(TARGET, (1.05, 0.55, 0.85)), "out_of_reach"),
    ],
)
def test_a_lost_object_is_a_failed_pickup_and_its_dropoff_is_not_run(place: Stage, reason: str) -> None:
    robot = StagedRobot({3: place})
    results = idle_until_over(robot)
    pickup, dropoff = tasks_of(results)
    assert summary(pickup) == (1, "pickup", "failure", reason)
    assert (pickup.first_tick, pickup.last_tick) == (0, 3)
    assert summary(dropoff) == (2, "dropoff", "not_run", "pickup_failed")
    assert (dropoff.first_tick, dropoff.last_tick, dropoff.goal) == (None, None, "left_bin")
    assert results[-1].finished and results[-1].view.done_tasks == 2


def test_after_a_failed_pickup_the_next_cycle_goes_on_with_task_three() -> None:
    robot = StagedRobot({0: lambda world: world.put(TARGET, LYING, tilt_rad=math.pi / 2)})
    results = run(opened(trial_setup(), robot), [HANDS_OFF] * 6)
    assert [summary(task)[0] for task in tasks_of(results)] == [1, 2]
    assert results[-1].row.task == 3
    assert [placed.spec.id for placed in robot.scenes[-1].objects] == [name for name in PLACEMENT if name != TARGET]


def test_an_object_knocked_over_by_the_arm_fails_in_a_world_of_its_own_rules_too() -> None:
    """No staging: drive the closed gripper into the bottle."""
    engine = opened(trial_setup(pickups=ONE))
    run(engine, [CLOSE, HANDS_OFF])
    x_m, y_m, z_m = engine.world.object(TARGET).grasp_world_m
    results = fly_to(engine, (x_m - 0.12, y_m, z_m))
    results += drive(engine, lambda _: push((1, 0, 0)), at_most=40)
    assert [summary(task) for task in tasks_of(results)] == [
        (1, "pickup", "failure", "knocked_over"),
        (2, "dropoff", "not_run", "pickup_failed"),
    ]


def test_an_object_that_never_comes_to_rest_is_judged_when_the_wait_is_over() -> None:
    rolling = StagedRobot({0: lambda world: world.put(TARGET, LYING, tilt_rad=math.pi / 2, settled=False)})
    results = idle_until_over(rolling)
    assert tasks_of(results)[0].reason == "knocked_over"
    assert len(results) == RobotTiming().settle_timeout_ticks


def test_an_object_that_was_still_in_between_is_waited_for_anew() -> None:
    rest_m = trial_setup().cycles[0].scene.object(TARGET).rest_pose.position_world_m

    def lean(settled: bool) -> Stage:
        return lambda world: world.put(TARGET, rest_m, tilt_rad=0.1 if settled else 1.0, settled=settled)

    robot = StagedRobot({tick: lean(tick == 8) for tick in range(20)})
    results = idle_until_over(robot)
    assert len(results) == 9 + RobotTiming().settle_timeout_ticks
    assert tasks_of(results)[0].reason == "knocked_over"


def test_an_object_that_trembles_but_stands_is_waited_for() -> None:
    x_m, y_m, z_m = trial_setup().cycles[0].scene.object(TARGET).rest_pose.position_world_m
    robot = StagedRobot({0: lambda world: world.put(TARGET, (x_m, y_m, z_m), settled=False)})
    assert not tasks_of(run(opened(trial_setup(), robot), [HANDS_OFF] * 40))


# ---- failed dropoffs ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("target_m", "outcome", "reason"),
    [
        ((0.52, 0.48, 0.90), "success", None),
        ((0.52, -0.48, 0.90), "failure", "wrong_bin"),
        ((0.80, 0.30, 0.92), "failure", "left_on_table"),
        ((0.66, 0.20, 0.90), "failure", "outside_bin"),
        ((0.66, 0.30, 0.90), "success", None),  # beside the bin by less than 10 cm
    ],
)
def test_a_drop_is_judged_by_where_it_lands(target_m: Vector3, outcome: str, reason: str | None) -> None:
    engine = opened(trial_setup(pickups=ONE))
    pick_up(engine)
    fly_to(engine, target_m)
    results = drive(engine, lambda _: OPEN)
    assert [summary(task) for task in tasks_of(results)] == [(2, "dropoff", outcome, reason)]


def test_an_object_that_slips_while_it_is_carried_ends_the_dropoff_where_it_landed() -> None:
    robot = StagedRobot(
        {
            0: lambda world: world.hold(TARGET, 0.05),
            3: slips((0.70, 0.2, 0.5), settled=False),
            5: lambda world: world.put(TARGET, (0.60, 0.1, 0.05)),
        }
    )
    results = drive(opened(trial_setup(pickups=ONE), robot), lambda _: push(UP), at_most=60)
    assert [summary(task) for task in tasks_of(results)][1] == (2, "dropoff", "failure", "outside_bin")
    assert [event.kind for event in events_of(results)] == ["grasped", "slipped"]
    # ControlsState that are still on the stick move nothing while the object falls.
    assert [result.row.source for result in results] == ["user"] * 4 + ["gripper"] * 2


def test_an_object_caught_again_before_it_lies_still_is_still_being_carried() -> None:
    robot = StagedRobot(
        {
            0: lambda world: world.hold(TARGET, 0.05),
            1: lambda world: world.hold(None),
            2: lambda world: world.hold(TARGET, 0.05),
        }
    )
    robot_moves = drive(opened(trial_setup(), robot), lambda _: push(UP), lambda result: result.row.tick == 6)
    assert [task.kind for task in tasks_of(robot_moves)] == ["pickup"]
    assert [result.row.source for result in robot_moves] == ["user"] * 2 + ["gripper"] + ["user"] * 4


@pytest.mark.parametrize("timeout_ticks", [3, 12])
def test_an_object_that_never_settles_is_judged_as_it_lies(timeout_ticks: int) -> None:
    robot = StagedRobot(
        {
            0: lambda world: world.hold(TARGET, 0.05),
            1: slips((0.52, 0.48, 0.1), settled=False),
        }
    )
    timing = RobotTiming(settle_timeout_ticks=timeout_ticks)
    results = drive(opened(trial_setup(pickups=ONE, timing=timing), robot), lambda _: HANDS_OFF, at_most=60)
    assert summary(tasks_of(results)[1]) == (2, "dropoff", "success", None)
    assert len(results) == 1 + timeout_ticks


def test_a_dropoff_is_not_judged_before_the_fingers_are_open() -> None:
    """An object may already lie still when the tick of the press ends."""
    released = StagedRobot(
        {
            0: lambda world: world.hold(TARGET, 0.05),
            2: slips((0.52, 0.48, 0.1)),
        }
    )
    timing = RobotTiming(gripper_ticks=4)
    engine = opened(trial_setup(pickups=ONE, timing=timing), released)
    results = run(engine, [CLOSE, HANDS_OFF, HANDS_OFF, HANDS_OFF])
    assert [result.row.held for result in results] == [TARGET, TARGET, None, None]
    assert [[task.kind for task in result.tasks] for result in results] == [["pickup"], [], [], ["dropoff"]]


# ---- the wrong object -----------------------------------------------------------------------------------------------


def test_the_wrong_object_is_an_event_and_the_task_goes_on() -> None:
    engine = opened(trial_setup())
    wrong = "bleach_bottle"
    drive(engine, Person(wrong), lambda result: result.row.held == wrong)
    lifted = run(engine, [push(UP)] * 5)
    assert not tasks_of(lifted)
    row = lifted[-1].row
    assert (row.task, row.kind, row.goal, row.held) == (1, "pickup", TARGET, wrong)
    assert set(json.loads(row.goals)) == {"left_bin", "right_bin"}
    fly_to(engine, (0.66, 0.20, 0.95))
    dropped = run(engine, [OPEN, *[HANDS_OFF] * 6])
    assert not tasks_of(dropped)
    assert set(json.loads(dropped[-1].row.goals)) == set(PLACEMENT)
    rest = drive(engine, Person(), lambda result: len(result.tasks) == 1 and result.tasks[0].kind == "dropoff")
    assert [summary(task) for task in tasks_of(rest)] == [
        (1, "pickup", "success", None),
        (2, "dropoff", "success", None),
    ]


def test_events_say_what_was_grasped_and_what_was_asked_for() -> None:
    robot = StagedRobot({0: lambda world: world.hold("sponge_pack"), 2: lambda world: world.hold(None)})
    results = run(opened(trial_setup(), robot), [HANDS_OFF] * 4)
    assert [[(event.kind, dict(event.data)) for event in result.events] for result in results] == [
        [("wrong_object_grasped", {"object": "sponge_pack", "instructed": TARGET})],
        [],
        [("slipped", {"object": "sponge_pack"})],
        [],
    ]


@pytest.mark.parametrize("held", [TARGET, "sponge_pack"])
def test_what_leaves_opened_fingers_was_released_and_what_leaves_closed_ones_slipped(held: str) -> None:
    def told(robot: StagedRobot, presses: Sequence[UserInput]) -> list[str]:
        results = run(opened(trial_setup(), robot), presses)
        return [event.kind for event in events_of(results) if event.kind in ("released", "slipped")]

    slipping = StagedRobot({0: lambda world: world.hold(held), 3: lambda world: world.hold(None)})
    assert told(slipping, [HANDS_OFF, CLOSE, *[HANDS_OFF] * 3]) == ["slipped"]
    # The press that closes comes first: fingers that are open already take no other.
    released = StagedRobot({0: lambda world: world.hold(held), 6: lambda world: world.hold(None)})
    assert told(released, [CLOSE, *[HANDS_OFF] * 3, OPEN, *[HANDS_OFF] * 3]) == ["released"]


def test_everything_displaced_is_restored_at_the_next_reset() -> None:
    engine = opened(trial_setup())
    wrong = "bleach_bottle"
    drive(engine, Person(wrong), lambda result: result.row.held == wrong)
    fly_to(engine, (0.66, 0.20, 0.95))
    run(engine, [OPEN, *[HANDS_OFF] * 6])
    displaced = engine.world.object(wrong).pose
    assert displaced != engine.scene.object(wrong).rest_pose
    drive(engine, Person(), lambda result: result.cycle_start is not None)
    standing = {item.id: item.pose for item in engine.world.objects}
    assert standing == {placed.spec.id: placed.rest_pose for placed in engine.scene.objects}
    assert wrong in standing and TARGET not in standing


def test_an_object_left_on_the_table_is_taken_away_and_one_in_a_bin_stays_in_sight() -> None:
    engine = opened(trial_setup())
    pick_up(engine)
    fly_to(engine, (0.80, 0.30, 0.92))
    drive(engine, lambda _: OPEN, lambda result: bool(result.tasks))
    assert engine.delivered == {}
    second = drive(engine, Person(), lambda result: result.cycle_start is not None)[-1].cycle_start
    assert second is not None and [name for name, _ in second.delivered] == [PICKUPS[1][0]]
    (pose,) = engine.delivered.values()
    assert engine.scene.bin(PICKUPS[1][1]).distance_m(*pose.position_world_m[:2]) == 0.0


# ---- practice -------------------------------------------------------------------------------------------------------


def test_practice_is_done_when_the_object_was_grasped_moved_and_dropped() -> None:
    engine = opened(practice_setup())
    results = drive(engine, Person())
    assert [summary(task) for task in tasks_of(results)] == [
        (1, "pickup", "success", None),
        (2, "dropoff", "success", None),
    ]
    before, after = engine.scene.object("practice_block").rest_pose, engine.world.object("practice_block").pose
    assert math.dist(before.position_world_m[:2], after.position_world_m[:2]) >= 0.10
    assert results[-1].finished and results[-1].view.tasks == 2


def test_practice_without_moving_is_repeated_from_the_start() -> None:
    engine = opened(practice_setup())
    pick_up(engine)
    results = drive(engine, lambda _: OPEN, lambda result: bool(result.tasks))
    assert [summary(task) for task in tasks_of(results)] == [(2, "dropoff", "failure", "not_moved")]
    assert [(event.kind, event.data["reason"]) for event in events_of(results)[-1:]] == [
        ("practice_repeated", "not_moved")
    ]
    assert not engine.finished and results[-1].cycle_start is not None
    again = drive(engine, Person())
    assert [summary(task)[:3] for task in tasks_of(again)] == [(1, "pickup", "success"), (2, "dropoff", "success")]
    assert engine.finished


def test_a_practice_object_that_is_lost_is_put_back() -> None:
    robot = StagedRobot({1: lambda world: world.put("practice_block", (0.8, 0.0, 0.75), tilt_rad=math.pi / 2)})
    results = run(opened(practice_setup(), robot), [HANDS_OFF] * 8)
    assert [summary(task) for task in tasks_of(results)] == [(1, "pickup", "failure", "knocked_over")]
    assert [event.kind for event in events_of(results)] == ["practice_repeated"]
    assert results[-1].row.task == 1
    assert len(robot.scenes) == 2 and robot.scenes[0] == robot.scenes[1]


def test_a_practice_that_does_not_succeed_is_over_after_three_tries() -> None:
    def knocked(robot: StagedRobot) -> None:
        robot.put("practice_block", (0.8, 0.0, 0.75), tilt_rad=math.pi / 2)

    engine = opened(practice_setup(), StagedRobot(dict.fromkeys(range(1, 200), knocked)))
    results = run(engine, [HANDS_OFF] * 60)
    assert engine.finished
    assert [event.kind for event in events_of(results)] == ["practice_repeated"] * 2
