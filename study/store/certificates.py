"""The certificate of a participant who has ended: made in the transaction that ends them, and when a page reports."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import sqlalchemy as sql

from study.flow.recorded import RECEIVED
from study.integrity.certificate import signed_text, told
from study.integrity.signing import public_key, sign
from study.records import CertificateRow, EventRow
from study.store import ledger
from study.store.rows import put
from study.store.tables import RECORDS, SUBMISSIONS

log = logging.getLogger(__name__)

ACKNOWLEDGED = "{}"
"""What a message was answered with that was taken: no problems."""


def certify(connection: sql.Connection, folder: Path, participant: str, utc: str) -> None:
    """Certify what there is of a participant by now, what this transaction writes included; nothing before they end."""
    people = RECORDS["participants"].c
    ended = connection.execute(sql.select(people.finished_utc).where(people.participant == participant)).scalar()
    if ended is None:
        return
    ledger.close_ledger(connection)  # the chain ends before the certificate's own link
    ledger.open_ledger(connection)
    head, reports = ledger.head_of(connection, participant), list(_reports(connection, participant))
    taken = SUBMISSIONS.c.response == ACKNOWLEDGED
    messages = _count(connection, SUBMISSIONS, participant, taken) - len(reports)  # which report, and are not reported
    ticks, acknowledged = told(reports) or (None, None)
    try:
        row = CertificateRow(
            participant=participant,
            utc=utc,
            links=head.seq,
            head=head.hash,
            ticks=_count(connection, RECORDS["ticks"], participant),
            practice_ticks=_count(connection, RECORDS["practice_ticks"], participant),
            answers=_count(connection, RECORDS["survey_answers"], participant),
            messages=messages,
            told_ticks=ticks,
            told_messages=acknowledged,
            key=public_key(folder),
            signature="",
        )
        signed = replace(row, signature=sign(folder, signed_text(row)))
    except (OSError, ValueError) as error:  # keeps nobody from ending: there is no certificate
        log.error("participant %s has no certificate: the data folder's key cannot be used: %s", participant, error)
        return
    put(connection, "certificates", [signed])


def _reports(connection: sql.Connection, participant: str) -> Iterator[dict[str, Any]]:
    events = RECORDS["events"]
    names = [column for column in events.c if column.name != "row_id"]
    query = sql.select(*names).where(events.c.participant == participant, events.c.kind == RECEIVED.kind)
    for row in connection.execute(query.order_by(events.c.row_id)).mappings():
        if (report := RECEIVED.of(EventRow(**row))) is not None:
            yield report.model_dump()


def _count(connection: sql.Connection, table: sql.Table, participant: str, *where: Any) -> int:
    query = sql.select(sql.func.count()).select_from(table).where(table.c.participant == participant, *where)
    return int(connection.execute(query).scalar_one())
