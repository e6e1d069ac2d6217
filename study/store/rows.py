"""Rows on their way in: a recorded row as the database takes it, added once or replacing the one of its key.

Each is noted in the transaction's ledger, from which its link in the chain is made (`study.store.ledger`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import sqlalchemy as sql

from study.integrity.content import CHAINED
from study.records import KEYS, TABLES, columns
from study.store import ledger
from study.store.statements import insertion, replacement, run, run_many
from study.store.tables import CHAINED_TABLES, RECORDS
from study.store.values import StoreError


def clean_text(value: object) -> str:
    """Text as databases and a CSV reader take it: no NUL, no half of a surrogate pair."""
    text = str(value)
    if text.isascii():
        return text.replace("\0", "")
    return text.replace("\0", "").encode("utf-8", "replace").decode("utf-8")


_CASTS_OF: Mapping[str, Callable[[Any], Any]] = {"str": clean_text, "int": int, "float": float}
_CASTS: Mapping[str, tuple[tuple[str, Callable[[Any], Any]], ...]] = {
    name: tuple((info.name, _CASTS_OF[info.type]) for info in columns(name)) for name in TABLES
}

_NAMES: Mapping[str, tuple[str, ...]] = {name: tuple(column for column, _ in of) for name, of in _CASTS.items()}
"""The columns of each table, in the order of `_values`."""


def insert(connection: sql.Connection, table: sql.Table, **values: object) -> None:
    """One row of a table of the lab's own."""
    run(connection, insertion(table, tuple(values)), tuple(values.values()))
    if table.name in CHAINED:
        ledger.note(connection, table.name, values)


def update(connection: sql.Connection, name: str, participant: str, values: Mapping[str, Any]) -> bool:
    """Change a participant's only row of a table; False when there is none."""
    table = CHAINED_TABLES[name]
    here = table.c.participant == participant
    if connection.execute(table.update().where(here).values(values)).rowcount != 1:
        return False
    ledger.note(connection, name, dict(connection.execute(sql.select(table).where(here)).mappings().one()))
    return True


def add(connection: sql.Connection, table: str, rows: Iterable[Any]) -> None:
    """Rows of a recorded table, beside those it has. Raises `StoreError` for a row of another table's type."""
    values = [_values(table, row) for row in rows]
    if values:
        said = insertion(RECORDS[table], _NAMES[table])
        run_many(connection, said, [tuple(one.values()) for one in values])
    for one in values:
        ledger.note(connection, table, one)


def put(connection: sql.Connection, table: str, rows: Iterable[Any]) -> None:
    """As `add`, but a row takes the place of an earlier one with its key."""
    for row in rows:
        values = _values(table, row)
        ledger.note(connection, table, values)
        said = replacement(RECORDS[table], _NAMES[table], tuple(KEYS[table]))
        run(connection, said, tuple(values.values()))


def _values(table: str, row: Any) -> dict[str, Any]:
    """A row as a database takes it: plain Python numbers, whatever made them."""
    if not isinstance(row, TABLES[table]):
        raise StoreError(f"table {table} takes {TABLES[table].__name__}, not {type(row).__name__}")
    given = vars(row)
    return {name: None if given[name] is None else cast_to(given[name]) for name, cast_to in _CASTS[table]}
