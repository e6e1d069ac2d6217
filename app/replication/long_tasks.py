"""How long tasks take when no time limit ends them, and how often the arm stands because it "cannot fold further".

A time limit hides how long somebody would have been lost. It changes nothing before it is reached, so only trials that
reached one are simulated once more without (`lengths_of_person`); all other tasks are those of the study.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from app.replication.formats import CONDITION_NAMES, columns, percent
from app.replication.paper import BALANCED, CONDITIONS_IN_ORDER, TELEOPERATION, reported
from app.simulated.participant import Case, Record, simulate_trial
from app.trial.hints import FOLDED
from sim.interface import TICK_S, Robot
from study.analysis.measures import CONTROL_SOURCES, TIME_LIMIT

LONG_S = 150.0
LONG_TICKS = round(LONG_S / TICK_S)
"""A task longer than this counts as long."""
LONG_AIM = 0.01
"""Of balanced tasks, at most so many are to be long."""
KINDS = ("pickup", "dropoff")


@dataclass(frozen=True)
class TaskLength:
    """One task without time limits, failed and unfinished ones included."""

    condition: str
    kind: str
    control_ticks: int
    """As in the paper's task efficiency: ticks in which the arm could be moved."""
    blocked_ticks: int
    """Of these, ticks in which the arm was asked to move and did not."""
    folded_ticks: int
    """Of these, ticks in which it could not because it "cannot fold further"."""


@dataclass(frozen=True)
class Lengths:
    """All tasks of one kind under one condition."""

    condition: str
    kind: str
    tasks: int
    long: float
    """Share of tasks of more than `LONG_TICKS` control ticks."""
    quantile_99: float
    longest: int
    beyond_paper: float
    """Share of tasks beyond the paper's mean plus three SD (of pickups; for dropoffs of all tasks, since the paper
    gives none for dropoffs alone)."""
    blocked: float
    folded: float
    """Shares of all control ticks."""


def lengths_of(ticks: Sequence[Any]) -> tuple[TaskLength, ...]:
    """The tasks in a participant's tick rows, in order."""
    of_task: dict[tuple[int, int], list[Any]] = {}
    for tick in ticks:
        if tick.task is not None and tick.source in CONTROL_SOURCES:
            of_task.setdefault((tick.trial, tick.task), []).append(tick)
    return tuple(
        TaskLength(
            condition=of[0].condition,
            kind=of[0].kind,
            control_ticks=len(of),
            blocked_ticks=sum(bool(tick.blocked) for tick in of),
            folded_ticks=sum(bool(tick.blocked) and tick.blocked_reason == FOLDED for tick in of),
        )
        for of in of_task.values()
    )


def lengths_of_person(case: Case, record: Record, make_robot: Callable[[], Robot]) -> tuple[TaskLength, ...]:
    """The tasks of somebody whose trials left `record`, without time limits: trials that reached one are simulated
    again, and are what they would have been in a whole study without limits."""
    limited = {task.trial for task in record["tasks"] if task.reason == TIME_LIMIT}
    ticks: list[Any] = []
    for trial in range(1, len(case.order) + 1):
        if trial in limited:
            ticks += simulate_trial(without_limits(case), trial, make_robot)["ticks"]
        else:
            ticks += [tick for tick in record["ticks"] if tick.trial == trial]
    return lengths_of(ticks)


def without_limits(case: Case) -> Case:
    """The same person in the same study without time limits."""
    study = case.setup.study.model_copy(update={"task_limit_s": 0.0, "trial_limit_s": 0.0})
    return replace(case, setup=replace(case.setup, study=study))


def summed_up(tasks: Iterable[TaskLength]) -> tuple[Lengths, ...]:
    """By condition and kind, in the paper's order; what never occurred is left out."""
    found = {(kind, condition): _Counted() for kind in KINDS for condition in CONDITIONS_IN_ORDER}
    for task in tasks:
        of = found.get((task.kind, task.condition))
        if of is not None:
            of.ticks.append(task.control_ticks)
            of.blocked += task.blocked_ticks
            of.folded += task.folded_ticks
    return tuple(_lengths(condition, kind, of) for (kind, condition), of in found.items() if of.ticks)


