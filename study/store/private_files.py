"""Files that only their owner may read: what is recorded is about people.

SQLite gives the files beside a database the database's own mode, so the database alone has to be made right.
"""

from __future__ import annotations

import contextlib
import logging
import os
import stat
from collections.abc import Iterator
from pathlib import Path

log = logging.getLogger(__name__)

FILE_MODE, FOLDER_MODE = 0o600, 0o700
OTHERS = stat.S_IRWXG | stat.S_IRWXO
"""What a group and everybody else may do."""


def make_private(path: Path) -> None:
    """An empty file, if there is none. Raises `OSError`."""
    with contextlib.suppress(FileExistsError):
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, FILE_MODE))


def keep_private(folder: Path, stem: str) -> None:
    """Close what an earlier version, or whoever copied it, left open to others: files of ours alone, for the folder may
    be somebody's home. What cannot be closed is told."""
    for path in _ours(folder, stem):
        try:
            found = path.lstat()
            if not stat.S_ISREG(found.st_mode) or not found.st_mode & OTHERS:
                continue
            path.chmod(stat.S_IMODE(found.st_mode) & ~OTHERS)
            log.warning("%s could be read by others on this computer; now by its owner alone", path)
        except OSError as error:
            log.warning("%s can be read by others on this computer: %s", path, error.strerror or error)


def _ours(folder: Path, stem: str) -> Iterator[Path]:
    yield from sorted(folder.glob(f"{stem}.*"))
