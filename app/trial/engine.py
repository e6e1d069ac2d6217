"""One trial (or practice), tick by tick: who moves the robot, what is believed, and when a task is over.

    engine = TrialEngine(setup, robot)
    engine.open()
    while not engine.finished:
        result = engine.tick(UserInput(direction=(1, 0, 0)))

`TrialEngine` has no clock, no socket and no randomness: the same setup and the same inputs give the same rows, bit for
bit. A live session spreads a tick over half a second by calling `begin`, `advance` (15 times) and `end` itself.

A tick (paper IV-A):

    input ──► gripper button? ──► fingers move, motion pauses            source = gripper
          ──► direction?      ──► inference, then the arbiter: follow    source = user, or blend if it takes another
          ──► nothing         ──► inference, then the arbiter: choose    source = robot, or idle if it never moves
                                                                                  by itself
    somebody frees the arm    ──► the cycle begins again, whatever has become of it     source = free

The unit is the pick-and-place cycle. Each starts in a fresh physics world and with a fresh arbiter and inference, which
are given what they remember, so a cycle can be re-run from its first tick alone: `CycleStart` is all there is to keep.
A cycle that begins again because the arm was freed is another attempt at it, and that attempt is the unit then. It
begins with what the cycle began with; the world before, and what inference and arbiter made of it, are not looked at
any more: a way out must not depend on them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from app.autonomy.actions import Direction
from app.autonomy.belief import Belief
from app.autonomy.interface import Explanation, Feasible, State
from app.trial.feasibility import Feasibility, Surroundings
from app.trial.fingers import Fingers
from app.trial.goals import Goals, candidates
from app.trial.hints import Hint, hint_for
from app.trial.judge import Judge
from app.trial.motion import motion_command, unit_direction
from app.trial.reasoning import Limit, Reasoning, Told
from app.trial.tasks import TaskProgress
from app.trial.tick_rows import RETURNING, Decision, TickRows
from app.trial.time_limits import near_limit
from app.trial.values import (
    NO_INPUT,
    STILL,
    CycleStart,
    EngineEvent,
    Press,
    TickResult,
    TrialSetup,
    TrialView,
    UserInput,
)
from app.trial.verdicts import TIME_LIMIT, Verdict
from app.trial.way_on import Gate
from sim.clearance import clearance
from sim.interface import (
    SLICES_PER_TICK,
    TICK_S,
    MotionSegment,
    MotionVerdict,
    Pose,
    Robot,
    RobotCommand,
    SceneSpec,
    Vector3,
    WorldState,
)
from study.records import TaskRow

PRACTICE_TRIES = 3
"""Practice is over after so many cycles, whatever came of them."""

_STAND_STILL = (MotionSegment(STILL, SLICES_PER_TICK),)


class _Tick(NamedTuple):
    """What was decided at the start of a tick, kept until its end. `action` is None when motion is paused."""

    row: dict[str, Any]
    asked: tuple[MotionSegment, ...]
    verdict: MotionVerdict
    action: Direction | None

    def momentum(self, blocked: bool) -> Vector3:
        """The direction the arm ends up with: the action's, or what the limits left of it."""
        if self.action is None or blocked or not any(self.action):
            return STILL
        kept = self.verdict.executed[-1].direction
        return unit_direction(self.action) if kept == self.asked[-1].direction else kept


