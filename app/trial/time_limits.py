"""Which time limit is near: what the participant is told before it is over. Pure."""

from __future__ import annotations

from typing import Literal

from app.trial.values import TimeLimits

Limited = Literal["task", "trial"]
NEAR_TICKS = 120
"""A limit is near in its last minute, or in its last quarter if that is shorter."""


def near_limit(limits: TimeLimits, trial_ticks: int, task_ticks: int) -> Limited | None:
    """Whose limit is near after so many ticks of the trial and of the task; the nearer one of two, None of none."""
    if not (0 < limits.trial_ticks <= trial_ticks + NEAR_TICKS or 0 < limits.task_ticks <= task_ticks + NEAR_TICKS):
        return None
    spent: tuple[tuple[Limited, int, int], ...] = (
        ("trial", limits.trial_ticks, trial_ticks),
        ("task", limits.task_ticks, task_ticks),
    )
    left: dict[Limited, int] = {name: limit - ticks for name, limit, ticks in spent if limit}
    near = [name for name, limit, _ in spent if name in left and left[name] <= min(NEAR_TICKS, limit // 4)]
    return min(near, key=left.__getitem__, default=None)
