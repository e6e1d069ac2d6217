"""The first thing that sees a request or a socket, and the last that sees an answer: outside of everything else.

It turns away what comes under another host's name (a page of a stranger's whose name leads here), and whoever asks too
much at once; answers HEAD as GET; and sees to it that every answer, however it came to be, tells browsers what it may
do.
"""

from __future__ import annotations

import ipaddress
import math
import time
from collections.abc import Callable
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.config import EVERY_ADDRESS, LOOPBACK
from app.lab.lab import Lab
from app.limits import Bound, BucketsByAddress, network_of
from app.web.security_headers import complete


class Guard:
    """ASGI application around another. `lab.base_url` may become known later."""

    def __init__(self, app: ASGIApp, lab: Lab, now_s: Callable[[], float] = time.monotonic) -> None:
        self._app = app
        self._lab = lab
        self._now_s = now_s
        limits = lab.config.limits
        self._buckets = BucketsByAddress(limits.requests_per_s, limits.requests_burst, limits.addresses)
        self._open: dict[str, int] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on what is in order."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        answer = _completed(send, without_body=scope.get("method") == "HEAD")
        refusal = self._refusal(scope)
        if refusal is not None:
            await _refuse(refusal, scope, receive, answer)
            return
        if scope.get("method") == "HEAD":
            scope = {**scope, "method": "GET"}
        address = address_of(scope)
        self._open[address] = self._open.get(address, 0) + 1
        try:
            await self._app(scope, receive, answer)
        finally:
            self._open[address] -= 1
            if not self._open[address]:
                del self._open[address]

    def _refusal(self, scope: Scope) -> Response | None:
        headers, limits = Headers(scope=scope), self._lab.config.limits
        wrong = wrong_host(headers.getlist("host"), self._lab)
        if wrong:
            return self._refused("host", 421, wrong)
        address = address_of(scope)
        if self._open.get(address, 0) >= limits.connections_per_address:
            text = f"more than {limits.connections_per_address} connections are open from this address"
            return self._refused("connections", 429, text, wait_s=1.0)
        if shows_token(headers, self._lab):
            return None
        wait_s = self._buckets.take(address, self._now_s())
        if wait_s > 0:
            text = f"too many requests from this address; at most {limits.requests_per_s:g} a second are answered"
            return self._refused("requests", 429, text, wait_s)
        return None

    def _refused(self, bound: Bound, status: int, text: str, wait_s: float = 0.0) -> Response:
        self._lab.refusals.add(bound)
        headers = {"Connection": "close"}
        if wait_s > 0:
            headers["Retry-After"] = str(math.ceil(wait_s))
        return JSONResponse({"detail": text}, status, headers=headers)


def shows_token(headers: Headers, lab: Lab) -> bool:
    """Whether a request has the experimenter's token."""
    scheme, _, token = headers.get("authorization", "").partition(" ")
    return scheme.lower() == "bearer" and lab.is_experimenter(token.strip())


def address_of(scope: Scope) -> str:
    """Whom a request or a socket is counted with."""
    client = scope.get("client")
    return network_of(client[0]) if client else ""


def wrong_host(given: list[str], lab: Lab) -> str:
    """Why a request is not for this lab, by its Host header; "" when it is.

    The lab answers to the host of its public address, to the address it listens on, and to loopback's names: none of
    them can be led here by a stranger's name server.
    """
    if len(given) != 1:
        return f"the request has {len(given)} Host headers; it must have one"
    host = host_name(given[0])
    ours = {*LOOPBACK, lab.config.host.lower(), host_name(urlsplit(lab.base_url).netloc)} - {*EVERY_ADDRESS}
    if host in ours or _is_loopback(host):
        return ""
    return f"this lab does not answer to the host {given[0][:200]!r}; --public-url sets the address it is reached at"


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def host_name(netloc: str) -> str:
    """The host of a Host header or of an address, without its port."""
    host = netloc.strip().lower()
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0].rstrip(".")


def _completed(send: Send, without_body: bool) -> Send:
    """`send`, with the headers that an answer lacks, and for HEAD without its body."""

    async def completed(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            message = {**message, "headers": list(message.get("headers", ()))}
            complete(MutableHeaders(scope=message))
        elif without_body and message["type"] == "http.response.body":
            if message.get("more_body"):
                return
            message = {**message, "body": b""}
        await send(message)

    return completed


async def _refuse(refusal: Response, scope: Scope, receive: Receive, send: Send) -> None:
    """The answer to a request; of a socket, to its handshake."""
    if scope["type"] == "http":
        await refusal(scope, receive, send)
        return
    await receive()  # the handshake
    if "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": 1008})
        return
    head: Message = {
        "type": "websocket.http.response.start",
        "status": refusal.status_code,
        "headers": refusal.raw_headers,
    }
    await send(head)
    await send({"type": "websocket.http.response.body", "body": bytes(refusal.body)})
