"""Checksums of the database's pages, from the clean end of a lab to the next start.

Rows are proved by their chain. What holds no row (free pages, the gaps between rows, the file's own counters) is not,
and neither is where in the file a change was: this is for both, as long as nobody writes.
"""

from __future__ import annotations

import contextlib
import os
import zlib
from collections.abc import Iterator
from pathlib import Path

PAGE_BYTES = 4096
SUMS_FILE = "lab.pages"


def write_sums(path: Path) -> None:
    """Note the pages of a database that nobody has open any more; what cannot be noted proves nothing."""
    if _has_log(path):
        return
    with contextlib.suppress(OSError):
        text = "".join(f"{number:08x}\n" for number in _sums(path))
        sums = path.with_name(SUMS_FILE)
        descriptor = os.open(sums, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(descriptor, "w", encoding="ascii") as file:
            file.write(text)


def forget_sums(path: Path) -> None:
    """The database is about to be written."""
    path.with_name(SUMS_FILE).unlink(missing_ok=True)


def changed_pages(path: Path) -> Iterator[int]:
    """The pages, from 1, that are not as they were noted; none when nothing was noted, or a log says more."""
    try:
        noted = path.with_name(SUMS_FILE).read_text(encoding="ascii", errors="replace").split("\n")[:-1]
    except OSError:
        return
    if _has_log(path):
        return
    found = [f"{number:08x}" for number in _sums(path)]
    for number in range(max(len(noted), len(found))):
        if noted[number : number + 1] != found[number : number + 1]:
            yield number + 1


def _sums(path: Path) -> Iterator[int]:
    with path.open("rb") as file:
        while page := file.read(PAGE_BYTES):
            yield zlib.crc32(page)


def _has_log(path: Path) -> bool:
    try:
        return path.with_name(f"{path.name}-wal").stat().st_size > 0
    except OSError:
        return False
