"""Where the processes of sessions come from, and what to do when it gives none.

forkserver   a process without threads that has made the imports once: a worker in a fraction of a second   Linux
spawn        each process begins anew and makes its imports itself, which takes seconds            macOS, Windows

A fork server that died is replaced before anybody needs it, one that hangs when it was asked for a worker in vain.
macOS has fork servers, but its own libraries start threads that a fork does not survive.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Literal, cast, get_args

from app.config import StartMethod
from app.errors import LabError
from app.processes import kill, vital_signs
from app.trial.robots import ROBOTS, make_robot
from study.parts.errors import PartError

log = logging.getLogger(__name__)

IDLE_S = 2.0
"""A fork server that was asked for a worker and does nothing for so long hangs."""
BUSY_S = 20.0
"""One that works may still be making its imports, but not for ever."""
IMPORTS_S = 30.0
"""So much longer a process may take that makes its imports itself: 2 s on a quick machine, ten times that from a cold
disk with a virus scanner."""
PRELOADED = ("app.worker.worker",)
OF_VIEWS = ("sim.view.scene", "sim.view.spectator", "sim.view.ready")
BY_VISER = ("rich.panel", "rich.table", "rich._emoji_codes")
"""What viser imports when a server begins, for a banner that nobody sees: 50 ms of each session. A name that is not
there is passed by."""
READY = {"bullet": ("sim.bullet_ready",)}
"""What a robot has ready before processes are forked, whose memory they share."""
FIRST, LAST = "app.worker.uncollected", "app.worker.shared_memory"
"""What stands before and after the imports."""


class ProcessesHang(LabError):
    """No process came. Where a fork server was why, it has been ended, and the next process comes from another."""


@dataclass(frozen=True)
class ProcessSource:
    """Gives processes. Made by `process_source`.

    Attributes:
        method: how they begin.
        allowance_s: how much longer than from a fork server the first word of one may take.
    """

    method: Literal["forkserver", "spawn"]
    allowance_s: float
    _context: Any

    def pipe(self, duplex: bool = True) -> tuple[Connection, Connection]:
        """Two ends of a connection, of which one goes to a process."""
        ends: tuple[Connection, Connection] = self._context.Pipe(duplex)
        return ends

    def process(self, target: Callable[..., None], *arguments: object) -> BaseProcess:
        """A process that has not begun. It ends with this one."""
        return cast(BaseProcess, self._context.Process(target=target, args=arguments, daemon=True))

    def warm_up(self, robot: str) -> None:
        """Have a fork server make its imports now, so that the first session does not wait for them, and try the robot.

        Raises `LabError` with one line for a robot that cannot be made: it is tried there, since this process must
        never load physics. So it does where the temporary folder's name is too long for a socket, as on a cluster.
        """
        ours, theirs = self.pipe(duplex=False)
        process = self.process(_try_robot, robot, theirs)
        with _too_long_said():
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

    def tend(self) -> None:
        """Start another fork server when the present one died: then its imports are made before a worker is needed.

        Raises `LabError` as `warm_up` does.
        """
        if self.method == "forkserver":
            from multiprocessing import forkserver

            with _too_long_said():
                forkserver.ensure_running()


@contextlib.contextmanager
def _too_long_said() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if "AF_UNIX" not in str(error):
            raise
        raise LabError(
            f"{tempfile.gettempdir()}: too long a name for the sockets of processes; set TMPDIR to a shorter one, "
            "such as /tmp, or take --start-method spawn"
        ) from None


def process_source(robot: str, start_method: StartMethod = "auto", *, scene: bool = True) -> ProcessSource:
    """Where processes come from; `scene`: whether sessions have 3-D views. Call before this one has threads.

    Raises `LabError` for a method that this system does not have, and `PartError` for no robot.
    """
    of_views = (*OF_VIEWS, *BY_VISER) if scene else ()
    preloaded = [FIRST, *PRELOADED, *of_views, ROBOTS.module_of(robot), *READY.get(robot, ()), LAST]
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # 27 actions and 6 goals: threads would only cost
    known = multiprocessing.get_all_start_methods()
    if start_method not in ("auto", *known):
        choices = ", ".join(name for name in get_args(StartMethod) if name in ("auto", *known))
        raise LabError(f"--start-method {start_method}: this system has none; choose one of {choices}")
    has_good_one = "forkserver" in known and sys.platform != "darwin"
    if start_method == "spawn" or (start_method == "auto" and not has_good_one):
        return ProcessSource("spawn", IMPORTS_S, multiprocessing.get_context("spawn"))
    context: Any = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(preloaded)
    return ProcessSource("forkserver", 0.0, context)


class StartWatch:
    """Whether something is done about a process that was asked for."""

    def __init__(self, source: ProcessSource) -> None:
        self._source = source
        self._asked_s = self._worked_s = time.monotonic()
        self._cpu_s = -1.0

    def hangs(self) -> bool:
        """Whether none will come. To be asked a few times a second."""
        now_s, signs = time.monotonic(), vital_signs(self._fork_server())
        if signs is not None and signs.cpu_s != self._cpu_s:
            self._cpu_s, self._worked_s = signs.cpu_s, now_s
        is_idle = signs is not None and now_s - self._worked_s > IDLE_S
        return is_idle or now_s - self._asked_s > BUSY_S + self._source.allowance_s

    def end(self) -> bool:
        """End the fork server: the next process comes from another one. False where there is none to end."""
        pid = self._fork_server()
        if pid is None:
            return False
        log.error("the process that workers come from hangs and is ended")
        kill(pid)
        return True

    def _fork_server(self) -> int | None:
        if self._source.method != "forkserver":
            return None
        from multiprocessing import forkserver

        server = forkserver._forkserver  # the module has no other way to name its process
        pid: int | None = getattr(server, "_forkserver_pid", None)
        return pid


def _try_robot(robot: str, connection: Connection) -> None:
    """Make a robot and let it go, in a process that only warms up; send the reason why it cannot be, or None."""
    try:
        make_robot(robot).close()
    except PartError as error:
        connection.send(str(error))
    except Exception as error:
        connection.send(f"robot {robot!r} cannot be made: {type(error).__name__}: {error}")
    else:
        connection.send(None)
