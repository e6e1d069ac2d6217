"""A session's worker: when ticks run, when the robot is held, and what is re-run after a crash.

Real time is simulated (`tests.support.simulated_pipe`), so that every moment is exact; one test runs a real process.
"""

from __future__ import annotations

import itertools
import multiprocessing
from dataclasses import replace
from typing import Any, cast

import pytest

from app.config import Pace
from app.trial.values import CycleStart, TickResult, UserInput, inputs_of
from app.worker.line import Line
from app.worker.messages import (
    Alive,
    Begin,
    ControlsState,
    Failed,
    Hold,
    HoldChanged,
    Ready,
    SetView,
    Stop,
    Ticked,
    WorkerCommand,
    WorkerSpec,
)
from app.worker.worker import run as run_worker
from sim.interface import SLICE_S, SLICES_PER_TICK, TICK_S
from sim.kinematic import KinematicRobot
from sim.view.looks import RobotLook
from study.parts.errors import PartError
from tests.support.arbiter_cases import CONDITIONS
from tests.support.engine_cases import (
    FORWARD,
    HANDS_OFF,
    LEFT,
    PICKUPS,
    Person,
    StagedRobot,
    drive,
    opened,
    push,
    run,
    trial_setup,
)
from tests.support.simulated_pipe import STAYS_OPEN, UNIX_S, Schedule, SimulatedPipe, beats, of, simulate

TIMEOUT_S = 0.5


def spec(
    pace: Pace = "real_time",
    log: tuple[tuple[UserInput, str], ...] = (),
    start: CycleStart | None = None,
    pickups: Any = PICKUPS,
    condition: str = "teleoperation",
) -> WorkerSpec:
    setup = trial_setup(condition, pickups)
    return WorkerSpec(setup, start or CycleStart(), log, "kinematic", pace, False, TIMEOUT_S, clock_offset_s=UNIX_S)


def log_of(results: list[TickResult]) -> tuple[tuple[UserInput, str], ...]:
    return tuple((inputs_of(result.row), result.row.digest) for result in results)


# ---- real time ------------------------------------------------------------------------------------------------------


