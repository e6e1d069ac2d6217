"""The only file that opens a database: SQLite in the lab's data folder, through SQLAlchemy.

Every public method that writes is one transaction and is on disk when it returns (WAL with `synchronous=FULL`). The
recorded tables are made from `records.TABLES`; beside them stand the lab's own, which no export holds: sessions,
tokens (hashed), identities, study texts, message ids already answered, starts of cycles, erasure marks.

A `Store` may be used from several threads. SQLite has one writer at a time, others wait up to ten seconds.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import IO, Any, Literal, cast

import sqlalchemy as sql
from sqlalchemy.dialects.sqlite import insert as insert_or_update

from study.design import Study, next_order, plan_session
from study.fingerprint import machine_fingerprint
from study.protocol import Session, from_json, new_session, to_json
from study.records import (
    KEYS,
    SCHEMA_VERSION,
    TABLES,
    AlertRow,
    EventRow,
    ParticipantRow,
    StudyError,
    SurveyAnswerRow,
    TaskRow,
    TickRow,
    TrialRow,
    columns,
)

STORE_VERSION = 2
"""Version of the lab's own tables; the recorded ones follow `records.SCHEMA_VERSION`."""
FILE_NAME = "lab.sqlite"
LOCK_NAME = "lab.lock"
Kind = Literal["study", "pilot", "demo"]
"""What somebody is enrolled for. Only `study` holds a cell and is in the default export."""
ID_LETTER: Mapping[Kind, str] = {"study": "P", "pilot": "T", "demo": "D"}
"""What ids begin with: P for participants, T for trial runs, D for demos."""
Kind = Literal["study", "pilot", "demo"]
"""What somebody is enrolled for. Only `study` holds a cell and is in the default export."""
ID_LETTER: Mapping[Kind, str] = {"study": "P", "pilot": "T", "demo": "D"}
"""What ids begin with: P for participants, T for trial runs, D for demos."""
ORDER_SEPARATOR = ">"


class StoreError(StudyError):
    """The database cannot be opened or refuses a write; one line that says which file and why."""


@dataclass(frozen=True)
class StoredSession:
    """A participant as the lab knows them."""

    participant: str
    public_id: str
    session: Session
    order: tuple[str, ...]
    kind: Kind
    pace: str
    study_hash: str
    seed: int
    created_utc: str
    rejected: bool

    @property
    def demo(self) -> bool:
        """Whether this is a visitor who tries the study, not somebody of whom data are wanted."""
        return self.kind == "demo"


@dataclass(frozen=True)
class Cycle:
    """The start of a pick-and-place cycle: what a new worker needs before it re-runs the cycle's ticks."""

    participant: str
    trial: int
    practice: bool
    cycle: int
    start: str
    """JSON, made and read by the worker."""


_METADATA = sql.MetaData()
_SQL_TYPES: Mapping[str, Any] = {"str": sql.Text, "int": sql.Integer, "float": sql.Float}


def _text(value: object) -> str:
    """Text as SQLite and a CSV reader take it: no NUL, no half of a surrogate pair."""
    return str(value).replace("\0", "").encode("utf-8", "replace").decode("utf-8")


_CASTS_OF: Mapping[str, Callable[[Any], Any]] = {"str": _text, "int": int, "float": float}


def _participant_column(**options: Any) -> sql.Column[str]:
    target = sql.ForeignKey("sessions.participant")
    return sql.Column("participant", sql.Text, target, nullable=False, **options)


