"""One WebSocket of a participant's page: checks what comes in, sends what goes out, decides nothing."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from fastapi import WebSocket, WebSocketDisconnect
from pydantic import TypeAdapter, ValidationError
from starlette.requests import HTTPConnection

from app.limits import Limits, Meter, Refusals
from app.session.interfaces import Role
from app.session.session import LiveSession
from app.wire import (
    CLIENT_MESSAGE,
    MAX_MESSAGE_BYTES,
    PROTOCOL_VERSION,
    ClientMessage,
    Error,
    Heartbeat,
    Hello,
    Input,
    Message,
    Note,
    Submit,
)
from sim.interface import TICK_S
from study.json_text import once, whole_number

CLOSE_WITHIN_S = 2.0
CLOSE_NORMAL = 1000
CLOSE_REFUSED = 1008
CLOSE_TRY_LATER = 1013
BEHIND_S = TICK_S
"""A page whose messages had to wait so long is behind: what its hands did meanwhile is over."""
CAUGHT_UP_S = 0.02
"""It has caught up when nothing came for so long: what is on its way already comes at once."""


@dataclass(frozen=True)
class Bounds:
    """What holds for one socket: the table, the session's meter, and where refusals are counted."""

    limits: Limits
    meter: Meter
    refusals: Refusals


def usual_bounds() -> Bounds:
    """The defaults, for a session of its own."""
    return Bounds(Limits(), Meter(Limits()), Refusals())


class SocketClient:
    """A connected page, as `app.session.session.Client` wants it."""

    def __init__(
        self,
        websocket: WebSocket,
        role: Role,
        hello: Hello,
        bounds: Bounds,
        refused: Callable[[str], None] = lambda code: None,
    ) -> None:
        self.role: Role = role
        self.name = hello.client
        self.telemetry = hello.telemetry
        self.room = asyncio.Semaphore(bounds.limits.waiting_messages)
        """For messages that wait to be dealt with."""
        self._websocket = websocket
        self._refused = refused
        self._outgoing: asyncio.Queue[Message | int] = asyncio.Queue(bounds.limits.unsent_messages)
        self._overrun = asyncio.Event()

    @property
    def waiting(self) -> int:
        """How many messages have not been sent yet."""
        return self._outgoing.qsize()

    def deliver(self, message: Message) -> None:
        """Queue a message; a refusal is counted."""
        if isinstance(message, Error):
            self._refused(message.code)
        try:
            self._outgoing.put_nowait(message)
        except asyncio.QueueFull:
            self._overrun.set()

    def end(self, code: int = CLOSE_NORMAL) -> None:
        """Close once everything queued is sent."""
        try:
            self._outgoing.put_nowait(code)
        except asyncio.QueueFull:
            self._overrun.set()

    async def send_all(self) -> None:
        """Send what is queued until told to end."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while not isinstance(message := await self._outgoing.get(), int):
                await self._websocket.send_text(message.model_dump_json())
            await self._websocket.close(message)

    async def cut_off(self) -> None:
        """Returns once the page has let so much pile up that it is not worth waiting for."""
        await self._overrun.wait()


class Places:
    """How many sockets each session has open. One participant with many tabs must not use up the lab."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._open: dict[str, int] = {}

    def is_full(self, public_id: str) -> bool:
        """Whether a session has no place left."""
        return self._open.get(public_id, 0) >= self._limit

    @contextlib.contextmanager
    def take(self, public_id: str) -> Iterator[bool]:
        """A place for as long as the block runs; False when all are taken."""
        taken = self._open.get(public_id, 0)
        if taken >= self._limit:
            yield False
            return
        self._open[public_id] = taken + 1
        try:
            yield True
        finally:
            self._open[public_id] -= 1
            if not self._open[public_id]:
                del self._open[public_id]


def same_origin(request: HTTPConnection, public_url: str | None) -> bool:
    """Whether a browser's page that opens this socket, or sends this request, is one of ours.

    Clients that are no browsers send no Origin.
    """
    origin = request.headers.get("origin")
    if origin is None:
        return True
    host = urlsplit(origin).netloc
    return host == request.headers.get("host") or (public_url is not None and host == urlsplit(public_url).netloc)


