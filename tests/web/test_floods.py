"""Pages that say too much: what they cost, what they are told, and that nobody else notices."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import httpx
import pytest
from fastapi import HTTPException, WebSocket
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from app.config import LabConfig
from app.lab.lab import Lab
from app.limits import Limits, Meter, Refusals
from app.session.session import LiveSession
from app.simulated.connection import enter
from app.web import arbiter_api
from app.web import participant_socket as sockets
from app.wire import PROTOCOL_VERSION, Heartbeat, Hello, Input, Message, Tick, Welcome
from tests.support.lab_server import EXPERIMENTER_TOKEN, LabServer
from tests.support.wire_client import invite, visit

pytestmark = pytest.mark.slow

HELLO = Hello(protocol=PROTOCOL_VERSION, client="x").model_dump_json()
WAIT_S = 20.0


def note(number: int, size: int = 10) -> str:
    return json.dumps({"type": "note", "id": f"n{number}", "name": "hidden", "data": {"a": "x" * size}})


def submit(number: int) -> str:
    return json.dumps({"type": "submit", "id": f"s{number}", "step": "help", "data": {"text": "x" * 100}})


class FakeSocket:
    """A page's connection: says what stands in `frames`, one when asked for one, and then nothing more."""

    def __init__(self, frames: list[str]) -> None:
        self.frames = [HELLO, *frames]
        self.read = 0
        self.sent: list[dict[str, Any]] = []
        self.closed: list[int] = []
        self.is_idle = asyncio.Event()

    async def receive(self) -> dict[str, Any]:
        if self.read == len(self.frames):
            self.is_idle.set()
            await asyncio.Event().wait()
        self.read += 1
        return {"type": "websocket.receive", "text": self.frames[self.read - 1]}

    async def send_text(self, data: str) -> None:
        self.sent.append(json.loads(data))

    async def close(self, code: int, reason: str = "") -> None:
        self.closed.append(code)


class SlowSession:
    """Deals with nothing by itself; `deal` does, with the oldest."""

    def __init__(self, pace: str = "real_time") -> None:
        self.enrolment = SimpleNamespace(pace=pace)
        self.got: list[Message] = []
        self.heard = asyncio.Event()
        self._waiting: list[Callable[[], None]] = []

    def attach(self, client: sockets.SocketClient) -> None:
        pass

    def detach(self, client: sockets.SocketClient) -> None:
        pass

    def receive(self, client: sockets.SocketClient, message: Message, dealt: Callable[[], None] | None = None) -> None:
        self.got.append(message)
        self.heard.set()
        if dealt is not None:
            self._waiting.append(dealt)

    def deal(self) -> None:
        self._waiting.pop(0)()

    async def has(self, number: int) -> None:
        """Returns once so many messages have come."""
        while len(self.got) < number:
            self.heard.clear()
            await asyncio.wait_for(self.heard.wait(), WAIT_S)


def serve(socket: FakeSocket, session: SlowSession, limits: Limits, refusals: Refusals | None = None) -> Any:
    bounds = sockets.Bounds(limits, Meter(limits), refusals or Refusals())
    return sockets.serve(cast(WebSocket, socket), cast(LiveSession, session), "participant", bounds=bounds)


# --- what waits --------------------------------------------------------------------------------------------------


async def test_a_page_is_not_read_while_enough_of_it_waits() -> None:
    socket, session = FakeSocket([submit(number) for number in range(100)]), SlowSession()
    serving = asyncio.create_task(serve(socket, session, Limits(waiting_messages=4)))
    await session.has(4)
    for _ in range(20):
        await asyncio.sleep(0)  # time to read more, if it did
    assert len(session.got) == 4 and socket.read == 6  # hello, four that wait, and one in the hand
    for dealt in range(1, 11):
        session.deal()
        await session.has(4 + dealt)
    assert socket.read == 16
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)


async def test_hands_do_not_wait_and_take_no_room() -> None:
    beats = [Heartbeat(seq=0, direction=(0, 0, 1)).model_dump_json() for _ in range(50)]
    socket, session = FakeSocket([submit(0), *beats]), SlowSession()
    serving = asyncio.create_task(serve(socket, session, Limits(waiting_messages=1)))
    await session.has(51)
    assert [cast(Heartbeat, beat).direction for beat in session.got[1:]] == [(0, 0, 1)] * 50
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)


