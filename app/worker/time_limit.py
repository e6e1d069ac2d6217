"""How long a part may think in a live trial: 100 ms of the half second that a tick has.

A timer interrupts whatever Python code is running; code that never comes back from a library in C is ended
with its worker (`app.session.worker_link`). Time in which the machine ran something else does not count: a part is not
to blame for a busy machine.
"""

from __future__ import annotations

import _thread
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from types import FrameType

from app.trial.reasoning import TookTooLong

DECIDE_WITHIN_S = 0.1
_SCHEDSTAT = "/proc/self/schedstat"
"""Linux: time on a processor, time waiting for one (nanoseconds), slices. Elsewhere all time counts."""


class TimeLimit(AbstractContextManager["TimeLimit"]):
    """Raises `TookTooLong` inside, or at its end at the latest. One at a time.

    Only a process's main thread gets signals: elsewhere it raises at the end alone.
    """

    def __init__(self, limit_s: float = DECIDE_WITHIN_S) -> None:
        self._limit_s = limit_s
        self._began_s = self._waited_s = 0.0
        self._alarm: _Timer | _Watchdog | None = None

    def __enter__(self) -> TimeLimit:
        self._began_s, self._waited_s = time.monotonic(), _waited_s()
        if threading.current_thread() is threading.main_thread():
            self._alarm = (_Timer if hasattr(signal, "setitimer") else _Watchdog)(self._limit_s, self._check)
            self._alarm.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._alarm is not None:
            self._alarm.stop()
        self._check()

    def _check(self) -> None:
        lasted_s = time.monotonic() - self._began_s
        if lasted_s > self._limit_s and lasted_s - (_waited_s() - self._waited_s) > self._limit_s:
            raise TookTooLong(f"took longer than {1000 * self._limit_s:g} ms")


class _Timer:
    """Has `check` called in the main thread, again and again, by the system's timer."""

    def __init__(self, every_s: float, check: Callable[[], None]) -> None:
        self._every_s = every_s
        self._check = check

    def start(self) -> None:
        self._before = signal.signal(signal.SIGALRM, self._on_alarm)
        signal.setitimer(signal.ITIMER_REAL, self._every_s, self._every_s)

    def stop(self) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._before)

    def _on_alarm(self, _signal: int, _frame: FrameType | None) -> None:
        self._check()


class _Watchdog:
    """The same where the system has no such timer (Windows): a thread has Python believe in a Ctrl+C. It interrupts no
    sleep. A Ctrl+C that somebody pressed goes where it would have gone."""

    def __init__(self, every_s: float, check: Callable[[], None]) -> None:
        self._every_s = every_s
        self._check = check
        self._is_ours = False
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="time limit", daemon=True)

    def start(self) -> None:
        self._before = signal.signal(signal.SIGINT, self._on_interrupt)
        self._thread.start()

    def stop(self) -> None:
        self._over.set()
        self._thread.join()
        signal.signal(signal.SIGINT, self._before)

    def _run(self) -> None:
        while not self._over.wait(self._every_s):
            self._is_ours = True
            _thread.interrupt_main(signal.SIGINT)

    def _on_interrupt(self, number: int, frame: FrameType | None) -> None:
        if not self._is_ours:
            if callable(self._before):
                self._before(number, frame)
            return
        self._is_ours = False
        if not self._over.is_set():  # else `TimeLimit` checks by itself, and nothing may be raised on the way there
            self._check()


def own_time_s() -> float:
    """A clock that stands still while this thread waits for a processor."""
    return time.monotonic() - _waited_s()


def _waited_s() -> float:
    try:
        file = os.open(_SCHEDSTAT, os.O_RDONLY)
        try:
            return int(os.read(file, 100).split()[1]) / 1e9
        finally:
            os.close(file)
    except (OSError, ValueError, IndexError):
        return 0.0
