"""A database in a file: SQLite in the data folder.

SQLite has one writer at a time, others wait up to ten seconds; readers see one moment and hold nobody up (WAL with
`synchronous=FULL`). The lab that serves waits a moment only: it tries again by itself, and says so meanwhile.

SQLite goes on writing to a file that was deleted or moved under its hands. So each transaction ends with a look whether
the database is still where it was opened, and raises when it is not.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

import sqlalchemy as sql

from study.disk.flushing import to_disk
from study.disk.locks import Lock, hold
from study.disk.private_files import FOLDER_MODE, keep_private, make_private
from study.store import migration
from study.store.condition import WHAT_TO_DO, StoreTroubled, TroubleKind, kind_of
from study.store.page_sums import forget_sums, write_sums
from study.store.statements import driver_of
from study.store.tables import METADATA
from study.store.values import StoreError

FILE_NAME = "lab.sqlite"
LOCK_NAME = "lab.lock"
WAIT_S = 10.0
"""How long a transaction waits for another program's."""
WAIT_SERVING_S = 0.25
"""The same for the lab that serves: everybody who waits is told meanwhile."""
_BESIDE = ("", "-wal", "-shm")
"""What the files of an open database end in."""


def open_file(folder: Path, *, exclusive: bool, must_exist: bool) -> SqliteFile:
    """The database of a data folder, as `open_store` says."""
    path = folder.absolute() / FILE_NAME
    try:
        if must_exist and not path.is_file():
            raise StoreError(f"{folder}: no lab data here ({FILE_NAME} is missing)")
        make_folder(folder)
        if path.exists() and not path.is_file():
            raise StoreError(f"{path}: is no regular file; a lab's database cannot be there")
    except OSError as error:
        raise StoreError(f"{folder}: cannot be used as data folder: {error.strerror or error}") from None
    lock = hold_folder(folder) if exclusive else None
    if not must_exist:
        _close_to_others(folder, path)
    return SqliteFile(path, lock)


def make_folder(folder: Path) -> None:
    """Make a data folder, its owner's alone, where there is none. Raises `OSError`."""
    if not folder.exists():
        folder.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)


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


def hold_folder(folder: Path) -> Lock:
    """The folder's lock, held until it is closed. Raises `StoreError` when a lab holds it, or it cannot be made."""
    try:
        lock = hold(folder / LOCK_NAME)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be used as data folder: {error.strerror or error}") from None
    if lock is None:
        raise StoreError(f"{folder}: another lab is running on this data folder")
    return lock


