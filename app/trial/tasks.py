"""Where a trial stands: the cycle, its attempt, the task in it, and the task rows that follow."""

from __future__ import annotations

from typing import Literal

from app.trial.values import CycleSetup, CycleStart, TaskSpan, TrialSetup
from app.trial.verdicts import TIME_LIMIT, Verdict
from study.records import TaskRow

Kind = Literal["pickup", "dropoff"]


class TaskProgress:
    """Counts cycles and tasks. Practice repeats its one cycle for as long as it takes; its tasks stay 1 and 2.

    A task may have ticks in several attempts of its cycle: its row spans them all, and has the outcome of the last.

    Attributes:
        cycle: number of the current cycle, from 1.
        attempt: how often it has been begun.
        cycle_setup: what it is made of.
        kind: the current task of the cycle.
    """

    cycle: int
    cycle_setup: CycleSetup

    def __init__(self, setup: TrialSetup, start: CycleStart) -> None:
        self.kind: Kind = "pickup"
        self.attempt = start.attempt
        self._setup = setup
        self._set_cycle(start.cycle)
        self._first_tick: int | None = None
        self._goals = 0
        self._spans: dict[Kind, TaskSpan] = {"pickup": start.pickup, "dropoff": start.dropoff}

    @property
    def is_last_cycle(self) -> bool:
        """Whether no cycle follows, however this one ends; practice has none."""
        return self._setup.kind == "trial" and self.cycle == len(self._setup.cycles)

    @property
    def tasks(self) -> int:
        """How many tasks there are: a pickup and a dropoff a cycle."""
        return 2 * len(self._setup.cycles)

    @property
    def task(self) -> int:
        """Number of the current task, from 1; odd = pickup."""
        return self._number(self.cycle, self.kind)

    @property
    def goal(self) -> str | None:
        """Id of the instructed object or bin; None for a practice dropoff, which may go anywhere."""
        return self.cycle_setup.object if self.kind == "pickup" else self.cycle_setup.bin

    def spans(self, next_tick: int) -> dict[Kind, TaskSpan]:
        """The ticks before `next_tick` of both tasks of the cycle, by kind."""
        if self._first_tick is None:
            return self._spans
        return {**self._spans, self.kind: self._spans[self.kind].and_then(self._first_tick, next_tick - 1)}

    def ticks(self, next_tick: int) -> int:
        """How many ticks the current task has had before `next_tick`, all attempts together."""
        before = self._spans[self.kind].ticks
        return before if self._first_tick is None else before + next_tick - self._first_tick

    def begin_task(self, tick: int, goals: int) -> None:
        """Note the first tick of the task and how many goals it began with; later calls change nothing."""
        if self._first_tick is None:
            self._first_tick, self._goals = tick, goals

    def to_dropoff(self, next_tick: int) -> None:
        """The pickup is done."""
        self._spans = self.spans(next_tick)
        self.kind, self._first_tick = "dropoff", None

    def to_cycle(self, cycle: int) -> None:
        """Another cycle begins with its pickup."""
        self.kind, self._first_tick, self.attempt = "pickup", None, 1
        self._spans = {"pickup": TaskSpan(), "dropoff": TaskSpan()}
        self._set_cycle(cycle)

    def _set_cycle(self, cycle: int) -> None:
        self.cycle, self.cycle_setup = cycle, self._setup.cycles[min(cycle, len(self._setup.cycles)) - 1]

    def row(self, verdict: Verdict, last_tick: int) -> TaskRow:
        """The row of the task that just ended."""
        span = self.spans(last_tick + 1)[self.kind]
        return self._row(self.cycle, self.kind, (verdict.outcome, verdict.reason), span, self._goals)

    def not_run_row(self) -> TaskRow:
        """The row of the dropoff after a failed pickup."""
        return self._not_run(self.cycle, "dropoff", "pickup_failed")

    def rest(self, next_tick: int) -> tuple[TaskRow, ...]:
        """The rows of everything that is not over when the trial's time is: what was begun failed, the rest is not
        run."""
        rows = []
        if self.spans(next_tick)[self.kind].first_tick is not None:
            rows.append(self.row(TIME_LIMIT, next_tick - 1))
        else:
            rows.append(self._not_run(self.cycle, self.kind, "time_limit"))
        if self.kind == "pickup":
            rows.append(self._not_run(self.cycle, "dropoff", "time_limit"))
        later = range(self.cycle + 1, len(self._setup.cycles) + 1)
        kinds: tuple[Kind, Kind] = ("pickup", "dropoff")
        return (*rows, *(self._not_run(cycle, kind, "time_limit") for cycle in later for kind in kinds))

    def _number(self, cycle: int, kind: Kind) -> int:
        return 2 * (cycle if self._setup.kind == "trial" else 1) - (1 if kind == "pickup" else 0)

    def _not_run(self, cycle: int, kind: Kind, reason: str) -> TaskRow:
        return self._row(cycle, kind, ("not_run", reason), TaskSpan())

    def _row(self, cycle: int, kind: Kind, ended: tuple[str, str | None], span: TaskSpan, goals: int = 0) -> TaskRow:
        """`goals` is 0 for a task that has not begun in this attempt."""
        cycle_setup = self._setup.cycles[min(cycle, len(self._setup.cycles)) - 1]
        scene = cycle_setup.scene
        return TaskRow(
            participant=self._setup.participant,
            condition=self._setup.condition,
            trial=self._setup.trial,
            task=self._number(cycle, kind),
            kind=kind,
            goal=cycle_setup.object if kind == "pickup" else (cycle_setup.bin or ""),
            object=cycle_setup.object,
            goals=goals or len(scene.objects if kind == "pickup" else scene.bins),
            outcome=ended[0],
            reason=ended[1],
            first_tick=span.first_tick,
            last_tick=span.last_tick,
            attempts=self.attempt if cycle == self.cycle else 1,
        )
