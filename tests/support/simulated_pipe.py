"""A worker in simulated time: clock and pipe in one, so that waiting costs nothing and every moment is exact."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import pytest

from app.autonomy.actions import Direction
from app.trial.engine import TrialEngine
from app.worker.line import Line
from app.worker.messages import Alive, ControlsState, Stop, WorkerCommand, WorkerReport, WorkerSpec
from app.worker.spectator_view import OnDemandView
from app.worker.worker import Worker
from sim.interface import Robot

UNIX_S = 1_700_000_000.0
STAYS_OPEN = (1e9, Stop())
"""A lab that stops its worker listens on until the worker has ended."""

Schedule = list[tuple[float, WorkerCommand]]
"""Commands, each with the second at which it arrives."""
ReportType = TypeVar("ReportType", bound=WorkerReport)


@dataclass(frozen=True)
class Sent:
    """A report and when it was sent, seconds since the worker started."""

    at_s: float
    report: Any


class SimulatedPipe:
    """Stands for `time` and for the connection: commands arrive at their times, the clock moves when it is waited.

    After the last command the lab is gone, as a closed pipe says it.
    """

    def __init__(self, schedule: Iterable[tuple[float, WorkerCommand]]) -> None:
        self.now_s = 0.0
        self.sent: list[Sent] = []
        self._coming = sorted(schedule, key=lambda entry: entry[0])

    def monotonic(self) -> float:
        return self.now_s

    def poll(self, timeout_s: float) -> bool:
        if not self._coming:
            return True  # end of file
        arrives_s = self._coming[0][0]
        if arrives_s > self.now_s + timeout_s:
            self.now_s += timeout_s
            return False
        self.now_s = max(self.now_s, arrives_s)
        return True

    def recv(self) -> WorkerCommand:
        if not self._coming:
            raise EOFError
        return self._coming.pop(0)[1]

    def send(self, report: Any) -> None:
        self.sent.append(Sent(self.now_s, report))


def beats(
    start_s: float, end_s: float, seq: int = 0, direction: Direction | None = None, every_s: float = 0.1
) -> Schedule:
    """A page's heartbeats."""
    count = round((end_s - start_s) / every_s) + 1
    return [(start_s + every_s * k, ControlsState(seq, direction, beat=True)) for k in range(count)]


def simulate(
    monkeypatch: pytest.MonkeyPatch,
    spec: WorkerSpec,
    robot: Robot,
    schedule: Sequence[tuple[float, WorkerCommand]],
    scene: Any = None,
    pipe: SimulatedPipe | None = None,
    spectator_view: OnDemandView | None = None,
) -> list[Sent]:
    """Everything a worker reports while these commands arrive; the last one must end it. Signs of life, which say
    nothing else, stand in `pipe.sent` only."""
    assert any(isinstance(command, Stop) for _, command in schedule)
    pipe = pipe or SimulatedPipe([*schedule, STAYS_OPEN])
    monkeypatch.setattr("app.worker.worker.time", pipe)
    engine = TrialEngine(spec.setup, robot, spec.start)
    Worker(cast(Line, pipe), spec, engine, scene, spectator_view).serve()
    return [entry for entry in pipe.sent if not isinstance(entry.report, Alive)]


def of(sent: Sequence[Sent], kind: type[ReportType]) -> list[ReportType]:
    """The reports of one kind, in order."""
    return [entry.report for entry in sent if isinstance(entry.report, kind)]
