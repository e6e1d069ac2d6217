"""Every route × every credential: who is let in stands in `tests/support/route_table.py`, and nobody else is."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Iterable, Iterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, get_args
from urllib.parse import urlsplit

import httpx
import pytest
from starlette.routing import BaseRoute, Mount, WebSocketRoute
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Subprotocol

from app.config import LabConfig
from app.lab.lab import Lab
from app.lab.tokens import dashboard_key
from app.web.server import create_app
from tests.support import lab_server as labs
from tests.support.lab_server import EXPERIMENTER_TOKEN, LabServer
from tests.support.route_table import ACCEPTED, LETS_IN, ROUTES, Credential, Route
from tests.support.viser_client import PROTOCOL
from tests.support.wire_client import SHORT, asked, invite, visit, write_study

pytestmark = pytest.mark.slow

SECOND_DEVICE = {**SHORT, 'placement = "same_page_away" ': 'placement = "second_device" '}
METRICS_TOKEN = "a-token-for-prometheus-0123456789abcdef"
BODIES = (b"{}", b"{")
"""An empty object, which most routes cannot use, and what is no JSON: to a stranger they are the same."""


@dataclass(frozen=True)
class Held:
    """What somebody has: headers of requests, and a token that could stand in a link."""

    headers: Mapping[str, Any]
    token: str = "wrong"
    panel_token: str = "wrong"


@dataclass(frozen=True)
class Asked:
    """A lab with somebody in it whose robot is in place, and what everybody else holds."""

    lab: LabServer
    participant: str
    public_id: str
    held: Mapping[Credential, Held]


def token_of(link: str) -> str:
    return urlsplit(link).path.rpartition("/")[2]


def cookies(token: str, panel_token: str) -> Held:
    return Held({"Cookie": f"salab={token}; salab_panel={panel_token}"}, token, panel_token)


def everybody(lab: LabServer, made: Mapping[str, Any]) -> dict[Credential, Held]:
    token, panel_token = token_of(made["link"]), token_of(made["panel_link"])
    other, erased = invite(lab), invite(lab)
    assert asked(
        lab, "POST", f"participants/{erased['participant']}/erase", {"confirm": erased["participant"]}
    ).is_success

    def bearer(token: str) -> Held:
        return Held({"Authorization": f"Bearer {token}"}, token, token)

    def both(made: Mapping[str, Any]) -> Held:
        return cookies(token_of(made["link"]), token_of(made["panel_link"]))

    return {
        "nobody": Held({}),
        "a wrong token": bearer("wrong"),
        "half of the experimenter's token": bearer(EXPERIMENTER_TOKEN[:-1]),
        "the experimenter's token in another scheme": Held({"Authorization": f"Basic {EXPERIMENTER_TOKEN}"}),
        "the experimenter's token without a scheme": Held({"Authorization": EXPERIMENTER_TOKEN}),
        "the experimenter's token as a cookie": Held(
            {"Cookie": "; ".join(f"{name}={EXPERIMENTER_TOKEN}" for name in ("salab", "salab_panel", "salab_desk"))},
            EXPERIMENTER_TOKEN,
            EXPERIMENTER_TOKEN,
        ),
        "no ASCII": Held({"Authorization": b"Bearer \xff\xfe"}, "%ff%fe", "%00"),
        "the participant's token as the experimenter's": Held({"Authorization": f"Bearer {token}"}),
        "the metrics' token": bearer(METRICS_TOKEN),
        "the experimenter's token": bearer(EXPERIMENTER_TOKEN),
        "the dashboard's cookie": Held({"Cookie": f"salab_desk={dashboard_key(EXPERIMENTER_TOKEN)}"}),
        "the participant's cookie": Held({"Cookie": f"salab={token}"}, token, token),
        "the second device's cookie": Held({"Cookie": f"salab_panel={panel_token}"}, panel_token, panel_token),
        "the participant's cookies exchanged": cookies(panel_token, token),
        "another participant's cookies": both(other),
        "the cookies of an erased participant": both(erased),
    }


@pytest.fixture(scope="module")
def asked_lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[LabServer, dict[str, Any]]]:
    """With a scene, and a second device, so that there is something behind every route."""
    folder = tmp_path_factory.mktemp("routes")
    study = write_study(folder, SECOND_DEVICE)
    arguments = ("--robot", "kinematic", "--study", str(study))
    with labs.start(folder / "data", *arguments, environment={"SALAB_METRICS_TOKEN": METRICS_TOKEN}) as lab:
        yield lab, invite(lab)


def routes_of(routes: Iterable[BaseRoute]) -> Iterator[BaseRoute]:
    """All of an app, those of its routers too."""
    for route in routes:
        router = getattr(route, "original_router", None)
        if router is None:
            yield route
        else:
            yield from routes_of(router.routes)


def named(route: BaseRoute) -> Iterator[tuple[str, str]]:
    """A route as the table names it."""
    path = str(getattr(route, "path", ""))
    if isinstance(route, Mount):
        yield "FILES", path
    elif isinstance(route, WebSocketRoute):
        yield "WS", path
    else:
        methods = set(getattr(route, "methods", None) or {"?"}) - {"HEAD"}
        yield from ((method, path) for method in methods)


def test_every_route_of_the_app_stands_in_the_table_and_every_one_in_the_table_exists() -> None:
    app = create_app(Lab(LabConfig(), None))
    existing = [name for route in routes_of(app.routes) for name in named(route)]
    table = [(route.method, route.path) for route in ROUTES]
    assert sorted(existing) == sorted(table), (
        "a new route stands in tests/support/route_table.py, with whom it lets in; one that is gone does not: "
        f"{sorted(set(existing) ^ set(table))}"
    )
    assert len(set(table)) == len(table)


def test_the_table_knows_every_credential() -> None:
    used = {credential for route in ROUTES for credential in route.lets_in}
    assert used == set(LETS_IN) <= set(get_args(Credential))


def expected(route: Route, credential: Credential) -> int:
    if route.open_with is not None:
        return route.open_with
    return route.lets_in.get(credential, route.refused)


def address_of(route: Route, held: Held, there: Asked, participant: str) -> str:
    return route.example or route.path.format(
        token=held.token if route.path.startswith("/p/") else held.panel_token,
        public_id=there.public_id,
        participant=participant,
        trial=1,
        name="figure1.svg",
    )


async def statuses(
    route: Route, credential: Credential, there: Asked, client: httpx.AsyncClient
) -> set[tuple[int, str]]:
    """Status and text of the answers that somebody gets, whatever else the request says."""
    held = there.held[credential]
    if route.method == "WS":
        return {(await opened(route, held, there), "")}
    is_let_in = route.open_with is not None or credential in route.lets_in
    found = set()
    # Whoever is let in changes nothing of anybody who is there; to all others nothing tells who is.
    for participant in ("P999",) if is_let_in else (there.participant, "P999"):
        for body in BODIES[:1] if is_let_in else BODIES:
            content = body if route.method == "POST" else b""
            address = address_of(route, held, there, participant)
            method = "GET" if route.method == "FILES" else route.method
            headers = {**held.headers, "Content-Type": "application/json"}
            answer = await client.request(method, address, content=content, headers=headers)
            client.cookies.clear()  # each request brings what it says and nothing else
            found.add((answer.status_code, "" if is_let_in else answer.text))
    return found


async def opened(route: Route, held: Held, there: Asked) -> int:
    """How a WebSocket's handshake ends; the dashboard's tells nothing before its hello does."""
    url = there.lab.base_url.replace("http", "ws", 1) + address_of(route, held, there, there.participant)
    offered = [Subprotocol(PROTOCOL)] if route.path.endswith(("/scene", "/scene/{participant}")) else None
    cookie = {"Cookie": held.headers["Cookie"]} if "Cookie" in held.headers else {}
    try:
        async with connect(url, additional_headers=cookie, subprotocols=offered, proxy=None, max_size=None) as socket:
            if route.path == "/dashboard/socket":
                scheme, _, said = str(held.headers.get("Authorization", "")).partition(" ")
                said = said if scheme == "Bearer" else "wrong"
                await socket.send(json.dumps({"type": "hello", "token": said}))
                await asyncio.wait_for(socket.recv(), 20)
            return ACCEPTED
    except InvalidStatus as refused:
        return refused.response.status_code
    except ConnectionClosed:
        return 403


@asynccontextmanager
async def somebody_there(lab: LabServer, made: Mapping[str, Any]) -> AsyncIterator[Asked]:
    """The participant's page is open and their robot in place for as long as the block runs."""
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        await player.status("ready")
        public_id = httpx.get(made["link"], trust_env=False, timeout=30.0).headers["location"].split("/")[2]  # noqa: ASYNC210
        yield Asked(lab, made["participant"], public_id, everybody(lab, made))


async def test_each_credential_opens_what_the_table_says_and_nothing_else(
    asked_lab: tuple[LabServer, dict[str, Any]],
) -> None:
    wrong, cells = [], 0
    async with (
        somebody_there(*asked_lab) as there,
        httpx.AsyncClient(base_url=there.lab.base_url, trust_env=False, timeout=30.0) as client,
    ):
        for route in ROUTES:
            for credential in get_args(Credential):
                cells += 1
                found = await statuses(route, credential, there, client)
                want = expected(route, credential)
                got = {status for status, _ in found}
                if got != {want}:
                    wrong.append(f"{route.method} {route.path} with {credential}: {got}, not {want}")
                elif len(found) > 1:
                    wrong.append(f"{route.method} {route.path} with {credential}: the answer tells who is there")
    assert not wrong, "\n" + "\n".join(wrong)
    assert cells == len(ROUTES) * len(get_args(Credential))
