"""The version of the file, and how an older one becomes this one, with Alembic.

A revision is one file in `revisions/versions`. A new file is made from `tables` and marked with `HEAD`; an older one is
copied aside first, then brought up in one transaction, so that whoever is killed in between finds it as it was. There
is no way back: a later version's file is refused, and the copy is what to go back to.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Collection
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import sqlalchemy as sql

from study.records import SCHEMA_VERSION, utc_text
from study.store import ledger, numbering
from study.store.tables import META, SESSIONS, VERSION
from study.store.values import StoreError

if TYPE_CHECKING:
    from alembic.config import Config

FIRST = "0001"
"""The schema as it was when migrations began."""
HEAD = "0007"
"""The schema of `tables`: the last revision there is."""
CHAINED_SINCE = "0006"
"""The first schema with a chain; data of before get theirs when they are brought up, of the rows as they are then."""
REVISIONS = Path(__file__).with_name("revisions")
_FIRST_META = {"schema_version": "1", "store_version": "3"}
"""What files say that were written before there were migrations."""


def mark(connection: sql.Connection) -> None:
    """Write into a file that its schema is `HEAD`."""
    connection.execute(VERSION.delete())
    connection.execute(VERSION.insert().values(version_num=HEAD))
    connection.execute(META.delete().where(META.c.name.in_(_FIRST_META)))
    connection.execute(META.insert(), [{"name": name, "value": value} for name, value in _meta().items()])


def revision_of(connection: sql.Connection, existing: Collection[str], name: str, copies: Collection[str] = ()) -> str:
    """The revision of a database that has these tables. Raises `StoreError` for one that this version cannot bring up;
    `copies` are what may be gone back to."""
    if "meta" not in existing:
        raise StoreError(f"{name}: a database, but not one of this lab")
    found = {row.name: row.value for row in connection.execute(sql.select(META))}
    revision = connection.execute(sql.select(VERSION.c.version_num)).scalar() if VERSION.name in existing else FIRST
    expected = _meta() if revision == HEAD else _FIRST_META if revision == FIRST else {}
    if revision != HEAD and revision not in _known():
        back = f", or go back to the copy made before: {', '.join(sorted(copies))}" if copies else ""
        raise StoreError(
            f"{name}: written by a later version of the lab (schema {revision}, this version knows those up to "
            f"{HEAD}); open it with that version{back}"
        )
    for item, value in expected.items():
        if found.get(item) != value:
            raise StoreError(
                f"{name}: {item} is {found.get(item)}, this version of the lab needs {value}; "
                "open it with the version that wrote it, or use another data folder"
            )
    return revision


def copy_aside(path: Path, revision: str) -> Path:
    """Copy the database, whole as of this moment, beside itself; the copy's name says which schema it has.

    Raises `StoreError` when it cannot be written: nothing is changed without a copy.
    """
    path = path.absolute()  # a relative one that begins with `file:` may be read as an address
    copy = path.with_name(f"{path.stem}.schema-{revision}{path.suffix}")
    unfinished = copy.with_name(f"{copy.name}.unfinished")
    try:
        unfinished.unlink(missing_ok=True)
        with closing(sqlite3.connect(path)) as source, closing(sqlite3.connect(unfinished)) as target:
            source.backup(target)
        unfinished.chmod(0o600)
        os.replace(unfinished, copy)
    except (OSError, sqlite3.Error) as error:
        raise StoreError(f"{path}: needs a copy of it first, and {copy.name} cannot be written: {error}") from None
    return copy


def copies_beside(path: Path) -> list[Path]:
    """The copies that `copy_aside` made of a database, finished or not."""
    return list(path.parent.glob(f"{path.stem}.schema-*{path.suffix}*"))


def bring_up(connection: sql.Connection, name: str, revision: str) -> None:
    """Run every revision after `revision` in the connection's transaction. Raises `StoreError` when one fails.

    The numbers that SQLite must never give out again (those of erased participants) outlive a table that is replaced.
    """
    from alembic import command

    connection.execute(VERSION.delete())
    connection.execute(VERSION.insert().values(version_num=revision))
    config = _config()
    config.attributes["connection"] = connection
    number = numbering.given_out(connection)
    try:
        command.upgrade(config, HEAD)
    except Exception as error:  # whatever a revision raises, the file stays as it was
        line = str(getattr(error, "orig", None) or error).partition("\n")[0]
        raise StoreError(
            f"{name}: cannot be brought from schema {revision} to {HEAD}: {type(error).__name__}: {line}; "
            "nothing was changed"
        ) from error
    _keep_number(connection, name, number)
    if revision < CHAINED_SINCE:
        ledger.begin(connection, revision, utc_text(time.time()))
    mark(connection)


def _keep_number(connection: sql.Connection, name: str, number: int) -> None:
    """Have the database go on after this number. Raises `StoreError` when it no longer counts on for ever."""
    if connection.dialect.name == "sqlite":
        counting = "SELECT name FROM sqlite_master WHERE type = 'table' AND sql LIKE '%AUTOINCREMENT%'"
        if SESSIONS.name not in set(connection.exec_driver_sql(counting).scalars()):
            raise StoreError(
                f"{name}: the revision would let numbers of {SESSIONS.name} be given out again; replace the table with "
                "table_kwargs={'sqlite_autoincrement': True}; nothing was changed"
            )
    numbering.keep(connection, number)


def _meta() -> dict[str, str]:
    """What a file says beside its revision: versions from before there were migrations read it, and refuse."""
    return {"schema_version": str(SCHEMA_VERSION), "store_version": "3" if HEAD == FIRST else HEAD}


def _known() -> frozenset[str]:
    from alembic.script import ScriptDirectory

    return frozenset(script.revision for script in ScriptDirectory.from_config(_config()).walk_revisions())


def _config() -> Config:
    from alembic.config import Config  # takes a while, and most files are of this version

    config = Config()
    config.set_main_option("script_location", str(REVISIONS).replace("%", "%%"))
    return config
