"""What `Database` asks of the kind of database that it has: a file of SQLite's, or a server of PostgreSQL's.

All else of the store is the same for both. What one of them does not need, it does nothing for.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

import sqlalchemy as sql

from study.store.condition import TroubleKind


class Backend(Protocol):
    """One opened database.

    Attributes:
        name: what errors call it, without any password.
        folder: where the lab's own files lie.
        reading: hands out connections that see one moment.
        writing: hands out connections on which nobody else writes.
        errors: what its driver raises.
        why_empty: what to say of one that was expected to hold something.
    """

    name: str
    folder: Path
    reading: sql.Engine
    writing: sql.Engine
    errors: tuple[type[Exception], ...]
    why_empty: str

    def close(self) -> None:
        """Give it up; twice is once."""

    # ---- opening it

    @property
    def is_new(self) -> bool:
        """Whether there is nothing yet, so that tables may be made."""

    def check_whole(self, connection: sql.Connection) -> None:
        """Raise `StoreError` when it is damaged, or cannot keep what it acknowledges."""

    def before_writing(self) -> None:
        """It is about to be changed."""

    def stay(self) -> None:
        """From now on it is served."""

    def alone(self) -> AbstractContextManager[None]:
        """Nobody else has it open for writing meanwhile. Raises `StoreError`."""

    def copy_aside(self, revision: str) -> None:
        """Keep a copy of it as it is, before it is brought up. Raises `StoreError`."""

    def copies(self) -> Mapping[str, Path]:
        """Those copies, by name."""

    def rebuilding(self) -> AbstractContextManager[sql.Connection]:
        """A transaction in which whole tables may be replaced."""

    # ---- its condition

    @property
    def in_place(self) -> bool:
        """Whether it is still what was opened."""

    def must_be_in_place(self) -> None:
        """Raise `StoreTroubled` when it is not."""

    def trouble(self, error: BaseException) -> TroubleKind | None:
        """Which trouble an error of its driver is; None for a mistake of ours."""

    def said(self, error: BaseException) -> str:
        """What an error says, in one line."""

    def is_in_transaction(self, connection: sql.Connection) -> bool:
        """False when it has undone the whole transaction by itself."""

    def touch(self, connection: sql.Connection) -> None:
        """Write what changes nothing."""

    def read_back(self) -> None:
        """Read the newest rows past whatever is remembered of them; raises what its driver does."""

    # ---- what is written and what was deleted

    def move_log(self) -> None:
        """Move the log as far as others' reading lets it."""

    def empty_log(self) -> bool | None:
        """See that nothing of what was deleted is left; False when that cannot be done now, None when never."""

    def copy_out(self, path: Path) -> None:
        """Write all of it to a new file, also when its own has no name any more. Raises `OSError` or its `errors`."""
