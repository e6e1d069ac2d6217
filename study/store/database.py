"""The file: one SQLite database in the data folder, whose transactions are on disk when they end.

SQLite has one writer at a time, others wait up to ten seconds; readers see one moment and hold nobody up (WAL with
`synchronous=FULL`). The lab that serves waits a moment only: it tries again by itself, and says so meanwhile.

SQLite goes on writing to a file that was deleted or moved under its hands. So each transaction ends with a look whether
the database is still where it was opened, and raises when it is not.
"""

from __future__ import annotations

import hashlib
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import Any
from urllib.parse import quote

import sqlalchemy as sql
from sqlalchemy.dialects.sqlite import insert as insert_or_update

from study.disk.flushing import to_disk
from study.disk.locks import Lock, hold
from study.disk.private_files import FOLDER_MODE, keep_private, make_private
from study.store import ledger, migration
from study.store.condition import WHAT_TO_DO, StoreTroubled, kind_of
from study.store.fingerprint import fingerprint_text, machine_fingerprint
from study.store.page_sums import forget_sums, write_sums
from study.store.statements import driver_of
from study.store.tables import MACHINES, METADATA, VERSION
from study.store.values import StoreError

FILE_NAME = "lab.sqlite"
LOCK_NAME = "lab.lock"
WAIT_S = 10.0
"""How long a transaction waits for another program's."""
WAIT_SERVING_S = 0.25
"""The same for the lab that serves: everybody who waits is told meanwhile."""
_BESIDE = ("", "-wal", "-shm")
"""What the files of an open database end in."""


def open_database(folder: Path, *, exclusive: bool, must_exist: bool) -> Database:
    """Open the database of a data folder, as `open_store` says."""
    path = folder.absolute() / FILE_NAME
    try:
        if must_exist and not path.is_file():
            raise StoreError(f"{folder}: no lab data here ({FILE_NAME} is missing)")
        if not folder.exists():
            folder.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        if path.exists() and not path.is_file():
            raise StoreError(f"{path}: is no regular file; a lab's database cannot be there")
    except OSError as error:
        raise StoreError(f"{folder}: cannot be used as data folder: {error.strerror or error}") from None
    lock = _lock(folder) if exclusive else None
    if not must_exist:
        _close_to_others(folder, path)
    is_new = not path.is_file() or path.stat().st_size == 0
    database = Database(path, lock)
    try:
        database.prepare(is_reader=must_exist, is_new=is_new)
    except BaseException:
        database.close()
        raise
    return database


def is_in_use(folder: Path) -> bool:
    """Whether a lab runs on a folder, or somebody changes its data. Raises `OSError`."""
    if not (folder / LOCK_NAME).is_file():
        return False
    lock = hold(folder / LOCK_NAME)
    if lock is None:
        return True
    lock.close()
    return False


def _close_to_others(folder: Path, path: Path) -> None:
    try:
        make_private(path)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be used as data folder: {error.strerror or error}") from None
    keep_private(folder, path.stem)


def _lock(folder: Path) -> Lock:
    """The folder's lock, held until it is closed. Raises `StoreError` when a lab holds it, or it cannot be made."""
    try:
        lock = hold(folder / LOCK_NAME)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be used as data folder: {error.strerror or error}") from None
    if lock is None:
        raise StoreError(f"{folder}: another lab is running on this data folder")
    return lock


class TransactionUndone(StoreError):
    """An error in a part for which SQLite has undone the whole transaction, as it does when memory runs out."""