@dataclass
class _Counted:
    """All tasks of one kind under one condition: how long each was, and the rest together."""

    ticks: array[int] = field(default_factory=lambda: array("q"))
    blocked: int = 0
    folded: int = 0


def _lengths(condition: str, kind: str, of: _Counted) -> Lengths:
    far, total = usual_end(condition, kind), sum(of.ticks)
    return Lengths(
        condition=condition,
        kind=kind,
        tasks=len(of.ticks),
        long=sum(one > LONG_TICKS for one in of.ticks) / len(of.ticks),
        quantile_99=float(np.quantile(of.ticks, 0.99)),
        longest=max(of.ticks),
        beyond_paper=sum(one > far for one in of.ticks) / len(of.ticks),
        blocked=of.blocked / total,
        folded=of.folded / total,
    )


def usual_end(condition: str, kind: str) -> float:
    """The paper's mean plus three SD, ticks."""
    of = reported("efficiency_ticks", "pickup" if kind == "pickup" else "all")
    return of.means[condition] + 3.0 * of.sds[condition]


def met(rows: Sequence[Lengths], condition: str = BALANCED) -> bool:
    """Whether at most `LONG_AIM` of that condition's tasks are long."""
    of = [row for row in rows if row.condition == condition]
    tasks = sum(row.tasks for row in of)
    return bool(tasks) and sum(row.long * row.tasks for row in of) / tasks <= LONG_AIM


# ---- as text --------------------------------------------------------------------------------------------------------

COLUMNS: Mapping[str, str] = {
    "kind": "pickup or dropoff",
    "condition": "condition of the study",
    "tasks": "tasks counted, failed and unfinished ones included",
    "long": f"share of them with more than {LONG_TICKS} control ticks ({LONG_S:g} s)",
    "quantile_99": "control ticks that 1 % of the tasks exceed",
    "longest": "control ticks of the longest",
    "beyond_paper": "share beyond the paper's mean plus three SD of efficiency (dropoffs: of all tasks)",
    "blocked": "share of control ticks in which the arm was asked to move and did not",
    "folded": f"share of control ticks in which it did not because {FOLDED}",
}


def table(rows: Sequence[Lengths]) -> str:
    """The lengths, for the screen and the report."""
    shown: list[tuple[str, ...]] = [
        ("task", "tasks", f"> {LONG_S:g} s", "> paper's M + 3 SD", "99 %", "longest", "blocked", "cannot fold")
    ]
    for row in rows:
        shown.append(
            (
                f"{row.kind}, {CONDITION_NAMES[row.condition]}",
                str(row.tasks),
                percent(row.long, 2),
                percent(row.beyond_paper, 2),
                f"{row.quantile_99:.0f}",
                str(row.longest),
                percent(row.blocked, 1),
                percent(row.folded, 2),
            )
        )
    return columns(shown)


def sentence(rows: Sequence[Lengths]) -> str:
    """What the table says of the aims."""
    of = [row for row in rows if row.condition == BALANCED]
    if not of:
        return "No task under balanced was simulated, so that nothing can be said of its length."
    tasks = sum(row.tasks for row in of)
    share = sum(row.long * row.tasks for row in of) / tasks
    told = (
        f"Of {tasks} balanced tasks, {percent(share, 2)} take longer than {LONG_S:g} s ({LONG_TICKS} control ticks); "
        f"the aim, at most {LONG_AIM:.0%}, is {'met' if met(rows) else 'MISSED'}. The longest takes "
        f"{max(row.longest for row in of)} ticks."
    )
    lost = next((row for row in rows if (row.condition, row.kind) == (TELEOPERATION, "dropoff")), None)
    if lost is not None:
        end = usual_end(TELEOPERATION, "dropoff")
        told += (
            f"\nThe longest dropoff under pure teleoperation takes {lost.longest} ticks; the aim, none beyond the "
            f"paper's mean plus three SD ({end:.0f}), is {'met' if lost.longest <= end else 'MISSED'}."
        )
    return told
