"""Many simulated studies: each reduced, where it was run, to the values that are compared (`Values`), kept on disk so
that an interrupted run goes on where it was.

Study k of a run depends on the run's seed and k alone. Its participants take the orders in turn, as in the lab, but
beginning at an order of its own, so that a number that is no multiple of six leaves no order behind for good.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, overload

from app.errors import LabError
from app.replication.long_tasks import TaskLength, lengths_of_person
from app.replication.paper import REPORTED
from app.simulated.participant import Case, Record, simulate_trials
from app.simulated.progress import progress
from app.simulated.study import Plan, check_count, participant_seed, run_jobs
from app.trial.robots import make_robot
from sim.interface import Robot
from study.analysis.measures import measure
from study.analysis.observations import Observation, observations, survey_observations
from study.definition.study import orders
from study.flow.answers import survey_scores
from study.json_text import parse_json
from study.text_file import opened

Key = tuple[str, str]
"""Measure and kind, as in `app.replication.paper.REPORTED`."""
MAX_STUDIES = 10_000
VALUES_VERSION = 2
"""Of what a study on disk holds; 2 = with the length of every task."""
MOST_STUDY_BYTES = 50_000_000
"""Of one study on disk, unpacked: a hundred times a usual one."""
SURVEYS = ("sus_modified", "tlx_raw")


@dataclass(frozen=True)
class Values:
    """What is compared, for some participants: observations by measure and kind, a few counts, and how long tasks take
    without time limits."""

    observations: dict[Key, tuple[Observation, ...]]
    counts: dict[str, int] = field(default_factory=dict)
    lengths: tuple[TaskLength, ...] = ()

    def joined(self, others: Iterable[Values]) -> Values:
        """These and others together."""
        everything = [self, *others]
        return Values(
            {key: tuple(one for item in everything for one in item.observations[key]) for key in self.observations},
            {name: sum(item.counts.get(name, 0) for item in everything) for name in self.counts},
            tuple(task for item in everything for task in item.lengths),
        )


def study_seed(seed: int, study: int) -> int:
    """The seed of study `study`, from 0."""
    return participant_seed(seed, study)


def run_participant(plan: Plan, first_order: int, index: int) -> Values:
    """One participant's values. Someone who gave up is left out, as an incomplete participant is from an analysis."""
    case, robot = rotated(plan, first_order, index), partial(make_robot, plan.robot)
    return measured(case, simulate_trials(case, robot), robot)


def rotated(plan: Plan, first_order: int, index: int) -> Case:
    """That participant of a study whose first one has order `first_order`."""
    case = plan.case(index)
    choices = orders(case.setup.study)
    return replace(case, order=choices[(first_order + index) % len(choices)])


def measured(case: Case, record: Record, robot: Callable[[], Robot]) -> Values:
    """What is compared of a participant's record."""
    complete = len(record["tasks"]) == len(case.order) * case.setup.study.tasks_per_trial
    measures = measure(record["tasks"], record["ticks"]) if complete else measure([], [])
    scores = survey_scores(record["survey_answers"]) if complete else ()
    found: dict[Key, tuple[Observation, ...]] = {}
    for item in REPORTED:
        if item.measure in SURVEYS:
            found[item.measure, item.kind] = survey_observations(scores, item.measure)
        else:
            found[item.measure, item.kind] = observations(measures, item.measure, item.kind)
    counts = {
        "participants": 1,
        "gave_up": 0 if complete else 1,
        "tasks": len(measures.tasks),
        "ticks": len(record["ticks"]),
        "failed_pickups": sum(t.kind == "pickup" and t.outcome == "failure" for t in measures.tasks),
        "failed_dropoffs": sum(t.kind == "dropoff" and t.outcome == "failure" for t in measures.tasks),
        "never_converged": sum(t.convergence_user_actions is None for t in measures.analysed_tasks()),
        "windows_pickup": len(measures.analysed_windows("pickup")),
        "windows_all": len(measures.analysed_windows()),
        "uncertain_windows_pickup": len(measures.gains("pickup")),
        "uncertain_windows_all": len(measures.gains()),
    }
    return Values(found, counts, lengths_of_person(case, record, robot))


