"""Requests are counted by the template of their route: addresses have tokens and ids in them, and no end.

Counted (outside of all) ─► … ─► Named (around the router) ─► the route
   method, status, seconds ◄────── its template
"""

from __future__ import annotations

import time

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.monitoring.metrics import Metrics

NONE = "(none)"
"""No route of the lab's."""
_TEMPLATE = "salab.template"


class Named:
    """ASGI middleware: notes which route a request came to, where `Counted` finds it."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes everything on."""
        try:
            await self._app(scope, receive, send)
        finally:
            if _TEMPLATE in scope:
                scope[_TEMPLATE].append(template_of(scope))


class Counted:
    """ASGI middleware: counts what was answered to requests."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes everything on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        template: list[str] = []  # one list, in however many copies of the scope
        status, began_s = 500, time.perf_counter()

        async def noting(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self._app({**scope, _TEMPLATE: template}, receive, noting)
        finally:
            route = template[-1] if template else NONE
            self._metrics.answered(scope["method"], route, status, time.perf_counter() - began_s)


def template_of(scope: Scope) -> str:
    """Of the route a request came to: `/p/{token}`, `/static` for all that is below, `(none)` for nothing of ours."""
    route = scope.get("route")
    if route is not None:
        return str(route.path)
    if scope.get("endpoint") is None:
        return NONE
    path: str = scope["path"].removeprefix(scope.get("app_root_path", scope.get("root_path", "")))
    return "/" + path.split("/")[1]  # a folder of files, or the pages of the documentation
