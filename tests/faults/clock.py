"""A computer's clock that somebody sets, for one lab alone; the machine's own is never touched.

`python -m tests.faults.clock serve …` is `salab serve …` in a process whose time of day is off by what a file says, at
that moment. The clock that only goes forward is as it is everywhere, as it would be on a computer whose clock is set.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

VARIABLE = "SALAB_FALSE_CLOCK"
PROGRAM = ("-m", "tests.faults.clock")
"""What Python runs for `salab`."""


class FalseClock:
    """How far off the clock of one lab is. `set` takes effect at once, while the lab runs."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def set(self, by_s: float) -> None:
        """Set the lab's clock off by so many seconds."""
        whole = self._path.with_suffix(".new")
        whole.write_text(f"{by_s:+.0f}\n", encoding="ascii")
        whole.replace(self._path)

    def environment(self) -> dict[str, str]:
        """What the lab's process is started with."""
        return {VARIABLE: str(self._path)}


def main() -> None:
    """The lab, with a clock that is off."""
    path, right = Path(os.environ[VARIABLE]), time.time

    def wrong() -> float:
        return right() + float(path.read_text(encoding="ascii"))

    time.time = wrong
    from app.__main__ import main as salab  # not before: it keeps the clock that it finds

    salab()


if __name__ == "__main__":
    main()
