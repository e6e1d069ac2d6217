"""What is asked for besides workers: whether a process can be started at all, and to prepare the scene.

Each blocks, and is asked on a thread of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection

from app.trial.robots import prepared_look
from app.worker.process_source import ProcessSource
from study.definition.sections import ViewSettings

START_WITHIN_S = 10.0
"""A fork server may have to be started anew, with its imports."""
BAKE_WITHIN_S = 300.0


def why_no_process(source: ProcessSource, within_s: float = START_WITHIN_S) -> str:
    """Why no process can be started for a session; "" when one was."""
    try:
        return (
            ""
            if _ask(source, _answer, within_s + source.allowance_s) == ""
            else "a process for a session gave no answer"
        )
    except EOFError:
        return "the process that sessions' processes come from has ended"  # the next try begins it anew
    except OSError as error:
        return f"a process for a session cannot be started: {error.strerror or error}"


def prepared_scene(source: ProcessSource, view: ViewSettings, within_s: float = BAKE_WITHIN_S) -> str:
    """Have the robot's look made ready where it is not; what is wrong with it, "" for nothing."""
    try:
        return _ask(source, partial(_prepare, view=view), within_s) or ""
    except (EOFError, OSError):
        return ""  # why is told by `why_no_process`; the first session makes it ready


def _ask(source: ProcessSource, target: Callable[[Connection], None], within_s: float) -> str | None:
    """What a process says, None for nothing in time."""
    ours, theirs = source.pipe(duplex=False)
    process = source.process(target, theirs)
    with ours:
        try:
            process.start()
        finally:
            theirs.close()
        try:
            said: str | None = ours.recv() if ours.poll(within_s) else None
        except EOFError:
            said = None
    process.kill()
    process.join()
    return said


def _answer(connection: Connection) -> None:
    connection.send("")


def _prepare(connection: Connection, view: ViewSettings) -> None:
    connection.send(prepared_look(view))
