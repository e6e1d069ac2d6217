"""Deleting somebody, and the mark that stays."""

from __future__ import annotations

import sqlalchemy as sql

from study.integrity.chain import tombstone_hash
from study.store.rows import insert
from study.store.tables import ERASURES, METADATA


def erase(connection: sql.Connection, participant: str, utc: str) -> None:
    """Delete every row of a participant, in every table that has a column `participant`, and mark that there was one.

    The mark is the tombstone that their chain leaves, over no content.

    Deleted pages are overwritten (secure_delete); the log holds them until `Database.empty_log`.
    """
    for table in reversed(METADATA.sorted_tables):
        if "participant" in table.c and table is not ERASURES:
            connection.execute(table.delete().where(table.c.participant == participant))
    insert(connection, ERASURES, participant=participant, utc=utc, hash=tombstone_hash(participant, utc))


def erasures(connection: sql.Connection) -> tuple[tuple[str, str], ...]:
    """(participant, utc) of everyone erased."""
    query = sql.select(ERASURES.c.participant, ERASURES.c.utc).order_by(ERASURES.c.utc)
    return tuple((row.participant, row.utc) for row in connection.execute(query))
