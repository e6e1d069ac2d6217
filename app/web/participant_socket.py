"""One WebSocket of a participant's page: checks what comes in, sends what goes out, decides nothing."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import re
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlsplit

from fastapi import WebSocket, WebSocketDisconnect
from pydantic import TypeAdapter, ValidationError
from starlette.requests import HTTPConnection

from app.session.interfaces import Role
from app.session.session import LiveSession
from app.wire import CLIENT_MESSAGE, MAX_MESSAGE_BYTES, PROTOCOL_VERSION, ClientMessage, Error, Hello, Message
from study.json_text import once, whole_number

HELLO_WITHIN_S = 10.0
CLOSE_WITHIN_S = 2.0
MAX_QUEUED = 1000
"""A page that lets this many messages pile up is cut off; it comes back and gets the present state."""


class SocketClient:
    """A connected page, as `app.session.session.Client` wants it."""

    def __init__(
        self, websocket: WebSocket, role: Role, hello: Hello, refused: Callable[[str], None] = lambda code: None
    ) -> None:
        self.role: Role = role
        self.name = hello.client
        self.telemetry = hello.telemetry
        self._websocket = websocket
        self._refused = refused
        self._outgoing: asyncio.Queue[Message | None] = asyncio.Queue(MAX_QUEUED)
        self._overrun = asyncio.Event()

    def deliver(self, message: Message) -> None:
        """Queue a message; a refusal is counted."""
        if isinstance(message, Error):
            self._refused(message.code)
        try:
            self._outgoing.put_nowait(message)
        except asyncio.QueueFull:
            self._overrun.set()

    def end(self) -> None:
        """Close once everything queued is sent."""
        try:
            self._outgoing.put_nowait(None)
        except asyncio.QueueFull:
            self._overrun.set()

    async def send_all(self) -> None:
        """Send what is queued until told to end."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while (message := await self._outgoing.get()) is not None:
                await self._websocket.send_text(message.model_dump_json())
            await self._websocket.close(1000)

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
    refused: Callable[[str], None] = lambda code: None,
) -> None:
    """Speak the protocol on an accepted socket until either side leaves. `taken` is what a page may say; `refused` is
    called with the code of each refusal."""
    try:
        hello = await asyncio.wait_for(_hello(websocket), HELLO_WITHIN_S)
    except asyncio.TimeoutError:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await websocket.close(1008, "no hello")
        return
    except (WebSocketDisconnect, RuntimeError):
        return  # gone before it said anything, or while it was told what was wrong
    client = SocketClient(websocket, role, hello, refused)
    session.attach(client)
    sending = asyncio.create_task(client.send_all())
    receiving = asyncio.create_task(_receive_all(websocket, session, client, taken))
    cut_off = asyncio.create_task(client.cut_off())
    tasks = (sending, receiving, cut_off)
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        session.detach(client)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    if not cut_off.cancelled():
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, asyncio.TimeoutError):
            await asyncio.wait_for(websocket.close(1013), CLOSE_WITHIN_S)


async def _hello(websocket: WebSocket) -> Hello:
    """The first message; whatever else comes first is refused and the socket stays open."""
    while True:
        message = parse(await _text(websocket))
        if isinstance(message, Hello) and message.protocol == PROTOCOL_VERSION:
            return message
        if isinstance(message, Hello):
            text = f"protocol {message.protocol} is not spoken here; it is {PROTOCOL_VERSION}. Please reload the page."
            message = Error(code="protocol", field="protocol", message=text)
        elif not isinstance(message, Error):
            message = Error(code="protocol", field="type", message="the first message must be 'hello'")
        await websocket.send_text(message.model_dump_json())


async def _receive_all(
    websocket: WebSocket, session: LiveSession, client: SocketClient, taken: TypeAdapter[ClientMessage]
) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        while True:
            message = parse(await _text(websocket), taken)
            if isinstance(message, Error):
                client.deliver(message)
            elif isinstance(message, Hello):
                client.deliver(Error(code="protocol", field="type", message="'hello' is said once"))
            else:
                session.receive(client, message)


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
        data = json.loads(text, parse_int=whole_number, object_pairs_hook=once)
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
