"""Figures of the whole stack in lockstep, over sockets and with every commit on disk: ticks, and bots' whole studies.

The lab runs as a user starts it, in processes of its own; all clients are one other process, this one. On two cores the
lab, its workers and the clients share what there is, and other programs too: the processor time of the lab's own
process, of all workers and of the clients stands beside the clock's.

Ticks are counted while everybody drives to and fro. A whole study is mostly forms and starts of workers: of the short
one that the tests drive, a third of a minute of ticks.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import resource
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import psutil

from app.simulated.bot import run_bot
from app.trial.robots import ROBOTS
from tests.bench.figure import Figure
from tests.support import lab_server
from tests.support.lab_server import LabServer
from tests.support.wire_client import SHORT, Player, invite, visit, write_study

SESSIONS = (1, 8)
TICKS = 1500
"""Of all sessions together, for the figure of a second."""
STUDIES = 16
"""Completed for the figure of a minute."""
ENDLESS = {**SHORT, "task_limit_s = 300 ": "task_limit_s = 0 ", "trial_limit_s = 1500 ": "trial_limit_s = 0 "}
TO_AND_FRO = ("[0,1,0]", "[0,-1,0]")


@dataclass(frozen=True)
class Took:
    """Seconds by the clock, and of processor time: the lab's own process, its workers, the clients."""

    wall_s: float
    lab_s: float
    workers_s: float
    clients_s: float

    def each(self, count: int) -> str:
        """Of the processors, in ms for each of so many."""
        parts = (self.lab_s, self.workers_s, self.clients_s)
        return "CPU: lab {:.2f}, worker {:.2f}, client {:.2f} ms".format(*(1e3 * part / count for part in parts))


def lockstep_figures() -> Iterator[Figure]:
    """Of each robot; studies on the one without physics."""
    for robot in reversed([name for name in ROBOTS.shipped if not ROBOTS.lacking(name)]):
        is_plain = robot == "kinematic"
        with _lab(robot) as lab:
            for sessions in SESSIONS:
                took = asyncio.run(driven(lab, sessions, TICKS))
                rate = f"{TICKS / took.wall_s:.0f} ticks/s ({took.each(TICKS)})"
                yield Figure(f"{robot}: {sessions} at once", rate, "1000 or more" if is_plain and sessions > 1 else "")
            for sessions in SESSIONS if is_plain else ():
                studies = STUDIES if sessions > 1 else 2
                took = asyncio.run(completed(lab, sessions, studies))
                rate = f"{60 * studies / took.wall_s:.0f} a minute ({took.each(studies)})"
                yield Figure(f"studies completed, {sessions} at once", rate, "150 or more" if sessions > 1 else "")


@contextlib.contextmanager
def _lab(robot: str) -> Iterator[LabServer]:
    with tempfile.TemporaryDirectory() as folder:
        study = write_study(Path(folder), ENDLESS)
        options = ("--robot", robot, "--pace", "lockstep", "--no-scene", "--study", str(study))
        with lab_server.start(Path(folder) / "data", *options) as lab:
            asyncio.run(run_bot(invite(lab)["link"]))  # what is made once is made
            yield lab


async def driven(lab: LabServer, sessions: int, ticks: int) -> Took:
    """Everybody in their first trial drives to and fro, for so many ticks together; nothing else is counted."""
    async with contextlib.AsyncExitStack() as stack:
        players = [await stack.enter_async_context(visit(invite(lab)["link"])) for _ in range(sessions)]
        await asyncio.gather(*(player.reach_trial() for player in players))
        before = _spent(lab)
        await asyncio.gather(*(_to_and_fro(player, ticks // sessions) for player in players))
        return _since(lab, before)


async def _to_and_fro(player: Player, ticks: int) -> None:
    """As little work for the client as can be: messages are put together by hand, and looked at no closer."""
    for number, direction in zip(range(ticks), itertools.cycle(TO_AND_FRO), strict=False):
        seq = player.seq + 1 + number
        await player.wire.send_raw(f'{{"type":"input","seq":{seq},"client_ms":0.0,"direction":{direction}}}')
        while '"type":"tick"' not in (frame := str(await player.wire.receive_raw())):
            if '"type":"error"' in frame and '"id":null' in frame:
                raise RuntimeError(frame)
    player.seq += ticks


async def completed(lab: LabServer, at_once: int, studies: int) -> Took:
    """Bots complete whole studies, forms and starts of workers included."""
    links = [invite(lab)["link"] for _ in range(studies)]

    async def one_after_the_other() -> None:
        while links:
            await run_bot(links.pop())

    before = _spent(lab)
    await asyncio.gather(*(one_after_the_other() for _ in range(at_once)))
    return _since(lab, before)


def _spent(lab: LabServer) -> Took:
    """So far. Workers are the fork server's children, which it waits for when they have ended."""
    process = psutil.Process(lab.process.pid)
    own, workers_s = process.cpu_times(), 0.0
    for child in process.children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            times = child.cpu_times()
            workers_s += times.user + times.system + times.children_user + times.children_system
    used = resource.getrusage(resource.RUSAGE_SELF)
    return Took(time.perf_counter(), own.user + own.system, workers_s, used.ru_utime + used.ru_stime)


def _since(lab: LabServer, before: Took) -> Took:
    now = _spent(lab)
    return Took(*(getattr(now, each.name) - getattr(before, each.name) for each in fields(Took)))
