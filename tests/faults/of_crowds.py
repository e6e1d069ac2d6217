"""Too much of something: files, messages, connections, requests. Whoever drives beside it does not notice."""

from __future__ import annotations

import asyncio
import contextlib
import json
import resource
import sys
import time

from websockets.exceptions import ConnectionClosed

from app.simulated.connection import BotError
from app.wire import Error
from tests.faults import processes
from tests.faults.person import Person
from tests.faults.row import Fault, event, sign
from tests.faults.stage import Stage
from tests.support.lab_server import ROOT
from tests.support.wire_client import visit

FILES = 256
IDLE_CONNECTIONS = 300
FLOOD_S = 10.0
NOTE_BYTES = 55_000
TAKEN_PER_S = 100
"""A page that says more than this is cut off, if it is read as fast as it says it at all."""
HALF_SENT = 400
HALF_SENT_WITHIN_S = 45.0
"""By then every request whose head never ended has been closed."""
LOG_BYTES = 1_000_000
GROWTH_BYTES = 100 * 2**20
"""How much the lab may grow in a flood. Without bounds it was 2.2 GB."""


async def _closed(writer: asyncio.StreamWriter) -> None:
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()


async def files_run_out(stage: Stage) -> None:
    """So many connections that the lab has no file to open, and then a worker dies."""
    before = stage.log_bytes()
    usual = resource.prlimit(stage.pid, resource.RLIMIT_NOFILE)
    resource.prlimit(stage.pid, resource.RLIMIT_NOFILE, (FILES, usual[1]))
    host, _, port = stage.direct_address.partition(":")
    writers = [(await asyncio.open_connection(host, int(port)))[1] for _ in range(IDLE_CONNECTIONS)]
    await asyncio.sleep(3.0)
    processes.kill(processes.workers(stage.pid)[-1])
    await asyncio.sleep(5.0)
    for writer in writers:
        await _closed(writer)
    stage.spent_s = time.monotonic() - stage.began_s
    grown = stage.log_bytes() - before
    stage.notes.append(f"the log grew by {grown / 1e3:.1f} kB")
    assert grown < LOG_BYTES, f"the log grew by {grown / 1e6:.1f} MB"


class _Memory:
    """How much memory the lab has at the most, while the block runs."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._task: asyncio.Task[None] | None = None
        self._before = self._most = 0

    async def __aenter__(self) -> _Memory:
        self._before = self._most = processes.own_bytes(self._stage.pid)
        self._task = asyncio.create_task(self._look())
        return self

    async def _look(self) -> None:
        while True:
            await asyncio.sleep(0.5)
            self._most = max(self._most, processes.own_bytes(self._stage.pid))

    async def __aexit__(self, *_: object) -> None:
        assert self._task is not None
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)
        grown = self._most - self._before
        self._stage.notes.append(f"memory {self._before / 2**20:.0f} MB, at most {self._most / 2**20:.0f} MB")
        if grown > GROWTH_BYTES:
            self._stage.problems.append(f"the lab's memory grew by {grown / 2**20:.0f} MB")


async def flood_of_notes(stage: Stage) -> None:
    """Another participant's page sends notes as large as they may be, as fast as it can."""
    made = await stage.invite()
    sent, refused, closed = 0, set[str](), False
    async with _Memory(stage), visit(made["link"]) as player:
        ends_s = time.monotonic() + FLOOD_S

        async def hear() -> None:
            nonlocal closed
            with contextlib.suppress(BotError, AssertionError, asyncio.TimeoutError):
                while True:
                    message = await player.next()
                    if isinstance(message, Error):
                        refused.add(message.code)
            closed = True

        hearing = asyncio.create_task(hear())
        note = {"type": "note", "name": "pad_unplugged", "data": {"pad_id": "x" * NOTE_BYTES}}
        with contextlib.suppress(BotError, ConnectionClosed):
            while time.monotonic() < ends_s and not closed:
                await player.wire.send_raw(json.dumps({**note, "id": f"n{sent}"}))
                sent += 1
                await asyncio.sleep(0)
        hearing.cancel()
        await asyncio.gather(hearing, return_exceptions=True)
    stage.notes.append(
        f"{sent} notes; refused with {sorted(refused) or 'nothing'}; socket {'closed' if closed else 'open'}"
    )
    if not refused:
        stage.problems.append("no note of a flood was refused")
    if not closed and sent > TAKEN_PER_S * FLOOD_S:
        stage.problems.append(f"{sent} notes were taken from a page in {FLOOD_S:g} s, and its socket was not closed")


