"""Starting, hearing and ending worker processes, from the lab's event loop.

Workers come from a fork server that was started before this process had threads, with the heavy imports made once, so a
new worker is ready in a fraction of a second and a crash in native code ends that worker alone.
"""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import os
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from typing import Any, cast

from app.worker_messages import Stop, WorkerCommand, WorkerReport, WorkerSpec

STOP_WITHIN_S = 3.0
"""A worker that has not ended by then is killed."""


def worker_context(robot: str) -> ForkServerContext:
    """The fork server that workers come from. Call before the process has threads."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # 27 actions and 6 goals: threads would only cost
    context = multiprocessing.get_context("forkserver")
    preload = ["app.worker", "sim.scene", "sim.bullet" if robot == "bullet" else "sim.kinematic"]
    context.set_forkserver_preload(preload)
    return context


def _entry(connection: Connection, spec: WorkerSpec) -> None:
    from app.worker import run

    run(connection, spec)


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
        self._exited = asyncio.Event()

    @property
    def pid(self) -> int | None:
        """Process id, None before `start`."""
        return self._process.pid

    def start(self) -> None:
        """Start the process and listen to it."""
        self._process.start()
        self._theirs.close()
        self._loop.add_reader(self._connection.fileno(), self._read)

    def send(self, command: WorkerCommand) -> None:
        """Hand over a command; a worker that is gone does not hear it (its exit is reported on its own)."""
        if self._exited.is_set():
            return
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self._connection.send(command)

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
            self._connection.close()
            self._exited.set()
            self._on_exit()
