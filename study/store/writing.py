"""The one thread that writes: in the order it was asked, and what waits together is committed together.

A commit waits some milliseconds for the disk, whatever is in it. The batches that came meanwhile are one transaction,
with a part for each, so that many sessions wait no longer than one does:

    asked:    A  B  C  look  D        while A was being written
    written:  A │ B C │ look │ D      each group is one transaction; nobody is answered before it is on disk
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from study.store.condition import CommitUnknown, StoreTroubled
from study.store.store import Store
from study.store.values import Batch, StoreError

MOST_TOGETHER = 64
"""Batches of one transaction: whoever comes next waits for all of it."""


Work = Batch | Callable[[Store], Any]
"""A batch to be committed, or something else to be done with the store."""


@dataclass(frozen=True)
class Written:
    """What a piece of work came to, whether it wrote, and whether that went to the file that has the name."""

    result: Any
    wrote: bool
    in_place: bool = False


@dataclass(frozen=True)
class _Piece:
    """Something asked for; `done` hears what came of it."""

    work: Work
    done: asyncio.Future[Written]


class WritingThread:
    """Does what it is given on the store. All but `close` is called from the event loop's thread."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="store")
        self._lock = threading.Lock()
        self._waiting: deque[_Piece] = deque()
        self._is_busy = False

    def do(self, work: Work) -> asyncio.Future[Written]:
        """Have a batch committed, or other work done; it is done even when nobody waits for the answer any more."""
        loop = asyncio.get_running_loop()
        piece = _Piece(work, loop.create_future())
        with self._lock:
            self._waiting.append(piece)
            if self._is_busy:
                return piece.done
            self._is_busy = True
        self._thread.submit(self._write_all, loop)
        return piece.done

    def close(self) -> None:
        """Finish what waits. Blocks."""
        self._thread.shutdown()

    # ---- on the thread

    def _write_all(self, loop: asyncio.AbstractEventLoop) -> None:
        """Until nothing waits."""
        while pieces := self._next():
            outcomes = self._outcomes(pieces)
            with contextlib.suppress(RuntimeError):  # the loop has ended meanwhile
                loop.call_soon_threadsafe(_tell, pieces, outcomes)

    def _next(self) -> list[_Piece]:
        """The batches that wait before anything else does, or that one piece of something else."""
        with self._lock:
            if not self._waiting:
                self._is_busy = False
                return []
            pieces = [self._waiting.popleft()]
            while (
                isinstance(pieces[0].work, Batch)
                and len(pieces) < MOST_TOGETHER
                and self._waiting
                and isinstance(self._waiting[0].work, Batch)
            ):
                pieces.append(self._waiting.popleft())
            return pieces

    def _outcomes(self, pieces: Sequence[_Piece]) -> Sequence[Written | BaseException]:
        batches = [piece.work for piece in pieces if isinstance(piece.work, Batch)]
        try:
            if batches:
                found = self._store.commit_all(batches)
                in_place = self._store.in_place
                return [one if isinstance(one, Exception) else Written(one, True, in_place) for one in found]
            return [self._done(piece.work) for piece in pieces]
        except BaseException as error:
            return [error] * len(pieces)

    def _done(self, work: Work) -> Written:
        before = self._store.writes
        try:
            result = done_on(self._store, work)
        except StoreTroubled as error:
            if self._store.writes > before:  # half of it is done: it must not be done again
                raise StoreError(str(error)) from error
            if isinstance(error, CommitUnknown):  # nor this: all of it may be
                raise StoreError(f"{error}; whether it was done is not known: look before it is tried again") from error
            raise
        return Written(result, self._store.writes > before)


def done_on(store: Store, work: Work) -> Any:
    """What comes of a piece of work on a store, by itself."""
    return store.commit(work) if isinstance(work, Batch) else work(store)


def _tell(pieces: Sequence[_Piece], outcomes: Sequence[Written | BaseException]) -> None:
    for piece, outcome in zip(pieces, outcomes, strict=True):
        if piece.done.done():
            continue
        if isinstance(outcome, BaseException):
            piece.done.set_exception(outcome)
            piece.done.exception()  # whoever asked may have left
        else:
            piece.done.set_result(outcome)
