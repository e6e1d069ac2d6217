"""A dashboard's socket, as tests use it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable
from typing import Any

from websockets.asyncio.client import ClientConnection, connect

from tests.support.lab_server import LabServer
from tests.support.wire_client import MESSAGE_WITHIN_S, UNTIL_WITHIN_S

Line = dict[str, Any]


class Dashboard:
    """One dashboard's socket: what it was told, one message at a time."""

    def __init__(self, wire: ClientConnection) -> None:
        self.wire = wire
        self.lines: dict[str, Line] = {}
        self.lab: Line = {}

    async def next(self) -> Line:
        message: Line = json.loads(await asyncio.wait_for(self.wire.recv(), MESSAGE_WITHIN_S))
        if message["type"] == "overview":
            self.lab = {name: message[name] for name in ("trouble", "crowding")}
            self.lines |= {line["participant"]: line for line in message["sessions"]}
        return message

    async def line(self, participant: str, where: Callable[[Line], bool] = lambda line: True) -> Line:
        """Listen until the participant's line is like this."""
        ends_s = time.monotonic() + UNTIL_WITHIN_S
        while participant not in self.lines or not where(self.lines[participant]):
            assert time.monotonic() < ends_s, f"{participant} is not so after {UNTIL_WITHIN_S:g} s: {self.lines}"
            await self.next()
        return self.lines[participant]

    async def watch(self, participant: str | None) -> None:
        await self.wire.send(json.dumps({"type": "watch", "participant": participant}))

    async def news(self, where: Callable[[Line], bool] = lambda message: True) -> Line:
        """Listen until something about the opened session arrives that is like this."""
        ends_s, others = time.monotonic() + UNTIL_WITHIN_S, []
        while time.monotonic() < ends_s:
            message = await self.next()
            if message["type"] == "watched" and where(message):
                return message
            others.append(message)
        raise AssertionError(f"no such news within {UNTIL_WITHIN_S:g} s; these came: {others[:3]} ... {others[-3:]}")


def socket_url(lab: LabServer) -> str:
    return lab.base_url.replace("http", "ws", 1) + "/dashboard/socket"


@contextlib.asynccontextmanager
async def dashboard(lab: LabServer) -> AsyncIterator[Dashboard]:
    async with connect(socket_url(lab), proxy=None, max_size=None) as wire:
        await wire.send(json.dumps({"type": "hello", "token": lab.experimenter_token}))
        yield Dashboard(wire)
