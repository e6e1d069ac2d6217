"""A session's line to its worker: which process it is, what it was told, and when it was last heard.

What a worker is to do is not sent once and forgotten: `ticks`, `free` and `view` say how it should be, and tell it to
the worker when that is not what it was told last. So another worker is told everything again, and what failed on the
way is made up for by whoever asks next (`Transitions.settle`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

from app.monitoring.log_lines import about
from app.session.interfaces import LabServices, WorkerHandle
from app.trial.values import TrialSetup
from app.worker.messages import Alive, Asking, Begin, Free, Hold, PartFailed, SetView, WorkerCommand, WorkerReport
from study.flow.protocol import WorkerKind

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Patience:
    """How long a worker may say nothing, in seconds: while it uses no processor time, and at all.

    A worker gives a sign of life every half a second. One that works and does not come to it may be on a busy machine;
    one that does not even work waits for something that does not come.
    """

    idle_s: float
    busy_s: float

    def longer(self, by_s: float) -> Patience:
        """So much more of both."""
        return Patience(self.idle_s + by_s, self.busy_s + by_s)


READY = Patience(1.25, 2.0)
LOCKSTEP = Patience(1.25, 5.0)
"""Nobody waits for a clock: a tick may take long."""
STARTING = Patience(4.0, 8.0)
"""For each step of the way: a robot of one's own may have to be waited for."""
STOPPED_S = 1.25
"""The same for one whose process was stopped from outside, wherever it is."""
RETRIES_S = (0.1, 0.5, 1.0, 2.0)
"""Pauses before a worker that could not be started is tried again; the last one goes on."""


@dataclass
class _Told:
    """What the present worker was told last."""

    ticks: bool = False
    free: bool = False
    view: str | None = None


