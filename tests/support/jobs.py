"""Jobs for other processes. They stand by themselves, so that a process that begins has little to import."""

from __future__ import annotations

import os
import time
from pathlib import Path

from app.errors import LabError


def fails_at_two(job: int) -> int:
    """Give the job back, except the second."""
    if job == 2:
        raise LabError("two")
    return job


def dies(job: int) -> None:
    """End the process as a crash would."""
    os._exit(9)


def tell_and_sleep(job: int) -> None:
    """Leave a file named after this process, then take longer than any test."""
    (Path(os.environ["TELL_PIDS_IN"]) / f"pid.{os.getpid()}").touch()
    time.sleep(600)
