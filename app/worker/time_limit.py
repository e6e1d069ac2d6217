"""How long a part may think in a live trial: 100 ms of the half second that a tick has.

A timer's signal interrupts whatever Python code is running; code that never comes back from a library in C is ended
with its worker (`app.session.worker_link`). Time in which the machine ran something else does not count: a part is not
to blame for a busy machine.
"""

from __future__ import annotations

import signal
import threading
import time
from contextlib import AbstractContextManager
from pathlib import Path
from types import FrameType

from app.trial.reasoning import TookTooLong

DECIDE_WITHIN_S = 0.1
_SCHEDSTAT = Path("/proc/self/schedstat")
"""Linux: time on a processor, time waiting for one (nanoseconds), slices. Elsewhere all time counts."""


class TimeLimit(AbstractContextManager["TimeLimit"]):
    """Raises `TookTooLong` inside, or at its end at the latest. One at a time.

    Only a process's main thread gets signals: elsewhere it raises at the end alone.
    """

    def __init__(self, limit_s: float = DECIDE_WITHIN_S) -> None:
        self._limit_s = limit_s
        self._began_s = 0.0
        self._has_signals = threading.current_thread() is threading.main_thread()

    def __enter__(self) -> TimeLimit:
        self._began_s = own_time_s()
        if not self._has_signals:
            return self
        self._handler = signal.signal(signal.SIGALRM, self._on_alarm)
        signal.setitimer(signal.ITIMER_REAL, self._limit_s, self._limit_s)
        return self

    def __exit__(self, *_: object) -> None:
        if not self._has_signals:
            self._check()
            return
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._handler)
        self._check()

    def _on_alarm(self, _signal: int, _frame: FrameType | None) -> None:
        self._check()

    def _check(self) -> None:
        if own_time_s() - self._began_s > self._limit_s:
            raise TookTooLong(f"took longer than {1000 * self._limit_s:g} ms")


def own_time_s() -> float:
    """A clock that stands still while this thread waits for a processor."""
    return time.monotonic() - _waited_s()


def _waited_s() -> float:
    try:
        return int(_SCHEDSTAT.read_text(encoding="ascii").split()[1]) / 1e9
    except (OSError, ValueError, IndexError):
        return 0.0
