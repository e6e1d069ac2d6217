"""The fingers of one cycle: what they were told, how long motion pauses for it, what they took or lost. Pure."""

from __future__ import annotations

from app.trial.values import EngineEvent, Press
from sim.interface import WorldState


class Fingers:
    """They begin open and empty.

    Attributes:
        busy_ticks: for so many ticks more they move, and motion pauses.
    """

    def __init__(self, takes_ticks: int) -> None:
        self._takes_ticks = takes_ticks
        self._told: Press = "open"
        self._let_go = False
        self._held: str | None = None
        self.busy_ticks = 0

    def press(self, button: Press | None) -> Press | None:
        """What a button has them do: nothing, while they are busy or were told so already."""
        if button is None or self.busy_ticks or button == self._told:
            return None
        self._told, self._let_go = button, button == "open"
        self.busy_ticks = self._takes_ticks
        return button

    def tick(self) -> None:
        """A tick has passed."""
        self.busy_ticks = max(self.busy_ticks - 1, 0)

    def look(self, world: WorldState, instructed: str) -> list[EngineEvent]:
        """What they took or lost since the last look."""
        before, self._held = self._held, world.held
        if world.held == before:
            return []
        if world.held is None:
            return [EngineEvent("released" if self._let_go else "slipped", {"object": before})]
        self._let_go = False
        if world.held != instructed:
            return [EngineEvent("wrong_object_grasped", {"object": world.held, "instructed": instructed})]
        return [EngineEvent("grasped", {"object": world.held})]
