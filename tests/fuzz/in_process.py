"""A lab and its app in this process, spoken to without a network: every byte of a request is ours to choose.

Nothing escapes: what the app raises, what is logged as an error and what the loop complains of are collected.
"""

from __future__ import annotations

import asyncio
import json
import logging
import threading
import traceback
from collections.abc import Coroutine, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import quote, unquote

from app.config import LabConfig
from app.lab.lab import Lab
from app.web.server import create_app

TOKEN = "the-token-of-an-experimenter-who-fuzzes"
WITHIN_S = 60.0
"""What takes longer hangs."""
_SAFE = "".join(chr(number) for number in range(0x21, 0x7F))
T = TypeVar("T")


@dataclass(frozen=True)
class Answer:
    """What came back for a request; `raised` is the traceback of what the app let through."""

    status: int
    headers: tuple[tuple[str, str], ...]
    body: bytes
    raised: str = ""


class Complaints(logging.Handler):
    """Every traceback that is logged."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.heard: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep what has a traceback. What has none is a sentence about the machine, such as that its disk is slow."""
        if not record.exc_info and "Traceback" not in record.getMessage():
            return
        trace = "".join(traceback.format_exception(*record.exc_info)) if record.exc_info else ""
        self.heard.append(f"{record.getMessage()}\n{trace}")

    def take(self) -> list[str]:
        """What was heard since the last time."""
        heard, self.heard = self.heard, []
        return heard


def without_rates(config: LabConfig) -> LabConfig:
    """The same lab for somebody who asks as fast as they can: rates are tested elsewhere."""
    limits = getattr(config, "limits", None)
    if limits is None:
        return config
    high = {
        one.name: type(getattr(limits, one.name))(1_000_000)
        for one in fields(limits)
        if one.name.endswith(("_per_s", "_per_min", "_burst", "_per_address"))
    }
    changed: dict[str, Any] = {"limits": replace(limits, **high)}
    return replace(config, **changed)


class InProcessLab:
    """A context: the lab runs in a loop of its own, in a thread of its own."""

    def __init__(self, data_dir: Path) -> None:
        self._data_dir = data_dir
        self._stack = ExitStack()
        self.complaints = Complaints()

    def __enter__(self) -> InProcessLab:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="fuzzed lab", daemon=True)
        self._thread.start()
        logging.getLogger().addHandler(self.complaints)
        self._loop.set_exception_handler(lambda _, told: self.complaints.heard.append(str(told)))
        config = LabConfig(data_dir=self._data_dir, robot="kinematic", pace="lockstep", scene=False)
        self.lab = Lab(without_rates(config), TOKEN)
        self.lab.prepare()
        self.lab.base_url = "http://127.0.0.1"
        self.app = create_app(self.lab)
        self._life = self.app.router.lifespan_context(self.app)
        self.run(self._life.__aenter__())
        return self

    def __exit__(self, *_: object) -> None:
        self.run(self._life.__aexit__(None, None, None))
        logging.getLogger().removeHandler(self.complaints)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(WITHIN_S)
        self._loop.close()

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Do something in the lab's loop."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(WITHIN_S)

    def invite(self) -> dict[str, Any]:
        """A new pilot: their id and links."""
        headers = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"}
        made = self.ask("POST", "/api/participants", headers, b'{"kind": "pilot"}')
        found: dict[str, Any] = json.loads(made.body)
        return found

    def ask(self, method: str, path: str, headers: Mapping[str, str] | None = None, body: bytes = b"") -> Answer:
        """Send a request. `path` is raw: with its query, percent-encoded or not."""
        return self.run(self._ask(method, path, headers or {}, body))

    async def _ask(self, method: str, path: str, headers: Mapping[str, str], body: bytes) -> Answer:
        scope = self._scope("http", path, {"content-length": str(len(body)), **headers}) | {"method": method}
        sent: list[dict[str, Any]] = []
        coming = [{"type": "http.request", "body": body, "more_body": False}]

        async def receive() -> dict[str, Any]:
            return coming.pop() if coming else {"type": "http.disconnect"}

        async def send(message: Any) -> None:
            sent.append(dict(message))

        raised = ""
        try:
            await self.app(scope, receive, send)
        except Exception:
            raised = traceback.format_exc()
        start: Any = next((one for one in sent if one["type"] == "http.response.start"), {"status": 500, "headers": ()})
        told = tuple((name.decode("latin-1"), value.decode("latin-1")) for name, value in start["headers"])
        whole = b"".join(one.get("body", b"") for one in sent if one["type"] == "http.response.body")
        return Answer(int(start["status"]), told, whole, raised)

    def _scope(self, kind: str, path: str, headers: Mapping[str, str]) -> dict[str, Any]:
        # What a server is given is ASCII: a browser writes everything else as percent signs and digits.
        whole = quote(path.encode("utf-8", "surrogateescape"), safe=_SAFE)
        raw, _, query = whole.partition("?")
        lines = {"host": "127.0.0.1", **{name.lower(): value for name, value in headers.items()}}
        return {
            "type": kind,
            "asgi": {"version": "3.0"},
            "http_version": "1.1",
            "scheme": "http" if kind == "http" else "ws",
            "path": unquote(raw),
            "raw_path": raw.encode(),
            "query_string": query.encode(),
            "root_path": "",
            "headers": [
                (name.encode("latin-1", "replace"), value.encode("latin-1", "replace")) for name, value in lines.items()
            ],
            "client": ("127.0.0.1", 40_000),
            "server": ("127.0.0.1", 80),
            "state": {},
            "subprotocols": [],
            "extensions": {},
        }

    def socket(self, path: str, headers: Mapping[str, str]) -> InProcessSocket:
        """A WebSocket that is not open yet."""
        return InProcessSocket(self, self._scope("websocket", path, headers))


class InProcessSocket:
    """One WebSocket. `frames` go in; what comes out is kept."""

    def __init__(self, lab: InProcessLab, scope: dict[str, Any]) -> None:
        self._lab = lab
        self._scope = scope

    async def open(self) -> bool:
        """Connect; False when the app refuses."""
        self._in: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._out: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._in.put_nowait({"type": "websocket.connect"})
        self.raised = ""
        self._task = asyncio.create_task(self._run())
        first = await asyncio.wait_for(self._out.get(), WITHIN_S)
        return bool(first["type"] == "websocket.accept")

    async def _run(self) -> None:
        async def send(message: Any) -> None:
            self._out.put_nowait(dict(message))

        try:
            await self._lab.app(self._scope, self._in.get, send)
        except Exception:
            self.raised = traceback.format_exc()
        finally:
            self._out.put_nowait({"type": "websocket.close", "code": 1006})

    def say(self, frame: str | bytes) -> None:
        """Send a frame."""
        key = "text" if isinstance(frame, str) else "bytes"
        self._in.put_nowait({"type": "websocket.receive", key: frame})

    async def hear(self, within_s: float = WITHIN_S) -> str | None:
        """The next frame; None once the socket is closed."""
        message = await asyncio.wait_for(self._out.get(), within_s)
        return None if message["type"] == "websocket.close" else str(message.get("text") or "")

    @property
    def answers(self) -> int:
        """How many frames came back that nobody has heard yet."""
        return sum("text" in message for message in self._out._queue)  # type: ignore[attr-defined]

    async def close(self) -> None:
        """Leave."""
        self._in.put_nowait({"type": "websocket.disconnect", "code": 1001})
        await asyncio.wait([self._task], timeout=WITHIN_S)
