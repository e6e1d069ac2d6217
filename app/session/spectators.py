"""The experimenters who look at a session in 3-D: the first of them asks for its second view, the last gives it up."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from app.session.worker_link import WorkerLink
from app.worker.messages import Spectate

OPENS_WITHIN_S = 10.0
LINGERS_S = 5.0
"""After the last has left the view stays so long: a page that is reloaded finds it again."""


class Spectators:
    """Those of one session. `link` is the line to its worker, whichever that is."""

    def __init__(self, link: WorkerLink, lingers_s: float = LINGERS_S) -> None:
        self._link = link
        self._lingers_s = lingers_s
        self._count = 0
        self._changed = asyncio.Event()
        self._closing: asyncio.TimerHandle | None = None

    @property
    def count(self) -> int:
        """How many look on."""
        return self._count

    @contextlib.asynccontextmanager
    async def look(self) -> AsyncIterator[int | None]:
        """Look on for as long as the block runs: the port of the view on loopback, None when there is none now."""
        self._count += 1
        if self._closing is not None:
            self._closing.cancel()
            self._closing = None
        try:
            yield await self._port()
        finally:
            self._count -= 1
            if not self._count:
                self._closing = asyncio.get_running_loop().call_later(self._lingers_s, self._give_up)

    def told(self, port: int | None) -> None:
        """The worker has opened or closed the view."""
        self._link.spectator_port = port
        self._changed.set()

    def end(self) -> None:
        """The session is closed."""
        if self._closing is not None:
            self._closing.cancel()

    async def _port(self) -> int | None:
        if self._link.spectator_port is None and self._link.ready:
            self._changed.clear()
            self._link.send(Spectate(True))
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._changed.wait(), OPENS_WITHIN_S)
        return self._link.spectator_port

    def _give_up(self) -> None:
        self._closing = None
        self._link.send(Spectate(False))
