"""The bad network of the faults is bad as it says, and never loses or turns round a byte."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

import numpy as np

from tests.faults.proxy import FIRST_TIMEOUT_S, BadNetwork, Line

WITHIN_S = 20.0


@contextlib.asynccontextmanager
async def echo() -> AsyncIterator[BadNetwork]:
    """A server that sends back what it hears, behind a bad network."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(1000):
            writer.write(data)
        writer.close()

    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    network = BadNetwork(*server.sockets[0].getsockname()[:2])
    await network.open()
    try:
        yield network
    finally:
        await network.close()
        server.close()


async def test_bytes_come_in_order_however_bad_the_line_is() -> None:
    async with echo() as network:
        network.line = Line(delay_s=0.002, jitter_s=0.002, loss=0.02)
        host, _, port = network.address.partition(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        sent = np.random.default_rng(1).bytes(100_000)
        writer.write(sent)
        writer.write_eof()
        assert await asyncio.wait_for(reader.read(-1), WITHIN_S) == sent
        assert network.lost > 0
        writer.close()


async def test_in_a_cut_nothing_passes_and_after_it_everything() -> None:
    async with echo() as network:
        host, _, port = network.address.partition(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(b"before")
        assert await asyncio.wait_for(reader.readexactly(6), WITHIN_S) == b"before"
        network.cut()
        writer.write(b"in it")
        hearing = asyncio.create_task(reader.readexactly(5))
        done, _ = await asyncio.wait({hearing}, timeout=0.1)
        assert not done
        network.mend()
        assert await asyncio.wait_for(hearing, WITHIN_S) == b"in it"
        writer.close()


def test_a_loss_costs_a_retransmission_and_two_cost_more() -> None:
    rng = np.random.default_rng(1)
    line = Line(delay_s=0.08, jitter_s=0.02, loss=0.02)
    took_s = np.array([line.passage_s(rng) for _ in range(20_000)])
    lost = took_s > 0.1
    assert abs(lost.mean() - 0.02) < 0.004
    assert took_s.min() >= 0.06 and took_s[~lost].max() <= 0.1
    once_s = FIRST_TIMEOUT_S + 0.16
    assert took_s[lost].min() >= 0.06 + once_s and took_s.max() >= 0.06 + 3 * once_s
