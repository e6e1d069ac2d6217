"""A job for other processes that says where it runs and then takes longer than any test."""

from __future__ import annotations

import os
import time
from pathlib import Path


def tell_and_sleep(job: int) -> None:
    """Leave a file named after this process."""
    (Path(os.environ["TELL_PIDS_IN"]) / f"pid.{os.getpid()}").touch()
    time.sleep(600)
