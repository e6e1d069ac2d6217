"""What an export holds of one trial, or of the practice before it: all that a replay takes."""

from __future__ import annotations

import hashlib
import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from app.errors import LabError
from app.trial.values import PhaseKind
from study.export.export import columns_in, read_meta, read_table, rows_of_table
from study.flow.recorded import RAN_ON
from study.flow.recorded import RanOn as Noted
from study.records import EventRow, ParticipantRow, TaskRow, TickRow, TrialRow, columns
from study.store import fingerprint_id
from study.text_file import FileProblem, read_text

MAX_STUDY_BYTES = 64 * 1024 * 1024
"""Of a study file in an export: far more than one with its meshes and the sources of its parts has."""


class CannotReplay(LabError):
    """An export that lacks what a replay takes; one line with what would help."""


@dataclass(frozen=True)
class RanOn:
    """What the export says of robot and machine. `assumed` has for a fact that it does not state what was taken.

    `robots` are those that the ticks ran on: name, and package, version and source hash of one that does not ship. More
    than one where a lab was started again with another. `machines` are fingerprints, as of
    `study.store.machine_fingerprint`.
    """

    robots: tuple[Mapping[str, str], ...]
    machines: tuple[Mapping[str, str], ...]
    assumed: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Recording:
    """One trial (or practice) as recorded. `trial_row` and `tasks` are those of a trial; practice has none.

    `lacking` are columns of ticks and tasks that were not recorded when the export was made.
    """

    participant: ParticipantRow
    trial: int
    phase: PhaseKind
    ticks: tuple[TickRow, ...]
    study_text: str = field(repr=False)
    ran_on: RanOn
    trial_row: TrialRow | None = None
    tasks: tuple[TaskRow, ...] = ()
    lacking: frozenset[str] = frozenset()

    @property
    def called(self) -> str:
        """Such as `P001 trial 2`, or `P001 practice 1`."""
        return f"{self.participant.participant} {self.phase} {self.trial}"


