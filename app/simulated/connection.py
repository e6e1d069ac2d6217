"""A scripted client's way into the lab: the link, the socket with typed messages out and in, and the 3-D view."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.metadata
import itertools
import secrets
import ssl
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urljoin, urlsplit

import httpx
import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Subprotocol

from app.errors import LabError
from app.simulated.received import NOTE, Received
from app.wire import PROTOCOL_VERSION, SERVER_MESSAGE, Ack, Error, Hello, Message, Note, Submit, submit_type
from study.flow.flow import FLOW, Flow

ANSWER_WITHIN_S = 60.0


class BotError(LabError):
    """The bot cannot go on; the message says what the lab answered."""


@dataclass(frozen=True)
class PageAccess:
    """Where a link leads: the page's address and the cookie that opens it."""

    page_url: str
    cookie: str

    @property
    def socket_url(self) -> str:
        """Address of the page's WebSocket."""
        parts = urlsplit(self.page_url)
        scheme = "wss" if parts.scheme == "https" else "ws"
        return urljoin(f"{scheme}://{parts.netloc}{parts.path}", "socket")


async def enter(url: str) -> PageAccess:
    """Follow a link as a browser does. Raises `BotError` if it is none or leads nowhere."""
    start = url.rstrip("/").rpartition("/")[0]
    without_token = f"{start}/…" if start else url
    no_link = BotError(f"{without_token!r} is no link; one looks like http://127.0.0.1:8000/p/TOKEN")
    if not _is_link(url):
        raise no_link
    try:
        # As for the socket: the system's certificates, or those of SSL_CERT_FILE, for a lab of a university's own.
        verify = ssl.create_default_context() if url.startswith("https:") else True
        async with httpx.AsyncClient(trust_env=False, verify=verify) as client:
            response = await client.get(url)
    except httpx.InvalidURL:
        raise no_link from None
    except httpx.HTTPError as error:
        raise BotError(f"{without_token}: {type(error).__name__}: {error}") from None
    if response.status_code != 303:
        raise BotError(f"the link was answered with {response.status_code}; it is wrong or has ended")
    cookie = "; ".join(f"{name}={value}" for name, value in response.cookies.items())
    return PageAccess(urljoin(url, response.headers["location"]), cookie)


def _is_link(url: str) -> bool:
    try:
        parts = urlsplit(url)
        return parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:  # brackets without an address, or a port that is no number
        return False


class Wire:
    """An open socket of the protocol: typed messages out and in."""

    def __init__(self, connection: ClientConnection, submit: type[Submit] = Submit) -> None:
        self._connection = connection
        self._submit = submit
        self._name = secrets.token_hex(6)
        self._numbers = itertools.count(1)
        self._received = Received()

    async def send(self, message: Message) -> None:
        """Send one message. Raises `BotError` when the lab is gone."""
        await self.send_raw(message.model_dump_json())

    async def send_raw(self, frame: str | bytes) -> None:
        """Send a frame as it is. Raises `BotError` when the lab is gone."""
        try:
            await self._connection.send(frame)
        except ConnectionClosed as closed:
            raise BotError(f"the lab closed the connection: {closed}") from None

    async def receive(self) -> Message:
        """The next message of the lab. Raises `BotError` when it stays silent or is gone."""
        message: Message = SERVER_MESSAGE.validate_json(await self.receive_raw())
        self._received.hear(message)
        return message

    async def receive_raw(self) -> str | bytes:
        """The next frame of the lab as it is. Raises `BotError` when it stays silent or is gone."""
        try:
            return await asyncio.wait_for(self._connection.recv(), ANSWER_WITHIN_S)
        except asyncio.TimeoutError:
            raise BotError(f"the lab said nothing for {ANSWER_WITHIN_S:g} s") from None
        except ConnectionClosed as closed:
            raise BotError(f"the lab closed the connection: {closed}") from None

    async def submit(self, step: str, data: Mapping[str, Any]) -> str:
        """Submit a step; returns the message's id."""
        identifier = self.new_id()
        await self.send(self._submit.model_validate({"id": identifier, "step": step, "data": data}))
        return identifier

    async def report_received(self) -> None:
        """Once the study is over: tell the lab what this client was told is on disk."""
        await self._acknowledged(Note(id=self.new_id(), name="in_step"))  # so is everything said before it
        await self._acknowledged(Note(id=self.new_id(), name=NOTE, data=self._received.report()))

    async def _acknowledged(self, note: Note) -> None:
        await self.send(note)
        while True:
            message = await self.receive()
            if isinstance(message, Error):
                raise BotError(f"the lab refused a note: {message.code}, {message.field}: {message.message}")
            if isinstance(message, Ack) and message.id == note.id:
                return

    def new_id(self) -> str:
        """An id for a submission; no other wire makes the same one, or the lab would take it for a resend."""
        return f"bot-{self._name}-{next(self._numbers)}"


