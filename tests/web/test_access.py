"""Who may do what: links, cookies, the experimenter's token; and that a refusal tells nothing."""

from __future__ import annotations

import http.cookies
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect as sync_connect

from app.lab import tokens as auth
from app.simulated.connection import enter
from app.web.access import ErrorReply
from app.wire import PROTOCOL_VERSION, Hello
from tests.support.lab_server import EXPERIMENTER_TOKEN, LabServer
from tests.support.route_table import OPEN_ROUTES
from tests.support.wire_client import events, invite, seen_by_experimenter, stored, visit


@pytest.fixture(scope="module")
def client(quick_lab: LabServer) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=quick_lab.base_url, trust_env=False, timeout=30.0) as client:
        yield client


@pytest.fixture(scope="module")
def someone(quick_lab: LabServer) -> dict[str, Any]:
    """A participant with both links."""
    return invite(quick_lab)


def test_tokens_are_long_and_stored_only_as_hashes() -> None:
    token = auth.new_token()
    assert len(token) * 6 >= 128
    assert token != auth.new_token()
    assert token not in auth.token_hash(token)
    assert auth.same_token(token, token) and not auth.same_token(token, token[:-1])


def test_tokens_of_any_text_can_be_compared() -> None:
    assert auth.same_token("é\x00", "é\x00")
    assert not auth.same_token("é", "e")
    assert not auth.same_token("", "e")


def test_whoever_guesses_tokens_has_to_wait_and_nobody_else() -> None:
    wrong = auth.Attempts(allowed=3, within_s=60.0, addresses=2)
    assert [wrong.add("a", f"guess {n}", float(n)) for n in range(3)] == [0.0, 0.0, 0.0]
    assert wrong.add("a", "guess 3", 10.0) == 50.0
    assert wrong.add("a", "guess 2", 10.0) == 0.0  # a page left open with a stale token is not guessing
    assert wrong.add("b", "guess 3", 10.0) == 0.0
    assert wrong.add("a", "guess 4", 60.0) == 0.0  # the first guess is a minute ago
    for number in range(100):
        wrong.add(f"c{number}", "guess", 61.0)
    assert len(wrong._tried) == 2


def test_too_many_wrong_tokens_are_429_and_the_right_one_still_opens(start_lab: Callable[..., LabServer]) -> None:
    lab = start_lab("--robot", "kinematic", "--no-scene")
    with httpx.Client(base_url=lab.base_url, trust_env=False, timeout=30.0) as guesser:
        answers = [
            guesser.get("/api/sessions", headers={"Authorization": f"Bearer guess-{number}"}) for number in range(11)
        ]
        assert [answer.status_code for answer in answers] == [403] * 10 + [429]
        assert 0 < int(answers[-1].headers["retry-after"]) <= 60
        assert "try again in" in answers[-1].json()["detail"]
        assert guesser.get("/api/sessions", headers=lab.headers).status_code == 200
    socket = lab.base_url.replace("http", "ws", 1) + "/dashboard/socket"
    with sync_connect(socket, proxy=None) as guess:
        guess.send('{"type": "hello", "token": "guess-11"}')
        with pytest.raises(ConnectionClosed) as closed:
            guess.recv(timeout=20)
    assert closed.value.rcvd is not None and "too many wrong tokens" in closed.value.rcvd.reason


def test_every_refusal_of_a_route_is_declared_as_what_is_sent(client: httpx.Client) -> None:
    """None is FastAPI's own; only the open link says in its own words why nobody can begin, and a lab that is not well
    how it is."""
    own = {
        **{(path, status): {"JoinReply"} for path in ("/join", "/join/offer") for status in ("400", "404", "409")},
        **{(path, "503"): {"JoinReply", "ErrorReply"} for path in ("/join", "/join/offer")},
        ("/api/health", "503"): {"HealthReply"},
        ("/api/health/ready", "503"): {"ReadyReply"},
    }
    described = client.get("/openapi.json").json()
    assert not {"HTTPValidationError", "ValidationError"} & set(described["components"]["schemas"])
    for path, methods in described["paths"].items():
        for method, route in methods.items():
            refused = {status: reply for status, reply in route["responses"].items() if status >= "400"}
            takes_nothing = path == "/api/metrics"
            expected = {"403", "429"} if takes_nothing else {"403", "422", "429"}
            assert path in OPEN_ROUTES or expected <= set(refused), (method, path)
            for status, reply in refused.items():
                schema = reply["content"]["application/json"]["schema"]
                named = {one["$ref"].rpartition("/")[2] for one in schema.get("anyOf", [schema])}
                assert named == own.get((path, status), {"ErrorReply"}), (method, path, status)


