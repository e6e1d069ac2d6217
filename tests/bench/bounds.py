"""What a simulated study takes at least, however its arithmetic is done. See `tests.bench`.

Whatever is made of the arithmetic of inference and arbiter, the participants' all at once perhaps, saves at most what
it takes. Here nothing of it is worked out: the answers of a run before are played back. What is left of a tick is what
a person, the robot and the record take. Seconds are those of the processor, the fewest of some runs, a few ticks at a
time.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from app.autonomy.arbiters import weighing
from app.autonomy.inference.boltzmann import Boltzmann
from app.simulated import participant
from app.simulated.participant import Record
from app.simulated.study import Plan, make_plan
from app.trial.engine import TrialEngine
from app.trial.robots import make_robot
from app.trial.setup import study_setup
from app.trial.world import open_study
from study.export.export import write_tables
from study.integrity.chain import chained
from study.records import TABLES
from tests.bench.engine import first_trial, pilots_input
from tests.bench.figure import Figure
from tests.support.arbiter_cases import CONDITIONS

RUNS = 6
STRETCH = 25
"""Ticks that are timed at a time."""
ARITHMETIC: tuple[tuple[Any, str], ...] = (
    (Boltzmann, "update"),
    (weighing, "rough_gains"),
    (weighing, "moves_rewards_m"),
)
"""The functions whose answers are played back."""

Run = Callable[[Callable[[], None]], None]
"""Goes through some ticks and tells after each."""


def bound_figures() -> Iterator[Figure]:
    """Microseconds a tick, with the arithmetic and without; and what a row takes after its tick."""
    plan = make_plan(0, "kinematic", None)
    setup = study_setup(open_study(None))
    cycles = [partial(_cycles, first_trial(setup, condition)) for condition in CONDITIONS]
    for what, runs in (
        ("a simulated participant's tick", [partial(_study, plan, 1)]),
        ("a tick of whole cycles, the scripted pilot with it", cycles),
    ):
        ticks, whole_s, bare_s = (sum(parts) for parts in zip(*map(_both, runs), strict=True))
        yield Figure(f"{what}, kinematic", f"{1e6 * whole_s / ticks:.0f} us")
        yield Figure("  the same, inference and arbiter played back", f"{1e6 * bare_s / ticks:.0f} us")
    yield from _row_figures(plan.run(1))


def _both(run: Run) -> tuple[int, float, float]:
    """How many ticks, and their seconds with the arithmetic and without."""
    with _recorded() as answers:
        ticks = len(_ticks(run))
    whole_s = _fewest(run, ticks)
    bare_s = _fewest(run, ticks, lambda: _played(answers))
    return ticks, whole_s, bare_s


def _ticks(run: Run) -> list[float]:
    """The processor's time after each tick, with that of the beginning before the first."""
    times_s = [time.process_time()]
    run(lambda: times_s.append(time.process_time()))
    return times_s


def _fewest(run: Run, ticks: int, within: Callable[[], Any] | None = None) -> float:
    found = []
    for _ in range(RUNS):
        if within is None:
            times_s = _ticks(run)
        else:
            with within():
                times_s = _ticks(run)
        found.append(np.diff([*times_s[:-1:STRETCH], times_s[-1]]))
    fewest_s: float = np.min(found, axis=0).sum()
    return fewest_s


@contextmanager
def _recorded() -> Iterator[list[list[Any]]]:
    """Inside, what the arithmetic answers is kept."""
    kept: list[list[Any]] = [[] for _ in ARITHMETIC]

    def keeping(work: Callable[..., Any], answers: list[Any]) -> Callable[..., Any]:
        def asked(*asked_for: Any) -> Any:
            answers.append(work(*asked_for))
            return answers[-1]

        return asked

    with _replaced([keeping(getattr(*place), answers) for place, answers in zip(ARITHMETIC, kept, strict=True)]):
        yield kept


@contextmanager
def _played(kept: list[list[Any]]) -> Iterator[None]:
    """Inside, it answers what it did when it was `_recorded`."""

    def playing(answers: list[Any]) -> Callable[..., Any]:
        left = iter(answers)
        return lambda *asked_for: next(left)

    with _replaced([playing(answers) for answers in kept]):
        yield


@contextmanager
def _replaced(by: list[Callable[..., Any]]) -> Iterator[None]:
    (first, second, third) = (patch.object(*place, one) for place, one in zip(ARITHMETIC, by, strict=True))
    with first, second, third:
        yield


def _study(plan: Plan, index: int, told: Callable[[], None]) -> None:
    """A whole simulated participant."""
    tick = participant._Sitting._tick

    def told_tick(sitting: Any, engine: TrialEngine) -> None:
        tick(sitting, engine)
        told()

    with patch.object(participant._Sitting, "_tick", told_tick):
        plan.run(index)


def _cycles(trial: Any, told: Callable[[], None]) -> None:
    """A whole trial by the scripted pilot."""
    robot = make_robot("kinematic")
    engine = TrialEngine(trial, robot)
    engine.open()
    pilot = pilots_input(trial)
    while not engine.finished:
        engine.tick(pilot(engine))
        told()
    robot.close()


def _row_figures(record: Record) -> Iterator[Figure]:
    """What a row takes after its tick: its link of the chain, and being written as CSV and Parquet."""
    (person,) = record["participants"]
    rows = sum(map(len, record.values()))
    yield Figure(
        "a row's link of the chain", f"{1e6 * _least_s(lambda: chained(person.participant, record)) / rows:.0f} us"
    )
    whole = {**record, "chain": chained(person.participant, record)}
    rows += len(whole["chain"])
    with tempfile.TemporaryDirectory() as folder:
        spent_s = _least_s(lambda: write_tables(Path(folder) / "export", {table: whole[table] for table in TABLES}))
    yield Figure("a row as CSV and Parquet, links too", f"{1e6 * spent_s / rows:.0f} us")


def _least_s(work: Callable[[], object]) -> float:
    spent_s = []
    for _ in range(RUNS):
        started_s = time.process_time()
        work()
        spent_s.append(time.process_time() - started_s)
    return min(spent_s)
