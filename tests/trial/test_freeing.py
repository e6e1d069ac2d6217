"""Freeing the arm: the cycle begins again, whatever has become of it; nothing of the record is lost or doubled."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.autonomy.actions import DIRECTIONS
from app.trial.engine import TrialEngine
from app.trial.values import (
    CycleStart,
    TaskSpan,
    TickResult,
    TimeLimits,
    TrialSetup,
    UserInput,
    cycle_from_json,
    cycle_to_json,
    inputs_of,
)
from sim.interface import MotionVerdict, RobotCommand, SceneSpec
from sim.kinematic import KinematicRobot
from study.records import TaskRow, TickRow
from tests.support.engine_cases import (
    FORWARD,
    HANDS_OFF,
    PICKUPS,
    Person,
    StagedRobot,
    drive,
    events_of,
    opened,
    pick_up,
    practice_setup,
    push,
    rows_of,
    run,
    tasks_of,
    trial_setup,
)

FREE = UserInput(free=True)
ONE = PICKUPS[:1]
SUCCESS = [("pickup", "success"), ("dropoff", "success")]


def last_rows(results: list[TickResult]) -> list[TaskRow]:
    """What stands in the record: a task's row takes the place of an earlier one."""
    return list({task.task: task for task in tasks_of(results)}.values())


def ended(tasks: list[TaskRow]) -> list[tuple[str, str]]:
    return [(task.kind, task.outcome) for task in tasks]


def test_the_cycle_begins_again_with_the_tick_that_frees_the_arm() -> None:
    engine = opened(trial_setup("balanced"))
    start = engine.world
    before = run(engine, [push(FORWARD)] * 5)
    freed, *after = run(engine, [FREE, *[HANDS_OFF] * 4])
    assert [row.attempt for row in rows_of([*before, freed, *after])] == [1] * 5 + [2] * 5
    assert [row.source for row in rows_of([freed, *after])] == ["free", "reset", "reset", "reset", "robot"]
    row = freed.row
    assert (row.p_x, row.p_y, row.p_z) == start.position_world_gripper_m
    assert (row.task, row.kind, row.goal, row.user_x, row.action_x) == (None,) * 5
    (event,) = events_of([freed])
    assert event.kind == "arm_freed"
    assert dict(event.data) == {"phase": "trial", "cycle": 1, "attempt": 2}
    assert freed.cycle_start == CycleStart(1, 5, attempt=2, pickup=TaskSpan(0, 4, 5))
    assert freed.view.phase == "reset"
    assert after[-2].view.phase == "operating"


def test_hands_that_push_while_the_arm_is_freed_count_only_afterwards() -> None:
    engine = opened(trial_setup())
    run(engine, [push(FORWARD)])
    results = run(engine, [UserInput(FORWARD, "close", free=True), *[push(FORWARD)] * 4])
    assert [row.user_x for row in rows_of(results)] == [None] * 4 + [1]
    assert [row.gripper_input for row in rows_of(results)] == [None] * 5


def test_an_arm_that_goes_back_already_is_not_freed_once_more() -> None:
    engine = opened(trial_setup())
    run(engine, [push(FORWARD)])
    results = run(engine, [FREE] * 4)
    assert [row.source for row in rows_of(results)] == ["free", "reset", "reset", "reset"]
    assert {row.attempt for row in rows_of(results)} == {2}
    assert len(events_of(results)) == 1
    drive(engine, Person(), lambda result: result.cycle_start is not None)
    results = run(engine, [FREE] * 4)
    assert [(row.source, row.cycle, row.attempt) for row in rows_of(results)] == [("reset", 2, 1)] * 4


