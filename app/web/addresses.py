"""Where the lab lives on the network, and how a link becomes a cookie.

The lab's public address may have a path (https://lab.example/study). Then every address and cookie begins with it,
whether the proxy in front takes it away before it asks the lab or passes it on.
"""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import urlsplit

from fastapi import Request
from fastapi.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from app.lab.lab import Lab
from app.session.interfaces import Role

COOKIES: Mapping[Role, str] = {"participant": "salab", "panel": "salab_panel"}
"""One each: on one machine the path of the panel is below that of the participant's page."""
COOKIE_MAX_AGE_S = 30 * 24 * 3600


def prefix(lab: Lab) -> str:
    """The path of the lab's public address, "" or such as "/study"."""
    return urlsplit(lab.base_url).path.rstrip("/")


def place_of(public_id: str, role: Role) -> str:
    """The path of a page, below the prefix."""
    return f"/s/{public_id}" + ("/panel" if role == "panel" else "")


def set_cookie(response: Response, request: Request, lab: Lab, name: str, token: str, path: str) -> None:
    """Keep a token in the browser, for the addresses below `path` and out of the reach of scripts.

    Lax, because people arrive from mail and from recruitment services.
    """
    secure = request.url.scheme == "https" or lab.base_url.startswith("https")
    response.set_cookie(
        name, token, max_age=COOKIE_MAX_AGE_S, path=prefix(lab) + path, httponly=True, samesite="lax", secure=secure
    )


class Prefixed:
    """ASGI middleware: the app sees its prefix as `root_path`, whether or not a proxy has taken it away."""

    def __init__(self, app: ASGIApp, lab: Lab) -> None:
        self._app = app
        self._lab = lab

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes everything on."""
        root = prefix(self._lab)
        if root and scope["type"] in ("http", "websocket"):
            path = scope["path"]
            is_whole = path == root or path.startswith(f"{root}/")
            scope = {**scope, "root_path": root, "path": path if is_whole else root + path}
        await self._app(scope, receive, send)
