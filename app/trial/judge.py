"""Whether the task under way is over, by the rules of `app.trial.verdicts`: what falls may come to rest first. Pure."""

from __future__ import annotations

from app.trial.values import CycleSetup
from app.trial.verdicts import Verdict, dropoff_verdict, pickup_verdict, practice_verdict
from sim.interface import WorldState


class Judge:
    """Watches the object of one cycle, a look a tick.

    Attributes:
        settling_ticks: for so many ticks the object of a dropoff has been out of the fingers; motion pauses meanwhile.
    """

    def __init__(self, cycle: CycleSetup, timeout_ticks: int) -> None:
        """`timeout_ticks`: how long an object is waited for that does not come to rest."""
        self._cycle, self._timeout_ticks = cycle, timeout_ticks
        self._loose_ticks = 0
        self.settling_ticks = 0

    def of_pickup(self, world: WorldState) -> Verdict | None:
        """None until the object is lifted or lost. One that rolls on and on is judged as it lies."""
        name = self._cycle.object
        loose = world.held != name and not world.object(name).settled
        self._loose_ticks = self._loose_ticks + 1 if loose else 0
        return pickup_verdict(self._cycle.scene, world, name, self._loose_ticks >= self._timeout_ticks)

    def of_dropoff(self, world: WorldState, fingers_busy: bool) -> Verdict | None:
        """None until the object has left the fingers and come to rest (or the wait ran out)."""
        scene, name = self._cycle.scene, self._cycle.object
        if world.held == name:
            self.settling_ticks = 0
            return None
        self.settling_ticks += 1
        timed_out = self.settling_ticks >= self._timeout_ticks
        if fingers_busy or not (world.object(name).settled or timed_out):
            return None
        if self._cycle.bin is None:
            return practice_verdict(scene, world, name)
        return dropoff_verdict(scene, world, name, self._cycle.bin)
