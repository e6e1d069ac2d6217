"""What long commands show while they run: one line that is rewritten, or a line now and then where nobody watches."""

from __future__ import annotations

import sys
import time
from typing import TextIO

WIDTH = 30
QUIET_EVERY_S = 20.0


class ProgressBar:
    """Counts `total` things done. Writes to stderr, so that results can be piped away."""

    def __init__(self, what: str, total: int, done: int = 0, out: TextIO | None = None) -> None:
        self._what = what
        self._total = total
        self._done = self._first = done
        self._out = out or sys.stderr
        self._live = self._out.isatty()
        self._started_s = self._said_s = time.monotonic()
        if self._live:
            self._draw()

    def step(self) -> None:
        """One more is done."""
        self._done += 1
        now_s = time.monotonic()
        if self._live or self._done == self._total or now_s - self._said_s >= QUIET_EVERY_S:
            self._said_s = now_s
            self._draw()

    def close(self) -> None:
        """Leave the line as it is."""
        if self._live:
            self._out.write("\n")

    def _draw(self) -> None:
        spent_s = time.monotonic() - self._started_s
        fresh = self._done - self._first
        left = f", about {spent_s / fresh * (self._total - self._done):.0f} s left" if fresh else ""
        filled = WIDTH * self._done // max(self._total, 1)
        bar = "#" * filled + "." * (WIDTH - filled)
        text = f"[{bar}] {self._done}/{self._total} {self._what}, {spent_s:.0f} s{left}"
        self._out.write(f"\r{text:<78}" if self._live else f"{text}\n")
        self._out.flush()
