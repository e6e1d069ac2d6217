"""What was recorded, as of one moment: rows as their type, study texts, machines, erasure marks."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import sqlalchemy as sql

from study.flow.roster import EnrolmentKind
from study.integrity.chain import Head
from study.records import KEYS, OVERRUN_MS, TABLES, TrialRow, columns
from study.store import erasure
from study.store.ledger import head_of
from study.store.tables import MACHINES, RECORDS, SESSIONS, STUDIES


class Snapshot:
    """A view of one moment, made by `Store.snapshot`; usable as long as that `with` lasts."""

    def __init__(self, connection: sql.Connection) -> None:
        self._connection = connection

    def rows(self, table: str, include_demo: bool = False, include_pilot: bool = False) -> Iterator[Any]:
        """The rows of a recorded table as their type, participant by participant in order of enrolment."""
        query = _ordered(table).where(SESSIONS.c.kind.in_(_kinds(include_demo, include_pilot)))
        row_type = TABLES[table]
        with self._connection.execution_options(yield_per=1000).execute(query) as found:  # whoever reads no further
            for row in found.mappings():
                yield row_type(**row)

    def rows_of(self, table: str, participant: str, **equal: object) -> tuple[Any, ...]:
        """One participant's rows of a recorded table, where the named columns have these values."""
        query = _ordered(table).where(RECORDS[table].c.participant == participant)
        for name, value in equal.items():
            query = query.where(RECORDS[table].c[name] == value)
        return tuple(TABLES[table](**row) for row in self._connection.execute(query).mappings())

    def trials(self, include_demo: bool = False, include_pilot: bool = False) -> Iterator[TrialRow]:
        """As `rows("trials")`, with the ticks so far of those that are running: their own row is from their begin."""
        for trial in tuple(self.rows("trials", include_demo, include_pilot)):
            yield self._counted(trial) if trial.outcome == "running" else trial

    def _counted(self, trial: TrialRow) -> TrialRow:
        ticks = RECORDS["ticks"].c
        late = sql.func.coalesce(sql.func.sum(sql.case((ticks.late_ms > OVERRUN_MS, 1), else_=0)), 0)
        query = sql.select(sql.func.count(), late).where(ticks.participant == trial.participant)
        count, overruns = self._connection.execute(query.where(ticks.trial == trial.trial)).one()
        return replace(trial, ticks=count, overruns=overruns)

    def study_texts(self, include_demo: bool = False, include_pilot: bool = False) -> dict[str, str]:
        """Hash to text of every study file that participants ran under, in order of first use."""
        first = sql.func.min(SESSIONS.c.number)
        query = sql.select(STUDIES.c.hash, STUDIES.c.text).join(SESSIONS).group_by(STUDIES.c.hash).order_by(first)
        query = query.where(SESSIONS.c.kind.in_(_kinds(include_demo, include_pilot)))
        return {row.hash: row.text for row in self._connection.execute(query)}

    def machines(self) -> tuple[dict[str, str], ...]:
        """Fingerprints of every machine that ran this lab, the first one first."""
        query = sql.select(MACHINES.c.fingerprint).order_by(MACHINES.c.first_utc, MACHINES.c.hash)
        return tuple(json.loads(row.fingerprint) for row in self._connection.execute(query))

    def heads(self) -> dict[str, Head]:
        """Participant to the end of their chain, demo included, in order of enrolment."""
        everybody = sql.select(SESSIONS.c.participant).order_by(SESSIONS.c.number)
        names = self._connection.execute(everybody).scalars().all()
        return {name: head_of(self._connection, name) for name in names}

    def erasures(self) -> tuple[tuple[str, str], ...]:
        """(participant, utc) of everyone erased."""
        return erasure.erasures(self._connection)


def _kinds(include_demo: bool, include_pilot: bool) -> tuple[EnrolmentKind, ...]:
    return ("study", *(("pilot",) if include_pilot else ()), *(("demo",) if include_demo else ()))


def _ordered(table: str) -> sql.Select[Any]:
    """The recorded columns, participants in order of enrolment, their rows by key or by arrival."""
    infos = columns(table)  # names the tables there are
    source = RECORDS[table]
    keys = [source.c[name] for name in KEYS[table][1:]] if table in KEYS else [source.c.row_id]
    joined = sql.select(*[source.c[info.name] for info in infos])
    joined = joined.join(SESSIONS, SESSIONS.c.participant == source.c.participant)
    return joined.order_by(SESSIONS.c.number, *keys)
