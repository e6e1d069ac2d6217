"""Hands: from messages that arrive whenever they like to the one input of a tick.

Rules (design promise): a press *and* release between two ticks still counts as that tick's input; input older than one
tick is never used; nothing is queued for later.
"""

from __future__ import annotations

from typing import Literal

from app.trial_values import Direction, OperatorInput
from app.worker_messages import Hands


class HandsLatch:
    """Collects hand states until a tick takes them. Owns no clock: callers pass `now_s` (monotonic seconds)."""

    def __init__(self, fresh_s: float) -> None:
        self.fresh_s = fresh_s
        self.seq = 0
        self._direction: Direction | None = None
        self._seen: Direction | None = None
        self._gripper: Literal["open", "close"] | None = None
        self._at_s: float | None = None

    def put(self, hands: Hands, now_s: float) -> None:
        """A message arrived. A heartbeat that repeats an older input than the last one changes nothing but time."""
        self._at_s = now_s
        if hands.beat and hands.seq < self.seq:
            return
        self.seq = max(self.seq, hands.seq)
        self._direction = hands.direction
        if hands.direction is not None:
            self._seen = hands.direction
        if hands.pressed is not None:
            self._gripper = hands.pressed

    def fresh(self, now_s: float) -> bool:
        """Whether the page has been heard of within `fresh_s`."""
        return self._at_s is not None and now_s - self._at_s <= self.fresh_s

    def take(self) -> OperatorInput:
        """The input of the tick that starts now. What was pressed and released meanwhile counts, once."""
        direction = self._direction if self._direction is not None else self._seen
        gripper = self._gripper
        self._seen, self._gripper = None, None
        return OperatorInput(direction, gripper, self.seq)

    def drop(self) -> None:
        """Forget presses that were not taken (before a pause ends): nothing stale is executed late."""
        self._direction, self._seen, self._gripper = None, None, None
