"""Scripted clients for tests: what a page says and hears, one message at a time, each awaited and none guessed.

Everything is pulled: nothing runs behind a test's back but the heartbeats it asks for.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import httpx

from app.session.private_text import with_words
from app.simulated.answers import PlainPerson
from app.simulated.bot import handed_in
from app.simulated.connection import BotError, Wire, enter, open_wire
from app.wire import (
    SERVER_MESSAGE,
    Ack,
    Error,
    Heartbeat,
    Input,
    Message,
    Note,
    Page,
    Ping,
    Pong,
    Status,
    Tick,
    Welcome,
    submit_type,
)
from study.flow.flow import FLOW, Flow
from study.store import Store, open_store
from tests.support.lab_server import LabServer
from tests.support.study_samples import lab_text

Kind = TypeVar("Kind", bound=Message)
Direction = tuple[int, int, int]

COMPREHENSION = {"which_object": "named", "on_sound": "log", "robot_moves": "obeys"}
"""The right answers of the study that ships."""
MESSAGE_WITHIN_S = 30.0
"""Far longer than anything takes: a test that waits this long has failed."""
UNTIL_WITHIN_S = 90.0
"""The same for a message of one kind, while others come: ticks, acknowledgements of heartbeats."""

SHORT = {
    "practice = true ": "practice = false ",
    "pickups_per_trial = 3 ": "pickups_per_trial = 1 ",
}
"""What makes the shipped study short: two tasks a trial, no practice."""
OPEN = {
    "open = false ": "open = true ",
    "quota = 0 ": "quota = 30 ",
    'completion_link = "" ': 'completion_link = "http://127.0.0.1:9/done?of={PROLIFIC_PID}" ',
    'screened_out_link = "" ': 'screened_out_link = "http://127.0.0.1:9/out?of={PROLIFIC_PID}" ',
    'full_link = "" ': 'full_link = "http://127.0.0.1:9/full?of={PROLIFIC_PID}" ',
    "webgl = false ": "webgl = true ",
    "max_round_trip_ms = 0 ": "max_round_trip_ms = 2000 ",
    "min_window_width_px = 0 ": "min_window_width_px = 1000 ",
}
"""What opens the shipped study to people with an id, and lets in only those whose device fits."""


def write_study(folder: Path, changes: Mapping[str, str] | None = None, text: str | None = None) -> Path:
    """The study that shipped first, or one with that text, with parts replaced; each must be there exactly once."""
    text = lab_text() if text is None else text
    for old, new in (SHORT if changes is None else changes).items():
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the study file"
        text = text.replace(old, new)
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def invite(lab: LabServer, **body: Any) -> dict[str, Any]:
    """A new participant: id and links."""
    response = httpx.post(
        f"{lab.base_url}/api/participants", headers=lab.headers, json=body, trust_env=False, timeout=MESSAGE_WITHIN_S
    )
    assert response.status_code == 201, response.text
    created: dict[str, Any] = response.json()
    return created


def asked(lab: LabServer, method: str, route: str, body: Mapping[str, Any] | None = None) -> httpx.Response:
    """The lab's answer to an experimenter's request of `/api/ROUTE`."""
    address = f"{lab.base_url}/api/{route}"
    return httpx.request(method, address, headers=lab.headers, json=body, trust_env=False, timeout=MESSAGE_WITHIN_S)


def seen_by_experimenter(lab: LabServer, participant: str) -> dict[str, Any]:
    """One participant's line of the session list."""
    response = httpx.get(f"{lab.base_url}/api/sessions", headers=lab.headers, trust_env=False, timeout=MESSAGE_WITHIN_S)
    return next(item for item in response.json() if item["participant"] == participant)


async def command(lab: LabServer, participant: str, name: str, reason: str | None = None) -> httpx.Response:
    """The experimenter's pause, resume or abort."""
    options: dict[str, Any] = {"base_url": lab.base_url, "headers": lab.headers, "trust_env": False}
    async with httpx.AsyncClient(**options, timeout=MESSAGE_WITHIN_S) as client:
        return await client.post(f"/api/sessions/{participant}/{name}", json={"reason": reason})


