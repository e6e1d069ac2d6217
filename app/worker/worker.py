"""One session's process: robot, arbiter and scene, and the loop that runs them.

    commands ──► Worker ──► reports
    Begin, Hold, ControlsState, Free, SetView, Spectate, Stop; Alive, Ready, Ticked, HoldChanged, SpectatorPort, Asking,
    PartFailed, Failed

Real time: tick k starts at its absolute deadline; its 15 slices are spread over the half second, the scene is drawn
after each, and the result goes out after the last. When the page has not been heard of for `heartbeat_timeout_s`, no
tick starts (the robot is held) until it is heard of again.

Lockstep: each `ControlsState` message that is not a heartbeat runs one tick at once. The code that runs is the same.

An arbiter or an inference that cannot be used ends the worker before the robot has moved; the lab is told why.

A crash in here costs the session a second and no data: the lab starts another worker, which re-runs the current cycle
from the log.
"""

from __future__ import annotations

import logging
import math
import signal
import time
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from app.monitoring.log_lines import about
from app.trial.engine import TrialEngine
from app.trial.reasoning import PartFault
from app.trial.robots import make_robot, make_scene, make_spectator_view
from app.trial.values import TickResult, UserInput
from app.trial.verdicts import release_points
from app.worker.input_latch import InputLatch
from app.worker.line import Line
from app.worker.messages import (
    Alive,
    Asking,
    Begin,
    ControlsState,
    Failed,
    Free,
    Hold,
    HoldChanged,
    PartFailed,
    Ready,
    SetView,
    Spectate,
    SpectatorPort,
    Stop,
    Ticked,
    WorkerCommand,
    WorkerSpec,
    WorldInNumbers,
)
from app.worker.pacer import Deadline, Pacer
from app.worker.spectator_view import OnDemandView
from app.worker.time_limit import TimeLimit
from sim.interface import SLICE_S, SLICES_PER_TICK, TICK_S

if TYPE_CHECKING:
    from sim.view.scene import SceneView

log = logging.getLogger(__name__)

IDLE_WAIT_S = 0.25
"""How often a worker that runs no ticks looks whether the lab is still there."""
ALIVE_EVERY_S = 0.5
"""How often a worker that has nothing to tell says that it lives."""


