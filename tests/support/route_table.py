"""Every route of the lab and whom it lets in. A route that is added stands here, or `tests/web/test_route_table.py`
fails; so does one that lets in anybody who is not named.

`OPEN` routes answer everybody alike. Of all others the table names the credentials that are let in, with the status
they get; every other credential gets `refused`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Credential = Literal[
    "nobody",
    "a wrong token",
    "half of the experimenter's token",
    "the experimenter's token in another scheme",
    "the experimenter's token without a scheme",
    "the experimenter's token as a cookie",
    "no ASCII",
    "the participant's token as the experimenter's",
    "the metrics' token",
    "the experimenter's token",
    "the dashboard's cookie",
    "the participant's cookie",
    "the second device's cookie",
    "the participant's cookies exchanged",
    "another participant's cookies",
    "the cookies of an erased participant",
]
LETS_IN: tuple[Credential, ...] = (
    "the metrics' token",
    "the experimenter's token",
    "the dashboard's cookie",
    "the participant's cookie",
    "the second device's cookie",
    "another participant's cookies",
)
"""Those that open anything at all."""

ACCEPTED = 101
"""Of a WebSocket."""


@dataclass(frozen=True)
class Route:
    """One method of one route; of a folder of files, its place. `WS` is a WebSocket.

    Attributes:
        open_with: what everybody gets; None for a route that asks who it is.
        lets_in: what those get who are let in.
        refused: what all others get.
        example: an address of it, where the template alone is none.
    """

    method: Literal["GET", "POST", "DELETE", "WS", "FILES"]
    path: str
    open_with: int | None = None
    lets_in: Mapping[Credential, int] = field(default_factory=dict)
    refused: int = 403
    example: str = ""


def for_everybody(
    method: Literal["GET", "POST", "WS", "FILES"], path: str, status: int = 200, example: str = ""
) -> Route:
    """A route that asks nobody who they are."""
    return Route(method, path, open_with=status, example=example)


def for_experimenters(method: Literal["GET", "POST", "DELETE"], path: str, status: int) -> Route:
    """A route of the API that wants the experimenter's token. `status` is what it answers to an empty object, about
    a participant that is not there."""
    return Route(method, path, lets_in={"the experimenter's token": status})


def for_dashboards(method: Literal["GET", "WS"], path: str, status: int) -> Route:
    """What a dashboard opens in frames."""
    return Route(method, path, lets_in={"the dashboard's cookie": status})


def for_participants(method: Literal["GET", "WS"], path: str, status: int = 200) -> Route:
    """A page of one participant, or what it asks for."""
    return Route(method, path, lets_in={"the participant's cookie": status})


def for_second_devices(method: Literal["GET", "WS"], path: str, status: int = 200) -> Route:
    """The page of one participant's second device, or what it asks for."""
    return Route(method, path, lets_in={"the second device's cookie": status})


