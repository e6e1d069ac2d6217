"""Bounds below the requests, over real connections: heads and bodies that do not come, too many of anything, and that
others do not notice."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import socket
import struct
import time
from collections.abc import Iterator

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from app.errors import LabError
from app.limits import Limits, Refusals, with_limits
from app.web.connections import Door, Proxies, allowed_connections
from tests.support import lab_server as labs
from tests.support.lab_server import LabServer

pytestmark = pytest.mark.slow

WAIT_S = 20.0
"""Far longer than any bound of the lab below."""
BOUNDS = {
    "head_s": 1,
    "idle_s": 60,
    "head_bytes": 8192,
    "body_s": 1,
    "body_bytes": 100_000,
    "connections_per_address": 40,
    "frames_per_s": 50,
    "frames_burst": 200,
    "unread_s": 0.6,
}


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabServer]:
    """A lab with narrow bounds."""
    given = [f"--limit={name}={value}" for name, value in BOUNDS.items()]
    with labs.start(tmp_path_factory.mktemp("bounds") / "data", "--robot", "kinematic", "--no-scene", *given) as lab:
        yield lab


def dial(lab: LabServer) -> socket.socket:
    made = socket.create_connection(("127.0.0.1", lab.port), timeout=WAIT_S)
    return made


def rest(connection: socket.socket) -> bytes:
    """All that comes until the lab closes; `TimeoutError` when it does not."""
    got = b""
    with contextlib.suppress(ConnectionError):
        while part := connection.recv(65_536):
            got += part
    return got


def whole_answer(connection: socket.socket) -> bytes:
    """One answer on a connection that stays open."""
    got = b""
    while (found := re.search(rb"content-length: (\d+).*?\r\n\r\n", got, re.DOTALL | re.IGNORECASE)) is None or len(
        got
    ) < found.end() + int(found[1]):
        part = connection.recv(65_536)
        assert part, got
        got += part
    return got


def status_and_reason(answer: bytes) -> tuple[int, str]:
    head, _, body = answer.partition(b"\r\n\r\n")
    assert b"frame-ancestors 'none'" in head
    return int(head.split()[1]), json.loads(body)["detail"]


def goes_on(lab: LabServer) -> bool:
    return httpx.get(f"{lab.base_url}/api/health", trust_env=False, timeout=30.0).status_code == 200


@pytest.mark.parametrize(
    "half", [b"G", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"x" * 4000]
)
def test_half_a_head_is_waited_for_so_long_and_no_longer(lab: LabServer, half: bytes) -> None:
    with dial(lab) as connection:
        connection.sendall(half)
        status, reason = status_and_reason(rest(connection))
    assert status == 408 and "head of the request took more than 1 s" in reason


def test_a_head_that_drips_does_not_live_longer(lab: LabServer) -> None:
    """Each byte is a sign of life, and none of them buys time."""
    with dial(lab) as connection:
        connection.settimeout(0.05)
        began_s, answer = time.monotonic(), b""
        with contextlib.suppress(ConnectionError):
            connection.sendall(b"GET / HTTP/1.1\r\nX: ")
            while not answer and time.monotonic() - began_s < WAIT_S:
                connection.sendall(b"x")
                with contextlib.suppress(TimeoutError):
                    answer = connection.recv(65_536)
    assert answer.startswith(b"HTTP/1.1 408 ")


def test_a_connection_that_asks_nothing_is_closed_without_a_word(lab: LabServer) -> None:
    with dial(lab) as connection:
        assert rest(connection) == b""


@pytest.mark.parametrize("answers_first", [False, True], ids=["first request", "after one that was answered"])
def test_half_a_body_is_waited_for_so_long_and_no_longer(lab: LabServer, answers_first: bool) -> None:
    with dial(lab) as connection:
        if answers_first:
            connection.sendall(b"GET /api/health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            assert whole_answer(connection).startswith(b"HTTP/1.1 200 ")
        head = b"POST /api/arbiter/evaluate HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
        connection.sendall(head + b'Content-Length: 500\r\n\r\n{"position_m"')
        status, reason = status_and_reason(rest(connection))
    assert status == 408 and "body of the request took more than 1 s" in reason
    assert "Traceback" not in lab.log()


def test_hundreds_of_half_requests_are_all_gone_and_the_lab_answers_meanwhile(lab: LabServer) -> None:
    with contextlib.ExitStack() as stack:
        half = []
        for _ in range(30):
            half.append(connection := stack.enter_context(dial(lab)))
            connection.sendall(b"POST /join HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-")
        assert goes_on(lab)
        assert [status_and_reason(rest(connection))[0] for connection in half] == [408] * 30


@pytest.mark.parametrize(
    "head", [b"X-A: " + b"a" * 20_000 + b"\r\n", b"".join(b"X-%d: a\r\n" % n for n in range(2000))], ids=["one", "many"]
)
@pytest.mark.parametrize("is_whole", [True, False])
def test_a_head_that_is_too_large_is_refused(lab: LabServer, head: bytes, is_whole: bool) -> None:
    with dial(lab) as connection:
        with contextlib.suppress(ConnectionError):
            connection.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + head + (b"\r\n" if is_whole else b""))
        status, reason = status_and_reason(rest(connection))
    assert status == 431 and "larger than 8192 bytes" in reason


def test_a_body_that_is_too_large_is_refused_before_it_comes_and_the_connection_closed(lab: LabServer) -> None:
    with dial(lab) as connection:
        connection.sendall(b"POST /join HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 400001\r\n\r\n")
        status, reason = status_and_reason(rest(connection))
    assert status == 413 and "100000 bytes" in reason
    with dial(lab) as connection:
        head = b"POST /join HTTP/1.1\r\nHost: 127.0.0.1\r\nExpect: 100-continue\r\nContent-Length: 100001\r\n\r\n"
        connection.sendall(head)
        assert status_and_reason(rest(connection))[0] == 413
    with dial(lab) as connection:
        connection.sendall(b"POST /join HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: " + b"9" * 5000 + b"\r\n\r\n")
        assert rest(connection)[:12] in (b"HTTP/1.1 413", b"HTTP/1.1 400")
    assert "Traceback" not in lab.log()


def test_a_body_that_is_a_little_too_large_is_let_pass_and_the_connection_goes_on(lab: LabServer) -> None:
    with dial(lab) as connection:
        connection.sendall(b"POST /join HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 400000\r\n\r\n" + b"a" * 400_000)
        answer = whole_answer(connection)
        assert answer.startswith(b"HTTP/1.1 413 ") and b"connection: close" not in answer.lower()
        connection.sendall(b"GET /api/health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert whole_answer(connection).startswith(b"HTTP/1.1 200 ")


def test_what_is_no_http_is_told_so(lab: LabServer) -> None:
    with dial(lab) as connection:
        connection.sendall(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 hello\r\n\r\n")
        assert status_and_reason(rest(connection))[0] == 400


def test_one_address_has_so_many_connections(lab: LabServer) -> None:
    most = BOUNDS["connections_per_address"]
    with contextlib.ExitStack() as stack:
        for _ in range(int(most)):  # on keep-alive, and answered: each is counted for sure
            connection = stack.enter_context(dial(lab))
            connection.sendall(b"GET /api/health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            assert whole_answer(connection).startswith(b"HTTP/1.1 200 ")
        with dial(lab) as one_more:
            status, reason = status_and_reason(rest(one_more))
        assert status == 429 and "40 connections are open from this address" in reason
    answers = (goes_on_soon(lab) for _ in range(3))
    assert all(answers)


def goes_on_soon(lab: LabServer) -> bool:
    """Once the lab has seen that the connections above are closed."""
    for _ in range(1000):
        with contextlib.suppress(httpx.HTTPError):
            if goes_on(lab):
                return True
    return False


def test_the_address_of_a_proxy_is_not_counted_and_the_last_place_is_nobodys() -> None:
    refusals = Refusals()
    door = Door(Limits(connections_per_address=2), refusals, Proxies(["10.0.0.0/24", "::1"]), most=5)
    assert [door.enter("192.0.2.1") for _ in range(2)] == [None, None]
    assert (door.enter("192.0.2.1") or (0, ""))[0] == 429
    door.leave("192.0.2.1")
    assert [door.enter("10.0.0.7") for _ in range(3)] == [None, None, None]
    assert (door.enter("10.0.0.7") or (0, ""))[0] == 503
    for address in (*["10.0.0.7"] * 4, *["192.0.2.1"] * 2):
        door.leave(address)
    assert door.open == 0


def test_there_are_never_more_connections_than_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the system refuses to take one more, and the database cannot be opened either."""
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr("resource.setrlimit", lambda what, bounds: asked.append(bounds))
    for soft, hard, expected in ((1024, 524_288, 4000), (1024, 1024, 896), (256, 256, 128), (100_000, -1, 4000)):
        monkeypatch.setattr("resource.getrlimit", lambda what, both=(soft, hard): both)
        assert allowed_connections(Limits()) == expected
    assert asked == [(4128, 524_288), (1024, 1024), (256, 256)]