def run(connection: Line, spec: WorkerSpec) -> None:
    """Entry point of the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with ExitStack() as open_parts:
        open_parts.callback(connection.close)
        try:
            robot = make_robot(spec.robot)
            connection.send(Alive())
            open_parts.callback(robot.close)
            scene = make_scene(spec.view) if spec.scene else None
            spectator_view = None
            if scene is not None:
                open_parts.callback(scene.close)
                spectator_view = OnDemandView(lambda: make_spectator_view(scene))
                open_parts.callback(spectator_view.close)
            engine = TrialEngine(
                spec.setup,
                robot,
                spec.start,
                limit=TimeLimit,
                asking=lambda part, within_s: connection.send(Asking(part, within_s)),
            )
            Worker(connection, spec, engine, scene, spectator_view).serve()
        except (EOFError, BrokenPipeError, ConnectionResetError):
            pass  # the lab is gone: nothing is left to serve
        except PartFault as fault:
            fields = about(participant=spec.setup.participant, part=fault.part)
            log.warning("a part of the study cannot be used", exc_info=fault, extra=fields)
            with suppress(OSError):
                connection.send(PartFailed(fault.part, fault.reason))
        except Exception as error:
            with suppress(OSError):
                connection.send(Failed(f"{type(error).__name__}: {error}"))
            raise


class Worker:
    """Serves one trial or practice over a connection. See the module's text."""

    def __init__(
        self,
        connection: Line,
        spec: WorkerSpec,
        engine: TrialEngine,
        scene: SceneView | None,
        spectator_view: OnDemandView | None = None,
    ) -> None:
        self._connection = connection
        self._spec = spec
        self._engine = engine
        self._scene = scene
        self._shown = (0, 0)
        self._scene_goal: str | None = None
        self._spectator_view = spectator_view
        self._latch = InputLatch(spec.heartbeat_timeout_s, TICK_S)
        self._pacer = Pacer(TICK_S)
        self._running = False
        self._held = False
        self._resumed = False
        self._free = False
        self._stopping = False
        self._tick_ends_s = 0.0
        self._said_s = -math.inf

    def serve(self) -> None:
        """Build the world, re-run the log, then obey until told to stop or the lab is gone."""
        self._engine.open()
        self._live()
        mismatch = self._rerun()
        self._live()
        port = self._scene.open() if self._scene else None
        self._draw()
        self._connection.send(
            Ready(port, self._engine.view(), self._world_in_numbers(), self._engine.finished, mismatch, *self._look())
        )
        while not self._stopping:
            self._live()
            if self._spec.pace == "lockstep" or not self._running or self._engine.finished:
                if self._connection.poll(IDLE_WAIT_S):
                    self._obey(self._connection.recv())
                self._tend_views()
            else:
                self._pace()

    def _look(self) -> tuple[Mapping[str, str], str]:
        """What the scene shows of the robot, and why it is not what the study says."""
        look = self._scene.look if self._scene is not None else None
        if look is None:
            return {}, ""
        if look.note:
            fields = about(participant=self._spec.setup.participant, note=look.note)
            log.warning("the robot is drawn otherwise than the study says", extra=fields)
        return look.facts, look.note

    def _rerun(self) -> int | None:
        mismatch = None
        for user_input, digest in self._spec.log:
            if self._engine.finished:  # it went another way this time
                return self._engine.next_tick if mismatch is None else mismatch
            result = self._engine.tick(user_input)
            self._live()
            if result.row.digest != digest and mismatch is None:
                mismatch = result.row.tick
        self._resumed = self._engine.next_tick > 0
        return mismatch

    def _live(self) -> None:
        """Say that it lives, every half a second."""
        now_s = time.monotonic()
        if now_s - self._said_s >= ALIVE_EVERY_S:
            self._said_s = now_s
            self._connection.send(Alive())

    # ---- commands -----------------------------------------------------------------------------------------------

    def _obey(self, command: WorkerCommand) -> None:
        now_s = time.monotonic()
        if isinstance(command, ControlsState):
            self._latch.put(command, now_s)
            if self._spec.pace == "lockstep" and self._running and not command.beat and not self._engine.finished:
                self._lockstep_tick()
        elif isinstance(command, Begin):
            self._latch.forget_presses()  # what is held down now still counts
            self._running = True
            self._pacer.start(max(now_s, self._tick_ends_s))
        elif isinstance(command, Hold):
            self._resumed = self._resumed or (self._running and self._engine.next_tick > 0)
            self._running = False
            self._held = False
            self._pacer.stop()
        elif isinstance(command, Free):
            self._free = True
        elif isinstance(command, SetView):
            if self._scene is not None:
                self._scene.set_view(command.name)
        elif isinstance(command, Spectate):
            if self._spectator_view is not None:
                self._spectator_view.ask(command.looking)
            else:
                self._connection.send(SpectatorPort(None))
        elif isinstance(command, Stop):
            self._stopping = True

    def _drain(self, wait_s: float) -> None:
        """Obey what has arrived, waiting at most `wait_s` for the first."""
        if self._connection.poll(max(0.0, wait_s)):
            self._obey(self._connection.recv())
            while self._connection.poll(0.0):
                self._obey(self._connection.recv())

    # ---- ticks --------------------------------------------------------------------------------------------------

    def _lockstep_tick(self) -> None:
        started_unix_s = self._spec.clock_offset_s + time.monotonic()
        user_input = self._take_input(time.monotonic())
        result = self._engine.tick(user_input)
        self._draw()
        world, told = self._world_in_numbers(), self._engine.explain()
        self._connection.send(Ticked(result, world, self._latch.seq, started_unix_s, None, 0, told, user_input.free))

    def _pace(self) -> None:
        """Wait for the next deadline and run its tick, if the page is there."""
        self._drain(self._pacer.wait_s(time.monotonic()))
        deadline = self._pacer.take(time.monotonic()) if self._running else None
        if deadline is None:
            return
        if self._latch.fresh(time.monotonic()):
            if self._held:
                self._held = False
                self._latch.forget_presses()  # made when nothing could be seen to follow from them
                self._connection.send(HoldChanged(False))
            self._real_time_tick(deadline)
        else:
            self._tend_views()
            if self._held:
                return
            self._held = True
            self._resumed = True
            self._latch.drop()
            self._connection.send(HoldChanged(True))

    def _real_time_tick(self, deadline: Deadline) -> None:
        started_unix_s = self._spec.clock_offset_s + time.monotonic()
        self._tick_ends_s = deadline.due_s + TICK_S
        user_input = self._take_input(time.monotonic())
        self._engine.begin(user_input)
        seq = self._latch.seq
        for index in range(SLICES_PER_TICK):
            due_s = deadline.due_s + index * SLICE_S
            while (wait_s := due_s - time.monotonic()) > 0:
                self._drain(wait_s)
            self._engine.advance()
            self._draw()
            self._tend_spectator_view()
        result = self._engine.end()
        late_ms = deadline.late_s * 1000.0
        world, told = self._world_in_numbers(), self._engine.explain()
        missed = deadline.missed
        self._connection.send(Ticked(result, world, seq, started_unix_s, late_ms, missed, told, user_input.free))
        self._draw(ended=result)

    def _tend_views(self) -> None:
        """Who looks on may change while no slice is drawn."""
        if self._scene is not None:
            self._scene.tend()
        self._tend_spectator_view()

    def _tend_spectator_view(self) -> None:
        """What the experimenters see, after what the participant sees. If it fails they lose it; the trial goes on."""
        if self._spectator_view is None:
            return
        try:
            changed = self._spectator_view.tend(self._engine)
        except Exception:
            fields = about(participant=self._spec.setup.participant)
            log.exception("the experimenters' view failed and is given up", extra=fields)
            self._spectator_view, changed = None, (None,)
        if changed is not None:
            self._connection.send(SpectatorPort(*changed))

    def _world_in_numbers(self) -> WorldInNumbers:
        world = self._engine.world
        return WorldInNumbers(
            position_m=world.position_world_gripper_m,
            held=world.held,
            gripper=world.gripper,
            objects_m={item.id: item.grasp_world_m for item in world.objects},
            bins_m=release_points(self._engine.scene.bins),
        )

    def _take_input(self, now_s: float) -> UserInput:
        user_input = replace(self._latch.take(now_s), after_pause=self._resumed, free=self._free)
        self._resumed = self._free = False
        return user_input

    def _draw(self, ended: TickResult | None = None) -> None:
        """Show the world as it is now; the scene of a new cycle, or of another attempt, replaces the old one."""
        if self._scene is None:
            return
        if self._shown != self._engine.place:
            self._shown = self._engine.place
            self._scene.show(self._engine.scene, self._engine.delivered)
            self._scene_goal = None
        elif ended is not None:
            return
        if self._scene_goal != self._engine.goal:
            self._scene_goal = self._engine.goal
            self._scene.mark(self._scene_goal)
        self._scene.update(self._engine.world, self._engine.delivered)
