"""What a tick's row says: who moved, from where, on what input, and what was believed."""

from __future__ import annotations

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from app.autonomy.actions import Direction
from app.trial.engine import TrialEngine
from app.trial.values import CycleStart, RobotTiming, UserInput
from app.trial.verdicts import release_points
from sim.interface import MotionSegment, MotionVerdict, RobotCommand
from study.records import TickRow
from tests.support.arbiter_cases import CONDITIONS, ArbiterCase, Condition
from tests.support.engine_cases import (
    BACK,
    CLOSE,
    FORWARD,
    HANDS_OFF,
    LEFT,
    OPEN,
    PLACEMENT,
    RIGHT,
    UP,
    Person,
    StagedRobot,
    drive,
    events_of,
    go_to,
    opened,
    parameters,
    pick_up,
    practice_setup,
    push,
    rows_of,
    run,
    tasks_of,
    trial_setup,
)
from tests.support.literal_reference import RAW_ACTIONS, LiteralState, evaluate_literal, likelihoods, posterior_after
from tests.support.literal_reference import entropy as literal_entropy

SEQUENCE = [push(FORWARD), push((1, 1, 0)), HANDS_OFF, push(LEFT), push(UP), push((1, -1, -1)), HANDS_OFF, push(BACK)]


def position(row: TickRow) -> tuple[float, float, float]:
    return row.p_x, row.p_y, row.p_z


def momentum(row: TickRow) -> tuple[float, float, float]:
    return row.m_x, row.m_y, row.m_z


def user(row: TickRow) -> tuple[int | None, int | None, int | None]:
    return row.user_x, row.user_y, row.user_z


def action(row: TickRow) -> tuple[int | None, int | None, int | None]:
    return row.action_x, row.action_y, row.action_z


def whole(direction: tuple[int | None, int | None, int | None]) -> Direction:
    """A direction that is there."""
    x, y, z = direction
    assert x is not None and y is not None and z is not None
    return x, y, z


BLANK = (None, None, None)
STILL = (0.0, 0.0, 0.0)


# ---- where and how it moves -----------------------------------------------------------------------------------------


def test_position_and_momentum_are_those_at_the_start_of_the_tick() -> None:
    engine = opened(trial_setup())
    before = []
    rows = []
    for user_input in SEQUENCE:
        before.append(engine.world.position_world_gripper_m)
        rows.append(engine.tick(user_input).row)
    assert [position(row) for row in rows] == before
    assert position(rows[1]) != position(rows[0])
    half, third = math.sqrt(1 / 2), math.sqrt(1 / 3)
    executed = [STILL, (1, 0, 0), (half, half, 0), STILL, (0, 1, 0), (0, 0, 1), (third, -third, -third), STILL]
    assert [momentum(row) for row in rows] == [pytest.approx(direction) for direction in executed]


def test_the_arm_follows_the_person_and_keeps_the_old_direction_for_the_planning_delay() -> None:
    rows = rows_of(run(opened(trial_setup()), [push(FORWARD), push(LEFT), HANDS_OFF, HANDS_OFF]))
    moved = [[b - a for a, b in zip(position(one), position(two), strict=True)] for one, two in pairwise(rows)]
    # 0.04 m/s for 0.5 s, of which the first 0.1 s go where the arm went before
    assert moved[0] == pytest.approx([0.016, 0.0, 0.0])
    assert moved[1] == pytest.approx([0.004, 0.016, 0.0])
    assert moved[2] == pytest.approx([0.0, 0.004, 0.0])


@pytest.mark.parametrize("condition", CONDITIONS)
def test_with_input_the_person_moves_the_robot_and_without_it_the_condition_decides(condition: str) -> None:
    rows = rows_of(run(opened(trial_setup(condition)), SEQUENCE))
    for row, user_input in zip(rows, SEQUENCE, strict=True):
        if user_input.direction is not None:
            assert (row.source, user(row), action(row)) == ("user", user_input.direction, user_input.direction)
        elif condition == "teleoperation":
            assert (row.source, user(row), action(row)) == ("idle", BLANK, BLANK)
        else:
            assert (row.source, user(row)) == ("robot", BLANK)
            assert all(value in (-1, 0, 1) for value in action(row))


