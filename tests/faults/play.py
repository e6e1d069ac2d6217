"""One fault done to one lab: before, meanwhile, after (`hit`), and what came of it (`judge`)."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from sim.interface import TICK_S
from tests.faults.checker import Breach, Evidence, breaches, counts
from tests.faults.memory import HeardTick, Memory, Seen
from tests.faults.person import Person
from tests.faults.row import CannotRun, Fault, Sight
from tests.faults.stage import Stage
from tests.support.wire_client import Direction

BEFORE: Direction = (0, 1, 0)
AFTER: Direction = (0, 0, 1)
"""What the person holds when the fault begins, and what they do once it is over: nothing in common."""
CALLS_AFTER_S, LETS_GO_AFTER_S = 0.3, 0.7
TICKS_BEFORE, TICKS_AT_REST, TICKS_AFTER = 2, 2, 2
PATIENCE_S = 30.0
"""Beyond what the row allows: a fault that takes longer is over all the same, and its row is red."""
ACKNOWLEDGED_WITHIN_S = 15.0


@dataclass(frozen=True)
class Outcome:
    """What came of a fault. Times in seconds since it began; None = it was not seen, or did not happen."""

    name: str
    about: str
    part: str
    how: str = ""
    told_participant: tuple[tuple[str, float | None], ...] = ()
    told_experimenter: tuple[tuple[str, float | None], ...] = ()
    fault_s: float = 0.0
    standstill_s: float | None = None
    """The longest time between two acknowledged ticks around it, less the length of a tick."""
    allowed_s: float = 0.0
    ticks: int = 0
    """Acknowledged ticks that were held against the record."""
    breaches: tuple[Breach, ...] = ()
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    not_run: str = ""

    @property
    def is_kept(self) -> bool:
        """Whether everything promised was kept."""
        return not (self.breaches or self.problems)

    def as_json(self) -> dict[str, Any]:
        """For the report."""
        return {**asdict(self), "kept": self.is_kept, "counts": counts(self.breaches)}


@dataclass
class Hit:
    """A fault that was done: when it began and ended (monotonic, seconds), and what went wrong already."""

    fault: Fault
    began_s: float = 0.0
    ended_s: float = 0.0
    spent_s: float = 0.0
    problems: list[str] = field(default_factory=list)
    calls: dict[str, str] = field(default_factory=dict)
    """Calls for help by their id."""


async def hit(stage: Stage, fault: Fault) -> Hit:
    """Do a fault to a stage whose participant drives, and see the participant through it."""
    person, done = stage.person, Hit(fault)
    number = len(person.memory.sent)
    await person.hold(BEFORE)
    if not await person.ticks(TICKS_BEFORE, PATIENCE_S):
        done.problems.append("the robot did not move before the fault")
    words = f"before {fault.name} {number}"
    call = await person.call(words)
    done.calls[call] = words
    if not await person.until_acknowledged(call, ACKNOWLEDGED_WITHIN_S):
        done.problems.append("a call for help before the fault was not acknowledged")
    stage.began_s, stage.spent_s = time.monotonic(), 0.0
    async with _meanwhile(person, f"in {fault.name} {number}", done):
        try:
            await fault.does(stage)
        except CannotRun:
            raise
        except Exception as error:  # what the fault expected did not come: that is the finding
            kind = "" if isinstance(error, AssertionError) else f"{type(error).__name__}: "
            done.problems.append(f"{kind}{error}"[:400])
    done.began_s, done.ended_s, done.spent_s = stage.began_s, time.monotonic(), stage.spent_s
    if fault.goes_on:
        await _afterwards(person, done, number)
    await person.hold(None)
    return done


@contextlib.asynccontextmanager
async def _meanwhile(person: Person, words: str, done: Hit) -> AsyncIterator[None]:
    """The person calls for help in the fault, and lets go of what they held."""

    async def act() -> None:
        await asyncio.sleep(CALLS_AFTER_S)
        done.calls[await person.call(words)] = words
        await asyncio.sleep(LETS_GO_AFTER_S - CALLS_AFTER_S)
        await person.hold(None)

    acting = asyncio.create_task(act())
    try:
        yield
        await acting
    finally:
        acting.cancel()
        await asyncio.gather(acting, return_exceptions=True)


async def _afterwards(person: Person, done: Hit, number: int) -> None:
    """Hands at rest until the robot obeys again, then they do something else."""
    within_s = done.fault.downtime_s + PATIENCE_S

    def since() -> int:
        return sum(heard.at_s > done.ended_s + TICK_S for heard in person.memory.ticks)  # those before began before

    if not await person.until(lambda: since() >= TICKS_AT_REST, within_s):
        done.problems.append(f"no tick within {within_s:g} s after it; the page says {person.sign!r}")
        return
    await person.hold(AFTER)
    if not await person.ticks(TICKS_AFTER, PATIENCE_S):
        done.problems.append("the robot did not go on moving")
    words = f"after {done.fault.name} {number}"
    done.calls[await person.call(words)] = words
    for call, words in done.calls.items():
        if not await person.until_acknowledged(call, ACKNOWLEDGED_WITHIN_S):
            done.problems.append(f"the call {words!r} was never acknowledged")


async def judge(stage: Stage, done: Hit) -> Outcome:
    """Hold what the participant did, heard and saw against the row and against the record. The session is paused."""
    fault, person = done.fault, stage.person
    problems = [*done.problems, *stage.problems]
    found: Sequence[Breach] = ()
    try:
        memory, record = await settled(stage, person, exports=fault.exports)
        found = breaches(memory, record, fault.way_s)
    except Exception as error:  # whatever keeps the record from being read is the finding
        if fault.is_kept:
            problems.append(f"the record cannot be read: {type(error).__name__}: {error}"[:300])
    told_participant = _told(fault.participant, person.memory.seen, done.began_s)
    told_experimenter = _told(fault.experimenter, [*stage.experimenter.seen, *person.board_seen], done.began_s)
    problems += _untold("the participant", fault.participant, told_participant)
    problems += _untold("the experimenter", fault.experimenter, told_experimenter)
    standstill_s = standstill(person.memory.ticks, done.began_s, done.ended_s) if fault.goes_on else None
    allowed_s = done.spent_s + fault.downtime_s
    if standstill_s is not None and standstill_s > allowed_s:
        problems.append(f"the robot stood still for {standstill_s:.1f} s, {allowed_s:.1f} are allowed")
    return Outcome(
        name=fault.name,
        about=fault.about,
        part=fault.part,
        how=stage.disk.how,
        told_participant=told_participant,
        told_experimenter=told_experimenter,
        fault_s=done.spent_s,
        standstill_s=standstill_s,
        allowed_s=allowed_s,
        ticks=len(person.memory.ticks),
        breaches=tuple(found),
        problems=tuple(problems),
        notes=tuple(stage.notes),
    )


async def settled(stage: Stage, person: Person, *, exports: bool = True) -> tuple[Memory, Evidence]:
    """Memory and record of one moment: nothing is written while both are read, and all that was said has arrived."""
    answer = await stage.asked("POST", f"sessions/{person.name}/pause", {"reason": None})
    if answer.status_code != 200:
        stage.notes.append(f"pause was answered with {answer.status_code}")
    if not await person.until(lambda: person.sign == "paused", ACKNOWLEDGED_WITHIN_S):
        stage.notes.append(f"the session did not pause for the record to be read; the page says {person.sign!r}")
    await person.ticks(1, 2 * TICK_S)  # the one that was under way
    if not exports:
        return person.remembered(), await asyncio.to_thread(stage.evidence, person, None)
    before = await asyncio.to_thread(stage.evidence, person, None)
    exported = await stage.export()
    record = await asyncio.to_thread(stage.evidence, person, exported)
    return person.remembered(), replace(record, events_before=len(before.events))


def standstill(ticks: Sequence[HeardTick], began_s: float, ended_s: float) -> float | None:
    """The longest time between two ticks of which the later one came after the fault began, and the earlier one before
    it was over by more than a moment; less a tick."""
    gaps_s = [
        later.at_s - earlier.at_s
        for earlier, later in itertools.pairwise(ticks)
        if later.at_s > began_s and earlier.at_s < ended_s + TICK_S
    ]
    return max(0.0, max(gaps_s) - TICK_S) if gaps_s else None


def _told(sights: Sequence[Sight], seen: Sequence[Seen], began_s: float) -> tuple[tuple[str, float | None], ...]:
    """When each was seen first."""
    return tuple(
        (sight.words, next((one.at_s - began_s for one in seen if one.at_s >= began_s and sight.is_it(one)), None))
        for sight in sights
    )


def _untold(who: str, sights: Sequence[Sight], told: Sequence[tuple[str, float | None]]) -> list[str]:
    """What was not told, or late."""
    problems = []
    for sight, (words, after_s) in zip(sights, told, strict=True):
        if after_s is None:
            problems.append(f"{who} was never told: {words}")
        elif after_s > sight.within_s:
            problems.append(f"{who} was told after {after_s:.1f} s, not {sight.within_s:g}: {words}")
    return problems
