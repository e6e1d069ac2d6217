"""What every request meets first and every answer last: the host, the browser's orders, HEAD, the rate."""

from __future__ import annotations

import re
import socket
from collections.abc import Iterator
from urllib.parse import urlsplit

import httpx
import pytest
from starlette.responses import PlainTextResponse
from starlette.routing import Route
from starlette.types import Receive, Scope, Send

from app.config import LabConfig
from app.lab.lab import Lab
from app.limits import Limits
from app.web.guard import Guard, wrong_host
from app.web.server import create_app
from tests.support.lab_server import EXPERIMENTER_TOKEN, LabServer
from tests.support.wire_client import invite


@pytest.fixture(scope="module")
def client(quick_lab: LabServer) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=quick_lab.base_url, trust_env=False, timeout=30.0) as client:
        yield client


# --- the host ----------------------------------------------------------------------------------------------------


def lab_at(base_url: str, host: str = "127.0.0.1") -> Lab:
    lab = Lab(LabConfig(host=host, public_url=base_url if base_url.startswith("https") else None), EXPERIMENTER_TOKEN)
    lab.base_url = base_url
    return lab


@pytest.mark.parametrize(
    ("given", "base_url", "host"),
    [
        ("127.0.0.1:8000", "http://127.0.0.1:8000", "127.0.0.1"),
        ("localhost:9000", "http://127.0.0.1:8000", "127.0.0.1"),  # through a tunnel
        ("LOCALHOST", "http://127.0.0.1:8000", "127.0.0.1"),
        ("[::1]:8000", "http://[::1]:8000", "::1"),
        ("lab.example", "https://lab.example/study", "127.0.0.1"),
        ("Lab.Example.:443", "https://lab.example", "0.0.0.0"),
        ("127.0.0.1:8000", "https://lab.example", "127.0.0.1"),  # a proxy that says where it asks
        ("192.168.7.5:8000", "http://192.168.7.5:8000", "192.168.7.5"),
        ("10.0.0.5:8000", "https://lab.example", "10.0.0.5"),
    ],
)
def test_the_lab_answers_to_its_own_names(given: str, base_url: str, host: str) -> None:
    assert wrong_host([given], lab_at(base_url, host)) == ""


@pytest.mark.parametrize(
    "given",
    [
        "evil.example",
        "lab.example.evil.example",
        "127.evil.example",  # a name, not an address
        "127.0.0.1.evil.example:8000",
        "localhost.evil.example",
        "evil.example:127.0.0.1",
        "",
        "0.0.0.0:8000",
        "[::]",
        "lab.example@evil.example",
    ],
)
@pytest.mark.parametrize("base_url", ["http://127.0.0.1:8000", "https://lab.example/study"])
def test_a_name_of_a_strangers_leads_nowhere(given: str, base_url: str) -> None:
    """It may lead here: then a page of the stranger's would be of the same origin as the lab."""
    told = wrong_host([given], lab_at(base_url, "0.0.0.0"))
    assert repr(given) in told and "--public-url" in told


def test_a_request_has_one_host() -> None:
    lab = lab_at("http://127.0.0.1:8000")
    assert "0 Host headers" in wrong_host([], lab)
    assert "2 Host headers" in wrong_host(["localhost", "evil.example"], lab)


def test_another_host_is_answered_with_421_by_every_kind_of_address(quick_lab: LabServer, client: httpx.Client) -> None:
    for path in ("/", "/api/health", "/static/style.css", "/p/anything", "/docs", "/nowhere", "/api/sessions"):
        answer = client.get(path, headers={"Host": "evil.example", **quick_lab.headers})
        assert answer.status_code == 421
        assert "evil.example" in answer.json()["detail"]
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]


