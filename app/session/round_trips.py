"""The time from the lab to a page and back, measured by the lab: a ping, and the pong that answers it.

One ping is on its way at a time. `measure` asks for several in a row, each sent when the one before has come back, for
a median that one slow message does not move. A ping of a measurement says how many follow, so that the page knows
when it is over.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable

from app.session.interfaces import Client
from app.wire import Ping, Pong

LOST_AFTER_S = 5.0
"""A ping of a measurement without an answer for this long is sent again."""


class RoundTrips:
    """Pings the participant's page."""

    def __init__(self, now_unix_s: Callable[[], float]) -> None:
        self._now_unix_s = now_unix_s
        self._number = 0
        self._sent_s: float | None = None
        self._left = 0
        self._found_ms: list[float] = []

    @property
    def median_ms(self) -> float | None:
        """Of the last measurement; None while it is under way and when there was none."""
        return statistics.median(self._found_ms) if self._found_ms and not self._left else None

    def probe(self, client: Client) -> None:
        """A single one, for a sign of life; a measurement that is under way goes on instead."""
        is_waiting = self._sent_s is not None and self._now_unix_s() - self._sent_s < LOST_AFTER_S
        if not (self._left and is_waiting):
            self._ping(client)

    def measure(self, client: Client, count: int) -> None:
        """Begin a measurement of `count` round trips; one that was under way is forgotten."""
        self._left, self._found_ms = count, []
        self._ping(client)

    def answered(self, client: Client, pong: Pong) -> float | None:
        """The page's answer: the round trip in ms, or None for an answer to an earlier ping."""
        if pong.n != self._number or self._sent_s is None:
            return None
        round_trip_ms = (self._now_unix_s() - self._sent_s) * 1000.0
        self._sent_s = None
        if self._left:
            self._found_ms.append(round_trip_ms)
            self._left -= 1
            if self._left:
                self._ping(client)
        return round_trip_ms

    def _ping(self, client: Client) -> None:
        self._number, self._sent_s = self._number + 1, self._now_unix_s()
        client.deliver(Ping(n=self._number, left=self._left - 1 if self._left else None))
