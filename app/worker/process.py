"""Starting, hearing and ending worker processes, from the lab's event loop.

A crash in native code ends its worker alone. A worker that hangs holds up nobody else: it is started and told on other
threads, and the session ends one that no longer answers.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection

from app.monitoring.log_lines import about
from app.monitoring.log_setup import set_up_logging
from app.processes import VitalSigns, Watched, kill
from app.worker.line import Line, packed, takes
from app.worker.messages import ControlsState, Stop, WorkerCommand, WorkerReport, WorkerSpec
from app.worker.process_source import ProcessesHang, ProcessSource, StartWatch

log = logging.getLogger(__name__)

STOP_WITHIN_S = 3.0
"""A worker that has not ended by then is killed."""
KILLED_WITHIN_S = 1.0
"""The end of a killed worker is believed by then, though its connection (which it may have given on) did not close."""
LOOK_EVERY_S = 0.25
"""How often a thread that waits looks whether it is still wanted."""


def _entry(connection: Connection, spec: WorkerSpec) -> None:
    from app.worker.worker import run

    set_up_logging(spec.log_format)
    try:
        run(Line(connection), spec)
    except Exception:
        log.exception("a worker ends because of an error", extra=about(participant=spec.setup.participant))
        raise SystemExit(1) from None


class _Outgoing:
    """Commands on their way to a worker: sent at once while the line takes them, else by a thread of their own.

    A worker that no longer reads (stopped, or hung in native code) blocks this thread and nothing else. Meanwhile
    only the newest state of the hands is kept: older ones would be stale anyway.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._waiting: list[WorkerCommand | None] = []
        self._is_sending = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="worker commands", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def put(self, command: WorkerCommand | None) -> None:
        """Queue a command; None ends the thread after what is queued."""
        with self._changed:
            if command is not None and not self._waiting and not self._is_sending:
                try:
                    if takes(self._connection):
                        self._connection.send_bytes(packed(command))
                        return
                except OSError:
                    return  # the worker is gone; its exit is reported on its own
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
                self._is_sending = False
                while not self._waiting:
                    self._changed.wait()
                command = self._waiting.pop(0)
                self._is_sending = True
            if command is None:
                return
            try:
                self._connection.send_bytes(packed(command))
            except OSError:
                return  # the worker is gone; its exit is reported on its own


class _Incoming:
    """Reports of a worker, heard by a thread of their own: for event loops that can only wait for sockets (Windows)."""

    def __init__(self, connection: Connection, hear: Callable[[WorkerReport], None], end: Callable[[], None]) -> None:
        self._connection = connection
        self._hear = hear
        self._end = end
        self._loop = asyncio.get_running_loop()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="worker reports", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Hear no more. The connection is closed when the thread does not wait there any more, and by the loop, which
        may be sending."""
        self._over.set()

    def _run(self) -> None:
        with suppress(RuntimeError):  # the loop has ended
            with suppress(EOFError, OSError):
                while not self._over.is_set():
                    if self._connection.poll(LOOK_EVERY_S):
                        self._loop.call_soon_threadsafe(self._hear, self._connection.recv())
            self._loop.call_soon_threadsafe(self._end)
            self._loop.call_soon_threadsafe(self._connection.close)
            return
        self._connection.close()


class WorkerProcess:
    """One live worker. Reports arrive through `on_report` in order; `on_exit` is called once, after the last.

    Attributes:
        pid: process id.
    """

    def __init__(
        self,
        source: ProcessSource,
        spec: WorkerSpec,
        on_report: Callable[[WorkerReport], None],
        on_exit: Callable[[], None],
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._on_report = on_report
        self._on_exit = on_exit
        self._source = source
        self._connection, self._theirs = source.pipe()
        self._process = source.process(_entry, self._theirs, spec)
        self._incoming: _Incoming | None = None
        self._watched: Watched | None = None
        self._outgoing = _Outgoing(self._connection)
        self._exited = asyncio.Event()

    @property
    def pid(self) -> int | None:
        """Process id, None before `start`."""
        return self._process.pid

    async def start(self) -> None:
        """Start the process and listen to it. Raises `ProcessesHang`, or what the machine says."""
        starting = asyncio.ensure_future(asyncio.to_thread(self._process.start))
        watch = StartWatch(self._source)
        try:
            while not (await asyncio.wait({starting}, timeout=LOOK_EVERY_S))[0]:
                if watch.hangs():
                    if watch.end():  # which ends the waiting too
                        with suppress(Exception):
                            await starting
                        raise ProcessesHang("the process that workers come from hung and was ended")
                    raise ProcessesHang("the system gave no process in time")
            await starting
        except BaseException:
            self._connection.close()  # a worker that came too late has nobody to serve, and ends
            raise
        finally:
            self._theirs.close()
        self._outgoing.start()
        try:
            self._loop.add_reader(self._connection.fileno(), self._read)
        except NotImplementedError:
            self._incoming = _Incoming(self._connection, self._heard, self._ended)
            self._incoming.start()

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
        kill(self.pid)
        self._loop.call_later(KILLED_WITHIN_S, self._ended)

    def vital_signs(self) -> VitalSigns | None:
        """What the machine says of the process."""
        if self._watched is None and self.pid is not None:
            self._watched = Watched(self.pid)
        return self._watched.signs() if self._watched is not None else None

    def _read(self) -> None:
        """One report, which has come: the loop calls again for the next."""
        try:
            report = self._connection.recv()
        except (EOFError, OSError):
            self._ended()
        else:
            self._on_report(report)

    def _heard(self, report: WorkerReport) -> None:
        if not self._exited.is_set():
            self._on_report(report)

    def _ended(self) -> None:
        """Nothing more will come of it."""
        if self._exited.is_set():
            return
        self._outgoing.put(None)
        if self._incoming is not None:
            self._incoming.stop()
        else:
            self._loop.remove_reader(self._connection.fileno())
            self._connection.close()
        self._exited.set()
        self._on_exit()
