"""A copy of a database whose file was deleted, moved or replaced while it was open.

The copy is a data folder: a lab can be started on it as it is.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from study.store.database import FILE_NAME, Database
from study.store.values import StoreError


def copy_out(database: Database, utc: str) -> Path:
    """Copy everything to a new folder; returns it. Raises `StoreError` when no place takes it."""
    name = f"{database.backend.folder.name}.rescued-{utc[:19].replace('-', '').replace(':', '')}"
    problems = []
    refused: tuple[type[Exception], ...] = (OSError, *database.backend.errors)
    for place in _places(database.backend.folder):
        try:
            folder = _new_folder(place, name)
        except OSError as error:
            problems.append(f"{place}: {error}")
            continue
        try:
            database.copy_out(folder / FILE_NAME)
        except refused as error:
            shutil.rmtree(folder, ignore_errors=True)  # half a copy is none, and it is tried again
            problems.append(f"{place}: {error}")
        else:
            return folder
    raise StoreError(f"no place for a rescue copy of {database.name}: {'; '.join(problems)}")


def _places(folder: Path) -> Iterator[Path]:
    """Where a copy may go, best first."""
    yield folder.parent
    with suppress(RuntimeError):  # whoever has none
        yield Path.home()
    yield Path(tempfile.gettempdir())


def _new_folder(place: Path, name: str) -> Path:
    """A folder of that name, or that name with a number. Raises `OSError`."""
    number = 1
    while True:
        folder = place / (name if number == 1 else f"{name}-{number}")
        try:
            folder.mkdir(mode=0o700)
        except FileExistsError:
            number += 1
        else:
            return folder
