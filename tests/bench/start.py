"""Figures of beginnings: a lab until it is ready, a session until its robot is, and what a session takes of memory."""

from __future__ import annotations

import asyncio
import contextlib
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import psutil

from tests.bench.figure import Figure
from tests.support import lab_server
from tests.support.lab_server import LabServer
from tests.support.wire_client import invite, visit, worker_pids, write_study

STARTS = 3
SESSIONS = 5


def start_figures() -> Iterator[Figure]:
    """On pybullet, with the scene. What is imported was compiled and read before: the first lab is not counted."""
    with tempfile.TemporaryDirectory() as folder:
        study = write_study(Path(folder))
        options = ("--robot", "bullet", "--study", str(study))
        ready_s, lab_s = [], []
        for number in range(STARTS + 1):
            began_s = time.perf_counter()
            with lab_server.start(Path(folder) / f"data{number}", *options) as lab:
                ready_s.append(time.perf_counter() - began_s)
                times = psutil.Process(lab.process.pid).cpu_times()
                lab_s.append(times.user + times.system)
                if number == STARTS:
                    session_s, pss_mb = asyncio.run(_sessions(lab))
    ready, cpu = statistics.median(ready_s[1:]), statistics.median(lab_s[1:])
    yield Figure(
        "salab serve until it is ready, warm", f"{ready:.2f} s (CPU of the lab's process {cpu:.2f} s)", "0.8 s"
    )
    yield Figure("a session, from its page to its robot", f"{statistics.median(session_s):.2f} s", "0.3 s or less")
    yield Figure("memory of a further session (PSS)", f"{statistics.median(pss_mb):.0f} MB", "45 MB or less")


async def _sessions(lab: LabServer) -> tuple[list[float], list[float]]:
    """One after the other comes to its first trial and stays there: how long each robot took, and each process's share
    of memory at the end."""
    took_s = []
    async with contextlib.AsyncExitStack() as stack:
        for _ in range(SESSIONS):
            player = await stack.enter_async_context(visit(invite(lab)["link"]))
            await player.reach("trial_ready")
            began_s = time.perf_counter()
            await player.status("ready")
            took_s.append(time.perf_counter() - began_s)
        return took_s, [psutil.Process(pid).memory_full_info().pss / 1e6 for pid in worker_pids(lab)]
