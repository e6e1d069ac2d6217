"""Statements of every tick, put into words once and given to SQLite as they are.

SQLAlchemy makes a statement anew each time, and an execution around it: of a tick that is several times what SQLite
itself takes. What is said here is what it would say.
"""

from __future__ import annotations

import sqlite3
from functools import cache

import sqlalchemy as sql
from sqlalchemy.dialects import sqlite
from sqlalchemy.dialects.sqlite import insert as insert_or_update

_DIALECT = sqlite.dialect()


def driver_of(connection: sql.Connection) -> sqlite3.Connection:
    """SQLite's own connection, in the transaction that this one is in. What it raises `Database` tells as its own."""
    driver = connection.connection.driver_connection
    assert isinstance(driver, sqlite3.Connection)
    return driver


@cache
def insertion(table: sql.Table, names: tuple[str, ...]) -> str:
    """A row of these columns; their values in this order."""
    return _said(table.insert().values({name: sql.bindparam(name) for name in names}), names)


@cache
def replacement(table: sql.Table, names: tuple[str, ...], keys: tuple[str, ...]) -> str:
    """The same, in place of the row that has these keys, if there is one."""
    statement = insert_or_update(table).values({name: sql.bindparam(name) for name in names})
    changed = {name: statement.excluded[name] for name in names if name not in keys}
    return _said(statement.on_conflict_do_update(index_elements=list(keys), set_=changed), names)


def _said(statement: sql.Insert, names: tuple[str, ...]) -> str:
    """With a number in place of each name, so that the values may come in any order of columns."""
    compiled = statement.compile(dialect=_DIALECT)
    assert isinstance(compiled, sql.sql.compiler.SQLCompiler)
    places = iter(compiled.positiontup or ())
    before, *after = compiled.string.split("?")
    return before + "".join(f"?{names.index(next(places)) + 1}{part}" for part in after)
