"""A session's line to its worker: which process it is, whether it is ready, and when it was last heard."""

from __future__ import annotations

import logging
from collections.abc import Callable

from app.monitoring.log_lines import about
from app.session.interfaces import LabServices, WorkerHandle
from app.trial.values import TrialSetup
from app.worker.messages import Asking, PartFailed, WorkerCommand, WorkerReport
from study.flow.protocol import WorkerKind

log = logging.getLogger(__name__)

HUNG_AFTER_S = 5.0
"""A worker that reports nothing for this long, while its page is heard, is replaced."""


class WorkerLink:
    """The worker of one session, if it has one. Reports and exits arrive with the epoch of the worker they are of.

    Attributes:
        epoch: number of the present worker; what arrives with another number is of one that was stopped.
        ready: its world stands, and it takes commands.
        held: it waits for the page's heartbeat.
        asking: the part it was last heard to ask, while it has not answered.
        faulted: it ends because of its arbiter or inference, and has said so.
        restarts: how many workers of this practice or trial ended by themselves.
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
        self.ready = False
        self.held = False
        self.faulted = False
        self.asking: Asking | None = None
        self.restarts = 0
        self.scene_port: int | None = None
        self.spectator_port: int | None = None
        self.setup: TrialSetup | None = None
        self._services = services
        self._participant = participant
        self._on_report = on_report
        self._on_exit = on_exit
        self._handle: WorkerHandle | None = None
        self._page_heard_s = self._page_heard_since_s = self._reported_s = 0.0

    @property
    def is_up(self) -> bool:
        """Whether there is a process, ready or not."""
        return self._handle is not None

    async def start(self, kind: WorkerKind, trial: int) -> None:
        """Start a worker where the record ends; none for a session that can only be ended."""
        self.epoch += 1
        epoch = self.epoch
        self.faulted, self.asking = False, None
        self.ready, self.scene_port, self.spectator_port = False, None, None
        spec = await self._services.make_spec(kind, trial)
        if spec is None:
            return
        self.setup = spec.setup
        self._handle = self._services.start_worker(
            spec, lambda report: self._on_report(epoch, report), lambda: self._on_exit(epoch)
        )

    async def stop(self) -> None:
        """End the worker; the practice or trial it ran is over."""
        handle, self._handle = self._handle, None
        self.epoch += 1
        self.ready, self.held, self.restarts, self.setup = False, False, 0, None
        self.scene_port = self.spectator_port = None
        if handle is not None:
            await handle.stop()

    def lost(self) -> None:
        """The process ended by itself."""
        self._services.metrics.worker_lost()
        self._handle, self.ready, self.held = None, False, False
        self.scene_port = self.spectator_port = None
        self.restarts += 1

    def kill(self) -> None:
        """End it at once, without listening to it any more; its exit is reported."""
        self.ready = False
        if self._handle is not None:
            self._handle.kill()

    def send(self, command: WorkerCommand) -> None:
        """Hand over a command, if the worker is ready for any."""
        if self._handle is not None and self.ready:
            self._handle.send(command)

    def page_heard(self) -> None:
        """The page said something about the hands; silence before starts a new stretch of being heard."""
        now_s = self._services.now_unix_s()
        if now_s - self._page_heard_s > HUNG_AFTER_S / 2:
            self._page_heard_since_s = now_s
        self._page_heard_s = now_s

    def reported(self) -> None:
        """The worker said something."""
        self._reported_s = self._services.now_unix_s()

    def part_that_hangs(self) -> PartFailed | None:
        """The part in which the worker hangs, if it does, as the worker would have told it; the worker is ended."""
        silent_s = self._services.now_unix_s() - self._reported_s
        if self._handle is None or self.asking is None or silent_s <= self.asking.within_s:
            return None
        hangs = PartFailed(self.asking.part, f"gave no answer for {self.asking.within_s:g} s and was ended")
        self.asking = None
        self.kill()
        return hangs

    def end_if_hung(self) -> None:
        """End a ticking worker that has gone silent while its page has not: another takes over from the log."""
        now_s = self._services.now_unix_s()
        page_is_there = now_s - self._page_heard_s <= HUNG_AFTER_S / 2
        silent_s = now_s - max(self._reported_s, self._page_heard_since_s)
        if page_is_there and silent_s > HUNG_AFTER_S and self._handle is not None:
            log.error("the worker hangs and is ended", extra=about(participant=self._participant))
            self._reported_s = now_s
            self._handle.kill()
