"""A folder that is there whole or not at all."""

from __future__ import annotations

import os
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from study.disk.flushing import to_disk
from study.store.values import StoreError


@contextmanager
def made_whole(place: Path) -> Iterator[Path]:
    """A folder beside `place` to be filled, which takes its place when the `with` ends; on disk, and its owner's."""
    place = place.absolute()
    made = place.with_name(f".{place.name}.{os.getpid()}.unfinished")
    try:
        if place.exists() and (not place.is_dir() or any(place.iterdir())):
            raise StoreError(f"{place}: there already; choose another place, or move it away")
        place.parent.mkdir(parents=True, exist_ok=True)
        made.mkdir(mode=0o700)
        yield made
        for path in made.iterdir():
            path.chmod(0o600)
            to_disk(path)
        to_disk(made)
        if place.exists():
            place.rmdir()
        made.rename(place)
        to_disk(place.parent)
    except (OSError, sqlite3.Error) as error:
        raise StoreError(f"{place}: cannot be written: {error}") from None
    finally:
        shutil.rmtree(made, ignore_errors=True)
