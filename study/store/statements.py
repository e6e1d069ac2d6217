"""Statements of every tick, put into words once and given to SQLite as they are.

SQLAlchemy makes a statement anew each time, and an execution around it: of a tick that is several times what SQLite
itself takes.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable
from functools import cache

import sqlalchemy as sql
from sqlalchemy.dialects import sqlite

_quote = sqlite.dialect().identifier_preparer.quote


def driver_of(connection: sql.Connection) -> sqlite3.Connection:
    """SQLite's own connection, in the transaction that this one is in. What it raises `Database` tells as its own."""
    driver = connection.connection.driver_connection
    assert isinstance(driver, sqlite3.Connection)
    return driver


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


def _quoted(names: Iterable[str]) -> list[str]:
    return [_quote(name) for name in names]
