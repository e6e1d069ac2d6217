"""A store for asyncio code: one thread does all the writing, in the order it was asked (`study.store.writing`).

When the disk does not do (full, locked, gone, …) that is a state and not only an error: `trouble` says what is wrong
and since when, listeners are told at once, and what must be kept is tried again until it is on disk.

    run(work)       for whoever can be refused: tries for a moment, then raises `StoreTroubled`
    keep(work)      for what has happened and must not be lost: returns when it is on disk, however long that takes
    commit(batch)   the same for a batch, which is committed together with what else waits
    find(work)      looks something up, however long that takes
    read(work)      looks something up, or raises
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, TypeVar

from study.store.condition import WHAT_TO_DO, StoreTroubled, Trouble, TroubleKind
from study.store.store import Store, open_store
from study.store.values import Batch
from study.store.writing import Work, WritingThread, Written, done_on

log = logging.getLogger(__name__)

Result = TypeVar("Result")
Listener = Callable[["Trouble | None"], None]

PATIENCE_S = 1.0
"""How long `run` tries."""
SLOW_AFTER_S = 0.7
"""What has waited so long for the disk is a trouble, though nothing has failed."""
RETRIES_S = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Pauses between tries; the last one goes on."""
LOOK_EVERY_S = 0.5
"""How often the files are looked for, whether or not anything is written."""
READ_BACK_EVERY_S = 1.0
"""How often what was written is read back from the disk."""
TRY_EVERY_S = 5.0
"""How often something is written while nobody has anything to write; every second while that does not work."""
RESCUE_EVERY_S = 10.0
"""How often a place for a rescue copy is looked for, until there is one."""
READERS = 4


