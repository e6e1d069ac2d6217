"""`Store`: everything the lab asks of its data.

Every method that writes is one transaction and is on disk when it returns. A `Store` may be used from several threads.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, cast

from study.definition.study import Study, plan_session
from study.flow.flow import FLOW, Flow
from study.flow.open_link import BEFORE_CONSENT, LAPSED
from study.flow.protocol import Event
from study.flow.recorded import RECEIVED
from study.flow.roster import EnrolmentKind
from study.records import EventRow, TickRow
from study.store import certificates, erasure, participants, progress, rows
from study.store.condition import StoreTroubled
from study.store.database import Database, TransactionUndone, open_database
from study.store.place import DataPlace, place_of
from study.store.rescue import copy_out
from study.store.snapshot import Snapshot
from study.store.sqlite_file import SqliteFile
from study.store.unknown import Unknown
from study.store.values import Batch, Cycle, SessionUnreadable, StoredSession, StoreError, UnreadableSession


def open_store(
    data: DataPlace | Path | str, *, exclusive: bool = False, must_exist: bool = False, flow: Flow = FLOW
) -> Store:
    """Open the database of a data folder or of a server, made when it is not there.

    `exclusive` is for the lab that serves: a second one on the same data is refused. `must_exist` is for the export.
    `flow` holds the pages that participants go through. Raises `StoreError` with one line for what cannot be used, a
    foreign or damaged database, or another schema version.
    """
    return Store(open_database(place_of(data), exclusive=exclusive, must_exist=must_exist), flow)


class Store:
    """An open database. Made by `open_store`; close it, or use it in `with`."""

    def __init__(self, database: Database, flow: Flow = FLOW) -> None:
        self._database = database
        self._unknown = Unknown()
        self.flow = flow

    @property
    def name(self) -> str:
        """What errors call the database: its file, or its address without a password."""
        return self._database.name

    @property
    def folder(self) -> Path:
        """Where the lab's own files lie."""
        return self._database.backend.folder

    @property
    def path(self) -> Path:
        """The database's file. Raises `StoreError` for one that a server keeps."""
        if isinstance(self._database.backend, SqliteFile):
            return self._database.backend.path
        raise StoreError(f"{self.name}: is no file")

    @property
    def writes(self) -> int:
        """How many transactions were written."""
        return self._database.writes

    @property
    def in_place(self) -> bool:
        """Whether the database is still the file that was opened: not moved, deleted or replaced."""
        return self._database.in_place

    def try_to_write(self) -> None:
        """Write what changes nothing. Raises `StoreTroubled` when the disk does not do."""
        self._database.try_to_write()

    def read_back(self) -> None:
        """Read the newest rows from the disk. Raises `StoreTroubled` when what is there is damaged."""
        self._database.read_back()

    def rescue(self, utc: str) -> Path:
        """Copy everything to a new data folder where one can be made: beside the old one, at home, or where temporary
        files go. Works for a database whose file was deleted. Raises `StoreError` when no place takes it."""
        return copy_out(self._database, utc)

    def close(self) -> None:
        """Give up the file; twice is once."""
        self._database.close()

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
        kind: EnrolmentKind = "study",
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
        with self._database.write() as connection:
            participant = participants.enrol(
                connection,
                study,
                self.flow,
                seed=seed,
                public_id=public_id,
                utc=utc,
                kind=kind,
                pace=pace,
                order=order,
            )
            for role, sha256 in (tokens or {}).items():
                participants.add_token(connection, participant, role, sha256, utc)
            for name, value in (identities or {}).items():
                participants.add_identity(connection, participant, name, value)
        return self.session(participant)

    def session(self, participant: str) -> StoredSession:
        """One participant; `SessionUnreadable` when what is stored cannot be read, `StoreError` when there is none of
        that id."""
        with self._database.read() as connection:
            found, unreadable = participants.stored_sessions(connection, self.flow, participant=participant)
        if unreadable:
            raise SessionUnreadable(f"{participant}: {unreadable[0].reason}")
        if not found:
            raise StoreError(f"no participant {participant!r}")
        return found[0]

    def sessions(self) -> tuple[StoredSession, ...]:
        """Everyone whose session can be read, demo included, in order of enrolment. `unreadable_sessions` has the
        others."""
        return self.everyone()[0]

    def unreadable_sessions(self) -> tuple[UnreadableSession, ...]:
        """Those of whom what is stored cannot be read, in order of enrolment."""
        return self.everyone()[1]

    def everyone(self) -> tuple[tuple[StoredSession, ...], tuple[UnreadableSession, ...]]:
        """Both, as of one moment."""
        with self._database.read() as connection:
            return participants.stored_sessions(connection, self.flow)

    def study_text(self, study_hash: str) -> str:
        """The study file that participants were enrolled with, by its SHA-256; `StoreError` when there is none."""
        with self._database.read() as connection:
            text = participants.study_text(connection, study_hash)
        if text is None:
            raise StoreError(f"no study {study_hash[:12]} is stored here")
        return text

    def participant_for_token(self, sha256: str) -> tuple[str, str] | None:
        """(participant, role) of a token's SHA-256, or None."""
        with self._database.read() as connection:
            return participants.holder_of_token(connection, sha256)

    def add_token(self, participant: str, role: str, sha256: str, utc: str, *, alone: bool = False) -> None:
        """Another link for a participant; `alone`: those to this page from before open nothing any more."""
        with self._database.write() as connection:
            if alone:
                participants.drop_tokens(connection, participant, role)
            participants.add_token(connection, participant, role, sha256, utc)

    def add_identity(self, participant: str, kind: str, value: str) -> None:
        """Something that identifies a person (recruitment id, note, user agent); never exported."""
        with self._database.write() as connection:
            participants.add_identity(connection, participant, kind, value)

    def identities(self, participant: str) -> tuple[tuple[str, str], ...]:
        """(kind, value) of everything identifying, in order of arrival."""
        with self._database.read() as connection:
            return participants.identities_of(connection, participant)

    def participant_of_identity(self, kind: str, value: str) -> str | None:
        """Who was the first of whom this identifying thing was noted; None = nobody."""
        with self._database.read() as connection:
            return participants.participant_of_identity(connection, kind, value)

    def link_ids(self) -> dict[str, dict[str, str]]:
        """Participant to the ids of the open link they came over, by parameter, for those who did."""
        with self._database.read() as connection:
            return participants.link_ids(connection)

    def cells_held(self) -> int:
        """How many participants hold a cell of the counterbalancing."""
        with self._database.read() as connection:
            return participants.cells_held(connection)

    def labels(self) -> dict[str, str]:
        """Participant to the label the experimenter gave them, for those who have one."""
        with self._database.read() as connection:
            return participants.labels(connection)

    def reject(self, participant: str, event: EventRow) -> bool:
        """Give a participant's counterbalancing cell out again; the data stay, with this event beside them.

        False, and nothing written, when somebody else did it first or there is no such participant.
        """
        with self._database.write() as connection:
            if not participants.free_cell(connection, participant):
                return False
            rows.add(connection, "events", [event])
            return True

    def waiting_over_link(self) -> tuple[tuple[StoredSession, str | None], ...]:
        """Who came over the open link and has not agreed to take part, with the time of the last event about them."""
        with self._database.read() as connection:
            return tuple(participants.over_link(connection, self.flow))

    def lapse(self, participant: str, reason: str, utc: str) -> bool:
        """Give the place of somebody out again who has not agreed to take part; False when they have."""
        with self._database.write() as connection:
            (stored,), _ = participants.stored_sessions(connection, self.flow, participant=participant)
            if stored.session.state not in BEFORE_CONSENT:
                return False
            after, _ = self.flow.advance(stored.session, Event("place_lapsed", reason), stored.session.since_s)
            progress.save_session(connection, after, None, None)
            data = {"event": "place_lapsed", "from": stored.session.state, "to": after.state, "reason": reason}
            rows.add(connection, "events", [EventRow(participant, None, None, utc, "state", "lab", json.dumps(data))])
            return True

    def take_place_again(self, participant: str, study: Study, quota: int, utc: str) -> bool:
        """Let somebody whose place has lapsed begin anew under the least-filled order; False when it has not lapsed, or
        `quota` participants hold a cell."""
        with self._database.write() as connection:
            (stored,), _ = participants.stored_sessions(connection, self.flow, participant=participant)
            if stored.session.state != LAPSED or participants.cells_held(connection) >= quota:
                return False
            begun = participants.begin_anew(connection, stored, study, self.flow)
            data = {"event": "place_given", "from": stored.session.state, "to": begun.state, "reason": None}
            rows.add(connection, "events", [EventRow(participant, None, None, utc, "state", "lab", json.dumps(data))])
            return True

    def erasures(self) -> tuple[tuple[str, str], ...]:
        """As `Snapshot.erasures`."""
        with self.snapshot() as recorded:
            return recorded.erasures()

    def erase(self, participant: str, utc: str) -> bool | None:
        """Delete everything about a participant but the mark that there was one. Cannot be undone.

        The rows are gone when this returns. True when the space they took is overwritten too; False when another
        process was reading the database and its log could not be emptied: the next erasure, or the end of the lab,
        does it. None for a server, which promises no overwriting.
        """
        with contextlib.suppress(SessionUnreadable):  # whoever cannot be read can be erased
            self.session(participant)
        with self._database.write() as connection:
            erasure.erase(connection, participant, utc)
        for copy in self._database.backend.copies().values():  # they hold the one who is erased
            copy.unlink(missing_ok=True)
        return self._database.empty_log()

    # ---- what happens in a session

    def commit(self, batch: Batch) -> bool:
        """Write a batch; on disk at return. False, and nothing written, when its submission was answered before."""
        answered = self._unknown.answer(self._database, batch)
        if answered is not None:
            return answered
        is_new = False
        with self._unknown.noting([batch], lambda: [is_new]), self._database.write() as connection:
            is_new = self._write(connection, batch)
        self._phase_ended([batch])
        return is_new

    def commit_all(self, batches: Sequence[Batch]) -> list[bool | Exception]:
        """Write batches in their order, waiting for the disk once. Of each, what `commit` returns, or the error that it
        raises: then nothing of that one is written, and no other lacks anything."""
        if len(batches) > 1 and not self._unknown.concerns(batches):
            try:
                return self._commit_together(batches)
            except StoreTroubled as error:
                if error.kind != "full":
                    return [error] * len(batches)
            except StoreError:
                pass
        return self._commit_in_turn(batches)  # some may fit, and what is wrong with one is told of that one

    def _commit_together(self, batches: Sequence[Batch]) -> list[bool | Exception]:
        found: list[bool | Exception] = []
        with self._unknown.noting(batches, lambda: found), self._database.transaction() as connection:
            for batch in batches:
                try:
                    with self._database.part(connection):
                        is_new = self._write(connection, batch)
                except (StoreTroubled, TransactionUndone):
                    raise
                except Exception as error:
                    found.append(error)
                else:
                    found.append(is_new)
        self._phase_ended(batches)
        return found

    def _commit_in_turn(self, batches: Sequence[Batch]) -> list[bool | Exception]:
        """Until the disk does not do: then of those that follow, the same is true."""
        found: list[bool | Exception] = []
        for batch in batches:
            try:
                found.append(self.commit(batch))
            except StoreTroubled as error:
                return [*found, *[error] * (len(batches) - len(found))]
            except Exception as error:
                found.append(error)
        return found

    def _write(self, connection: Any, batch: Batch) -> bool:
        sent = batch.submission
        if sent is not None:
            if progress.response_to(connection, sent.participant, sent.message_id) is not None:
                return False
            progress.save_response(connection, sent.participant, sent.message_id, sent.response)
        for identity in batch.identities:
            participants.add_identity(connection, identity.participant, identity.kind, identity.text)
        if batch.session is not None:
            progress.save_session(connection, batch.session, batch.consent, batch.finished_utc)
        rows.add(connection, "ticks", batch.ticks)
        rows.add(connection, "practice_ticks", batch.practice_ticks)
        rows.put(connection, "trials", batch.trials)
        rows.put(connection, "tasks", batch.tasks)
        rows.put(connection, "alerts", batch.alerts)
        rows.add(connection, "survey_answers", batch.answers)
        rows.add(connection, "events", batch.events)
        for cycle in batch.cycles:
            progress.save_cycle(connection, cycle)
        for participant, utc in _to_certify(batch).items():
            certificates.certify(connection, self.folder, participant, utc)
        return True

    def _phase_ended(self, batches: Sequence[Batch]) -> None:
        """Where one has, a copy of the file alone is to lack little."""
        if any(batch.session is not None for batch in batches):
            self._database.move_log()

    def response(self, participant: str, message_id: str) -> dict[str, Any] | None:
        """What a message was answered with, or None when it is new."""
        with self._database.read() as connection:
            return progress.response_to(connection, participant, message_id)

    def last_cycle(self, participant: str, trial: int, *, practice: bool = False) -> Cycle | None:
        """The cycle that was running last in a trial (or its practice)."""
        with self._database.read() as connection:
            return progress.last_cycle(connection, participant, trial, practice=practice)

    def ticks_of_attempt(
        self, participant: str, trial: int, cycle: int, attempt: int, *, practice: bool = False
    ) -> tuple[TickRow, ...]:
        """The ticks of one attempt at a cycle in order, for re-running them."""
        table = "practice_ticks" if practice else "ticks"
        found = self.rows_of(table, participant, trial=trial, cycle=cycle, attempt=attempt)
        return cast("tuple[TickRow, ...]", found)

    def last_input_seq(self, participant: str) -> int:
        """The highest input sequence number that a committed tick took into account; 0 = none."""
        with self._database.read() as connection:
            return progress.last_input_seq(connection, participant)

    # ---- reading

    @contextlib.contextmanager
    def snapshot(self) -> Iterator[Snapshot]:
        """Everything recorded as it is at this moment, whatever is written meanwhile."""
        with self._database.read() as connection:
            yield Snapshot(connection)

    def reading(self) -> AbstractContextManager[Any]:
        """A connection that sees one moment; for what is in this room."""
        return self._database.read()

    def rewriting(self) -> AbstractContextManager[Any]:
        """A transaction whose rows are linked by nobody: they bring their links. For what is in this room."""
        return self._database.transaction()

    def rows(self, table: str, include_demo: bool = False, include_pilot: bool = False) -> Iterator[Any]:
        """As `Snapshot.rows`."""
        with self.snapshot() as recorded:
            yield from recorded.rows(table, include_demo, include_pilot)

    def rows_of(self, table: str, participant: str, **equal: object) -> tuple[Any, ...]:
        """As `Snapshot.rows_of`."""
        with self.snapshot() as recorded:
            return recorded.rows_of(table, participant, **equal)


def _to_certify(batch: Batch) -> dict[str, str]:
    """Whose certificate this batch calls for, and when: of who ends, and of who has a page that reports."""
    reports = {row.participant: row.utc for row in batch.events if RECEIVED.of(row)}
    if batch.session is not None and batch.finished_utc is not None:
        reports[batch.session.participant] = batch.finished_utc
    return reports
