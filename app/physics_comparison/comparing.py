"""`salab compare-physics`: the same inputs and the same people on two robots or more.

    compared = compare_physics(asked)       paths up to first contact, values after it, and the rule's verdicts

The first robot named is the one the others are held against.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from app.errors import LabError
from app.physics_comparison.closed_loop import People, run_people
from app.physics_comparison.equivalence import Equivalence, equivalences
from app.physics_comparison.open_loop import Followed, Paths, follow, pooled
from app.physics_comparison.recorded import Export, Recorded, of_person
from app.physics_comparison.rule import rule
from app.replication.studies import Values
from app.simulated.participant import simulate_trials
from app.simulated.progress import progress
from app.simulated.study import MAX_WORKERS, check_count, run_jobs, setup_of
from app.trial.robots import ROBOTS, make_robot
from study.parts.errors import PartError

MAX_STUDIES = 1000
MAX_PEOPLE = 999

_Job = tuple[int, Recorded | None]


@dataclass(frozen=True)
class Asked:
    """What is compared. `recorded` people's inputs are run in open loop: of simulated ones on the first robot, or those
    of an export."""

    robots: tuple[str, ...]
    people: People
    recorded: int
    export: Export | None = None


@dataclass(frozen=True)
class Compared:
    """What came of it."""

    asked: Asked
    conditions: tuple[str, ...]
    followed: tuple[Followed, ...]
    paths: tuple[Paths, ...]
    values: Mapping[str, Values]
    """Of every robot."""
    equivalences: tuple[Equivalence, ...]

    @property
    def first(self) -> str:
        """The robot that the others are held against."""
        return self.asked.robots[0]

    def of(self, robot: str) -> tuple[Equivalence, ...]:
        """That robot's measures and outcomes beside the first's."""
        return tuple(one for one in self.equivalences if one.robot == robot)


def chosen_robots(named: Sequence[str]) -> tuple[str, ...]:
    """The robots named, or all that are installed when none is.

    Raises `LabError` for fewer than two, or one named twice, and `PartError` for one that is unknown or not installed.
    """
    if not named:
        lacking = {name: why for name in ROBOTS.names if (why := _lacking(name))}
        robots = tuple(name for name in ROBOTS.names if name not in lacking)
        if len(robots) < 2:
            raise LabError(f"only {', '.join(robots) or 'no robot'} is installed; {'; '.join(lacking.values())}")
        return robots
    for name in named:
        if named.count(name) > 1:
            raise LabError(f"robot {name!r} is named twice; it has nothing to be compared with in itself")
        ROBOTS.load(name)
    if len(named) < 2:
        others = ", ".join(name for name in ROBOTS.names if name != named[0])
        raise LabError(f"{named[0]} alone cannot be compared; name another robot beside it: {others}")
    return tuple(named)


def _lacking(name: str) -> str | None:
    try:
        ROBOTS.load(name)
    except PartError as error:
        return str(error)
    return None


def check(studies: int, participants: int, recorded: int, workers: int, of_export: bool = False) -> None:
    """Raises `LabError` out of bounds. Cheap: ask before any work."""
    check_count("studies", studies, MAX_STUDIES)
    check_count("participants", participants, MAX_PEOPLE)
    check_count("workers", workers, MAX_WORKERS)
    if studies * participants < 2:
        raise LabError("one person has no spread to judge a difference by; ask for at least two participants")
    check_count("recorded", recorded, MAX_PEOPLE if of_export else studies * participants)


def compare_physics(asked: Asked, workers: int, folder: Path | None) -> Compared:
    """Run everything, in so many processes. With a folder, people who are done are kept in it."""
    study = setup_of(asked.people.plan.study_text, asked.people.plan.trust).study
    conditions = tuple(item.id for item in study.conditions)
    # First, since what is in the folder may be of other people: that is to be told before minutes of work.
    values = run_people(asked.people, asked.robots, workers, folder)
    followed = _followed(asked, workers)
    first, *others = asked.robots
    return Compared(
        asked=asked,
        conditions=conditions,
        followed=followed,
        paths=pooled(followed, rule().quantile),
        values=values,
        equivalences=tuple(
            one
            for robot in others
            for one in equivalences(robot, values[first], values[robot], conditions, asked.people.participants)
        ),
    )


def _followed(asked: Asked, workers: int) -> tuple[Followed, ...]:
    given = [None] * asked.recorded if asked.export is None else asked.export.trials
    jobs: list[_Job] = list(enumerate(given))
    done: dict[int, list[Followed]] = {}
    with progress("people's inputs" if asked.export is None else "recorded trials", len(jobs)) as bar:
        for (number, _), found in run_jobs(partial(_follow, asked.people, asked.robots), jobs, workers):
            done[number] = found
            bar.update()
    return tuple(one for number in sorted(done) for one in done[number])


def _follow(people: People, robots: Sequence[str], job: _Job) -> list[Followed]:
    """A recorded trial, or where there is none that person's, who drives the first robot for it."""
    number, given = job
    makers = {name: partial(make_robot, name) for name in robots}
    if given is not None:
        return follow(given, makers)
    case = replace(people.case(number), index=number)
    record = simulate_trials(case, makers[robots[0]])
    return [found for one in of_person(case, record) for found in follow(one, makers)]
