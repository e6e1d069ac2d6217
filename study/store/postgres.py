"""A database that a server keeps: PostgreSQL, through psycopg (the extra `postgres`).

One lab at a time: the one connection that writes holds an advisory lock of its session for as long as it lives, so that
whoever can write has it. Everything written takes a second one for its transaction, so that there is one writer at a
time, whichever process it is in, as with SQLite. Readers see one moment (REPEATABLE READ, read only) and hold nobody
up. What is acknowledged is on the server's disk: `synchronous_commit` is on, and `fsync` must be.

Values are kept as SQLite keeps them, so that an export is the same: NaN is nothing, a minus before zero goes, texts are
compared byte by byte. NUL, which PostgreSQL takes in no text, becomes U+FFFD.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sql

from study.disk.locks import Lock
from study.extras import how_to_install
from study.store.condition import StoreTroubled, TroubleKind
from study.store.place import DataPlace
from study.store.postgres_values import adapt
from study.store.sqlite_file import WAIT_S, WAIT_SERVING_S, hold_folder, make_folder
from study.store.statements import driver_of
from study.store.tables import META, METADATA
from study.store.values import StoreError

OLDEST = 130000
"""The oldest server, as it numbers itself."""
_UNLESS_SAID: Mapping[str, Any] = {
    "application_name": "shared-autonomy-lab",
    "connect_timeout": 5,
    # A server whose machine or network is gone is noticed within a quarter of a minute.
    "keepalives_idle": 5,
    "keepalives_interval": 5,
    "keepalives_count": 2,
    "tcp_user_timeout": 15_000,
}
"""Parameters of a connection that an address may set otherwise; times in seconds, and one in milliseconds."""
SERVING = (0x5A1AB, 1)
"""The advisory lock of the lab that serves."""
WRITING = (0x5A1AB, 2)
"""That of whatever writes."""
READERS = 8
"""So many connections for reading, and as many more when they are needed."""
MOST_OF_AN_ERROR = 300
_SAID: Mapping[str, TroubleKind] = {
    "08": "unreachable",
    "57P": "unreachable",
    "53300": "unreachable",
    "53100": "full",
    "53": "unreachable",
    "55P03": "locked",
    "40": "locked",
    "25006": "read_only",
    "58": "io",
    "XX001": "corrupt",
    "XX002": "corrupt",
}
"""What an error's number begins with, and which trouble that is; the longest counts."""


def open_server(place: DataPlace, *, exclusive: bool) -> PostgresServer:
    """The database at an address. Raises `StoreError` in one line, without the password."""
    assert place.url is not None
    try:
        url = sql.make_url(place.url)
    except (sql.exc.ArgumentError, ValueError):
        raise StoreError(f"{place}: cannot be read as the address of a database") from None
    lock = None
    if exclusive and not place.shares_folder:
        try:
            make_folder(place.folder)
        except OSError as error:
            raise StoreError(f"{place.folder}: cannot be used as folder: {error.strerror or error}") from None
        lock = hold_folder(place.folder)
    try:
        return PostgresServer(str(place), place.folder.absolute(), url, lock, is_serving=exclusive)
    except BaseException:
        if lock:
            lock.close()
        raise


def _driver() -> Any:
    try:
        import psycopg
    except ModuleNotFoundError:
        raise
    except ImportError as error:
        why = str(error).partition("\n")[0]
        raise StoreError(f"psycopg cannot be loaded: {why}; {how_to_install('postgres')}") from None
    return psycopg