class AsyncStore:
    """Runs what it is given on the store, off the event loop. All of it is called from the event loop's thread.

    What was asked for is done even when the one who asked is cancelled: a closed browser must not undo a write that
    is on its way.

    Attributes:
        store: the store itself, for reading from other threads.
        trouble: why nothing can be written now; None while all is well.
        last_write_s: how long the last try at something that writes took, in seconds.
        now_s: its clock, which only goes forward.
    """

    def __init__(
        self,
        store: Store,
        now_s: Callable[[], float] = time.monotonic,
        now_unix_s: Callable[[], float] = time.time,
    ) -> None:
        self.store = store
        self.trouble: Trouble | None = None
        self.last_write_s = 0.0
        self.now_s = now_s
        self._now_unix_s = now_unix_s
        self._thread = WritingThread(store)
        self._readers = ThreadPoolExecutor(max_workers=READERS, thread_name_prefix="store reader")
        self._listeners: list[Listener] = []
        self._waiting: dict[int, float] = {}
        self._kept: dict[int, Work] = {}
        self._rescued: set[int] = set()
        self._numbers = 0
        self._damage: StoreTroubled | None = None
        self._wrote_s = -math.inf
        self._rescue_tried_s = -math.inf
        self._rescuing: asyncio.Task[None] | None = None
        self._watching: asyncio.Task[None] | None = None

    # ---- what is asked of it ------------------------------------------------------------------------------------

    async def run(self, work: Callable[[Store], Result]) -> Result:
        """`await run(lambda store: store.commit(...))`; on disk when it returns, errors as the store raises them.

        Raises `StoreTroubled` when the disk has not done for `PATIENCE_S`.
        """
        result: Result = await self._until(work, self.now_s() + PATIENCE_S)
        return result

    async def keep(self, work: Callable[[Store], Result]) -> Result:
        """As `run`, and not given up while the disk does not do. It holds one write at most: a second one would be
        done again when what follows it fails."""
        kept: Result = await self._keep(work)
        return kept

    async def commit(self, batch: Batch) -> bool:
        """As `keep` with `Store.commit`: what other batches wait for, it waits for together with them."""
        is_new: bool = await self._keep(batch)
        return is_new

    async def read(self, work: Callable[[Store], Result]) -> Result:
        """Look something up without waiting for what is being written."""
        return await asyncio.get_running_loop().run_in_executor(self._readers, work, self.store)

    async def find(self, work: Callable[[Store], Result]) -> Result:
        """As `read`, and not given up while the disk does not do."""
        for pause_s in _pauses_s():
            try:
                return await self.read(work)
            except StoreTroubled as error:
                self._troubled(error.kind, str(error))
            await asyncio.sleep(pause_s)
        raise AssertionError("the pauses have no end")

    @property
    def waiting(self) -> int:
        """How much waits for the disk."""
        return len(self._waiting)

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Have `listener(trouble)` called whenever the trouble changes; returns what ends that. It must not block."""
        self._listeners.append(listener)

        def unlisten() -> None:
            with contextlib.suppress(ValueError):  # twice is once
                self._listeners.remove(listener)

        return unlisten

    def watch(self) -> None:
        """Begin to look by itself whether the files are there and can be written. `close` ends it."""
        self._watching = asyncio.create_task(self._look(), name="store watch")

    async def close(self) -> None:
        """Finish what is waiting, then close the store."""
        for task in (self._watching, self._rescuing):
            if task is not None and task is not asyncio.current_task():
                if task is self._watching:
                    task.cancel()
                await asyncio.gather(task, return_exceptions=True)
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(None, self._thread.close)
        await loop.run_in_executor(None, self._readers.shutdown)
        self.store.close()

    # ---- one try after the other --------------------------------------------------------------------------------

    async def _keep(self, work: Work) -> Any:
        self._numbers += 1
        number = self._numbers
        self._kept[number] = work
        try:
            return await self._until(work, math.inf, number)
        finally:
            self._kept.pop(number, None)
            self._rescued.discard(number)

    async def _until(self, work: Work, give_up_s: float, number: int = 0) -> Any:
        """The result of the first try that the disk did; `number` is that of what is kept."""
        done: Written | None = None
        for pause_s in _pauses_s():
            try:
                if done is None:
                    done = await self._attempt(work)
                    self._kept.pop(number, None)  # it stands in what is open, wherever that is now
                self._prove(done)
                return done.result
            except StoreTroubled as error:
                self._troubled(error.kind, str(error))
                if self.now_s() + pause_s > give_up_s:
                    raise
                done = replace(done, in_place=False) if done is not None else None
            await asyncio.sleep(pause_s)
        raise AssertionError("the pauses have no end")

    async def _attempt(self, work: Work) -> Written:
        """Try once, and notice when that takes long."""
        loop = asyncio.get_running_loop()
        self._numbers += 1
        number = self._numbers
        self._waiting[number] = began_s = self.now_s()
        timer = loop.call_later(SLOW_AFTER_S, self._is_slow, number)
        try:
            written = await asyncio.shield(self._thread.do(work))
        finally:
            timer.cancel()
            del self._waiting[number]
        if written.wrote:
            self.last_write_s = self.now_s() - began_s
        elif self.trouble is not None and self.trouble.kind == "slow" and not self._overdue():
            self._well()
        return written

    def _prove(self, done: Written) -> None:
        """Written, and to the file that has the name. Raises `StoreTroubled`."""
        if not done.wrote:
            return
        if not (done.in_place or self.store.in_place):
            raise StoreTroubled("gone", f"{self.store.name}: {WHAT_TO_DO['gone']}")
        if self._damage is not None:
            raise self._damage
        self._wrote_s = self.now_s()
        if self.trouble is not None and not self._overdue():
            self._well()

    # ---- its condition ------------------------------------------------------------------------------------------

    def _overdue(self) -> bool:
        return any(self.now_s() - since_s >= SLOW_AFTER_S for since_s in self._waiting.values())

    def _is_slow(self, number: int) -> None:
        if number in self._waiting and self.trouble is None:
            self._troubled("slow", f"{self.store.name}: a write takes longer than {SLOW_AFTER_S:g} s")

    def _troubled(self, kind: TroubleKind, text: str) -> None:
        before = self.trouble
        if before is None:
            log.error("the lab cannot save: %s %s", WHAT_TO_DO[kind], text)
            self._tell(Trouble(kind, text, self.now_s(), self._now_unix_s()))
        elif before.kind != kind or before.text != text:
            if before.kind != kind:
                log.error("the lab still cannot save: %s %s", WHAT_TO_DO[kind], text)
            self._tell(replace(before, kind=kind, text=text))
        if kind == "gone":
            self._rescue_soon()

    def _well(self) -> None:
        trouble = self.trouble
        assert trouble is not None
        log.warning("the lab saves again, after %.1f s", self.now_s() - trouble.since_s)
        if trouble.rescue is not None:
            log.warning("the data folder is back; the rescue copy %s is not needed any more", trouble.rescue)
        self._rescue_tried_s = -math.inf
        self._rescued.clear()
        self._tell(None)

    def _tell(self, trouble: Trouble | None) -> None:
        self.trouble = trouble
        for listener in tuple(self._listeners):
            try:
                listener(trouble)
            except Exception:
                log.exception("somebody could not be told that the lab %s", "cannot save" if trouble else "saves again")

    async def _look(self) -> None:
        """Look whether the files are there and can be written while nobody has anything to write."""
        tried_s = read_s = self.now_s()
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            now_s = self.now_s()
            if now_s - read_s >= READ_BACK_EVERY_S and self.store.in_place:
                read_s = now_s
                await self._read_back()
            if not self.store.in_place:
                self._troubled("gone", f"{self.store.name}: {WHAT_TO_DO['gone']}")
            elif self._kept or self._waiting:
                continue  # whoever waits finds out
            elif now_s - max(tried_s, self._wrote_s) >= (TRY_EVERY_S if self.trouble is None else 2 * LOOK_EVERY_S):
                tried_s = now_s
                try:
                    self._prove(await self._attempt(lambda store: store.try_to_write()))
                except StoreTroubled as error:
                    self._troubled(error.kind, str(error))
                except Exception:
                    log.exception("whether the lab can save could not be told")

    async def _read_back(self) -> None:
        """Damage is a trouble until what is there can be read again: writing may go on as if nothing was."""
        try:
            await self.read(lambda store: store.read_back())
        except StoreTroubled as error:
            if error.kind == "corrupt":
                self._damage = error
                self._troubled(error.kind, str(error))
        except Exception:
            log.exception("what was written could not be read back")
        else:
            self._damage = None

    # ---- a database that is gone --------------------------------------------------------------------------------

    def _rescue_soon(self) -> None:
        """Copy what is open, and what waits to be written, unless that was done or tried a moment ago."""
        trouble = self.trouble
        if trouble is None or (self._rescuing is not None and not self._rescuing.done()):
            return
        is_due = trouble.rescue is None and self.now_s() - self._rescue_tried_s >= RESCUE_EVERY_S
        if is_due or (trouble.rescue is not None and self._kept.keys() - self._rescued):
            self._rescue_tried_s = self.now_s()
            self._rescuing = asyncio.create_task(self._rescue(trouble.rescue), name="store rescue")

    async def _rescue(self, folder: Path | None) -> None:
        works = {number: work for number, work in self._kept.items() if number not in self._rescued}
        self._rescued |= works.keys()
        try:
            copied = await self._thread.do(lambda store: self._copy_out(folder, tuple(works.values())))
        except Exception as error:
            self._rescued -= works.keys()
            log.error("what the lab holds could not be copied: %s", error)
            return
        if self.trouble is not None and self.trouble.rescue is None:
            log.error("all that the lab has recorded was copied to %s; a lab can be started on it", copied.result)
            self._tell(replace(self.trouble, rescue=copied.result))

    def _copy_out(self, folder: Path | None, works: tuple[Work, ...]) -> Path:
        """On the thread that writes: the copy, made now or before, and in it what the disk has not taken."""
        if folder is None:
            folder = self.store.rescue(datetime.now(timezone.utc).isoformat())
        with open_store(folder, must_exist=False, flow=self.store.flow) as copy:
            for work in works:
                try:
                    done_on(copy, work)
                except Exception:
                    log.exception("something that was waiting could not be written to %s", folder)
        return folder


def _pauses_s() -> Iterator[float]:
    yield from RETRIES_S
    while True:
        yield RETRIES_S[-1]
