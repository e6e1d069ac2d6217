"""The same simulated people on each robot: everybody sees what their robot does, and goes on from there.

People are those of `salab replicate`: study k and person i depend on the seed, k and i alone. What is kept of a person
on a robot are the values that are compared, by measure, kind and condition.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby, pairwise
from pathlib import Path

from app.physics_comparison.watched import WatchedRobot
from app.replication.studies import Archive, Key, Values, rotated, study_seed
from app.simulated.participant import Case, Record, simulate_trials
from app.simulated.progress import progress
from app.simulated.study import Plan, run_jobs
from app.trial.robots import make_robot
from study.analysis.measures import CONTROL_SOURCES, TaskKind, measure
from study.analysis.observations import Observation, observations
from study.records import TickRow

MEASURES: tuple[tuple[str, TaskKind], ...] = (
    ("efficiency_ticks", "pickup"),
    ("efficiency_ticks", "dropoff"),
    ("belief_gain", "pickup"),
    ("belief_gain", "dropoff"),
    ("convergence_user_actions", "pickup"),
    ("convergence_user_actions", "dropoff"),
    ("window_rate", "all"),
)
"""The study's measures. Usability and workload are left out: their values follow from an assumed model."""
OUTCOMES: Mapping[Key, str] = {
    ("picked", "pickup"): "pickups that succeeded",
    ("delivered", "dropoff"): "dropoffs that succeeded, of those that were run",
    ("dropped", "carry"): "attempts at a pick-and-place in which what was held was lost without a button",
    ("pushed", "attempt"): "objects moved by more than 1 cm that were never held, an attempt",
}
BLOCKED: tuple[Key, ...] = (("blocked_ticks", "pickup"), ("blocked_ticks", "dropoff"))
"""Control ticks of a task in which the arm was asked to move and did not."""
VALUES_VERSION = 1
"""Of what a person on disk holds."""
CONTROL, REFUSED = "control_ticks", "blocked: "
"""Names of counts: of control ticks, and of those blocked, by reason."""


@dataclass(frozen=True)
class People:
    """Who drives: so many studies of so many people."""

    plan: Plan
    studies: int
    participants: int

    @property
    def number(self) -> int:
        """How many people there are."""
        return self.studies * self.participants

    def case(self, person: int) -> Case:
        """Person `person`, from 0, study after study."""
        study, index = divmod(person, self.participants)
        own = replace(self.plan, seed=study_seed(self.plan.seed, study))
        return rotated(own, study * self.participants, index)

    def drive(self, person: int, robot: str) -> Values:
        """That person's study on that robot. Somebody who gives up has no values, as in an analysis."""
        case, watched = self.case(person), list[WatchedRobot]()

        def make() -> WatchedRobot:
            watched.append(WatchedRobot(make_robot(robot)))
            return watched[-1]

        return values_of(case, simulate_trials(case, make), watched, f"{person:05d}")


def values_of(case: Case, record: Record, watched: Sequence[WatchedRobot], name: str) -> Values:
    """What is compared of a record; `watched` are the robots of its trials, in order, and `name` is the person's."""
    ticks: list[TickRow] = record["ticks"]
    complete = len(record["tasks"]) == len(case.order) * case.setup.study.tasks_per_trial
    found: dict[Key, tuple[Observation, ...]] = dict.fromkeys((*MEASURES, *OUTCOMES, *BLOCKED), ())
    if complete:
        measures = measure(record["tasks"], ticks)
        for of_measure, kind in MEASURES:
            found[of_measure, kind] = observations(measures, of_measure, kind)
        for task in measures.tasks:
            outcome = ("picked" if task.kind == "pickup" else "delivered", task.kind)
            found[outcome] += (
                Observation(float(task.outcome == "success"), task.condition, name, task.position, "", 0),
            )
        for key in BLOCKED:
            found[key] = tuple(_blocked(ticks, key[1], name))
        found["dropped", "carry"] = tuple(_dropped(ticks, name))
        for trial, (condition, robot) in enumerate(zip(case.order, watched, strict=True), 1):
            found["pushed", "attempt"] += tuple(
                Observation(float(world.pushed), condition, name, trial, "", 0) for world in robot.worlds
            )
    refused = Counter(row.blocked_reason or "no reason given" for row in ticks if row.blocked)
    control = sum(row.source in CONTROL_SOURCES for row in ticks)
    return Values(
        {key: tuple(replace(one, participant=name) for one in of) for key, of in found.items()},
        {CONTROL: control, "gave_up": int(not complete), **{REFUSED + why: n for why, n in refused.items()}},
    )


def _blocked(ticks: Sequence[TickRow], kind: str, name: str) -> Iterator[Observation]:
    """Of every task of that kind."""
    blocked: Counter[tuple[str, int, int | None]] = Counter()
    for row in ticks:
        if row.kind == kind:
            blocked[row.condition, row.trial, row.task] += int(row.blocked and row.source in CONTROL_SOURCES)
    for (condition, trial, _), count in blocked.items():
        yield Observation(float(count), condition, name, trial, "", 0)


def _dropped(ticks: Sequence[TickRow], name: str) -> Iterator[Observation]:
    """Of every attempt in which something was held: whether it was lost while the fingers were told to hold it."""
    attempts = groupby(ticks, key=lambda row: (row.condition, row.trial, row.cycle, row.attempt))
    for (condition, trial, _, _), of_attempt in attempts:
        rows = list(of_attempt)
        if any(row.held for row in rows):
            lost = any(
                before.held is not None and row.held is None and row.gripper == "closed"
                for before, row in pairwise(rows)
            )
            yield Observation(float(lost), condition, name, trial, "", 0)


def run_people(people: People, robots: Sequence[str], workers: int, folder: Path | None) -> dict[str, Values]:
    """What everybody did on each robot. With a folder, each person is kept there when done, and none is run again."""
    archives = []
    for robot in robots:
        settings = {
            **replace(people.plan, robot=robot).settings(),
            "participants": people.participants,
            "values_version": VALUES_VERSION,
        }
        archives.append(Archive(None if folder is None else folder / robot, settings, "person"))
        archives[-1].open()
    jobs = [(number, person) for person in range(people.number) for number in range(len(robots))]
    done = {job: values for job in jobs if (values := archives[job[0]].load(job[1])) is not None}
    missing = [job for job in jobs if job not in done]
    with progress("people on robots", len(jobs), len(done)) as bar:
        for job, values in run_jobs(partial(_drive, people, tuple(robots)), missing, workers):
            archives[job[0]].save(job[1], values)
            done[job] = values
            bar.update()
    return {
        robot: _joined([done[number, person] for person in range(people.number)]) for number, robot in enumerate(robots)
    }


def _joined(everybody: Sequence[Values]) -> Values:
    joined = everybody[0].joined(everybody[1:])
    counts: Counter[str] = Counter()
    for one in everybody:
        counts.update(one.counts)  # nobody need have met every reason
    return replace(joined, counts=dict(counts))


def _drive(people: People, robots: Sequence[str], job: tuple[int, int]) -> Values:
    number, person = job
    return people.drive(person, robots[number])