def test_ticks_start_on_the_grid_and_are_reported_after_their_last_slice(monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = [*beats(0.0, 3.0), (1.0, Begin()), (2.9, Stop())]
    sent = simulate(monkeypatch, spec(), KinematicRobot(), schedule)
    assert isinstance(sent[0].report, Ready) and sent[0].at_s == 0.0
    ticked = of(sent, Ticked)
    assert [report.result.row.tick for report in ticked] == [0, 1, 2, 3]
    assert [report.started_unix_s - UNIX_S for report in ticked] == pytest.approx([1.0, 1.5, 2.0, 2.5])
    last_slice_s = (SLICES_PER_TICK - 1) * SLICE_S
    assert [entry.at_s for entry in sent[1:]] == pytest.approx([at + last_slice_s for at in (1.0, 1.5, 2.0, 2.5)])
    on_time: Any = pytest.approx(0.0, abs=1e-6)
    assert [(report.late_ms, report.missed) for report in ticked] == [(on_time, 0)] * 4


def test_the_first_tick_of_a_trial_follows_no_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = [*beats(0.0, 3.0), (1.0, Begin()), (1.4, Stop())]
    (ticked,) = of(simulate(monkeypatch, spec(), KinematicRobot(), schedule), Ticked)
    assert ticked.result.row.after_pause == 0


class Watched(KinematicRobot):
    """Notes the time of every slice; the first slice of tick `slow_tick` takes `slow_s`."""

    def __init__(self, slow_tick: int = -1, slow_s: float = 0.0) -> None:
        super().__init__()
        self.pipe: SimulatedPipe | None = None
        self.slices_s: list[float] = []
        self._slow = (slow_tick * SLICES_PER_TICK, slow_s)

    def advance(self, slices: int = 1) -> None:
        assert self.pipe is not None
        if len(self.slices_s) == self._slow[0]:
            self.pipe.now_s += self._slow[1]
        self.slices_s += [self.pipe.now_s] * slices
        super().advance(slices)


def test_the_slices_of_a_tick_are_spread_over_it(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Watched()
    schedule = [*beats(0.0, 3.0), (1.0, Begin()), (1.7, Stop())]
    robot.pipe = SimulatedPipe([*schedule, STAYS_OPEN])
    simulate(monkeypatch, spec(), robot, schedule, pipe=robot.pipe)
    assert robot.slices_s == pytest.approx([1.0 + SLICE_S * k for k in range(2 * SLICES_PER_TICK)])


def test_a_slow_tick_is_late_once_and_deadlines_missed_meanwhile_are_counted_not_made_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = Watched(slow_tick=1, slow_s=1.3)
    schedule = [*beats(0.0, 6.0, every_s=0.01), (1.0, Begin()), (4.2, Stop())]
    robot.pipe = SimulatedPipe([*schedule, STAYS_OPEN])
    ticked = of(simulate(monkeypatch, spec(), robot, schedule, pipe=robot.pipe), Ticked)
    starts_s = [report.started_unix_s - UNIX_S for report in ticked]
    # tick 1 began at 1.5 and was done at 2.8, after the deadlines 2.0 and 2.5; 2.5 is taken late, 2.0 is missed
    assert starts_s == pytest.approx([1.0, 1.5, 2.8, 3.0, 3.5, 4.0], abs=1e-6)
    assert [report.missed for report in ticked] == [0, 0, 1, 0, 0, 0]
    assert [report.late_ms for report in ticked] == pytest.approx([0, 0, 300, 0, 0, 0], abs=1e-3)
    assert [report.result.row.tick for report in ticked] == [0, 1, 2, 3, 4, 5]


def test_what_the_hands_did_just_before_a_deadline_moves_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """A press between two ticks counts at the next one, also when it is over by then; and only once."""
    tap = [(1.6, ControlsState(1, FORWARD)), (1.7, ControlsState(2, None))]
    held = [(2.1, ControlsState(3, LEFT)), *beats(2.15, 3.4, 3, LEFT)]
    schedule = [*beats(0.0, 1.55), *tap, *beats(1.75, 2.05, 2), *held, (1.0, Begin()), (3.2, Stop())]
    ticked = of(simulate(monkeypatch, spec(), KinematicRobot(), schedule), Ticked)
    rows = [report.result.row for report in ticked]
    assert [(row.user_x, row.user_y, row.user_z) for row in rows] == [
        (None, None, None),
        (None, None, None),
        FORWARD,
        LEFT,
        LEFT,
    ]
    assert [report.seq for report in ticked] == [row.input_seq for row in rows] == [0, 0, 2, 3, 3]


def test_a_silent_page_holds_the_robot_and_its_return_goes_on_after_a_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    before, after = beats(0.0, 2.1, 1, FORWARD), beats(5.2, 7.0, 1, FORWARD)
    schedule = [(0.0, ControlsState(1, FORWARD)), *before, *after, (1.0, Begin()), (6.3, Stop())]
    sent = simulate(monkeypatch, spec("real_time", condition="balanced"), KinematicRobot(), schedule)
    told = [(round(entry.at_s, 6), entry.report.held) for entry in sent if isinstance(entry.report, HoldChanged)]
    # last heard at 2.1: the tick of 2.5 still starts, that of 3.0 does not; heard again at 5.2, on at 5.5
    assert told == [(3.0, True), (5.5, False)]
    ticked = of(sent, Ticked)
    assert [report.started_unix_s - UNIX_S for report in ticked] == pytest.approx([1.0, 1.5, 2.0, 2.5, 5.5, 6.0])
    rows = [report.result.row for report in ticked]
    assert [row.tick for row in rows] == [0, 1, 2, 3, 4, 5]
    assert [row.after_pause for row in rows] == [0, 0, 0, 0, 1, 0]
    assert rows[4].m_x == 0.0 and rows[3].m_x == 1.0
    assert {row.source for row in rows} == {"user"}  # silence is never taken for hands off
    assert [report.missed for report in ticked] == [0] * 6


def test_a_press_made_while_the_robot_was_held_is_not_executed_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was stuck in the network arrives at once: a press, its release, and the heartbeats after it."""
    stuck = [(4.2, ControlsState(2, LEFT, "close")), (4.2, ControlsState(3, None)), *beats(4.2, 6.0, 3)]
    schedule = [*beats(0.0, 1.2), *stuck, (1.0, Begin()), (5.3, Stop())]
    sent = simulate(monkeypatch, spec(), KinematicRobot(), schedule)
    rows = [report.result.row for report in of(sent, Ticked)]
    assert {row.source for row in rows} == {"idle"}
    assert [row.gripper_input for row in rows] == [None] * len(rows)
    assert rows[-1].input_seq == 3


def test_what_was_held_down_before_a_silence_is_not_taken_up_again_on_an_old_message(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A heartbeat from before the last input arrives late: somebody is there, but what they do now is not known."""
    first: Schedule = [(0.9, ControlsState(2, FORWARD)), (1.0, Begin())]
    schedule = [*first, *beats(3.2, 4.0, 1, FORWARD), (3.9, Stop())]
    rows = [report.result.row for report in of(simulate(monkeypatch, spec(), KinematicRobot(), schedule), Ticked)]
    assert [row.source for row in rows] == ["user", "idle"]


def test_a_page_never_heard_of_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = [(1.0, Begin()), *beats(3.3, 4.5), (4.2, Stop())]
    sent = simulate(monkeypatch, spec(), KinematicRobot(), schedule)
    assert [type(entry.report) for entry in sent[:3]] == [Ready, HoldChanged, HoldChanged]
    assert [report.started_unix_s - UNIX_S for report in of(sent, Ticked)] == pytest.approx([3.5, 4.0])


def test_hold_finishes_the_tick_that_runs_and_begin_goes_on_from_there(monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = [
        (0.0, ControlsState(1, FORWARD)),
        *beats(0.0, 6.0, 1, FORWARD),
        (1.0, Begin()),
        (1.7, Hold()),
        (4.23, Begin()),
    ]
    sent = simulate(monkeypatch, spec(), KinematicRobot(), [*schedule, (4.9, Stop())])
    ticked = of(sent, Ticked)
    assert [report.started_unix_s - UNIX_S for report in ticked] == pytest.approx([1.0, 1.5, 4.23, 4.73])
    rows = [report.result.row for report in ticked]
    assert [row.tick for row in rows] == [0, 1, 2, 3]
    assert [row.after_pause for row in rows] == [0, 0, 1, 0]
    assert rows[2].m_x == 0.0
    assert {row.source for row in rows} == {"user"}  # what is held down when the pause ends counts


def test_a_pause_within_one_tick_neither_skips_nor_hurries_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = [*beats(0.0, 6.0), (1.0, Begin()), (1.6, Hold()), (1.7, Begin()), (2.9, Stop())]
    ticked = of(simulate(monkeypatch, spec(), KinematicRobot(), schedule), Ticked)
    assert [report.started_unix_s - UNIX_S for report in ticked] == pytest.approx([1.0, 1.5, 2.0, 2.5])
    assert [report.late_ms for report in ticked] == pytest.approx([0, 0, 0, 0], abs=1e-3)
    assert [report.result.row.after_pause for report in ticked] == [0, 0, 1, 0]


def test_presses_made_before_begin_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = [
        (0.2, ControlsState(1, FORWARD, "close")),
        (0.3, ControlsState(2, None)),
        *beats(0.3, 3.0, 2),
        (1.0, Begin()),
    ]
    ticked = of(simulate(monkeypatch, spec(), KinematicRobot(), [*schedule, (1.4, Stop())]), Ticked)
    assert [report.result.row.source for report in ticked] == ["idle"]


def test_stop_lets_the_running_tick_end_and_runs_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = [*beats(0.0, 9.0), (1.0, Begin()), (1.1, Stop())]
    sent = simulate(monkeypatch, spec(), KinematicRobot(), schedule)
    assert len(of(sent, Ticked)) == 1
    assert sent[-1].at_s == pytest.approx(1.0 + 14 * SLICE_S)


def test_a_finished_trial_runs_no_more_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    lost = StagedRobot({1: lambda robot: robot.put("spray_bottle", (0.77, 0.70, 0.1))})
    one = spec(pickups=PICKUPS[:1])
    sent = simulate(monkeypatch, one, lost, [*beats(0.0, 9.0), (1.0, Begin()), (8.0, Stop())])
    ticked = of(sent, Ticked)
    assert [report.result.finished for report in ticked] == [False, True]
    assert [task.outcome for task in ticked[-1].result.tasks] == ["failure", "not_run"]


def test_real_time_gives_the_rows_the_engine_gives_for_the_same_inputs(monkeypatch: pytest.MonkeyPatch) -> None:
    hands: list[tuple[float, WorkerCommand]] = [
        (1.3, ControlsState(1, FORWARD)),
        (2.2, ControlsState(2, LEFT, "close")),
        (3.6, ControlsState(3, None)),
    ]
    schedule = [*beats(0.0, 1.2), *hands, *beats(3.7, 7.0, 3), (1.0, Begin()), (6.8, Stop())]
    balanced = spec(condition="balanced")
    schedule += [
        (at, ControlsState(seq, d, beat=True)) for at, seq, d in [(1.8, 1, FORWARD), (2.6, 2, LEFT), (3.1, 2, LEFT)]
    ]
    ticked = of(simulate(monkeypatch, balanced, KinematicRobot(), schedule), Ticked)
    rows = [report.result.row for report in ticked]
    assert {row.source for row in rows} == {"user", "gripper", "robot"}
    again = run(opened(balanced.setup), [inputs_of(row) for row in rows])
    assert [result.row for result in again] == rows


# ---- lockstep -------------------------------------------------------------------------------------------------------


def lockstep(
    monkeypatch: pytest.MonkeyPatch, commands: list[WorkerCommand], given: WorkerSpec | None = None, scene: Any = None
) -> list[Any]:
    """The reports to commands that arrive one after another."""
    schedule = [(float(index), command) for index, command in enumerate([*commands, Stop()])]
    given = given or spec("lockstep")
    return [entry.report for entry in simulate(monkeypatch, given, KinematicRobot(), schedule, scene)]


def test_in_lockstep_every_input_runs_one_tick_and_a_heartbeat_none(monkeypatch: pytest.MonkeyPatch) -> None:
    beat = ControlsState(1, FORWARD, beat=True)
    reports = lockstep(
        monkeypatch,
        [Begin(), beat, ControlsState(1, FORWARD), beat, beat, ControlsState(2, None), ControlsState(3, None)],
    )
    assert [type(report) for report in reports] == [Ready, Ticked, Ticked, Ticked]
    rows = [report.result.row for report in reports[1:]]
    assert [(row.tick, row.source, row.input_seq) for row in rows] == [(0, "user", 1), (1, "idle", 2), (2, "idle", 3)]
    assert {report.late_ms for report in reports[1:]} == {None}


def test_in_lockstep_nothing_runs_before_begin_or_while_held(monkeypatch: pytest.MonkeyPatch) -> None:
    commands: list[WorkerCommand] = [
        ControlsState(1, FORWARD),
        Begin(),
        ControlsState(2, LEFT),
        Hold(),
        ControlsState(3, FORWARD),
        Begin(),
        ControlsState(4, None),
    ]
    rows = [report.result.row for report in lockstep(monkeypatch, commands)[1:]]
    assert [(row.tick, row.input_seq, row.user_y, row.after_pause) for row in rows] == [(0, 2, 1, 0), (1, 4, None, 1)]


def test_a_whole_trial_in_lockstep_is_the_engine_s(monkeypatch: pytest.MonkeyPatch) -> None:
    setup = trial_setup("balanced")
    results = drive(opened(setup), Person())
    inputs = [inputs_of(result.row) for result in results]
    hands: list[WorkerCommand] = [ControlsState(seq, i.direction, i.gripper) for seq, i in enumerate(inputs, start=1)]
    reports = lockstep(
        monkeypatch, [Begin(), *hands, ControlsState(9999, FORWARD)], spec("lockstep", condition="balanced")
    )
    assert [replace(report.result.row, input_seq=None) for report in reports[1:]] == [result.row for result in results]
    assert [report.result.tasks for report in reports[1:]] == [result.tasks for result in results]
    assert reports[-1].result.finished


# ---- what is seen ---------------------------------------------------------------------------------------------------


class Screen:
    """A scene that notes what it is asked to show."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []

    look = RobotLook("own", {"gripper_link": b"glTF"}, "the published one is not installed")

    def open(self) -> int:
        return 4711

    def show(self, scene: Any, delivered: Any) -> None:
        self.calls.append(("show", tuple(placed.spec.id for placed in scene.objects), tuple(delivered)))

    def update(self, world: Any, delivered: Any) -> None:
        self.calls.append(("update", world.digest(), tuple(delivered)))

    def set_view(self, name: str) -> None:
        self.calls.append(("view", name))

    def mark(self, goal: str | None) -> None:
        self.calls.append(("mark", goal))

    def tend(self) -> None:
        pass


def test_the_scene_shows_every_slice_and_each_cycle_s_own_table(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen()
    schedule = [*beats(0.0, 9.0), (1.0, Begin()), (1.1, SetView("top")), (2.4, Stop())]
    lost = StagedRobot({1: lambda robot: robot.put("spray_bottle", (0.77, 0.70, 0.1))})
    sent = simulate(monkeypatch, spec(), lost, schedule, screen)
    (ready,) = of(sent, Ready)
    assert ready.scene_port == 4711
    assert (ready.look, ready.look_note) == (Screen.look.facts, Screen.look.note), "what is drawn is reported"
    shown = [call for call in screen.calls if call[0] == "show"]
    assert [len(objects) for _, objects, _ in shown] == [6, 5]
    updates = [call[1] for call in screen.calls if call[0] == "update"]
    # once when ready, each slice of ticks 0 to 2, and the new table when the first cycle was over
    assert len(updates) == 1 + 3 * SLICES_PER_TICK + 1
    assert ("view", "top") in screen.calls
    # The ring is around what is instructed, from before the first picture of each table.
    marks = [index for index, call in enumerate(screen.calls) if call[0] == "mark"]
    assert [screen.calls[index][1] for index in marks] == ["spray_bottle", "sponge_pack"]
    assert [screen.calls[index - 1][0] for index in marks] == ["show", "show"]


def test_what_is_drawn_follows_from_the_world_and_the_task_under_every_condition(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The person drives all the time, so that the world is the same; whatever else differed would be a cue."""
    drawn = []
    for condition in CONDITIONS:
        screen = Screen()
        commands: list[WorkerCommand] = [Begin()]
        commands += [ControlsState(seq + 1, FORWARD if seq % 2 else LEFT) for seq in range(8)]
        lockstep(monkeypatch, commands, spec("lockstep", condition=condition), screen)
        drawn.append(screen.calls)
    assert len(drawn[0]) > 8
    assert drawn[1:] == drawn[:1] * (len(CONDITIONS) - 1)


def test_a_report_says_in_numbers_what_the_scene_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    reports = lockstep(monkeypatch, [Begin(), ControlsState(1, FORWARD)])
    engine = opened(trial_setup())
    for report, ticks in zip(reports, (0, 1), strict=True):
        run(engine, [push(FORWARD)] * ticks)
        sight = report.world
        assert sight.position_m == engine.world.position_world_gripper_m
        assert sight.objects_m == {item.id: item.grasp_world_m for item in engine.world.objects}
        assert set(sight.bins_m) == {"left_bin", "right_bin"}
        assert (sight.held, sight.gripper) == (None, "open")


# ---- after a crash --------------------------------------------------------------------------------------------------


def test_a_log_is_re_run_before_the_worker_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    results = run(opened(trial_setup()), [push(FORWARD), HANDS_OFF, push(LEFT)])
    ready, ticked = lockstep(monkeypatch, [Begin(), ControlsState(9, FORWARD)], spec("lockstep", log_of(results)))
    assert ready.mismatch is None
    assert ready.view == replace(results[-1].view, source="idle")
    row = ticked.result.row
    assert (row.tick, row.after_pause, row.m_y) == (3, 1, 0.0)
    expected = run(
        opened(trial_setup()), [*(inputs_of(result.row) for result in results), UserInput(FORWARD, None, 9, True)]
    )
    assert row == expected[-1].row


def test_a_log_that_led_elsewhere_is_reported_with_its_first_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    log = list(log_of(run(opened(trial_setup()), [push(FORWARD)] * 5)))
    for tampered in (2, 4):
        log[tampered] = (log[tampered][0], "0" * 16)
    (ready,) = lockstep(monkeypatch, [], spec("lockstep", tuple(log)))
    assert ready.mismatch == 2


def test_a_log_that_goes_on_after_the_end_is_a_mismatch(monkeypatch: pytest.MonkeyPatch) -> None:
    results = drive(opened(trial_setup(pickups=PICKUPS[:1])), Person())
    log = (*log_of(results), (HANDS_OFF, "0" * 16), (HANDS_OFF, "0" * 16))
    (ready,) = lockstep(monkeypatch, [], spec("lockstep", log, pickups=PICKUPS[:1]))
    assert (ready.finished, ready.mismatch) == (True, len(results))


def test_only_the_current_cycle_is_re_run(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = opened(trial_setup())
    first = drive(engine, Person(), lambda result: result.cycle_start is not None)
    start = first[-1].cycle_start
    second = run(engine, [HANDS_OFF, HANDS_OFF, push(FORWARD), HANDS_OFF, push(FORWARD)])
    ready, ticked = lockstep(monkeypatch, [Begin(), ControlsState(1, None)], spec("lockstep", log_of(second), start))
    assert ready.mismatch is None
    assert (ready.view.done_tasks, ready.finished) == (2, False)
    assert ticked.result.row.tick == len(first) + len(second)


def test_a_worker_restored_between_two_cycles_marks_the_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    start = drive(opened(trial_setup()), Person(), lambda result: result.cycle_start is not None)[-1].cycle_start
    _, ticked = lockstep(monkeypatch, [Begin(), ControlsState(1, None)], spec("lockstep", (), start))
    assert (ticked.result.row.source, ticked.result.row.after_pause) == ("reset", 1)


def test_a_log_up_to_the_end_leaves_nothing_to_run(monkeypatch: pytest.MonkeyPatch) -> None:
    one = trial_setup(pickups=PICKUPS[:1])
    results = drive(opened(one), Person())
    (ready,) = lockstep(
        monkeypatch, [Begin(), ControlsState(1, None)], spec("lockstep", log_of(results), pickups=PICKUPS[:1])
    )
    assert (ready.finished, ready.mismatch, ready.view.phase) == (True, None, "finished")


# ---- the process ----------------------------------------------------------------------------------------------------


class Pipe(SimulatedPipe):
    closed = False

    def close(self) -> None:
        self.closed = True


def run_in_place(monkeypatch: pytest.MonkeyPatch, pipe: Pipe, robot: StagedRobot) -> None:
    """The entry point, without a process of its own."""
    monkeypatch.setattr("app.worker.worker.time", pipe)
    monkeypatch.setattr("app.worker.worker.signal.signal", lambda number, action: None)
    monkeypatch.setattr("app.worker.worker.make_robot", lambda name: robot)
    run_worker(cast(Line, pipe), spec("lockstep"))


def test_a_worker_whose_lab_is_gone_ends_and_lets_go_of_its_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe, robot = Pipe([(0.0, Begin()), (1.0, ControlsState(1, None))]), StagedRobot()
    run_in_place(monkeypatch, pipe, robot)
    assert [type(entry.report) for entry in pipe.sent if not isinstance(entry.report, Alive)] == [Ready, Ticked]
    assert robot.closed and pipe.closed


@pytest.mark.parametrize("pace", ["real_time", "lockstep"])
def test_it_says_that_it_lives_whatever_it_waits_for(monkeypatch: pytest.MonkeyPatch, pace: Pace) -> None:
    """Before Start, while it ticks, without its page, and held: the lab never waits long for a sign."""
    schedule = [*beats(0.0, 6.0), (4.0, Begin()), (12.0, Hold()), (16.0, Stop())]
    pipe = SimulatedPipe([*schedule, STAYS_OPEN])
    simulate(monkeypatch, spec(pace), KinematicRobot(), schedule, pipe=pipe)
    signs_s = [entry.at_s for entry in pipe.sent]
    assert signs_s[0] == 0.0 and signs_s[-1] > 15.0
    assert max(after - before for before, after in itertools.pairwise(signs_s)) < 1.0


def test_a_robot_that_breaks_is_reported_and_let_go_of(monkeypatch: pytest.MonkeyPatch) -> None:
    def snap(robot: StagedRobot) -> None:
        raise RuntimeError("the elbow came off")

    pipe, robot = Pipe([(0.0, Begin()), (1.0, ControlsState(1, None))]), StagedRobot({0: snap})
    with pytest.raises(RuntimeError):
        run_in_place(monkeypatch, pipe, robot)
    assert pipe.sent[-1].report == Failed("RuntimeError: the elbow came off")
    assert robot.closed and pipe.closed


def test_a_robot_that_cannot_be_made_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = Pipe([(0.0, Stop())])
    monkeypatch.setattr("app.worker.worker.signal.signal", lambda number, action: None)
    with pytest.raises(PartError):
        run_worker(cast(Line, pipe), replace(spec(), robot="steam"))
    (failed,) = of(pipe.sent, Failed)
    assert "steam" in failed.reason and "kinematic" in failed.reason
    assert pipe.closed


def test_a_real_process_ticks_in_real_time_and_ends_with_its_lab() -> None:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=run_worker, args=(Line(theirs), spec()), daemon=True)
    process.start()
    theirs.close()
    reports: list[Any] = []
    try:
        reports.append(ours.recv())
        ours.send(ControlsState(1, FORWARD))
        ours.send(Begin())
        while sum(isinstance(report, Ticked) for report in reports) < 3:
            ours.send(ControlsState(1, FORWARD, beat=True))
            while ours.poll(TICK_S / 10):
                reports.append(ours.recv())
        reports = [report for report in reports if not isinstance(report, Alive)]
    finally:
        ours.close()
        process.join(timeout=60)
        assert process.exitcode == 0
    assert isinstance(reports[0], Ready) and reports[0].mismatch is None
    rows = [report.result.row for report in reports if isinstance(report, Ticked)]
    assert [row.tick for row in rows] == [0, 1, 2]
    assert [result.row for result in run(opened(spec().setup), [inputs_of(row) for row in rows])] == rows
