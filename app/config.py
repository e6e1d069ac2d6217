"""Every setting of the lab with its default, and the error all edges report.

What a *study* is made of stands in the study file (`study.design`); this is how the lab itself runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


class LabError(RuntimeError):
    """Something the lab cannot do; the message is one line that says what and what would help."""


@dataclass(frozen=True)
class LabConfig:
    """How one lab runs. The command line's options have the same names."""

    data_dir: Path = Path("data")
    """Folder of the database."""
    host: str = "127.0.0.1"
    """Address to listen on; anything but loopback is an explicit choice."""
    port: int = 8000
    """Port to listen on; 0 = any free one."""
    public_url: str | None = None
    """What links begin with when a proxy stands in front; None = http://host:port."""
    study_file: Path | None = None
    """The study to run; None = the paper's."""
    robot: Literal["bullet", "kinematic"] = "bullet"
    """Which robot moves."""
    pace: Literal["real_time", "lockstep"] = "real_time"
    """How new participants are paced unless the API says otherwise."""
    scene: bool = True
    """Whether real-time sessions have a 3-D scene."""
    heartbeat_ms: int = 100
    """How often a page says that it is there."""
    max_sockets_per_session: int = 8
    """More connections than this to one session are refused."""
    worker_restarts: int = 3
    """How often a crashed worker is replaced within one trial before the session is paused for the experimenter."""
