"""Which of many like lines are written: the first at once, the rest as one line with their number.

    13:00:00  the first                          written
    13:00:00  202,635 more of its kind           counted
    13:00:10  the last of them, repeated=202635  written

A kind that goes on is told so once in each window. Kinds beyond `MAX_KINDS` in one window are counted together, so that
no flood of lines that all differ fills a disk either.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

WINDOW_S = 10.0
MAX_KINDS = 100
"""Different lines in one window."""

Item = TypeVar("Item")


@dataclass
class _Kind(Generic[Item]):
    since_s: float
    count: int = 0
    last: Item | None = None


@dataclass(frozen=True)
class Folded(Generic[Item]):
    """The last of `count` items, of one kind or (`is_rest`) of those there were too many of, within so long."""

    last: Item
    count: int
    within_s: float
    is_rest: bool = False


class Folding(Generic[Item]):
    """Owns no clock: callers pass `now_s` (monotonic seconds)."""

    def __init__(self, window_s: float = WINDOW_S, max_kinds: int = MAX_KINDS) -> None:
        self.window_s = window_s
        self._max_kinds = max_kinds
        self._kinds: dict[Hashable, _Kind[Item]] = {}
        self._rest: _Kind[Item] | None = None

    def take(self, key: Hashable, item: Item, now_s: float) -> bool:
        """Whether it is to be written now; otherwise it is counted. Ask `due` before."""
        kind = self._kinds.get(key)
        if kind is None and len(self._kinds) < self._max_kinds:
            self._kinds[key] = _Kind(now_s)
            return True
        if kind is None:
            self._rest = kind = self._rest or _Kind(now_s)
        kind.count, kind.last = kind.count + 1, item
        return False

    def due(self, now_s: float, all_of_them: bool = False) -> list[Folded[Item]]:
        """What has been counted in windows that are over (`all_of_them`: in any), each to be written once."""
        found = []
        for key, kind in tuple(self._kinds.items()):
            if all_of_them or now_s - kind.since_s >= self.window_s:
                if kind.last is None:
                    del self._kinds[key]
                    continue
                found.append(Folded(kind.last, kind.count, now_s - kind.since_s))
                self._kinds[key] = _Kind(now_s)
        rest = self._rest
        if rest is not None and rest.last is not None and (all_of_them or now_s - rest.since_s >= self.window_s):
            found.append(Folded(rest.last, rest.count, now_s - rest.since_s, is_rest=True))
            self._rest = None
        return found

    def next_s(self) -> float | None:
        """When something will be due; None while nothing is counted."""
        counted = [kind.since_s for kind in (*self._kinds.values(), self._rest) if kind and kind.last is not None]
        return min(counted) + self.window_s if counted else None
