"""A lab's data on either kind of database, and what another program does with them meanwhile."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from study.store import DataPlace, place_of
from tests.support.postgres_server import PostgresServer

KINDS = ("sqlite", "postgres")


def new_place(kind: str, folder: Path, server: PostgresServer | None) -> DataPlace:
    """A place where nothing is yet."""
    if kind == "sqlite":
        return DataPlace(folder)
    assert server is not None
    return DataPlace(folder, server.url(server.database()))


def typed(place: DataPlace) -> str:
    """What `--data` is given."""
    return place.url or str(place.folder)


def typed_options(place: DataPlace) -> tuple[str, ...]:
    """The same with the option for the folder of a database on a server."""
    return ("--data", typed(place), *(() if place.url is None else ("--folder", str(place.folder))))


@contextlib.contextmanager
def other_program(place: DataPlace | Path) -> Iterator[Any]:
    """Its connection, on which every statement is a transaction; `execute` has a cursor."""
    data = place_of(place)
    if data.url is None:
        with closing(sqlite3.connect(data.folder / "lab.sqlite", isolation_level=None)) as connection:
            yield connection
        return
    import psycopg

    address = data.url.replace("postgresql+psycopg", "postgresql")
    with psycopg.connect(address, autocommit=True) as connection:
        yield connection


def found_in(place: DataPlace | Path, query: str) -> list[tuple[Any, ...]]:
    """What another program finds."""
    with other_program(place) as connection:
        return list(connection.execute(query).fetchall())


def changed_in(place: DataPlace | Path, *statements: str) -> int:
    """What another program does, whatever the database would hold it to; how many rows the last one concerned."""
    count = 0
    with other_program(place) as connection:
        if place_of(place).url is not None:
            connection.execute("SET session_replication_role = replica")  # no references are checked, as in SQLite
        for statement in statements:
            count = connection.execute(statement).rowcount
    return count


@contextlib.contextmanager
def locked(place: DataPlace | Path) -> Iterator[None]:
    """Another program writes to the database, and does not end while the block runs."""
    with other_program(place) as other:
        if place_of(place).url is None:
            other.execute("BEGIN IMMEDIATE")
        else:
            from study.store.postgres import WRITING

            other.execute("BEGIN")
            other.execute(f"SELECT pg_advisory_xact_lock{WRITING}")
        yield
        other.execute("ROLLBACK")
