"""A clock for a session's record: it goes on evenly and never back, whatever becomes of the computer's own."""

from __future__ import annotations

import time
from collections.abc import Callable

JUMP_S = 1.0
"""By how much the computer's clock has to be set for that to be a jump; less is its usual drift."""


class SteadyClock:
    """The time of day as it was when the clock was made, and what has passed since then.

    The computer's clock may be set (by hand, by a time server, after sleep) while it runs: that moves nothing here, and
    `jump_s` tells it once. `not_before_unix_s` is the last time in the record: where the computer's clock stands before
    it, this one goes on from there.

    Attributes:
        offset_s: what is added to the monotonic clock, which all processes of a machine share until it is restarted.
    """

    def __init__(
        self,
        wall_unix_s: Callable[[], float] = time.time,
        monotonic_s: Callable[[], float] = time.monotonic,
        not_before_unix_s: float = 0.0,
    ) -> None:
        self._wall_unix_s, self._monotonic_s = wall_unix_s, monotonic_s
        self.offset_s = max(wall_unix_s(), not_before_unix_s) - monotonic_s()
        self._ahead_s = 0.0

    def now_unix_s(self) -> float:
        """The time, in seconds since 1970."""
        return self.offset_s + self._monotonic_s()

    def jump_s(self) -> float | None:
        """By how much the computer's clock was set since this was asked last, back is negative; None = it was not."""
        ahead_s = self._wall_unix_s() - self.now_unix_s()
        jumped_s = ahead_s - self._ahead_s
        if abs(jumped_s) < JUMP_S:
            return None
        self._ahead_s = ahead_s
        return jumped_s
