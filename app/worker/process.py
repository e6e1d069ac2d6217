"""Starting, hearing and ending worker processes, from the lab's event loop.

Workers come from a fork server (a process without threads), with the heavy imports made once, so a new worker is
ready in a fraction of a second and a crash in native code ends that worker alone. A worker that hangs holds up nobody
else: it is started and told on other threads, and the session ends one that no longer answers. A fork server that died
is replaced before anybody needs it, one that hangs when it was asked for a worker in vain; its workers go on.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import multiprocessing.forkserver
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, cast

from app.errors import LabError
from app.monitoring.log_lines import about
from app.monitoring.log_setup import set_up_logging
from app.trial.robots import ROBOTS, make_robot
from app.worker.messages import ControlsState, Stop, WorkerCommand, WorkerReport, WorkerSpec
from study.parts.errors import PartError

log = logging.getLogger(__name__)

STOP_WITHIN_S = 3.0
"""A worker that has not ended by then is killed."""
KILLED_WITHIN_S = 1.0
"""The end of a killed worker is believed by then, though its connection (which it may have given on) did not close."""
LOOK_EVERY_S = 0.25
IDLE_S = 2.0
"""A fork server that was asked for a worker and does nothing for so long hangs."""
BUSY_S = 20.0
"""One that works may still be making its imports, but not for ever."""


def worker_context(robot: str) -> ForkServerContext:
    """The fork server that workers come from. Call before the process has threads. Raises `LabError` for no robot."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # 27 actions and 6 goals: threads would only cost
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        ["app.worker.worker", "sim.view.scene", "sim.view.spectator", ROBOTS.module_of(robot)]
    )
    return context


def warm_up(context: ForkServerContext, robot: str) -> None:
    """Start the fork server and let it make its imports now, so that the first session does not wait for them.

    Raises `LabError` with one line for a robot that cannot be made: it is tried there, since this process must never
    load physics.
    """
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_try_robot, args=(robot, theirs))
    process.start()
    theirs.close()
    with ours:
        try:
            problem: str | None = ours.recv()
        except EOFError:
            process.join()
            problem = f"robot {robot!r} cannot be made: its process ended with {process.exitcode}"
    process.join()
    if problem is not None:
        raise LabError(problem)


@dataclass(frozen=True)
class VitalSigns:
    """Of a process: whether it was stopped from outside, and how much processor time it has had, in seconds."""

    stopped: bool
    cpu_s: float