class PostgresServer:
    """The open database. Made by `open_server`; usable from several threads. Attributes: as `Backend`."""

    why_empty = ""
    is_new = True
    in_place = True

    def __init__(self, name: str, folder: Path, url: sql.URL, lock: Lock | None, is_serving: bool) -> None:
        self.name = name
        self.folder = folder
        self._psycopg = _driver()
        self.errors: tuple[type[Exception], ...] = (self._psycopg.Error,)
        self._lock = lock
        self._is_serving = is_serving
        self._wait_s = WAIT_SERVING_S if is_serving else WAIT_S
        self._is_closed = False
        self._parameters = {**url.translate_connect_args(username="user", database="dbname"), **url.query}
        self.reading = self._engine(self._connect_reader, size=READERS, isolation_level="REPEATABLE READ")
        self.writing = self._engine(self._connect_writer, size=1)
        sql.event.listen(self.writing, "begin", _one_writer)

    def _engine(self, creator: Any, size: int, **options: Any) -> sql.Engine:
        more = 0 if size == 1 else READERS
        engine = sql.create_engine(
            "postgresql+psycopg://",  # the address alone says which dialect: `creator` connects
            creator=creator,
            pool_size=size,
            max_overflow=more,
            pool_timeout=WAIT_S,
            pool_reset_on_return=None,  # `_reset` does, and complains of no lost connection
            use_native_hstore=False,
            **options,
        )
        sql.event.listen(engine, "reset", self._reset)
        sql.event.listen(engine, "checkin", self._given_back)
        return engine

    def close(self) -> None:
        """Give it up; twice is once."""
        self._is_closed = True
        self._drop()
        if self._lock:
            self._lock.close()
            self._lock = None

    # ---- opening it

    def check_whole(self, connection: sql.Connection) -> None:
        """Pages are the server's to check; that it keeps what it acknowledges is asked."""
        driver = driver_of(connection)
        version = driver.info.server_version
        if version < OLDEST:
            raise StoreError(
                f"{self.name}: PostgreSQL {version // 10000} is too old, the lab needs {OLDEST // 10000} or later"
            )
        for setting, wanted in (("fsync", "on"), ("synchronous_commit", "on"), ("server_encoding", "UTF8")):
            found = connection.exec_driver_sql(f"SHOW {setting}").scalar_one()
            if found != wanted:
                raise StoreError(f"{self.name}: {setting} is {found}, and the lab needs {wanted}")

    def before_writing(self) -> None:
        """Nothing is noted of its pages."""

    def stay(self) -> None:
        """It was locked when the first thing was written."""

    @contextmanager
    def alone(self) -> Iterator[None]:
        """With the lab's lock, as long as it takes, unless this is the lab: its connection for writing has it."""
        if self._is_serving:
            yield
            return
        connection = self._connect()
        try:
            self._must_be_alone(connection)
            yield
        finally:
            connection.close()

    def copy_aside(self, revision: str) -> None:
        """All of it is done in one transaction or nothing; the way back is the server's own backup."""

    def copies(self) -> Mapping[str, Path]:
        """None."""
        return {}

    @contextmanager
    def rebuilding(self) -> Iterator[sql.Connection]:
        """PostgreSQL changes tables in place."""
        with self.writing.begin() as connection:
            yield connection

    # ---- its condition

    def must_be_in_place(self) -> None:
        """Where it is, the server knows."""

    def trouble(self, error: BaseException) -> TroubleKind | None:
        """By its number; whoever was lost has none. Connections of before are of no more use then."""
        kind: TroubleKind | None
        number = getattr(error, "sqlstate", None)
        if isinstance(error, sql.exc.TimeoutError):
            return "locked"
        if number is None:
            is_lost = isinstance(error, (self._psycopg.OperationalError, self._psycopg.InterfaceError))
            kind = "unreachable" if is_lost else None
        else:
            kind = next((_SAID[number[:length]] for length in (5, 3, 2) if number[:length] in _SAID), None)
        if kind == "unreachable":
            self._drop()
        return kind

    def said(self, error: BaseException) -> str:
        """The first line of what the server says; its second may hold values of rows."""
        told = getattr(getattr(error, "diag", None), "message_primary", None) or str(error)
        return " ".join(str(told).split())[:MOST_OF_AN_ERROR]

    def is_in_transaction(self, connection: sql.Connection) -> bool:
        """As the driver knows; an error leaves one in which nothing more can be done."""
        state = self._psycopg.pq.TransactionStatus
        return driver_of(connection).info.transaction_status in (state.INTRANS, state.INERROR)

    def touch(self, connection: sql.Connection) -> None:
        """A row as it is."""
        connection.execute(META.update().where(META.c.name == "schema_version").values(value=META.c.value))

    def read_back(self) -> None:
        """The server reads it, from its memory or its disk."""
        with self.reading.connect() as connection:
            for table in METADATA.sorted_tables:
                connection.execute(sql.select(table).limit(1)).fetchall()

    # ---- what is written and what was deleted

    def move_log(self) -> None:
        """The server does."""

    def empty_log(self) -> None:
        """Its log, its pages and its backups are the server's."""

    def copy_out(self, path: Path) -> None:
        """A server that is away cannot be read."""
        raise OSError("the database is on a server")

    # ---- connections

    def _reset(self, connection: Any, _: object, state: Any) -> None:
        """Nothing of what was begun is left; one that is lost is of no more use to anybody."""
        if not state.terminate_only and not connection.closed:
            try:
                connection.rollback()
            except self.errors:
                connection.close()

    def _given_back(self, connection: Any, _: object) -> None:
        """By whoever read on while it was closed."""
        if self._is_closed and connection is not None:
            connection.close()

    def _drop(self) -> None:
        self.reading.dispose()
        self.writing.dispose()

    def _connect(self) -> Any:
        given = {**_UNLESS_SAID, **self._parameters}
        connection = self._psycopg.connect(**given, client_encoding="utf8", autocommit=True)
        try:
            connection.execute(
                f"SET synchronous_commit = on; SET lock_timeout = {round(self._wait_s * 1000)}; SET TimeZone = 'UTC'; "
                # A lab whose machine is gone is not to hold its lock for hours.
                "SET tcp_keepalives_idle = 5; SET tcp_keepalives_interval = 5; SET tcp_keepalives_count = 2; "
                "SET idle_in_transaction_session_timeout = 0"
            )
            adapt(connection)
        except BaseException:
            connection.close()
            raise
        return connection

    def _must_be_alone(self, connection: Any) -> None:
        """Take the lab's lock, for as long as the connection lives. Raises `StoreTroubled` when another one has it."""
        if not connection.execute(f"SELECT pg_try_advisory_lock{SERVING}").fetchone()[0]:
            raise StoreTroubled("locked", f"{self.name}: another lab is running on this database")

    def _connect_reader(self) -> Any:
        connection = self._connect()
        connection.autocommit = False
        connection.read_only = True
        return connection

    def _connect_writer(self) -> Any:
        connection = self._connect()
        try:
            if self._is_serving:
                self._must_be_alone(connection)
        except BaseException:
            connection.close()
            raise
        connection.autocommit = False
        return connection


def _one_writer(connection: sql.Connection) -> None:
    """One writer at a time: until the transaction ends."""
    driver_of(connection).execute(f"SELECT pg_advisory_xact_lock{WRITING}")