@pytest.mark.parametrize("condition", ["goal_oriented", "balanced"])
def test_an_assisting_robot_does_what_the_row_alone_says_it_should(condition: Condition) -> None:
    rows = rows_of(run(opened(trial_setup(condition)), SEQUENCE))
    for row in (row for row in rows if row.source == "robot"):
        goals = json.loads(row.goals)
        belief = json.loads(row.belief)
        literal = evaluate_literal(
            position(row), momentum(row), list(goals.values()), list(belief.values()), None, parameters(condition)
        )
        x, y, z = whole(action(row))
        assert 9 * (x + 1) + 3 * (y + 1) + z + 1 == literal.chosen
    assert any(row.source == "robot" for row in rows)


def test_an_arbiter_that_chooses_to_stay_is_not_an_idle_robot() -> None:
    """With no way open the best that can be done is to stay: zeros, where an idle robot leaves blanks."""

    class HemmedIn(StagedRobot):
        def feasible(self, displacements_m: NDArray[np.float64]) -> NDArray[np.bool_]:
            still: NDArray[np.bool_] = (displacements_m == 0.0).all(axis=1)
            return still

    row = opened(trial_setup("goal_oriented"), HemmedIn()).tick().row
    assert (row.source, action(row), row.blocked) == ("robot", (0, 0, 0), 0)


def test_the_arm_never_follows_momentum_after_gripper_block_or_pause() -> None:
    pressed = [push(FORWARD), CLOSE, HANDS_OFF, push(LEFT), OPEN, push(LEFT), push(LEFT)]
    rows = rows_of(run(opened(trial_setup()), pressed))
    assert [row.source for row in rows] == ["user", "gripper", "gripper", "user", "gripper", "gripper", "user"]
    assert momentum(rows[1]) == (1, 0, 0)  # what was executed in the tick before it
    assert momentum(rows[2]) == momentum(rows[3]) == momentum(rows[6]) == STILL

    engine = opened(trial_setup())
    engine.tick(push(FORWARD))
    paused = engine.tick(UserInput(FORWARD, after_pause=True)).row
    assert (momentum(paused), paused.after_pause) == (STILL, 1)
    assert engine.tick(push(FORWARD)).row.after_pause == 0


def test_motion_that_is_refused_is_marked_and_leaves_no_momentum() -> None:
    engine = opened(trial_setup())
    results = drive(engine, lambda _: push(BACK), lambda result: bool(result.row.blocked), at_most=40)
    blocked = results[-1]
    assert blocked.row.blocked_reason
    assert blocked.view.blocked
    assert (user(blocked.row), action(blocked.row)) == (BACK, BACK)
    after = engine.tick(push(BACK)).row
    assert momentum(after) == STILL
    assert position(after) == engine.world.position_world_gripper_m  # it stands there


def test_momentum_is_what_the_limits_left_of_a_direction() -> None:
    def without_y(command: RobotCommand) -> MotionVerdict:
        kept = tuple(MotionSegment((s.direction[0], 0.0, s.direction[2]), s.slices) for s in command.segments)
        return MotionVerdict(kept, blocked=False, reason="the edge")

    robot = StagedRobot()
    robot.limit = without_y
    first, second = rows_of(run(opened(trial_setup(), robot), [push((1, 1, 0)), HANDS_OFF]))
    assert (first.blocked, first.blocked_reason) == (0, "the edge")
    assert momentum(second) == pytest.approx((math.sqrt(1 / 2), 0.0, 0.0))


def test_an_arm_pressed_against_something_is_blocked() -> None:
    robot = StagedRobot({0: lambda world: setattr(world, "lagging", True)})
    first, second, third = rows_of(run(opened(trial_setup(), robot), [push(FORWARD), push(FORWARD), HANDS_OFF]))
    assert first.blocked == second.blocked == 1
    assert "pressed" in (first.blocked_reason or "")
    assert momentum(second) == momentum(third) == STILL
    assert third.blocked == 0  # nobody asked for motion


def test_ticks_count_on_through_resets_and_time_goes_with_them() -> None:
    rows = rows_of(drive(opened(trial_setup()), Person()))
    assert [row.tick for row in rows] == list(range(len(rows)))
    assert [row.trial_s for row in rows] == [tick * 0.5 for tick in range(len(rows))]
    assert {row.trial for row in rows} == {2}
    assert len({row.digest for row in rows}) == len(rows)  # the world's time alone makes each one different


