"""Whether what happens in a session can be saved, and what becomes of the session while it cannot.

the disk does not do ──► pages and dashboard are told, the robot holds, what is in hand waits (`AsyncStore.keep`)
… for longer than `pause_after_s` ──► the session will be paused: people have gone to do something else
the disk does again ──► what waited is written; then it all goes on by itself, or the pause is recorded
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from study.store import WHAT_TO_DO, AsyncStore, Trouble


class Saving:
    """Of one session. `changed` is called whenever one of the attributes has changed.

    Attributes:
        trouble: why nothing can be saved now; None while all is well.
        is_long: that has lasted so long that the session is to be paused.
        over: a trouble that is over and stands in no record yet, with how long it lasted in seconds.
    """

    def __init__(self, store: AsyncStore, pause_after_s: float, changed: Callable[[], None]) -> None:
        self.trouble: Trouble | None = store.trouble
        self.is_long = False
        self.over: tuple[Trouble, float] | None = None
        self._pause_after_s = pause_after_s
        self._changed = changed
        self._now_s = store.now_s
        self._timer: asyncio.TimerHandle | None = None
        self._unlisten = store.listen(self._told)
        if self.trouble is not None:
            self._wait()

    @property
    def works(self) -> bool:
        """Whether ticks may run: the disk does, and no pause is due."""
        return self.trouble is None and not self.is_long

    @property
    def refuses(self) -> str:
        """Why nobody can be promised that something is saved now, for the experimenter; "" when it can."""
        if self.trouble is None or self.trouble.kind == "slow":
            return ""
        return f"The lab cannot save now, and tries again by itself. {WHAT_TO_DO[self.trouble.kind]}"

    def recorded(self, over: tuple[Trouble, float]) -> None:
        """What was over stands in the record."""
        if self.over == over:
            self.over = None
            self.is_long = self.is_long and self.trouble is not None

    def close(self) -> None:
        """Listen no more."""
        self._unlisten()
        if self._timer is not None:
            self._timer.cancel()

    def _told(self, trouble: Trouble | None) -> None:
        before, self.trouble = self.trouble, trouble
        if trouble is not None and before is None:
            self._wait()
        elif trouble is None and before is not None:
            if self._timer is not None:
                self._timer.cancel()
            lasted_s = self._now_s() - before.since_s
            if self.over is not None:  # it came back before the session could say so
                lasted_s += self.over[1]
            self.over = (before, lasted_s)
        self._changed()

    def _wait(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(self._pause_after_s, self._is_long)

    def _is_long(self) -> None:
        self.is_long = True
        self._changed()
