"""Files that only their owner may read: what is recorded is about people.

SQLite gives the files beside a database the database's own mode, so the database alone has to be made right.

On Windows a mode says nothing about others: a file has the rights of the folder it is in. Python makes a folder of mode
0700 its owner's alone there (since 3.10.15, 3.11.10 and 3.12.4), and a user's own folder is so from the start; of any
other the log says that it may be open, and it is left as it is.
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
HAS_MODES = os.name != "nt"
"""Whether a file's mode says who may read it."""


def make_private(path: Path) -> None:
    """An empty file, if there is none. Raises `OSError`."""
    with contextlib.suppress(FileExistsError):
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, FILE_MODE))


def keep_private(folder: Path, stem: str) -> None:
    """Close what an earlier version, or whoever copied it, left open to others: files of ours alone, for the folder may
    be somebody's home. What cannot be closed is told."""
    if not HAS_MODES:
        _say_who_decides(folder)
        return
    for path in _ours(folder, stem):
        try:
            found = path.lstat()
            if not stat.S_ISREG(found.st_mode) or not found.st_mode & OTHERS:
                continue
            path.chmod(stat.S_IMODE(found.st_mode) & ~OTHERS)
            log.warning("%s could be read by others on this computer; now by its owner alone", path)
        except OSError as error:
            log.warning("%s can be read by others on this computer: %s", path, error.strerror or error)


def _say_who_decides(folder: Path) -> None:
    """Where nothing can be closed by a mode: whose the folder is cannot be asked either without asking Windows."""
    if not folder.resolve().is_relative_to(Path.home().resolve()):
        log.warning(
            "%s: on Windows, who may read a file is decided by its folder, and this one is not in yours; "
            "close it with: icacls FOLDER /inheritance:r /grant:r USER:(OI)(CI)F",
            folder,
        )


def _ours(folder: Path, stem: str) -> Iterator[Path]:
    yield from sorted(folder.glob(f"{stem}.*"))
