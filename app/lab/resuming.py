"""Where a stored session stood, read from its rows: what a lab that has just started needs to go on."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from app.session.history import KEPT_EVENTS
from app.session.interfaces import Freer, HelpCall, Resumed
from app.session.private_text import with_words
from app.trial.values import CycleStart, UserInput, cycle_from_json, inputs_of
from study.flow.distractors.interface import Distractor
from study.flow.distractors.state import from_rows
from study.flow.protocol import WorkerKind
from study.records import OVERRUN_MS, EventRow, is_note, unix_s
from study.store import Store, StoredSession

_ASKERS: Mapping[str, Freer] = {"step_free_arm": "participant", "free_arm": "experimenter"}
"""Events that ask to free the arm, and who asks."""
_ABOUT_FREEING = (*_ASKERS, "arm_freed", "free_not_needed", "start", "step_start")
"""Those, and what becomes of it; practice and trial each begin with nothing asked for."""
_CALLS = {("step_help", "participant"), ("help_seen", "experimenter")}
"""What a call for help leaves behind: an event, and by whom."""


def resumed(store: Store, stored: StoredSession, distractor: Distractor[Any]) -> Resumed:
    """Its distractor, the last tick of its phase, the last input's number."""
    participant, session = stored.participant, stored.session
    table = "ticks" if session.place in ("trial_ready", "trial") else "practice_ticks"
    rows = store.rows_of(table, participant, trial=session.trial) if session.worker else ()
    alerts = store.rows_of("alerts", participant, trial=session.trial) if table == "ticks" else ()
    events: tuple[EventRow, ...] = store.rows_of("events", participant)
    setups = [json.loads(row.data) for row in events if row.kind == "step_setup"]
    calls = [row for row in events if (row.kind, row.source) in _CALLS][-1:]
    words = with_words(calls, store.identities(participant)) if calls else []
    is_open = bool(calls) and calls[0].kind == "step_help"
    times = [stored.created_utc, *(row.utc for row in events), *(row.started_utc for row in rows[-1:])]
    return Resumed(
        distractor=from_rows(distractor, stored.seed, alerts),
        tick=rows[-1].tick if rows else None,
        last_seq=store.last_input_seq(participant),
        overruns=sum(1 for row in rows if (row.late_ms or 0.0) > OVERRUN_MS),
        frees=sum(1 for row in rows if row.source == "free"),
        freed_by=_freed_by(events, session.trial) if session.worker else None,
        sound=setups[-1].get("sound") if setups else None,
        help_wanted=HelpCall(words[0].get("text", ""), calls[0].utc) if is_open else None,
        events=events[-KEPT_EVENTS:],
        last_unix_s=max(map(unix_s, filter(None, times))),
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
    about = [row for row in events if row.trial == trial and row.kind in _ABOUT_FREEING and not is_note(row)]
    return _ASKERS.get(about[-1].kind) if about else None
