"""Figures of a running lab: a session against the clock on pybullet. See tests/bench."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import itertools
import statistics
import tempfile
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urljoin

import httpx
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from app.simulated.connection import PageAccess, camera_message, enter
from tests.bench.figure import Figure
from tests.support import lab_server
from tests.support.viser_client import PROTOCOL, decoded
from tests.support.wire_client import Player, invite, stored, visit, write_study

LIVE_S = 30.0
PUSH_S = 0.7
"""How long the scripted client pushes in one direction: neither in step with the ticks nor a multiple of them."""
DIRECTIONS = ((0, 1, 0), (0, 0, 1), (0, -1, 0), (0, 0, -1))


@dataclass
class SceneBytes:
    """What a scene client received: until everything was there, and after that."""

    first: int = 0
    later: int = 0
    is_complete: bool = False


def live_figures() -> Iterator[Figure]:
    """One participant, one 3-D client, half a minute of driving."""
    with tempfile.TemporaryDirectory() as folder:
        study = write_study(Path(folder))
        with lab_server.start(Path(folder) / "data", "--robot", "bullet", "--study", str(study)) as lab:
            made = invite(lab)
            received, page_bytes, packed_bytes = asyncio.run(_drive(made["link"]))
            with stored(lab) as store:
                late_ms = [row.late_ms for row in store.rows_of("ticks", made["participant"])]
            overruns = sum(late > 50.0 for late in late_ms if late is not None)
    yield Figure(f"ticks in {LIVE_S:.0f} s (2 a second are right)", str(len(late_ms)))
    yield from _late_figures(sorted(late for late in late_ms if late is not None))
    yield Figure("ticks more than 50 ms late", str(overruns))
    yield Figure("scene, until everything is shown", f"{received.first / 1e6:.2f} MB", "1 MB or less")
    yield Figure("scene, while driving", f"{received.later / LIVE_S / 1e3:.0f} kB/s")
    yield Figure("3-D client's page", f"{page_bytes / 1e6:.1f} MB")
    yield Figure("3-D client's page as sent (gzip)", f"{packed_bytes / 1e6:.2f} MB")


def _late_figures(late_ms: Sequence[float]) -> Iterator[Figure]:
    cuts = statistics.quantiles(late_ms, n=100, method="inclusive")
    yield Figure("tick-start error p50, p99", f"{cuts[49]:.2f}, {cuts[98]:.2f} ms")
    yield Figure("tick-start error, largest", f"{late_ms[-1]:.2f} ms")


async def _drive(link: str) -> tuple[SceneBytes, int, int]:
    """Drive to and fro with the scene open; what it cost, the page's size, and its size as sent."""
    async with visit(link) as player:
        await player.reach("trial_ready")
        await player.status("ready")
        access = await enter(link)  # the same key as the socket's: it takes nothing over
        page_bytes, packed_bytes = await _page_bytes(access)
        async with _watching(access) as received:
            await player._submit("start", {}, None)
            await player.page("trial")
            await player.status("running")
            hearing = asyncio.create_task(_hear(player))
            ends_s = time.monotonic() + LIVE_S
            for direction in itertools.cycle(DIRECTIONS):
                if time.monotonic() >= ends_s:
                    break
                await player.hands(direction)
                async with player.beating(direction):
                    await asyncio.sleep(PUSH_S)
            hearing.cancel()
    return received, page_bytes, packed_bytes


async def _hear(player: Player) -> None:
    with contextlib.suppress(asyncio.CancelledError):
        while True:
            await player.wire.receive_raw()


async def _page_bytes(access: PageAccess) -> tuple[int, int]:
    headers = {"Cookie": access.cookie, "Accept-Encoding": "gzip"}
    async with (
        httpx.AsyncClient(trust_env=False, timeout=30.0) as client,
        client.stream("GET", urljoin(access.page_url, "scene/"), headers=headers) as response,
    ):
        packed = b"".join([part async for part in response.aiter_raw()])
    return len(gzip.decompress(packed)), len(packed)


@contextlib.asynccontextmanager
async def _watching(access: PageAccess) -> AsyncIterator[SceneBytes]:
    """A 3-D client that counts; entered when it has everything."""
    received = SceneBytes()
    url = urljoin(access.socket_url, "scene")
    headers = {"Cookie": access.cookie}
    protocols = [Subprotocol(PROTOCOL)]
    async with connect(url, additional_headers=headers, subprotocols=protocols, max_size=None, proxy=None) as socket:
        await socket.send(camera_message())
        while not received.is_complete:
            frame = await asyncio.wait_for(socket.recv(), 30.0)
            assert isinstance(frame, bytes)
            received.first += len(frame)
            received.is_complete = any(message["type"] == "ReplayDoneMessage" for message in decoded(frame))
        counting = asyncio.create_task(_count(socket, received))
        yield received
        counting.cancel()


async def _count(socket: ClientConnection, received: SceneBytes) -> None:
    with contextlib.suppress(asyncio.CancelledError):
        while True:
            received.later += len(await socket.recv())