def test_what_is_refused_is_answered_as_declared(client: httpx.Client, quick_lab: LabServer) -> None:
    def refusal(status: int, answer: httpx.Response) -> ErrorReply:
        assert answer.status_code == status
        told = answer.json()
        read = ErrorReply.model_validate(told)
        assert set(told) <= set(ErrorReply.model_fields) and read.detail
        return read

    def evaluate(content: bytes) -> httpx.Response:
        return client.post("/api/arbiter/evaluate", content=content, headers={"Content-Type": "application/json"})

    assert refusal(403, client.get("/api/sessions")).problems is None
    wrong = refusal(422, evaluate(b'{"goals_m": []}'))
    assert wrong.problems is not None
    assert {problem.field for problem in wrong.problems} == {"position_m", "momentum", "goals_m"}
    assert wrong.detail == "; ".join(f"{problem.field}: {problem.message}" for problem in wrong.problems)
    unreadable = refusal(422, evaluate(b'{"alpha": ' + b"[" * 20_000))
    assert unreadable.problems is not None and [problem.field for problem in unreadable.problems] == ["body"]
    nobody = client.post("/api/sessions/P999/pause", json={}, headers=quick_lab.headers)
    assert refusal(404, nobody).problems is None
    slip = client.post("/api/qr", json={"link": "elsewhere"}, headers=quick_lab.headers)
    assert refusal(422, slip).problems is None


@pytest.mark.parametrize("path", ["participant/README.md", "README.md", "wire/%52EADME.MD", "./hands//README.md"])
def test_the_readmes_beside_what_pages_load_are_not_served(client: httpx.Client, path: str) -> None:
    assert client.get("/static/participant/participant.js").status_code == 200
    assert client.get(f"/static/{path}").status_code == 404


def test_the_printed_link_carries_the_token_behind_the_hash(quick_lab: LabServer, client: httpx.Client) -> None:
    parts = urlsplit(quick_lab.experimenter_link)
    assert (parts.path, parts.query) == ("/dashboard", "")
    token = parts.fragment.removeprefix("token=")
    assert client.get("/api/sessions", headers={"Authorization": f"Bearer {token}"}).status_code == 200
    assert client.get("/dashboard").status_code == 200  # the page itself knows nothing


def test_a_link_sets_a_cookie_that_scripts_cannot_read(client: httpx.Client, someone: dict[str, Any]) -> None:
    for link, name, path in (("link", "salab", "/s/{}"), ("panel_link", "salab_panel", "/s/{}/panel")):
        response = httpx.get(someone[link], trust_env=False, timeout=30.0)
        assert response.status_code == 303
        place = response.headers["location"]
        public_id = place.split("/")[2]
        cookie = http.cookies.SimpleCookie(response.headers["set-cookie"])[name]
        assert cookie["path"] == path.format(public_id)
        assert cookie["httponly"] is True
        assert cookie["samesite"] == "lax"
        assert not cookie["secure"]  # over plain HTTP on loopback a secure cookie would never come back
        assert int(cookie["max-age"]) > 3600
        assert "domain" not in response.headers["set-cookie"].lower()
        assert response.headers["referrer-policy"] == "no-referrer"
        assert someone["participant"] not in place  # the address bar does not tell who it is


def test_behind_https_the_cookie_is_secure(start_lab: Callable[..., LabServer]) -> None:
    lab = start_lab("--robot", "kinematic", "--no-scene", "--public-url", "https://lab.example/")
    assert lab.demo_link.startswith("https://lab.example/p/")
    assert lab.experimenter_link.startswith("https://lab.example/dashboard#token=")
    token = urlsplit(lab.demo_link).path
    # What it prints is the public address; where it listens is told by the process, here by its own log.
    response = httpx.get(f"http://127.0.0.1:{lab.port}{token}", trust_env=False, timeout=30.0)
    assert response.status_code == 303
    assert "Secure" in response.headers["set-cookie"]


def test_pages_say_the_same_to_a_stranger_whoever_exists(client: httpx.Client, someone: dict[str, Any]) -> None:
    public_id = httpx.get(someone["link"], trust_env=False, timeout=30.0).headers["location"].split("/")[2]
    token = urlsplit(someone["link"]).path.rpartition("/")[2]
    for template in ("/s/{}/", "/s/{}/panel/", "/s/{}/scene/", "/s/{}"):
        answers = [
            client.get(template.format(name), headers=headers)
            for name in (public_id, "0123456789abcdef")
            for headers in ({}, {"Cookie": "salab=wrong; salab_panel=wrong"})
        ]
        assert {answer.status_code for answer in answers} == ({403} if template != "/s/{}" else {307})
        assert len({answer.text for answer in answers}) == 1 or template == "/s/{}"
    links = [client.get(path) for path in (f"/p/{token}x", "/p/wrong", f"/d/{token}", "/p/%00", "/d/%ff%fe", "/p/é")]
    assert {link.status_code for link in links} == {403}
    assert len({link.text for link in links}) == 1
    assert all("set-cookie" not in link.headers for link in links)