def run_study(plan: Plan, participants: int, study: int) -> Values:
    """One study's values."""
    own = replace(plan, seed=study_seed(plan.seed, study))
    first, *others = [run_participant(own, study * participants, index) for index in range(participants)]
    return first.joined(others)


def packed(values: Values) -> bytes:
    """A study as it is kept, a tenth of what it takes as values: compressed JSON."""
    data = {
        "observations": {"/".join(key): [astuple(one) for one in of] for key, of in values.observations.items()},
        "counts": values.counts,
        "lengths": [astuple(one) for one in values.lengths],
    }
    return gzip.compress(json.dumps(data).encode(), compresslevel=3, mtime=0)


def unpacked(study: bytes) -> Values:
    """The study that was `packed`. Raises `ValueError` and others for what is none."""
    with gzip.open(io.BytesIO(study)) as file:
        text = file.read(MOST_STUDY_BYTES + 1)  # no more, whatever it unpacks to
    if len(text) > MOST_STUDY_BYTES:
        raise ValueError(f"unpacks to more than {MOST_STUDY_BYTES / 1e6:g} MB")
    data = parse_json(text)
    return Values(
        {
            (name, kind): tuple(Observation(*values) for values in of)
            for (name, kind), of in ((key.split("/"), of) for key, of in data["observations"].items())
        },
        dict(data["counts"]),
        tuple(TaskLength(*values) for values in data["lengths"]),
    )


class Studies(Sequence[Values]):
    """Many studies, each packed until it is looked at: so many trials more make so little more to hold. Whoever looks
    at all of them does so once, study by study."""

    def __init__(self, studies: Iterable[bytes]) -> None:
        self._packed = tuple(studies)

    @classmethod
    def of(cls, studies: Iterable[Values]) -> Studies:
        """Those studies, one packed after the other."""
        return cls(packed(study) for study in studies)

    @property
    def packed(self) -> tuple[bytes, ...]:
        """As they are held."""
        return self._packed

    def __len__(self) -> int:
        return len(self._packed)

    def __eq__(self, other: object) -> bool:
        return self._packed == other._packed if isinstance(other, Studies) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._packed)

    @overload
    def __getitem__(self, place: int) -> Values: ...
    @overload
    def __getitem__(self, place: slice) -> Studies: ...
    def __getitem__(self, place: int | slice) -> Values | Studies:
        return Studies(self._packed[place]) if isinstance(place, slice) else unpacked(self._packed[place])


@dataclass(frozen=True)
class Archive:
    """Finished studies on disk, one file each, or whatever else `what` says. With no folder nothing is kept."""

    folder: Path | None
    settings: dict[str, Any]
    what: str = "study"

    def open(self) -> None:
        """Make the folder, or check that what is there is of the same run. Raises `LabError`."""
        if self.folder is None:
            return
        note = self.folder / "settings.json"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if not note.exists():
                note.write_text(json.dumps(self.settings), encoding="utf-8")
            found = json.loads(note.read_text(encoding="utf-8"))
            if not isinstance(found, dict):
                raise ValueError("settings.json holds no settings")
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise LabError(f"{self.folder}: cannot be used: {why}; choose another --out") from None
        if found != self.settings:
            changed = sorted(name for name in self.settings if found.get(name) != self.settings[name])
            raise LabError(
                f"{self.folder}: holds studies with another {', '.join(changed)}; remove it, or choose another --out"
            )

    def load(self, study: int) -> Values | None:
        """A finished study; None when it is still to be run."""
        if self.folder is None or not self._place(study).is_file():
            return None
        try:
            with opened(self._place(study), MOST_STUDY_BYTES) as file:
                return unpacked(file.read(MOST_STUDY_BYTES + 1))
        except (OSError, EOFError, zlib.error, ValueError, TypeError, KeyError, AttributeError) as error:
            why = getattr(error, "reason", None) or f"{type(error).__name__}: {error}"
            raise LabError(f"{self._place(study)}: is no finished {self.what}: {why}; remove it") from None

    def save(self, study: int, values: Values | bytes) -> None:
        """Put a study away, packed already or not, all or nothing."""
        if self.folder is None:
            return
        unfinished = self._place(study).with_suffix(f".{os.getpid()}")
        unfinished.write_bytes(values if isinstance(values, bytes) else packed(values))
        os.replace(unfinished, self._place(study))

    def _place(self, study: int) -> Path:
        assert self.folder is not None
        return self.folder / f"{self.what}-{study:04d}.json.gz"


