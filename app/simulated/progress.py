"""What long commands show while they run, on stderr, so that results can be piped away."""

from __future__ import annotations

import io
import sys
from shutil import get_terminal_size
from typing import TYPE_CHECKING, NoReturn

from tqdm import tqdm

if TYPE_CHECKING:
    Bar = tqdm[NoReturn]  # nothing is iterated over
else:
    Bar = tqdm

LOOK = "{desc}: {n_fmt}/{total_fmt} |{bar}| {elapsed}, about {remaining} left"
MAX_COLUMNS = 78
WATCHED_EVERY_S = 0.1
QUIET_EVERY_S = 20.0


def progress(what: str, total: int, done: int = 0) -> Bar:
    """A bar that counts `total` things, `done` of them before, which do not count for the time left.

    On a terminal it is one line that is rewritten. Where nobody watches it is a line now and then, and one at the end.
    """
    is_watched = sys.stderr.isatty()
    columns, rows = get_terminal_size()  # the library itself shows nothing on terminals that do not know their size
    return (_Bar if is_watched else _Lines)(
        desc=what,
        total=total,
        initial=done,
        smoothing=0,  # the mean of all since the start, not of the last few
        miniters=1,
        mininterval=WATCHED_EVERY_S if is_watched else QUIET_EVERY_S,
        bar_format=LOOK,
        ncols=min(columns, MAX_COLUMNS),
        nrows=rows,
        ascii=" #",
        file=sys.stderr if is_watched else io.StringIO(),  # `_Lines` writes by itself
    )


class _Bar(Bar):
    monitor_interval = 0  # no thread of its own, so that other processes can be started


class _Lines(_Bar):
    """For logs and pipes: nothing is rewritten, and nothing said before something is done."""

    _said: float | None = None

    def display(self, msg: str | None = None, pos: int | None = None) -> None:
        """Write a line, unless it would be the last one again."""
        if self.n not in (self.initial, self._said):
            self._said = self.n
            print(self, file=sys.stderr, flush=True)
