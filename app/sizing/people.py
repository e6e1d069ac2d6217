"""Scripted people in a process of their own, so that what they cost is counted apart from the lab.

measuring ── Newcomer, Newcomer, … ──►┐                    each one a page, a heartbeat, 3-D views
          ◄── Told, every half second ┘                    the pipe's end is the end of them all
"""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection

from app.errors import LabError
from app.processes import keep_to_cores
from app.simulated.timed_bot import TimedPerson

TELL_EVERY_S = 0.5
MOST_OF_A_REASON = 300


@dataclass(frozen=True)
class Newcomer:
    """Somebody to begin: their links, and the near plane of each of their 3-D views."""

    link: str
    panel_link: str | None
    near_m: tuple[float, ...]


@dataclass(frozen=True)
class Told:
    """How the people of one process are doing. Counts are since the process began, but for those of now."""

    arrived: int = 0
    """Now: under way, and has driven a robot that all their views show."""
    under_way: int = 0
    """Now: begun and not ended."""
    ended: int = 0
    failed: int = 0
    """Of those that ended, the ones that could not go on."""
    holds: int = 0
    scene_bytes: int = 0
    problem: str = ""
    """Why the last one of them could not go on."""


def live(connection: Connection, cores: Sequence[int] = ()) -> None:
    """What the process does, until its other end is closed. `cores`: the ones it keeps to, all if none are named."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl+C is for whoever started us
    if cores:
        keep_to_cores(None, cores)
    asyncio.run(_People(connection).run())


class _People:
    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._people: set[TimedPerson] = set()
        self._past = Told()

    async def run(self) -> None:
        loop, coming = asyncio.get_running_loop(), asyncio.Queue[Newcomer | None]()
        threading.Thread(target=self._listen, args=(loop, coming), name="newcomers", daemon=True).start()
        telling, under_way = asyncio.create_task(self._tell()), set[asyncio.Task[None]]()
        while (newcomer := await coming.get()) is not None:
            task = asyncio.create_task(self._one(newcomer))
            under_way.add(task)
            task.add_done_callback(under_way.discard)
        for task in (telling, *under_way):
            task.cancel()
        await asyncio.gather(telling, *under_way, return_exceptions=True)

    def _listen(self, loop: asyncio.AbstractEventLoop, coming: asyncio.Queue[Newcomer | None]) -> None:
        while True:
            try:
                newcomer: Newcomer | None = self._connection.recv()
            except (EOFError, OSError):
                newcomer = None
            loop.call_soon_threadsafe(coming.put_nowait, newcomer)
            if newcomer is None:
                return

    async def _one(self, newcomer: Newcomer) -> None:
        person, problem = TimedPerson(newcomer.link, newcomer.panel_link, newcomer.near_m), ""
        self._people.add(person)
        try:
            await person.live()
        except (LabError, OSError, ValueError, AssertionError) as error:
            problem = f"{type(error).__name__}: {error}"[:MOST_OF_A_REASON]
        self._people.discard(person)
        self._past = self._with(self._past, person, problem)

    @staticmethod
    def _with(past: Told, person: TimedPerson, problem: str) -> Told:
        return Told(
            ended=past.ended + 1,
            failed=past.failed + bool(problem),
            holds=past.holds + (person.bot.holds if person.bot else 0),
            scene_bytes=past.scene_bytes + person.scene_bytes,
            problem=problem or past.problem,
        )

    async def _tell(self) -> None:
        while True:
            self._connection.send(self._now())
            await asyncio.sleep(TELL_EVERY_S)

    def _now(self) -> Told:
        past, people = self._past, tuple(self._people)
        return Told(
            arrived=sum(person.has_driven for person in people),
            under_way=len(people),
            ended=past.ended,
            failed=past.failed,
            holds=past.holds + sum(person.bot.holds for person in people if person.bot),
            scene_bytes=past.scene_bytes + sum(person.scene_bytes for person in people),
            problem=past.problem,
        )
