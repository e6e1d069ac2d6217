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
POSTGRES = "postgresql"
TEXT = sql.Text().with_variant(sql.Text(collation="C"), POSTGRES)
"""Compared byte by byte, as SQLite does: an export's order does not depend on the server's language."""
WHOLE = sql.Integer().with_variant(sql.BigInteger(), POSTGRES)
"""As large in PostgreSQL as in SQLite: seeds have 48 bits."""
_SQL_TYPES: Mapping[str, Any] = {"str": TEXT, "int": WHOLE, "float": sql.Float}


def _participant_column(**options: Any) -> sql.Column[str]:
    target = sql.ForeignKey("sessions.participant")
    return sql.Column("participant", TEXT, target, nullable=False, **options)


META = sql.Table(
    "meta", METADATA, sql.Column("name", TEXT, primary_key=True), sql.Column("value", TEXT, nullable=False)
)
VERSION = sql.Table("alembic_version", METADATA, sql.Column("version_num", sql.String(32), primary_key=True))
"""Which revision the file has (see `study.store.migration`)."""
MACHINES = sql.Table(
    "machines",
    METADATA,
    sql.Column("hash", TEXT, primary_key=True),
    sql.Column("fingerprint", TEXT, nullable=False),
    sql.Column("first_utc", TEXT, nullable=False),
)
STUDIES = sql.Table(
    "studies", METADATA, sql.Column("hash", TEXT, primary_key=True), sql.Column("text", TEXT, nullable=False)
)
SESSIONS = sql.Table(
    "sessions",
    METADATA,
    sql.Column("number", WHOLE, primary_key=True),
    sql.Column("participant", TEXT, nullable=False, unique=True),
    sql.Column("public_id", TEXT, nullable=False, unique=True),
    sql.Column("session", TEXT, nullable=False),
    sql.Column("state", TEXT, nullable=False),
    sql.Column("condition_order", TEXT, nullable=False),
    sql.Column("kind", TEXT, nullable=False),
    sql.Column("pace", TEXT, nullable=False),
    sql.Column("study_hash", TEXT, sql.ForeignKey("studies.hash"), nullable=False),
    sql.Column("seed", WHOLE, nullable=False),
    sql.Column("created_utc", TEXT, nullable=False),
    sql.Column("rejected", WHOLE, nullable=False, default=0),
    sqlite_autoincrement=True,  # the number of an erased participant is never given out again
)
TOKENS = sql.Table(
    "tokens",
    METADATA,
    sql.Column("sha256", TEXT, primary_key=True),
    _participant_column(index=True),
    sql.Column("role", TEXT, nullable=False),
    sql.Column("created_utc", TEXT, nullable=False),
)
IDENTITIES = sql.Table(
    "identities",
    METADATA,
    sql.Column("id", WHOLE, primary_key=True),
    _participant_column(index=True),
    sql.Column("kind", TEXT, nullable=False),
    sql.Column("value", TEXT, nullable=False),
)
SUBMISSIONS = sql.Table(
    "submissions",
    METADATA,
    _participant_column(primary_key=True),
    sql.Column("message_id", TEXT, primary_key=True),
    sql.Column("response", TEXT, nullable=False),
)
CYCLES = sql.Table(
    "cycles",
    METADATA,
    _participant_column(primary_key=True),
    sql.Column("trial", WHOLE, primary_key=True),
    sql.Column("practice", WHOLE, primary_key=True),
    sql.Column("cycle", WHOLE, primary_key=True),
    sql.Column("start", TEXT, nullable=False),
)
ERASURES = sql.Table(
    "erasures",
    METADATA,
    sql.Column("participant", TEXT, primary_key=True),
    sql.Column("utc", TEXT, nullable=False),
    sql.Column("hash", TEXT, nullable=False),
)


def _record_table(name: str) -> sql.Table:
    keys = KEYS.get(name, ())
    checks: list[Any] = []
    made: list[sql.Column[Any]] = [] if keys else [sql.Column("row_id", WHOLE, primary_key=True)]
    for info in columns(name):
        if info.name == "participant":
            made.append(_participant_column(primary_key="participant" in keys, index=not keys))
        else:
            kind = _SQL_TYPES[info.type]
            made.append(sql.Column(info.name, kind, primary_key=info.name in keys, nullable=info.optional))
    for info in columns(name):  # SQLite keeps what is no number as nothing
        if info.type == "float":
            is_number = sql.CheckConstraint(f"{info.name} <> 'NaN'", name=f"{name}_{info.name}_is_a_number")
            checks.append(is_number.ddl_if(dialect=POSTGRES))
    if name == "chain":
        made.append(sql.Column("salt", TEXT, nullable=False))  # of rows that no export holds; no export holds it
    return sql.Table(name, METADATA, *made, *checks)


RECORDS: Mapping[str, sql.Table] = {name: _record_table(name) for name in TABLES}
"""The recorded tables by their name in `records.TABLES`."""
CHAINED_TABLES: Mapping[str, sql.Table] = {name: METADATA.tables[name] for name in CHAINED}
"""The tables whose rows the chain tells of."""
