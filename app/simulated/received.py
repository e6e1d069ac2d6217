"""What a scripted client was told is on disk, reported when the study is over, as static/wire/received.js does for the
pages: of each practice and trial the last tick, and how many submits and notes. The certificate compares it with what
the lab has."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from app.wire import Ack, Page, Tick

NOTE = "received"
_DRIVEN = ("practice", "trial")


@dataclass
class Received:
    """The count of one client."""

    acknowledged: int = 0
    ticks: dict[str, int] = field(default_factory=dict)
    _phase: str = ""

    def hear(self, message: object) -> None:
        """Whatever the lab says."""
        if isinstance(message, Ack):
            self.acknowledged += 1
        elif isinstance(message, Page) and message.state in _DRIVEN:
            self._phase = f"{message.state} {message.trial}"
        elif isinstance(message, Tick) and self._phase:
            self.ticks[self._phase] = max(self.ticks.get(self._phase, 0), message.tick + 1)

    def report(self) -> dict[str, Any]:
        """The note's data."""
        return {"acknowledged": self.acknowledged, "ticks": dict(self.ticks)}
