"""The paper's measures (IV-C), from the rows that an export holds. Pure: rows in, values out.

    measure(tasks, ticks) -> Measures(tasks, windows)
    window_rates(measures) -> one rate per participant and condition

Words used here, all of them about the ticks of one task:

- a *control tick* has source user, blend, robot or idle; gripper and reset ticks have not (settling counts as gripper);
- a *user action* is a tick with source user or blend: the person gave a direction, whether or not it was taken;
- a *window* is a longest run of at least `WINDOW_TICKS` control ticks without a user action. A user action, a gripper
  tick, a pause (`after_pause` stands on the first tick after it), a reset, freeing the arm and the end of the task end
  it;
- an *attempt* ends when the arm is freed, and the pick-and-place begins again. A task's ticks are those of all
  attempts: they count as its efficiency, and as user actions until its belief has converged for good;
- a task is *censored* when a time limit ended it: it would have taken longer than was seen.

Failed pickups are analysed, as in the paper; dropoffs that failed or were not run are not (`TaskMeasures.analysed`).
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from operator import attrgetter, ge
from typing import Any, Literal, Protocol, get_args

from study.records import RecordProblem, TaskRow

WINDOW_TICKS = 5
"""Shortest window: 2.5 s (paper IV-C.1)."""
GAIN_ENTROPY = 0.7
"""Belief gain is looked at where the entropy before the user action is above this (paper V-C.1)."""
TIE = 1e-12
"""Probabilities closer than this are equal: the goal is then not *the* most likely one."""

USER_SOURCES = frozenset({"user", "blend"})
CONTROL_SOURCES = USER_SOURCES | {"robot", "idle"}
TaskKind = Literal["all", "pickup", "dropoff"]
WindowEnd = Literal["user", "gripper", "pause", "free", "task"]
TIME_LIMIT = "time_limit"
"""The reason of a task that a time limit ended, or that came after the trial's."""


class TickLike(Protocol):
    """What is read of a tick: any `TickRow`, or a lighter row with these names."""

    @property
    def participant(self) -> str: ...
    @property
    def trial(self) -> int: ...
    @property
    def task(self) -> int | None: ...
    @property
    def tick(self) -> int: ...
    @property
    def source(self) -> str: ...
    @property
    def after_pause(self) -> int: ...
    @property
    def belief(self) -> str: ...
    @property
    def entropy(self) -> float: ...
    @property
    def attempt(self) -> int: ...


@dataclass(frozen=True)
class TaskMeasures:
    """One task that was run. `position` is the trial's number: the place of its condition in the order."""

    participant: str
    condition: str
    position: int
    task: int
    kind: str
    goal: str
    goals: int
    outcome: str
    reason: str | None
    analysed: bool
    """Pickups always, dropoffs if they succeeded."""
    efficiency_ticks: int
    """Control ticks: *total task efficiency*."""
    user_actions: int
    convergence_user_actions: int | None
    """*Belief convergence speed*; None = never converged. See `convergence`."""
    missing_ticks: int
    """Ticks between the task's first and last, in the same attempt, that have no row."""
    attempts: int = 1
    """Attempts at its pick-and-place; 1 = the arm was never freed in it."""
    censored: bool = False
    """Whether a time limit ended it: its ticks and user actions are the least it would have taken."""


@dataclass(frozen=True)
class WindowMeasures:
    """One shared autonomy window."""

    participant: str
    condition: str
    position: int
    task: int
    kind: str
    goal: str
    goals: int
    analysed: bool
    """As its task."""
    first_tick: int
    ticks: int
    ended_by: WindowEnd
    entropy_before: float
    """Entropy at the window's last tick, before the user action."""
    gain: float | None
    """b(instructed goal) after the user action that ended the window, less b before it. None when no user action did,
    or when the candidate goals changed or do not hold the instructed one."""

    @property
    def uncertain(self) -> bool:
        """Whether the window counts for *belief accuracy gain*: a gain, and entropy above `GAIN_ENTROPY`."""
        return self.gain is not None and self.entropy_before > GAIN_ENTROPY


@dataclass(frozen=True)
class WindowRate:
    """Windows divided by control ticks, over the analysed tasks of one participant under one condition."""

    participant: str
    condition: str
    position: int
    kind: TaskKind
    windows: int
    control_ticks: int

    @property
    def rate(self) -> float:
        """Windows per control tick."""
        return self.windows / self.control_ticks


@dataclass(frozen=True)
class Measures:
    """Everything measured, in the order of the rows."""

    tasks: tuple[TaskMeasures, ...]
    windows: tuple[WindowMeasures, ...]
    not_run: tuple[TaskRow, ...] = ()
    """Dropoffs that did not follow a failed pickup."""

    def analysed_tasks(self, kind: TaskKind = "all") -> Sequence[TaskMeasures]:
        """The tasks that enter the analysis."""
        return self._analysed[kind][0]

    def analysed_windows(self, kind: TaskKind = "all") -> Sequence[WindowMeasures]:
        """The windows of those tasks."""
        return self._analysed[kind][1]

    @cached_property
    def _analysed(self) -> Mapping[TaskKind, tuple[list[TaskMeasures], list[WindowMeasures]]]:
        """Looked for once: there are tens of thousands of windows, and every table asks."""
        tasks = [task for task in self.tasks if task.analysed]
        windows = [window for window in self.windows if window.analysed]
        return {
            kind: (
                [task for task in tasks if kind in ("all", task.kind)],
                [window for window in windows if kind in ("all", window.kind)],
            )
            for kind in get_args(TaskKind)
        }

    def gains(self, kind: TaskKind = "all") -> list[WindowMeasures]:
        """The windows that *belief accuracy gain* is measured at."""
        return [window for window in self.analysed_windows(kind) if window.uncertain]


