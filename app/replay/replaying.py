"""A recorded trial run again on the robot that ran it, and compared with its record.

    for told in replay_all(folder, trust=False):
        print(told)                       # P001 trial 2: 513 ticks, the same bit for bit (bullet)

Inputs, pauses and presses come from the record; everything else is computed anew by the engine that ran the trial:
positions, beliefs, actions, who decided, what was refused, what the world was, tasks and how they ended.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

from app.errors import LabError
from app.replay.comparison import (
    OTHER_MACHINE_TOLERANCE,
    Difference,
    Measure,
    task_difference,
    tick_differences,
    trial_difference,
)
from app.replay.recording import CannotReplay, ExportedTrials, Recording
from app.trial.reasoning import PartFault
from app.trial.rerunning import rerun
from app.trial.robots import ROBOTS, make_robot, robot_facts
from app.trial.setup import StudySetup, study_setup
from app.trial.values import PhaseKind, TickResult
from app.trial.world import parse_stored
from study.definition.study import plan_session
from study.records import StudyError, TaskRow, TickRow, TrialRow
from study.store import machine_fingerprint

DECIDING = ("python", "system", "cpu", "blas", "numpy", "pybullet", "mujoco", "app", "code")
"""What of a machine's fingerprint decides whether its numbers are ours bit for bit; of the physics, the robot's."""
_ABSENT = "not recorded"


@dataclass(frozen=True)
class Asked:
    """How to replay. `robot` takes another one than was recorded, `tolerance` another bound than the machine asks for,
    `trust` lets code run that came with the study file."""

    robot: str | None = None
    tolerance: float | None = None
    trust: bool = False


@dataclass(frozen=True)
class Replayed:
    """What came of one replay.

    `ticks` counts those compared, `tolerance` 0 = bit for bit. `other` names what was different of the machine,
    `assumed` what the export does not say and was taken, `lacking` the columns that were not recorded then.
    """

    called: str
    state: Literal["same", "different", "cannot"]
    ticks: int = 0
    robot: str = ""
    tolerance: float = 0.0
    difference: Difference | None = None
    reason: str = ""
    other: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    lacking: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.state == "cannot":
            return f"{self.called}: cannot be replayed: {self.reason}"
        how = f"within {self.tolerance:g}" if self.tolerance else "bit for bit"
        said = f"{self.ticks} ticks, the same {how}" if self.state == "same" else str(self.difference)
        notes = [self.robot, *(f"assumed: {fact}" for fact in self.assumed)]
        if self.lacking:
            notes.append(f"not recorded then: {', '.join(self.lacking)}")
        if self.other:
            notes.append(f"another machine: {', '.join(self.other)}")
        return f"{self.called}: {said} ({'; '.join(notes)})"


def replay(recording: Recording, asked: Asked = Asked(), here: Mapping[str, str] | None = None) -> Replayed:
    """Replay one recording on this machine, whose fingerprint may be given as `here`. Never raises for what the export
    holds: what cannot be replayed says why."""
    try:
        return _replay(recording, asked, here if here is not None else machine_fingerprint())
    except PartFault as fault:
        return Replayed(recording.called, "cannot", reason=f"{fault}")
    except (LabError, StudyError) as error:
        return Replayed(recording.called, "cannot", reason=str(error).partition("\n")[0])


def replay_all(
    folder: Path | str,
    asked: Asked = Asked(),
    *,
    participant: str | None = None,
    trial: int | None = None,
    phases: tuple[PhaseKind, ...] = ("trial", "practice"),
    workers: int = 1,
) -> Iterator[Replayed]:
    """Replay what an export holds, or one participant's, or one trial of them, in so many processes; one after the
    other in the order of the export.

    Raises `CannotReplay` when there is nothing of that kind, and `study.export.export.ExportError`.
    """
    recordings = ExportedTrials(folder).of(participant, trial, phases)
    here, found = machine_fingerprint(), False
    if workers <= 1:
        for recording in recordings:
            found = True
            yield replay(recording, asked, here)
    else:
        with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
            running: deque[Future[Replayed]] = deque()
            try:
                for recording in recordings:
                    found = True
                    running.append(pool.submit(replay, recording, asked, here))
                    if len(running) > 2 * workers:  # a study's ticks do not fit into memory at once
                        yield running.popleft().result()
                while running:
                    yield running.popleft().result()
            except BrokenProcessPool:
                raise LabError("a process ended unexpectedly (out of memory?); try fewer --workers") from None
            finally:
                pool.shutdown(wait=False, cancel_futures=True)
    if not found:
        whose = f" of {participant}" if participant else ""
        which = " and ".join(phases) if trial is None else f"{' or '.join(phases)} {trial}"
        raise CannotReplay(f"{folder}: no ticks of {which}{whose}")


@lru_cache(maxsize=8)
def _setup(study_text: str, trust: bool) -> StudySetup:
    return study_setup(parse_stored(study_text, "the export's study file"), trust)


def _replay(recording: Recording, asked: Asked, here: Mapping[str, str]) -> Replayed:
    person = recording.participant
    robot_name = _robot(recording, asked)
    setup = _setup(recording.study_text, asked.trust)
    plan = plan_session(setup.study, tuple(person.condition_order.split(">")), person.seed)
    other = _other_machine(recording, robot_name, here)
    tolerance = (OTHER_MACHINE_TOLERANCE if other else 0.0) if asked.tolerance is None else asked.tolerance
    said = {**recording.ran_on.assumed, **({} if asked.robot is None else {"robot": "the robot, as asked for"})}
    measure = Measure(tolerance, recording.lacking)
    trial_setup = setup.trial_setup(person.participant, plan, recording.trial, recording.phase)
    tasks: dict[int, TaskRow] = {}
    ticks, difference, finished = 0, None, False

    def rows(results: Iterator[TickResult]) -> Iterator[TickRow]:
        nonlocal finished
        for result in results:
            finished = result.finished
            tasks.update({task.task: task for task in result.tasks})  # of one that is done again, the last counts
            yield result.row

    trial_row = recording.trial_row
    if trial_row is not None:
        difference = trial_difference(trial_row, setup.trial_row(person.participant, plan, recording.trial), measure)
    if difference is None:
        robot = make_robot(robot_name)
        try:
            results = rows(rerun(trial_setup, robot, recording.ticks))
            for difference in tick_differences(recording.ticks, results, measure):
                if difference is not None:
                    break
                ticks += 1
        finally:
            robot.close()
    if difference is None and trial_row is not None:
        difference = _end_difference(trial_row, len(recording.ticks), finished)
    if difference is None and recording.phase == "trial":
        difference = task_difference(recording.tasks, list(tasks.values()), measure)
    return Replayed(
        called=recording.called,
        state="same" if difference is None else "different",
        ticks=ticks,
        robot=robot_name,
        tolerance=tolerance,
        difference=difference,
        other=other,
        lacking=tuple(sorted(recording.lacking)),
        assumed=tuple(said.values()),
    )


def _end_difference(row: TrialRow, ticks: int, finished: bool) -> Difference | None:
    """Whether the trial ended as its row says."""
    place = f"trial {row.trial}"
    if row.ticks != ticks:
        return Difference("trials", place, "ticks", str(row.ticks), f"{ticks} rows")
    if finished != (row.outcome == "completed"):
        return Difference("trials", place, "outcome", row.outcome, "over" if finished else "not over")
    return None


def _robot(recording: Recording, asked: Asked) -> str:
    """The robot to replay on. Raises `CannotReplay` where the record's robot is not known, or is not here."""
    robots = recording.ran_on.robots
    if asked.robot is not None:
        ROBOTS.require(asked.robot)
        return asked.robot
    if not robots or not all("robot" in facts for facts in robots):
        raise CannotReplay("the export does not say which robot ran it; name one with --robot")
    if len(robots) > 1:
        names = ", then ".join(facts["robot"] for facts in robots)
        raise CannotReplay(f"it ran on several robots: {names}; name one with --robot")
    recorded = robots[0]
    name = recorded["robot"]
    ROBOTS.require(name)
    now = robot_facts(name)
    if {**recorded} != now and ("sha256" in recorded or "sha256" in now):
        raise CannotReplay(
            f"robot {name!r} was {_package(recorded)}, here it is {_package(now)}; install that one, or say "
            f"--robot {name}"
        )
    return name


def _package(facts: Mapping[str, str]) -> str:
    if "sha256" not in facts:
        return "one without a source recorded"
    return f"{facts.get('package', '')} {facts.get('version', '')}, source {facts['sha256'][:12]}".strip()


def _other_machine(recording: Recording, robot: str, here: Mapping[str, str]) -> tuple[str, ...]:
    """What decides about numbers and is not as it was; facts of an older export that it has not are taken as ours."""
    found = []
    idle = {library.module for name, library in ROBOTS.libraries.items() if robot in ROBOTS.shipped and name != robot}
    for name in [name for name in DECIDING if name not in idle]:
        were = dict.fromkeys(machine.get(name, _ABSENT) for machine in recording.ran_on.machines)
        if any(was not in (here.get(name), _ABSENT) for was in were):
            found.append(f"{name} was {' or '.join(were)}, is {here.get(name)}")
    return tuple(found)
