"""Recorded inputs: of simulated people, or of real ones from an export."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby, islice
from pathlib import Path

from app.replay.recording import CannotReplay, ExportedTrials, Recording
from app.simulated.participant import Case, Record
from app.simulated.study import setup_of
from app.trial.values import TrialSetup
from study.definition.study import plan_session
from study.records import TickRow


@dataclass(frozen=True)
class Recorded:
    """The ticks of one trial as they were recorded, and what it depends on besides."""

    setup: TrialSetup
    rows: tuple[TickRow, ...]

    def attempts(self) -> Iterator[tuple[TickRow, ...]]:
        """The ticks of each attempt at each pick-and-place; every one has a fresh world."""
        for _, rows in groupby(self.rows, key=lambda row: (row.cycle, row.attempt)):
            yield tuple(rows)


def of_person(case: Case, record: Record) -> Iterator[Recorded]:
    """The trials that a simulated person left behind."""
    plan = plan_session(case.setup.study, case.order, case.seed)
    for trial, rows in groupby(record["ticks"], key=lambda row: row.trial):
        yield Recorded(case.setup.trial_setup(case.participant, plan, trial, "trial"), tuple(rows))


@dataclass(frozen=True)
class Export:
    """What is taken of an export: the study file, and the trials of some people."""

    folder: Path
    study_text: str
    people: int
    robots: tuple[str, ...]
    """What they drove, as the export says it."""
    trials: tuple[Recorded, ...]


def read_export(folder: Path, most_people: int, trust: bool) -> Export:
    """The trials of the first people who have any. Those who were enrolled with another study file than the first one
    are left out.

    Raises `CannotReplay` and `study.export.export.ExportError` with one line for what cannot be read.
    """
    recordings = (one for one in ExportedTrials(folder).of() if one.ticks)
    by_person = groupby(recordings, key=lambda one: one.participant.participant)
    people = [list(of_person) for _, of_person in islice(by_person, most_people)]
    if not people:
        raise CannotReplay(f"{folder}: no ticks of trials in it; at least one participant must have driven")
    text = people[0][0].study_text
    own = [found for found in people if found[0].study_text == text]
    facts = (fact for found in own for one in found for fact in one.ran_on.robots)
    robots = tuple(dict.fromkeys(fact.get("robot", "") for fact in facts))
    return Export(folder, text, len(own), robots, tuple(_recorded(one, trust) for found in own for one in found))


def _recorded(recording: Recording, trust: bool) -> Recorded:
    person, setup = recording.participant, setup_of(recording.study_text, trust)
    plan = plan_session(setup.study, tuple(person.condition_order.split(">")), person.seed)
    return Recorded(setup.trial_setup(person.participant, plan, recording.trial, "trial"), recording.ticks)
