"""The lab's side of a connection, below the requests: how many there are, how long a head, a body or an unread answer
may take, and how many frames a socket may send.

uvicorn has no such bounds but the one between two requests. Here its protocols are given them; what reaches the
application has come whole and in time.

    accepted ─► head ─► body ─► answer ─► (idle) ─► head ─► …
        │        │ head_s, head_bytes
        │        └────── body_s              each late one: 408, and the connection is closed
        └ more than `connections`: 503; more than `connections_per_address`: 429
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterable
from http import HTTPStatus
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network
from typing import Any, ClassVar, Literal

from starlette.datastructures import MutableHeaders
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.http11 import Response

from app.errors import LabError
from app.limits import Bound, Bucket, Limits, Refusals, network_of
from app.web.security_headers import complete

LINGER_S = 1.0
"""A refused connection is closed so long after its answer: closed at once, the answer might not arrive."""
CLOSED_WITHIN_S = 2.0
"""A socket that is told to close may take so long to; uvicorn's ten seconds are a long time for what is not read."""
OTHER_FILES = 128
"""File descriptors that are kept for everything but connections: database, workers, files that are served."""
TOO_LARGE = HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE
POLICY_VIOLATION = 1008
SLICE_BYTES = 4096
"""Of what a socket sends, so much is taken apart at a time: the frames in it are counted in between."""


