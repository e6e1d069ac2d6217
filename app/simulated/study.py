"""`salab simulate`: N simulated participants, spread over processes, resumable, exported like a real study.

Participant k depends on the seed and k alone, never on the others or on who runs them: any number of workers, and any
number of interruptions, leave the same bytes. Finished participants wait in `OUT.part/`, one folder each, until all
are done; then `OUT` is written and the folder goes.
"""

from __future__ import annotations

import gzip
import json
import os
import shutil
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from functools import lru_cache, partial
from itertools import islice
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from app.errors import LabError
from app.simulated.participant import Case, Record, simulate_participant
from app.simulated.progress import progress
from app.simulated.traits import Population
from app.simulated.variants import changed_study, population_of, preset_changes
from app.trial.robots import ROBOTS, make_robot, robot_facts
from app.trial.setup import StudySetup, study_setup
from app.trial.world import open_study, parse_text
from study.definition.study import Study, orders
from study.export.export import check_place, write_tables
from study.flow.flow import FLOW, Flow
from study.integrity.chain import chained
from study.records import SCHEMA_VERSION, TABLES, columns, row_of
from study.store import machine_fingerprint

MAX_PARTICIPANTS = 9999
MAX_WORKERS = 256
MAX_SEED = 2**63 - 1
AHEAD = 3
"""Jobs for each process that it has been given or is doing: none waits, and ten thousand are not held."""

Job = TypeVar("Job")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Plan:
    """What is simulated. `study_text` is the whole study file, changes included."""

    study_text: str
    seed: int
    robot: str = "kinematic"
    population: Population = field(default_factory=Population)
    flow: Flow = FLOW
    trust: bool = False
    """Whether code that the study's text holds from files beside the study file may run."""

    def case(self, index: int) -> Case:
        """Participant `index`, from 0: orders in turn, so that every six fill the counterbalancing once."""
        setup = setup_of(self.study_text, self.trust)
        choices = orders(setup.study)
        order = choices[index % len(choices)]
        return Case(setup, index, participant_seed(self.seed, index), order, self.population, self.flow)

    def run(self, index: int) -> Record:
        """Simulate that participant."""
        return simulate_participant(self.case(index), partial(make_robot, self.robot))

    def settings(self) -> dict[str, Any]:
        """Everything the bytes depend on, for the record and for resuming."""
        own = self.flow.states != FLOW.states
        return {
            **({"pages": list(self.flow.states)} if own else {}),
            "seed": self.seed,
            **_robot_told(self.robot),
            "study": setup_of(self.study_text, self.trust).study.hash,
            "population": {"means": dict(self.population.means), "spread_scale": self.population.spread_scale},
            "schema_version": SCHEMA_VERSION,
        }


def _robot_told(name: str) -> dict[str, Any]:
    """Its name, and what is known of one that does not ship."""
    facts = robot_facts(name)
    return {"robot": name, **({"robot_facts": facts} if len(facts) > 1 else {})}


@lru_cache(maxsize=64)
def setup_of(study_text: str, trust: bool = False) -> StudySetup:
    """The study of that text, calibrated; once a process."""
    return study_setup(parse_text(study_text, "the study simulated", trust), trust)


def make_plan(
    seed: int,
    robot: str,
    preset: str | None,
    study_file: Path | None = None,
    trust: bool = False,
    flow: Flow = FLOW,
) -> Plan:
    """The study, with a preset's numbers if named, and its people. Raises `LabError`, `StudyFileError`, and
    `PartError` for a part that cannot be used."""
    ROBOTS.require(robot)
    if not 0 <= seed <= MAX_SEED:
        raise LabError(f"seed {seed}; it must be from 0 to {MAX_SEED}")
    changes = preset_changes(preset, layout=study_file is None)
    study: Study = changed_study(open_study(study_file, trust), changes, trust)
    setup_of(study.source_text, trust)  # what cannot be used is told before any work
    return Plan(study.source_text, seed, robot, population_of(preset), flow, trust)


def participant_seed(seed: int, index: int) -> int:
    """The seed of participant `index`: 48 bits, as the lab draws for real ones."""
    state = np.random.SeedSequence(seed, spawn_key=(index,)).generate_state(1, np.uint64)
    return int(state[0] >> np.uint64(16))