class Database:
    """The open file and its transactions. Made by `open_database`; usable from several threads.

    Attributes:
        path: where it stands.
        writes: how many transactions were written.
    """

    def __init__(self, path: Path, lock: Lock | None = None) -> None:
        self.path = path
        self.writes = 0
        self._lock = lock
        self._place: tuple[tuple[int, int] | None, ...] | None = None
        self._anchor: sqlite3.Connection | None = None
        # Put together, not written as text: the name of a folder may hold ? and %, which mean something in an address.
        address = sql.URL.create("sqlite", database=str(path))
        self.engine = sql.create_engine(address, creator=self._connect)
        sql.event.listen(self.engine, "connect", _set_up_connection)
        sql.event.listen(self.engine, "begin", _begin)
        self._writing = self.engine.execution_options(begin="BEGIN IMMEDIATE")

    def close(self) -> None:
        """Give up the file; twice is once."""
        self.engine.dispose()
        if self._anchor is not None:
            self._anchor.close()
            self._anchor = None
        if self._lock:
            write_sums(self.path)
            self._lock.close()
            self._lock = None

    @contextmanager
    def write(self) -> Iterator[sql.Connection]:
        """A transaction that is on disk when the `with` ends, or leaves nothing when it raises."""
        with self.transaction() as connection, ledger.linked(connection):
            yield connection

    @contextmanager
    def transaction(self) -> Iterator[sql.Connection]:
        """As `write`, for what is written in `part`s alone."""
        with self._told(), self._writing.begin() as connection:
            yield connection
            self._must_be_in_place()
        self.writes += 1

    @contextmanager
    def part(self, connection: sql.Connection) -> Iterator[None]:
        """A part of a transaction: when it raises, nothing of it is left, and the transaction may go on.

        Raises `TransactionUndone` where SQLite itself has undone the whole transaction for it.
        """
        driver = driver_of(connection)
        with self._told():
            driver.execute("SAVEPOINT part")
            try:
                with self._told(), ledger.linked(connection):
                    yield
            except BaseException as error:
                if not driver.in_transaction:
                    raise TransactionUndone(str(error)) from error
                driver.execute("ROLLBACK TO part")
                driver.execute("RELEASE part")
                raise
            driver.execute("RELEASE part")

    @contextmanager
    def read(self) -> Iterator[sql.Connection]:
        """A view of one moment."""
        with self._told(), self.engine.connect() as connection:
            yield connection

    def move_log(self) -> None:
        """Move the log into the file as far as others' reading lets it. What fails is tried again with the next one:
        the log has everything."""
        with suppress(sql.exc.DBAPIError, StoreError), self.engine.connect() as connection:
            connection.execution_options(isolation_level="AUTOCOMMIT").exec_driver_sql("PRAGMA wal_checkpoint(PASSIVE)")

    def empty_log(self) -> bool:
        """Move the log into the file and cut it off; False when another process's reading did not let it."""
        with self._told(), self.engine.connect() as connection:
            direct = connection.execution_options(isolation_level="AUTOCOMMIT")
            waits_ms = direct.exec_driver_sql("PRAGMA busy_timeout").scalar_one()
            direct.exec_driver_sql(f"PRAGMA busy_timeout={round(WAIT_S * 1000)}")
            try:
                return int(direct.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)").one()[0]) == 0
            finally:
                direct.exec_driver_sql(f"PRAGMA busy_timeout={waits_ms}")

    # ---- where it stands

    @property
    def in_place(self) -> bool:
        """Whether the files are still those that were opened. A reader's are not watched."""
        return self._place is None or self._place == self._found()

    def try_to_write(self) -> None:
        """Write what changes nothing, to see whether the disk does."""
        with self.write() as connection:
            number = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
            connection.exec_driver_sql(f"PRAGMA user_version={int(number)}")

    def read_back(self) -> None:
        """Read the newest row of each table from the disk, past what SQLite keeps of it in memory.

        It goes on writing to a file that something else has written over, from what it remembers. Raises
        `StoreTroubled` when what is there is damaged.
        """
        try:
            with closing(self._connect()) as connection:
                for table in METADATA.sorted_tables:
                    connection.execute(f'SELECT * FROM "{table.name}" ORDER BY rowid DESC LIMIT 1').fetchall()
        except sqlite3.Error as error:
            kind = kind_of(str(error))
            if kind is None:
                raise StoreError(f"{self.path}: {error}") from error
            self._must_be_in_place()
            raise StoreTroubled(kind, f"{self.path}: {error}") from error

    def copy_out(self, path: Path) -> None:
        """Write all of it to a new file, also when its own has no name any more: what is open can still be read.

        Raises `OSError` or `sqlite3.Error` when that place does not take it.
        """
        assert self._anchor is not None  # `prepare` opened it
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
        with closing(sqlite3.connect(path)) as copy:
            copy.execute("PRAGMA synchronous=FULL")
            self._anchor.backup(copy)
        to_disk(path)

    def _found(self) -> tuple[tuple[int, int] | None, ...]:
        """Device and inode of each of the files that stand there now."""
        found: list[tuple[int, int] | None] = []
        for ending in _BESIDE:
            try:
                status = os.stat(f"{self.path}{ending}")
            except OSError:
                found.append(None)
            else:
                found.append((status.st_dev, status.st_ino))
        return tuple(found)

    def _must_be_in_place(self) -> None:
        if not self.in_place:
            raise StoreTroubled("gone", f"{self.path}: {WHAT_TO_DO['gone']}")

    def _connect(self) -> sqlite3.Connection:
        """Another connection; to no file but the one that was opened, and none is made in its place."""
        self._must_be_in_place()
        mode = "rwc" if self._place is None else "rw"
        address = f"file:{quote(os.fsencode(self.path))}?mode={mode}"
        wait_s = WAIT_SERVING_S if self._place is not None and self._lock else WAIT_S
        return sqlite3.connect(address, uri=True, timeout=wait_s, check_same_thread=False)

    def _stay(self) -> None:
        """From now on the files are watched, and held open by one connection whatever becomes of the others."""
        self._anchor = self._connect()
        self._anchor.execute("SELECT count(*) FROM sqlite_master").fetchone()  # which makes the files beside it
        self._place = self._found()
        self.engine.dispose()  # those of before wait longer

    # ---- versions

    def prepare(self, *, is_reader: bool, is_new: bool) -> None:
        """Make the tables of a new file, or check that the file is one of ours and whole, and bring an older one up.

        A reader takes no write lock, unless the file is an older one: the lab may be running.
        """
        revision: str | None = None
        with self.read() as connection:
            existing = set(sql.inspect(connection).get_table_names())
            is_marked = VERSION.name in existing
            if existing:
                revision = migration.revision_of(connection, existing, self.path)
                verdict = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar()
                if verdict != "ok":
                    first = str(verdict).partition("\n")[0]
                    raise StoreError(f"{self.path}: damaged: {first}")
            elif is_reader or not is_new:
                raise StoreError(
                    f"{self.path}: no lab data here, the database is empty; a copy made while a lab ran is whole only "
                    "with the file beside it that ends in -wal"
                )
        if revision is not None and revision != migration.HEAD:
            self._bring_up()
            is_marked = True
        if is_reader:
            return
        forget_sums(self.path)
        text = fingerprint_text(machine_fingerprint())
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        machine = {"hash": hashlib.sha256(text.encode()).hexdigest(), "fingerprint": text, "first_utc": now}
        with self.write() as connection:
            if not is_marked:
                METADATA.create_all(connection, tables=[VERSION] if existing else None)
                migration.mark(connection)
            connection.execute(insert_or_update(MACHINES).values(machine).on_conflict_do_nothing())
        self._stay()

    def _bring_up(self) -> None:
        """Make an older file one of this version, after copying it aside; nobody else has it open meanwhile."""
        lock = None if self._lock else _lock(self.path.parent)
        try:
            with self.read() as connection:  # again, now that nobody else can be at it
                existing = set(sql.inspect(connection).get_table_names())
                revision = migration.revision_of(connection, existing, self.path)
            if revision != migration.HEAD:
                migration.copy_aside(self.path, revision)
                forget_sums(self.path)
                with self._rebuilding() as connection:
                    METADATA.create_all(connection, tables=[VERSION])
                    migration.bring_up(connection, self.path, revision)
        finally:
            if lock:
                lock.close()

    @contextmanager
    def _rebuilding(self) -> Iterator[sql.Connection]:
        """A transaction in which whole tables may be replaced: references are checked at its end, not on the way."""
        with self._told(), self.engine.connect() as connection:
            driver: Any = connection.connection.driver_connection
            driver.execute("PRAGMA foreign_keys=OFF")  # which SQLite does outside of transactions only
            try:
                with connection.execution_options(begin="BEGIN IMMEDIATE").begin():
                    yield connection
                    broken = connection.exec_driver_sql("PRAGMA foreign_key_check").first()
                    if broken is not None:
                        raise StoreError(f"{self.path}: a row of {broken[0]} would refer to a {broken[2]} that is gone")
            finally:
                driver.execute("PRAGMA foreign_keys=ON")

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Whatever the database says becomes one line with the file's name."""
        try:
            yield
        except (sql.exc.DBAPIError, sqlite3.Error) as error:
            said = error.orig if isinstance(error, sql.exc.DBAPIError) else error
            kind = kind_of(str(said))
            if kind is None:
                raise StoreError(f"{self.path}: {said}") from error
            self._must_be_in_place()  # or that is why
            raise StoreTroubled(kind, f"{self.path}: {said}") from error
        except OverflowError as error:
            raise StoreError(f"{self.path}: a whole number beyond 64 bits cannot be stored") from error


def _set_up_connection(connection: Any, _: object) -> None:
    connection.isolation_level = None  # SQLAlchemy's `begin` decides how a transaction starts, not the driver
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "secure_delete=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _begin(connection: sql.Connection) -> None:
    connection.exec_driver_sql(connection.get_execution_options().get("begin", "BEGIN"))
