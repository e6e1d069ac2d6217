"""All that a lab has recorded, from one place to another: out of a data folder into a database on a server, and back.

Both have the same tables, so that rows are carried over as they are, chains and certificates with them. The copy is
there whole or not at all: in a folder it is made beside its place, on a server in one transaction. It is verified by
its chains, and the ends of all of them are those of the original, before it is said to be made.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import sqlalchemy as sql

from study.integrity.certificate import all_heads
from study.integrity.chain import Head
from study.integrity.findings import Verdict
from study.integrity.signing import KEY_NAME
from study.store import numbering
from study.store.place import DataPlace
from study.store.snapshot import Snapshot
from study.store.statements import insertion, run_many
from study.store.store import Store, open_store
from study.store.tables import META, METADATA, VERSION
from study.store.values import StoreError
from study.store.verification import verify_data
from study.store.whole import made_whole

AT_ONCE = 1000
"""Rows that are held in memory."""
_MADE_WITH_IT = (META.name, VERSION.name)
"""Tables that every database of this version has its own of."""


@dataclass(frozen=True)
class Copied:
    """What was copied: how many rows, and what their verification says."""

    rows: int
    verdict: Verdict


def copy(source: DataPlace, target: DataPlace) -> Copied:
    """Copy everything to where nothing is.

    Nobody may write meanwhile: the source is held as by a lab. Raises `StoreError` when it is in use or not as it was
    recorded, when the target holds anything, or when the copy is not the same: then there is none.
    """
    if source == target:
        raise StoreError(f"{target}: is where the data are; name another place")
    with open_store(source, exclusive=True, must_exist=True) as opened:
        verdict = verify_data(source)
        if verdict.findings:
            raise StoreError(f"{source}: not as recorded: {verdict.findings[0]}; nothing was copied")
        if target.url is not None:
            shares = target.folder.absolute() == source.folder.absolute()
            return _into_server(opened, replace(target, shares_folder=shares))
        with made_whole(target.folder) as made:
            copied = _into(opened, DataPlace(made))
            _copy_key(opened.folder, made)
        return copied


def copy_rows(source: DataPlace, folder: Path) -> None:
    """Copy everything as of one moment, whatever is written meanwhile, into a folder that somebody makes whole."""
    with open_store(source, must_exist=True) as opened, open_store(folder) as copied:
        _fill(opened, copied)


def _into_server(source: Store, target: DataPlace) -> Copied:
    with open_store(target, exclusive=True) as opened:
        if opened.everyone() != ((), ()) or opened.erasures():
            raise StoreError(f"{target}: holds data already; name an empty database")
        try:
            copied = Copied(_fill(source, opened), _same(source, opened, verify_data(target)))
        except BaseException:
            _empty(opened)
            raise
        _copy_key(source.folder, opened.folder)
        return copied


def _into(source: Store, target: DataPlace) -> Copied:
    with open_store(target) as opened:
        return Copied(_fill(source, opened), _same(source, opened, verify_data(target)))


def _fill(source: Store, target: Store) -> int:
    """In one transaction; how many rows."""
    count = 0
    with source.reading() as reading, target.rewriting() as writing:
        for table in METADATA.sorted_tables:
            if table.name not in _MADE_WITH_IT:
                count += _carried(table, reading, writing)
        numbering.keep(writing, numbering.given_out(reading))
    return count


def _carried(table: sql.Table, source: sql.Connection, target: sql.Connection) -> int:
    target.execute(table.delete())  # what a new database notes of the machine
    words = insertion(table, tuple(column.name for column in table.c))
    order = list(table.primary_key.columns)
    count = 0
    with source.execution_options(yield_per=AT_ONCE).execute(sql.select(table).order_by(*order)) as found:
        for rows in found.partitions():
            run_many(target, words, [tuple(row) for row in rows])
            count += len(rows)
    number = table.autoincrement_column
    if number is not None and target.dialect.name != "sqlite":  # its counter goes on after what it did not count
        highest = sql.select(sql.func.max(number)).scalar_subquery()
        counter = sql.func.pg_get_serial_sequence(table.name, number.name)
        target.execute(sql.select(sql.func.setval(counter, sql.func.coalesce(highest, 1), highest.is_not(None))))
    return count


def _same(source: Store, target: Store, verdict: Verdict) -> Verdict:
    """Raise `StoreError` unless the copy is as recorded, and every chain ends as it did."""
    if verdict.findings:
        raise StoreError(f"the copy is not as recorded: {verdict.findings[0]}; it was taken away")
    with source.snapshot() as one, target.snapshot() as other:
        if _ends(one) != _ends(other):
            raise StoreError("the copy's chains end otherwise than those of the original; it was taken away")
    return verdict


def _ends(recorded: Snapshot) -> tuple[dict[str, Head], str, tuple[tuple[str, str], ...], Any]:
    heads = recorded.heads()
    return heads, all_heads(heads), recorded.erasures(), recorded.machines()


def _empty(target: Store) -> None:
    with target.rewriting() as connection:
        for table in reversed(METADATA.sorted_tables):
            if table.name not in _MADE_WITH_IT:
                connection.execute(table.delete())
        numbering.keep(connection, 0)


def _copy_key(folder: Path, target: Path) -> None:
    """The key that certificates are signed with, unless there is one."""
    if (folder / KEY_NAME).is_file() and not (target / KEY_NAME).exists():
        shutil.copyfile(folder / KEY_NAME, target / KEY_NAME)
        (target / KEY_NAME).chmod(0o600)
