"""The report of the data so far, made on request in a process of its own: sessions go on as if nothing was.

It lies in the lab's data folder while the lab runs and goes with it. It goes, too, when somebody is erased: it may hold
what was measured of them.
"""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from app.jobs.process import JobLost, run_job
from app.report.job import WORK_PREFIX
from app.session.commands import NotNow
from study.store import DataPlace, place_of

FOLDER = "report"
PAGE = "report.html"
"""As `study.analysis.report` names it, which is not imported here: it loads the statistics and the plotting."""


@dataclass(frozen=True)
class ReportStatus:
    """How far it is. `text` is the step under way, or why there is no report."""

    state: Literal["none", "making", "made", "cannot"] = "none"
    text: str = ""
    step: int = 0
    of: int = 0
    made_utc: str | None = None
    participants: int = 0
    trials: int = 0
    figures: tuple[tuple[str, str], ...] = ()
    """(name, title)"""


def remove(data_dir: Path) -> None:
    """Remove what was made, and what jobs that were killed have left: both may hold what was measured of somebody."""
    for folder in (data_dir / FOLDER, *data_dir.glob(f"{WORK_PREFIX}*")):
        shutil.rmtree(folder, ignore_errors=True)


class Reporter:
    """Makes one report at a time. `now_utc` is asked when one is done."""

    def __init__(self, data: DataPlace | Path, now_utc: Callable[[], str]) -> None:
        self.status = ReportStatus()
        place = place_of(data)
        self.folder = place.folder / FOLDER
        self._data_dir = place.folder
        self._environment = place.environment
        self._now_utc = now_utc
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to make one. Raises `NotNow` while one is being made."""
        if self.status.state == "making":
            raise NotNow("The report is being made already.")
        self.status = ReportStatus("making", "Starting")
        self._task = asyncio.create_task(self._make(), name="report")

    async def finished(self) -> ReportStatus:
        """Wait until nothing is being made any more."""
        if self._task is not None:
            await asyncio.gather(self._task, return_exceptions=True)
        return self.status

    async def discard(self) -> None:
        """End what is under way and remove what was made, and what the work on it has left."""
        if self._task is not None:
            self._task.cancel()
        await self.finished()
        self.status = ReportStatus()
        await asyncio.to_thread(remove, self._data_dir)

    async def _make(self) -> None:
        arguments = (str(self._data_dir.resolve()), str(self.folder.resolve()))
        try:
            self.status = self._end(await run_job("app.report.job", arguments, self._step, self._environment))
        except JobLost as lost:
            self.status = ReportStatus("cannot", f"The report's {lost}.")

    def _step(self, said: dict[str, Any]) -> None:
        self.status = replace(self.status, **said)

    def _end(self, said: dict[str, Any]) -> ReportStatus:
        """What is said at the end of the work."""
        if "cannot" in said:
            return ReportStatus("cannot", said["cannot"])
        made = dict(said["made"])
        figures = tuple((figure["name"], figure["title"]) for figure in made.pop("figures"))
        return ReportStatus("made", made_utc=self._now_utc(), figures=figures, **made)
