"""A viser client without a browser: what a scene server sends, as plain dictionaries."""

from __future__ import annotations

from collections.abc import Iterable
from types import TracebackType
from typing import Any

import msgspec
import zstandard
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from app.simulated.connection import camera_message, scene_protocol

PROTOCOL = scene_protocol()
TIMEOUT_S = 10.0


def decoded(frame: bytes) -> list[dict[str, Any]]:
    """The messages of one frame: sizes, then zstd-compressed msgpack (viser 1.1, its WebsocketClientWorker.ts)."""
    unpacked, packed = (int.from_bytes(frame[start : start + 8], "little") for start in (0, 8))
    body = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed], max_output_size=unpacked)
    messages: list[dict[str, Any]] = msgspec.msgpack.decode(body)["messages"]
    return messages


class ViserClient:
    """Connects on entering; `messages` holds all that came so far.

    viser counts a client in once it has said where its camera is, which a `silent` one does not.
    """

    def __init__(
        self,
        port: int,
        path: str = "",
        width: int = 1280,
        height: int = 720,
        *,
        near: float = 0.1,
        silent: bool = False,
    ) -> None:
        self.messages: list[dict[str, Any]] = []
        self.size_bytes = 0
        self._url = f"ws://127.0.0.1:{port}{path}"
        self._first = None if silent else camera_message(width, height, near)
        self._socket: ClientConnection

    def __enter__(self) -> ViserClient:
        self._socket = connect(
            self._url, subprotocols=[Subprotocol(PROTOCOL)], compression=None, max_size=None, proxy=None
        )
        if self._first is not None:
            self._socket.send(self._first)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()

    def send(self, message: dict[str, Any]) -> None:
        self._socket.send(msgspec.msgpack.encode(message))

    def until(self, **wanted: Any) -> dict[str, Any]:
        """Read on until a message has all of these fields, and return it; `TimeoutError` when none comes."""
        start = 0
        while True:
            for message in self.messages[start:]:
                if all(message.get(name) == value for name, value in wanted.items()):
                    return message
            start = len(self.messages)
            frame = self._socket.recv(timeout=TIMEOUT_S)
            assert isinstance(frame, bytes)
            self.size_bytes += len(frame)
            self.messages += decoded(frame)

    def forget(self) -> None:
        """Start `messages` anew."""
        self.messages.clear()

    def backlog(self) -> None:
        """Read all the server had to say to a newcomer."""
        self.until(type="ReplayDoneMessage")

    def nodes(self) -> list[str]:
        """The names of all models that were sent."""
        return [message["name"] for message in self.messages if message["type"] == "GlbMessage"]

    def position(self, name: str) -> Any:
        """The last position sent for a node."""
        return self._last("SetPositionMessage", name, "position")

    def visible(self, name: str) -> bool:
        """Whether the node is shown, as last said."""
        return bool(self._last("SetSceneNodeVisibilityMessage", name, "visible"))

    def _last(self, kind: str, name: str, field: str) -> Any:
        said = [m[field] for m in self.messages if m["type"] == kind and m["name"] == name]
        assert said, f"nothing of {kind} about {name}"
        return said[-1]


def names(messages: Iterable[dict[str, Any]]) -> set[str]:
    """The nodes that messages are about."""
    return {message["name"] for message in messages if "name" in message}
