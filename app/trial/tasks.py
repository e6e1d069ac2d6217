"""Where a trial stands: the cycle, the task in it, and the task rows that follow."""

from __future__ import annotations

from typing import Literal

from app.trial.values import CycleSetup, TrialSetup
from app.trial.verdicts import Verdict
from study.records import TaskRow


class TaskProgress:
    """Counts cycles and tasks. Practice repeats its one cycle for as long as it takes; its tasks stay 1 and 2.

    Attributes:
        cycle: number of the current cycle, from 1.
        cycle_setup: what it is made of.
        kind: the current task of the cycle.
    """

    cycle: int
    cycle_setup: CycleSetup

    def __init__(self, setup: TrialSetup, cycle: int) -> None:
        self.kind: Literal["pickup", "dropoff"] = "pickup"
        self._setup = setup
        self._set_cycle(cycle)
        self._first_tick: int | None = None
        self._goals = 0

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
        return self._number(self.kind)

    @property
    def goal(self) -> str | None:
        """Id of the instructed object or bin; None for a practice dropoff, which may go anywhere."""
        return self.cycle_setup.object if self.kind == "pickup" else self.cycle_setup.bin

    def begin_task(self, tick: int, goals: int) -> None:
        """Note the first tick of the task and how many goals it began with; later calls change nothing."""
        if self._first_tick is None:
            self._first_tick, self._goals = tick, goals

    def to_dropoff(self) -> None:
        """The pickup is done."""
        self.kind, self._first_tick = "dropoff", None

    def to_cycle(self, cycle: int) -> None:
        """Another cycle begins with its pickup."""
        self.kind, self._first_tick = "pickup", None
        self._set_cycle(cycle)

    def _set_cycle(self, cycle: int) -> None:
        self.cycle, self.cycle_setup = cycle, self._setup.cycles[min(cycle, len(self._setup.cycles)) - 1]

    def row(self, verdict: Verdict, last_tick: int) -> TaskRow:
        """The row of the task that just ended."""
        return self._row(self.kind, verdict.outcome, verdict.reason, self._goals, self._first_tick, last_tick)

    def not_run_row(self) -> TaskRow:
        """The row of the dropoff after a failed pickup."""
        return self._row("dropoff", "not_run", "pickup_failed", len(self.cycle_setup.scene.bins), None, None)

    def _number(self, kind: str) -> int:
        cycle = self.cycle if self._setup.kind == "trial" else 1
        return 2 * cycle - (1 if kind == "pickup" else 0)

    def _row(
        self,
        kind: str,
        outcome: str,
        reason: str | None,
        goals: int,
        first_tick: int | None,
        last_tick: int | None,
    ) -> TaskRow:
        cycle_setup = self.cycle_setup
        return TaskRow(
            participant=self._setup.participant,
            condition=self._setup.condition,
            trial=self._setup.trial,
            task=self._number(kind),
            kind=kind,
            goal=cycle_setup.object if kind == "pickup" else (cycle_setup.bin or ""),
            object=cycle_setup.object,
            goals=goals,
            outcome=outcome,
            reason=reason,
            first_tick=first_tick,
            last_tick=last_tick,
        )
