"""Cox's proportional hazards of the ticks until a task is over, in which one that a time limit ended is right-censored.

Its strata are participants, so that each is compared with themselves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from study.analysis.effect_sizes import LEVEL, Interval, NotFitted
from study.analysis.measures import TaskMeasures
from study.analysis.partial_likelihood import NoMaximum, greatest

LARGEST_LOG_RATIO = 15.0
"""A hazard three million times another's is none that was estimated: one condition ends before any other does."""

NO_RATIO = "tasks under one condition all end before those under another: no ratio can be estimated"


@dataclass(frozen=True)
class Hazards:
    """Cox's model of the control ticks until a task is over, participants as strata, Efron's ties.

    A hazard ratio above 1: under this condition tasks end sooner than under `against`.
    """

    against: str
    ratios: tuple[tuple[str, Interval, float], ...]
    """Condition, hazard ratio with its 95 % interval, p (Wald)."""
    chi_squared: float
    df: int
    p: float
    """Wald test of the condition."""
    tasks: int
    censored: int
    participants: int


def until_done(tasks: Sequence[TaskMeasures], conditions: Sequence[str]) -> Hazards | NotFitted:
    """How much sooner or later tasks end under each condition than under the first."""
    present = [name for name in conditions if any(task.condition == name for task in tasks)]
    if len(present) < 2:
        return NotFitted("at least two conditions are needed")
    without_end = [name for name in present if not any(task.condition == name and not task.censored for task in tasks)]
    if without_end:
        return NotFitted(f"no task under {' and '.join(without_end)} ended before its time limit")
    names = present[1:]
    design = np.array([[float(task.condition == name) for name in names] for task in tasks])
    centred = design.copy()
    people = np.array([task.participant for task in tasks])
    for person in set(people.tolist()):
        centred[people == person] -= centred[people == person].mean(axis=0)
    if int(np.linalg.matrix_rank(centred)) < len(names):
        return NotFitted("no participant has tasks under several conditions")
    times = np.array([max(task.efficiency_ticks, 1) for task in tasks], dtype=np.float64)
    try:
        effects, covariance = greatest(times, design, np.array([not task.censored for task in tasks]), people)
    except NoMaximum:
        return NotFitted(NO_RATIO)
    if np.abs(effects).max() > LARGEST_LOG_RATIO:
        return NotFitted(NO_RATIO)
    reach = float(stats.norm.ppf(0.5 + LEVEL / 2.0))
    ratios = []
    for index, name in enumerate(names):
        value, se = float(effects[index]), math.sqrt(covariance[index, index])
        low, high = math.exp(value - reach * se), math.exp(value + reach * se)
        ratios.append((name, Interval(math.exp(value), low, high), 2.0 * float(stats.norm.sf(abs(value) / se))))
    chi_squared = float(effects @ np.linalg.solve(covariance, effects))
    return Hazards(
        against=present[0],
        ratios=tuple(ratios),
        chi_squared=chi_squared,
        df=len(names),
        p=float(stats.chi2.sf(chi_squared, len(names))),
        tasks=len(tasks),
        censored=sum(task.censored for task in tasks),
        participants=len(set(people.tolist())),
    )