@pytest.mark.parametrize("path", ["/dashboard/socket", "/s/0123456789abcdef/socket"])
def test_so_is_a_socket(quick_lab: LabServer, path: str) -> None:
    handshake = (
        f"GET {path} HTTP/1.1\r\nHost: evil.example\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", quick_lab.port), timeout=20) as connection:
        connection.sendall(handshake.encode())
        answer = connection.makefile("rb").read()
    assert answer.startswith(b"HTTP/1.1 421 ") and b"evil.example" in answer
    assert b"frame-ancestors 'none'" in answer.lower()


# --- what a browser is told --------------------------------------------------------------------------------------


def policy(answer: httpx.Response) -> dict[str, str]:
    """The content policy of an answer, by directive."""
    directives = answer.headers["content-security-policy"].split(";")
    return {name: value for name, _, value in (one.strip().partition(" ") for one in directives)}


def test_every_answer_of_every_kind_says_who_may_frame_it(quick_lab: LabServer, client: httpx.Client) -> None:
    link = urlsplit(invite(quick_lab)["link"]).path
    kinds = [
        client.get("/"),
        client.get("/dashboard"),
        client.get("/join"),
        client.get("/docs"),
        client.get("/openapi.json"),
        client.get("/static/style.css"),
        client.get("/static/participant/participant.js"),
        client.get("/static/nowhere.js"),
        client.get("/static-offline-docs/swagger-ui.css"),
        client.get("/nowhere"),
        client.get(link),  # 303
        client.get("/s/0123456789abcdef"),  # 307
        client.get("/s/0123456789abcdef/"),  # 403
        client.get("/s/0123456789abcdef/scene/"),
        client.get("/s/0123456789abcdef/why"),
        client.get("/dashboard/report/"),
        client.get("/dashboard/scene/P001/"),
        client.get("/favicon.ico"),  # 204
        client.get("/api/health"),
        client.get("/api/sessions"),
        client.get("/api/sessions", headers=quick_lab.headers),
        client.post("/api/arbiter/evaluate", json={}),  # 422
        client.post("/api/arbiter/evaluate", content=b"x" * 1_000_001),  # 413
        client.post("/api/arbiter/evaluate", content=iter([b"x"])),  # 411
        client.delete("/api/health"),  # 405
        client.get("/static/style.css", headers={"If-None-Match": client.get("/static/style.css").headers["etag"]}),
    ]
    assert {200, 204, 303, 304, 307, 403, 404, 405, 411, 413, 422} <= {answer.status_code for answer in kinds}
    for answer in kinds:
        assert policy(answer)["frame-ancestors"] in ("'none'", "'self'"), answer.request.url
        assert policy(answer)["base-uri"] == "'none'"
        expected = "DENY" if policy(answer)["frame-ancestors"] == "'none'" else "SAMEORIGIN"
        assert answer.headers["x-frame-options"] == expected
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"


