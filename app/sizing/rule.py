"""When a machine holds so many people, what gives way first, and how many it is to take.

    step      N people drive at once, for some seconds                                      measured
    holds     nearly no tick begins late                                                     MOST_LATE_SHARE
    verdict   of the most that held, a third is kept in reserve                              RESERVE

Values and functions only; `app.sizing.measuring` measures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from sim.interface import TICK_S
from study.records import OVERRUN_MS

LATE_MS = OVERRUN_MS
"""A tick that begins so much after its time is late: the record calls it an overrun."""
MOST_LATE_SHARE = 0.01
"""So many of the ticks of a step may be late or left out: a 99th percentile of `LATE_MS`."""
HICCUPS = 2
"""So few late ticks are chance, however few ticks there were."""
LEAST_DRIVING = 0.6
"""Between practice and trials people answer, and their robots begin anew; the rest of the time they drive."""
RESERVE = 1.0 / 3.0
"""Share of what held that is kept in reserve: people come in bunches, and machines have other things to do."""
FULL = 0.85
"""Share of a core, or of all of them, from which on there is none left to be in time with."""
SLOW_COMMIT_MS = 250.0
"""A tick has half a second; one that is on disk only after this keeps its page waiting."""
LEAST_FREE_MB = 300.0
"""Memory that must be left."""
OVERLOAD = 1.5
"""A step is not tried that would want so many times the cores there are."""
FILES_OF_LAB, FILES_PER_SESSION = 150, 12
"""Open files of a lab: its own, and of each session (page, two 3-D views and their far ends, the worker's pipes)."""

Bottleneck = Literal["workers", "web", "writer", "memory", "people", "others", "unknown"]
"""What gives way first: the sessions' processes, the lab's own, the disk, memory, the scripted people themselves, or
programs that have nothing to do with it."""
BUSY = 0.15
"""A machine on which others take this share of the cores is no place to measure on."""


@dataclass(frozen=True)
class Room:
    """What there is for the lab and its people.

    Attributes:
        cores: what lab and people have in all.
        lab_cores: what the lab has of them; all, unless the people are kept to cores of their own.
        open_files: how many files a process may have open.
    """

    cores: int
    lab_cores: int
    open_files: int


@dataclass(frozen=True)
class Step:
    """What was measured while so many people drove at once.

    CPU is in cores: 1.0 is one core, all the time. Memory is proportional set size where the system tells it (Linux),
    so that what processes share counts once. Queues are the longest that were seen.
    """

    sessions: int
    arrived: int
    """Of them, those that came as far as driving."""
    seconds: float
    ticks: int
    late_p50_ms: float
    late_p99_ms: float
    late_most_ms: float
    late: int
    """Ticks more than `LATE_MS` late."""
    missed: int
    """Ticks that were left out because the next was due."""
    held: int
    """How often a robot stood still because its page's sign of life did not come in time."""
    web_cores: float
    worker_cores: float
    people_cores: float
    busiest_people_cores: float
    """Of the scripted people's processes, the one that did the most."""
    others_cores: float
    """What everything else on the machine took."""
    commit_p50_ms: float
    commit_p99_ms: float
    store_queue: int
    session_queue: int
    outgoing_queue: int
    web_mb: float
    workers_mb: float
    resident_mb: float
    """Of all the lab's processes, what each of them maps: shared pages count in each."""
    free_mb: float
    """Memory that the machine could still give."""
    scene_kb_s: float
    """What a person's 3-D views received a second; 0 without them."""
    failed: int = 0
    """Scripted people who could not go on, and were replaced."""

    @property
    def late_share(self) -> float:
        """Share of the ticks that were due and late, or left out."""
        due = self.ticks + self.missed
        return (self.late + self.missed) / due if due else 1.0

    @property
    def driving_share(self) -> float:
        """Ticks beside those of people who do nothing but drive."""
        return (self.ticks + self.missed) * TICK_S / (self.seconds * self.sessions)

    @property
    def lab_mb(self) -> float:
        """Memory of the lab and its workers."""
        return self.web_mb + self.workers_mb

    @property
    def mb_per_session(self) -> float:
        """What one more session takes, on average over those there are."""
        return self.workers_mb / max(1, self.sessions)

    @property
    def lab_cores(self) -> float:
        """CPU of the lab and its workers."""
        return self.web_cores + self.worker_cores


@dataclass(frozen=True)
class Verdict:
    """What came out. `held` is the most people that held, 0 = not even the fewest; `capacity` is how many to take.

    `broke` says what the first step that did not hold showed, or why it was not tried; "" where none was left to try.
    """

    held: int
    capacity: int
    broke: str = ""
    bottleneck: Bottleneck = "unknown"


def why_it_breaks(step: Step) -> str:
    """What is not as it should be in a step, in words; "" for one that holds."""
    if step.arrived < step.sessions:
        return f"{step.arrived} of {step.sessions} came as far as driving"
    bad = step.late + step.missed
    if not step.ticks or (bad > HICCUPS and step.late_share > MOST_LATE_SHARE):
        told = f"{100 * step.late_share:.1f} % of the ticks began more than {LATE_MS:g} ms late or were left out"
        return f"{told}; {100 * MOST_LATE_SHARE:g} % may"
    if step.driving_share < LEAST_DRIVING:
        return f"robots ran for {100 * step.driving_share:.0f} % of the time; {100 * LEAST_DRIVING:g} % must be"
    if step.held > HICCUPS and step.held > MOST_LATE_SHARE * step.ticks:
        return f"robots stood still {step.held} times because a page's sign of life came too late"
    return ""


def bottleneck(step: Step, room: Room) -> Bottleneck:
    """What gives way first in a step."""
    if step.free_mb < LEAST_FREE_MB:
        return "memory"
    if step.busiest_people_cores > FULL:
        return "people"
    if step.web_cores > FULL:
        return "web"
    takes: dict[Bottleneck, float] = {"workers": step.worker_cores, "web": step.web_cores, "others": step.others_cores}
    if room.lab_cores == room.cores:
        takes["people"] = step.people_cores
    everything = step.lab_cores + step.people_cores + step.others_cores
    is_full = everything > FULL * room.cores or step.lab_cores > FULL * room.lab_cores
    takes_most = max(takes, key=lambda name: takes[name])
    if is_full and takes_most == "others":
        return "others"
    if step.commit_p50_ms > SLOW_COMMIT_MS:  # nothing moves then, however much else there is to do
        return "writer"
    if is_full:
        return takes_most
    if step.commit_p99_ms > SLOW_COMMIT_MS or step.store_queue > step.sessions:
        return "writer"
    return "unknown"


def why_not(sessions: int, room: Room, last: Step | None = None) -> str:
    """Why a step need not be tried, or must not; "" when it may. `last` is the step before it, which held."""
    files = FILES_OF_LAB + FILES_PER_SESSION * sessions
    if files > room.open_files:
        return (
            f"{sessions} at once want about {files} open files, and a process may have {room.open_files} here: "
            "raise the limit (ulimit -n, LimitNOFILE= of the service)"
        )
    if last is None:
        return ""
    more = sessions / last.sessions
    cores = last.lab_cores * more + (last.people_cores * more if room.lab_cores == room.cores else 0.0)
    if cores > OVERLOAD * room.lab_cores:
        return f"{sessions} at once would want about {cores:.1f} cores, and there {_are(room.lab_cores)} for them"
    wants_mb = last.mb_per_session * (sessions - last.sessions)
    if wants_mb > last.free_mb - LEAST_FREE_MB:
        return f"{sessions} at once would want {wants_mb:.0f} MB more, and {last.free_mb:.0f} MB are free"
    return ""


def _are(cores: int) -> str:
    return "is 1" if cores == 1 else f"are {cores}"


def verdict(steps: Sequence[Step], room: Room, not_tried: str = "") -> Verdict:
    """What the steps say, in the order in which they were measured; a step that was measured again counts as it was
    the last time. `not_tried` says why the next one was not measured."""
    last_of = {step.sessions: step for step in steps}
    held = 0
    for sessions in sorted(last_of):
        step = last_of[sessions]
        if broke := why_it_breaks(step):
            return Verdict(held, capacity(held), broke, bottleneck(step, room))
        held = sessions
    found = bottleneck(last_of[held], room) if held and not_tried else "unknown"
    return Verdict(held, capacity(held), not_tried, found)


def capacity(held: int) -> int:
    """How many to take where so many held: at least one, if that held."""
    return min(held, max(1, int(held * (1.0 - RESERVE) + 1e-9)))
