"""A trial without a server, docs/examples/09_drive_headless."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.lab_server import ROOT

pytestmark = pytest.mark.slow

EXAMPLE = ROOT / "docs" / "examples" / "09_drive_headless" / "drive.py"


def test_it_prints_what_happens_and_every_task_succeeds() -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", str(EXAMPLE)],
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    *lines, last = done.stdout.splitlines()
    assert [line.split()[2:5] for line in lines if " task " in line] == [
        ["task", f"{number}:", "pickup" if number % 2 else "dropoff"] for number in range(1, 7)
    ]
    assert last.startswith("6 of 6 tasks in ")