def test_a_row_names_the_last_input_it_took_into_account() -> None:
    engine = opened(trial_setup())
    seqs = [engine.tick(UserInput(FORWARD, seq=seq)).row.input_seq for seq in (3, 3, 9)]
    assert [*seqs, engine.tick().row.input_seq] == [3, 3, 9, None]


# ---- the gripper ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ticks", [1, 2, 5])
def test_a_press_pauses_motion_for_exactly_the_gripper_ticks(ticks: int) -> None:
    engine = opened(trial_setup(timing=RobotTiming(gripper_ticks=ticks)))
    here = engine.world.position_world_gripper_m
    results = run(engine, [UserInput(FORWARD, "close"), *[push(FORWARD)] * (ticks + 1)])
    rows = rows_of(results)
    assert [row.source for row in rows] == ["gripper"] * ticks + ["user"] * 2
    assert [position(row) for row in rows[: ticks + 1]] == [here] * (ticks + 1)
    assert {(user(row), action(row)) for row in rows[:ticks]} == {(BLANK, BLANK)}
    assert [row.gripper_input for row in rows] == ["close", *[None] * (ticks + 1)]
    assert [result.view.phase for result in results] == ["gripper"] * (ticks - 1) + ["operating"] * 3


def test_a_press_wins_over_a_direction() -> None:
    row = opened(trial_setup()).tick(UserInput(FORWARD, "close")).row
    assert (row.source, row.gripper_input, user(row), action(row)) == ("gripper", "close", BLANK, BLANK)


def test_a_press_while_the_fingers_are_busy_is_ignored() -> None:
    robot = StagedRobot()
    rows = rows_of(run(opened(trial_setup(), robot), [CLOSE, OPEN, push(FORWARD)]))
    assert [row.source for row in rows] == ["gripper", "gripper", "user"]
    assert [command.gripper for command in robot.commands] == ["close", "hold", "hold"]
    assert rows[1].gripper_input is None


def test_a_press_while_an_object_falls_is_ignored() -> None:
    robot = StagedRobot(
        {0: lambda world: world.hold("spray_bottle", 0.05), 1: lambda world: world.put_down("spray_bottle")}
    )
    rows = rows_of(run(opened(trial_setup(), robot), [HANDS_OFF, push(UP), CLOSE, HANDS_OFF]))
    assert [row.gripper_input for row in rows] == [None] * 4
    assert {command.gripper for command in robot.commands} == {"hold"}


def test_after_a_reset_the_fingers_are_open_and_can_be_closed() -> None:
    lost = StagedRobot({1: lambda world: world.put("spray_bottle", (0.77, 0.70, 0.1))})
    inputs = [CLOSE, *[HANDS_OFF] * (1 + RobotTiming().reset_ticks), CLOSE]
    rows = rows_of(run(opened(trial_setup(), lost), inputs))
    assert [row.source for row in rows] == ["gripper"] * 2 + ["reset"] * 4 + ["gripper"]


def test_a_press_that_would_change_nothing_is_ignored() -> None:
    inputs = [OPEN, UserInput(FORWARD, "open"), CLOSE, HANDS_OFF, CLOSE, UserInput(FORWARD, "close"), OPEN]
    rows = rows_of(run(opened(trial_setup()), inputs))
    assert [row.source for row in rows] == ["idle", "user", "gripper", "gripper", "idle", "user", "gripper"]
    assert [row.gripper_input for row in rows] == [None, None, "close", None, None, None, "open"]


def test_fingers_still_on_their_way_are_not_sent_again() -> None:
    """With one tick of pause the fingers take longer than the pause; the same button again must not pause more."""
    engine = opened(trial_setup(timing=RobotTiming(gripper_ticks=1)))
    rows = rows_of(run(engine, [CLOSE, CLOSE]))
    assert rows[0].gripper == "moving"
    assert [row.source for row in rows] == ["gripper", "idle"]