def allowed_connections(limits: Limits) -> int:
    """How many connections may be open, after asking the system for as many file descriptors as it gives."""
    given = _file_descriptors(limits.connections + OTHER_FILES)
    return max(1, min(limits.connections, given - OTHER_FILES if given > 2 * OTHER_FILES else given // 2))


def _file_descriptors(wanted: int) -> int:
    """How many there are after asking for so many. On Windows sockets are none, and nothing limits them."""
    try:
        import resource
    except ImportError:
        return wanted
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft >= wanted:
        return soft
    more = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (more, hard))
    except (OSError, ValueError):  # macOS refuses what is beyond its own bound, whatever it says of the hard one
        return soft
    return more


class Proxies:
    """The addresses whose word on who asks is believed, and who themselves are not counted."""

    def __init__(self, addresses: Iterable[str]) -> None:
        self._networks: list[IPv4Network | IPv6Network] = []
        for text in addresses:
            try:
                self._networks.append(ip_network(text))
            except ValueError:
                raise LabError(
                    f"--trusted-proxy {text}: must be the address of a proxy such as 10.0.0.5, or a network such as "
                    "10.0.0.0/24"
                ) from None

    def __contains__(self, address: str) -> bool:
        try:
            parsed = ip_address(address)
        except ValueError:
            return False
        return any(parsed in network for network in self._networks)


class Door:
    """Counts the connections that are open."""

    def __init__(self, limits: Limits, refusals: Refusals, proxies: Proxies, most: int) -> None:
        self.limits = limits
        self.refusals = refusals
        self._proxies = proxies
        self._most = most
        self._open: dict[str, int] = {}
        self._all = 0

    @property
    def open(self) -> int:
        """How many are open."""
        return self._all

    def enter(self, address: str) -> tuple[int, str] | None:
        """One more, whatever is answered; status and reason if it is too many."""
        key = network_of(address)
        self._all += 1
        self._open[key] = self._open.get(key, 0) + 1
        if self._all > self._most:
            return 503, f"more than {self._most} connections are open"
        if self._open[key] > self.limits.connections_per_address and address not in self._proxies:
            return 429, f"more than {self.limits.connections_per_address} connections are open from this address"
        return None

    def leave(self, address: str) -> None:
        """One less."""
        key = network_of(address)
        self._all -= 1
        self._open[key] -= 1
        if not self._open[key]:
            del self._open[key]


class _Unread:
    """Ends a connection whose other side takes nothing for too long."""

    def __init__(self, door: Door, transport: asyncio.Transport) -> None:
        self._door = door
        self._transport = transport
        self._timer: asyncio.TimerHandle | None = None

    def begin(self) -> None:
        """The buffer is full."""
        self.end()
        self._timer = asyncio.get_running_loop().call_later(self._door.limits.unread_s, self._late)

    def end(self) -> None:
        """It is empty enough, or the connection is gone."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _late(self) -> None:
        self._door.refusals.add("unread")
        self._transport.abort()


class BoundedHttp(HttpToolsProtocol):
    """A connection that speaks HTTP. `door` is the lab's."""

    door: ClassVar[Door]

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Somebody has connected."""
        super().connection_made(transport)
        self._address = self.client[0] if self.client else ""
        self._unread = _Unread(self.door, transport)
        self._reads: Literal["head", "body", "nothing"] = "nothing"
        self._timer: asyncio.TimerHandle | None = None
        self._head_bytes = 0
        self._is_refused = False
        self._was_upgraded = False
        refused = self.door.enter(self._address)
        if refused is None:
            self._expect("head", self.door.limits.head_s)
        else:
            # At the last of all places nobody can be waited for.
            self._refuse("connections", *refused, linger_s=0.0 if refused[0] == 503 else LINGER_S)

    def connection_lost(self, exc: Exception | None) -> None:
        """It is gone, whoever ended it."""
        self._expect("nothing")
        self._unread.end()
        self.door.leave(self._address)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Something came in."""
        if self._is_refused:
            return
        if self._reads == "nothing" and self._timer is None and not self._has_answer_to_give():
            self._expect("head", self.door.limits.head_s)
        self._head_bytes += len(data)
        super().data_received(data)
        if self._reads == "head" and self._head_bytes > self.door.limits.head_bytes:
            self._refuse_head()

    def _has_answer_to_give(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def on_message_begin(self) -> None:
        """A request begins."""
        if self._reads != "head":
            self._expect("head", self.door.limits.head_s)
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        """Its head is there."""
        if self._is_refused:
            return
        size = len(self.url) + sum(len(name) + len(value) for name, value in self.headers)
        if size > self.door.limits.head_bytes:
            self._refuse_head()
            return
        self._expect("body", self.door.limits.body_s)
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Some of its body is there."""
        if not self._is_refused:
            super().on_body(body)

    def on_message_complete(self) -> None:
        """All of it is there."""
        if self._is_refused:
            return
        self._expect("nothing")
        super().on_message_complete()

    def handle_websocket_upgrade(self) -> None:
        """From here on it is a socket, which leaves by the same door."""
        if self._is_refused:
            return
        self._expect("nothing")
        super().handle_websocket_upgrade()

    def send_400_response(self, msg: str) -> None:
        """What came in is no HTTP."""
        self._answer(400, msg)

    def pause_writing(self) -> None:
        """The other side takes its time."""
        super().pause_writing()
        self._unread.begin()

    def resume_writing(self) -> None:
        """It has taken something."""
        super().resume_writing()
        self._unread.end()

    def _expect(self, what: Literal["head", "body", "nothing"], within_s: float = 0.0) -> None:
        self._reads, self._head_bytes = what, 0
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if what != "nothing":
            self._timer = self.loop.call_later(within_s, self._late)

    def _late(self) -> None:
        what = self._reads
        self._timer = None
        if what == "nothing" or self.transport.is_closing():
            return
        if what == "head" and self._head_bytes == 0:
            self.transport.close()  # browsers open connections before they need them: nothing was asked
            return
        limits = self.door.limits
        within_s = limits.head_s if what == "head" else limits.body_s
        self._refuse(what, 408, f"the {what} of the request took more than {within_s:g} s")

    def _refuse_head(self) -> None:
        self._refuse("head", TOO_LARGE, f"the head of the request is larger than {self.door.limits.head_bytes} bytes")

    def _refuse(self, bound: Bound, status: int, text: str, linger_s: float = LINGER_S) -> None:
        self.door.refusals.add(bound)
        self._answer(status, text, linger_s)

    def _answer(self, status: int, text: str, linger_s: float = LINGER_S) -> None:
        """The last answer on this connection. An application that still waits for a body hears that nobody is there."""
        self._expect("nothing")
        self._is_refused = True
        has_begun = self._has_answer_to_give() and self.cycle.response_started
        if self.cycle is not None:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        if has_begun or self.transport.is_closing():
            self.transport.close()
            return
        self.transport.write(_last_answer(status, text))
        if linger_s and self.transport.can_write_eof():
            self.transport.write_eof()
            self._timer = self.loop.call_later(linger_s, self.transport.close)
        else:
            self.transport.close()


def _last_answer(status: int, text: str) -> bytes:
    """An answer as it goes over the line, before which nothing of the application has run."""
    body = json.dumps({"detail": text}).encode()
    head = MutableHeaders()
    head["Content-Type"] = "application/json"
    head["Content-Length"] = str(len(body))
    head["Connection"] = "close"
    if status in (429, 503):
        head["Retry-After"] = "1"
    complete(head)
    lines = b"".join(name + b": " + value + b"\r\n" for name, value in head.raw)
    return f"HTTP/1.1 {int(status)} {HTTPStatus(status).phrase}\r\n".encode() + lines + b"\r\n" + body


class BoundedWebSocket(WebSocketsSansIOProtocol):
    """A connection that has become a WebSocket. It came in as a `BoundedHttp`."""

    door: ClassVar[Door]

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        limits = self.door.limits
        self._frames = Bucket(limits.frames_per_s, limits.frames_burst)
        self._is_over = False
        self.close_timeout = CLOSED_WITHIN_S
        reject = self.conn.reject

        def completed(status: int, text: str) -> Response:
            response = reject(status, text)
            head = MutableHeaders()
            complete(head)
            response.headers.update(head.items())
            return response

        self.conn.reject = completed  # type: ignore[method-assign]

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The handshake is about to be read."""
        super().connection_made(transport)
        self._address = self.client[0] if self.client else ""
        self._unread = _Unread(self.door, self.transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """It is gone, whoever ended it."""
        self._unread.end()
        self.door.leave(self._address)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Something came in: a little at a time, so that many small frames are noticed before all are dealt with."""
        for start in range(0, len(data), SLICE_BYTES):
            if self._is_over:
                return
            super().data_received(data[start : start + SLICE_BYTES])

    def handle_cont(self, event: Frame) -> None:
        """More of a message."""
        if self._takes_one():
            super().handle_cont(event)

    def handle_text(self, event: Frame) -> None:
        """A message, or its beginning."""
        if self._takes_one():
            super().handle_text(event)

    def handle_bytes(self, event: Frame) -> None:
        """A message of bytes, or its beginning."""
        if self._takes_one():
            super().handle_bytes(event)

    def handle_ping(self) -> None:
        """A ping: answered only while answers are taken."""
        if self._takes_one() and self.writable.is_set():
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        """The answer to a ping, or somebody's idea of one."""
        if self._takes_one():
            super().handle_pong(event)

    def pause_writing(self) -> None:
        """The other side takes its time."""
        super().pause_writing()
        self._unread.begin()

    def resume_writing(self) -> None:
        """It has taken something."""
        super().resume_writing()
        self._unread.end()

    def _takes_one(self) -> bool:
        """Whether one more frame is dealt with; after too many the socket is told why, and closed."""
        if self._is_over:
            return False
        if self._frames.take(self.loop.time()):
            return True
        self._is_over = True
        self.door.refusals.add("frames")
        if not self.close_sent:
            self.conn.fail(POLICY_VIOLATION, "too many frames")
            self.transport.write(b"".join(self.conn.data_to_send()))
            self.close_sent = True
        self._linger()
        return False

    def handle_parser_exception(self) -> None:
        """A frame that is none, or too large: the socket is told which, and closed."""
        self._is_over = True
        closed = self.conn.close_sent
        assert closed is not None  # by whoever found out
        self.queue.put_nowait({"type": "websocket.disconnect", "code": closed.code, "reason": closed.reason})
        if not self.close_sent:
            self.transport.write(b"".join(self.conn.data_to_send()))
            self.close_sent = True
        self._linger()

    def _linger(self) -> None:
        """Closed at once, with more of the flood on its way, the connection would be reset and the reason lost."""
        if self.transport.is_closing() or not self.transport.can_write_eof():
            self.transport.close()
            return
        self.transport.write_eof()
        if self.read_paused:
            self.read_paused = False
            self.transport.resume_reading()
        if self.close_timer is not None:
            self.close_timer.cancel()
        self.close_timer = self.loop.call_later(LINGER_S, self.transport.close)  # the application does not close it


def bounded(door: Door) -> tuple[type[BoundedHttp], type[BoundedWebSocket]]:
    """The protocols of one server, which makes one of these for each connection."""
    return (
        type("BoundedHttp", (BoundedHttp,), {"door": door}),
        type("BoundedWebSocket", (BoundedWebSocket,), {"door": door}),
    )
