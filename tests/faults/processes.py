"""The processes of a lab, found below the one that was started, and what can be done to them: to them alone."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path

from tests.faults.row import CannotRun


def children(pid: int) -> list[int]:
    """The live processes that a process has started, oldest first."""
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(OSError):
            found += [int(child) for child in (task / "children").read_text().split()]
    return sorted(child for child in found if state_of(child) not in ("", "Z"))


def descendants(pid: int) -> list[int]:
    """Its children, and theirs."""
    found = children(pid)
    return [*found, *(one for child in found for one in descendants(child))]


def state_of(pid: int) -> str:
    """R, S, T, Z … as in proc(5); "" for none."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (OSError, IndexError):
        return ""


def command_of(pid: int) -> str:
    """What it runs, as one line."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    return ""


def fork_server(lab_pid: int) -> int:
    """The process that workers come from. Raises `CannotRun` when there is none."""
    for child in children(lab_pid):
        if "multiprocessing.forkserver" in command_of(child):
            return child
    raise CannotRun("the lab has no fork server")


def workers(lab_pid: int) -> list[int]:
    """The workers of the sessions, oldest first. They outlive the fork server that they came from."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and "multiprocessing.forkserver" in command_of(int(entry.name)):
            with contextlib.suppress(OSError, ValueError):
                state, parent, _, session = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
                if int(session) == lab_pid and int(parent) != lab_pid and state != "Z":
                    found.append(int(entry.name))
    return sorted(found)


def running(lab_pid: int, module: str) -> list[int]:
    """Children of the lab that run this module."""
    return [child for child in children(lab_pid) if module in command_of(child)]


def kill(pid: int) -> None:
    """As a crash or the kernel out of memory would."""
    os.kill(pid, signal.SIGKILL)


def stop(pid: int) -> None:
    """It hangs from now on."""
    os.kill(pid, signal.SIGSTOP)


def go_on(pid: int) -> None:
    """It hangs no more, if it still is."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGCONT)


def own_bytes(pid: int) -> int:
    """How much memory a process has that is no file's (PSS of anonymous pages), in bytes. Pages of files are left out:
    their share is less while others run who read the same files. Raises `OSError` for a process that is gone."""
    for row in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
        if row.startswith("Pss_Anon:"):
            return int(row.split()[1]) * 1024
    raise OSError(f"process {pid} has no memory")
