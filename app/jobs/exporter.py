"""The archive of the data that the dashboard downloads: made on request in a process of its own, one at a time.

It lies in the lab's data folder while the lab runs and goes with it, and when somebody is erased: it may hold what was
measured of them.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from app.errors import LabError
from app.jobs.export_job import EXCEL_SAFE, PILOT
from app.jobs.process import JobLost, run_job
from app.session.commands import NotNow
from study.export.placing import sweep_noted
from study.store import DataPlace, place_of

FOLDER = "export"


@dataclass(frozen=True)
class ExportStatus:
    """How far it is. `text` is the step under way, or why there is no archive; `rows` are of ticks."""

    state: Literal["none", "making", "made", "cannot"] = "none"
    text: str = ""
    step: int = 0
    of: int = 0
    made_utc: str | None = None
    include_pilot: bool = False
    excel_safe: bool = False
    bytes: int = 0
    rows: int = 0


def remove(data_dir: Path) -> None:
    """Remove what was made, and what exports that were killed have left, wherever that is."""
    shutil.rmtree(data_dir / FOLDER, ignore_errors=True)
    sweep_noted(data_dir)


def _another_name(archive: Path, own: Path) -> None:
    """The same file under another name; a copy on disks without such names (FAT)."""
    try:
        os.link(archive, own)
    except OSError:
        shutil.copyfile(archive, own)


class Exporter:
    """Makes one archive at a time. `now_utc` is asked when one is done."""

    def __init__(self, data: DataPlace | Path, now_utc: Callable[[], str]) -> None:
        self.status = ExportStatus()
        place = place_of(data)
        self.archive = place.folder / FOLDER / "export.zip"
        self._data_dir = place.folder
        self._environment = place.environment
        self._now_utc = now_utc
        self._task: asyncio.Task[None] | None = None
        self._turn = asyncio.Lock()

    def start(self, include_pilot: bool = False, excel_safe: bool = False) -> None:
        """Begin to make one. Raises `NotNow` while one is being made."""
        if self.status.state == "making":
            raise NotNow("An export is being made already.")
        self.status = ExportStatus("making", "Starting", include_pilot=include_pilot, excel_safe=excel_safe)
        self._task = asyncio.create_task(self._make(), name="export")

    async def finished(self) -> ExportStatus:
        """Wait until nothing is being made any more."""
        if self._task is not None:
            await asyncio.gather(self._task, return_exceptions=True)
        return self.status

    async def discard(self) -> None:
        """End what is under way and remove what was made, and what the work on it has left."""
        if self._task is not None:
            self._task.cancel()
        await self.finished()
        self.status = ExportStatus()
        await asyncio.to_thread(remove, self._data_dir)

    async def fresh(self, include_pilot: bool = False, excel_safe: bool = False) -> Path:
        """Make one for whoever waits for it, after those who came before; a file of its own, to be removed by them.

        Raises `LabError` with the reason when there is none.
        """
        async with self._turn:
            await self.finished()
            self.start(include_pilot, excel_safe)
            status = await self.finished()
            if status.state != "made":
                raise LabError(status.text or "The export was ended: somebody cancelled it, or was erased.")
            own = self.archive.with_name(f"{secrets.token_hex(8)}.zip")
            await asyncio.to_thread(_another_name, self.archive, own)
            return own

    @contextmanager
    def _ended(self) -> Iterator[None]:
        try:
            yield
        except asyncio.CancelledError:
            self.status = ExportStatus()
            raise
        except JobLost as lost:
            self.status = ExportStatus("cannot", f"The export's {lost}.")
        except Exception as error:
            self.status = ExportStatus("cannot", f"{type(error).__name__}: {error}")
            raise

    async def _make(self) -> None:
        wanted = {PILOT: self.status.include_pilot, EXCEL_SAFE: self.status.excel_safe}
        options = [option for option, is_wanted in wanted.items() if is_wanted]
        with self._ended():
            data_dir, archive = await asyncio.to_thread(self._places)
            arguments = (str(data_dir), str(archive), *options)
            end = await run_job("app.jobs.export_job", arguments, self._step, self._environment)
            if "cannot" in end:
                self.status = ExportStatus("cannot", end["cannot"])
            else:
                made = replace(self.status, state="made", text="", made_utc=self._now_utc())
                self.status = replace(made, **end["made"])

    def _places(self) -> tuple[Path, Path]:
        """Data folder and archive, whose folder is for the lab's eyes alone."""
        with contextlib.suppress(OSError):  # the job will say it
            self.archive.parent.mkdir(mode=0o700, exist_ok=True)
        return self._data_dir.resolve(), self.archive.resolve()

    def _step(self, said: dict[str, Any]) -> None:
        self.status = replace(self.status, **said)
