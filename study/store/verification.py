"""Whether data are as they were recorded: the database's pages, its references, and everybody's chain.

Only reads, past everything that would write or bring an older database up, and while a lab may be running.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import sqlalchemy as sql

from study.integrity.certificate import check_certificate
from study.integrity.chain import Linked, ReadChain, tombstone_hash
from study.integrity.content import CHAINED, keys_of
from study.integrity.findings import Finding, Verdict
from study.integrity.signing import is_signed
from study.records import CertificateRow, ChainRow
from study.store.database import BAD_ADDRESS
from study.store.migration import CHAINED_SINCE, FIRST
from study.store.place import DataPlace, place_of
from study.store.reading import FileReader, Reader, Row, ServerReader
from study.store.sqlite_file import FILE_NAME
from study.store.values import StoreError

LATER = ("certificates",)
"""Tables that came after the chain."""
_UNREADABLE: tuple[type[Exception], ...] = (
    *(sqlite3.Error, sql.exc.DBAPIError),
    *(UnicodeDecodeError, KeyError, TypeError, ValueError),
)
"""What reading a damaged database raises: where a name of a table or column is damaged, nothing is found by it."""


def verify_data(data: DataPlace | Path) -> Verdict:
    """Compare a lab's data with what its chains say. Raises `StoreError` when there are none to look at."""
    place = place_of(data)
    if place.url is not None:
        return _verify_server(place)
    path = place.folder / FILE_NAME
    if not path.is_file():
        raise StoreError(f"{place.folder}: no lab data here ({FILE_NAME} is missing)")
    try:
        with closing(FileReader.opened(path)) as connection:
            return _Recorded(FileReader(connection, path)).verdict()
    except _UNREADABLE as error:
        return Verdict((Finding(FILE_NAME, f"cannot be read: {_said(error)}"),), 0, 0)


def _verify_server(place: DataPlace) -> Verdict:
    from study.store.database import Database
    from study.store.postgres import open_server

    database = Database(open_server(place, exclusive=False))
    try:
        with database.read() as connection:
            if not sql.inspect(connection).has_table("sessions"):
                raise StoreError(f"{place}: no lab data here")
            return _Recorded(ServerReader(connection)).verdict()
    except StoreError as error:
        error.exit_status = BAD_ADDRESS
        raise
    finally:
        database.close()


class _Recorded:
    """The database as of one moment."""

    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._rows = reader.rows
        self._links = 0

    def verdict(self) -> Verdict:
        findings, participants, notes = list(self._reader.damages(_UNREADABLE, _said)), 0, []
        try:
            revision = self._revision()
            findings += self._reader.references()
            findings += self._own()
            if revision < CHAINED_SINCE:
                notes.append(
                    f"schema {revision} has no chain yet: it begins, with the rows as they are, when this version of "
                    "the lab opens the folder; until then pages and references are all that can be looked at"
                )
            else:
                people = [
                    str(row["participant"]) for row in self._rows("SELECT participant FROM sessions ORDER BY number")
                ]
                participants = len(people)
                for participant in people:
                    links = list(self._chain(participant))
                    chain = ReadChain(participant, links)
                    findings += chain.findings
                    for row in self._of("certificates", participant):
                        linked = [link.row for link in links]
                        findings += check_certificate(CertificateRow(**row), linked, is_signed)
                    for table in CHAINED:
                        findings += chain.compared(table, self._of(table, participant))
        except _UNREADABLE as error:
            findings.append(Finding(self._reader.name, f"cannot be read further: {_said(error)}"))
        return Verdict(tuple(findings), participants, self._links, tuple(notes))

    def _revision(self) -> str:
        if "alembic_version" not in self._reader.tables():
            return FIRST
        return next((str(row["version_num"]) for row in self._rows("SELECT version_num FROM alembic_version")), FIRST)

    def _own(self) -> Iterator[Finding]:
        """What carries its hash with it, and the numbers given out."""
        for table, text in (("studies", "text"), ("machines", "fingerprint")):
            for row in self._rows(f"SELECT * FROM {table}"):
                if hashlib.sha256(str(row[text]).encode()).hexdigest() != row["hash"]:
                    yield Finding(f"{table}, {str(row['hash'])[:12]}", "its text is not the one of its hash")
        erased = set()
        for row in self._rows("SELECT * FROM erasures"):
            erased.add(str(row["participant"]))
            if "hash" in row and tombstone_hash(str(row["participant"]), str(row["utc"])) != row["hash"]:
                yield Finding(f"erasures, {row['participant']}", "the mark is not as it was made")
        numbers = {row["number"] for row in self._rows("SELECT number FROM sessions")}
        numbers |= {int(name[1:]) for name in erased if name[1:].isdecimal()}
        where, given_out = self._reader.given_out()
        if numbers and given_out < max(numbers):
            yield Finding(where, f"says that {given_out} numbers of participants were given out, not {max(numbers)}")
        for number in sorted(set(range(1, given_out + 1)) - numbers):
            yield Finding("sessions", f"participant number {number} is missing, and was not erased")

    def _chain(self, participant: str) -> Iterator[Linked]:
        for row in self._rows("SELECT * FROM chain WHERE participant = ? ORDER BY seq", participant):
            self._links += 1
            salt = str(row["salt"])
            yield Linked(ChainRow(**{name: value for name, value in row.items() if name != "salt"}), salt)

    def _of(self, table: str, participant: str) -> Iterator[Row]:
        if table in LATER and table not in self._reader.tables():
            return iter(())  # of a schema that had it not yet
        order = "" if keys_of(table) is not None else f" ORDER BY {self._reader.arrival(table)}"
        return self._rows(f"SELECT * FROM {table} WHERE participant = ?{order}", participant)


def _said(error: Exception) -> str:
    if isinstance(error, sql.exc.DBAPIError):
        return str(error.orig).partition("\n")[0]
    return str(error) if isinstance(error, sqlite3.Error) else f"names in it are damaged ({error})"
