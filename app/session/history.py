"""What just happened in a session, kept in memory for those who look on: its last minute of ticks, its last events."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import TypeVar

from app.autonomy.interface import Explanation
from study.records import EventRow, TickRow

KEPT_TICKS = 120
"""One minute."""
KEPT_EVENTS = 50
RATE_OVER_S = 5.0
SHARE_OVER_TICKS = 20
MAX_SIGNALS = 2000
Row = TypeVar("Row")


class History:
    """The last rows of one session. Everything in it is on disk already.

    Attributes:
        ticks: the last minute of the phase that runs.
        explanations: what the arbiter said of each of them.
        events: the last events, whatever the phase.
        ticks_seen: how many ticks were ever added; who has seen `n` of them has missed the last `ticks_seen - n`.
        events_seen: the same for events.
    """

    def __init__(self, events: Iterable[EventRow] = ()) -> None:
        self.ticks: deque[TickRow] = deque(maxlen=KEPT_TICKS)
        self.explanations: deque[Explanation] = deque(maxlen=KEPT_TICKS)
        self.events: deque[EventRow] = deque(events, maxlen=KEPT_EVENTS)
        self.ticks_seen = 0
        self.events_seen = len(self.events)
        self._signals_s: deque[float] = deque(maxlen=MAX_SIGNALS)

    def add_tick(self, row: TickRow, explanation: Explanation) -> None:
        """A tick is on disk."""
        self.ticks.append(row)
        self.explanations.append(explanation)
        self.ticks_seen += 1

    def add_events(self, rows: Iterable[EventRow]) -> None:
        """Events are on disk."""
        for row in rows:
            self.events.append(row)
            self.events_seen += 1

    def forget_ticks(self) -> None:
        """The phase is over."""
        self.ticks.clear()
        self.explanations.clear()

    def heard(self, now_s: float) -> None:
        """The page said what the hands do (an input or a heartbeat)."""
        self._signals_s.append(now_s)

    def signals_per_s(self, now_s: float) -> float:
        """How often the page said so over the last five seconds."""
        return sum(1 for heard_s in self._signals_s if now_s - RATE_OVER_S < heard_s <= now_s) / RATE_OVER_S

    def driving_share(self) -> float | None:
        """Share of the last twenty ticks in which the person drove or pressed; None before the first."""
        last = list(self.ticks)[-SHARE_OVER_TICKS:]
        if not last:
            return None
        return sum(1 for row in last if row.user_x is not None or row.gripper_input is not None) / len(last)

    def ticks_since(self, seen: int) -> list[tuple[TickRow, Explanation]]:
        """The ticks that came after the `seen`-th, as far as they are kept, with what the arbiter said of them."""
        return _last(zip(self.ticks, self.explanations, strict=True), self.ticks_seen - seen)

    def events_since(self, seen: int) -> list[EventRow]:
        """The events that came after the `seen`-th, as far as they are kept."""
        return _last(self.events, self.events_seen - seen)


def _last(rows: Iterable[Row], count: int) -> list[Row]:
    """The last rows, so many; none for a count of 0."""
    return list(rows)[-count:] if count > 0 else []