class TrialEngine:
    """Runs one trial on one robot. See the module's text for the order of things.

    Attributes:
        finished: all tasks are over.
        setup: what the trial depends on.
    """

    def __init__(
        self,
        setup: TrialSetup,
        robot: Robot,
        start: CycleStart | None = None,
        limit: Limit | None = None,
        asking: Told | None = None,
    ) -> None:
        """`limit` and `asking` are those of `app.trial.reasoning.Reasoning`."""
        self.setup = setup
        self.finished = False
        self._robot = robot
        self._began = start or CycleStart()
        self._reasoning = Reasoning(setup, self._began, limit, asking)
        self._gate = Gate()
        self._surroundings = Surroundings()
        self._tick = self._began.first_tick
        self._progress = TaskProgress(setup, self._began)
        self._delivered: dict[str, Pose] = dict(self._began.delivered)
        self._momentum: Vector3 = STILL
        self._goals = Goals.at(())
        self._looked_at: tuple[object, ...] = ()
        self._belief: Belief | None = None
        self._rows = TickRows(setup)
        self._fingers = Fingers(setup.timing.gripper_ticks)
        self._judge = Judge(self._progress.cycle_setup, setup.timing.settle_timeout_ticks)
        self._reset_ticks_left = 0
        self._is_freed = False
        self._pressed_ticks = 0
        self._pending: _Tick | None = None
        self._world: WorldState | None = None
        self._is_open = False
        self._shown: tuple[tuple[object, ...], TrialView] | None = None

    # ---- what callers may look at -------------------------------------------------------------------------------

    @property
    def world(self) -> WorldState:
        """The world after the last slice."""
        if self._world is None:
            if not self._is_open:
                raise RuntimeError("the engine is not open; call open() first")
            self._world = self._robot.observe()
        return self._world

    @property
    def scene(self) -> SceneSpec:
        """The scene of the current cycle."""
        return self._progress.cycle_setup.scene

    @property
    def delivered(self) -> Mapping[str, Pose]:
        """Where the objects of earlier cycles came to rest."""
        return self._delivered

    @property
    def next_tick(self) -> int:
        """Number of the next tick."""
        return self._tick

    @property
    def cycle(self) -> int:
        """Number of the current cycle, from 1."""
        return self._progress.cycle

    @property
    def place(self) -> tuple[int, int]:
        """Cycle and attempt, each from 1: each place has a world of its own."""
        return self._progress.cycle, self._progress.attempt

    @property
    def goal(self) -> str | None:
        """Id of the instructed object or bin; None for a practice dropoff, which may go anywhere."""
        return self._progress.goal

    @property
    def belief(self) -> Belief | None:
        """The belief after the last tick; None before the first."""
        return self._belief

    def view(
        self, source: str = "idle", blocked: bool = False, ended: Verdict | None = None, hint: Hint | None = None
    ) -> TrialView:
        """The trial as a page may show it now."""
        progress, world = self._progress, self.world
        phase: Literal["operating", "gripper", "settling", "reset", "finished"] = "operating"
        if self.finished:
            phase = "finished"
        elif self._reset_ticks_left:
            phase = "reset"
        elif self._judge.settling_ticks:
            phase = "settling"
        elif self._fingers.busy_ticks:
            phase = "gripper"
        shown = (
            phase,
            progress.kind,
            progress.cycle_setup.object,
            progress.cycle_setup.bin,
            progress.task - 1 if not self.finished else progress.tasks,
            progress.tasks,
            world.gripper,
            world.held is not None,
            blocked,
            source,
            ended,
            hint,
            None if self.finished else near_limit(self.setup.limits, self._trial_ticks, self._task_ticks),
        )
        if self._shown is None or self._shown[0] != shown:  # most ticks leave it as it was
            self._shown = shown, TrialView(*shown)
        return self._shown[1]

    def explain(self) -> Explanation:
        """What spoke for the arm's last action, as the arbiter says it."""
        return self._reasoning.explain()

    # ---- running ------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Build the world of the first cycle to be run. The arm resets visibly before every cycle but the first, and
        before every other attempt.

        Raises `app.trial.reasoning.PartFault` when inference or arbiter cannot be made.
        """
        self._is_open = True
        self._enter_cycle(reset=self._began.first_tick > 0 or self._began.attempt > 1)

    def tick(self, user_input: UserInput = NO_INPUT) -> TickResult:
        """One whole tick."""
        self.begin(user_input)
        self.advance(SLICES_PER_TICK)
        return self.end()

    def begin(self, user_input: UserInput) -> None:
        """Take the input, update the belief, decide, and command the robot.

        Raises `app.trial.reasoning.PartFault` before the robot is commanded; the engine is then to be made anew.
        """
        if self.finished or self._pending is not None:
            raise RuntimeError("a tick cannot begin: " + ("the trial is over" if self.finished else "one is running"))
        if user_input.after_pause:
            self._momentum = STILL
        if user_input.free and not self._reset_ticks_left:  # it is going back already otherwise
            self._begin_again()
        self._look()
        if self._reset_ticks_left:
            source, self._is_freed = ("free" if self._is_freed else "reset"), False
            self._pending = self._begin_still(user_input, source)
            return
        self._refresh_belief()
        pressed = None if self._judge.settling_ticks else self._fingers.press(user_input.gripper)
        if self._fingers.busy_ticks or self._judge.settling_ticks:
            self._pending = self._begin_still(user_input, "gripper", pressed)
        else:
            self._pending = self._begin_motion(user_input)

    def advance(self, slices: int = 1) -> None:
        """So many slices of physics."""
        self._robot.advance(slices)
        self._world = None  # observed when somebody looks

    def end(self) -> TickResult:
        """Judge what happened and hand over the tick's row."""
        if self._pending is None:
            raise RuntimeError("no tick is running; call begin() first")
        pending, self._pending = self._pending, None
        world = self.world
        events: list[EngineEvent] = []
        blocked, reason = pending.verdict.blocked, pending.verdict.reason
        if pending.action is not None and any(pending.action) and world.lagging:
            blocked, reason = True, "the arm is pressed against something"
        self._momentum = pending.momentum(bool(blocked))
        hint = self._hint(pending, reason) if blocked and pending.action is not None else None
        self._pressed_ticks = self._pressed_ticks + 1 if hint is not None else 0
        row = self._rows.ended(pending.row, world, blocked, reason)
        self._tick += 1
        events += self._fingers.look(world, self._progress.cycle_setup.object)
        tasks, verdict, cycle_start = self._end_task(row.source, world, events)
        if not self.finished and self._is_over(self.setup.limits.trial_ticks, self._trial_ticks):
            tasks, verdict, cycle_start = (*tasks, *self._end_trial(events)), verdict or TIME_LIMIT, None
        return TickResult(
            row=row,
            tasks=tasks,
            events=tuple(events),
            view=self.view(row.source, blocked, verdict, hint),
            cycle_start=cycle_start,
            finished=self.finished,
        )

    def _hint(self, pending: _Tick, reason: str | None) -> Hint:
        assert pending.action is not None
        world, reach_m = self.world, self.setup.timing.speed_m_s * TICK_S
        clear = clearance(world, self.scene)

        def can_go(way: Vector3) -> bool:
            x_m, y_m, z_m = (reach_m * part for part in way)
            return clear((x_m, y_m, z_m)) and bool(self._robot.feasible(np.array([(x_m, y_m, z_m)]))[0])

        return hint_for(unit_direction(pending.action), reason, world, can_go, self._pressed_ticks)

    # ---- the start of a tick ------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Where the candidate goals are now."""
        world = self.world
        if self._looked_at == (world.objects, world.held, self.scene):
            return
        self._looked_at = world.objects, world.held, self.scene
        places_m = candidates(world, self.scene)
        if places_m != self._goals.places_m:
            self._goals = Goals.at(places_m)

    def _refresh_belief(self) -> None:
        """A changed set of goals starts a fresh belief."""
        if self._belief is None or self._belief.goal_ids != self._goals.ids:
            self._belief = Belief.uniform(self._goals.ids)
        self._progress.begin_task(self._tick, len(self._goals.ids))

    def _state(self) -> State:
        world, goals = self.world, self._goals
        return State(
            position_m=world.position_world_gripper_m,
            momentum=self._momentum,
            goal_ids=goals.ids,
            goals_m=goals.positions_m,
            held=world.held,
            tick=self._tick,
        )

    def _begin_still(self, user_input: UserInput, source: str, pressed: Press | None = None) -> _Tick:
        verdict = self._robot.command(RobotCommand(_STAND_STILL, self.setup.timing.speed_m_s, pressed or "hold"))
        row = self._row(Decision(source, pressed=pressed), user_input, self._state())
        return _Tick(row, _STAND_STILL, verdict, action=None)

    def _begin_motion(self, user_input: UserInput) -> _Tick:
        assert self._belief is not None
        user, model, world, scene = user_input.direction, self.setup.models.transition, self.world, self.scene
        reach_m = self.setup.timing.speed_m_s * TICK_S
        feasible = Feasibility(self._robot, world, scene, model, self._momentum, reach_m, self._surroundings)
        state = self._state()

        def allowed(belief: Belief) -> Feasible:
            if user is not None or not self.setup.keep_way_on:
                return feasible
            return self._gate.question(feasible, state, belief, world, scene)

        self._belief, action, alone = self._reasoning.decide(state, self._belief, user, allowed)
        source = "robot" if alone else "idle"
        if user is not None:
            source = "user" if action == user else "blend"
        command = motion_command(model, self._momentum, action, self.setup.timing.speed_m_s)
        verdict = self._robot.command(command)
        decision = Decision(source, user, action if source != "idle" else None)
        return _Tick(self._row(decision, user_input, state), command.segments, verdict, action)

    def _row(self, decision: Decision, user_input: UserInput, state: State) -> dict[str, Any]:
        return self._rows.begun(decision, user_input, self._progress, state, self._goals, self._belief)

    # ---- the end of a tick --------------------------------------------------------------------------------------

    def _end_task(
        self, source: str, world: WorldState, events: list[EngineEvent]
    ) -> tuple[tuple[TaskRow, ...], Verdict | None, CycleStart | None]:
        """Count down what is under way, and end the task if it is over."""
        if source in RETURNING:
            self._reset_ticks_left -= 1
            if source == "reset":
                return (), None, None
            where = {"phase": self.setup.kind, "cycle": self._began.cycle, "attempt": self._began.attempt}
            events.append(EngineEvent("arm_freed", where))
            return (), None, self._began
        self._fingers.tick()
        picking_up = self._progress.kind == "pickup"
        verdict = (
            self._judge.of_pickup(world) if picking_up else self._judge.of_dropoff(world, self._fingers.busy_ticks > 0)
        )
        if verdict is None and self._is_over(self.setup.limits.task_ticks, self._task_ticks):
            verdict = TIME_LIMIT
        if verdict is None:
            return (), None, None
        if picking_up and verdict.outcome == "success":
            return (self._end_pickup(verdict),), verdict, None
        return self._end_cycle(verdict, world, events)

    def _end_pickup(self, verdict: Verdict) -> TaskRow:
        """The pickup's row; the dropoff begins with the next tick and a fresh belief."""
        row = self._progress.row(verdict, self._tick - 1)
        self._progress.to_dropoff(self._tick)
        self._belief = None
        return row

    def _end_cycle(
        self, verdict: Verdict, world: WorldState, events: list[EngineEvent]
    ) -> tuple[tuple[TaskRow, ...], Verdict, CycleStart | None]:
        progress, practice = self._progress, self.setup.kind == "practice"
        tasks = [progress.row(verdict, self._tick - 1)]
        if progress.kind == "pickup" and not practice:
            tasks.append(progress.not_run_row())
        if progress.kind == "dropoff" and not practice and verdict.reason not in ("left_on_table", "time_limit"):
            # What stands in the way on the table is taken away; the rest stays in sight.
            self._delivered[progress.cycle_setup.object] = world.object(progress.cycle_setup.object).pose
        # Practice is there to be learned from, not to be stuck in: after so many tries it is over as well.
        succeeded = progress.kind == "dropoff" and verdict.outcome == "success"
        practice_done = practice and (succeeded or progress.cycle >= PRACTICE_TRIES)
        if practice and not practice_done:
            events.append(EngineEvent("practice_repeated", {"reason": verdict.reason}))
        if progress.is_last_cycle or practice_done:
            self.finished = True
            return tuple(tasks), verdict, None
        progress.to_cycle(progress.cycle + 1)
        inference_memory, arbiter_memory = self._reasoning.memories
        self._began = CycleStart(
            cycle=progress.cycle,
            first_tick=self._tick,
            delivered=tuple(self._delivered.items()),
            arbiter_memory=arbiter_memory,
            inference_memory=inference_memory,
            counted_from=self._began.counted_from,
        )
        self._enter_cycle(reset=True)
        return tuple(tasks), verdict, self._began

    def _begin_again(self) -> None:
        """The arm is freed: the cycle begins again with the tick that begins now, and with what it began with."""
        spans = self._progress.spans(self._tick)
        self._began = self._began.again(self._tick, spans["pickup"], spans["dropoff"])
        self._progress = TaskProgress(self.setup, self._began)
        self._reasoning.forget(self._began)
        self._enter_cycle(reset=True)

    # ---- time limits --------------------------------------------------------------------------------------------

    @property
    def _trial_ticks(self) -> int:
        """How many ticks the trial has had, resets included; the practice, since it was begun or repeated."""
        return self._tick - self._began.counted_from

    @property
    def _task_ticks(self) -> int:
        """How many ticks the current task has had, all attempts together."""
        return self._progress.ticks(self._tick)

    def _is_over(self, limit_ticks: int, ticks: int) -> bool:
        """Whether a limit is reached. What is falling already may come to rest first."""
        return bool(limit_ticks) and ticks >= limit_ticks and not self._judge.settling_ticks

    def _end_trial(self, events: list[EngineEvent]) -> tuple[TaskRow, ...]:
        """The trial's time is over: whatever is not done stays undone."""
        self.finished = True
        if self.setup.kind == "practice":
            events.append(EngineEvent("practice_time_limit", {}))
        return self._progress.rest(self._tick)

    def _enter_cycle(self, reset: bool) -> None:
        """A fresh world: arm at the start, belief forgotten, everything displaced restored."""
        self._belief = None
        self._momentum = STILL
        self._fingers = Fingers(self.setup.timing.gripper_ticks)
        self._judge = Judge(self._progress.cycle_setup, self.setup.timing.settle_timeout_ticks)
        self._pressed_ticks = 0
        self._is_freed = self._progress.attempt > 1
        self._reset_ticks_left = max(self.setup.timing.reset_ticks, int(self._is_freed)) if reset else 0
        self._reasoning.begin_cycle()
        self._robot.reset(self.scene)
        self._world = self._robot.observe()
