"""A database that another program has locked."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path


@contextlib.contextmanager
def locked(data_dir: Path) -> Iterator[None]:
    """Another program writes to the database, and does not end while the block runs."""
    with closing(sqlite3.connect(data_dir / "lab.sqlite", isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        yield
        other.execute("ROLLBACK")