def test_a_dropoff_that_is_freed_begins_with_the_pickup_and_each_task_keeps_one_row() -> None:
    engine = opened(trial_setup(pickups=ONE))
    first = [*pick_up(engine), *run(engine, [push((0, 0, 1))] * 3)]
    assert ended(tasks_of(first)) == SUCCESS[:1]
    assert engine.world.held == ONE[0][0]
    freed = run(engine, [FREE])
    assert not engine.world.held
    results = [*first, *freed, *drive(engine, Person())]
    rows, tasks = rows_of(results), last_rows(results)
    assert ended(tasks) == SUCCESS
    for task in tasks:
        ticks = [row.tick for row in rows if row.task == task.task]
        assert (task.first_tick, task.last_tick, task.attempts) == (ticks[0], ticks[-1], 2)
        assert {row.attempt for row in rows if row.task == task.task} == {1, 2}
    released = [event for event in events_of(results[len(first) :]) if event.kind == "released"]
    assert len(released) == 1  # the fingers opened once, over the bin


def test_what_was_delivered_before_stays() -> None:
    engine = opened(trial_setup())
    drive(engine, Person(), lambda result: result.cycle_start is not None)
    delivered = dict(engine.delivered)
    run(engine, [HANDS_OFF] * 5)
    (freed,) = run(engine, [FREE])
    assert dict(engine.delivered) == delivered == dict(freed.cycle_start.delivered if freed.cycle_start else ())
    assert (engine.place, freed.row.attempt) == ((2, 2), 2)


def test_the_next_cycle_counts_its_attempts_anew() -> None:
    engine = opened(trial_setup())
    run(engine, [push(FORWARD), FREE])
    drive(engine, Person(), lambda result: result.cycle_start is not None)
    assert engine.place == (2, 1)
    rows = rows_of(drive(engine, Person()))
    assert {row.attempt for row in rows} == {1}


def test_practice_can_be_freed_too() -> None:
    engine = opened(practice_setup())
    before = run(engine, [push(FORWARD)] * 2)
    results = [*before, *run(engine, [FREE]), *drive(engine, Person(), at_most=200)]
    assert engine.finished
    assert [row.attempt for row in rows_of(results)] == [1] * 2 + [2] * (len(results) - 2)


class Broken(StagedRobot):
    """A robot whose physics raises from its third tick in a world on."""

    ticks = 0

    def reset(self, scene: SceneSpec) -> None:
        self.ticks = 0
        super().reset(scene)

    def command(self, command: RobotCommand) -> MotionVerdict:
        self.ticks += 1
        if self.ticks > 2:
            raise RuntimeError("the world has no numbers any more")
        return super().command(command)


def test_the_way_out_does_not_look_at_the_world_it_leads_out_of() -> None:
    setup, robot = trial_setup(), Broken()
    engine = opened(setup, robot)
    logged = run(engine, [push(FORWARD)] * 2)
    with pytest.raises(RuntimeError, match="no numbers"):
        engine.tick(push(FORWARD))
    again = TrialEngine(setup, Broken())  # as a worker does that takes over
    again.open()
    assert run(again, [inputs_of(result.row) for result in logged]) == logged
    assert again.tick(FREE).row.source == "free"


def test_another_attempt_survives_the_store_and_an_older_record_is_a_first_one() -> None:
    odd = CycleStart(
        2, 77, attempt=4, pickup=TaskSpan(3, 70, 41), dropoff=TaskSpan(50, 66, 12), counted_from=2, arbiter_memory="[1]"
    )
    assert cycle_from_json(cycle_to_json(odd)) == odd
    assert cycle_from_json('{"cycle": 2, "first_tick": 9, "delivered": []}') == CycleStart(2, 9)
    assert cycle_to_json(CycleStart(2, 9)) == '{"cycle": 2, "first_tick": 9, "delivered": []}'


# ---- any inputs, any limits -----------------------------------------------------------------------------------------


def rerun(setup: TrialSetup, start: CycleStart, rows: list[TickRow]) -> list[TickResult]:
    """Those ticks again, from the rows alone, in a new engine with a new robot."""
    engine = TrialEngine(setup, KinematicRobot(), cycle_from_json(cycle_to_json(start)))
    engine.open()
    return run(engine, [inputs_of(row) for row in rows])