def reached(lab: LabServer, bound: str) -> float:
    """How often, as the lab's metrics tell."""
    text = httpx.get(f"{lab.base_url}/api/metrics", headers=lab.headers, trust_env=False, timeout=30.0).text
    found = re.search(rf'salab_bounds_reached_total{{bound="{bound}"}} (\S+)', text)
    return float(found[1]) if found else 0.0


def test_who_takes_nothing_of_what_was_asked_for_is_cut_off(lab: LabServer) -> None:
    before, until_s = reached(lab, "unread"), time.monotonic() + WAIT_S
    ask = b"GET /static-offline-docs/swagger-ui-bundle.js HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with dial(lab) as connection:
        connection.sendall(ask * 40)  # more than any buffer on the way holds
        while reached(lab, "unread") == before:
            assert time.monotonic() < until_s, "it was not cut off"
        assert b"HTTP/1.1 200 " in rest(connection)  # as much as had come
    assert goes_on(lab)


# --- sockets -----------------------------------------------------------------------------------------------------


def shake_hands(lab: LabServer, connection: socket.socket) -> None:
    """A WebSocket that nobody has to be known for: the dashboard's, before its token."""
    connection.sendall(
        b"GET /dashboard/socket HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        head += connection.recv(1)
    assert head.startswith(b"HTTP/1.1 101 ")


def frame(opcode: int, payload: bytes = b"", is_last: bool = True) -> bytes:
    size = len(payload)
    length = bytes([0x80 | size]) if size < 126 else b"\xff" + struct.pack("!Q", size)
    return bytes([(0x80 if is_last else 0) | opcode]) + length + b"\0\0\0\0" + payload  # masked with nothing


PIECES = (
    frame(1, b"{", is_last=False) + frame(0, b"x", is_last=False) * 5000,
    frame(1, b"{", is_last=False) + (frame(0, b"x", is_last=False) + frame(9)) * 5000,
)


@pytest.mark.parametrize(
    "flood",
    [frame(9, b"x" * 100) * 5000, frame(10, b"x") * 5000, *PIECES],
    ids=["pings", "pongs", "pieces of a message", "pieces and pings"],
)
def test_a_socket_that_floods_is_told_and_closed(lab: LabServer, flood: bytes) -> None:
    with dial(lab) as connection:
        shake_hands(lab, connection)
        with contextlib.suppress(ConnectionError):
            connection.sendall(flood)
        got = rest(connection)
    assert b"\x03\xf0too many frames" in got
    assert goes_on(lab)
    assert "Traceback" not in lab.log()


def test_a_message_beyond_every_size_closes_the_socket(lab: LabServer) -> None:
    with dial(lab) as connection:
        shake_hands(lab, connection)
        with contextlib.suppress(ConnectionError):
            connection.sendall(frame(1, b"x" * (Limits().frame_bytes + 1)))
        assert b"\x03\xf1" in rest(connection)  # 1009


@pytest.mark.parametrize(
    ("message", "code"), [("x" * 8 * Limits().frame_bytes, 1009), ("x", 1008)], ids=["too large", "too many"]
)
async def test_the_reason_arrives_though_more_is_being_sent(lab: LabServer, message: str, code: int) -> None:
    address = f"ws://127.0.0.1:{lab.port}/dashboard/socket"
    async with connect(address, compression=None, proxy=None) as page:
        with contextlib.suppress(ConnectionClosed):
            while True:
                await page.send(message)
                await asyncio.sleep(0)  # to read meanwhile, as browsers do
        await page.wait_closed()
        assert page.close_code == code


# --- the table of bounds -----------------------------------------------------------------------------------------


def test_each_bound_can_be_set_and_what_is_none_is_told() -> None:
    assert with_limits(["head_s=2.5", "connections = 7"]) == Limits(head_s=2.5, connections=7)
    for text, told in (
        ("heads=1", "no limit 'heads'; there are connections, connections_per_address, head_s"),
        ("head_s", "'' is not a number"),
        ("connections=1.5", "'1.5' is not a whole number"),
        ("head_s=nan", "must be above 0"),
        ("head_s=-1", "must be above 0"),
        ("connections=0", "must be above 0"),
        ("head_s=1e300", "below 1e\\+12"),
    ):
        with pytest.raises(LabError, match=told):
            with_limits([text])


def test_a_proxy_is_an_address() -> None:
    with pytest.raises(LabError, match=r"--trusted-proxy \*: must be the address of a proxy"):
        Proxies(["*"])


def test_every_bound_is_reached_by_its_name_somewhere() -> None:
    """No bound that nothing asks for."""
    sources = "".join(path.read_text(encoding="utf-8") for path in sorted((labs.ROOT / "app").rglob("*.py")))
    for name in Limits.__dataclass_fields__:
        assert re.search(rf"limits(\(\))?\.{name}\b", sources), name
