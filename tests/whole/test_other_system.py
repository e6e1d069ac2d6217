"""The lab where only what every system has is there: no fork, no `fcntl`, no `/proc`, none of Unix's signals.

This machine has them all; `tests/support/other_system.py` takes them away from the lab's own code.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from app.simulated.bot import run_bot
from tests.support import other_system
from tests.support.lab_server import ROOT, LabServer
from tests.support.wire_client import asked, invite, write_study

PROGRAM = ("-m", "tests.support.other_system", "app")
LIVE = ("--robot", "kinematic", "--no-scene")


@pytest.mark.slow
def test_every_module_can_be_imported_where_nothing_of_unix_is_there() -> None:
    command = [sys.executable, "-W", "error", "-m", "tests.support.other_system", "modules"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


@pytest.mark.slow
async def test_a_lab_without_a_fork_server_serves_a_whole_study_though_a_worker_is_killed(
    start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    lab = start_lab(*LIVE, "--study", str(write_study(tmp_path)), program=PROGRAM)
    killed: list[psutil.Process] = []

    def kill_the_first(said: str) -> None:
        if not killed and said.startswith("trial ("):
            killed.extend(spawned(lab))
            for process in killed:
                process.kill()

    report = await run_bot(invite(lab, pace="lockstep")["link"], say=kill_the_first)
    assert (report.surveys, report.findings, report.pages[-1]) == (3, [], "done")
    text = asked(lab, "GET", "metrics").text
    numbers = dict(line.rsplit(" ", 1) for line in text.splitlines() if not line.startswith("#"))
    assert killed and float(numbers["salab_worker_restarts_total"]) == 1
    assert float(numbers["process_resident_memory_bytes"]) > 1e7 and float(numbers["process_cpu_seconds_total"]) > 0.1
    assert "on Windows, who may read a file" in lab.log()


def spawned(lab: LabServer) -> list[psutil.Process]:
    """Its processes of sessions."""
    children = psutil.Process(lab.process.pid).children()
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


def test_what_is_taken_away_is_there_for_others() -> None:
    """Else the tests here would test nothing but a broken Python."""
    assert other_system.is_ours("app.worker.process") and not other_system.is_ours("psutil")
    assert "fcntl" in other_system.GONE_MODULES and "SIGKILL" in other_system.GONE_NAMES["signal"]
