"""A store for asyncio code: one thread does all the writing, in the order it was asked."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from study.store.store import Store

Result = TypeVar("Result")


class AsyncStore:
    """Runs what it is given on the store, one after the other, off the event loop.

    What was asked for is done even when the one who asked is cancelled: a closed browser must not undo a write that
    is on its way.
    """

    def __init__(self, store: Store) -> None:
        self.store = store
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="store")

    async def run(self, work: Callable[[Store], Result]) -> Result:
        """`await run(lambda store: store.commit(...))`; on disk when it returns, errors as the store raises them."""
        return await asyncio.shield(asyncio.get_running_loop().run_in_executor(self._thread, work, self.store))

    async def close(self) -> None:
        """Finish what is waiting, then close the store."""
        await asyncio.get_running_loop().run_in_executor(None, self._thread.shutdown)
        self.store.close()
