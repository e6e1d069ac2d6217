"""The run: a lab of its own, and so many people at a time, until one of the steps does not hold.

for each number of people
    why_not(…)?  ──► the end: it is not tried
    let them come, until all drive ──► settle ──► read ─ … seconds … ─ read ──► a `Step`
    it does not hold?  once more; if it does not hold again ──► the end
"""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from app.errors import LabError
from app.processes import busy_cpu_s, can_keep_to_cores, free_bytes, tree_bytes
from app.sizing import machine
from app.sizing.crowd import Crowd
from app.sizing.figures_of_lab import COMMITS, Reading, bucket_share, late_ms, most, read, share
from app.sizing.own_lab import OwnLab, beside, own_lab
from app.sizing.people import Newcomer
from app.sizing.rule import LATE_MS, Room, Step, why_it_breaks, why_not
from app.trial.world import open_study
from sim.view.viewpoints import INSET

STEPS = (1, 2, 4, 8, 12, 16, 20, 24, 32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256)
"""So many people at once, if nobody says otherwise."""
MOST_SESSIONS = 2_000
LEAST_S, MOST_S = 1.0, 3600.0
COMING_S, COMING_EACH_S = 60.0, 2.0
"""Within so long all have to drive, and so much more for each of those who come."""
SETTLE_S = 3.0
"""Between the last one's first tick and the first that counts."""
LOOK_EVERY_S = 2.0
KEEP_EVERY_S = 0.2
NEAR_M = 0.1
"""Near plane of the picture's camera."""
INVITED_AT_ONCE = 100
MOST_FAILED = 3
"""So many more than there are people, and nobody will come as far as driving."""
MB = 1e6


@dataclass(frozen=True)
class Asked:
    """What to measure.

    Attributes:
        robot: which one moves, None = the lab's default.
        study: the study file, None = the one that ships.
        data: the data folder that is meant: it is measured on its disk.
        steps: numbers of people, rising.
        seconds: how long each step is measured.
        scene: whether everybody has the 3-D views open that a participant's page has.
        people_cores: how many cores the scripted people are kept to; 0 = they and the lab share all.
    """

    data: Path
    robot: str | None = None
    study: Path | None = None
    trust: bool = False
    steps: tuple[int, ...] = STEPS
    seconds: float = 30.0
    scene: bool = True
    people_cores: int = 0

    def check(self, cores: int) -> None:
        """Raises `LabError` for what cannot be measured."""
        if not self.steps or min(self.steps) < 1 or max(self.steps) > MOST_SESSIONS:
            raise LabError(f"--steps {_listed(self.steps)}: must be numbers of people from 1 to {MOST_SESSIONS}")
        if list(self.steps) != sorted(set(self.steps)):
            raise LabError(f"--steps {_listed(self.steps)}: must rise from each to the next")
        if not LEAST_S <= self.seconds <= MOST_S:
            raise LabError(f"--seconds {self.seconds:g}: must be from {LEAST_S:g} to {MOST_S:g}")
        if not 0 <= self.people_cores < cores:
            raise LabError(
                f"--people-cores {self.people_cores}: this machine has {cores} for lab and people: "
                f"0 (they share them) to {cores - 1}"
            )
        if self.people_cores and not can_keep_to_cores():
            raise LabError("--people-cores: this system keeps no process to some of the cores; leave it out")


def _listed(steps: Sequence[int]) -> str:
    return ",".join(map(str, steps))


class Watcher(Protocol):
    """Who is told how far it is."""

    def coming(self, sessions: int, arrived: int) -> None:
        """So many drive of those who come."""

    def measuring(self, sessions: int, done_s: float, of_s: float) -> None:
        """So much of a step is over."""


