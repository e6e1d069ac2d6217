"""Run as a process of its own by `test_migration`: brings copies of a data folder up, each killed at another statement.

    python -m tests.support.killed_migrations DATA PLACE KILLS

Prints how many statements there are; leaves PLACE/0, PLACE/1, ... as the killed ones left them.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import sqlalchemy as sql

from study.store import migration, open_store


def _bring_up(data: Path, step: Callable[[], None]) -> None:
    """Open the folder, with `step` called before each statement and once more when the copy is made."""
    copy_aside = migration.copy_aside

    def copied(path: Path, revision: str) -> Path:
        made = copy_aside(path, revision)
        step()
        return made

    migration.copy_aside = copied

    @sql.event.listens_for(sql.Engine, "before_cursor_execute")
    def _(*_: Any) -> None:
        step()

    @sql.event.listens_for(sql.Engine, "commit")
    def _(*_: Any) -> None:
        step()

    open_store(data, exclusive=True).close()


def _in_a_child(data: Path, last: int) -> int:
    """Bring a folder up in a process that kills itself at step `last`; the number of steps it took."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        steps = 0

        def step() -> None:
            nonlocal steps
            steps += 1
            if steps == last:
                os.kill(os.getpid(), signal.SIGKILL)

        _bring_up(data, step)
        os.write(writer, str(steps).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        told = pipe.read()
    os.waitpid(child, 0)
    return int(told) if told else last


if __name__ == "__main__":
    source, place, kills = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    shutil.copytree(source, place / "whole")
    steps = _in_a_child(place / "whole", -1)
    for number in range(kills):
        shutil.copytree(source, place / str(number))
        _in_a_child(place / str(number), 1 + number * (steps - 1) // (kills - 1))
    print(steps)