# ---- one task -------------------------------------------------------------------------------------------------------


def convergence(goal: str, ticks: Sequence[TickLike]) -> int | None:
    """User actions observed up to and including the first from which `goal` stays the most likely; None = never.

    Only ticks in which `goal` is a candidate are looked at. Goals switch on holding: once the instructed object is
    held the candidates are the bins, and while a wrong one is held they are too; such ticks neither count as observed
    user actions nor speak for or against convergence. A belief that starts afresh (after a wrong object was put down)
    is uniform, hence not converged. A tie is not "most likely".
    """
    return _convergence(_leads(goal, _beliefs(ticks)), ticks)


def measure(tasks: Iterable[TaskRow], ticks: Iterable[TickLike]) -> Measures:
    """Measure every task given, from the ticks that belong to it; other ticks (other trials, resets) are passed over.

    Ticks stand in the order of the export (participant, trial, tick) and are read once, as a stream, a trial at a time:
    a task's may stand apart, one attempt after the other. Raises `StudyError` for a task without ticks, ticks out of
    order, or a belief that cannot be read.
    """
    rows = {(row.participant, row.trial, row.task): row for row in tasks}
    not_run = tuple(row for row in rows.values() if row.outcome == "not_run")
    wanted = {key: row for key, row in rows.items() if row.outcome != "not_run"}
    measured: dict[tuple[str, int, int], tuple[TaskMeasures, tuple[WindowMeasures, ...]]] = {}
    for (participant, trial), of_trial in groupby(ticks, key=attrgetter("participant", "trial")):
        of_task: dict[int, list[TickLike]] = {}
        for task, together in groupby(of_trial, key=attrgetter("task")):
            if task is not None and (participant, trial, task) in wanted:
                of_task.setdefault(task, []).extend(together)
        for task, found_ticks in of_task.items():
            name = (participant, trial, task)
            if name in measured:
                raise RecordProblem(
                    participant,
                    f"{_place(wanted[name])}: its ticks are not together; sort them by participant, trial, tick",
                )
            measured[name] = measure_task(wanted[name], found_ticks)
    for key, row in wanted.items():
        if key not in measured:
            raise RecordProblem(
                row.participant, f"{_place(row)}: outcome {row.outcome}, but it has no ticks; export the data again"
            )
    found = [measured[key] for key in wanted]
    return Measures(
        tasks=tuple(task for task, _ in found),
        windows=tuple(window for _, windows in found for window in windows),
        not_run=not_run,
    )


def measure_task(row: TaskRow, ticks: Sequence[TickLike]) -> tuple[TaskMeasures, tuple[WindowMeasures, ...]]:
    """One task and its windows. `ticks` are the ticks of this task, in order."""
    numbers = [tick.tick for tick in ticks]
    if any(map(ge, numbers, numbers[1:])):
        raise RecordProblem(
            row.participant,
            f"{_place(row)}: its ticks are out of order; sort them by participant, trial, tick",
        )
    try:
        beliefs = _beliefs(ticks)
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise RecordProblem(
            row.participant, f"{_place(row)}: a belief is not JSON of goal id to probability; export the data again"
        ) from None
    analysed = row.kind == "pickup" or row.outcome == "success"
    sources = Counter([tick.source for tick in ticks])
    task = TaskMeasures(
        participant=row.participant,
        condition=row.condition,
        position=row.trial,
        task=row.task,
        kind=row.kind,
        goal=row.goal,
        goals=row.goals,
        outcome=row.outcome,
        reason=row.reason,
        analysed=analysed,
        efficiency_ticks=sum(sources[name] for name in CONTROL_SOURCES),
        user_actions=sum(sources[name] for name in USER_SOURCES),
        convergence_user_actions=_convergence(_leads(row.goal, beliefs), ticks),
        missing_ticks=_missing(row, ticks),
        attempts=row.attempts,
        censored=row.reason == TIME_LIMIT,
    )
    windows = tuple(
        _window(row, analysed, ticks, beliefs, start, stop, ended_by) for start, stop, ended_by in _runs(ticks)
    )
    return task, windows


def _missing(row: TaskRow, ticks: Sequence[TickLike]) -> int:
    """Ticks without a row, within each attempt and towards the task's first and last one; they stand in order."""
    gaps = 0
    for _, attempt in groupby(ticks, key=attrgetter("attempt")):
        own = list(attempt)
        gaps += own[-1].tick - own[0].tick - (len(own) - 1)
    if row.first_tick is not None and row.last_tick is not None and ticks:
        gaps += max(ticks[0].tick - row.first_tick, 0) + max(row.last_tick - ticks[-1].tick, 0)
    return gaps


