"""What a transaction wrote, and the links of the chain that are made of it before it ends.

`rows` notes each row here; `Database.write` has the links made as the last thing of the transaction, so that a row and
its link are on disk together or not at all.
"""

from __future__ import annotations

import secrets
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import sqlalchemy as sql

from study.integrity.chain import BEGUN, Entry, Head, entry, extended
from study.integrity.content import CHAINED, OWN_KEYS, key_of, keys_of
from study.records import columns
from study.store.statements import insertion, run, run_many
from study.store.tables import CHAINED_TABLES, RECORDS, SESSIONS

_INFO = "chain"
"""Where the entries wait, on the connection."""
_HEADS = "heads"
"""Where the ends of the chains are noted that a transaction has written."""
_SALT_BYTES = 16
_LINK = (*(info.name for info in columns("chain")), "salt")
_HEAD = "SELECT seq, hash FROM chain WHERE participant = ? ORDER BY seq DESC LIMIT 1"
_WRITTEN = "SELECT 1 FROM chain WHERE participant = ? AND seq = ? AND hash = ?"


@contextmanager
def linked(connection: sql.Connection) -> Iterator[None]:
    """What is written inside is linked at its end."""
    open_ledger(connection)
    yield
    close_ledger(connection)


def open_ledger(connection: sql.Connection) -> None:
    """Nothing was written yet."""
    connection.info[_INFO] = defaultdict(list)


def note(connection: sql.Connection, table: str, values: Mapping[str, Any]) -> None:
    """A row was written, whose columns have these values."""
    connection.info[_INFO][values["participant"]].append(_entry(table, values))


def note_removed(connection: sql.Connection, table: str, values: Mapping[str, Any]) -> None:
    """A row was removed that had these values."""
    connection.info[_INFO][values["participant"]].append(Entry(table, key_of(table, values), ""))


def close_ledger(connection: sql.Connection) -> None:
    """Link what was written."""
    for participant, entries in connection.info.pop(_INFO).items():
        _link(connection, participant, entries)


def head_of(connection: sql.Connection, participant: str) -> Head:
    """The end of a participant's chain."""
    row = run(connection, _HEAD, (participant,)).fetchone()
    return Head(*row) if row else Head()


def begin(connection: sql.Connection, revision: str, utc: str) -> None:
    """Begin the chain of everybody who was there before there was one, with their rows as they are."""
    for participant in (
        connection.execute(sql.select(SESSIONS.c.participant).order_by(SESSIONS.c.number)).scalars().all()
    ):
        rows = ((table, values) for table in CHAINED for values in rows_of(connection, table, participant))
        begun = Entry(BEGUN, f"{utc}, schema {revision}", "")
        _link(connection, participant, [begun, *(_entry(table, values) for table, values in rows)])


def rows_of(connection: sql.Connection, table: str, participant: str) -> Iterator[Mapping[str, Any]]:
    """A participant's rows of a chained table as they stand in the file, in order of arrival or of their key."""
    source = CHAINED_TABLES[table]
    order = [source.c[name] for name in keys_of(table) or ()] or list(source.primary_key.columns)
    query = sql.select(source).where(source.c.participant == participant).order_by(*order)
    yield from map(dict, connection.execute(query).mappings())


def _entry(table: str, values: Mapping[str, Any]) -> Entry:
    """Of a row of the lab's own, which is in no export, the content is salted: its hash is in them."""
    return entry(table, values, secrets.token_hex(_SALT_BYTES) if table in OWN_KEYS else "")


def _link(connection: sql.Connection, participant: str, entries: Iterable[Entry]) -> None:
    noted = list(entries)
    links = extended(head_of(connection, participant), participant, noted)
    said = insertion(RECORDS["chain"], _LINK)
    rows = [(*vars(link).values(), made.salt) for link, made in zip(links, noted, strict=True)]
    run_many(connection, said, rows)
    if links:
        connection.info.setdefault(_HEADS, {})[participant] = Head(links[-1].seq, links[-1].hash)


def forget_heads(connection: sql.Connection) -> None:
    """A transaction begins."""
    connection.info[_HEADS] = {}


def heads_written(connection: sql.Connection) -> dict[str, Head]:
    """The ends of the chains that this transaction has written, by participant."""
    return dict(connection.info.get(_HEADS, {}))


def has_one_of(connection: sql.Connection, heads: Mapping[str, Head]) -> bool:
    """Whether a transaction that wrote these ends of chains was committed: all of it was, or nothing."""
    return any(run(connection, _WRITTEN, (who, head.seq, head.hash)).fetchone() for who, head in heads.items())
