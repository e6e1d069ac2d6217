"""Who takes part: enrolment under a counterbalanced order, tokens, and what identifies a person (never exported)."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import Any

import sqlalchemy as sql

from study.definition.study import Study, next_order
from study.flow.flow import Flow, NoSuchPage
from study.flow.open_link import BEFORE_CONSENT, IDENTITY_PREFIX, ids_among
from study.flow.protocol import FREES_CELL, Session, to_json
from study.flow.roster import EnrolmentKind
from study.records import SCHEMA_VERSION, ParticipantRow, StudyError
from study.store import ledger, numbering
from study.store.rows import add, clean_text, insert, update
from study.store.statements import insert_once
from study.store.tables import IDENTITIES, RECORDS, SESSIONS, STUDIES, TOKENS
from study.store.values import StoredSession, UnreadableSession

ID_LETTER: Mapping[EnrolmentKind, str] = {"study": "P", "pilot": "T", "demo": "D"}
"""What ids begin with: P for participants, T for trial runs, D for demos."""
ORDER_SEPARATOR = ">"
MOST_OF_A_REASON = 300
"""So many characters say why something cannot be read."""


def enrol(
    connection: sql.Connection,
    study: Study,
    flow: Flow,
    *,
    seed: int,
    public_id: str,
    utc: str,
    kind: EnrolmentKind,
    pace: str,
    order: Sequence[str] | None,
) -> str:
    """Somebody new under the least-filled order, or the one given; returns their id."""
    insert_once(connection, STUDIES, hash=study.hash, text=study.source_text)
    chosen = tuple(order) if order else next_order(study, _taken(connection))
    condition_order = ORDER_SEPARATOR.join(chosen)
    inserted = connection.execute(
        SESSIONS.insert().values(
            **numbering.next_number(connection),
            participant=public_id,  # replaced below with session and state: the name is made of the number
            public_id=public_id,
            session="",
            state="",
            condition_order=condition_order,
            kind=kind,
            pace=pace,
            study_hash=study.hash,
            seed=seed,
            created_utc=utc,
            rejected=0,
        )
    )
    assert inserted.inserted_primary_key is not None
    number = inserted.inserted_primary_key[0]
    participant = f"{ID_LETTER[kind]}{number:03d}"
    session = flow.new_session(participant, len(chosen), flow.skips(study))
    connection.execute(SESSIONS.update().where(SESSIONS.c.number == number).values(participant=participant))
    update(connection, "sessions", participant, {"session": to_json(session), "state": session.state})
    row = ParticipantRow(
        participant=participant,
        seed=seed,
        condition_order=condition_order,
        state=session.state,
        study_hash=study.hash,
        created_utc=utc,
        consent_utc=None,
        consent_hash=None,
        finished_utc=None,
        schema_version=SCHEMA_VERSION,
        kind=kind,
        language=study.language,
    )
    add(connection, "participants", [row])
    return participant


def study_text(connection: sql.Connection, study_hash: str) -> str | None:
    """The study file of this SHA-256, if anybody was enrolled with it."""
    text: str | None = connection.execute(sql.select(STUDIES.c.text).where(STUDIES.c.hash == study_hash)).scalar()
    return text


def _taken(connection: sql.Connection) -> dict[tuple[str, ...], int]:
    """How many hold a cell of each order."""
    query = (
        sql.select(SESSIONS.c.condition_order, sql.func.count())
        .where(SESSIONS.c.kind == "study", SESSIONS.c.rejected == 0, SESSIONS.c.state.not_in(FREES_CELL))
        .group_by(SESSIONS.c.condition_order)
    )
    return {tuple(order.split(ORDER_SEPARATOR)): count for order, count in connection.execute(query)}


def cells_held(connection: sql.Connection) -> int:
    """How many hold a cell of any order."""
    return sum(_taken(connection).values())


def free_cell(connection: sql.Connection, participant: str) -> bool:
    """Give a participant's cell out again; False when somebody else did it first or there is no such participant."""
    query = sql.select(SESSIONS.c.rejected).where(SESSIONS.c.participant == participant)
    return connection.execute(query).scalar() == 0 and update(connection, "sessions", participant, {"rejected": 1})


def over_link(connection: sql.Connection, flow: Flow) -> list[tuple[StoredSession, str | None]]:
    """Who came over the open link and has not agreed to take part, with the time of their last event."""
    events = RECORDS["events"].c
    last = sql.select(sql.func.max(events.utc)).where(events.participant == SESSIONS.c.participant).scalar_subquery()
    has_ids = (
        sql.select(IDENTITIES.c.id)
        .where(IDENTITIES.c.participant == SESSIONS.c.participant)
        .where(IDENTITIES.c.kind.startswith(IDENTITY_PREFIX, autoescape=True))
        .exists()
    )
    here = (SESSIONS.c.kind == "study", SESSIONS.c.rejected == 0, SESSIONS.c.state.in_(BEFORE_CONSENT), has_ids)
    query = sql.select(SESSIONS, last.label("last_utc")).where(*here).order_by(SESSIONS.c.number)
    found = []
    for row in connection.execute(query):
        with contextlib.suppress(StudyError, TypeError, ValueError, AttributeError):
            found.append((_stored(row, flow), row.last_utc))
    return found