async def refused(url: str, **headers: str) -> int:
    """The status with which a WebSocket handshake is refused."""
    with pytest.raises(InvalidStatus) as info:
        async with connect(url, additional_headers=headers, proxy=None):
            pass
    return info.value.response.status_code


async def test_cookies_open_only_their_own_sockets(quick_lab: LabServer, someone: dict[str, Any]) -> None:
    participant, panel = await enter(someone["link"]), await enter(someone["panel_link"])
    other = await enter(invite(quick_lab)["link"])
    scene_url = participant.socket_url.removesuffix("socket") + "scene"
    token, panel_token = participant.cookie.partition("=")[2], panel.cookie.partition("=")[2]
    assert participant.socket_url != panel.socket_url
    wrong_cookies = [
        "",
        other.cookie,
        panel.cookie,
        f"salab={panel_token}",
        "salab=wrong",
        f"salab={EXPERIMENTER_TOKEN}",
    ]
    for url in (participant.socket_url, scene_url, participant.socket_url.replace("/s/", "/s/0")):
        for cookie in wrong_cookies:
            assert await refused(url, Cookie=cookie) == 403
    for cookie in ("", participant.cookie, f"salab_panel={token}", other.cookie):
        assert await refused(panel.socket_url, Cookie=cookie) == 403
    for access in (participant, panel):
        async with connect(access.socket_url, additional_headers={"Cookie": access.cookie}, proxy=None) as socket:
            await socket.send(Hello(protocol=PROTOCOL_VERSION, client="x").model_dump_json())
            assert '"welcome"' in str(await socket.recv())


async def test_a_page_of_another_site_opens_no_socket(quick_lab: LabServer, someone: dict[str, Any]) -> None:
    access = await enter(someone["link"])
    for origin in ("http://evil.example", "null", "http://127.0.0.1:1", quick_lab.base_url + ".evil.example"):
        assert await refused(access.socket_url, Cookie=access.cookie, Origin=origin) == 403
    headers = {"Cookie": access.cookie, "Origin": quick_lab.base_url}
    async with connect(access.socket_url, additional_headers=headers, proxy=None):
        pass


def test_the_disk_holds_no_token_in_clear(quick_lab: LabServer, someone: dict[str, Any]) -> None:
    httpx.get(someone["link"], trust_env=False, timeout=30.0)
    secrets = [urlsplit(someone[name]).path.rpartition("/")[2].encode() for name in ("link", "panel_link")]
    found = b""
    for path in quick_lab.data_dir.rglob("*"):
        found += path.read_bytes() if path.is_file() else b""
    assert auth.token_hash(secrets[0].decode()).encode() in found
    for secret in (*secrets, EXPERIMENTER_TOKEN.encode()):
        assert secret not in found
        assert secret.decode() not in quick_lab.log().replace(quick_lab.experimenter_link, "").replace(
            EXPERIMENTER_TOKEN, "", quick_lab.log().count("READY")
        )


async def test_a_mail_scanner_that_follows_the_link_starts_nothing(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with httpx.AsyncClient(headers={"User-Agent": "scanner/1.0"}, trust_env=False, timeout=30.0) as scanner:
        for _ in range(3):
            assert (await scanner.get(made["link"])).status_code == 303
    seen = seen_by_experimenter(quick_lab, made["participant"])
    assert (seen["state"], seen["connected"]) == ("consent", False)
    assert events(quick_lab, made["participant"]) == []
    async with visit(made["link"]) as player:  # the link still works
        await player.page("consent")
    with stored(quick_lab) as store:
        identities = dict(store.identities(made["participant"]))
    assert set(identities) == {"user_agent_participant"}  # of the page alone; apart from the record, never exported
    assert "scanner" not in identities["user_agent_participant"]


def test_pages_may_load_nothing_from_elsewhere(client: httpx.Client) -> None:
    response = client.get("/")
    assert response.status_code == 200
    assert "default-src 'self'" in response.headers["content-security-policy"]
    assert response.headers["x-content-type-options"] == "nosniff"
    assert response.headers["x-frame-options"] == "DENY"