async def test_what_the_hands_did_while_the_page_was_not_read_moves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """They come at once when reading goes on, and are old; what comes afterwards is as it is said."""
    monkeypatch.setattr(sockets, "BEHIND_S", 0.0)
    press = Input(seq=1, client_ms=0.0, direction=(0, 0, 1), gripper="close").model_dump_json()
    beat = Heartbeat(seq=1, direction=(0, 0, 1)).model_dump_json()
    socket, session = FakeSocket([submit(0), submit(1), press, beat]), SlowSession()
    serving = asyncio.create_task(serve(socket, session, Limits(waiting_messages=1)))
    await session.has(1)
    session.deal()
    await session.has(4)
    late, beaten = cast(Input, session.got[2]), cast(Heartbeat, session.got[3])
    assert (late.direction, late.gripper, late.seq, beaten.direction) == (None, None, 1, None)
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)


# --- what is too much --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("limits", "frames", "told", "bound"),
    [
        (Limits(messages_per_s=0.001, messages_burst=5), [note(n) for n in range(9)], "messages a second", "messages"),
        (Limits(messages_per_s=0.001, messages_burst=5), ["{"] * 9, "messages a second", "messages"),
        (
            Limits(message_bytes_per_s=0.001, message_bytes_burst=3000),
            [note(n, 900) for n in range(9)],
            "bytes a",
            "messages",
        ),
        (Limits(records_per_s=0.001, records_burst=5), [submit(n) for n in range(9)], "submits and notes", "records"),
    ],
    ids=["messages", "messages that are none", "bytes", "records"],
)
async def test_a_page_that_says_too_much_is_told_so_and_closed(
    limits: Limits, frames: list[str], told: str, bound: str
) -> None:
    socket, session, refusals = FakeSocket(frames), SlowSession(), Refusals()
    await asyncio.wait_for(serve(socket, session, limits, refusals), WAIT_S)
    assert len(session.got) < len(frames)
    assert (socket.sent[-1]["type"], socket.sent[-1]["code"]) == ("error", "too_many")
    assert told in socket.sent[-1]["message"]
    assert socket.closed == [1013]
    assert {name: count for name, count in refusals.counts.items() if count} == {bound: 1}


async def test_what_is_too_much_is_not_even_read_as_json(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Any] = []
    parse = sockets.parse

    def noted(frame: Any, *taken: Any) -> Message:
        read.append(frame)
        return parse(frame, *taken)

    monkeypatch.setattr(sockets, "parse", noted)
    socket = FakeSocket([note(n) for n in range(100)])
    await serve(socket, SlowSession(), Limits(messages_per_s=0.001, messages_burst=4, waiting_messages=100))
    assert len(read) == 4 and socket.read == 5


async def test_so_is_one_before_its_hello() -> None:
    socket, refusals = FakeSocket([]), Refusals()
    socket.frames = ["{"] * 20
    limits = Limits(messages_per_s=0.001, messages_burst=5)
    await asyncio.wait_for(serve(socket, SlowSession(), limits, refusals), WAIT_S)
    assert [message["code"] for message in socket.sent] == ["malformed"] * 5 + ["too_many"]
    assert socket.closed == [1013] and refusals.counts["messages"] == 1


def test_an_honest_page_never_comes_near() -> None:
    """An hour of heartbeats, a stick that flickers, an outage that ends at once, and all of a full outbox twice."""
    limits = Limits()
    meter, now_s = Meter(limits), 0.0
    for _ in range(3600 * 5):
        now_s += 0.2
        assert all(meter.heard(150, now_s) == "" for _ in range(2 + 12))  # ten beats a second, and sixty inputs
    assert all(meter.heard(150, now_s) == "" for _ in range(40 * 60))  # all of it held back for 40 s
    now_s += 20.0
    assert all(meter.heard(300, now_s) == "" and meter.recorded(now_s) == "" for _ in range(2 * 500))
    assert meter.opened(now_s)


def test_a_lockstep_client_sends_as_fast_as_ticks_are_computed() -> None:
    meter = Meter(Limits())
    assert all(meter.heard(150, 0.0, is_paced=False) == "" for _ in range(100_000))


# --- a flood and the others --------------------------------------------------------------------------------------


