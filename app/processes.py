"""What the system says of a process, and what can be done to one: the same on Linux, macOS and Windows.

All through psutil, which asks each system in its own way. A process that is gone, or nobody's to look at, is None or
left alone, never an error: it may end while one asks.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import psutil

from app import container


@dataclass(frozen=True)
class VitalSigns:
    """Of a process: whether it was stopped from outside, and how much processor time it has had, in seconds."""

    stopped: bool
    cpu_s: float


def vital_signs(pid: int | None) -> VitalSigns | None:
    """What the system says; None of a process that is gone, and of none."""
    return Watched(pid).signs() if pid is not None else None


class Watched:
    """A process that is looked at again and again: finding it is half of what looking at it takes."""

    def __init__(self, pid: int) -> None:
        self._process: psutil.Process | None = None
        with contextlib.suppress(psutil.Error):
            self._process = psutil.Process(pid)

    def signs(self) -> VitalSigns | None:
        """What the system says; None of a process that is gone."""
        if self._process is None:
            return None
        try:
            with self._process.oneshot():
                times = self._process.cpu_times()
                stopped = self._process.status() in (psutil.STATUS_STOPPED, psutil.STATUS_TRACING_STOP)
        except psutil.Error:
            return None
        return VitalSigns(stopped, times.user + times.system)


@contextlib.contextmanager
def without_collections() -> Iterator[None]:
    """Within it no garbage that lies in rings is looked for: for work that makes many values and keeps most of them,
    where the looking takes a fifth of the time. What there is at its end is not looked at afterwards either."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if was_enabled:
            gc.enable()


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


@dataclass(frozen=True)
class TreeBytes:
    """Memory of a process and of all that came from it. `own` and `others` are proportional set sizes where the system
    tells them (Linux), so that what is shared counts once; elsewhere what is each one's alone. `resident` is of all."""

    own: int
    others: int
    resident: int


def tree_cpu_s(pid: int) -> tuple[float, float]:
    """Processor time in seconds: of a process, and of all that came from it, those that have ended included where the
    system counts them (not on Windows)."""
    try:
        process = psutil.Process(pid)
        times, others = process.cpu_times(), process.children(recursive=True)
    except psutil.Error:
        return 0.0, 0.0
    own_s, others_s = times.user + times.system, _ended_cpu_s(times)
    for other in others:
        with contextlib.suppress(psutil.Error):
            found = other.cpu_times()
            others_s += found.user + found.system + _ended_cpu_s(found)
    return own_s, others_s


def _ended_cpu_s(times: Any) -> float:
    return float(getattr(times, "children_user", 0.0) + getattr(times, "children_system", 0.0))


def tree_bytes(pid: int) -> TreeBytes:
    """Memory, all of it 0 for a process that is gone."""
    sizes, resident = [0], 0
    try:
        process = psutil.Process(pid)
        tree = [process, *process.children(recursive=True)]
    except psutil.Error:
        return TreeBytes(0, 0, 0)
    for one in tree:
        size = 0
        with contextlib.suppress(psutil.Error):
            found: Any = one.memory_full_info()
            size, resident = getattr(found, "pss", found.uss), resident + found.rss
        sizes.append(size)
    return TreeBytes(sizes[1], sum(sizes[2:]), resident)


def busy_cpu_s() -> float:
    """Processor time that the machine has spent on anything at all, since it was started, in seconds of one core."""
    times = psutil.cpu_times()
    waits = times.idle + getattr(times, "iowait", 0.0)
    twice = getattr(times, "guest", 0.0) + getattr(times, "guest_nice", 0.0)  # user has them in it
    return float(sum(times) - waits - twice)


def memory_bytes() -> int:
    """How much memory there is for this process: the machine's, or what its container is given of it."""
    total = int(psutil.virtual_memory().total)
    return min(total, container.given_memory_bytes() or total)


def free_bytes() -> int:
    """How much of it could be had now, by the system's own estimate."""
    available, given = int(psutil.virtual_memory().available), container.free_memory_bytes()
    return available if given is None else min(available, given)


def can_keep_to_cores() -> bool:
    """Whether processes can be kept to some of the cores; macOS has no such thing."""
    return hasattr(psutil.Process, "cpu_affinity")


def keep_to_cores(pid: int | None, cores: Sequence[int]) -> None:
    """Have a process (None = this one), and what comes from it later, run on these cores alone."""
    process: Any = psutil.Process(pid)
    with contextlib.suppress(psutil.NoSuchProcess):
        process.cpu_affinity(list(cores))
