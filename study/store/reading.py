"""Reading a database as it stands, for its verification: past SQLAlchemy's types, and whatever state it is in."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import quote

import sqlalchemy as sql

from study.integrity.findings import Finding
from study.store import numbering
from study.store.page_sums import changed_pages
from study.store.sqlite_file import FILE_NAME
from study.store.statements import run
from study.store.tables import METADATA

MOST_DAMAGES = 100
"""As many as SQLite is asked for; more say nothing more."""
Row = Mapping[str, Any]
Errors = tuple[type[Exception], ...]


class Reader(Protocol):
    """One moment of a database. `name` is what findings call it."""

    name: str

    def rows(self, query: str, *values: object) -> Iterator[Row]:
        """What is found, by the names of its columns."""

    def tables(self) -> frozenset[str]:
        """Those there are."""

    def arrival(self, table: str) -> str:
        """The column by which rows without a key stand in order of arrival."""

    def damages(self, errors: Errors, said: Callable[[Exception], str]) -> Iterator[Finding]:
        """What is wrong with its pages. `errors` are raised by reading what is damaged."""

    def references(self) -> Iterator[Finding]:
        """Rows that refer to a row that is missing."""

    def given_out(self) -> tuple[str, int]:
        """Where it stands which number of a participant was the last, and that number."""


class FileReader:
    """A file of SQLite's."""

    name = FILE_NAME

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection = connection
        self._path = path

    @staticmethod
    def opened(path: Path) -> sqlite3.Connection:
        """A connection on which one moment is read, whatever is written meanwhile."""
        address = f"file:{quote(str(path.absolute()))}?mode=ro"
        connection = sqlite3.connect(address, uri=True, timeout=10.0, isolation_level=None)
        connection.row_factory = _as_mapping
        connection.text_factory = _text
        try:
            connection.execute("BEGIN")
        except sqlite3.Error:
            connection.close()
            raise
        return connection

    def rows(self, query: str, *values: object) -> Iterator[Row]:
        """As SQLite finds them."""
        yield from self._connection.execute(query, values)

    def tables(self) -> frozenset[str]:
        """In its own list."""
        return frozenset(row["name"] for row in self.rows("SELECT name FROM sqlite_master WHERE type = 'table'"))

    def arrival(self, table: str) -> str:
        """SQLite's own number, whatever became of the column."""
        return "rowid"

    def damages(self, errors: Errors, said: Callable[[Exception], str]) -> Iterator[Finding]:
        """What SQLite itself finds (pages, indexes, the list of free pages, values of a wrong type), and pages that are
        not as the lab left them when it ended."""
        try:
            for row in self.rows(f"PRAGMA integrity_check({MOST_DAMAGES})"):
                text = " ".join(str(next(iter(row.values()))).split())
                if text != "ok":
                    yield Finding(self._place_of(text, errors), text.removeprefix("*** in database main *** "))
        except errors as error:
            yield Finding(FILE_NAME, f"its pages are damaged: {said(error)}")
        for number in changed_pages(self._path):
            yield Finding(self._place_of(f"page {number}", errors), f"page {number} is not as the lab left it")

    def _place_of(self, text: str, errors: Errors) -> str:
        """The file, and the table or index whose page SQLite names by a number."""
        named = re.search(r"\bpage (\d+)", text)
        try:
            found = self.rows("SELECT name FROM dbstat WHERE pageno = ?", int(named[1])) if named else iter(())
            return ", ".join([FILE_NAME, *(str(row["name"]) for row in found)])
        except errors:  # the page is damaged, or this SQLite has no such table
            return FILE_NAME

    def references(self) -> Iterator[Finding]:
        """As SQLite finds them."""
        for row in self.rows("PRAGMA foreign_key_check"):
            yield Finding(f"{row['table']}, row {row['rowid']}", f"belongs to a row of {row['parent']} that is missing")

    def given_out(self) -> tuple[str, int]:
        """SQLite counts."""
        found = self.rows("SELECT seq FROM sqlite_sequence WHERE name = 'sessions'")
        return "sqlite_sequence", max((row["seq"] for row in found), default=0)


class ServerReader:
    """A database of PostgreSQL's, on a connection that reads one moment."""

    name = "the database"

    def __init__(self, connection: sql.Connection) -> None:
        self._connection = connection
        self._tables = frozenset(sql.inspect(connection).get_table_names())

    def rows(self, query: str, *values: object) -> Iterator[Row]:
        """As its driver finds them."""
        cursor = run(self._connection, query, values)
        names = [column.name for column in cursor.description]
        for row in cursor:
            yield dict(zip(names, row, strict=True))

    def tables(self) -> frozenset[str]:
        """Of the lab's schema."""
        return self._tables

    def arrival(self, table: str) -> str:
        """The column that numbers them."""
        return next(iter(METADATA.tables[table].primary_key)).name

    def damages(self, errors: Errors, said: Callable[[Exception], str]) -> Iterator[Finding]:
        """Pages are the server's to check (`pg_amcheck`, data checksums)."""
        return iter(())

    def references(self) -> Iterator[Finding]:
        """The server holds them, unless somebody has told it not to."""
        for table in METADATA.sorted_tables:
            for key in table.foreign_keys if table.name in self._tables else ():
                parent, mine, theirs = key.column.table.name, key.parent.name, key.column.name
                lost = (
                    f"SELECT {mine} AS lost FROM {table.name} WHERE NOT EXISTS "
                    f"(SELECT 1 FROM {parent} WHERE {parent}.{theirs} = {table.name}.{mine})"
                )
                for row in self.rows(lost):
                    yield Finding(f"{table.name} of {row['lost']}", f"belongs to a row of {parent} that is missing")

    def given_out(self) -> tuple[str, int]:
        """The lab counts."""
        return "meta", numbering.given_out(self._connection)


def _as_mapping(cursor: sqlite3.Cursor, row: tuple[Any, ...]) -> Row:
    names = [description[0] for description in cursor.description]
    return dict(zip(names, [value.hex() if isinstance(value, bytes) else value for value in row], strict=True))


def _text(raw: bytes) -> str:
    """Text as it is; of what is no text any more, something that no row ever held."""
    return raw.decode("utf-8", "backslashreplace")
