"""What a command says: to a terminal that lacks letters, to a pipe that nobody reads any more, or to nobody at all.

No console stops a running lab, and no name of a file or title breaks the line that it stands in.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import unicodedata

LONGEST_LINE = 2_000
"""Of what is wrong with a file: a cell or a name in it may be as long as the file."""
GONE = 1
"""Exit status when the reader of a pipe has left, as in `salab check my-study.toml | head -1`."""


def prepare() -> None:
    """See to it that printing a letter cannot fail, and that no file that is opened later becomes the console."""
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:  # started with `>&-`: the next file opened would get its number, and what libraries print
            os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def shown(text: str) -> str:
    """A text as it may stand in a line: line ends, and what steers a terminal, as escapes."""
    return "".join(sign if _stays(sign) else sign.encode("unicode_escape").decode("ascii") for sign in text)


def _stays(sign: str) -> bool:
    return sign.isprintable() or unicodedata.category(sign) == "Zs"


def announce(text: str) -> None:
    """Say something that nobody may be there to read. What cannot be said is not."""
    try:
        print(text, flush=True)
    except (OSError, ValueError):  # the pipe's reader has left, the disk behind it is full, or it was closed
        hush()


def complain(error: Exception) -> None:
    """Say on stderr what is wrong, each problem in a line of its own."""
    problems = getattr(error, "problems", None) or (str(error),)
    for number, problem in enumerate(problems):
        with contextlib.suppress(OSError, ValueError):
            print(f"{'' if number else 'salab: '}{_short(shown(problem))}", file=sys.stderr)


def _short(line: str) -> str:
    return line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 1]}…"


def of_system(error: OSError) -> str:
    """An error of the operating system in a line."""
    names = [os.fspath(name) for name in (error.filename, error.filename2) if isinstance(name, (str, bytes))]
    place = " to ".join(os.fsdecode(name) for name in names)
    said = error.strerror or str(error) or type(error).__name__
    return f"{place}: {said}" if place else said


def flush() -> None:
    """Get out what was printed; raises `OSError` when it cannot be."""
    if sys.stdout is not None:
        sys.stdout.flush()


def hush() -> None:
    """Print nowhere from now on: whatever else is said must not fail once more, at the end of the process either."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
