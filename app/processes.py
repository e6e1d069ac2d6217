"""What the system says of a process, and what can be done to one: the same on Linux, macOS and Windows.

All through psutil, which asks each system in its own way. A process that is gone, or nobody's to look at, is None or
left alone, never an error: it may end while one asks.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import Any

import psutil


@dataclass(frozen=True)
class VitalSigns:
    """Of a process: whether it was stopped from outside, and how much processor time it has had, in seconds."""

    stopped: bool
    cpu_s: float


def vital_signs(pid: int | None) -> VitalSigns | None:
    """What the system says; None of a process that is gone, and of none."""
    if pid is None:
        return None
    try:
        process = psutil.Process(pid)
        with process.oneshot():
            times = process.cpu_times()
            stopped = process.status() in (psutil.STATUS_STOPPED, psutil.STATUS_TRACING_STOP)
    except psutil.Error:
        return None
    return VitalSigns(stopped, times.user + times.system)


def kill(pid: int) -> None:
    """End a process at once, in whatever it hangs."""
    with contextlib.suppress(psutil.Error):
        psutil.Process(pid).kill()


def step_back(niceness: int) -> None:
    """Let others have the processor before this process. `niceness`: from 0 to 19, as Unix counts; Windows knows one
    step, below normal."""
    own = psutil.Process()
    with contextlib.suppress(psutil.Error):
        own.nice(getattr(psutil, "BELOW_NORMAL_PRIORITY_CLASS", niceness))


@dataclass(frozen=True)
class Figures:
    """What a process takes: memory in bytes, processor time in seconds, open files, and when it began."""

    resident_bytes: int
    virtual_bytes: int
    cpu_s: float
    open_files: int
    began_unix_s: float


def own_figures() -> Figures:
    """Of this process. `open_files` are handles of every kind on Windows."""
    own: Any = psutil.Process()
    with own.oneshot():
        memory, times = own.memory_info(), own.cpu_times()
        open_files = own.num_fds() if hasattr(own, "num_fds") else own.num_handles()
        return Figures(memory.rss, memory.vms, times.user + times.system, open_files, own.create_time())
