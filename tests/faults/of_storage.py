"""The disk and the database: full, locked, read-only, deleted, corrupted; and the computer's clock."""

from __future__ import annotations

import asyncio
import shutil
import time

import numpy as np

from tests.faults import processes
from tests.faults.disk import locked
from tests.faults.row import TOLD_S, Fault, Setup, event, one_sign, trouble, unhealthy
from tests.faults.stage import Stage

FULL_S = 4.0
LOCKED_S = 3.0
LOCKED_LONG_S = 30.0
READ_ONLY_S = 4.0
DELETED_S = 4.0
STALLED = ("unsaved", "recovering", "held", "paused")
"""Signs that tell a participant that the robot stands still because of the lab."""


async def disk_full(stage: Stage) -> None:
    """Something else fills the disk, and is removed."""
    await asyncio.to_thread(stage.disk.fill, stage.pid)
    await asyncio.sleep(FULL_S)
    stage.disk.empty()
    stage.spent_s = FULL_S


async def _lock(stage: Stage, for_s: float) -> None:
    with locked(stage.database):
        await asyncio.sleep(for_s)
    stage.spent_s = for_s


async def lock(stage: Stage) -> None:
    """A backup tool, a reader with a transaction that writes."""
    await _lock(stage, LOCKED_S)


async def lock_long(stage: Stage) -> None:
    """Longer than SQLite waits."""
    await _lock(stage, LOCKED_LONG_S)


async def read_only(stage: Stage) -> None:
    """The kernel finds an error on the disk and lets nobody write any more; an operator repairs it."""
    began_s = time.monotonic()
    stage.disk.fail()
    await asyncio.sleep(READ_ONLY_S)
    silent = await _no_more_ticks(stage, stage.began_s + 1.0)
    await asyncio.to_thread(stage.lab.close)
    await asyncio.to_thread(stage.disk.repair)
    await stage.start()
    stage.spent_s = time.monotonic() - began_s
    assert silent, "ticks were acknowledged on a disk that takes no bytes"


async def _no_more_ticks(stage: Stage, after_s: float) -> bool:
    """Whether no tick was acknowledged after this moment, and none is within a second."""
    heard = [tick for tick in stage.person.memory.ticks if tick.at_s > after_s]
    return not heard and not await stage.person.ticks(1, 1.0)


async def deleted(stage: Stage) -> None:
    """Somebody removes the data folder of a lab that runs."""
    await asyncio.to_thread(shutil.rmtree, stage.data_dir)
    await asyncio.sleep(DELETED_S)
    assert await _no_more_ticks(stage, stage.began_s + 2.0), "ticks were acknowledged that lie in no file"
    rescued = [path for path in stage.folder.glob("*rescued*") if path.is_dir()]
    stage.notes.append(f"rescued: {[path.name for path in rescued]}")
    assert len(rescued) == 1, f"{len(rescued)} folders with what was recorded"
    (stage.record_dir,) = rescued


async def corrupted(stage: Stage) -> None:
    """Something writes over the file; then a worker dies, and the lab has to read what is there."""
    rng = np.random.default_rng(1)
    size = stage.database.stat().st_size
    with stage.database.open("r+b") as file:
        for place in range(4096, size, 4096):
            file.seek(place)
            file.write(rng.bytes(2048))
    (log,) = stage.data_dir.glob("lab.sqlite-wal")
    with log.open("r+b") as file:
        file.seek(32)
        file.write(rng.bytes(max(0, log.stat().st_size - 32)))
    processes.kill(processes.workers(stage.pid)[-1])
    await asyncio.sleep(DELETED_S)
    assert await _no_more_ticks(stage, stage.began_s + 2.0), "ticks were acknowledged on a file that cannot be read"
    await asyncio.to_thread(stage.lab.close)
    said = await stage.start_refused()
    lines = [row for row in said.splitlines()[1:] if row.strip()]
    assert said, "the lab started on a damaged file"
    assert len(lines) == 1 and "Traceback" not in said, f"the lab said at its start: {said[:500]}"
    stage.notes.append(f"the next start says: {lines[0]}")


async def _set_clock(stage: Stage, by_s: float) -> None:
    stage.clock.set(by_s)
    await asyncio.sleep(3.0)
    kinds = {seen.name for seen in stage.experimenter.seen if seen.kind == "event" and seen.at_s >= stage.began_s}
    stage.notes.append(f"events meanwhile: {sorted(kinds)}")


async def clock_forward(stage: Stage) -> None:
    """A time server sets it."""
    await _set_clock(stage, 3600.0)


async def clock_back(stage: Stage) -> None:
    """A time server sets it."""
    await _set_clock(stage, -3600.0)


SMALL_DISK = Setup(disk="small")
FALSE_CLOCK = Setup(is_clock_false=True)

ROWS = (
    Fault(
        "disk_full",
        "the disk is full for 4 s",
        disk_full,
        downtime_s=3.0,
        part="states",
        participant=(one_sign(STALLED, TOLD_S),),
        experimenter=(trouble(("full",), TOLD_S), unhealthy(TOLD_S)),
        setup=SMALL_DISK,
    ),
    Fault(
        "locked",
        "the database is locked for 3 s",
        lock,
        downtime_s=2.0,
        part="states",
        participant=(one_sign(STALLED, TOLD_S),),
        experimenter=(trouble(("locked", "slow"), TOLD_S),),
    ),
    Fault(
        "locked_long",
        "the database is locked for 30 s",
        lock_long,
        downtime_s=4.0,
        part="states",
        participant=(one_sign(STALLED, TOLD_S),),
        experimenter=(trouble(("locked", "slow"), TOLD_S), unhealthy(12.0)),
        is_long=True,
    ),
    Fault(
        "read_only",
        "the disk fails and is read-only; it is repaired and the lab started again",
        read_only,
        downtime_s=12.0,
        part="states",
        participant=(one_sign(STALLED, TOLD_S),),
        experimenter=(trouble(("read_only", "io"), TOLD_S), unhealthy(TOLD_S)),
        setup=Setup(disk="failing"),
    ),
    Fault(
        "deleted",
        "the data folder is deleted",
        deleted,
        downtime_s=0.0,
        part="states",
        participant=(one_sign(STALLED, TOLD_S),),
        experimenter=(trouble(("gone",), TOLD_S), unhealthy(TOLD_S)),
        goes_on=False,
        exports=False,
    ),
    Fault(
        "corrupted",
        "the database is written over, and a worker dies",
        corrupted,
        downtime_s=0.0,
        part="states",
        participant=(one_sign(STALLED, TOLD_S),),
        experimenter=(trouble(("corrupt",), TOLD_S + 2.0), unhealthy(TOLD_S + 2.0)),
        goes_on=False,
        exports=False,
        is_kept=False,
    ),
    Fault(
        "clock_forward",
        "the computer's clock is set forward by an hour",
        clock_forward,
        downtime_s=1.0,
        part="states",
        experimenter=(event("clock_set", 3.0),),
        setup=FALSE_CLOCK,
    ),
    Fault(
        "clock_back",
        "the computer's clock is set back by an hour",
        clock_back,
        downtime_s=1.0,
        part="states",
        experimenter=(event("clock_set", 3.0),),
        setup=FALSE_CLOCK,
    ),
)
