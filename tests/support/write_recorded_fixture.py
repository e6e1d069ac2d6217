"""Writes a data folder and its export with the lab as it is now, to test later versions against.

For each robot: somebody who finished, somebody in mid-trial, somebody erased, a pilot and a demo participant.

    python -m tests.support.write_recorded_fixture FOLDER

A released schema gets a folder of its own once, and it is never written again.
"""

from __future__ import annotations

import asyncio
import gzip
import sqlite3
import sys
import tempfile
from contextlib import closing
from pathlib import Path

from app.simulated.bot import Bot, run_bot
from app.simulated.connection import enter, open_wire
from app.wire import Tick
from study.export.export import export_zip
from study.store import open_store
from tests.support import lab_server
from tests.support.lab_server import LabServer
from tests.support.wire_client import asked, invite, write_study

ROBOTS = ("kinematic",)
TICKS_IN_SECOND_CYCLE = 5
TWO_PICKUPS = {"pickups_per_trial = 3 ": "pickups_per_trial = 2 "}
"""Two cycles a trial, and practice: short, with a row in every table."""


async def _until_second_cycle(link: str) -> None:
    """Through practice and into the second cycle of the first trial, a few ticks far; then the page is gone."""
    async with open_wire(await enter(link), "bot", telemetry=True) as wire:
        bot, ticks = Bot(wire, None), 0
        while ticks < TICKS_IN_SECOND_CYCLE:
            message = await wire.receive()
            await bot._handle(message)
            if isinstance(message, Tick) and message.done_tasks >= 2 and message.status != "resetting":
                ticks += 1


async def _fill(lab: LabServer) -> None:
    finished = invite(lab, pace="lockstep", label="somebody")
    await run_bot(finished["link"])
    midway = invite(lab, pace="lockstep")
    erased = invite(lab, pace="lockstep")
    pilot = invite(lab, pace="lockstep", kind="pilot")
    for link in (midway["link"], erased["link"], pilot["link"], lab.demo_link):
        await _until_second_cycle(link)
    who = erased["participant"]
    asked(lab, "POST", f"participants/{who}/erase", {"confirm": who}).raise_for_status()


def write(folder: Path) -> None:
    """One folder per robot, with `lab.sqlite.gz` and `export.zip`, all of it written through a running lab."""
    for robot in ROBOTS:
        with tempfile.TemporaryDirectory() as place:
            data = Path(place) / "data"
            study = write_study(Path(place), TWO_PICKUPS)
            arguments = ("--robot", robot, "--pace", "lockstep", "--no-scene", "--study", str(study))
            with lab_server.start(data, *arguments) as lab:
                asyncio.run(_fill(lab))
            target = folder / robot
            target.mkdir(parents=True)
            with closing(sqlite3.connect(data / "lab.sqlite")) as database:
                database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
                database.execute("VACUUM")
            with open_store(data, must_exist=True) as store:
                export_zip(store, target / "export.zip", include_pilot=True)
            packed = gzip.compress((data / "lab.sqlite").read_bytes(), mtime=0)
            (target / "lab.sqlite.gz").write_bytes(packed)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