def vital_signs(pid: int | None) -> VitalSigns | None:
    """From the kernel's table of processes; None on machines that have it elsewhere, and for no process."""
    try:
        line = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
        fields = line.rpartition(")")[2].split()
        return VitalSigns(fields[0] in "Tt", (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"))
    except (OSError, ValueError, IndexError):
        return None


class ForkServerHangs(LabError):
    """The process that workers come from gave none; it has been ended, and the next one comes from another."""


def tend_fork_server() -> None:
    """Start another fork server when the present one died: then its imports are made before a worker is needed."""
    multiprocessing.forkserver.ensure_running()


def _fork_server_pid() -> int | None:
    server = multiprocessing.forkserver._forkserver  # the module has no other way to name its process
    pid: int | None = getattr(server, "_forkserver_pid", None)
    return pid


class _ForkServerWatch:
    """Whether the fork server does something about a worker that it was asked for."""

    def __init__(self) -> None:
        self._asked_s = self._worked_s = time.monotonic()
        self._cpu_s = -1.0

    def hangs(self) -> bool:
        """Whether it will give none. To be asked a few times a second."""
        now_s, signs = time.monotonic(), vital_signs(_fork_server_pid())
        if signs is not None and signs.cpu_s != self._cpu_s:
            self._cpu_s, self._worked_s = signs.cpu_s, now_s
        is_idle = signs is not None and now_s - self._worked_s > IDLE_S
        return is_idle or now_s - self._asked_s > BUSY_S

    def end(self) -> None:
        """End it: the next worker comes from another one."""
        pid = _fork_server_pid()
        log.error("the process that workers come from hangs and is ended")
        if pid is not None:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


def _try_robot(robot: str, connection: Connection) -> None:
    """Make a robot and let it go, in a worker that only warms up; send the reason why it cannot be, or None."""
    try:
        make_robot(robot).close()
    except PartError as error:
        connection.send(str(error))
    except Exception as error:
        connection.send(f"robot {robot!r} cannot be made: {type(error).__name__}: {error}")
    else:
        connection.send(None)


def _entry(connection: Connection, spec: WorkerSpec) -> None:
    from app.worker.worker import run

    set_up_logging(spec.log_format)
    try:
        run(connection, spec)
    except Exception:
        log.exception("a worker ends because of an error", extra=about(participant=spec.setup.participant))
        raise SystemExit(1) from None


class _Outgoing:
    """Commands on their way to a worker, sent by a thread of their own.

    A worker that no longer reads (stopped, or hung in native code) blocks this thread and nothing else. Meanwhile
    only the newest state of the hands is kept: older ones would be stale anyway.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._waiting: list[WorkerCommand | None] = []
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="worker commands", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def put(self, command: WorkerCommand | None) -> None:
        """Queue a command; None ends the thread after what is queued."""
        with self._changed:
            last = self._waiting[-1] if self._waiting else None
            if isinstance(command, ControlsState) and isinstance(last, ControlsState) and (command.beat or last.beat):
                # A heartbeat only repeats: what was pressed, and whether it runs a tick, stays the input's.
                merged = replace(command, pressed=last.pressed, beat=last.beat) if command.beat else command
                self._waiting[-1] = merged
            else:
                self._waiting.append(command)
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._waiting:
                    self._changed.wait()
                command = self._waiting.pop(0)
            if command is None:
                return
            try:
                self._connection.send(command)
            except OSError:
                return  # the worker is gone; its exit is reported on its own


class WorkerProcess:
    """One live worker. Reports arrive through `on_report` in order; `on_exit` is called once, after the last.

    Attributes:
        pid: process id.
    """

    def __init__(
        self,
        context: ForkServerContext,
        spec: WorkerSpec,
        on_report: Callable[[WorkerReport], None],
        on_exit: Callable[[], None],
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._on_report = on_report
        self._on_exit = on_exit
        self._connection, theirs = context.Pipe()
        self._process = cast(BaseProcess, context.Process(target=_entry, args=(theirs, spec), daemon=True))
        self._theirs = theirs
        self._outgoing = _Outgoing(self._connection)
        self._exited = asyncio.Event()

    @property
    def pid(self) -> int | None:
        """Process id, None before `start`."""
        return self._process.pid

    async def start(self) -> None:
        """Start the process and listen to it. Raises `ForkServerHangs`, or what the machine says."""
        starting = asyncio.ensure_future(asyncio.to_thread(self._process.start))
        watch = _ForkServerWatch()
        try:
            while not (await asyncio.wait({starting}, timeout=LOOK_EVERY_S))[0]:
                if watch.hangs():
                    watch.end()  # which ends the waiting too
                    with suppress(Exception):
                        await starting
                    raise ForkServerHangs("the process that workers come from hung and was ended")
            await starting
        except BaseException:
            self._connection.close()  # a worker that came too late has nobody to serve, and ends
            raise
        finally:
            self._theirs.close()
        self._outgoing.start()
        self._loop.add_reader(self._connection.fileno(), self._read)

    def send(self, command: WorkerCommand) -> None:
        """Hand over a command; never blocks. A worker that is gone does not hear it (its exit is reported)."""
        if not self._exited.is_set():
            self._outgoing.put(command)

    async def stop(self) -> None:
        """End the process and wait for it; kill it if it does not obey."""
        self.send(Stop())
        try:
            await asyncio.wait_for(self._exited.wait(), STOP_WITHIN_S)
        except asyncio.TimeoutError:
            self.kill()
            await self._exited.wait()
        await asyncio.to_thread(self._process.join, KILLED_WITHIN_S)

    def kill(self) -> None:
        """End the process at once, whatever became of the fork server it is of."""
        if self._exited.is_set() or self.pid is None:
            return
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)
        self._loop.call_later(KILLED_WITHIN_S, self._ended)

    def vital_signs(self) -> VitalSigns | None:
        """What the machine says of the process."""
        return vital_signs(self.pid)

    def _read(self) -> None:
        try:
            while self._connection.poll():
                report: Any = self._connection.recv()
                self._on_report(report)
        except (EOFError, OSError):
            self._ended()

    def _ended(self) -> None:
        """Nothing more will come of it."""
        if self._exited.is_set():
            return
        self._loop.remove_reader(self._connection.fileno())
        self._outgoing.put(None)
        self._connection.close()
        self._exited.set()
        self._on_exit()
