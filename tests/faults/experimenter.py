"""What an experimenter sees meanwhile: the dashboard's socket, and the health route that an operator's watch asks."""

from __future__ import annotations

import asyncio
import json
import time
from typing import Any

import httpx
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidMessage

from tests.faults.memory import Seen
from tests.support.lab_server import EXPERIMENTER_TOKEN

HEALTH_EVERY_S = 0.25
HEALTH_WITHIN_S = 2.0
RETRY_S = 0.4


class Experimenter:
    """One dashboard that watches one participant, and comes back when it is cut off.

    `seen` has lines (kind "line", `data` as the dashboard got it), events of the watched participant (kind "event",
    named after the event), what is said of the lab's saving (kind "trouble", named after what is wrong), answers of the
    health route when they change (kind "health", named after the status), and "lost" for a lab that cannot be reached.
    """

    def __init__(self, address: str, participant: str) -> None:
        self.address = address
        self.participant = participant
        self.seen: list[Seen] = []
        self.line: dict[str, Any] = {}
        self.trouble: dict[str, Any] | None = None
        self._tasks: tuple[asyncio.Task[None], ...] = ()
        self._changed = asyncio.Event()

    def begin(self) -> None:
        """Open the dashboard."""
        self._tasks = (asyncio.create_task(self._watch()), asyncio.create_task(self._ask_health()))

    async def end(self) -> None:
        """Close it."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _see(self, kind: str, name: str, text: str = "", data: Any = None) -> None:
        self.seen.append(Seen(time.monotonic(), kind, name, text, data))
        self._changed.set()

    # ---- the dashboard ----------------------------------------------------------------------------------------------

    async def _watch(self) -> None:
        is_lost = False
        while True:
            try:
                opening = connect(
                    f"ws://{self.address}/dashboard/socket",
                    proxy=None,
                    max_size=None,
                    ping_interval=None,
                    close_timeout=1,
                )
                async with opening as wire:
                    is_lost = False
                    await wire.send(json.dumps({"type": "hello", "token": EXPERIMENTER_TOKEN}))
                    await wire.send(json.dumps({"type": "watch", "participant": self.participant}))
                    while True:
                        self._hear(json.loads(await wire.recv()))
            except (OSError, InvalidHandshake, InvalidMessage, ConnectionClosed, asyncio.TimeoutError, EOFError):
                if not is_lost:
                    self._see("lost", "dashboard")
                is_lost = True
            await asyncio.sleep(RETRY_S)

    def _hear(self, message: dict[str, Any]) -> None:
        if message["type"] == "overview":
            trouble = message.get("trouble")
            if trouble != self.trouble:
                self._see(
                    "trouble", trouble["kind"] if trouble else "none", trouble["text"] if trouble else "", trouble
                )
            self.trouble = trouble
            for line in message["sessions"]:
                if line["participant"] == self.participant:
                    self.line = line
                    self._see("line", line["state"], line.get("pause_reason") or "", line)
        elif message["type"] == "watched" and not message["since_start"]:
            for event in message["events"]:
                self._see("event", event["kind"], "", event)
        elif message["type"] not in ("watched", "error"):
            self._see("told", message["type"], "", message)

    # ---- an operator's watch -----------------------------------------------------------------------------------------

    async def _ask_health(self) -> None:
        last = ""
        async with httpx.AsyncClient(trust_env=False, timeout=HEALTH_WITHIN_S) as client:
            while True:
                text = ""
                try:
                    answer = await client.get(f"http://{self.address}/api/health")
                    now, text = str(answer.status_code), answer.text[:200]
                except (httpx.HTTPError, OSError):
                    now = "silent"
                if now != last:
                    self._see("health", now, text)
                last = now
                await asyncio.sleep(HEALTH_EVERY_S)
