"""The scripted people of a run, from outside: as many processes as they take, and what these cost."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import TracebackType

from app.errors import LabError
from app.processes import vital_signs
from app.sizing.people import Newcomer, Told, live

PEOPLE_PER_PROCESS = 12
"""So many keep a process far from a whole core, so that they are late only when the machine is full."""
ENDS_WITHIN_S = 5.0


@dataclass
class _House:
    """One process and its people."""

    process: BaseProcess
    connection: Connection
    told: Told = field(default_factory=Told)
    invited: int = 0

    @property
    def room(self) -> int:
        """How many more fit."""
        return PEOPLE_PER_PROCESS - (self.invited - self.told.ended)


class Crowd:
    """People who drive. `invite` gives the links of so many more. Close it, or use `with`."""

    def __init__(self, invite: Callable[[int], Sequence[Newcomer]], cores: Sequence[int] = ()) -> None:
        self._invite = invite
        self._cores = tuple(cores)
        self._houses: list[_House] = []
        self._context = multiprocessing.get_context("spawn")

    def __enter__(self) -> Crowd:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End them all."""
        for house in self._houses:
            house.connection.close()
        for house in self._houses:
            house.process.join(ENDS_WITHIN_S)
            if house.process.is_alive():
                house.process.kill()
                house.process.join()
        self._houses.clear()

    def keep(self, count: int) -> Told:
        """Hear how they are, and have so many under way: whoever has come to the end is replaced. Raises `LabError`
        when a process of theirs has ended."""
        for house in self._houses:
            self._hear(house)
        wanted = count - sum(house.invited - house.told.ended for house in self._houses)
        for newcomer in self._invite(wanted) if wanted > 0 else ():
            house = next((one for one in self._houses if one.room > 0), None) or self._another()
            house.connection.send(newcomer)
            house.invited += 1
        return self.told

    @property
    def told(self) -> Told:
        """All of them, as they were when they were last heard."""
        all_of_them = [house.told for house in self._houses]
        return Told(
            arrived=sum(told.arrived for told in all_of_them),
            under_way=sum(told.under_way for told in all_of_them),
            ended=sum(told.ended for told in all_of_them),
            failed=sum(told.failed for told in all_of_them),
            holds=sum(told.holds for told in all_of_them),
            scene_bytes=sum(told.scene_bytes for told in all_of_them),
            problem=next((told.problem for told in all_of_them if told.problem), ""),
        )

    def cpu_s(self) -> tuple[float, ...]:
        """Processor time of each process, in seconds."""
        signs = (vital_signs(house.process.pid) for house in self._houses)
        return tuple(found.cpu_s if found else 0.0 for found in signs)

    def _another(self) -> _House:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=live, args=(theirs, self._cores), daemon=True)
        process.start()
        theirs.close()
        house = _House(process, ours)
        self._houses.append(house)
        return house

    @staticmethod
    def _hear(house: _House) -> None:
        try:
            while house.connection.poll():
                house.told = house.connection.recv()
        except (EOFError, OSError):
            raise LabError(f"the scripted people's process ended with {house.process.exitcode}") from None