async def flood_of_inputs(stage: Stage) -> None:
    """Another participant's page says thousands of times a second what the hands do."""
    made = await stage.invite()
    other = Person(made["link"], made["participant"], stage.direct_address)
    stage.people.append(other)
    other.begin()
    assert await other.until(lambda: len(other.memory.ticks) > 0, 60.0), "the other participant never drove"
    async with _Memory(stage):
        ends_s, seq = time.monotonic() + FLOOD_S, 1000
        while time.monotonic() < ends_s:
            for _ in range(100):
                seq += 1
                await other.raw(json.dumps({"type": "input", "seq": seq, "client_ms": 0.0, "direction": [0, 0, 1]}))
            await asyncio.sleep(0.01)
    stage.notes.append(f"{seq - 1000} inputs; the flooding page says {other.sign!r}")
    stage.people.remove(other)
    await other.end()


async def half_sent_requests(stage: Stage) -> None:
    """Requests whose head never ends, from one address."""
    host, _, port = stage.direct_address.partition(":")
    opened = []
    for _ in range(HALF_SENT):
        with contextlib.suppress(OSError):
            reader, writer = await asyncio.open_connection(host, int(port))
            writer.write(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
            opened.append((reader, writer))
    began_s = time.monotonic()

    async def until_closed(reader: asyncio.StreamReader) -> None:
        with contextlib.suppress(OSError):
            while await reader.read(1000):
                pass

    waiting = [asyncio.create_task(until_closed(reader)) for reader, _ in opened]
    _, still = await asyncio.wait(waiting, timeout=HALF_SENT_WITHIN_S)
    stage.notes.append(f"{len(opened)} opened, {len(still)} still open after {time.monotonic() - began_s:.1f} s")
    for task in waiting:
        task.cancel()
    await asyncio.gather(*waiting, return_exceptions=True)
    for _, writer in opened:
        await _closed(writer)
    if still:
        stage.problems.append(
            f"{len(still)} of {HALF_SENT} half-sent requests were open after {HALF_SENT_WITHIN_S:g} s"
        )


async def flood_of_strangers(stage: Stage) -> None:
    """Forty strangers ask for pages, and for what the arbiter would do, as fast as they are answered."""
    async with _Memory(stage):
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "tests.faults.strangers", stage.direct_address, str(FLOOD_S),
            cwd=ROOT, stdout=asyncio.subprocess.PIPE,
        )  # fmt: skip
        said, _ = await process.communicate()
    answered = {int(status): count for status, count in json.loads(said).items()}
    stage.notes.append(f"answers: {dict(sorted(answered.items()))}")
    wrong = {status: count for status, count in answered.items() if status >= 500 and status != 503}
    if wrong:
        stage.problems.append(f"strangers were answered with {wrong}")


ROWS = (
    Fault(
        "files_run_out",
        f"a limit of {FILES} files, {IDLE_CONNECTIONS} idle connections, and a worker dies",
        files_run_out,
        downtime_s=4.0,
        part="bounds",
        participant=(sign("recovering", 5.0),),
        experimenter=(event("worker_lost", 30.0),),
    ),
    Fault(
        "flood_of_notes",
        f"another page sends notes of {NOTE_BYTES // 1000} kB for {FLOOD_S:g} s",
        flood_of_notes,
        downtime_s=1.0,
        part="bounds",
    ),
    Fault(
        "flood_of_inputs",
        f"another page sends thousands of inputs a second for {FLOOD_S:g} s",
        flood_of_inputs,
        downtime_s=1.0,
        part="bounds",
    ),
    Fault(
        "half_sent_requests",
        f"{HALF_SENT} requests whose head never ends",
        half_sent_requests,
        downtime_s=1.0,
        part="bounds",
    ),
    Fault(
        "flood_of_strangers",
        f"forty strangers ask for {FLOOD_S:g} s as fast as they are answered",
        flood_of_strangers,
        downtime_s=1.0,
        part="bounds",
    ),
)
