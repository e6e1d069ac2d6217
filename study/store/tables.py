"""What stands in the file: the recorded tables, made from `records.TABLES`, and beside them the lab's own.

No export holds the lab's own as they are: sessions, tokens (hashed), identities, study texts, machines, message ids
already answered, starts of cycles, erasure marks.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sqlalchemy as sql

from study.integrity.content import CHAINED
from study.records import KEYS, TABLES, columns

METADATA = sql.MetaData()
_SQL_TYPES: Mapping[str, Any] = {"str": sql.Text, "int": sql.Integer, "float": sql.Float}


def _participant_column(**options: Any) -> sql.Column[str]:
    target = sql.ForeignKey("sessions.participant")
    return sql.Column("participant", sql.Text, target, nullable=False, **options)


META = sql.Table(
    "meta", METADATA, sql.Column("name", sql.Text, primary_key=True), sql.Column("value", sql.Text, nullable=False)
)
VERSION = sql.Table("alembic_version", METADATA, sql.Column("version_num", sql.String(32), primary_key=True))
"""Which revision the file has (see `study.store.migration`)."""
MACHINES = sql.Table(
    "machines",
    METADATA,
    sql.Column("hash", sql.Text, primary_key=True),
    sql.Column("fingerprint", sql.Text, nullable=False),
    sql.Column("first_utc", sql.Text, nullable=False),
)
STUDIES = sql.Table(
    "studies", METADATA, sql.Column("hash", sql.Text, primary_key=True), sql.Column("text", sql.Text, nullable=False)
)
SESSIONS = sql.Table(
    "sessions",
    METADATA,
    sql.Column("number", sql.Integer, primary_key=True),
    sql.Column("participant", sql.Text, nullable=False, unique=True),
    sql.Column("public_id", sql.Text, nullable=False, unique=True),
    sql.Column("session", sql.Text, nullable=False),
    sql.Column("state", sql.Text, nullable=False),
    sql.Column("condition_order", sql.Text, nullable=False),
    sql.Column("kind", sql.Text, nullable=False),
    sql.Column("pace", sql.Text, nullable=False),
    sql.Column("study_hash", sql.Text, sql.ForeignKey("studies.hash"), nullable=False),
    sql.Column("seed", sql.Integer, nullable=False),
    sql.Column("created_utc", sql.Text, nullable=False),
    sql.Column("rejected", sql.Integer, nullable=False, default=0),
    sqlite_autoincrement=True,  # the number of an erased participant is never given out again
)
TOKENS = sql.Table(
    "tokens",
    METADATA,
    sql.Column("sha256", sql.Text, primary_key=True),
    _participant_column(index=True),
    sql.Column("role", sql.Text, nullable=False),
    sql.Column("created_utc", sql.Text, nullable=False),
)
IDENTITIES = sql.Table(
    "identities",
    METADATA,
    sql.Column("id", sql.Integer, primary_key=True),
    _participant_column(index=True),
    sql.Column("kind", sql.Text, nullable=False),
    sql.Column("value", sql.Text, nullable=False),
)
SUBMISSIONS = sql.Table(
    "submissions",
    METADATA,
    _participant_column(primary_key=True),
    sql.Column("message_id", sql.Text, primary_key=True),
    sql.Column("response", sql.Text, nullable=False),
)
CYCLES = sql.Table(
    "cycles",
    METADATA,
    _participant_column(primary_key=True),
    sql.Column("trial", sql.Integer, primary_key=True),
    sql.Column("practice", sql.Integer, primary_key=True),
    sql.Column("cycle", sql.Integer, primary_key=True),
    sql.Column("start", sql.Text, nullable=False),
)
ERASURES = sql.Table(
    "erasures",
    METADATA,
    sql.Column("participant", sql.Text, primary_key=True),
    sql.Column("utc", sql.Text, nullable=False),
    sql.Column("hash", sql.Text, nullable=False),
)


def _record_table(name: str) -> sql.Table:
    keys = KEYS.get(name, ())
    made: list[sql.Column[Any]] = [] if keys else [sql.Column("row_id", sql.Integer, primary_key=True)]
    for info in columns(name):
        if info.name == "participant":
            made.append(_participant_column(primary_key="participant" in keys, index=not keys))
        else:
            kind = _SQL_TYPES[info.type]
            made.append(sql.Column(info.name, kind, primary_key=info.name in keys, nullable=info.optional))
    if name == "chain":
        made.append(sql.Column("salt", sql.Text, nullable=False))  # of rows that no export holds; no export holds it
    return sql.Table(name, METADATA, *made)


RECORDS: Mapping[str, sql.Table] = {name: _record_table(name) for name in TABLES}
"""The recorded tables by their name in `records.TABLES`."""
CHAINED_TABLES: Mapping[str, sql.Table] = {name: METADATA.tables[name] for name in CHAINED}
"""The tables whose rows the chain tells of."""
