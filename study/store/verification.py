"""Whether a data folder holds what was recorded: the file's pages, its references, and everybody's chain.

Only reads, past everything that would write or bring an older file up, and while a lab may be running.
"""

from __future__ import annotations

import hashlib
import re
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import quote

from study.integrity.certificate import check_certificate
from study.integrity.chain import Linked, ReadChain, tombstone_hash
from study.integrity.content import CHAINED, keys_of
from study.integrity.findings import Finding, Verdict
from study.integrity.signing import is_signed
from study.records import CertificateRow, ChainRow
from study.store.migration import CHAINED_SINCE, FIRST
from study.store.page_sums import changed_pages
from study.store.values import StoreError

FILE_NAME = "lab.sqlite"
MOST_DAMAGES = 100
"""As many as SQLite is asked for; more say nothing more."""
LATER = ("certificates",)
"""Tables that came after the chain."""
_UNREADABLE = (sqlite3.Error, UnicodeDecodeError, KeyError, TypeError, ValueError)
"""What reading a damaged file raises: where a name of a table or column is damaged, nothing is found by it."""
Row = Mapping[str, Any]


def verify_data(folder: Path) -> Verdict:
    """Compare a data folder with what its chains say. Raises `StoreError` when there is none to look at."""
    path = folder / FILE_NAME
    if not path.is_file():
        raise StoreError(f"{folder}: no lab data here ({FILE_NAME} is missing)")
    address = f"file:{quote(str(path.absolute()))}?mode=ro"
    try:
        with closing(sqlite3.connect(address, uri=True, timeout=10.0, isolation_level=None)) as connection:
            connection.row_factory = _as_mapping
            connection.text_factory = _text
            connection.execute("BEGIN")  # one moment, whatever is written meanwhile
            return _File(connection, path).verdict()
    except _UNREADABLE as error:
        return Verdict((Finding(FILE_NAME, f"cannot be read: {_said(error)}"),), 0, 0)


class _File:
    """The database as of one moment."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection = connection
        self._path = path
        self._links = 0

    def verdict(self) -> Verdict:
        findings, participants, notes = [*self._pages(), *self._at_rest()], 0, []
        try:
            revision = self._revision()
            findings += self._references()
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
            findings.append(Finding(FILE_NAME, f"cannot be read further: {_said(error)}"))
        return Verdict(tuple(findings), participants, self._links, tuple(notes))

    def _rows(self, query: str, *values: object) -> Iterator[Row]:
        yield from self._connection.execute(query, values)

    def _pages(self) -> Iterator[Finding]:
        """What SQLite itself finds: pages, indexes, the list of free pages, values of a wrong type."""
        try:
            for row in self._rows(f"PRAGMA integrity_check({MOST_DAMAGES})"):
                text = " ".join(str(next(iter(row.values()))).split())
                if text != "ok":
                    yield Finding(self._place_of(text), text.removeprefix("*** in database main *** "))
        except _UNREADABLE as error:
            yield Finding(FILE_NAME, f"its pages are damaged: {_said(error)}")

    def _at_rest(self) -> Iterator[Finding]:
        """Pages that are not as the lab left them when it ended."""
        for number in changed_pages(self._path):
            yield Finding(self._place_of(f"page {number}"), f"page {number} is not as the lab left it")

    def _place_of(self, text: str) -> str:
        """The file, and the table or index whose page SQLite names by a number."""
        named = re.search(r"\bpage (\d+)", text)
        try:
            found = self._rows("SELECT name FROM dbstat WHERE pageno = ?", int(named[1])) if named else iter(())
            return ", ".join([FILE_NAME, *(str(row["name"]) for row in found)])
        except _UNREADABLE:  # the page is damaged, or this SQLite has no such table
            return FILE_NAME

    def _revision(self) -> str:
        tables = {row["name"] for row in self._rows("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if "alembic_version" not in tables:
            return FIRST
        return next((str(row["version_num"]) for row in self._rows("SELECT version_num FROM alembic_version")), FIRST)

    def _references(self) -> Iterator[Finding]:
        for row in self._rows("PRAGMA foreign_key_check"):
            yield Finding(f"{row['table']}, row {row['rowid']}", f"belongs to a row of {row['parent']} that is missing")

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
        given_out = max(
            (row["seq"] for row in self._rows("SELECT seq FROM sqlite_sequence WHERE name = 'sessions'")), default=0
        )
        if numbers and given_out < max(numbers):
            yield Finding(
                "sqlite_sequence", f"says that {given_out} numbers of participants were given out, not {max(numbers)}"
            )
        for number in sorted(set(range(1, given_out + 1)) - numbers):
            yield Finding("sessions", f"participant number {number} is missing, and was not erased")

    def _chain(self, participant: str) -> Iterator[Linked]:
        for row in self._rows("SELECT * FROM chain WHERE participant = ? ORDER BY seq", participant):
            self._links += 1
            salt = str(row["salt"])
            yield Linked(ChainRow(**{name: value for name, value in row.items() if name != "salt"}), salt)

    def _of(self, table: str, participant: str) -> Iterator[Row]:
        if table in LATER and not list(self._rows("SELECT 1 FROM sqlite_master WHERE name = ?", table)):
            return iter(())  # of a schema that had it not yet
        order = "" if keys_of(table) is not None else " ORDER BY rowid"
        return self._rows(f"SELECT * FROM {table} WHERE participant = ?{order}", participant)


def _said(error: Exception) -> str:
    return str(error) if isinstance(error, sqlite3.Error) else f"names in it are damaged ({error})"


def _as_mapping(cursor: sqlite3.Cursor, row: tuple[Any, ...]) -> Row:
    names = [description[0] for description in cursor.description]
    return dict(zip(names, [value.hex() if isinstance(value, bytes) else value for value in row], strict=True))


def _text(raw: bytes) -> str:
    """Text as it is; of what is no text any more, something that no row ever held."""
    return raw.decode("utf-8", "backslashreplace")