_META = sql.Table(
    "meta", _METADATA, sql.Column("name", sql.Text, primary_key=True), sql.Column("value", sql.Text, nullable=False)
)
_MACHINES = sql.Table(
    "machines",
    _METADATA,
    sql.Column("hash", sql.Text, primary_key=True),
    sql.Column("fingerprint", sql.Text, nullable=False),
    sql.Column("first_utc", sql.Text, nullable=False),
)
_STUDIES = sql.Table(
    "studies", _METADATA, sql.Column("hash", sql.Text, primary_key=True), sql.Column("text", sql.Text, nullable=False)
)
_SESSIONS = sql.Table(
    "sessions",
    _METADATA,
    sql.Column("number", sql.Integer, primary_key=True),
    sql.Column("participant", sql.Text, nullable=False, unique=True),
    sql.Column("public_id", sql.Text, nullable=False, unique=True),
    sql.Column("session", sql.Text, nullable=False),
    sql.Column("state", sql.Text, nullable=False),
    sql.Column("condition_order", sql.Text, nullable=False),
    sql.Column("kind", sql.Text, nullable=False),
    sql.Column("pace", sql.Text, nullable=False),
    sql.Column("study_hash", sql.Text, sql.ForeignKey("studies.hash"), nullable=False),
    sql.Column("seed", sql.Integer, nullable=False),
    sql.Column("created_utc", sql.Text, nullable=False),
    sql.Column("rejected", sql.Integer, nullable=False, default=0),
    sqlite_autoincrement=True,  # the number of an erased participant is never given out again
)
_TOKENS = sql.Table(
    "tokens",
    _METADATA,
    sql.Column("sha256", sql.Text, primary_key=True),
    _participant_column(index=True),
    sql.Column("role", sql.Text, nullable=False),
    sql.Column("created_utc", sql.Text, nullable=False),
)
_IDENTITIES = sql.Table(
    "identities",
    _METADATA,
    sql.Column("id", sql.Integer, primary_key=True),
    _participant_column(index=True),
    sql.Column("kind", sql.Text, nullable=False),
    sql.Column("value", sql.Text, nullable=False),
)
_SUBMISSIONS = sql.Table(
    "submissions",
    _METADATA,
    _participant_column(primary_key=True),
    sql.Column("message_id", sql.Text, primary_key=True),
    sql.Column("response", sql.Text, nullable=False),
)
_CYCLES = sql.Table(
    "cycles",
    _METADATA,
    _participant_column(primary_key=True),
    sql.Column("trial", sql.Integer, primary_key=True),
    sql.Column("practice", sql.Integer, primary_key=True),
    sql.Column("cycle", sql.Integer, primary_key=True),
    sql.Column("start", sql.Text, nullable=False),
)
_ERASURES = sql.Table(
    "erasures",
    _METADATA,
    sql.Column("participant", sql.Text, primary_key=True),
    sql.Column("utc", sql.Text, nullable=False),
)


def _record_table(name: str) -> sql.Table:
    keys = KEYS.get(name, ())
    made: list[sql.Column[Any]] = [] if keys else [sql.Column("row_id", sql.Integer, primary_key=True)]
    for info in columns(name):
        if info.name == "participant":
            made.append(_participant_column(primary_key="participant" in keys, index=not keys))
        else:
            kind = _SQL_TYPES[info.type]
            made.append(sql.Column(info.name, kind, primary_key=info.name in keys, nullable=info.optional))
    return sql.Table(name, _METADATA, *made)


_RECORDS: Mapping[str, sql.Table] = {name: _record_table(name) for name in TABLES}
_CASTS: Mapping[str, tuple[tuple[str, Callable[[Any], Any]], ...]] = {
    name: tuple((info.name, _CASTS_OF[info.type]) for info in columns(name)) for name in TABLES
}
_FREE_STATES = ("withdrawn", "aborted")
"""States whose participants give their counterbalancing cell back."""


def open_store(data_dir: Path | str, *, exclusive: bool = False, must_exist: bool = False) -> Store:
    """Open the database of a data folder, made when it is not there.

    `exclusive` is for the lab that serves: a second one on the same folder is refused. `must_exist` is for the
    export. Raises `StoreError` with one line for a folder or file that cannot be used, a foreign or damaged file,
    or another schema version.
    """
    folder = Path(data_dir)
    path = folder / FILE_NAME
    if must_exist and not path.is_file():
        raise StoreError(f"{folder}: no lab data here ({FILE_NAME} is missing)")
    lock: IO[str] | None = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if exclusive:
            lock = (folder / LOCK_NAME).open("w")
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        if lock:
            lock.close()
        raise StoreError(f"{folder}: another lab is running on this data folder") from None
    except OSError as error:
        raise StoreError(f"{folder}: cannot be used as data folder: {error.strerror or error}") from None
    store = Store(path, lock)
    try:
        store._prepare(is_reader=must_exist)
    except BaseException:
        store.close()
        raise
    return store


