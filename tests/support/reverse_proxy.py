"""A reverse proxy as small as can be: takes a path away, passes WebSockets through. Loopback only.

with PrefixProxy("/study") as proxy:
    lab = start(..., "--public-url", proxy.url)
    proxy.port = lab.port
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator
from types import TracebackType

MAX_HEAD_BYTES = 65_536


class PrefixProxy:
    """Listens on a port of its own; what does not begin with the prefix is answered with 404, as another site's."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.port = 0
        """Of the lab behind it."""
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="proxy", daemon=True)
        self._own_port = 0
        self._serving: set[asyncio.Task[None]] = set()

    @property
    def url(self) -> str:
        """The lab's public address."""
        return f"http://127.0.0.1:{self._own_port}{self.prefix}"

    def __enter__(self) -> PrefixProxy:
        self._thread.start()
        starting = asyncio.start_server(self._serve, "127.0.0.1", 0, limit=MAX_HEAD_BYTES)
        self._server = asyncio.run_coroutine_threadsafe(starting, self._loop).result(10)
        self._own_port = self._server.sockets[0].getsockname()[1]
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        asyncio.run_coroutine_threadsafe(self._stop(), self._loop).result(10)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)
        self._loop.close()

    async def _stop(self) -> None:
        self._server.close()
        for task in self._serving:
            task.cancel()
        await asyncio.gather(*self._serving, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._serving.add(task)  # the loop itself holds tasks only weakly
        try:
            async with _closing(writer):
                await self._answer(reader, writer)
        except (OSError, asyncio.IncompleteReadError):
            pass  # one side has gone
        finally:
            self._serving.discard(task)

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await reader.readuntil(b"\r\n\r\n")
        line, _, fields = head.partition(b"\r\n")
        method, target, version = line.split(b" ")
        prefix = self.prefix.encode()
        if not (target == prefix or target.startswith(prefix + b"/")):
            writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
            await writer.drain()
            return
        if b"upgrade: websocket" not in fields.lower():  # one request a connection keeps this small
            kept = [field for field in fields.split(b"\r\n") if not field.lower().startswith(b"connection:")]
            fields = b"\r\n".join([b"Connection: close", *kept])
        there, back = await asyncio.open_connection("127.0.0.1", self.port)
        async with _closing(back):
            back.write(b" ".join([method, target[len(prefix) :] or b"/", version]) + b"\r\n" + fields)
            pipes = [asyncio.create_task(_pipe(reader, back)), asyncio.create_task(_pipe(there, writer))]
            try:
                await asyncio.wait(pipes, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for pipe in pipes:
                    pipe.cancel()
                await asyncio.gather(*pipes, return_exceptions=True)


@contextlib.asynccontextmanager
async def _closing(writer: asyncio.StreamWriter) -> AsyncIterator[None]:
    try:
        yield
    finally:
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()


async def _pipe(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(65_536):
            writer.write(data)
            await writer.drain()
