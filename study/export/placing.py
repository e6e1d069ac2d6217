"""Something that is there whole or not at all: it is made in a work folder beside its place, and moved there when done.

    with work_folder(place.parent, data_dir) as work:
        ...                                              made in work / "files", say
        put_in_place(work / "files", place)

Who is killed leaves a work folder. It has a name that tells what it is (`.salab-export-…`), and a lock that ended with
its owner: whoever comes next removes it (`sweep`). It holds what was measured of people, so the data folder notes where
one is made, and an erasure finds it wherever that is (`sweep_noted`).
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from study.disk.flushing import to_disk
from study.disk.locks import Lock, hold

PREFIX = ".salab-export-"
"""What the names of work folders begin with."""
NOTES = ".exports-under-way"
"""The folder, in a data folder, of files that say where work folders are."""
_EARLIER, _PLACE = "earlier", "place"
"""In a work folder: what stood in the place before, and the name of the place, while the two change places."""
_LOCK = "lock"
"""In a work folder: whose holder is gone may be removed."""
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


@contextmanager
def work_folder(parent: Path, data_dir: Path | None = None) -> Iterator[Path]:
    """A folder of one's own beside something that is to be made, for its owner's eyes alone; gone when the `with` ends.

    `data_dir`: the data folder that notes it. Work folders of others that were killed are removed on the way. Raises
    `OSError`.
    """
    parent.mkdir(parents=True, exist_ok=True)
    sweep(parent)
    work, lock = _made(parent)
    note = _noted(work, data_dir) if data_dir is not None else None
    try:
        yield work
    finally:
        _remove(work, lock)
        if note is not None:
            note.unlink(missing_ok=True)
            with contextlib.suppress(OSError):
                note.parent.rmdir()  # unless others are noted in it


def put_in_place(made: Path, place: Path) -> None:
    """Move a file or a folder of a work folder to its place, in which it is from one moment to the next, or not at all;
    what was there before is then in the work folder. Nothing is moved before it is on disk. Raises `OSError`."""
    _flush(made)
    if made.is_dir() and place.is_dir() and any(place.iterdir()):
        if not _exchanged(made, place):
            _moved_around(made, place)
    else:
        os.replace(made, place)
    to_disk(place.parent)


def sweep(parent: Path) -> None:
    """Remove the work folders in a folder whose owners are gone."""
    for work in parent.glob(f"{PREFIX}*"):
        _remove_if_abandoned(work)


def sweep_noted(data_dir: Path) -> None:
    """Remove the work folders whose owners are gone, wherever the data folder's exports were to go."""
    sweep(data_dir)
    for note in (data_dir / NOTES).glob("*"):
        with contextlib.suppress(OSError, UnicodeDecodeError):
            work = Path(note.read_text(encoding="utf-8"))
            if not work.name.startswith(PREFIX) or _remove_if_abandoned(work):
                note.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        (data_dir / NOTES).rmdir()


def _made(parent: Path) -> tuple[Path, Lock]:
    """A new work folder and the lock that says that it is somebody's."""
    while True:
        work = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
        with contextlib.suppress(FileNotFoundError):  # somebody swept before it was locked
            lock = hold(work / _LOCK)
            if lock is not None:
                return work, lock


def _locked(work: Path) -> Lock | None:
    """The lock of a work folder that nobody else has; of no link, which leads who knows where."""
    if work.is_symlink():
        return None
    try:
        return hold(work / _LOCK)
    except OSError:
        return None


def _remove(work: Path, lock: Lock) -> None:
    """Remove a work folder of one's own, its lock last: until then nobody else begins to."""
    with contextlib.suppress(OSError):
        for path in work.iterdir():
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            elif path.name != _LOCK:
                path.unlink(missing_ok=True)
    lock.close()  # Windows removes no file that is open
    shutil.rmtree(work, ignore_errors=True)


def _noted(work: Path, data_dir: Path) -> Path | None:
    note = data_dir / NOTES / work.name
    try:
        note.parent.mkdir(exist_ok=True)
        note.write_text(str(work.resolve()), encoding="utf-8")
    except OSError:
        return None  # nothing can be erased from a folder that cannot be written to
    return note


def _remove_if_abandoned(work: Path) -> bool:
    """Whether a work folder is gone."""
    if not work.exists():
        return True
    lock = _locked(work)
    if lock is None:
        return False
    try:
        with contextlib.suppress(OSError, UnicodeDecodeError):
            place = work.parent / (work / _PLACE).read_text(encoding="utf-8")
            if place.parent == work.parent and not place.exists():  # killed between two moves
                os.rename(work / _EARLIER, place)
    finally:
        _remove(work, lock)
    return not work.exists()


def _exchanged(made: Path, place: Path) -> bool:
    """Let two folders change places in one step, where the system can do that."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):  # of macOS, of an old kernel's library, of Windows
        return False
    return bool(rename(_AT_FDCWD, os.fsencode(made), _AT_FDCWD, os.fsencode(place), _RENAME_EXCHANGE) == 0)


def _moved_around(made: Path, place: Path) -> None:
    """The same in two steps. Who is killed in between leaves the earlier one in the work folder, and its place's name:
    `sweep` brings it back."""
    work = made.parent
    (work / _PLACE).write_text(place.name, encoding="utf-8")
    to_disk(work / _PLACE)
    os.rename(place, work / _EARLIER)
    try:
        os.rename(made, place)
    except OSError:
        os.rename(work / _EARLIER, place)
        raise


def _flush(made: Path) -> None:
    for path in (*made.rglob("*"), made) if made.is_dir() else (made,):
        to_disk(path)