@dataclass(frozen=True)
class Batch:
    """The first so many studies of a plan, and where they are kept; with no folder they are not."""

    plan: Plan
    studies: int
    folder: Path | None


def run_studies(plan: Plan, studies: int, participants: int, workers: int, folder: Path | None) -> Studies:
    """The values of every study, in order; those on disk are not run again."""
    return run_batches([Batch(plan, studies, folder)], participants, workers, "studies")[0]


def run_batches(batches: Sequence[Batch], participants: int, workers: int, what: str) -> list[Studies]:
    """The values of every study of every batch: one set of processes for all of them, since starting it takes
    seconds."""
    archives = []
    for batch in batches:
        check_count("studies", batch.studies, MAX_STUDIES)
        settings = {**batch.plan.settings(), "participants": participants, "values_version": VALUES_VERSION}
        archives.append(Archive(batch.folder, settings))
        archives[-1].open()
    jobs = [(number, study) for number, batch in enumerate(batches) for study in range(batch.studies)]
    done = {job: packed(values) for job in jobs if (values := archives[job[0]].load(job[1])) is not None}
    missing = [job for job in jobs if job not in done]
    if missing:
        work = partial(_run_job, tuple(batch.plan for batch in batches), participants)
        with progress(what, len(jobs), len(done)) as bar:
            for job, study in run_jobs(work, missing, workers):
                archives[job[0]].save(job[1], study)
                done[job] = study
                bar.update()
    return [Studies(done[number, study] for study in range(batch.studies)) for number, batch in enumerate(batches)]


def _run_job(plans: tuple[Plan, ...], participants: int, job: tuple[int, int]) -> bytes:
    """One study of one batch. Batches one after the other, since a process calibrates each plan that it meets."""
    number, study = job
    return packed(run_study(plans[number], participants, study))


@dataclass(frozen=True)
class Person:
    """One simulated participant of many studies; `order` is the order of conditions."""

    study: int
    participant: str
    order: tuple[str, ...]


@dataclass(frozen=True)
class Pool:
    """All people of several studies, to draw new studies from."""

    people: tuple[Person, ...]
    own: dict[Person, dict[Key, tuple[Observation, ...]]]

    @classmethod
    def of(cls, studies: Sequence[Values]) -> Pool:
        """Everyone who completed; participants get names that are theirs alone."""
        own: dict[tuple[int, str], dict[Key, list[Observation]]] = {}
        for number, values in enumerate(studies):
            for key, of in values.observations.items():
                for one in of:
                    of_person = own.setdefault((number, one.participant), {})
                    of_person.setdefault(key, []).append(replace(one, participant=f"{number}-{one.participant}"))
        people = {}
        for (number, name), of_person in own.items():
            places = {one.position: one.condition for of in of_person.values() for one in of}
            order = tuple(places[place] for place in sorted(places))
            people[Person(number, name, order)] = {key: tuple(of) for key, of in of_person.items()}
        return cls(tuple(people), people)

    def values(self, people: Iterable[Person]) -> Values:
        """A study of those people."""
        chosen = list(people)
        keys = dict.fromkeys(key for person in chosen for key in self.own[person])
        return Values({key: tuple(one for person in chosen for one in self.own[person].get(key, ())) for key in keys})