# ---- belief ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("condition", CONDITIONS)
def test_every_belief_follows_from_the_rows_alone(condition: Condition) -> None:
    """What an analysis can do with the export: take each row's state and input, apply the paper's equations."""
    belief: dict[str, float] = {}
    task = None
    rows = rows_of(drive(opened(trial_setup(condition)), Person()))
    for row in rows:
        goals, logged = json.loads(row.goals), json.loads(row.belief)
        assert list(goals) == list(logged)
        if row.source == "reset" or row.task != task or list(belief) != list(goals):
            belief = dict.fromkeys(goals, 1.0 / len(goals))
        task = row.task
        if row.source == "user":
            belief = dict(zip(goals, literal_posterior(row, list(belief.values()), parameters(condition)), strict=True))
        assert logged == pytest.approx(belief, abs=1e-9)
        assert row.entropy == pytest.approx(literal_entropy(list(logged.values())), abs=1e-9)
    assert {row.source for row in rows} >= {"user", "gripper", "reset"}


def literal_posterior(row: TickRow, prior: list[float], given: ArbiterCase) -> list[float]:
    """Equations 1 to 6 on what the row says."""
    state = LiteralState(position(row), momentum(row))
    goals = json.loads(row.goals).values()
    index = RAW_ACTIONS.index(whole(user(row)))
    by_goal = [likelihoods(state, goal, given.transition, given.rationality_per_m)[index] for goal in goals]
    return posterior_after(prior, by_goal)


def test_without_input_nothing_is_learned() -> None:
    for condition in CONDITIONS:
        engine = opened(trial_setup(condition))
        before = engine.tick(push((1, 1, 0))).row
        after = rows_of(run(engine, [HANDS_OFF, HANDS_OFF, CLOSE, HANDS_OFF]))
        assert {row.belief for row in after} == {before.belief}
        assert before.entropy < 1.0


def test_goals_are_the_objects_where_they_are_until_something_is_held_and_then_the_bins() -> None:
    engine = opened(trial_setup())
    results = pick_up(engine)
    bins = {name: list(place) for name, place in release_points(engine.scene.bins).items()}
    for before, result in pairwise(results):
        goals = json.loads(result.row.goals)
        assert (goals == bins) == (before.row.held is not None)
    first = json.loads(results[0].row.goals)
    assert tuple(first) == PLACEMENT
    assert first["spray_bottle"] == list(engine.scene.object("spray_bottle").rest_pose.position_world_m)

    held = next(result for result in results if result.row.held)
    assert [event.kind for event in held.events] == ["grasped"]
    lifted = engine.tick(HANDS_OFF).row
    assert json.loads(lifted.belief) == {"left_bin": 0.5, "right_bin": 0.5}


def test_a_missed_grasp_keeps_the_objects_and_what_is_believed_of_them() -> None:
    engine = opened(trial_setup())
    before = engine.tick(push(FORWARD)).row
    rows = rows_of(run(engine, [CLOSE, HANDS_OFF, HANDS_OFF, OPEN, HANDS_OFF, HANDS_OFF]))
    assert rows[2].gripper == "closed"
    assert {(row.held, row.belief, row.task) for row in rows} == {(None, before.belief, 1)}


def test_belief_starts_anew_when_the_goals_change_and_when_a_task_ends() -> None:
    engine = opened(trial_setup())
    name = "spray_bottle"
    results = drive(engine, Person(), lambda result: result.row.held == name)
    bins_first = engine.tick(HANDS_OFF).row  # goals switched with the grasp, the task has not
    lifting = drive(engine, Person(), lambda result: bool(result.tasks))
    dropoff_first = engine.tick(HANDS_OFF).row
    uniform = {"left_bin": 0.5, "right_bin": 0.5}
    assert json.loads(results[-1].row.belief) != dict.fromkeys(PLACEMENT, 1 / 6)
    assert (bins_first.task, json.loads(bins_first.belief)) == (1, uniform)
    assert (dropoff_first.task, json.loads(dropoff_first.belief)) == (2, uniform)
    assert lifting


def test_a_goal_that_is_pushed_aside_is_believed_in_where_it_is_now() -> None:
    moved_m = (0.80, 0.33, 0.85)
    engine = opened(trial_setup(), StagedRobot({0: lambda robot: robot.put("bleach_bottle", moved_m)}))
    first, second = rows_of(run(engine, [push(FORWARD), HANDS_OFF]))
    there = engine.world.object("bleach_bottle").grasp_world_m
    assert json.loads(second.goals)["bleach_bottle"] == list(there)
    assert json.loads(first.goals)["bleach_bottle"] != list(there)
    assert second.belief == first.belief