@dataclass
class Run:
    """One run. `steps` yields each as it was measured; afterwards `not_tried` says why the next one was not.

    Attributes:
        robot: which one moved.
    """

    asked: Asked
    watcher: Watcher
    not_tried: str = ""
    robot: str = ""

    @property
    def room(self) -> Room:
        """What there is for lab and people."""
        cores = machine.cores()
        return Room(cores, cores - self.asked.people_cores, machine.open_files())

    def steps(self) -> Iterator[Step]:
        """Measure. Raises `LabError` for what cannot be, `StudyError` for a study that cannot."""
        asked, room = self.asked, self.room
        asked.check(room.cores)
        near_m, arguments = self._views(), self._arguments()
        if self._is_stopped_before(asked.steps[0], None):
            raise LabError(self.not_tried)
        every = machine.core_numbers()
        people_on = every[len(every) - asked.people_cores :] if asked.people_cores else ()
        lab_on = every[: len(every) - asked.people_cores] if asked.people_cores else ()
        with contextlib.ExitStack() as stack:
            folder = stack.enter_context(beside(asked.data))
            lab = stack.enter_context(own_lab(folder, arguments, lab_on))
            self.robot = str(_health(lab)["robot"])
            crowd = stack.enter_context(Crowd(lambda count: _invited(lab, count, near_m), people_on))
            last: Step | None = None
            for sessions in asked.steps:
                if self._is_stopped_before(sessions, last):
                    return
                last = self._step(lab, crowd, sessions)
                yield last
                if why_it_breaks(last):
                    last = self._step(lab, crowd, sessions)  # a machine may have something else to do for a moment
                    yield last
                if why_it_breaks(last):
                    return

    def _is_stopped_before(self, sessions: int, last: Step | None) -> bool:
        self.not_tried = why_not(sessions, self.room, last)
        return bool(self.not_tried)

    def _views(self) -> tuple[float, ...]:
        """The near planes of the 3-D views that a participant's page opens."""
        study = open_study(self.asked.study, self.asked.trust)
        if not self.asked.scene:
            return ()
        return (NEAR_M, INSET.near_m) if study.view.inset else (NEAR_M,)

    def _arguments(self) -> tuple[str, ...]:
        asked = self.asked
        return (
            *(("--robot", asked.robot) if asked.robot else ()),
            *(("--study", str(asked.study.absolute())) if asked.study else ()),
            *(("--trust",) if asked.trust else ()),
        )

    def _step(self, lab: OwnLab, crowd: Crowd, sessions: int) -> Step:
        failed = crowd.told.failed
        arrived = self._let_come(crowd, sessions)
        self._keep(crowd, sessions, SETTLE_S)
        before, cpu_before_s, told_before, busy_before_s = read(lab), crowd.cpu_s(), crowd.told, busy_cpu_s()
        from_unix_s, from_s = time.time(), time.monotonic()
        readings = [before]

        def look(done_s: float) -> None:
            self.watcher.measuring(sessions, done_s, self.asked.seconds)
            readings.append(read(lab))

        self._keep(crowd, sessions, self.asked.seconds, look)
        after, cpu_after_s, told, busy_s = read(lab), crowd.cpu_s(), crowd.told, busy_cpu_s()
        seconds, to_unix_s = time.monotonic() - from_s, time.time()
        memory, late = tree_bytes(lab.pid), late_ms(lab, from_unix_s, to_unix_s)
        people = [(now_s - was_s) / seconds for was_s, now_s in zip(cpu_before_s, cpu_after_s, strict=False)]
        web, workers = after.web_cpu_s - before.web_cpu_s, max(0.0, after.workers_cpu_s - before.workers_cpu_s)
        others = (busy_s - busy_before_s - web - workers) / seconds - sum(people)
        commits = before.buckets(COMMITS), after.buckets(COMMITS)
        return Step(
            sessions=sessions,
            arrived=arrived,
            seconds=round(seconds, 3),
            ticks=len(late),
            late_p50_ms=share(late, 0.5),
            late_p99_ms=share(late, 0.99),
            late_most_ms=late[-1] if late else 0.0,
            late=sum(one > LATE_MS for one in late),
            missed=int(_more(before, after, "salab_ticks_missed_total")),
            held=told.holds - told_before.holds,
            web_cores=web / seconds,
            worker_cores=workers / seconds,
            people_cores=sum(people),
            busiest_people_cores=max(people, default=0.0),
            others_cores=max(0.0, others),
            commit_p50_ms=1e3 * bucket_share(*commits, 0.5),
            commit_p99_ms=1e3 * bucket_share(*commits, 0.99),
            store_queue=most(readings, "salab_store_queue_length"),
            session_queue=most(readings, "salab_session_queue_longest"),
            outgoing_queue=most(readings, "salab_outgoing_queue_longest"),
            web_mb=memory.own / MB,
            workers_mb=memory.others / MB,
            resident_mb=memory.resident / MB,
            free_mb=free_bytes() / MB,
            scene_kb_s=(told.scene_bytes - told_before.scene_bytes) / seconds / sessions / 1e3,
            failed=told.failed - failed,
        )

    def _let_come(self, crowd: Crowd, sessions: int) -> int:
        """Have so many people come and drive; how many have in the end."""
        told = crowd.keep(sessions)
        ends_s = time.monotonic() + COMING_S + COMING_EACH_S * max(0, sessions - told.arrived)
        while told.arrived < sessions and time.monotonic() < ends_s:
            if told.failed > sessions + MOST_FAILED and not told.arrived:
                raise LabError(f"no scripted person gets as far as driving: {told.problem}")
            self.watcher.coming(sessions, told.arrived)
            time.sleep(KEEP_EVERY_S)
            told = crowd.keep(sessions)
        return told.arrived

    def _keep(
        self, crowd: Crowd, sessions: int, seconds: float, look: Callable[[float], None] = lambda done_s: None
    ) -> None:
        """Let them drive for so long, and look every now and then."""
        began_s = looked_s = time.monotonic()
        while (now_s := time.monotonic()) < began_s + seconds:
            crowd.keep(sessions)
            if now_s - looked_s >= LOOK_EVERY_S:
                looked_s = now_s
                look(now_s - began_s)
            time.sleep(min(KEEP_EVERY_S, max(0.0, began_s + seconds - time.monotonic())))


def _more(before: Reading, after: Reading, name: str) -> float:
    return after.metric(name) - before.metric(name)


def _health(lab: OwnLab) -> Mapping[str, Any]:
    found: Mapping[str, Any] = json.loads(lab.get("health"))
    return found


def _invited(lab: OwnLab, count: int, near_m: tuple[float, ...]) -> list[Newcomer]:
    """So many more participants, who hold no cell."""
    found: list[Newcomer] = []
    while (left := count - len(found)) > 0:
        body = {"kind": "pilot", "pace": "real_time", "count": min(left, INVITED_AT_ONCE)}
        for one in lab.post("participants", body)["created"]:
            panel = one["panel_link"] if one["second_device"] else None
            found.append(Newcomer(one["link"], panel, near_m))
    return found