def check_record(setup: TrialSetup, results: list[TickResult]) -> None:
    """What holds for every record, however it came to be."""
    rows, tasks = rows_of(results), last_rows(results)
    assert [row.tick for row in rows] == list(range(len(rows)))
    places = [(row.cycle, row.attempt) for row in rows]
    assert places == sorted(places)
    for before, row in pairwise(rows):
        assert (row.source == "free") == (row.cycle == before.cycle and row.attempt == before.attempt + 1)
        assert (row.attempt == 1) or row.cycle == before.cycle
    for task in tasks:
        ticks = [row.tick for row in rows if row.task == task.task]
        if task.outcome == "not_run":
            assert (task.first_tick, task.last_tick) == (None, None)
        else:
            assert (task.first_tick, task.last_tick) == (ticks[0], ticks[-1])
            assert task.attempts == max(row.attempt for row in rows if row.cycle == (task.task + 1) // 2)
        if setup.limits.task_ticks:
            assert len(ticks) <= setup.limits.task_ticks + setup.timing.settle_timeout_ticks
    if results[-1].finished:
        assert sorted(task.task for task in tasks) == list(range(1, 2 * len(setup.cycles) + 1))


@settings(max_examples=12, deadline=None)
@given(
    condition=st.sampled_from(["teleoperation", "goal_oriented", "balanced"]),
    frees=st.sets(st.integers(0, 220), max_size=6),
    pushes=st.dictionaries(st.integers(0, 220), st.sampled_from(DIRECTIONS), max_size=12),
    limits=st.builds(TimeLimits, st.sampled_from([0, 0, 25, 60]), st.sampled_from([0, 0, 90, 200])),
)
def test_whenever_the_arm_is_freed_the_record_is_whole_and_re_runs_to_the_same(
    condition: str, frees: set[int], pushes: dict[int, tuple[int, int, int]], limits: TimeLimits
) -> None:
    setup = replace(trial_setup(condition), limits=limits)
    engine, person, results = opened(setup), Person(), []
    while not engine.finished and engine.next_tick < 260:
        tick = engine.next_tick
        user_input = push(pushes[tick]) if tick in pushes else person(engine)
        results.append(engine.tick(replace(user_input, free=tick in frees)))
    check_record(setup, results)
    assert rerun(setup, CycleStart(), rows_of(results)) == results
    for start in [result.cycle_start for result in results if result.cycle_start is not None]:
        assert rerun(setup, start, rows_of(results)[start.first_tick :]) == results[start.first_tick :]


def test_an_attempt_begins_alike_whether_or_not_the_one_before_can_be_re_run() -> None:
    """The lab makes the start of another attempt from the rows when the record itself is what is broken."""
    setup = trial_setup()
    engine = opened(setup)
    begin = drive(engine, Person(), lambda result: result.cycle_start is not None)[-1].cycle_start
    assert begin is not None
    before = [*pick_up(engine), *run(engine, [HANDS_OFF] * 3)]
    results = run(engine, [FREE, *[HANDS_OFF] * 4, push(FORWARD)])
    other = TrialEngine(setup, KinematicRobot(), begin.after(rows_of(before)))
    other.open()
    assert run(other, [HANDS_OFF] * 5 + [push(FORWARD)]) == results


# ---- time limits ----------------------------------------------------------------------------------------------------


def limited(task_ticks: int = 0, trial_ticks: int = 0) -> TrialSetup:
    return replace(trial_setup(pickups=PICKUPS[:2]), limits=TimeLimits(task_ticks, trial_ticks))


def reasons(tasks: list[TaskRow]) -> list[tuple[int, str, str | None]]:
    return [(task.task, task.outcome, task.reason) for task in tasks]


def test_a_pickup_whose_time_is_over_fails_and_no_dropoff_follows() -> None:
    engine = opened(limited(task_ticks=20))
    results = run(engine, [HANDS_OFF] * 20)
    assert [bool(result.tasks) for result in results] == [False] * 19 + [True]
    assert reasons(list(results[-1].tasks)) == [
        (1, "failure", "time_limit"),
        (2, "not_run", "pickup_failed"),
    ]
    assert (engine.place, results[-1].view.phase) == ((2, 1), "reset")
    assert results[-1].view.ended is not None and results[-1].view.ended.reason == "time_limit"


def test_a_dropoff_whose_time_is_over_fails_and_its_object_is_gone_with_it() -> None:
    setup = limited(task_ticks=60)
    engine = opened(setup)
    results = [*pick_up(engine), *drive(engine, lambda _: HANDS_OFF, lambda result: bool(result.tasks))]
    assert reasons(tasks_of(results)) == [(1, "success", None), (2, "failure", "time_limit")]
    assert tasks_of(results)[1].last_tick == (tasks_of(results)[1].first_tick or 0) + 59
    assert not engine.delivered
    assert PICKUPS[0][0] not in {item.id for item in engine.world.objects}
    assert "released" not in {event.kind for event in events_of(run(engine, [HANDS_OFF] * 6))}


def test_freeing_the_arm_gives_no_time_back() -> None:
    engine = opened(limited(task_ticks=20))
    results = run(engine, [*[HANDS_OFF] * 15, FREE, *[HANDS_OFF] * 8])
    assert [result.row.tick for result in results if result.tasks] == [23]
    (task, _) = results[-1].tasks
    assert (task.first_tick, task.last_tick, task.attempts) == (0, 23, 2)


def test_when_the_trials_time_is_over_the_rest_is_not_run() -> None:
    engine = opened(limited(trial_ticks=20))
    results = run(engine, [HANDS_OFF] * 30)
    assert (len(results), engine.finished) == (20, True)
    assert reasons(tasks_of(results)) == [
        (1, "failure", "time_limit"),
        *[(number, "not_run", "time_limit") for number in (2, 3, 4)],
    ]
    assert [task.goals for task in tasks_of(results)] == [6, 2, 5, 2]
    assert results[-1].cycle_start is None


def test_a_trial_whose_time_ends_between_two_tasks_fails_none() -> None:
    lifted = len(pick_up(opened(limited())))
    engine = opened(limited(trial_ticks=lifted))
    assert reasons(tasks_of(pick_up(engine))) == [
        (1, "success", None),
        *[(number, "not_run", "time_limit") for number in (2, 3, 4)],
    ]
    assert engine.finished


def test_a_trial_whose_time_ends_while_the_freed_arm_goes_back_counts_what_was_begun() -> None:
    engine = opened(limited(trial_ticks=17))
    results = run(engine, [*[HANDS_OFF] * 15, FREE, HANDS_OFF])
    assert engine.finished
    assert reasons(tasks_of(results))[:2] == [(1, "failure", "time_limit"), (2, "not_run", "time_limit")]
    task = tasks_of(results)[0]
    assert (task.first_tick, task.last_tick, task.goals, task.attempts) == (0, 14, 6, 2)


def test_what_falls_when_the_time_is_over_may_come_to_rest() -> None:
    whole = opened(limited())
    results = drive(whole, Person(), lambda result: any(task.kind == "dropoff" for task in result.tasks))
    let_go = next(result.row.tick for result in results if result.row.gripper_input == "open")
    engine = opened(limited(trial_ticks=let_go + 2))
    again = run(engine, [inputs_of(result.row) for result in results])
    assert ended(tasks_of(again))[:2] == SUCCESS
    assert engine.finished


def test_a_task_that_is_done_in_its_last_tick_is_done() -> None:
    lifted = len(pick_up(opened(limited())))
    results = pick_up(opened(limited(task_ticks=lifted)))
    assert reasons(tasks_of(results)) == [(1, "success", None)]


def test_practice_goes_on_when_its_time_is_over() -> None:
    setup = replace(practice_setup(), limits=TimeLimits(trial_ticks=12))
    engine = TrialEngine(setup, KinematicRobot(), CycleStart(3, 100, counted_from=100))
    engine.open()
    results = run(engine, [HANDS_OFF] * 20)
    assert (len(results), engine.finished) == (12, True)
    assert [event.kind for event in events_of(results)] == ["practice_time_limit"]


def test_a_limit_that_is_near_is_told_the_nearer_one_first() -> None:
    engine = opened(limited(task_ticks=40, trial_ticks=48))
    told = Counter(result.view.ending for result in run(engine, [HANDS_OFF] * 40))
    assert told == {None: 29, "task": 10, "trial": 1}
    assert not [result for result in run(opened(limited()), [HANDS_OFF] * 40) if result.view.ending]
