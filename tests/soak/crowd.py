"""Those who drive while the lab is soaked: so many at a time, and when one has finished the next comes."""

from __future__ import annotations

import asyncio

from study.flow.protocol import TERMINAL
from tests.faults.person import Person
from tests.faults.stage import Stage

LOOK_EVERY_S = 1.0


class Crowd:
    """`gone` are those who finished; `stage.people` those who drive."""

    def __init__(self, stage: Stage, size: int) -> None:
        self.gone: list[Person] = []
        self._stage = stage
        self._size = size

    @property
    def everybody(self) -> list[Person]:
        """Who was ever there."""
        return [*self.gone, *self._stage.people]

    async def keep_up(self) -> None:
        """Until it is cancelled: whoever has finished goes, and another comes."""
        people = self._stage.people
        while True:
            for person in tuple(people):
                if person.page is not None and person.page.state in TERMINAL:
                    people.remove(person)
                    self.gone.append(person)
                    await person.end()
            while len(people) < self._size:
                try:
                    await self._stage.arrive(drives=True)
                except Exception:  # the lab is being started again, or cannot write: they come a second later
                    break
            await asyncio.sleep(LOOK_EVERY_S)
