"""Every setting of the lab with its default.

What a *study* is made of stands in the study file (`study.definition.study`); this is how the lab itself runs.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from urllib.parse import urlsplit

from app.errors import LabError
from app.limits import Limits
from app.monitoring.log_lines import LogFormat
from study.store import DataPlace

Pace = Literal["real_time", "lockstep"]
"""`real_time`: a tick every half a second. `lockstep`: one whenever its input arrives."""
StartMethod = Literal["auto", "forkserver", "spawn"]
"""How processes of sessions begin: from a `forkserver` that has made the imports, or by `spawn`, each anew."""
LOOPBACK = ("127.0.0.1", "::1", "localhost")
EVERY_ADDRESS = ("", "0.0.0.0", "::")
OWN_PATHS = frozenset(
    {"api", "d", "dashboard", "docs", "join", "openapi.json", "p", "s", "static", "static-offline-docs"}
)
"""First parts of the lab's own paths: no prefix may begin with one, or nobody could tell them apart."""
_SEGMENT = re.compile(r"[A-Za-z0-9._~-]+")


def public_url(text: str | None, host: str) -> str | None:
    """What links begin with, without a slash at its end; None = the address the lab listens on.

    Raises `LabError` for what no link can begin with.
    """
    if not text:
        if host in EVERY_ADDRESS:
            raise LabError(
                f"--host {host or repr(host)} listens on every address of this machine, which says nothing a link "
                "could begin with: add --public-url, such as https://lab.example"
            )
        return None
    parts = urlsplit(text)
    segments = [segment for segment in parts.path.split("/") if segment]
    wrong = None
    if parts.scheme not in ("http", "https") or not parts.hostname or "@" in parts.netloc:
        wrong = "must be an address such as https://lab.example or https://lab.example/study"
    elif parts.query or parts.fragment:
        wrong = "must end with the host or a path, without ? and #"
    elif not all(_SEGMENT.fullmatch(segment) for segment in segments) or ".." in segments:
        wrong = "may have letters, digits and . _ ~ - in its path"
    elif segments and segments[0] in OWN_PATHS:
        wrong = f"has a path that begins like one of the lab's own: {', '.join(sorted(OWN_PATHS))}"
    if wrong:
        raise LabError(f"--public-url {text}: {wrong}")
    return "/".join([f"{parts.scheme}://{parts.netloc}", *segments])


@dataclass(frozen=True)
class LabConfig:
    """How one lab runs. The command line's options have the same names."""

    data_dir: Path = Path("data")
    """Folder of the database, or of the lab's own files where the database is on a server."""
    database_url: str | None = field(default=None, repr=False)
    """Address of a PostgreSQL database; None = one in the folder."""
    host: str = "127.0.0.1"
    """Address to listen on; anything but loopback is an explicit choice."""
    port: int = 8000
    """Port to listen on; 0 = any free one."""
    public_url: str | None = None
    """What links begin with when a proxy stands in front, with a path or without; None = http://host:port."""
    study_file: Path | None = None
    """The study to run; None = the paper's."""
    trust: bool = False
    """Whether code in files beside the study file may run, and code that stored studies hold from such files."""
    robot: str | None = None
    """Which robot moves: a name in `app.trial.robots.ROBOTS`, or one that an installed package registers; None =
    `bullet`, or `mujoco` where pybullet is not installed."""
    pace: Pace = "real_time"
    """How new participants are paced unless the API says otherwise."""
    scene: bool = True
    """Whether real-time sessions have a 3-D scene."""
    log_format: LogFormat = "text"
    """What the lines of the log on standard error are: `text`, or an object of `json` each."""
    start_method: StartMethod = "auto"
    """How processes of sessions begin: `forkserver` is quick, `spawn` takes seconds for each and works on every system;
    `auto` takes the first on Linux and the second elsewhere."""
    heartbeat_ms: int = 100
    """How often a page says that it is there."""
    trusted_proxies: tuple[str, ...] = ()
    """Addresses or networks of proxies whose word on who asks is believed; with a public URL, this machine's own."""
    limits: Limits = field(default_factory=Limits)
    """What a client may cost the lab at most: the table below."""
    capacity: int | None = None
    """How many people at once the lab takes before its open link asks others to come back and the dashboard warns; 0 =
    no bound, None = what `salab bench sessions` found for this data folder, if anything."""
    unsaved_pause_s: float = 60.0
    """A session that cannot be saved, or gets no process, for this long, in seconds, is paused; before, it goes on by
    itself."""
    worker_restarts: int = 3
    """How often a crashed worker is replaced within one trial before the session is paused for the experimenter."""

    @property
    def data(self) -> DataPlace:
        """Where the data are."""
        return DataPlace(self.data_dir, self.database_url)