class Store:
    """An open database. Made by `open_store`; close it, or use it in `with`."""

    def __init__(self, path: Path, lock: IO[str] | None = None) -> None:
        self.path = path
        self._lock = lock
        self._engine = sql.create_engine(f"sqlite:///{path}", connect_args={"timeout": 10.0})
        sql.event.listen(self._engine, "connect", _set_up_connection)
        sql.event.listen(self._engine, "begin", _begin)
        self._writing = self._engine.execution_options(begin="BEGIN IMMEDIATE")

    def close(self) -> None:
        """Give up the file; twice is once."""
        self._engine.dispose()
        if self._lock:
            self._lock.close()
            self._lock = None

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ---- participants and sessions

    def create_participant(
        self,
        study: Study,
        *,
        seed: int,
        public_id: str,
        utc: str,
        tokens: Mapping[str, str] | None = None,
        kind: Kind = "study",
        pace: str = "real_time",
        order: Sequence[str] | None = None,
        identities: Mapping[str, str] | None = None,
    ) -> StoredSession:
        """Enrol someone under the least-filled order (or the one given). Pilot and demo take no cell.

        `tokens` maps a role to the SHA-256 of its token in hex. Raises `StudyError` for an order or seed the study
        cannot plan, `StoreError` for a public id or token that is taken.
        """
        if order is not None:
            plan_session(study, tuple(order), seed)
        with self._write() as connection:
            connection.execute(
                insert_or_update(_STUDIES).values(hash=study.hash, text=study.source_text).on_conflict_do_nothing()
            )
            chosen = tuple(order) if order else next_order(study, self._taken(connection))
            values: dict[str, Any] = {
                "participant": public_id,  # replaced below: the name is made of the number
                "public_id": public_id,
                "session": "",
                "state": "consent",
                "condition_order": ORDER_SEPARATOR.join(chosen),
                "kind": kind,
                "pace": pace,
                "study_hash": study.hash,
                "seed": seed,
                "created_utc": utc,
                "rejected": 0,
            }
            number = cast(int, connection.execute(_SESSIONS.insert().values(values)).inserted_primary_key[0])
            participant = f"{ID_LETTER[kind]}{number:03d}"
            session = new_session(participant, len(chosen), study.skips)
            connection.execute(
                _SESSIONS.update()
                .where(_SESSIONS.c.number == number)
                .values(participant=participant, session=to_json(session))
            )
            row = ParticipantRow(
                participant=participant,
                seed=seed,
                condition_order=values["condition_order"],
                state="consent",
                study_hash=study.hash,
                created_utc=utc,
                consent_utc=None,
                consent_hash=None,
                finished_utc=None,
                schema_version=SCHEMA_VERSION,
                kind=kind,
            )
            connection.execute(_RECORDS["participants"].insert(), [_values("participants", row)])
            for role, sha256 in (tokens or {}).items():
                _insert(connection, _TOKENS, sha256=sha256, participant=participant, role=role, created_utc=utc)
            for name, value in (identities or {}).items():
                _insert(connection, _IDENTITIES, participant=participant, kind=_text(name), value=_text(value))
        return self.session(participant)

    def session(self, participant: str) -> StoredSession:
        """One participant; `StoreError` when there is none of that id."""
        found = self._sessions(_SESSIONS.c.participant == participant)
        if not found:
            raise StoreError(f"no participant {participant!r}")
        return found[0]

    def session_of_public_id(self, public_id: str) -> StoredSession | None:
        """The participant whose pages live under this id."""
        return next(iter(self._sessions(_SESSIONS.c.public_id == public_id)), None)

    def sessions(self) -> tuple[StoredSession, ...]:
        """Everyone, demo included, in order of enrolment."""
        return self._sessions()

    def participant_for_token(self, sha256: str) -> tuple[str, str] | None:
        """(participant, role) of a token's SHA-256, or None."""
        query = sql.select(_TOKENS.c.participant, _TOKENS.c.role).where(_TOKENS.c.sha256 == sha256)
        with self._read() as connection:
            row = connection.execute(query).first()
        return (row.participant, row.role) if row else None

    def add_token(self, participant: str, role: str, sha256: str, utc: str) -> None:
        """Another link for a participant."""
        with self._write() as connection:
            _insert(connection, _TOKENS, sha256=sha256, participant=participant, role=role, created_utc=utc)

    def add_identity(self, participant: str, kind: str, value: str) -> None:
        """Something that identifies a person (recruitment id, note, user agent); never exported."""
        with self._write() as connection:
            _insert(connection, _IDENTITIES, participant=participant, kind=_text(kind), value=_text(value))

    def identities(self, participant: str) -> tuple[tuple[str, str], ...]:
        """(kind, value) of everything identifying, in order of arrival."""
        query = sql.select(_IDENTITIES.c.kind, _IDENTITIES.c.value).where(_IDENTITIES.c.participant == participant)
        with self._read() as connection:
            return tuple((row.kind, row.value) for row in connection.execute(query.order_by(_IDENTITIES.c.id)))

    def labels(self) -> dict[str, str]:
        """Participant to the label the experimenter gave them, for those who have one."""
        query = sql.select(_IDENTITIES.c.participant, _IDENTITIES.c.value).where(_IDENTITIES.c.kind == "label")
        with self._read() as connection:
            return {row.participant: row.value for row in connection.execute(query)}

    def reject(self, participant: str, event: EventRow) -> bool:
        """Give a participant's counterbalancing cell out again; the data stay, with this event beside them.

        False, and nothing written, when somebody else did it first or there is no such participant.
        """
        with self._write() as connection:
            here = (_SESSIONS.c.participant == participant, _SESSIONS.c.rejected == 0)
            if connection.execute(_SESSIONS.update().where(*here).values(rejected=1)).rowcount != 1:
                return False
            _add(connection, "events", [event])
            return True

    def erasures(self) -> tuple[tuple[str, str], ...]:
        """As `Snapshot.erasures`."""
        with self.snapshot() as recorded:
            return recorded.erasures()

    def erase(self, participant: str, utc: str) -> bool:
        """Delete everything about a participant but the mark that there was one. Cannot be undone.

        The rows are gone when this returns. True when the space they took is overwritten too; False when another
        process was reading the database and its log could not be emptied: the next erasure, or the end of the lab,
        does it.
        """
        self.session(participant)
        with self._write() as connection:
            for table in reversed(_METADATA.sorted_tables):
                if "participant" in table.c and table is not _ERASURES:
                    connection.execute(table.delete().where(table.c.participant == participant))
            _insert(connection, _ERASURES, participant=participant, utc=utc)
        with self._engine.connect() as connection:
            # Deleted pages are overwritten (secure_delete); the log still holds them until it is truncated.
            emptied = connection.execution_options(isolation_level="AUTOCOMMIT").exec_driver_sql(
                "PRAGMA wal_checkpoint(TRUNCATE)"
            )
            return int(emptied.one()[0]) == 0

    # ---- what happens in a session

    def commit(
        self,
        *,
        session: Session | None = None,
        ticks: Iterable[TickRow] = (),
        practice_ticks: Iterable[TickRow] = (),
        trials: Iterable[TrialRow] = (),
        tasks: Iterable[TaskRow] = (),
        alerts: Iterable[AlertRow] = (),
        answers: Iterable[SurveyAnswerRow] = (),
        events: Iterable[EventRow] = (),
        cycles: Iterable[Cycle] = (),
        consent: tuple[str, str] | None = None,
        finished_utc: str | None = None,
        submission: tuple[str, str, Mapping[str, Any]] | None = None,
        identities: Iterable[tuple[str, str, str]] = (),
    ) -> bool:
        """Write all of this or nothing, on disk at return.

        Trials, tasks, alerts and cycles replace an earlier row of the same key; ticks, answers and events are only
        ever added. `consent` is (utc, hash), with `session`. `submission` is (participant, message id, response):
        when that id was answered before, nothing at all is written and the result is False. `identities` are
        (participant, kind, text): words that may identify somebody, which no export holds.
        """
        with self._write() as connection:
            if submission is not None:
                participant, message_id, response = submission
                if self._response(connection, participant, message_id) is not None:
                    return False
                _insert(
                    connection,
                    _SUBMISSIONS,
                    participant=participant,
                    message_id=message_id,
                    response=json.dumps(response),
                )
            for person, kind, value in identities:
                _insert(connection, _IDENTITIES, participant=person, kind=kind, value=value)
            if session is not None:
                self._save_session(connection, session, consent, finished_utc)
            _add(connection, "ticks", ticks)
            _add(connection, "practice_ticks", practice_ticks)
            _put(connection, "trials", trials)
            _put(connection, "tasks", tasks)
            _put(connection, "alerts", alerts)
            _add(connection, "survey_answers", answers)
            _add(connection, "events", events)
            for cycle in cycles:
                values = {**vars(cycle), "practice": int(cycle.practice)}
                replaced = insert_or_update(_CYCLES).values(values)
                connection.execute(replaced.on_conflict_do_update(set_={"start": cycle.start}))
        return True

    def append_tick(
        self,
        row: TickRow,
        *,
        practice: bool = False,
        trials: Iterable[TrialRow] = (),
        tasks: Iterable[TaskRow] = (),
        alerts: Iterable[AlertRow] = (),
        events: Iterable[EventRow] = (),
        cycles: Iterable[Cycle] = (),
    ) -> None:
        """One tick and everything that happened in it."""
        ticks, practised = ((), (row,)) if practice else ((row,), ())
        self.commit(
            ticks=ticks,
            practice_ticks=practised,
            trials=trials,
            tasks=tasks,
            alerts=alerts,
            events=events,
            cycles=cycles,
        )

    def response(self, participant: str, message_id: str) -> dict[str, Any] | None:
        """What a message was answered with, or None when it is new."""
        with self._read() as connection:
            return self._response(connection, participant, message_id)

    def last_cycle(self, participant: str, trial: int, *, practice: bool = False) -> Cycle | None:
        """The cycle that was running last in a trial (or its practice)."""
        query = (
            sql.select(_CYCLES)
            .where(
                _CYCLES.c.participant == participant,
                _CYCLES.c.trial == trial,
                _CYCLES.c.practice == int(practice),
            )
            .order_by(_CYCLES.c.cycle.desc())
        )
        with self._read() as connection:
            row = connection.execute(query).first()
        return Cycle(row.participant, row.trial, bool(row.practice), row.cycle, row.start) if row else None

    def ticks_of_cycle(
        self, participant: str, trial: int, cycle: int, *, practice: bool = False
    ) -> tuple[TickRow, ...]:
        """The ticks of one cycle in order, for re-running them."""
        table = "practice_ticks" if practice else "ticks"
        return cast("tuple[TickRow, ...]", self.rows_of(table, participant, trial=trial, cycle=cycle))

    def last_input_seq(self, participant: str) -> int:
        """The highest input sequence number that a committed tick took into account; 0 = none."""
        highest = 0
        with self._read() as connection:
            for name in ("ticks", "practice_ticks"):
                table = _RECORDS[name]
                query = sql.select(sql.func.max(table.c.input_seq)).where(table.c.participant == participant)
                highest = max(highest, connection.execute(query).scalar() or 0)
        return highest

    # ---- reading

    @contextmanager
    def snapshot(self) -> Iterator[Snapshot]:
        """Everything recorded as it is at this moment, whatever is written meanwhile."""
        with self._read() as connection:
            yield Snapshot(connection)

    def rows(self, table: str, include_demo: bool = False, include_pilot: bool = False) -> Iterator[Any]:
        """As `Snapshot.rows`."""
        with self.snapshot() as recorded:
            yield from recorded.rows(table, include_demo, include_pilot)

    def rows_of(self, table: str, participant: str, **equal: object) -> tuple[Any, ...]:
        """One participant's rows of a recorded table, where the named columns have these values."""
        query = _ordered(table).where(_RECORDS[table].c.participant == participant)
        for name, value in equal.items():
            query = query.where(_RECORDS[table].c[name] == value)
        with self._read() as connection:
            return tuple(TABLES[table](**row) for row in connection.execute(query).mappings())

    # ---- inside

    def _prepare(self, *, is_reader: bool) -> None:
        """Make the tables of a new file, or check that the file is one of ours and whole.

        A reader takes no write lock: the lab may be running.
        """
        versions = {"schema_version": str(SCHEMA_VERSION), "store_version": str(STORE_VERSION)}
        with self._read() as connection:
            existing = set(sql.inspect(connection).get_table_names())
            if existing:
                self._check(connection, existing, versions)
            elif is_reader:
                raise StoreError(f"{self.path}: no lab data here, the database is empty")
        if is_reader:
            return
        text = json.dumps(machine_fingerprint(), sort_keys=True)
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        machine = {"hash": hashlib.sha256(text.encode()).hexdigest(), "fingerprint": text, "first_utc": now}
        with self._write() as connection:
            if not existing:
                _METADATA.create_all(connection)
                connection.execute(_META.insert(), [{"name": n, "value": v} for n, v in versions.items()])
            connection.execute(insert_or_update(_MACHINES).values(machine).on_conflict_do_nothing())

    def _check(self, connection: sql.Connection, existing: set[str], versions: Mapping[str, str]) -> None:
        if "meta" not in existing:
            raise StoreError(f"{self.path}: a database, but not one of this lab")
        found = {row.name: row.value for row in connection.execute(sql.select(_META))}
        for name, expected in versions.items():
            if found.get(name) != expected:
                raise StoreError(
                    f"{self.path}: {name} is {found.get(name)}, this version of the lab needs {expected}; "
                    "open it with the version that wrote it, or use another data folder"
                )
        verdict = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar()
        if verdict != "ok":
            raise StoreError(f"{self.path}: damaged: {str(verdict).splitlines()[0]}")

    @contextmanager
    def _write(self) -> Iterator[sql.Connection]:
        with self._told(), self._writing.begin() as connection:
            yield connection

    @contextmanager
    def _read(self) -> Iterator[sql.Connection]:
        with self._told(), self._engine.connect() as connection:
            yield connection

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Whatever the database says becomes one line with the file's name."""
        try:
            yield
        except sql.exc.DBAPIError as error:
            raise StoreError(f"{self.path}: {error.orig}") from error
        except OverflowError as error:
            raise StoreError(f"{self.path}: a whole number beyond 64 bits cannot be stored") from error

    def _taken(self, connection: sql.Connection) -> dict[tuple[str, ...], int]:
        query = (
            sql.select(_SESSIONS.c.condition_order, sql.func.count())
            .where(_SESSIONS.c.kind == "study", _SESSIONS.c.rejected == 0, _SESSIONS.c.state.not_in(_FREE_STATES))
            .group_by(_SESSIONS.c.condition_order)
        )
        return {tuple(order.split(ORDER_SEPARATOR)): count for order, count in connection.execute(query)}

    def _sessions(self, *conditions: sql.ColumnElement[bool]) -> tuple[StoredSession, ...]:
        query = sql.select(_SESSIONS).where(*conditions).order_by(_SESSIONS.c.number)
        with self._read() as connection:
            return tuple(
                StoredSession(
                    participant=row.participant,
                    public_id=row.public_id,
                    session=from_json(row.session),
                    order=tuple(row.condition_order.split(ORDER_SEPARATOR)),
                    kind=row.kind,
                    pace=row.pace,
                    study_hash=row.study_hash,
                    seed=row.seed,
                    created_utc=row.created_utc,
                    rejected=bool(row.rejected),
                )
                for row in connection.execute(query)
            )

    def _save_session(
        self, connection: sql.Connection, session: Session, consent: tuple[str, str] | None, finished_utc: str | None
    ) -> None:
        saved = connection.execute(
            _SESSIONS.update()
            .where(_SESSIONS.c.participant == session.participant)
            .values(session=to_json(session), state=session.state)
        )
        if saved.rowcount != 1:
            raise StoreError(f"no participant {session.participant!r}")
        values: dict[str, Any] = {"state": session.state}
        if consent is not None:
            values["consent_utc"], values["consent_hash"] = consent
        if finished_utc is not None:
            values["finished_utc"] = finished_utc
        table = _RECORDS["participants"]
        connection.execute(table.update().where(table.c.participant == session.participant).values(values))

    def _response(self, connection: sql.Connection, participant: str, message_id: str) -> dict[str, Any] | None:
        query = sql.select(_SUBMISSIONS.c.response).where(
            _SUBMISSIONS.c.participant == participant, _SUBMISSIONS.c.message_id == message_id
        )
        text = connection.execute(query).scalar()
        return None if text is None else cast("dict[str, Any]", json.loads(text))


