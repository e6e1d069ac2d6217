"""A computer's clock that somebody sets, for one lab alone: libfaketime, which the lab's processes load.

The machine's clock is never touched, nor is the clock that only goes forward (CLOCK_MONOTONIC).
"""

from __future__ import annotations

from pathlib import Path

from tests.faults.row import CannotRun

LIBRARIES = (
    "/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1",
    "/usr/lib/aarch64-linux-gnu/faketime/libfaketimeMT.so.1",
    "/usr/lib64/faketime/libfaketimeMT.so.1",
    "/usr/lib/faketime/libfaketimeMT.so.1",
)


class FalseClock:
    """How far off the clock of one lab is. `set` takes effect within a second, while the lab runs."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def set(self, by_s: float) -> None:
        """Set the lab's clock off by so many seconds."""
        self._path.write_text(f"{by_s:+.0f}\n", encoding="ascii")

    def environment(self) -> dict[str, str]:
        """What the lab's process is started with. Raises `CannotRun` without libfaketime."""
        library = next((path for path in LIBRARIES if Path(path).exists()), None)
        if library is None:
            raise CannotRun("libfaketime is not installed (Debian, Ubuntu: apt-get install faketime)")
        return {
            "LD_PRELOAD": library,
            "FAKETIME_TIMESTAMP_FILE": str(self._path),
            "FAKETIME_CACHE_DURATION": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",
            "DONT_FAKE_MONOTONIC": "1",
        }
