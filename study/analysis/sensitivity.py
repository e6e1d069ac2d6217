"""Whether the results hang on what did not end by itself: tasks that a time limit ended, and cycles that were freed.

    without(...)      the paper's comparisons over fewer tasks
    timed_tasks(...)  what `study.analysis.hazard_model` is fitted to

A time limit hides how long a task would have taken. Leaving such tasks out favours the condition that has more of them,
and so does taking the limit for their length. Cox's model uses just what is known: that they took longer.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

from study.analysis.measures import Measures, TaskKind, TaskMeasures

LeftOut = Literal["freed", "censored"]
LEFT_OUT: tuple[LeftOut, ...] = get_args(LeftOut)


def without(measures: Measures, left_out: LeftOut) -> Measures:
    """The measures without tasks of `freed` cycles, or without tasks that are `censored`."""

    def is_kept(task: TaskMeasures) -> bool:
        return task.attempts == 1 if left_out == "freed" else not task.censored

    kept = [task for task in measures.tasks if is_kept(task)]
    names = {(task.participant, task.position, task.task) for task in kept}
    windows = [item for item in measures.windows if (item.participant, item.position, item.task) in names]
    return replace(measures, tasks=tuple(kept), windows=tuple(windows))


def timed_tasks(measures: Measures, kind: TaskKind) -> list[TaskMeasures]:
    """The tasks of the main analysis, and the dropoffs that a time limit ended."""
    return [task for task in measures.tasks if (task.analysed or task.censored) and kind in ("all", task.kind)]