async def serve(
    websocket: WebSocket,
    session: LiveSession,
    role: Role,
    taken: TypeAdapter[ClientMessage] = CLIENT_MESSAGE,
    bounds: Bounds | None = None,
    refused: Callable[[str], None] = lambda code: None,
) -> None:
    """Speak the protocol on an accepted socket until either side leaves. `taken` is what a page may say; `refused` is
    called with the code of each refusal."""
    bounds = bounds or usual_bounds()
    try:
        hello = await asyncio.wait_for(_hello(websocket, bounds), bounds.limits.hello_s)
    except asyncio.TimeoutError:
        bounds.refusals.add("hello")
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await websocket.close(CLOSE_REFUSED, "no hello")
        return
    except (WebSocketDisconnect, RuntimeError):
        return  # gone before it said anything, or while it was told what was wrong
    if hello is None:
        return
    client = SocketClient(websocket, role, hello, bounds, refused)
    session.attach(client)
    sending = asyncio.create_task(client.send_all())
    receiving = asyncio.create_task(_receive_all(websocket, session, client, taken, bounds))
    cut_off = asyncio.create_task(client.cut_off())
    tasks = (sending, receiving, cut_off)
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        if receiving.done() and not receiving.cancelled() and receiving.exception() is None and receiving.result():
            await asyncio.wait((sending, cut_off), timeout=CLOSE_WITHIN_S, return_when=asyncio.FIRST_COMPLETED)
    finally:
        session.detach(client)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    if not cut_off.cancelled():
        bounds.refusals.add("unsent")
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, asyncio.TimeoutError):
            await asyncio.wait_for(websocket.close(CLOSE_TRY_LATER), CLOSE_WITHIN_S)


async def refuse(websocket: WebSocket, why: str) -> None:
    """The typed refusal of an accepted socket that says too much, and its end."""
    message = Error(code="too_many", field=None, message=why)
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, asyncio.TimeoutError):
        await asyncio.wait_for(websocket.send_text(message.model_dump_json()), CLOSE_WITHIN_S)
        await asyncio.wait_for(websocket.close(CLOSE_TRY_LATER), CLOSE_WITHIN_S)


def _bytes_of(frame: str | bytes) -> int:
    return len(frame if isinstance(frame, bytes) else frame.encode("utf-8", "surrogatepass"))


async def _hello(websocket: WebSocket, bounds: Bounds) -> Hello | None:
    """The first message; whatever else comes first is refused and the socket stays open. None once it was too much."""
    while True:
        frame = await _text(websocket)
        over = bounds.meter.heard(_bytes_of(frame), time.monotonic())
        if over:
            bounds.refusals.add("messages")
            await refuse(websocket, over)
            return None
        message = parse(frame)
        if isinstance(message, Hello) and message.protocol == PROTOCOL_VERSION:
            return message
        if isinstance(message, Hello):
            text = f"protocol {message.protocol} is not spoken here; it is {PROTOCOL_VERSION}. Please reload the page."
            message = Error(code="protocol", field="protocol", message=text)
        elif not isinstance(message, Error):
            message = Error(code="protocol", field="type", message="the first message must be 'hello'")
        await websocket.send_text(message.model_dump_json())