def begin_anew(connection: sql.Connection, stored: StoredSession, study: Study, flow: Flow) -> Session:
    """Put somebody whose place has lapsed at the beginning again, under the least-filled order."""
    order = next_order(study, _taken(connection))
    session = flow.new_session(stored.participant, len(order), flow.skips(study))
    told = {"condition_order": ORDER_SEPARATOR.join(order), "state": session.state}
    update(connection, "sessions", stored.participant, {**told, "session": to_json(session)})
    update(connection, "participants", stored.participant, told)
    return session


def stored_sessions(
    connection: sql.Connection, flow: Flow, *, participant: str | None = None
) -> tuple[tuple[StoredSession, ...], tuple[UnreadableSession, ...]]:
    """Everyone, or who has this id, in order of enrolment: those whose session can be read, and the others."""
    query = sql.select(SESSIONS).order_by(SESSIONS.c.number)
    if participant is not None:
        query = query.where(SESSIONS.c.participant == participant)
    read, unreadable = [], []
    for row in connection.execute(query):
        try:
            read.append(_stored(row, flow))
        except (StudyError, TypeError, ValueError, AttributeError) as error:
            lacks_page = isinstance(error, NoSuchPage)
            told = (str(row.participant), str(row.kind), str(row.created_utc))
            unreadable.append(UnreadableSession(*told, str(error)[:MOST_OF_A_REASON], lacks_page))
    return tuple(read), tuple(unreadable)


def _stored(row: Any, flow: Flow) -> StoredSession:
    session, order = flow.from_json(row.session), tuple(row.condition_order.split(ORDER_SEPARATOR))
    if session.participant != row.participant:
        raise StudyError(f"what is stored is the session of {session.participant!r}")
    if session.trials != len(order):
        raise StudyError(f"it has {session.trials} trials, and its order {len(order)} conditions")
    if row.kind not in ID_LETTER:
        raise StudyError(f"it is enrolled for {row.kind!r}; there are {', '.join(ID_LETTER)}")
    if not isinstance(row.seed, int):
        raise StudyError(f"its seed is {str(row.seed)[:60]!r}, must be a whole number")
    return StoredSession(
        participant=row.participant,
        public_id=row.public_id,
        session=session,
        order=order,
        kind=row.kind,
        pace=row.pace,
        study_hash=row.study_hash,
        seed=row.seed,
        created_utc=row.created_utc,
        rejected=bool(row.rejected),
    )


def add_token(connection: sql.Connection, participant: str, role: str, sha256: str, utc: str) -> None:
    """A link for a participant, of which only the hash is kept."""
    insert(connection, TOKENS, sha256=sha256, participant=participant, role=role, created_utc=utc)


def drop_tokens(connection: sql.Connection, participant: str, role: str) -> None:
    """The links of a participant to one of their pages open nothing any more."""
    here = (TOKENS.c.participant == participant, TOKENS.c.role == role)
    for row in connection.execute(sql.select(TOKENS).where(*here)).mappings().all():
        ledger.note_removed(connection, "tokens", dict(row))
    connection.execute(TOKENS.delete().where(*here))


def holder_of_token(connection: sql.Connection, sha256: str) -> tuple[str, str] | None:
    """(participant, role) of a token's SHA-256, or None."""
    query = sql.select(TOKENS.c.participant, TOKENS.c.role).where(TOKENS.c.sha256 == sha256)
    row = connection.execute(query).first()
    return (row.participant, row.role) if row else None


def add_identity(connection: sql.Connection, participant: str, kind: str, value: str) -> None:
    """Something that identifies a person."""
    insert(connection, IDENTITIES, participant=participant, kind=clean_text(kind), value=clean_text(value))


def identities_of(connection: sql.Connection, participant: str) -> tuple[tuple[str, str], ...]:
    """(kind, value) of everything identifying, in order of arrival."""
    query = sql.select(IDENTITIES.c.kind, IDENTITIES.c.value).where(IDENTITIES.c.participant == participant)
    return tuple((row.kind, row.value) for row in connection.execute(query.order_by(IDENTITIES.c.id)))


def participant_of_identity(connection: sql.Connection, kind: str, value: str) -> str | None:
    """Who was the first of whom this identifying thing was noted; None = nobody."""
    query = sql.select(IDENTITIES.c.participant).where(IDENTITIES.c.kind == kind, IDENTITIES.c.value == value)
    found: str | None = connection.execute(query.order_by(IDENTITIES.c.id)).scalar()
    return found


def link_ids(connection: sql.Connection) -> dict[str, dict[str, str]]:
    """Participant to the ids of the open link they came over, by parameter, for those who did."""
    query = sql.select(IDENTITIES.c.participant, IDENTITIES.c.kind, IDENTITIES.c.value).order_by(IDENTITIES.c.id)
    found: dict[str, dict[str, str]] = {}
    for row in connection.execute(query.where(IDENTITIES.c.kind.startswith(IDENTITY_PREFIX, autoescape=True))):
        found.setdefault(row.participant, {}).update(ids_among([(row.kind, row.value)]))
    return found


def labels(connection: sql.Connection) -> dict[str, str]:
    """Participant to the label the experimenter gave them, for those who have one."""
    query = sql.select(IDENTITIES.c.participant, IDENTITIES.c.value).where(IDENTITIES.c.kind == "label")
    return {row.participant: row.value for row in connection.execute(query)}
