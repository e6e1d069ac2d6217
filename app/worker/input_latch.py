"""The controls: from messages that arrive whenever they like to the one input of a tick.

Rules (design promise): a press *and* release between two ticks still counts as that tick's input; input older than one
tick is never used; nothing is queued for later.
"""

from __future__ import annotations

from typing import Literal

from app.autonomy.actions import Direction
from app.trial.values import UserInput
from app.worker.messages import ControlsState


class InputLatch:
    """Collects hand states until a tick takes them. Owns no clock: callers pass `now_s` (monotonic seconds)."""

    def __init__(self, fresh_s: float, stale_s: float) -> None:
        self.fresh_s = fresh_s
        self.stale_s = stale_s
        self.seq = 0
        self._direction: Direction | None = None
        self._seen: Direction | None = None
        self._gripper: Literal["open", "close"] | None = None
        self._at_s: float | None = None

    def put(self, hands: ControlsState, now_s: float) -> None:
        """A message arrived. One that is older than the last input is a sign of life and nothing else."""
        self._at_s = now_s
        if hands.seq < self.seq:
            return
        self.seq = hands.seq
        self._direction = hands.direction
        if hands.direction is not None and not hands.beat:
            self._seen = hands.direction  # a heartbeat repeats what is held, it is no press
        if hands.pressed is not None:
            self._gripper = hands.pressed

    def fresh(self, now_s: float) -> bool:
        """Whether the page has been heard of within `fresh_s`."""
        return self._at_s is not None and now_s - self._at_s <= self.fresh_s

    def take(self, now_s: float) -> UserInput:
        """The input of the tick that starts now. What was pressed and released meanwhile counts, once.

        Neutral when the page was last heard of more than `stale_s` ago.
        """
        if self._at_s is None or now_s - self._at_s > self.stale_s:
            self.drop()
        direction = self._direction if self._direction is not None else self._seen
        gripper = self._gripper
        self.forget_presses()
        return UserInput(direction, gripper, self.seq)

    def forget_presses(self) -> None:
        """Forget what was pressed and not taken; what is held down now still counts."""
        self._seen, self._gripper = None, None

    def drop(self) -> None:
        """Forget everything until the next message: nothing stale is executed late."""
        self._direction = None
        self.forget_presses()
