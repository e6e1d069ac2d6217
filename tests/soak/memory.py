"""How much memory the lab's web process has over time, and whether it keeps growing."""

from __future__ import annotations

import asyncio
import contextlib
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tests.faults import processes

SAMPLE_EVERY_S = 5.0
FLAT = 0.05
"""How far from the mean any sample may be, once the lab is warm."""
BAR = 40


@dataclass(frozen=True)
class Sample:
    """One look: seconds since the run began, bytes of the web process that are no file's, and which process it was."""

    at_s: float
    own_bytes: int
    pid: int


class Curve:
    """Looks at one process every few seconds, whichever it is then."""

    def __init__(self, pid: Callable[[], int]) -> None:
        self.samples: list[Sample] = []
        self._pid = pid
        self._began_s = time.monotonic()

    async def look(self) -> None:
        """Until it is cancelled."""
        while True:
            pid = self._pid()
            with contextlib.suppress(OSError):  # it is being started again
                self.samples.append(Sample(time.monotonic() - self._began_s, processes.own_bytes(pid), pid))
            await asyncio.sleep(SAMPLE_EVERY_S)


@dataclass(frozen=True)
class Flatness:
    """The window that counts, its mean, and by how much its lowest and highest sample differ from that, as shares."""

    from_s: float
    to_s: float
    mean_bytes: float
    below: float
    above: float

    @property
    def is_flat(self) -> bool:
        """Whether nothing is further from the mean than it may be."""
        return max(self.below, self.above) <= FLAT


def flatness(samples: Sequence[Sample], from_s: float, to_s: float) -> Flatness:
    """Of one process between two times. Raises `ValueError` where there is no sample, or there are two processes."""
    window = [sample for sample in samples if from_s <= sample.at_s <= to_s]
    pids = {sample.pid for sample in window}
    if len(pids) != 1:
        raise ValueError(f"{len(pids)} processes between {from_s:.0f} and {to_s:.0f} s; a curve is of one")
    mean = statistics.fmean(sample.own_bytes for sample in window)
    least, most = min(sample.own_bytes for sample in window), max(sample.own_bytes for sample in window)
    return Flatness(from_s, to_s, mean, 1.0 - least / mean, most / mean - 1.0)


def drawn(samples: Sequence[Sample], every_s: float) -> list[str]:
    """The curve as lines of text, one for each stretch of time."""
    most = max((sample.own_bytes for sample in samples), default=1)
    lines, next_s = [], 0.0
    for sample in samples:
        if sample.at_s >= next_s:
            bar = "#" * round(BAR * sample.own_bytes / most)
            lines.append(f"  {sample.at_s / 60:5.1f} min {sample.own_bytes / 2**20:7.1f} MB  {bar}")
            next_s = sample.at_s + every_s
    return lines
