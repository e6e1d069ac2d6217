"""The numbers of participants, none of which is ever given out again, whoever is erased.

SQLite counts them itself (AUTOINCREMENT). PostgreSQL's own counters go on when a transaction is undone, which leaves
gaps that look as if somebody had been taken away: there the highest number is a row of `meta`.
"""

from __future__ import annotations

from collections.abc import Mapping

import sqlalchemy as sql

from study.store.tables import META, SESSIONS

NAME = "numbers_given_out"


def next_number(connection: sql.Connection) -> Mapping[str, int]:
    """The column with the number of whoever comes next; nothing where the database numbers by itself."""
    if connection.dialect.name == "sqlite":
        return {}
    number = given_out(connection) + 1
    keep(connection, number)
    return {SESSIONS.c.number.name: number}


def given_out(connection: sql.Connection) -> int:
    """The highest number so far."""
    if connection.dialect.name == "sqlite":
        query = "SELECT seq FROM sqlite_sequence WHERE name = 'sessions'"
        return int(connection.exec_driver_sql(query).scalar() or 0)
    return int(connection.execute(sql.select(META.c.value).where(META.c.name == NAME)).scalar() or 0)


def keep(connection: sql.Connection, number: int) -> None:
    """Go on after this number."""
    if connection.dialect.name == "sqlite":
        connection.exec_driver_sql("DELETE FROM sqlite_sequence WHERE name = 'sessions'")
        connection.exec_driver_sql("INSERT INTO sqlite_sequence (name, seq) VALUES ('sessions', ?)", (number,))
        return
    connection.execute(META.delete().where(META.c.name == NAME))
    connection.execute(META.insert().values(name=NAME, value=str(number)))