@contextlib.asynccontextmanager
async def open_wire(access: PageAccess, name: str, telemetry: bool = False, flow: Flow = FLOW) -> AsyncIterator[Wire]:
    """Connect and say hello. `flow` is the lab's."""
    headers = {"Cookie": access.cookie}
    try:
        connection = await connect(access.socket_url, additional_headers=headers, compression=None, proxy=None)
    except (InvalidHandshake, OSError) as error:
        raise BotError(f"the lab did not open a socket: {error}") from None
    async with connection:
        wire = Wire(connection, submit_type(flow))
        await wire.send(Hello(protocol=PROTOCOL_VERSION, client=name, telemetry=telemetry))
        yield wire


# ---- the 3-D view -----------------------------------------------------------------------------------------------


def scene_protocol() -> str:
    """What a viser client calls the version it speaks."""
    return f"viser-v{importlib.metadata.version('viser')}"


def camera_message(width: int = 1280, height: int = 720, near: float = 0.1) -> bytes:
    """What a browser's 3-D view says first: where its camera is. viser counts no client in before."""
    return msgspec.msgpack.encode(
        {
            "type": "ViewerCameraMessage",
            "wxyz": [1.0, 0.0, 0.0, 0.0],
            "position": [3.0, 3.0, 3.0],
            "fov": 1.3,
            "near": near,
            "far": 100.0,
            "image_height": height,
            "image_width": width,
            "look_at": [0.0, 0.0, 0.0],
            "up_direction": [0.0, 0.0, 1.0],
        }
    )


class SceneWire:
    """An open 3-D view that takes in all it is sent and draws none of it."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection

    async def receive(self) -> int:
        """Size of the next frame, in bytes. Raises `BotError` when the view is closed, as when the robot goes."""
        try:
            return len(await self._connection.recv())
        except ConnectionClosed as closed:
            raise BotError(f"the 3-D view was closed: {closed}") from None


@contextlib.asynccontextmanager
async def open_scene(access: PageAccess, near_m: float = 0.1) -> AsyncIterator[SceneWire]:
    """Open the 3-D view of a participant's page, as its frame does. `near_m` is the camera's near plane. Raises
    `BotError` where there is none now."""
    headers, protocols = {"Cookie": access.cookie}, [Subprotocol(scene_protocol())]
    url = urljoin(access.socket_url, "scene")
    try:
        connection = await connect(
            url, additional_headers=headers, subprotocols=protocols, compression=None, max_size=None, proxy=None
        )
    except (InvalidHandshake, OSError, TimeoutError, asyncio.TimeoutError) as error:
        raise BotError(f"the lab did not open a 3-D view: {error}") from None
    async with connection:
        try:
            await connection.send(camera_message(near=near_m))
        except ConnectionClosed as closed:
            raise BotError(f"the 3-D view was closed: {closed}") from None
        yield SceneWire(connection)
