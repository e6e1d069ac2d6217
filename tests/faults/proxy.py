"""A network that is bad on purpose: a TCP proxy on loopback that delays, loses and cuts.

An application sees no packets, so a loss is what TCP makes of it: nobody misses a byte, but what was lost comes a
retransmission later, and everything behind it waits for it. Here every piece of at most `SEGMENT_BYTES` is lost with
the probability `loss`, again with every try; each try costs a retransmission time-out, which begins at
`FIRST_TIMEOUT_S` beyond the round trip and doubles. (The small messages of a page are too far apart for the faster
repair by repeated acknowledgements.)

A cut loses everything in both directions until it ends; what was said meanwhile comes after it, in order, as TCP keeps
it, the end of a connection too. Connections that begin in a cut wait for its end.
"""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import dataclass

import numpy as np

SEGMENT_BYTES = 1448
FIRST_TIMEOUT_S = 0.2
"""What a usual kernel adds to the round trip at least, before it sends once more."""


@dataclass(frozen=True)
class Line:
    """How one way of the network is. `delay_s` is drawn for each piece, evenly within `jitter_s` of it."""

    delay_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0

    def passage_s(self, rng: np.random.Generator) -> float:
        """How long one piece takes, in seconds."""
        passage_s = max(0.0, self.delay_s + self.jitter_s * float(rng.uniform(-1.0, 1.0)))
        timeout_s = FIRST_TIMEOUT_S + 2.0 * self.delay_s
        while rng.random() < self.loss:
            passage_s += timeout_s
            timeout_s *= 2.0
        return passage_s


GOOD = Line()


class BadNetwork:
    """Stands before one lab; `address` is where clients go. `line` and `cut` take effect at once, on all of them."""

    def __init__(self, host: str, port: int, seed: int = 1) -> None:
        self.line = GOOD
        self.lost = 0
        """Pieces that had to be sent again so far."""
        self._target = (host, port)
        self._rng = np.random.default_rng(seed)
        self._is_up = asyncio.Event()
        self._is_up.set()
        self._server: asyncio.Server | None = None
        self._serving: set[asyncio.Task[None]] = set()

    @property
    def address(self) -> str:
        """Host and port."""
        assert self._server is not None
        host, port = self._server.sockets[0].getsockname()[:2]
        return f"{host}:{port}"

    async def open(self) -> None:
        """Listen."""
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)

    async def close(self) -> None:
        """End every connection."""
        self._is_up.set()
        if self._server is not None:
            self._server.close()
        for task in self._serving:
            task.cancel()
        await asyncio.gather(*self._serving, return_exceptions=True)

    def cut(self) -> None:
        """Nothing passes any more."""
        self._is_up.clear()

    def mend(self) -> None:
        """Everything passes again, what waited first."""
        self._is_up.set()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._serving.add(task)  # the loop itself holds tasks only weakly
        try:
            await self._is_up.wait()
            there, back = await asyncio.open_connection(*self._target)
            ways = [asyncio.create_task(self._pass(reader, back)), asyncio.create_task(self._pass(there, writer))]
            try:
                await asyncio.gather(*ways)
            finally:
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
                back.transport.abort()
        except (OSError, asyncio.CancelledError):
            pass  # one side has gone, or this network is closed; a stream's task must not end cancelled
        finally:
            self._serving.discard(task)
            writer.transport.abort()

    async def _pass(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One way: pieces in order, none before the one in front of it."""
        pieces: asyncio.Queue[tuple[float, bytes | None]] = asyncio.Queue()
        delivering = asyncio.create_task(self._deliver(pieces, writer))
        loop = asyncio.get_running_loop()
        arrives_s = 0.0
        try:
            while True:
                try:
                    data = await reader.read(SEGMENT_BYTES)
                except OSError:
                    data = b""
                arrives_s = max(arrives_s, loop.time() + self._passage_s())
                pieces.put_nowait((arrives_s, data or None))
                if not data:
                    await delivering
                    return
        finally:
            delivering.cancel()
            await asyncio.gather(delivering, return_exceptions=True)

    def _passage_s(self) -> float:
        passage_s = self.line.passage_s(self._rng)
        self.lost += passage_s > self.line.delay_s + self.line.jitter_s
        return passage_s

    async def _deliver(self, pieces: asyncio.Queue[tuple[float, bytes | None]], writer: asyncio.StreamWriter) -> None:
        loop = asyncio.get_running_loop()
        with contextlib.suppress(OSError):
            while True:
                arrives_s, data = await pieces.get()
                await asyncio.sleep(max(0.0, arrives_s - loop.time()))
                await self._is_up.wait()
                if data is None:
                    writer.write_eof()
                    return
                writer.write(data)
                await writer.drain()
