"""Starting, hearing and ending worker processes, from the lab's event loop.

Workers come from a fork server (a process without threads), with the heavy imports made once, so a new worker is
ready in a fraction of a second and a crash in native code ends that worker alone. A worker that hangs holds up nobody
else: commands go out on a thread of their own, and the session ends a worker that no longer answers.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import threading
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
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


def worker_context(robot: str) -> ForkServerContext:
    """The fork server that workers come from. Call before the process has threads. Raises `LabError` for no robot."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # 27 actions and 6 goals: threads would only cost
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["app.worker.worker", "sim.scene", "sim.spectator", ROBOTS.module_of(robot)])
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

    def start(self) -> None:
        """Start the process and listen to it."""
        self._process.start()
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
            self._process.kill()
            await self._exited.wait()
        await asyncio.to_thread(self._process.join)

    def kill(self) -> None:
        """End the process at once."""
        if self._process.is_alive():
            self._process.kill()

    def _read(self) -> None:
        try:
            while self._connection.poll():
                report: Any = self._connection.recv()
                self._on_report(report)
        except (EOFError, ConnectionResetError, OSError):
            self._loop.remove_reader(self._connection.fileno())
            self._outgoing.put(None)
            self._connection.close()
            self._exited.set()
            self._on_exit()
