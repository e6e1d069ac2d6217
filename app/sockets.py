"""One WebSocket of a participant's page: checks what comes in, sends what goes out, decides nothing."""

from __future__ import annotations

import asyncio
import contextlib
import json
from typing import Any
from urllib.parse import urlsplit

from fastapi import WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from app.messages import CLIENT_MESSAGE, MAX_MESSAGE_BYTES, PROTOCOL_VERSION, Error, Hello, Message
from app.session import LiveSession
from app.surroundings import Role

HELLO_WITHIN_S = 10.0
MAX_QUEUED = 1000
"""A page that lets this many messages pile up is cut off; it comes back and gets the present state."""


class SocketClient:
    """A connected page, as `app.session.Client` wants it."""

    def __init__(self, websocket: WebSocket, role: Role, hello: Hello) -> None:
        self.role: Role = role
        self.name = hello.client
        self.telemetry = hello.telemetry
        self._websocket = websocket
        self._outgoing: asyncio.Queue[Message | None] = asyncio.Queue(MAX_QUEUED)
        self._overrun = False

    def deliver(self, message: Message) -> None:
        """Queue a message."""
        try:
            self._outgoing.put_nowait(message)
        except asyncio.QueueFull:
            self._overrun = True

    def end(self) -> None:
        """Close once everything queued is sent."""
        with contextlib.suppress(asyncio.QueueFull):
            self._outgoing.put_nowait(None)

    async def send_all(self) -> None:
        """Send what is queued until told to end."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while not self._overrun:
                message = await self._outgoing.get()
                if message is None:
                    break
                await self._websocket.send_text(message.model_dump_json())
            await self._websocket.close(1013 if self._overrun else 1000)


def same_origin(websocket: WebSocket, public_url: str | None) -> bool:
    """Whether a browser's page that opens this socket is one of ours. Clients that are no browsers send no Origin."""
    origin = websocket.headers.get("origin")
    if origin is None:
        return True
    host = urlsplit(origin).netloc
    return host == websocket.headers.get("host") or (public_url is not None and host == urlsplit(public_url).netloc)


async def serve(websocket: WebSocket, session: LiveSession, role: Role) -> None:
    """Speak the protocol on an accepted socket until either side leaves."""
    try:
        hello = await asyncio.wait_for(_hello(websocket), HELLO_WITHIN_S)
    except (asyncio.TimeoutError, WebSocketDisconnect):
        with contextlib.suppress(RuntimeError):
            await websocket.close(1008, "no hello")
        return
    client = SocketClient(websocket, role, hello)
    session.attach(client)
    sending = asyncio.create_task(client.send_all())
    receiving = asyncio.create_task(_receive_all(websocket, session, client))
    try:
        await asyncio.wait({sending, receiving}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        session.detach(client)
        for task in (sending, receiving):
            task.cancel()
        await asyncio.gather(sending, receiving, return_exceptions=True)


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


async def _receive_all(websocket: WebSocket, session: LiveSession, client: SocketClient) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        while True:
            message = parse(await _text(websocket))
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


def parse(text: str | bytes) -> Message:
    """A client's message, or the `Error` that answers it."""
    if isinstance(text, bytes):
        return Error(code="malformed", field=None, message="messages are text frames with JSON")
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > MAX_MESSAGE_BYTES:
        return Error(
            code="too_large", field=None, message=f"the message has {size} bytes; at most {MAX_MESSAGE_BYTES} are taken"
        )
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return Error(code="malformed", field=None, message="the message is not JSON")
    identifier = data.get("id") if isinstance(data, dict) and isinstance(data.get("id"), str) else None
    try:
        message: Any = CLIENT_MESSAGE.validate_python(data)
    except (ValidationError, RecursionError) as error:
        return _refusal(error, identifier)
    return message  # type: ignore[no-any-return]


def _refusal(error: ValidationError | RecursionError, identifier: str | None) -> Error:
    if isinstance(error, RecursionError):
        return Error(code="malformed", field=None, message="the message is nested too deeply", id=identifier)
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    place = [str(part) for part in first["loc"]]
    field = ".".join(place[1:] if len(place) > 1 else place) or "type"
    return Error(code="invalid", field=field, message=str(first["msg"]), id=identifier and identifier[:64])