def memory_mb(lab: LabServer) -> float:
    status = Path(f"/proc/{lab.process.pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


async def test_while_one_page_floods_the_others_ticks_all_come_in_order(quick_lab: LabServer) -> None:
    flooded = invite(quick_lab, pace="real_time")["link"]
    async with visit(invite(quick_lab)["link"]) as player:
        await player.reach_trial()
        before_mb = memory_mb(quick_lab)
        access = await enter(flooded)

        async def flood() -> list[str]:
            """What it was told last, the first time and when it was back at once."""
            told: list[str] = []
            for frames in ([HELLO, *(note(number, 55_000) for number in range(400))], []):
                async with connect(access.socket_url, additional_headers={"Cookie": access.cookie}, proxy=None) as page:

                    async def send(page: Any = page, frames: list[str] = frames) -> None:
                        with contextlib.suppress(ConnectionClosed):
                            for frame in frames:
                                await page.send(frame)

                    sending = asyncio.create_task(send())
                    with contextlib.suppress(ConnectionClosed):
                        while True:
                            message = json.loads(await asyncio.wait_for(page.recv(), WAIT_S))
                            if message.get("code") == "too_many":
                                told.append(message["message"])
                                sending.cancel()
                    await asyncio.gather(sending, return_exceptions=True)
            return told

        flooding = asyncio.create_task(flood())
        ticks = [await player.tick((0, 1, 0)) for _ in range(30)]
        told = await flooding
        ticks += [await player.tick((0, 1, 0)) for _ in range(5)]
        grown_mb = memory_mb(quick_lab) - before_mb
    assert [tick.tick for tick in ticks] == list(range(35))
    assert all(isinstance(tick, Tick) for tick in ticks)
    assert "bytes a second" in told[0] and "let in again" in told[1]
    assert grown_mb < 60, f"the lab grew by {grown_mb:.0f} MB"
    async with visit(invite(quick_lab)["link"]) as newcomer:
        assert newcomer.heard(Welcome)


# --- the open evaluate route -------------------------------------------------------------------------------------


def asked(goals: int = 1) -> arbiter_api.EvaluateRequest:
    goal = (0.7, 0.0, 0.8)
    return arbiter_api.EvaluateRequest(position_m=(0.7, 0, 0.9), momentum=(0, 0, 0), goals_m=[goal] * goals)


@pytest.fixture
def evaluated(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Holds every evaluation until it is called."""
    import threading

    go = threading.Event()
    monkeypatch.setattr(arbiter_api, "evaluate_request", lambda body, setup, ask: go.wait(WAIT_S) and body)
    monkeypatch.setattr(Lab, "setup", None)
    return go.set


async def test_evaluations_wait_in_a_short_line_and_are_counted_by_their_goals(evaluated: Callable[[], None]) -> None:
    limits = Limits(evaluations_waiting=3, evaluations_per_s=0.001, evaluations_burst=25)
    lab = Lab(LabConfig(limits=limits), EXPERIMENTER_TOKEN)
    evaluations = arbiter_api.Evaluations(lab)
    first = [asyncio.create_task(evaluations.run(asked(), "192.0.2.1")) for _ in range(3)]
    await asyncio.sleep(0)
    with pytest.raises(HTTPException, match="3 evaluations wait already"):
        await evaluations.run(asked(), "192.0.2.1")
    evaluated()
    await asyncio.gather(*first)
    for _ in range(2):
        await evaluations.run(asked(100), "192.0.2.1")  # as much as ten
    with pytest.raises(HTTPException) as info:
        await evaluations.run(asked(100), "192.0.2.1")
    assert info.value.status_code == 429 and int((info.value.headers or {})["Retry-After"]) > 1
    assert await evaluations.run(asked(100), "192.0.2.2")
    assert await evaluations.run(asked(100), None)  # the experimenter
    assert lab.refusals.counts["evaluations"] == 2
    evaluations.close()


def test_the_route_answers_429_as_it_says(start_lab: Callable[..., LabServer]) -> None:
    arguments = ("--limit=evaluations_burst=2", "--limit=evaluations_per_s=0.01", "--limit=wrong_links_per_min=3")
    lab = start_lab("--robot", "kinematic", "--no-scene", *arguments)
    with httpx.Client(base_url=lab.base_url, trust_env=False, timeout=30.0) as client:
        body = asked().model_dump(mode="json")
        answers = [client.post("/api/arbiter/evaluate", json=body) for _ in range(3)]
        assert [answer.status_code for answer in answers] == [200, 200, 429]
        assert "try again in" in answers[-1].json()["detail"] and int(answers[-1].headers["retry-after"]) > 0
        assert client.post("/api/arbiter/evaluate", json=body, headers=lab.headers).status_code == 200
        # And who guesses links waits, while the right one opens.
        links = [client.get(f"/p/wrong{number}").status_code for number in (1, 2, 2, 3, 4, 4)]
        assert links == [403, 403, 403, 403, 429, 429]
        assert client.get("/s/0123456789abcdef/", headers={"Cookie": "salab=wrong5"}).status_code == 429
        assert client.get(lab.demo_link).status_code == 303
        metrics = client.get("/api/metrics", headers=lab.headers).text
    assert 'salab_bounds_reached_total{bound="evaluations"} 1.0' in metrics
    assert 'salab_bounds_reached_total{bound="wrong_links"} 3.0' in metrics