def test_one_goal_leaves_no_uncertainty() -> None:
    row = opened(practice_setup("balanced")).tick(push(FORWARD)).row
    assert (json.loads(row.belief), row.entropy) == ({"practice_block": 1.0}, 0.0)


# ---- resets ---------------------------------------------------------------------------------------------------------


def test_reset_rows_belong_to_no_task_and_take_no_input() -> None:
    engine = opened(trial_setup("balanced"))
    results = drive(engine, Person(), lambda result: result.cycle_start is not None)
    start = results[-1].cycle_start
    assert start is not None
    resetting = run(engine, [push(FORWARD), CLOSE, OPEN, HANDS_OFF])
    for row in rows_of(resetting):
        assert (row.source, row.task, row.kind, row.goal) == ("reset", None, None, None)
        assert (user(row), action(row), momentum(row), row.gripper_input) == (BLANK, BLANK, STILL, None)
        assert position(row) == engine.scene.start_world_m
        assert row.gripper == "open"
        assert row.entropy == 1.0
        assert row.cycle == 2
    assert [result.view.phase for result in resetting] == ["reset"] * 3 + ["operating"]
    assert (start.cycle, start.first_tick) == (2, resetting[0].row.tick)
    following = engine.tick(push(FORWARD)).row
    assert (following.source, following.task, following.kind) == ("user", 3, "pickup")
    assert engine.next_tick == following.tick + 1


def test_the_first_cycle_begins_without_a_reset() -> None:
    assert opened(trial_setup()).tick(push(FORWARD)).row.source == "user"


# ---- using it wrongly -----------------------------------------------------------------------------------------------


def test_a_tick_is_begun_once_and_ended_once() -> None:
    engine = TrialEngine(trial_setup(), StagedRobot(), CycleStart())
    with pytest.raises(RuntimeError, match="not open"):
        _ = engine.world
    engine.open()
    with pytest.raises(RuntimeError, match="begin"):
        engine.end()
    engine.begin(HANDS_OFF)
    with pytest.raises(RuntimeError, match="one is running"):
        engine.begin(HANDS_OFF)


def test_a_trial_that_is_over_takes_no_ticks() -> None:
    engine = opened(trial_setup(pickups=[("spray_bottle", "left_bin")]))
    results = drive(engine, Person())
    assert results[-1].finished and results[-1].view.phase == "finished"
    assert [task.outcome for task in tasks_of(results)] == ["success", "success"]
    with pytest.raises(RuntimeError, match="over"):
        engine.tick()


def test_driving_around_ends_nothing() -> None:
    engine = opened(trial_setup())
    results = [*go_to(engine, (0.70, 0.15, 0.95)), *run(engine, [push(RIGHT)] * 10)]
    assert not tasks_of(results) and not events_of(results)


# ---- who decided ----------------------------------------------------------------------------------------------------


def unit(direction: tuple[int | None, ...]) -> NDArray[np.float64]:
    given = np.array(direction, dtype=float)
    return given / (np.linalg.norm(given) or 1.0)


@pytest.mark.parametrize("condition", ["goal_oriented", "balanced"])
@pytest.mark.parametrize("gamma", [0.0, 0.01, 1e6])
def test_a_tick_says_who_decided_and_how_far_from_what_was_asked(condition: str, gamma: float) -> None:
    inputs = [push((0, 0, 1)), push(BACK), HANDS_OFF, push((1, 1, 0)), push((0, 0, 0)), push(LEFT)] * 4
    rows = rows_of(run(opened(trial_setup(condition, gamma=gamma)), [*inputs, CLOSE, *inputs]))
    for row in rows:
        asked, taken = user(row), (row.action_x, row.action_y, row.action_z)
        if None in asked:
            assert row.source in ("robot", "gripper", "reset") and row.departure is None
        else:
            assert row.source == ("user" if asked == taken else "blend")
            assert row.departure == pytest.approx(np.linalg.norm(unit(asked) - unit(taken)), abs=1e-12)
            assert (row.departure == 0.0) == (row.source == "user")
    sources = {row.source for row in rows}
    assert ("blend" in sources) == (gamma < 1.0)
    assert "robot" in sources and "gripper" in sources


def test_under_teleoperation_the_person_decides() -> None:
    rows = rows_of(run(opened(trial_setup("teleoperation", gamma=0.0)), SEQUENCE))
    assert {(row.source, row.departure) for row in rows} == {("user", 0.0), ("idle", None)}
