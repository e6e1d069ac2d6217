"""Run as a process of its own by tests of the store: writes ticks for ever and prints each one that is on disk.

python -m tests.support.store_writer FOLDER WHO          one after the other
python -m tests.support.store_writer FOLDER WHO WHO …    of several people at once, as a lab does: `WHO NUMBER`
"""

from __future__ import annotations

import asyncio
import itertools
import sys

from study.store import AsyncStore, Batch, handed_over, open_store
from tests.support.study_samples import append_tick, tick_row


def alone(folder: str, who: str) -> None:
    """Ticks of one person."""
    with open_store(handed_over(folder), exclusive=True) as store:
        for number in itertools.count():
            append_tick(store, tick_row(who, tick=number))
            print(number, flush=True)


async def together(folder: str, *people: str) -> None:
    """Ticks of several people, each of whom waits for their own."""
    store = AsyncStore(open_store(handed_over(folder), exclusive=True))

    async def drive(who: str) -> None:
        for number in itertools.count():
            await store.commit(Batch(ticks=(tick_row(who, tick=number),)))
            print(who, number, flush=True)

    await asyncio.gather(*map(drive, people))


if __name__ == "__main__":
    if len(sys.argv) > 3:
        asyncio.run(together(*sys.argv[1:]))
    else:
        alone(*sys.argv[1:])
