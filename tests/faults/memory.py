"""What a page did and heard, with the time by this machine's monotonic clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from app.wire import Error, Submit, Tick
from tests.support.wire_client import Direction


@dataclass(frozen=True)
class Hands:
    """What the hands did from this moment on, whether or not the lab could hear of it."""

    at_s: float
    direction: Direction | None


@dataclass(frozen=True)
class HeardTick:
    """A tick that the lab said is on disk. `life` counts the lab's starts."""

    at_s: float
    life: int
    trial: int
    tick: Tick


@dataclass(frozen=True)
class Seen:
    """Something that somebody saw: a sign of the page, a line of the dashboard, an answer of the health route."""

    at_s: float
    kind: str
    name: str
    text: str = ""
    data: Any = None


@dataclass
class Memory:
    """Everything a page did and heard."""

    hands: list[Hands] = field(default_factory=lambda: [Hands(0.0, None)])
    presses: dict[int, str] = field(default_factory=dict)
    """By the number of the input."""
    ticks: list[HeardTick] = field(default_factory=list)
    sent: dict[str, Submit] = field(default_factory=dict)
    """What was handed in, by id."""
    acknowledged: dict[str, float] = field(default_factory=dict)
    refused: dict[str, Error] = field(default_factory=dict)
    seen: list[Seen] = field(default_factory=list)


def submitted_words(memory: Memory) -> dict[str, str]:
    """What was said in calls for help, by the id under which it was handed in."""
    return {identifier: str(given.data["text"]) for identifier, given in memory.sent.items() if given.step == "help"}
