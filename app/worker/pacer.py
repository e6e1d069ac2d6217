"""Pacing by absolute deadlines: tick k is due at start + k · period, however long the work took.

Sleeping for "the rest of the period" drifts by the time the sleep itself is late. Here a late tick starts at once and
the next keeps its place on the grid; deadlines that have gone by altogether are skipped and counted, never run in a
burst.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Deadline:
    """A tick that is due: when, how late it is taken, and how many deadlines before it were missed."""

    due_s: float
    late_s: float
    missed: int


class Pacer:
    """Hands out the deadlines of a fixed grid. Owns no clock: callers pass `now_s` (monotonic seconds)."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._next_s: float | None = None

    def start(self, now_s: float) -> None:
        """Lay the grid: the first deadline is now."""
        self._next_s = now_s

    def stop(self) -> None:
        """Forget the grid; nothing is due until the next start."""
        self._next_s = None

    @property
    def running(self) -> bool:
        """Whether a grid is laid."""
        return self._next_s is not None

    def wait_s(self, now_s: float) -> float:
        """Seconds until the next deadline, 0 when it is due; infinite when stopped."""
        return math.inf if self._next_s is None else max(0.0, self._next_s - now_s)

    def take(self, now_s: float) -> Deadline | None:
        """The deadline that is due, or None. The next one is the first grid point after now."""
        if self._next_s is None or now_s < self._next_s:
            return None
        first_s, missed = self._next_s, int((now_s - self._next_s) // self.period_s)
        # Rounding may leave the quotient on the wrong side of a grid point.
        missed += int(first_s + (missed + 1) * self.period_s <= now_s) - int(first_s + missed * self.period_s > now_s)
        due_s = first_s + missed * self.period_s
        self._next_s = first_s + (missed + 1) * self.period_s
        return Deadline(due_s, now_s - due_s, missed)
