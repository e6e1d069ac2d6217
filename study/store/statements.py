"""Statements of every tick, put into words once and given to the database's driver as they are.

SQLAlchemy makes a statement anew each time, and an execution around it: of a tick that is several times what SQLite
itself takes. The words are SQLite's; PostgreSQL's driver marks a value otherwise.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import sqlalchemy as sql


def driver_of(connection: sql.Connection) -> Any:
    """The driver's own connection, in the transaction that this one is in. What it raises `Database` tells as its
    own."""
    return connection.connection.driver_connection


def run(connection: sql.Connection, words: str, values: Sequence[Any] = ()) -> Any:
    """Have the driver do it; a cursor."""
    driver = driver_of(connection)
    if isinstance(driver, sqlite3.Connection):
        return driver.execute(words, values)
    return driver.execute(_for_postgres(words), values)


def run_many(connection: sql.Connection, words: str, rows: Sequence[Sequence[Any]]) -> None:
    """The same for each of these rows of values."""
    driver = driver_of(connection)
    if isinstance(driver, sqlite3.Connection):
        driver.executemany(words, rows)
    elif len(rows) == 1:
        driver.execute(_for_postgres(words), rows[0])
    else:
        driver.cursor().executemany(_for_postgres(words), rows)


@cache
def _for_postgres(words: str) -> str:
    return words.replace("?", "%s")


@cache
def insertion(table: sql.Table, names: tuple[str, ...]) -> str:
    """A row of these columns; their values in this order."""
    quoted = _quoted(names)
    values = ", ".join("?" * len(quoted))
    return f"INSERT INTO {_quote(table.name)} ({', '.join(quoted)}) VALUES ({values})"


@cache
def replacement(table: sql.Table, names: tuple[str, ...], keys: tuple[str, ...]) -> str:
    """The same, in place of the row that has these keys, if there is one."""
    changed = ", ".join(f"{name} = excluded.{name}" for name in _quoted(name for name in names if name not in keys))
    return f"{insertion(table, names)} ON CONFLICT ({', '.join(_quoted(keys))}) DO UPDATE SET {changed}"


def insert_once(connection: sql.Connection, table: sql.Table, **values: Any) -> None:
    """A row of a table that has no participants, unless it is there."""
    run(connection, f"{insertion(table, tuple(values))} ON CONFLICT DO NOTHING", tuple(values.values()))


def _quote(name: str) -> str:
    """In quotes, which both take, no name is mistaken for a word of theirs."""
    return f'"{name}"'


def _quoted(names: Iterable[str]) -> list[str]:
    return [_quote(name) for name in names]
