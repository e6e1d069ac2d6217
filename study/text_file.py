"""The one door through which text files of others come in: study files and what stands beside them, exports, lists.

Whoever sends a file may send anything: a pipe that never ends, a device, a link to another file of this machine, a
terabyte of nothing. What cannot be read is told in one line, and nothing is read without a bound. What editors and
spreadsheets do to a text is no mistake: a byte order mark, `\\r\\n`, a blank last line.
"""

from __future__ import annotations

import csv
import io
import os
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, TextIO

from study.records import StudyError

MOST_TABLE_BYTES = 4_000_000_000
"""Of a table in an export: a thousand times a usual one."""
MOST_LINE_BYTES = 4_000_000
"""Of a line in a table: far above the longest that is ever written."""
_BLOCK_BYTES = 1 << 20
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")


class FileProblem(StudyError):
    """A file that cannot be read. The message is `path: reason`, in one line."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{path}: {reason}")
        self.reason = reason


def read_text(path: Path, most_bytes: int, *, within: Path | None = None) -> str:
    """The text of a file, without a byte order mark; line ends as they are.

    `within`: the folder that no link may lead out of, for a file that a stranger's file names. Raises `FileProblem`.
    """
    raw = read_bytes(path, most_bytes, within=within)
    try:
        return text_of(raw)
    except ValueError as error:
        raise FileProblem(path, str(error)) from None


def read_bytes(path: Path, most_bytes: int, *, within: Path | None = None) -> bytes:
    """What stands in a regular file; as `read_text`."""
    with opened(path, most_bytes, within=within) as file:
        try:
            raw = file.read(most_bytes + 1)  # its size may have been a lie, as in /proc
        except OSError as error:
            raise FileProblem(path, f"cannot be read: {error.strerror or error}") from None
    if len(raw) > most_bytes:
        raise FileProblem(path, _too_large(most_bytes))
    return raw


def text_of(raw: bytes) -> str:
    """The text of these bytes, without a byte order mark. Raises `ValueError` with the reason why they are none."""
    if raw.startswith(_UTF_16):
        raise ValueError(_IS_UTF_16)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"not UTF-8 text (byte {error.start}); save the file as UTF-8") from None
    if "\x00" in text:
        raise ValueError(_has_nul(raw.index(0)))
    return text


def opened(path: Path, most_bytes: int, *, within: Path | None = None) -> IO[bytes]:
    """A regular file, open for reading bytes. Raises `FileProblem`."""
    try:
        place = os.path.realpath(path, strict=True)
        if within is not None and Path(os.path.realpath(within)) not in Path(place).parents:
            raise FileProblem(path, "is a link that leads out of its folder; put the file itself there")
        _check(path, os.stat(place), most_bytes)
        # Checked again once it is open, when nobody can put another one there; and no pipe is waited for meanwhile.
        descriptor = os.open(place, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
        file = os.fdopen(descriptor, "rb")
        try:
            _check(path, os.fstat(descriptor), most_bytes)
        except FileProblem:
            file.close()
            raise
    except OSError as error:
        raise FileProblem(path, f"cannot be read: {error.strerror or error}") from None
    return file


def _check(path: Path, found: os.stat_result, most_bytes: int) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise FileProblem(path, "is a folder, not a file")
    if not stat.S_ISREG(found.st_mode):
        raise FileProblem(path, "is no regular file")
    if found.st_size > most_bytes:
        raise FileProblem(path, _too_large(most_bytes))


_IS_UTF_16 = "is UTF-16 text; save the file as UTF-8"


def _has_nul(place: int) -> str:
    return f"is no text: there is a NUL byte in it (byte {place})"


def _too_large(most_bytes: int) -> str:
    return f"is larger than {most_bytes / 1e6:g} MB, the most that is read"


# ---- tables -------------------------------------------------------------------------------------------------------


def opened_table(path: Path, *, within: Path | None = None) -> IO[bytes]:
    """A table, open for reading lines: there are no NUL bytes in it, and each line ends before it fills the memory.
    Raises `FileProblem`."""
    file = opened(path, MOST_TABLE_BYTES, within=within)
    try:
        _check_lines(path, file)
        file.seek(0)
    except OSError as error:
        file.close()
        raise FileProblem(path, f"cannot be read: {error.strerror or error}") from None
    except FileProblem:
        file.close()
        raise
    return file


def table_text(file: IO[bytes]) -> TextIO:
    """An open table as text for `csv`, without a byte order mark."""
    return io.TextIOWrapper(file, encoding="utf-8-sig", newline="")


def _check_lines(path: Path, file: IO[bytes]) -> None:
    open_bytes, place = 0, 0  # of the line that has not ended yet; of the block
    while block := file.read(_BLOCK_BYTES):
        if place == 0 and block.startswith(_UTF_16):
            raise FileProblem(path, _IS_UTF_16)
        if (found := block.find(0)) >= 0:
            raise FileProblem(path, _has_nul(place + found))
        first, last = block.find(b"\n"), block.rfind(b"\n")
        if open_bytes + (len(block) if first < 0 else first) > MOST_LINE_BYTES:
            raise FileProblem(path, f"has a line of more than {MOST_LINE_BYTES / 1e6:g} MB")
        open_bytes = open_bytes + len(block) if last < 0 else len(block) - last - 1
        place += len(block)


def list_rows(path: Path, most_bytes: int) -> Iterator[tuple[int, Sequence[str]]]:
    """The rows of a list that a spreadsheet or a service saved, as `table_rows`. Raises `FileProblem`."""
    text = read_text(path, most_bytes)
    try:
        yield from table_rows(text)
    except ValueError as error:
        raise FileProblem(path, str(error)) from None


def table_rows(text: str) -> Iterator[tuple[int, Sequence[str]]]:
    """The rows of a table, each with the line it ends on: separated by `,`, `;` or tabs, whichever its first line has
    most of, or by what a spreadsheet says in a line `sep=;` before it. Blank lines are left out.

    Raises `ValueError` for a quote that is never closed, which would swallow every row after it.
    """
    first, _, rest = text.partition("\n")
    separator, before = max(",;\t", key=first.count), 0
    if first.startswith("sep=") and len(first.rstrip("\r")) == len("sep=;"):
        separator, before, text = first[4], 1, rest
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                yield before + reader.line_num, row
    except csv.Error as error:
        raise ValueError(f"cannot be read as a table (line {before + reader.line_num}): {error}") from None
