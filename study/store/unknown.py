"""Batches of which nobody knows whether they are on disk: the server was lost between being asked and answering.

They come again, as all that must be kept does. Then the ends of their chains are looked for, under the lock that their
transaction held, so that it has ended one way or the other: a batch that is there is answered, and not written twice.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from study.integrity.chain import Head
from study.store import ledger
from study.store.condition import CommitUnknown
from study.store.database import Database
from study.store.values import Batch

Answer = bool | Exception


@dataclass
class _Asked:
    """One transaction: its batches, what each would have been answered, the ends of chains; whether it is written."""

    answers: list[tuple[Batch, Answer]]
    heads: Mapping[str, Head]
    is_written: bool = False


class Unknown:
    """Those of one store."""

    def __init__(self) -> None:
        self._asked: list[_Asked] = []
        self._lock = threading.Lock()

    @contextmanager
    def noting(self, batches: Sequence[Batch], answers: Callable[[], Sequence[Answer]]) -> Iterator[None]:
        """Note the batches of a transaction of which it is not known."""
        try:
            yield
        except CommitUnknown as error:
            with self._lock:
                self._asked.append(_Asked(list(zip(batches, answers(), strict=True)), error.heads))
            raise

    def concerns(self, batches: Sequence[Batch]) -> bool:
        """Whether one of these is among them."""
        return bool(self._asked) and any(self._of(batch) is not None for batch in batches)

    def answer(self, database: Database, batch: Batch) -> bool | None:
        """What a batch is answered that is on disk; None for any other. Raises what its transaction would have."""
        asked = self._of(batch) if self._asked else None
        if asked is None:
            return None
        if not asked.is_written:
            with database.transaction() as connection:
                asked.is_written = ledger.has_one_of(connection, asked.heads)
        found = next(answer for one, answer in asked.answers if one is batch)
        with self._lock:
            asked.answers = [pair for pair in asked.answers if pair[0] is not batch] if asked.is_written else []
            self._asked = [one for one in self._asked if one.answers]
        if not asked.is_written:
            return None
        if isinstance(found, Exception):
            raise found
        return found

    def _of(self, batch: Batch) -> _Asked | None:
        return next((one for one in self._asked if any(each is batch for each, _ in one.answers)), None)