class Snapshot:
    """A view of one moment, made by `Store.snapshot`; usable as long as that `with` lasts."""

    def __init__(self, connection: sql.Connection) -> None:
        self._connection = connection

    def rows(self, table: str, include_demo: bool = False, include_pilot: bool = False) -> Iterator[Any]:
        """The rows of a recorded table as their type, participant by participant in order of enrolment."""
        query = _ordered(table).where(_SESSIONS.c.kind.in_(_kinds(include_demo, include_pilot)))
        row_type = TABLES[table]
        for row in self._connection.execution_options(yield_per=1000).execute(query).mappings():
            yield row_type(**row)

    def study_texts(self, include_demo: bool = False, include_pilot: bool = False) -> dict[str, str]:
        """Hash to text of every study file that participants ran under, in order of first use."""
        first = sql.func.min(_SESSIONS.c.number)
        query = sql.select(_STUDIES.c.hash, _STUDIES.c.text).join(_SESSIONS).group_by(_STUDIES.c.hash).order_by(first)
        query = query.where(_SESSIONS.c.kind.in_(_kinds(include_demo, include_pilot)))
        return {row.hash: row.text for row in self._connection.execute(query)}

    def machines(self) -> tuple[dict[str, str], ...]:
        """Fingerprints of every machine that ran this lab, the first one first."""
        query = sql.select(_MACHINES.c.fingerprint).order_by(_MACHINES.c.first_utc, _MACHINES.c.hash)
        return tuple(json.loads(row.fingerprint) for row in self._connection.execute(query))

    def erasures(self) -> tuple[tuple[str, str], ...]:
        """(participant, utc) of everyone erased."""
        query = sql.select(_ERASURES.c.participant, _ERASURES.c.utc).order_by(_ERASURES.c.utc)
        return tuple((row.participant, row.utc) for row in self._connection.execute(query))