class SqliteFile:
    """The open file. Made by `open_file`; usable from several threads.

    Attributes: as `Backend`, and
        path: where it stands.
    """

    errors: tuple[type[Exception], ...] = (sqlite3.Error,)
    why_empty = "; a copy made while a lab ran is whole only with the file beside it that ends in -wal"

    def __init__(self, path: Path, lock: Lock | None = None) -> None:
        self.path = path
        self.name = str(path)
        self.folder = path.parent
        self._lock = lock
        self._was_new = not path.is_file() or path.stat().st_size == 0
        self._place: tuple[tuple[int, int] | None, ...] | None = None
        self._anchor: sqlite3.Connection | None = None
        # Put together, not written as text: the name of a folder may hold ? and %, which mean something in an address.
        address = sql.URL.create("sqlite", database=str(path))
        self.reading = sql.create_engine(address, creator=self._connect)
        sql.event.listen(self.reading, "connect", _set_up_connection)
        sql.event.listen(self.reading, "begin", _begin)
        self.writing: sql.Engine = self.reading.execution_options(begin="BEGIN IMMEDIATE")

    def close(self) -> None:
        """Give up the file; twice is once."""
        self.reading.dispose()
        if self._anchor is not None:
            self._anchor.close()
            self._anchor = None
        if self._lock:
            write_sums(self.path)
            self._lock.close()
            self._lock = None

    # ---- opening it

    @property
    def is_new(self) -> bool:
        """Whether the file was not there, or held nothing. A file of tables that are gone is a copy without its log."""
        return self._was_new

    def check_whole(self, connection: sql.Connection) -> None:
        """As SQLite finds it."""
        verdict = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar()
        if verdict != "ok":
            first = str(verdict).partition("\n")[0]
            raise StoreError(f"{self.path}: damaged: {first}")

    def before_writing(self) -> None:
        """The checksums of its pages hold no longer."""
        forget_sums(self.path)

    def stay(self) -> None:
        """From now on the files are watched, and held open by one connection whatever becomes of the others."""
        self._anchor = self._connect()
        self._anchor.execute("SELECT count(*) FROM sqlite_master").fetchone()  # which makes the files beside it
        self._place = self._found()
        self.reading.dispose()  # those of before wait longer

    @contextmanager
    def alone(self) -> Iterator[None]:
        """With the folder's lock."""
        lock = None if self._lock else hold_folder(self.folder)
        try:
            yield
        finally:
            if lock:
                lock.close()

    def copy_aside(self, revision: str) -> None:
        """Beside itself."""
        migration.copy_aside(self.path, revision)

    def copies(self) -> Mapping[str, Path]:
        """Beside itself."""
        return {copy.name: copy for copy in migration.copies_beside(self.path)}

    @contextmanager
    def rebuilding(self) -> Iterator[sql.Connection]:
        """References are checked at its end, not on the way."""
        with self.reading.connect() as connection:
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

    # ---- its condition

    @property
    def in_place(self) -> bool:
        """Whether the files are still those that were opened. A reader's are not watched."""
        return self._place is None or self._place == self._found()

    def must_be_in_place(self) -> None:
        """Or SQLite writes to what has no name."""
        if not self.in_place:
            raise StoreTroubled("gone", f"{self.path}: {WHAT_TO_DO['gone']}")

    def trouble(self, error: BaseException) -> TroubleKind | None:
        """By its words."""
        return kind_of(str(error))

    def said(self, error: BaseException) -> str:
        """SQLite says a line."""
        return str(error)

    def is_in_transaction(self, connection: sql.Connection) -> bool:
        """As its driver knows."""
        driver: Any = driver_of(connection)
        return bool(driver.in_transaction)

    def touch(self, connection: sql.Connection) -> None:
        """The number that the file may carry for its users."""
        number = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
        connection.exec_driver_sql(f"PRAGMA user_version={int(number)}")

    def read_back(self) -> None:
        """Past what SQLite keeps of it in memory: it goes on writing to a file that something else has written over,
        from what it remembers."""
        with closing(self._connect()) as connection:
            for table in METADATA.sorted_tables:
                connection.execute(f'SELECT * FROM "{table.name}" ORDER BY rowid DESC LIMIT 1').fetchall()

    # ---- what is written and what was deleted

    def move_log(self) -> None:
        """Into the file. What fails is tried again with the next one: the log has everything."""
        with suppress(sql.exc.DBAPIError, StoreError), self.reading.connect() as connection:
            connection.execution_options(isolation_level="AUTOCOMMIT").exec_driver_sql("PRAGMA wal_checkpoint(PASSIVE)")

    def empty_log(self) -> bool:
        """Into the file, and cut it off; False when another process's reading did not let it."""
        with self.reading.connect() as connection:
            direct = connection.execution_options(isolation_level="AUTOCOMMIT")
            waits_ms = direct.exec_driver_sql("PRAGMA busy_timeout").scalar_one()
            direct.exec_driver_sql(f"PRAGMA busy_timeout={round(WAIT_S * 1000)}")
            try:
                return int(direct.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)").one()[0]) == 0
            finally:
                direct.exec_driver_sql(f"PRAGMA busy_timeout={waits_ms}")

    def copy_out(self, path: Path) -> None:
        """What is open can still be read. Raises `OSError` or `sqlite3.Error` when that place does not take it."""
        assert self._anchor is not None  # `stay` opened it
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

    def _connect(self) -> sqlite3.Connection:
        """Another connection; to no file but the one that was opened, and none is made in its place."""
        self.must_be_in_place()
        mode = "rwc" if self._place is None else "rw"
        address = f"file:{quote(os.fsencode(self.path))}?mode={mode}"
        wait_s = WAIT_SERVING_S if self._place is not None and self._lock else WAIT_S
        return sqlite3.connect(address, uri=True, timeout=wait_s, check_same_thread=False)


def _set_up_connection(connection: Any, _: object) -> None:
    connection.isolation_level = None  # SQLAlchemy's `begin` decides how a transaction starts, not the driver
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "secure_delete=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _begin(connection: sql.Connection) -> None:
    connection.exec_driver_sql(connection.get_execution_options().get("begin", "BEGIN"))
