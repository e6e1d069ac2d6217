"""n, mean and standard deviation of the measures, per condition and kind of task (`measures.json`). Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from study.analysis.measures import Measures, TaskKind, WindowRate, window_rates
from study.flow.answers import SurveyScore
from study.records import CONDITIONS

KINDS_OF_SUMMARY: tuple[TaskKind, ...] = ("pickup", "dropoff", "all")


@dataclass(frozen=True)
class Summary:
    """n, mean and sample standard deviation; mean is None without values, sd with fewer than two."""

    n: int
    mean: float | None
    sd: float | None


def summary(values: Sequence[float]) -> Summary:
    """n, mean, sd (n - 1 in the denominator)."""
    if not values:
        return Summary(0, None, None)
    count = len(values)
    mean = math.fsum(values) / count
    squares = math.fsum((value - mean) ** 2 for value in values)
    return Summary(count, mean, math.sqrt(squares / (count - 1)) if count > 1 else None)


def conditions_of(measures: Measures) -> tuple[str, ...]:
    """The conditions that occur: the paper's in its order, then any others by name."""
    present = {task.condition for task in measures.tasks}
    known = tuple(condition for condition in CONDITIONS if condition in present)
    return known + tuple(sorted(present - set(known)))


def summarise(measures: Measures, scores: Iterable[SurveyScore] = ()) -> dict[str, Any]:
    """Per condition and kind of task: n, mean and sd of each measure, and what was counted. Plain data for JSON."""
    scores = tuple(scores)
    rates = {kind: window_rates(measures, kind) for kind in KINDS_OF_SUMMARY}
    return {
        condition: {
            "tasks": {kind: _summarise_kind(measures, condition, kind, rates[kind]) for kind in KINDS_OF_SUMMARY},
            "surveys": {
                name: vars(
                    summary([item.score for item in scores if (item.condition, item.instrument) == (condition, name)])
                )
                for name in sorted({item.instrument for item in scores})
            },
        }
        for condition in conditions_of(measures)
    }


def _summarise_kind(measures: Measures, condition: str, kind: TaskKind, of_all: Sequence[WindowRate]) -> dict[str, Any]:
    tasks = [task for task in measures.analysed_tasks(kind) if task.condition == condition]
    windows = [window for window in measures.analysed_windows(kind) if window.condition == condition]
    gains = [window for window in windows if window.uncertain]
    converged = [task.convergence_user_actions for task in tasks if task.convergence_user_actions is not None]
    rates = [item.rate for item in of_all if item.condition == condition]
    run = [task for task in measures.tasks if task.condition == condition and kind in ("all", task.kind)]
    return {
        "efficiency_ticks": vars(summary([task.efficiency_ticks for task in tasks])),
        "convergence_user_actions": vars(summary(converged)),
        "belief_gain": vars(summary([window.gain for window in gains if window.gain is not None])),
        "window_rate": vars(summary(rates)),
        "belief_gain_by_goals": {
            str(count): vars(summary([w.gain for w in gains if w.goals == count and w.gain is not None]))
            for count in sorted({window.goals for window in gains})
        },
        "counts": {
            "analysed": len(tasks),
            "never_converged": len(tasks) - len(converged),
            "successes": sum(task.outcome == "success" for task in run),
            "failures": sum(task.outcome == "failure" for task in run),
            "not_run": sum(row.condition == condition and kind in ("all", row.kind) for row in measures.not_run),
            "windows": len(windows),
            "windows_ended_by_user": sum(window.ended_by == "user" for window in windows),
            "windows_above_entropy": len(gains),
        },
    }
