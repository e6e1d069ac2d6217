"""Writes a data folder and its export with the lab as it is now, to test later versions against.

For each robot: somebody who finished, somebody in mid-trial, somebody erased, a pilot and a demo participant.

    python -m tests.support.write_recorded_fixture FOLDER

A released schema gets a folder of its own once, and it is never written again.
"""

from __future__ import annotations

import asyncio
import shutil
import sqlite3
import sys
import tempfile
from contextlib import closing
from pathlib import Path

from app.simulated.bot import run_bot
from study.export.export import export_zip
from study.store import open_store
from tests.support import lab_server
from tests.support.lab_server import LabServer
from tests.support.wire_client import asked, invite, visit, write_study

ROBOTS = ("kinematic", "bullet")
TICKS_IN_MID_TRIAL = 6


async def _fill(lab: LabServer) -> None:
    finished = invite(lab, pace="lockstep", label="somebody")
    await run_bot(finished["link"])
    midway = invite(lab, pace="lockstep")
    erased = invite(lab, pace="lockstep")
    pilot = invite(lab, pace="lockstep", kind="pilot")
    for link in (midway["link"], erased["link"], pilot["link"], lab.demo_link):
        async with visit(link) as player:
            await player.reach_trial()
            for number in range(TICKS_IN_MID_TRIAL):
                await player.tick((1, 0, 0) if number % 3 else None)
    who = erased["participant"]
    asked(lab, "POST", f"participants/{who}/erase", {"confirm": who}).raise_for_status()


def write(folder: Path) -> None:
    """One folder per robot, with `lab.sqlite` and `export.zip`, all of it written through a running lab."""
    for robot in ROBOTS:
        with tempfile.TemporaryDirectory() as place:
            data = Path(place) / "data"
            study = write_study(Path(place))
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
            shutil.copy(data / "lab.sqlite", target / "lab.sqlite")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