class ExportedTrials:
    """The trials and practices of an export, read when they are asked for."""

    def __init__(self, folder: Path | str) -> None:
        """Raises `study.export.export.ExportError` for a folder that is no export."""
        self._folder = Path(folder)
        if not self._folder.is_dir():
            raise CannotReplay(f"{folder}: no such folder; give the folder that `salab export` wrote, unpacked")
        self._meta = read_meta(self._folder)
        self._people = {row.participant: row for row in read_table(folder, "participants")}
        self._trials = {(row.participant, row.trial): row for row in read_table(folder, "trials")}
        self._tasks: dict[tuple[str, int], list[TaskRow]] = defaultdict(list)
        for row in read_table(folder, "tasks"):
            self._tasks[row.participant, row.trial].append(row)
        said = ((row, RAN_ON.of(row)) for row in rows_of_table(folder, "events"))
        self._noted = [(row, noted) for row, noted in said if noted is not None]
        self._texts = _study_texts(self._folder)
        self._lacking = {table: _lacking(folder, table) for table in ("ticks", "practice_ticks", "tasks")}

    @property
    def people(self) -> tuple[str, ...]:
        """Ids of everybody in it."""
        return tuple(self._people)

    def of(
        self, participant: str | None = None, trial: int | None = None, phases: tuple[PhaseKind, ...] = ("trial",)
    ) -> Iterator[Recording]:
        """All of them, or those of one participant, or of one trial. Raises `CannotReplay` when the participant is not
        in the export, and `ExportError`."""
        if participant is not None and participant not in self._people:
            raise CannotReplay(f"{self._folder}: no participant {participant!r}; it has {_some(self.people)}")
        for phase in phases:
            rows = rows_of_table(self._folder, "ticks" if phase == "trial" else "practice_ticks", participant)
            found = set()
            for (who, number), ticks in groupby(rows, lambda row: (row.participant, row.trial)):
                found.add((who, number))
                if trial is None or trial == number:
                    yield self._recording(who, number, phase, tuple(ticks))
            for (who, number), row in self._trials.items() if phase == "trial" else ():
                lost = row.ticks > 0 and (who, number) not in found and participant in (None, who)
                if lost and trial in (None, number):
                    yield self._recording(who, number, phase, ())

    def _recording(self, who: str, trial: int, phase: PhaseKind, ticks: tuple[TickRow, ...]) -> Recording:
        if who not in self._people:
            raise CannotReplay(f"{self._folder}: ticks of {who!r}, who is not in participants.csv")
        person = self._people[who]
        if person.study_hash not in self._texts:
            raise CannotReplay(
                f"{self._folder}: no study file with the hash {person.study_hash[:12]}, which {who} was enrolled "
                "with; it is missing, or was changed"
            )
        return Recording(
            participant=person,
            trial=trial,
            phase=phase,
            ticks=ticks,
            study_text=self._texts[person.study_hash],
            ran_on=self._ran_on(who, trial, phase),
            trial_row=self._trials.get((who, trial)) if phase == "trial" else None,
            tasks=tuple(self._tasks.get((who, trial), ())) if phase == "trial" else (),
            lacking=self._lacking["ticks"] | self._lacking["tasks"]
            if phase == "trial"
            else self._lacking["practice_ticks"],
        )

    # ---- robot and machine --------------------------------------------------------------------------------------

    def _ran_on(self, who: str, trial: int, phase: PhaseKind) -> RanOn:
        machines = tuple(item for item in self._meta.get("machines", ()) if isinstance(item, dict))
        simulated = self._meta.get("simulated")
        if isinstance(simulated, dict) and "robot" in simulated:
            facts = simulated.get("robot_facts")
            told = [facts if isinstance(facts, dict) else {"robot": simulated["robot"]}]
            return RanOn(tuple(map(_robot_alone, told)), machines, _code_unknown(machines))
        assumed: dict[str, str] = _code_unknown(machines)
        noted = _in_force([one for one in self._noted if (one[0].participant, one[0].trial) == (who, trial)], phase)
        if not noted:
            theirs = [one for row, one in self._noted if row.participant == who]
            noted = theirs or [one for _, one in self._noted]
            if noted:
                whose = "their other" if theirs else "other people's"
                assumed["robot"] = f"the robot, taken from {whose} trials"
        robots = {json.dumps(facts): facts for facts in (_robot_alone(vars(one)) for one in noted)}
        by_id = {fingerprint_id(machine): machine for machine in machines}
        named = dict.fromkeys(one.machine for one in noted)
        if named and "robot" not in assumed and by_id.keys() >= named.keys():
            machines = tuple(by_id[name] for name in named)
        elif len(machines) > 1:
            assumed["machine"] = "the machine, which is one of several"
        return RanOn(tuple(robots.values()), machines, assumed)


def _lacking(folder: Path | str, table: str) -> frozenset[str]:
    return frozenset(info.name for info in columns(table)).difference(columns_in(folder, table))


def _code_unknown(machines: tuple[Mapping[str, str], ...]) -> dict[str, str]:
    is_known = machines and all("code" in machine for machine in machines)
    return {} if is_known else {"code": "the lab's code, taken for this one"}


def _in_force(noted: list[tuple[EventRow, Noted]], phase: PhaseKind) -> list[Noted]:
    """Those that ticks ran on: the last one before the first tick, and all that came on the way."""
    noted = [(row, one) for row, one in noted if one.phase == phase]
    before = [one for row, one in noted if row.tick is None]
    return [*before[-1:], *(one for row, one in noted if row.tick is not None)]


def _robot_alone(facts: Mapping[str, Any]) -> dict[str, str]:
    """Its name, and package, version and source hash of one that does not ship."""
    return {name: str(facts[name]) for name in ("robot", "package", "version", "sha256") if facts.get(name)}


def _study_texts(folder: Path) -> dict[str, str]:
    """Hash to text of every study file of an export."""
    texts = {}
    for path in sorted(folder.glob("study*.toml")):
        try:
            text = read_text(path, MAX_STUDY_BYTES, within=folder)
        except FileProblem as problem:
            raise CannotReplay(str(problem)) from None
        texts[hashlib.sha256(text.encode()).hexdigest()] = text
    return texts


def _some(names: tuple[str, ...]) -> str:
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "") if names else "nobody"
