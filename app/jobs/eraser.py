"""Somebody is erased in a process of its own."""

from __future__ import annotations

import asyncio
from pathlib import Path

from app.errors import LabError
from app.jobs.process import JobLost, run_job
from study.store import AsyncStore, DataPlace, StoreTroubled, place_of


async def erase(store: AsyncStore, data: DataPlace | Path, participant: str, utc: str) -> bool | None:
    """Delete everything about a participant, who has no live session, but the mark; as `Store.erase`.

    What has begun goes on when whoever asked is gone. Raises `StoreTroubled` while the disk does not do, and `LabError`
    with the reason when nothing was deleted.
    """
    # What the lab has asked to be written before is written first: afterwards it would belong to nobody.
    await store.run(lambda opened: None)
    place = place_of(data)
    folder = str(await asyncio.to_thread(place.folder.resolve))
    return await asyncio.shield(
        asyncio.create_task(_erase(store, participant, (folder, participant, utc), place), name="erase")
    )


async def _erase(store: AsyncStore, participant: str, arguments: tuple[str, str, str], place: DataPlace) -> bool | None:
    try:
        end = await run_job("app.jobs.erase_job", arguments, lambda step: None, place.environment)
    except JobLost as lost:
        if await store.read(lambda opened: participant in dict(opened.erasures())):
            return None if place.url else False  # it was done; a file's log is emptied at the next erasure
        raise LabError(f"{participant} is not erased: the {lost}. Nothing was deleted; try again") from None
    if "trouble" in end:
        raise StoreTroubled(end["trouble"], end["cannot"])
    if "cannot" in end:
        raise LabError(f"{participant} is not erased: {end['cannot']}")
    overwritten: bool | None = end["made"]["overwritten"]
    return overwritten
