"""One opened database, whose transactions are on disk when they end, whatever kind of database it is.

There is one writer at a time; readers see one moment and hold nobody up. What is particular to SQLite's file or to a
server of PostgreSQL's stands in the two modules of their names, behind `study.store.backend`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path

import sqlalchemy as sql

from study.store import ledger, migration
from study.store.backend import Backend
from study.store.condition import CommitUnknown, StoreTroubled
from study.store.fingerprint import fingerprint_text, machine_fingerprint
from study.store.place import DataPlace
from study.store.sqlite_file import FILE_NAME, LOCK_NAME, is_in_use, open_file
from study.store.statements import insert_once, run
from study.store.tables import MACHINES, METADATA, VERSION
from study.store.values import StoreError

__all__ = ["FILE_NAME", "LOCK_NAME", "Database", "TransactionUndone", "is_in_use", "open_database"]
BAD_ADDRESS = 2
"""The exit status of a command whose database cannot be used, as of one that was typed wrong."""


def open_database(place: DataPlace, *, exclusive: bool, must_exist: bool) -> Database:
    """Open the database of a place, as `open_store` says."""
    if place.url is None:
        backend: Backend = open_file(place.folder, exclusive=exclusive, must_exist=must_exist)
        return _prepared(Database(backend), is_reader=must_exist)
    from study.store.postgres import open_server  # whose driver is an extra

    try:
        return _prepared(Database(open_server(place, exclusive=exclusive)), is_reader=must_exist)
    except StoreError as error:
        error.exit_status = BAD_ADDRESS
        raise


def _prepared(database: Database, *, is_reader: bool) -> Database:
    try:
        database.prepare(is_reader=is_reader)
    except BaseException:
        database.close()
        raise
    return database


class TransactionUndone(StoreError):
    """An error in a part for which the database has undone the whole transaction, as SQLite does without memory."""


class Database:
    """The open database and its transactions. Made by `open_database`; usable from several threads.

    Attributes:
        backend: what kind it is.
        writes: how many transactions were written.
    """

    def __init__(self, backend: Backend) -> None:
        self.backend = backend
        self.writes = 0

    @property
    def engine(self) -> sql.Engine:
        """What hands out the connections for reading."""
        return self.backend.reading

    @property
    def name(self) -> str:
        """What errors call it."""
        return self.backend.name

    def close(self) -> None:
        """Give it up; twice is once."""
        self.backend.close()

    @contextmanager
    def write(self) -> Iterator[sql.Connection]:
        """A transaction that is on disk when the `with` ends, or leaves nothing when it raises."""
        with self.transaction() as connection, ledger.linked(connection):
            yield connection

    @contextmanager
    def transaction(self) -> Iterator[sql.Connection]:
        """As `write`, for what is written in `part`s alone.

        Raises `CommitUnknown` when the server was lost after it was asked to commit and before it answered.
        """
        asked = None
        try:
            with self._told(), self.backend.writing.begin() as connection:
                ledger.forget_heads(connection)
                yield connection
                self.backend.must_be_in_place()
                asked = ledger.heads_written(connection)
        except StoreTroubled as error:
            if asked and error.kind == "unreachable":
                raise CommitUnknown(error.kind, str(error), asked) from error
            raise
        self.writes += 1

    @contextmanager
    def part(self, connection: sql.Connection) -> Iterator[None]:
        """A part of a transaction: when it raises, nothing of it is left, and the transaction may go on.

        Raises `TransactionUndone` where the database itself has undone the whole transaction for it.
        """
        with self._told():
            run(connection, "SAVEPOINT part")
            try:
                with self._told(), ledger.linked(connection):
                    yield
            except BaseException as error:
                if not self.backend.is_in_transaction(connection):
                    raise TransactionUndone(str(error)) from error
                run(connection, "ROLLBACK TO part")
                run(connection, "RELEASE part")
                raise
            run(connection, "RELEASE part")

    @contextmanager
    def read(self) -> Iterator[sql.Connection]:
        """A view of one moment."""
        with self._told(), self.backend.reading.connect() as connection:
            yield connection

    def move_log(self) -> None:
        """As `Backend.move_log`."""
        self.backend.move_log()

    def empty_log(self) -> bool | None:
        """As `Backend.empty_log`."""
        with self._told():
            return self.backend.empty_log()

    @property
    def in_place(self) -> bool:
        """As `Backend.in_place`."""
        return self.backend.in_place

    def try_to_write(self) -> None:
        """Write what changes nothing, to see whether the disk does."""
        with self.write() as connection:
            self.backend.touch(connection)

    def read_back(self) -> None:
        """Read the newest row of each table from the disk. Raises `StoreTroubled` when what is there is damaged."""
        with self._told():
            self.backend.read_back()

    def copy_out(self, path: Path) -> None:
        """As `Backend.copy_out`."""
        self.backend.copy_out(path)

    # ---- versions

    def prepare(self, *, is_reader: bool) -> None:
        """Make the tables of a new database, or check that it is one of ours and whole, and bring an older one up.

        A reader takes no write lock, unless the database is an older one: the lab may be running.
        """
        revision: str | None = None
        with self.read() as connection:
            existing = set(sql.inspect(connection).get_table_names())
            is_marked = VERSION.name in existing
            if existing:
                revision = migration.revision_of(connection, existing, self.name, self.backend.copies())
            elif is_reader or not self.backend.is_new:
                raise StoreError(f"{self.name}: no lab data here, the database is empty{self.backend.why_empty}")
            self.backend.check_whole(connection)
        if revision is not None and revision != migration.HEAD:
            self._bring_up()
            is_marked = True
        if is_reader:
            return
        self.backend.before_writing()
        text = fingerprint_text(machine_fingerprint())
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        with self.write() as connection:
            if not is_marked:
                METADATA.create_all(connection, tables=[VERSION] if existing else None)
                migration.mark(connection)
            digest = hashlib.sha256(text.encode()).hexdigest()
            insert_once(connection, MACHINES, hash=digest, fingerprint=text, first_utc=now)
        self.backend.stay()

    def _bring_up(self) -> None:
        """Make an older one of this version, after copying it aside; nobody else has it open meanwhile."""
        with self.backend.alone():
            with self.read() as connection:  # again, now that nobody else can be at it
                existing = set(sql.inspect(connection).get_table_names())
                revision = migration.revision_of(connection, existing, self.name, self.backend.copies())
            if revision != migration.HEAD:
                self.backend.copy_aside(revision)
                self.backend.before_writing()
                with self._told(), self.backend.rebuilding() as connection:
                    METADATA.create_all(connection, tables=[VERSION])
                    migration.bring_up(connection, self.name, revision)

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Whatever the database says becomes one line with its name."""
        said_by_it: tuple[type[Exception], ...] = (sql.exc.DBAPIError, sql.exc.TimeoutError, *self.backend.errors)
        try:
            yield
        except said_by_it as error:
            said = error.orig if isinstance(error, sql.exc.DBAPIError) and error.orig is not None else error
            kind = self.backend.trouble(said)
            if kind is None:
                raise StoreError(f"{self.name}: {self.backend.said(said)}") from error
            self.backend.must_be_in_place()  # or that is why
            raise StoreTroubled(kind, f"{self.name}: {self.backend.said(said)}") from error
        except OverflowError as error:
            raise StoreError(f"{self.name}: a whole number beyond 64 bits cannot be stored") from error
