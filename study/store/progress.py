"""What a session has reached: its state, the messages already answered, and where a worker takes up again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, cast

import sqlalchemy as sql

from study.flow.protocol import Session, to_json
from study.store import ledger
from study.store.rows import insert, update
from study.store.statements import replacement, run
from study.store.tables import CYCLES, RECORDS, SUBMISSIONS
from study.store.values import ConsentGiven, Cycle, StoreError

_RESPONSE = "SELECT response FROM submissions WHERE participant = ? AND message_id = ?"


def save_session(
    connection: sql.Connection, session: Session, consent: ConsentGiven | None, finished_utc: str | None
) -> None:
    """The session as it is now, and its state in the recorded row."""
    if not update(connection, "sessions", session.participant, {"session": to_json(session), "state": session.state}):
        raise StoreError(f"no participant {session.participant!r}")
    values: dict[str, Any] = {"state": session.state}
    if session.state == "screened_out":
        values["screened_out"] = session.reason
    if consent is not None:
        values["consent_utc"], values["consent_hash"] = consent.utc, consent.sha256
    if finished_utc is not None:
        values["finished_utc"] = finished_utc
    update(connection, "participants", session.participant, values)


def save_response(connection: sql.Connection, participant: str, message_id: str, response: Mapping[str, Any]) -> None:
    """What a message is answered with, now and whenever it comes again."""
    text = json.dumps(response)
    insert(connection, SUBMISSIONS, participant=participant, message_id=message_id, response=text)


def response_to(connection: sql.Connection, participant: str, message_id: str) -> dict[str, Any] | None:
    """What a message was answered with, or None when it is new."""
    row = run(connection, _RESPONSE, (participant, message_id)).fetchone()
    return None if row is None else cast("dict[str, Any]", json.loads(row[0]))


def save_cycle(connection: sql.Connection, cycle: Cycle) -> None:
    """The start of a cycle, in place of that of an earlier attempt at it."""
    values = {**vars(cycle), "practice": int(cycle.practice)}
    said = replacement(CYCLES, tuple(values), ("participant", "trial", "practice", "cycle"))
    run(connection, said, tuple(values.values()))
    ledger.note(connection, "cycles", values)


def last_cycle(connection: sql.Connection, participant: str, trial: int, *, practice: bool) -> Cycle | None:
    """The cycle that was running last in a trial (or its practice)."""
    query = (
        sql.select(CYCLES)
        .where(
            CYCLES.c.participant == participant,
            CYCLES.c.trial == trial,
            CYCLES.c.practice == int(practice),
        )
        .order_by(CYCLES.c.cycle.desc())
    )
    row = connection.execute(query).first()
    return Cycle(row.participant, row.trial, bool(row.practice), row.cycle, row.start) if row else None


def last_input_seq(connection: sql.Connection, participant: str) -> int:
    """The highest input sequence number that a committed tick took into account; 0 = none."""
    highest = 0
    for name in ("ticks", "practice_ticks"):
        table = RECORDS[name]
        query = sql.select(sql.func.max(table.c.input_seq)).where(table.c.participant == participant)
        highest = max(highest, connection.execute(query).scalar() or 0)
    return highest