async def test_an_error_nobody_thought_of_says_so_as_well() -> None:
    lab = lab_at("http://127.0.0.1")
    app = create_app(lab)

    @app.get("/broken")
    async def broken() -> None:
        raise ZeroDivisionError

    transport = httpx.ASGITransport(app, raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
        answer = await client.get("/broken")
    assert answer.status_code == 500
    assert policy(answer)["frame-ancestors"] == "'none'"


def test_the_page_of_the_api_runs_its_own_script_and_nothing_from_elsewhere(client: httpx.Client) -> None:
    answer = client.get("/docs")
    assert "unsafe-inline" not in policy(answer)["script-src"] and "sha256-" in policy(answer)["script-src"]
    loaded = re.findall(r'(?:src|href)="([^"]+)"', answer.text)
    assert len(loaded) >= 3
    for address in loaded:
        assert address.startswith("/static-offline-docs/")
        assert client.get(address).status_code == 200


# --- HEAD --------------------------------------------------------------------------------------------------------


def test_head_answers_like_get_on_every_route(quick_lab: LabServer, client: httpx.Client) -> None:
    app = create_app(lab_at("http://127.0.0.1"))
    pages = [route.path for route in app.routes if isinstance(route, Route) and "GET" in (route.methods or ())]
    paths = [*pages, *(path for path, asked in app.openapi()["paths"].items() if "get" in asked)]
    assert len(paths) > 20
    of_someone = {"public_id": "0123456789abcdef", "token": "x", "participant": "P001", "trial": "1", "name": "a.svg"}
    for path in [*paths, "/static/style.css", "/static/nowhere.js", "/nowhere"]:
        asked = re.sub(r"\{(\w+)[^}]*\}", lambda found: of_someone[found[1]], path)
        for headers in ({}, quick_lab.headers):
            got, head = client.get(asked, headers=headers), client.head(asked, headers=headers)
            assert head.status_code == got.status_code, asked
            assert head.content == b""
            ignored = {"date", "set-cookie", *(("content-length", "etag", "last-modified") if asked in CHANGES else ())}
            assert {n: v for n, v in head.headers.items() if n not in ignored} == {
                n: v for n, v in got.headers.items() if n not in ignored
            }, asked


CHANGES = {"/api/export", "/api/sessions", "/api/roster", "/api/metrics"}
"""What others in this session change meanwhile, or is made anew each time."""


def test_head_is_no_way_around_a_post(client: httpx.Client) -> None:
    assert client.head("/api/arbiter/evaluate").status_code == client.get("/api/arbiter/evaluate").status_code == 405


# --- the rate ----------------------------------------------------------------------------------------------------


async def answered(scope: Scope, receive: Receive, send: Send) -> None:
    await PlainTextResponse("done")(scope, receive, send)


def asker(guard: Guard, address: str) -> httpx.AsyncClient:
    transport = httpx.ASGITransport(guard, client=(address, 1))
    return httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1")


async def test_who_asks_too_much_waits_and_nobody_else() -> None:
    now_s = [0.0]
    lab = Lab(LabConfig(limits=Limits(requests_per_s=2.0, requests_burst=3)), EXPERIMENTER_TOKEN)
    guard = Guard(answered, lab, lambda: now_s[0])
    async with asker(guard, "192.0.2.1") as busy, asker(guard, "192.0.2.2") as other:
        assert [(await busy.get("/")).status_code for _ in range(4)] == [200, 200, 200, 429]
        refusal = await busy.get("/")
        assert refusal.headers["retry-after"] == "1" and refusal.headers["connection"] == "close"
        assert "2 a second" in refusal.json()["detail"]
        assert (await other.get("/")).status_code == 200
        bearer = {"Authorization": f"Bearer {EXPERIMENTER_TOKEN}"}
        assert [(await busy.get("/", headers=bearer)).status_code for _ in range(10)] == [200] * 10
        now_s[0] = 0.5
        assert [(await busy.get("/")).status_code for _ in range(2)] == [200, 429]
    assert lab.refusals.counts["requests"] == 3


async def test_one_house_of_ipv6_is_one_address() -> None:
    lab = Lab(LabConfig(limits=Limits(requests_per_s=1.0, requests_burst=2)), EXPERIMENTER_TOKEN)
    guard = Guard(answered, lab, lambda: 0.0)
    statuses = []
    for address in ("2001:db8::1", "2001:db8::2", "2001:db8::3", "2001:db8:0:1::1", "::ffff:192.0.2.1"):
        async with asker(guard, address) as client:
            statuses.append((await client.get("/")).status_code)
    assert statuses == [200, 200, 429, 200, 200]


def test_a_class_behind_one_address_loads_its_pages_at_once() -> None:
    """24 people, each with page, second device and views, and once more after a reload; the bounds hold all of it."""
    limits = Limits()
    files = 90  # of a page; it has fewer
    assert limits.requests_burst >= 24 * (files + 40)
    assert limits.connections_per_address >= 24 * 15 * 2
    assert limits.joins_per_min >= 2 * 24