class WorkerLink:
    """The worker of one session, if it has one. Reports and exits arrive with the epoch of the worker they are of.

    Attributes:
        epoch: number of the present worker; what arrives with another number is of one that was stopped.
        wanted: whether there should be one, wherever the session needs one; False once it was given up.
        ready: its world stands, and it takes commands.
        held: it waits for the page's heartbeat.
        asking: the part it was last heard to ask, while it has not answered.
        faulted: it ends because of its arbiter or inference, and has said so.
        restarts: how many workers of this practice or trial ended by themselves.
        failed_starts: how many could not be started since one could.
        problem: why the last of them did, if that is known.
        scene_port: port of its viser server on loopback, if it has a scene.
        spectator_port: port of the experimenters' viser server, while it is open.
        setup: what it was started with.
    """

    def __init__(
        self,
        services: LabServices,
        participant: str,
        on_report: Callable[[int, WorkerReport], None],
        on_exit: Callable[[int], None],
    ) -> None:
        self.epoch = 0
        self.wanted = True
        self.ready = False
        self.held = False
        self.faulted = False
        self.asking: Asking | None = None
        self.restarts = 0
        self.failed_starts = 0
        self.problem = ""
        self.scene_port: int | None = None
        self.spectator_port: int | None = None
        self.setup: TrialSetup | None = None
        self._services = services
        self._participant = participant
        self._on_report = on_report
        self._on_exit = on_exit
        self._handle: WorkerHandle | None = None
        self._runs: tuple[WorkerKind, int] | None = None
        self._told = _Told()
        self._has_spoken = False
        self._heard_s = 0.0
        self._worked: tuple[float, float] = (0.0, 0.0)
        self._retry_s = self._failing_since_s = 0.0

    @property
    def is_up(self) -> bool:
        """Whether there is a process, ready or not."""
        return self._handle is not None

    @property
    def runs(self) -> tuple[WorkerKind, int] | None:
        """What the process was started for, or the next one is to be; None when none was."""
        return self._runs

    @property
    def may_start(self) -> bool:
        """Whether a worker is missing, and it is time to start one."""
        is_due = self.wanted and self._handle is None and self._services.now_unix_s() >= self._retry_s
        return is_due and self._services.may_begin()

    async def start(self, kind: WorkerKind, trial: int) -> None:
        """Start a worker where the record ends; none for a session that can only be ended. Raises what a machine that
        cannot start processes raises; then it may be tried again."""
        self.epoch += 1
        epoch, self._runs = self.epoch, (kind, trial)
        self.faulted, self.asking, self._told, self._has_spoken = False, None, _Told(), False
        self.ready, self.scene_port, self.spectator_port = False, None, None
        spec = await self._services.make_spec(kind, trial)
        if spec is None:
            self.wanted = False
            return
        self.setup = spec.setup
        self._heard_s = self._services.now_unix_s()
        self._handle = await self._services.start_worker(
            spec, lambda report: self._report(epoch, report), lambda: self._on_exit(epoch)
        )
        self._heard_s = self._services.now_unix_s()
        self.failed_starts = 0

    async def stop(self) -> None:
        """End the worker; the practice or trial it ran is over."""
        handle, self._handle, self._runs = self._handle, None, None
        self.epoch += 1
        self.ready, self.held, self.restarts, self.setup = False, False, 0, None
        self.wanted, self.problem, self.failed_starts, self._retry_s = True, "", 0, 0.0
        self.scene_port = self.spectator_port = None
        if handle is not None:
            await handle.stop()

    def lost(self) -> None:
        """The process ended by itself."""
        self._services.metrics.worker_lost()
        self._handle, self.ready, self.held = None, False, False
        self.scene_port = self.spectator_port = None
        self.restarts += 1

    def could_not_start(self, problem: str) -> float:
        """There is no process, and not because one has ended: the next try comes a little later each time. Returns for
        how long it has been so, in seconds."""
        now_s = self._services.now_unix_s()
        if not self.failed_starts:
            self._failing_since_s = now_s
        self._handle, self.ready, self.held = None, False, False
        self.failed_starts += 1
        self.problem = problem
        self._retry_s = now_s + RETRIES_S[min(self.failed_starts, len(RETRIES_S)) - 1]
        return now_s - self._failing_since_s

    def anew(self) -> None:
        """Forget that workers have ended or could not be started: somebody lets the session go on."""
        self.wanted, self.restarts, self.problem, self.failed_starts, self._retry_s = True, 0, "", 0, 0.0

    def kill(self, problem: str = "") -> None:
        """End it at once, without listening to it any more; its exit is reported."""
        self.ready = False
        self.problem = problem
        if self._handle is not None:
            self._handle.kill()

    # ---- what it is to do -----------------------------------------------------------------------------------------

    def ticks(self, wanted: bool) -> None:
        """Whether ticks are to run. The worker holds at once, and begins when it is ready."""
        if not wanted:
            self.held = False
        if self.ready and self._told.ticks != wanted:
            self._told.ticks = wanted
            self.send(Begin() if wanted else Hold())

    def free(self, wanted: bool) -> None:
        """Whether the arm is to be freed with the next tick. Once it is, nobody wants it any more."""
        if self.ready and self._told.free != wanted:
            self._told.free = wanted
            if wanted:
                self.send(Free())

    def view(self, name: str | None) -> None:
        """The camera that the participant has chosen; None as it begins."""
        if self.ready and self._told.view != name and name is not None:
            self._told.view = name
            self.send(SetView(name))

    def send(self, command: WorkerCommand) -> None:
        """Hand over a command, if the worker is ready for any."""
        if self._handle is not None and self.ready:
            self._handle.send(command)

    # ---- whether it lives -----------------------------------------------------------------------------------------

    def _report(self, epoch: int, report: WorkerReport) -> None:
        """The worker said something: it lives, whenever the session comes to deal with it."""
        if epoch == self.epoch:
            self._heard_s, self._has_spoken = self._services.now_unix_s(), True
            if isinstance(report, Asking):
                self.asking = report if report.part else None
        if not isinstance(report, (Alive, Asking)):
            self._on_report(epoch, report)

    def _is_beyond(self, patience: Patience, silent_s: float) -> bool:
        """Whether the silence is longer than this worker may be silent. To be asked a few times a second."""
        signs, now_s = self._handle.vital_signs() if self._handle else None, self._services.now_unix_s()
        if signs is None:
            return silent_s > patience.busy_s
        if signs.cpu_s != self._worked[0]:
            self._worked = (signs.cpu_s, now_s)
        idle_s = min(silent_s, now_s - self._worked[1])
        if signs.stopped and idle_s > STOPPED_S:
            return True
        return idle_s > patience.idle_s or silent_s > patience.busy_s

    def excuse(self) -> None:
        """Nobody could listen for a while: its silence begins now."""
        self._heard_s = self._services.now_unix_s()

    def end_if_hung(self, in_lockstep: bool) -> PartFailed | None:
        """End a worker that has gone silent: another takes over from the log. The part in which it hangs, if it was
        heard to ask one, as the worker would have told it."""
        if self._handle is None:
            return None
        silent_s = self._services.now_unix_s() - self._heard_s
        if self.asking is not None:
            if silent_s <= self.asking.within_s:
                return None
            hangs = PartFailed(self.asking.part, f"gave no answer for {self.asking.within_s:g} s and was ended")
            self.asking = None
            self.kill()
            return hangs
        patience = STARTING if not self.ready else LOCKSTEP if in_lockstep else READY
        if not self._has_spoken:
            patience = patience.longer(self._services.start_allowance_s)
        if self._is_beyond(patience, silent_s):
            fields = about(participant=self._participant, silent_s=round(silent_s, 1))
            log.error("a worker hangs and is ended", extra=fields)
            self._heard_s = self._services.now_unix_s()  # its exit is on the way
            self.kill("it gave no sign of life")
        return None