async def _receive_all(
    websocket: WebSocket,
    session: LiveSession,
    client: SocketClient,
    taken: TypeAdapter[ClientMessage],
    bounds: Bounds,
) -> bool:
    """Read until the page leaves, or says too much: True then, and it is being told.

    No more is read than can be dealt with: while `waiting_messages` of this page wait, the socket is not read, so that
    the page's own system holds back what it says. The hands never wait; but what they did while others waited is over,
    and is taken as hands off.
    """
    is_paced, is_behind = session.enrolment.pace == "real_time", False
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        while True:
            asked_s = time.monotonic()
            frame = await _text(websocket)
            now_s = time.monotonic()
            is_behind = is_behind and now_s - asked_s < CAUGHT_UP_S
            over = bounds.meter.heard(_bytes_of(frame), now_s, is_paced)
            message = parse(frame, taken) if not over else None
            if isinstance(message, (Submit, Note)):
                over = bounds.meter.recorded(now_s, is_paced)
            if over or message is None:
                bounds.refusals.add("records" if message else "messages")
                client.deliver(Error(code="too_many", field=None, message=over))
                client.end(CLOSE_TRY_LATER)
                return True
            if isinstance(message, Error):
                client.deliver(message)
            elif isinstance(message, Hello):
                client.deliver(Error(code="protocol", field="type", message="'hello' is said once"))
            elif isinstance(message, Input):
                late = {"direction": None, "gripper": None} if is_behind else {}
                session.receive(client, message.model_copy(update=late))
            elif isinstance(message, Heartbeat):
                session.receive(client, message.model_copy(update={"direction": None}) if is_behind else message)
            else:
                await client.room.acquire()
                is_behind = is_behind or (is_paced and time.monotonic() - now_s > BEHIND_S)
                session.receive(client, message, client.room.release)
    return False


async def _text(websocket: WebSocket) -> str | bytes:
    received = await websocket.receive()
    if received["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(received.get("code", 1005))
    text: str | bytes | None = received.get("text")
    return text if text is not None else received.get("bytes", b"")


def parse(text: str | bytes, taken: TypeAdapter[ClientMessage] = CLIENT_MESSAGE) -> Message:
    """A client's message, or the `Error` that answers it."""
    if isinstance(text, bytes):
        return Error(code="malformed", field=None, message="messages are text frames with JSON")
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > MAX_MESSAGE_BYTES:
        return Error(
            code="too_large", field=None, message=f"the message has {size} bytes; at most {MAX_MESSAGE_BYTES} are taken"
        )
    try:
        data = _JSON.decode(text)
    except json.JSONDecodeError:
        return Error(code="malformed", field=None, message="the message is not JSON")
    except (ValueError, RecursionError) as error:
        why = str(error) if type(error) is ValueError else "is nested too deeply"
        return Error(code="malformed", field=None, message=f"the message is not JSON that can be kept: it {why}")
    identifier = data.get("id") if isinstance(data, dict) else None
    if not isinstance(identifier, str) or not _IDENTIFIER.fullmatch(identifier):
        identifier = None
    unsound = _unsound(data)
    if unsound is not None:
        field, problem = unsound
        return Error(code="invalid", field=field, message=problem, id=identifier)
    try:
        message: Message = taken.validate_python(data)
    except ValidationError as error:
        return _refusal(error, identifier)
    return message


_JSON = json.JSONDecoder(parse_int=whole_number, object_pairs_hook=once)
_IDENTIFIER = re.compile(r"[A-Za-z0-9._:-]{1,64}")
MAX_DEPTH = 20
MAX_FIELD_CHARACTERS = 200


def _unsound(data: Any) -> tuple[str, str] | None:
    """Where and why a message could not be kept as it is: Python reads more than JSON may say."""
    waiting: list[tuple[str, Any, int]] = [("", data, 0)]
    while waiting:
        place, value, depth = waiting.pop()
        if depth > MAX_DEPTH:
            return place, f"is nested too deeply; at most {MAX_DEPTH} levels are taken"
        if isinstance(value, float) and not math.isfinite(value):
            return place, "must be a finite number"
        if isinstance(value, str) and not _is_unicode(value):
            return place, "must be Unicode text"
        if isinstance(value, (list, dict)):
            items = value.items() if isinstance(value, dict) else enumerate(value)
            for key, item in items:
                if isinstance(key, str) and not _is_unicode(key):
                    return place or "type", "names of fields must be Unicode text"
                name = f"{place}.{key}" if place else str(key)
                waiting.append((name[:MAX_FIELD_CHARACTERS], item, depth + 1))
    return None


def _is_unicode(text: str) -> bool:
    """False for halves of surrogate pairs, which no database and no other program takes."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _refusal(error: ValidationError, identifier: str | None) -> Error:
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    place = [str(part) for part in first["loc"]]
    field = ".".join(place[1:] if len(place) > 1 else place) or "type"
    return Error(code="invalid", field=field[:MAX_FIELD_CHARACTERS], message=str(first["msg"])[:500], id=identifier)