ROUTES: tuple[Route, ...] = (
    # pages and files that know nothing
    for_everybody("GET", "/"),
    for_everybody("GET", "/dashboard"),
    for_everybody("GET", "/favicon.ico", 204),
    for_everybody("FILES", "/static", example="/static/participant/participant.js"),
    for_everybody("FILES", "/static-offline-docs", example="/static-offline-docs/swagger-ui.css"),
    for_everybody("GET", "/docs"),
    for_everybody("GET", "/openapi.json"),
    # open parts of the API; the study that is asked here has no open link
    for_everybody("GET", "/api/health"),
    for_everybody("GET", "/api/health/live"),
    for_everybody("GET", "/api/health/ready"),
    for_everybody("GET", "/api/protocol"),
    for_everybody("POST", "/api/arbiter/evaluate", 422),
    for_everybody("GET", "/join", 404),
    for_everybody("GET", "/join/offer", 404),
    for_everybody("POST", "/join", 422),
    # links: the token is the credential
    Route("GET", "/p/{token}", lets_in={"the participant's cookie": 303, "another participant's cookies": 303}),
    Route("GET", "/d/{token}", lets_in={"the second device's cookie": 303, "another participant's cookies": 303}),
    # one participant's pages
    for_participants("GET", "/s/{public_id}/"),
    for_participants("GET", "/s/{public_id}/scene/"),
    for_participants("GET", "/s/{public_id}/second-device.svg"),
    for_participants("GET", "/s/{public_id}/why"),
    for_participants("WS", "/s/{public_id}/socket", ACCEPTED),
    for_participants("WS", "/s/{public_id}/scene", ACCEPTED),
    for_second_devices("GET", "/s/{public_id}/panel/"),
    for_second_devices("GET", "/s/{public_id}/panel/why"),
    for_second_devices("WS", "/s/{public_id}/panel/socket", ACCEPTED),
    # the dashboard's frames
    for_dashboards("GET", "/dashboard/scene/{participant}/", 200),
    for_dashboards("GET", "/dashboard/report/", 404),
    for_dashboards("GET", "/dashboard/report/figures/{name}", 404),
    for_dashboards("WS", "/dashboard/scene/{participant}", ACCEPTED),
    # the experimenter's socket: it opens, and tells nothing before the token is said in it
    Route("WS", "/dashboard/socket", lets_in={"the experimenter's token": ACCEPTED}),
    # the experimenter's API
    Route("GET", "/api/metrics", lets_in={"the experimenter's token": 200, "the metrics' token": 200}),
    for_experimenters("GET", "/api/sessions", 200),
    for_experimenters("POST", "/api/desk", 200),
    for_experimenters("DELETE", "/api/desk", 200),
    for_experimenters("GET", "/api/export", 200),
    for_experimenters("GET", "/api/export/progress", 200),
    for_experimenters("DELETE", "/api/export", 200),
    for_experimenters("GET", "/api/export/file", 409),
    for_experimenters("POST", "/api/export", 202),
    for_experimenters("POST", "/api/participants", 201),
    for_experimenters("GET", "/api/roster", 200),
    for_experimenters("POST", "/api/qr", 422),
    for_experimenters("GET", "/api/quality", 200),
    for_experimenters("POST", "/api/quality/{participant}/{trial}", 422),
    for_experimenters("GET", "/api/summary", 200),
    for_experimenters("GET", "/api/report", 200),
    for_experimenters("POST", "/api/report", 202),
    for_experimenters("POST", "/api/participants/{participant}/reject", 422),
    for_experimenters("POST", "/api/participants/{participant}/withdraw", 404),
    for_experimenters("POST", "/api/participants/{participant}/erase", 422),
    for_experimenters("POST", "/api/participants/{participant}/link", 404),
    for_experimenters("POST", "/api/sessions/{participant}/start", 404),
    for_experimenters("POST", "/api/sessions/{participant}/pause", 404),
    for_experimenters("POST", "/api/sessions/{participant}/resume", 404),
    for_experimenters("POST", "/api/sessions/{participant}/repeat_practice", 404),
    for_experimenters("POST", "/api/sessions/{participant}/abort_trial", 422),
    for_experimenters("POST", "/api/sessions/{participant}/free_arm", 404),
    for_experimenters("POST", "/api/sessions/{participant}/abort", 422),
    for_experimenters("GET", "/api/sessions/{participant}/heatmap", 404),
    for_experimenters("POST", "/api/sessions/{participant}/note", 422),
    for_experimenters("POST", "/api/sessions/{participant}/mark", 422),
    for_experimenters("POST", "/api/sessions/{participant}/message", 422),
    for_experimenters("POST", "/api/sessions/{participant}/help_seen", 404),
)

API = tuple(route for route in ROUTES if route.path.startswith("/api/") or route.path == "/join/offer" or
            (route.method, route.path) == ("POST", "/join"))  # fmt: skip
"""What stands in the OpenAPI document."""
OPEN_ROUTES = {route.path for route in API if route.open_with is not None}
EXPERIMENTERS_ROUTES = [(route.method, route.path) for route in API if route.open_with is None]