def _kinds(include_demo: bool, include_pilot: bool) -> tuple[Kind, ...]:
    return ("study", *(("pilot",) if include_pilot else ()), *(("demo",) if include_demo else ()))


def _kinds(include_demo: bool, include_pilot: bool) -> tuple[Kind, ...]:
    return ("study", *(("pilot",) if include_pilot else ()), *(("demo",) if include_demo else ()))


def _ordered(table: str) -> sql.Select[Any]:
    """The recorded columns, participants in order of enrolment, their rows by key or by arrival."""
    infos = columns(table)  # names the tables there are
    source = _RECORDS[table]
    keys = [source.c[name] for name in KEYS[table][1:]] if table in KEYS else [source.c.row_id]
    joined = sql.select(*[source.c[info.name] for info in infos])
    joined = joined.join(_SESSIONS, _SESSIONS.c.participant == source.c.participant)
    return joined.order_by(_SESSIONS.c.number, *keys)


def _set_up_connection(connection: Any, _: object) -> None:
    connection.isolation_level = None  # SQLAlchemy's `begin` decides how a transaction starts, not the driver
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "secure_delete=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _begin(connection: sql.Connection) -> None:
    connection.exec_driver_sql(connection.get_execution_options().get("begin", "BEGIN"))


def _insert(connection: sql.Connection, table: sql.Table, **values: object) -> None:
    connection.execute(table.insert().values(values))


def _values(table: str, row: Any) -> dict[str, Any]:
    """A row as SQLite takes it: plain Python numbers, whatever made them."""
    if not isinstance(row, TABLES[table]):
        raise StoreError(f"table {table} takes {TABLES[table].__name__}, not {type(row).__name__}")
    given = vars(row)
    return {name: None if given[name] is None else cast_to(given[name]) for name, cast_to in _CASTS[table]}


def _add(connection: sql.Connection, table: str, rows: Iterable[Any]) -> None:
    values = [_values(table, row) for row in rows]
    if values:
        connection.execute(_RECORDS[table].insert(), values)


def _put(connection: sql.Connection, table: str, rows: Iterable[Any]) -> None:
    for row in rows:
        statement = insert_or_update(_RECORDS[table]).values(_values(table, row))
        changed = {name: statement.excluded[name] for name, _ in _CASTS[table] if name not in KEYS[table]}
        connection.execute(statement.on_conflict_do_update(index_elements=list(KEYS[table]), set_=changed))
