"""Where a stored session stood, read from its rows: what a lab that has just started needs to go on."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from app.session.history import KEPT_EVENTS
from app.session.interfaces import Freer, HelpCall, Resumed
from app.session.private_text import with_words
from app.trial.values import CycleStart, UserInput, cycle_from_json, inputs_of
from study.flow.distractors.interface import Distractor
from study.flow.distractors.state import from_rows
from study.flow.protocol import WorkerKind
from study.flow.recorded import (
    ARM_FREED,
    FREE_ASKED_BY_EXPERIMENTER,
    FREE_ASKED_BY_PARTICIPANT,
    FREE_NOT_NEEDED,
    HELP,
    HELP_SEEN,
    SET_UP,
    STARTED_BY_EXPERIMENTER,
    STARTED_BY_PARTICIPANT,
    Recorded,
    time_of,
)
from study.records import OVERRUN_MS, EventRow
from study.store import Store, StoredSession

_ABOUT_FREEING: tuple[tuple[Recorded[Any], Freer | None], ...] = (
    (FREE_ASKED_BY_PARTICIPANT, "participant"),
    (FREE_ASKED_BY_EXPERIMENTER, "experimenter"),
    (ARM_FREED, None),
    (FREE_NOT_NEEDED, None),
    (STARTED_BY_PARTICIPANT, None),
    (STARTED_BY_EXPERIMENTER, None),
)
"""What asks to free the arm, and who asks; and what becomes of it. Practice and trial each begin with nothing asked."""


def resumed(store: Store, stored: StoredSession, distractor: Distractor[Any]) -> Resumed:
    """Its distractor, the last tick of its phase, the last input's number."""
    participant, session = stored.participant, stored.session
    table = "ticks" if session.place in ("trial_ready", "trial") else "practice_ticks"
    rows = store.rows_of(table, participant, trial=session.trial) if session.worker else ()
    alerts = store.rows_of("alerts", participant, trial=session.trial) if table == "ticks" else ()
    events: tuple[EventRow, ...] = store.rows_of("events", participant)
    setups = [found for found in map(SET_UP.of, events) if found]
    calls = [row for row in events if HELP.of(row) or HELP_SEEN.of(row)][-1:]
    words = with_words(calls, store.identities(participant)) if calls else []
    is_open = bool(calls) and HELP.of(calls[0]) is not None
    times = [stored.created_utc, *(row.utc for row in events), *(row.started_utc for row in rows[-1:])]
    return Resumed(
        distractor=from_rows(distractor, stored.seed, alerts),
        tick=rows[-1].tick if rows else None,
        last_seq=store.last_input_seq(participant),
        overruns=sum(1 for row in rows if (row.late_ms or 0.0) > OVERRUN_MS),
        frees=sum(1 for row in rows if row.source == "free"),
        freed_by=_freed_by(events, session.trial) if session.worker else None,
        sound=setups[-1].sound if setups else None,
        help_wanted=HelpCall(str(words[0].get("text", "")), calls[0].utc) if is_open else None,
        events=events[-KEPT_EVENTS:],
        last_unix_s=max((at for at in map(time_of, times) if at is not None), default=0.0),
    )


def cycle_under_way(
    store: Store, participant: str, trial: int, kind: WorkerKind
) -> tuple[CycleStart, tuple[tuple[UserInput, str], ...]]:
    """The start of the last attempt at a practice's or a trial's last cycle, and the inputs of its ticks with the
    digests they led to; of another attempt, with nothing to re-run, when somebody has asked to free the arm: the way
    out of a record that cannot be re-run."""
    practice = kind == "practice"
    last = store.last_cycle(participant, trial, practice=practice)
    start = cycle_from_json(last.start) if last else CycleStart()
    rows = store.ticks_of_attempt(participant, trial, start.cycle, start.attempt, practice=practice)
    if _freed_by(store.rows_of("events", participant, trial=trial), trial):
        return start.after(rows), ()
    return start, tuple((inputs_of(row), row.digest) for row in rows)


def _freed_by(events: Iterable[EventRow], trial: int) -> Freer | None:
    """Who has asked to free the arm in the practice or the trial under way, if no tick has done it."""
    asked: Freer | None = None
    for row in events:
        if row.trial == trial:
            asked = next((asker for event, asker in _ABOUT_FREEING if event.of(row)), asked)
    return asked
