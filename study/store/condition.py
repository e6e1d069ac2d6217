"""What the disk can do to a store, told apart by what somebody would do about it.

A write that the disk does not take is no mistake of whoever asked for it: the same may work in a moment. Such errors
are `StoreTroubled`; `AsyncStore` tries again and makes of them a state that others can see (`Trouble`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from study.integrity.chain import Head
from study.store.values import StoreError

TroubleKind = Literal["full", "locked", "read_only", "io", "corrupt", "gone", "slow", "unreachable"]
"""The disk is full; another program holds the database; it may only be read; the disk fails; the file is damaged; the
file is not where it was opened; a write takes long; the server of the database does not answer."""

WHAT_TO_DO: Mapping[TroubleKind, str] = {
    "full": "The disk is full: make room on it.",
    "locked": "Another program keeps the database locked: end it.",
    "read_only": "The data folder can only be read: make it writable again.",
    "io": "The disk reports errors: look at the system's log.",
    "corrupt": "The database is damaged: stop the lab and go back to a backup.",
    "gone": "The data folder was moved, deleted or replaced: put it back where it was.",
    "slow": "The disk takes long to write: look for what else is writing to it.",
    "unreachable": "The database server does not answer: look whether it runs, and whether this machine reaches it.",
}
"""What is wrong and what helps, for the experimenter."""

_SAID: tuple[tuple[str, TroubleKind], ...] = (
    ("disk is full", "full"),
    ("is locked", "locked"),
    ("locking protocol", "locked"),
    ("readonly database", "read_only"),
    ("disk i/o error", "io"),
    ("unable to open database file", "io"),
    ("malformed", "corrupt"),
    ("file is not a database", "corrupt"),
)
"""What SQLite says, and which trouble that is. Python 3.10 knows no other names of errors."""


class StoreTroubled(StoreError):
    """The disk did not do what was asked, of which nothing is left; it may do it later."""

    def __init__(self, kind: TroubleKind, text: str) -> None:
        self.kind = kind
        super().__init__(text)


class CommitUnknown(StoreTroubled):
    """The server was lost while it committed: whether all of it is on disk, or nothing, is told by these ends of
    chains, which are there or are not."""

    def __init__(self, kind: TroubleKind, text: str, heads: Mapping[str, Head]) -> None:
        self.heads = heads
        super().__init__(kind, text)


@dataclass(frozen=True)
class Trouble:
    """That the store cannot write: why, since when, and the words of the last error.

    `since_s` is monotonic. `rescue` is the copy that was made of a database that is gone, once it stands.
    """

    kind: TroubleKind
    text: str
    since_s: float
    since_unix_s: float
    rescue: Path | None = None


def kind_of(error: str) -> TroubleKind | None:
    """Which trouble an error of SQLite is; None for a mistake of ours, which stays one however often it is tried."""
    said = error.lower()
    return next((kind for part, kind in _SAID if part in said), None)