def simulate(plan: Plan, participants: int, workers: int, out_dir: Path, preset: str | None) -> dict[str, int]:
    """Simulate and export; rows per table. Raises `LabError` and `study.export.export.ExportError`."""
    check_count("participants", participants, MAX_PARTICIPANTS)
    check_count("workers", workers, MAX_WORKERS)
    check_free(out_dir)
    parts = _Parts(out_dir.with_name(out_dir.name + ".part"), plan)
    missing = [index for index in range(participants) if not parts.has(index)]
    with progress("participants", participants, participants - len(missing)) as bar:
        for _ in run_jobs(parts.make, missing, workers):
            bar.update()
    meta = {
        "machines": [machine_fingerprint()],
        "erased_participants": 0,
        "simulated": {"participants": participants, "preset": preset, **plan.settings()},
    }
    tables = {table: parts.rows(table, participants) for table in TABLES}
    studies = {setup_of(plan.study_text, plan.trust).study.hash: plan.study_text}
    counts = write_tables(out_dir, tables, studies=studies, meta=meta)
    parts.remove()
    return counts


def run_jobs(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[tuple[Job, Result]]:
    """(job, result) as they are done: here, or in so many processes. What fails here fails the whole."""
    # Small matrices: threads inside a process only get into each other's way. Children inherit the setting.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if workers == 1 or len(jobs) <= 1:
        for job in jobs:
            yield job, work(job)
        return
    processes = min(workers, len(jobs))
    with ProcessPoolExecutor(processes, get_context("spawn"), _begin_process) as pool:
        ahead = iter(jobs)
        running = {pool.submit(work, job): job for job in islice(ahead, AHEAD * processes)}
        try:
            while running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    running.update((pool.submit(work, job), job) for job in islice(ahead, 1))
                    yield running.pop(future), future.result()
        except BrokenProcessPool:
            raise LabError("a process ended unexpectedly (out of memory?); start again, what is done is kept") from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _begin_process() -> None:
    """Interrupts are the parent's to deal with, and without it nothing is left to do."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name="end with the parent", daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def check_count(what: str, value: int, most: int) -> None:
    """Raises `LabError` unless 1 <= value <= most."""
    if not 1 <= value <= most:
        raise LabError(f"{what} is {value}; it must be from 1 to {most}")


def check_free(out_dir: Path) -> None:
    """Fail before the work, not after it, when the results could not be written."""
    if out_dir.exists() and not out_dir.is_dir():
        raise LabError(f"{out_dir}: is a file; choose a folder with --out")
    check_place(out_dir)
    try:
        out_dir.absolute().parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LabError(f"{out_dir}: cannot be made: {error.strerror or error}") from None


@dataclass(frozen=True)
class _Parts:
    """Finished participants on disk, one folder each with a file per table; a folder that is there is complete."""

    folder: Path
    plan: Plan

    def has(self, index: int) -> bool:
        """Whether that participant is done. The first call makes the folder, or checks that it is of this plan."""
        self._claim()
        return self._place(index).is_dir()

    def make(self, index: int) -> None:
        """Simulate that participant and put the rows away, all or nothing."""
        record = self.plan.run(index)
        (participant,) = record["participants"]
        record["chain"] = chained(participant.participant, record)
        place = self._place(index)
        unfinished = place.with_suffix(f".{os.getpid()}")
        unfinished.mkdir()
        for table, rows in record.items():
            text = json.dumps([list(vars(row).values()) for row in rows])
            (unfinished / table).write_bytes(gzip.compress(text.encode(), compresslevel=1))
        os.replace(unfinished, place)

    def rows(self, table: str, participants: int) -> Iterable[Any]:
        """The rows of a table, participant by participant."""
        row_type = TABLES[table]
        names = [info.name for info in columns(table)]
        for index in range(participants):
            for values in json.loads(gzip.decompress((self._place(index) / table).read_bytes())):
                yield row_of(row_type, dict(zip(names, values, strict=True)))

    def remove(self) -> None:
        """Everything is exported."""
        shutil.rmtree(self.folder)

    def _place(self, index: int) -> Path:
        return self.folder / f"{index:05d}"

    def _claim(self) -> None:
        settings: Mapping[str, Any] = self.plan.settings()
        note = self.folder / "settings.json"
        try:
            if not self.folder.exists():
                self.folder.mkdir()
                note.write_text(json.dumps(settings), encoding="utf-8")
            found = json.loads(note.read_text(encoding="utf-8"))
            if not isinstance(found, dict):
                raise ValueError("settings.json holds no settings")
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise LabError(f"{self.folder}: cannot be used: {why}; remove it or choose another --out") from None
        if found != settings:
            changed = sorted(name for name in settings if found.get(name) != settings[name])
            raise LabError(
                f"{self.folder}: holds an unfinished simulation with another {', '.join(changed)}; "
                "remove it, or choose another --out"
            )
