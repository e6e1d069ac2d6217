"""Rows on their way in: a recorded row as SQLite takes it, added once or replacing the one of its key."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import sqlalchemy as sql
from sqlalchemy.dialects.sqlite import insert as insert_or_update

from study.records import KEYS, TABLES, columns
from study.store.tables import RECORDS
from study.store.values import StoreError


def clean_text(value: object) -> str:
    """Text as SQLite and a CSV reader take it: no NUL, no half of a surrogate pair."""
    return str(value).replace("\0", "").encode("utf-8", "replace").decode("utf-8")


_CASTS_OF: Mapping[str, Callable[[Any], Any]] = {"str": clean_text, "int": int, "float": float}
_CASTS: Mapping[str, tuple[tuple[str, Callable[[Any], Any]], ...]] = {
    name: tuple((info.name, _CASTS_OF[info.type]) for info in columns(name)) for name in TABLES
}


def insert(connection: sql.Connection, table: sql.Table, **values: object) -> None:
    """One row of a table of the lab's own."""
    connection.execute(table.insert().values(values))


def add(connection: sql.Connection, table: str, rows: Iterable[Any]) -> None:
    """Rows of a recorded table, beside those it has. Raises `StoreError` for a row of another table's type."""
    values = [_values(table, row) for row in rows]
    if values:
        connection.execute(RECORDS[table].insert(), values)


def put(connection: sql.Connection, table: str, rows: Iterable[Any]) -> None:
    """As `add`, but a row takes the place of an earlier one with its key."""
    for row in rows:
        statement = insert_or_update(RECORDS[table]).values(_values(table, row))
        changed = {name: statement.excluded[name] for name, _ in _CASTS[table] if name not in KEYS[table]}
        connection.execute(statement.on_conflict_do_update(index_elements=list(KEYS[table]), set_=changed))


def _values(table: str, row: Any) -> dict[str, Any]:
    """A row as SQLite takes it: plain Python numbers, whatever made them."""
    if not isinstance(row, TABLES[table]):
        raise StoreError(f"table {table} takes {TABLES[table].__name__}, not {type(row).__name__}")
    given = vars(row)
    return {name: None if given[name] is None else cast_to(given[name]) for name, cast_to in _CASTS[table]}
