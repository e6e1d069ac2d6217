"""Recorded ticks run again, from what their rows say of the input alone.

The engine is the one they were made with. What it cannot know of itself stands in the rows: that somebody repeated the
practice, and that a worker which had just taken over began another attempt while the arm was going back.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.trial.engine import TrialEngine
from app.trial.values import CycleStart, TickResult, TrialSetup, inputs_of
from sim.interface import Robot
from study.records import TickRow


def rerun(setup: TrialSetup, robot: Robot, rows: Sequence[TickRow]) -> Iterator[TickResult]:
    """What each of these rows becomes when it is run again, in order; fewer than there are rows when the trial is over
    before.

    The rows are those of one trial, or of all practice before it, from the first tick on. Raises
    `app.trial.reasoning.PartFault` as the engine does.
    """
    start = CycleStart()
    engine: TrialEngine | None = None
    for number, row in enumerate(rows):
        repeated = setup.kind == "practice" and row.cycle != start.cycle
        if engine is None or repeated:
            start = start.repeated(row.cycle, row.tick) if repeated else start
            engine = _opened(setup, robot, start)
        elif engine.finished:
            return
        elif row.source == "free" and row.attempt > start.attempt and engine.view().phase == "reset":
            place = (start.cycle, start.attempt)
            start = start.after([done for done in rows[:number] if (done.cycle, done.attempt) == place])
            engine = _opened(setup, robot, start)
        result = engine.tick(inputs_of(row))
        start = result.cycle_start or start
        yield result


def _opened(setup: TrialSetup, robot: Robot, start: CycleStart) -> TrialEngine:
    engine = TrialEngine(setup, robot, start)
    engine.open()
    return engine