def _convergence(leads: Sequence[bool | None], ticks: Sequence[TickLike]) -> int | None:
    observed = 0
    converged_at: int | None = None
    for lead, tick in zip(leads, ticks, strict=True):
        if lead is None:
            continue
        if tick.source in USER_SOURCES:
            observed += 1
            if lead and converged_at is None:
                converged_at = observed
        if not lead:
            converged_at = None
    return converged_at


def _leads(goal: str, beliefs: Sequence[Mapping[str, float]]) -> list[bool | None]:
    """Whether the goal is the most likely one after each tick; None = it is not a candidate."""
    leads: list[bool | None] = []
    before, lead = None, None
    for belief in beliefs:
        if belief is not before:  # ticks without evidence share theirs
            before, own = belief, belief.get(goal)
            lead = None
            if own is not None:
                others = [value for other, value in belief.items() if other != goal]
                lead = not others or own - max(others) > TIE
        leads.append(lead)
    return leads


def _beliefs(ticks: Sequence[TickLike]) -> list[Mapping[str, float]]:
    """Parsed beliefs; ticks without evidence repeat the text before them, which is parsed once."""
    beliefs: list[Mapping[str, float]] = []
    text, belief = None, {}
    for tick in ticks:
        if tick.belief != text:
            text = tick.belief
            belief = _parsed(text)
            values = belief.values()
            if not belief or not (min(values) >= 0.0 and max(values) <= 1.0) or math.isnan(sum(values)):
                raise ValueError(text)
        beliefs.append(belief)
    return beliefs


def _parsed(text: str) -> Any:
    """As `json.loads`, at a third of its cost for so short a text."""
    try:
        value, end = _scan(text, 0)
    except StopIteration:
        end = -1
    return value if end == len(text) else json.loads(text)


_scan: Callable[[str, int], tuple[Any, int]] = json.JSONDecoder().scan_once  # type: ignore[attr-defined]


def _runs(ticks: Sequence[TickLike]) -> Iterator[tuple[int, int, WindowEnd]]:
    """Start, stop (exclusive) and end of every window."""
    start: int | None = None
    hands_off = CONTROL_SOURCES - USER_SOURCES
    for index, tick in enumerate(ticks):
        no_input = tick.source in hands_off
        again = index > 0 and tick.attempt != ticks[index - 1].attempt
        broken = again or bool(tick.after_pause) or (index > 0 and tick.tick != ticks[index - 1].tick + 1)
        if start is not None and (broken or not no_input):
            if index - start >= WINDOW_TICKS:
                ended_by: WindowEnd = "task"
                if broken:
                    ended_by = "free" if again else "pause"
                elif tick.source == "gripper" or tick.source in USER_SOURCES:
                    ended_by = "gripper" if tick.source == "gripper" else "user"
                yield start, index, ended_by
            start = None
        if no_input and start is None:
            start = index
    if start is not None and len(ticks) - start >= WINDOW_TICKS:
        yield start, len(ticks), "task"


def _window(
    row: TaskRow,
    analysed: bool,
    ticks: Sequence[TickLike],
    beliefs: Sequence[Mapping[str, float]],
    start: int,
    stop: int,
    ended_by: WindowEnd,
) -> WindowMeasures:
    before = beliefs[stop - 1]
    entropy = ticks[stop - 1].entropy
    if not math.isfinite(entropy):
        raise RecordProblem(
            row.participant,
            f"{_place(row)}: the entropy of tick {ticks[stop - 1].tick} is {entropy}; it must be 0 to 1",
        )
    gain: float | None = None
    if ended_by == "user":
        after = beliefs[stop]
        if before.keys() == after.keys() and row.goal in after:
            gain = after[row.goal] - before[row.goal]
    return WindowMeasures(
        participant=row.participant,
        condition=row.condition,
        position=row.trial,
        task=row.task,
        kind=row.kind,
        goal=row.goal,
        goals=row.goals,
        analysed=analysed,
        first_tick=ticks[start].tick,
        ticks=stop - start,
        ended_by=ended_by,
        entropy_before=entropy,
        gain=gain,
    )


def _place(row: TaskRow) -> str:
    return f"participant {row.participant}, trial {row.trial}, task {row.task}"


# ---- per participant ------------------------------------------------------------------------------------------------


def window_rates(measures: Measures, kind: TaskKind = "all") -> tuple[WindowRate, ...]:
    """Windows (of any entropy, however they ended) per control tick, for every participant and condition."""
    ticks: dict[tuple[str, str, int], int] = {}
    for task in measures.analysed_tasks(kind):
        key = (task.participant, task.condition, task.position)
        ticks[key] = ticks.get(key, 0) + task.efficiency_ticks
    counts = dict.fromkeys(ticks, 0)
    for window in measures.analysed_windows(kind):
        counts[window.participant, window.condition, window.position] += 1
    return tuple(WindowRate(*key, kind, counts[key], total) for key, total in ticks.items() if total)