@contextlib.contextmanager
def stored(lab: LabServer) -> Any:
    """The lab's database, read beside it."""
    store: Store
    with open_store(lab.data, must_exist=True) as store:
        yield store


def events(lab: LabServer, participant: str, *kinds: str) -> list[tuple[str, dict[str, Any]]]:
    """The participant's events of these kinds (all, if none are named) as (kind, data), in order."""
    with stored(lab) as store:
        rows = store.rows_of("events", participant)
    return [(row.kind, json.loads(row.data)) for row in rows if not kinds or row.kind in kinds]


def read(lab: LabServer, participant: str, *kinds: str) -> list[tuple[str, dict[str, Any]]]:
    """As `events`, with the words that are kept apart back in their place."""
    with stored(lab) as store:
        rows = [row for row in store.rows_of("events", participant) if not kinds or row.kind in kinds]
        return [
            (row.kind, data) for row, data in zip(rows, with_words(rows, store.identities(participant)), strict=True)
        ]


def worker_pids(lab: LabServer) -> list[int]:
    """The lab's live worker processes: children of its fork server."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                state, parent = (entry / "stat").read_text().rpartition(")")[2].split()[:2]
                if state != "Z":
                    parents[int(entry.name)] = int(parent)
    return [pid for pid, parent in parents.items() if parents.get(parent) == lab.process.pid]


class Player:
    """One page of a participant (or the second device), moved by hand."""

    def __init__(self, wire: Wire, flow: Flow = FLOW) -> None:
        self.wire = wire
        self._flow = flow
        self.frames: list[str] = []
        self.messages: list[Message] = []
        self.seq = 0

    # ---- hearing ------------------------------------------------------------------------------------------------

    async def next(self) -> Message:
        """The next message of the lab."""
        frame = await asyncio.wait_for(self.wire.receive_raw(), MESSAGE_WITHIN_S)
        assert isinstance(frame, str)
        self.frames.append(frame)
        message: Message = SERVER_MESSAGE.validate_json(frame)
        self.messages.append(message)
        return message

    async def until(self, kind: type[Kind], where: Callable[[Kind], bool] = lambda message: True) -> Kind:
        """Listen until a message of this kind that fits arrives: in time, whatever else comes meanwhile. An error that
        was not asked for fails the test."""
        before, ends_s = len(self.messages), time.monotonic() + UNTIL_WITHIN_S
        while time.monotonic() < ends_s:
            message = await self.next()
            if isinstance(message, kind) and where(message):
                return message
            assert not isinstance(message, Error), message
        came = Counter(type(message).__name__ for message in self.messages[before:])
        last = [message for message in self.messages[before:] if isinstance(message, (Page, Status, kind))][-5:]
        raise AssertionError(f"no such {kind.__name__} within {UNTIL_WITHIN_S:g} s: {dict(came)}, and of them {last}")

    async def page(self, state: str) -> Page:
        """Listen until the page of this state is shown."""
        return await self.until(Page, lambda page: page.state == state)

    async def status(self, status: str) -> Status:
        """Listen until the robot is said to be this."""
        return await self.until(Status, lambda message: message.status == status)

    async def ended(self) -> str:
        """Listen until the lab closes the socket; how it did."""
        try:
            while True:
                await self.next()
        except BotError as closed:
            return str(closed)

    def heard(self, kind: type[Kind]) -> list[Kind]:
        """Every message of this kind so far."""
        return [message for message in self.messages if isinstance(message, kind)]

    # ---- saying -------------------------------------------------------------------------------------------------

    async def send(self, message: Message | str | bytes) -> None:
        """Send a message, or a frame as it is."""
        if isinstance(message, (str, bytes)):
            await self.wire.send_raw(message)
        else:
            await self.wire.send(message)

    async def refused(self, step: str, data: Mapping[str, Any] | None = None, identifier: str | None = None) -> Error:
        """Submit a step that must be refused; the first error that answers it."""
        return await self._answer(await self._submit(step, data or {}, identifier), Error)

    async def done(self, step: str, data: Mapping[str, Any] | None = None, identifier: str | None = None) -> Ack:
        """Submit a step that must be taken; its acknowledgement."""
        return await self._answer(await self._submit(step, data or {}, identifier), Ack)

    async def _submit(self, step: str, data: Mapping[str, Any], identifier: str | None) -> str:
        identifier = identifier or self.wire.new_id()
        submit = submit_type(self._flow)
        await self.send(submit.model_validate({"id": identifier, "step": step, "data": data}))
        return identifier

    async def _answer(self, identifier: str, kind: type[Kind]) -> Kind:
        while True:
            message = await self.next()
            if isinstance(message, (Ack, Error)) and message.id == identifier:
                assert isinstance(message, kind), message
                return message

    async def in_step(self) -> None:
        """Everything said before has been dealt with and answered when this returns."""
        marker = self.wire.new_id()
        await self.send(Note(id=marker, name="in_step"))
        while not (isinstance(message := await self.next(), Ack) and message.id == marker):
            pass

    async def hands(self, direction: Direction | None = None, gripper: str | None = None) -> int:
        """Say what the hands do now; the message's number."""
        self.seq += 1
        data = {"seq": self.seq, "client_ms": 0.0, "direction": direction, "gripper": gripper}
        await self.send(Input.model_validate(data))
        return self.seq

    async def tick(self, direction: Direction | None = None, gripper: str | None = None) -> Tick:
        """In lockstep: one input, and the tick it ran."""
        await self.hands(direction, gripper)
        return await self.until(Tick)

    @contextlib.asynccontextmanager
    async def beating(self, direction: Direction | None = None, every_s: float = 0.1) -> AsyncIterator[None]:
        """Heartbeats as a page sends them, on a timer, for as long as the block runs."""

        async def beat() -> None:
            with contextlib.suppress(BotError):
                for _ in itertools.count():
                    await self.send(Heartbeat.model_validate({"seq": self.seq, "direction": direction}))
                    await asyncio.sleep(every_s)

        task = asyncio.create_task(beat())
        try:
            yield
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    # ---- the way to somewhere -----------------------------------------------------------------------------------

    async def reach(self, state: str) -> Page:
        """Fill in what comes up until the page of this state is shown. Drives nothing."""
        while True:
            page = await self.until(Page)
            if page.state == state:
                return page
            if "round_trip" in page.content.get("checks", ()):
                await self.measured()
            if page.state == "instructions":
                asked = {question["id"] for question in page.content["questions"]}
                answers = {name: answer for name, answer in COMPREHENSION.items() if name in asked}
                await self._submit("instructions", {"answers": answers}, None)
            elif page.state.endswith("_ready"):
                await self.status("ready")
                await self._submit("start", {}, None)
            else:
                given = handed_in(page, PlainPerson(), self._flow)
                assert given is not None, f"nothing leads on from {page.state!r}"
                await self._submit(given.step, given.data, None)

    async def measured(self) -> None:
        """Answer the pings of a measurement to the last."""
        left: int | None = None
        while left != 0:
            ping = await self.until(Ping, lambda ping: ping.left is not None)
            left = ping.left
            await self.send(Pong(n=ping.n))

    async def reach_trial(self) -> None:
        """Into the first trial of the short study, its ticks running."""
        await self.reach("trial")
        await self.status("running")


@contextlib.asynccontextmanager
async def visit(link: str, name: str = "tab", telemetry: bool = False, flow: Flow = FLOW) -> AsyncIterator[Player]:
    """Open a participant's (or the second device's) link and say hello; the first message is the lab's welcome."""
    async with open_wire(await enter(link), name, telemetry, flow) as wire:
        player = Player(wire, flow)
        player.seq = (await player.until(Welcome)).last_seq
        yield player
