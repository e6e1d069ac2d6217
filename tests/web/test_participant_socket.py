"""Whatever arrives on a participant's socket: a typed answer that names the field, and the session goes on."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import random
from types import SimpleNamespace
from typing import Any, cast

import pytest
from fastapi import WebSocket, WebSocketDisconnect
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from websockets.asyncio.client import connect

from app.limits import Limits
from app.session.session import LiveSession
from app.simulated.connection import BotError, enter
from app.web import participant_socket as sockets
from app.wire import CLIENT_MESSAGE, MAX_MESSAGE_BYTES, PROTOCOL_VERSION, Error, Hello, Input, Message, Page, Ping
from tests.support.lab_server import LabServer
from tests.support.wire_client import Player, invite, visit

HELLO = {"type": "hello", "protocol": PROTOCOL_VERSION, "client": "tab"}
SUBMIT = {"type": "submit", "id": "a", "step": "consent", "data": {}}
NOTE = {"type": "note", "id": "a", "name": "hidden", "data": {}}
INPUT = {"type": "input", "seq": 1, "client_ms": 0.0, "direction": [0, 0, 1]}


def text(message: dict[str, Any], **changes: Any) -> str:
    return json.dumps({**message, **changes})


def nested(depth: int) -> str:
    return '{"type": "note", "id": "a", "name": "n", "data": ' + '{"a":' * depth + "1" + "}" * depth + "}"


REFUSED: list[tuple[str, str | bytes, str, str | None]] = [
    ("not JSON", "{", "malformed", None),
    ("empty", "", "malformed", None),
    ("binary", b'{"type": "pong", "n": 1}', "malformed", None),
    ("too large", text(NOTE, data={"a": "x" * MAX_MESSAGE_BYTES}), "too_large", None),
    ("too large in bytes, not in characters", text(NOTE)[:-2] + '"a":"' + "ä" * 40_000 + '"}}', "too_large", None),
    ("hopelessly nested", "[" * 30_000 + "]" * 30_000, "malformed", None),
    ("deeply nested", nested(500), "invalid", ".".join(["data", *"a" * 20])),
    ("no object", "[1, 2]", "invalid", "type"),
    ("a number", "1e999", "invalid", ""),
    ("no type", "{}", "invalid", "type"),
    ("unknown type", text(NOTE, type="drive"), "invalid", "type"),
    ("a message of the lab", '{"type": "welcome"}', "invalid", "type"),
    ("unknown field", text(INPUT, speed=3), "invalid", "speed"),
    ("missing field", '{"type": "pong"}', "invalid", "n"),
    ("no whole number", text(INPUT, seq="one"), "invalid", "seq"),
    ("a number in quotes", text(INPUT, seq="1"), "invalid", "seq"),
    ("a time in quotes", text(INPUT, client_ms="0"), "invalid", "client_ms"),
    ("below the bound", text(INPUT, seq=-1), "invalid", "seq"),
    ("above the bound", text(INPUT, seq=2**54), "invalid", "seq"),
    ("many digits", '{"type": "pong", "n": ' + "9" * 5000 + "}", "malformed", None),
    ("not a number", text(INPUT, client_ms=float("nan")), "invalid", "client_ms"),
    ("too large for a float", '{"type":"note","id":"a","name":"n","data":{"x":1e999}}', "invalid", "data.x"),
    ("not a number in the answers", text(SUBMIT, data={"a": [1, float("inf")]}), "invalid", "data.a.1"),
    ("half a character", '{"type":"submit","id":"a","step":"help","data":{"text":"\\ud800"}}', "invalid", "data.text"),
    ("half a character as name", '{"type":"note","id":"a","name":"n","data":{"\\udfff":1}}', "invalid", "data"),
    ("half a character as id", '{"type":"note","id":"\\ud800","name":"n"}', "invalid", "id"),
    ("a direction of two", text(INPUT, direction=[0, 1]), "invalid", "direction.2"),
    ("half a direction", text(INPUT, direction=[0, 0, 0.5]), "invalid", "direction.2"),
    ("two is no direction", text(INPUT, direction=[0, 0, 2]), "invalid", "direction.2"),
    ("a gripper that flies", text(INPUT, gripper="fly"), "invalid", "gripper"),
    ("id with a space", text(NOTE, id="a b"), "invalid", "id"),
    ("id too long", text(NOTE, id="a" * 65), "invalid", "id"),
    ("id missing", '{"type": "submit", "step": "help"}', "invalid", "id"),
    ("unknown step", text(SUBMIT, step="win"), "invalid", "step"),
    ("data that is no object", text(SUBMIT, data=[1]), "invalid", "data"),
    ("a name that is no note", text(NOTE, name="round_trip"), "invalid", "name"),
    ("a note that holds more than it has", text(NOTE, data={"a": {}}), "invalid", "data.a"),
    ("a note that lacks what it has", text(NOTE, name="view_switched"), "invalid", "data.view"),
    ("a note of another page", text(NOTE, name="panel_heard", data={"heard": True}), "illegal", "name"),
    ("a note of a page that is not there", text(NOTE, name="own.mine"), "invalid", "name"),
    ("a second hello", text(HELLO), "protocol", "type"),
    ("a view that is not there", '{"type": "view", "name": "moon"}', "invalid", "name"),
]


@pytest.mark.parametrize(("frame", "code", "field"), [case[1:] for case in REFUSED], ids=[case[0] for case in REFUSED])
async def test_a_bad_frame_gets_a_typed_answer_and_the_session_goes_on(
    consent_player: Player, frame: str | bytes, code: str, field: str | None
) -> None:
    player = consent_player
    await player.send(frame)
    while not isinstance(error := await player.next(), Error):
        assert isinstance(error, Ping)
    assert error.code == code
    if field is not None:
        assert error.field == field
    assert error.message and "Traceback" not in error.message
    await player.in_step()


@pytest.fixture(scope="module")
def link(quick_lab: LabServer) -> str:
    """A participant at the consent form; nothing in this module leads further."""
    made: str = invite(quick_lab)["link"]
    return made


@pytest.fixture
async def consent_player(link: str) -> Any:
    async with visit(link) as player:
        await player.page("consent")
        yield player


async def test_steps_of_other_states_are_refused_with_what_is_allowed(consent_player: Player) -> None:
    steps: dict[str, dict[str, Any]] = {"start": {}, "continue": {}, "resume": {}, "debrief": {"answers": {}}}
    for step, data in steps.items():
        error = await consent_player.refused(step, data)
        assert (error.code, error.field) == ("illegal", "step")
        assert "'consent'" in error.message and "consent_given" in error.message
        assert (await consent_player.until(Page)).state == "consent"


@pytest.mark.parametrize(
    ("step", "data", "field"),
    [
        ("consent", {}, "data.accepted"),
        ("consent", {"accepted": False, "hash": "x"}, "data.accepted"),
        ("consent", {"accepted": True, "hash": "x"}, "data.hash"),
        ("consent", {"accepted": True, "hash": "x", "more": 1}, "data.more"),
        ("decline", {"why": 1}, "data.why"),
        ("withdraw", {"reason": 5}, "data.reason"),
        ("help", {"text": "x" * 4001}, "data.text"),
        ("setup", {"device": "wheel", "sound": True}, "data.device"),
        ("setup", {"device": "keyboard", "sound": True, "dead_zone": 1.5}, "data.dead_zone"),
        ("setup", {"device": "gamepad", "sound": True, "mapping": {"a": "x" * 8000}}, "data.mapping"),
        ("demographics", {"answers": {"age_group": "old"}}, "answers.age_group"),
        ("alert_shown", {"alert": 0}, "data.alert"),
    ],
)
async def test_what_is_wrong_with_a_step_is_named(
    consent_player: Player, step: str, data: dict[str, Any], field: str
) -> None:
    error = await consent_player.refused(step, data)
    assert error.code == "invalid"
    assert error.field == field


async def test_inputs_out_of_order_are_named_and_ignored(quick_lab: LabServer) -> None:
    async with visit(invite(quick_lab)["link"]) as player:
        await player.reach_trial()
        first = await player.tick((0, 1, 0))
        for seq in (player.seq, player.seq - 1, player.seq + 2_000_000):
            await player.send(Input(seq=seq, client_ms=0.0, direction=(0, 0, 1)))
            while not isinstance(error := await player.next(), Error):
                pass
            assert (error.code, error.field) == ("out_of_order", "seq")
            assert str(seq) in error.message and str(player.seq) in error.message
        second = await player.tick((0, 1, 0))
        assert (first.tick, second.tick) == (0, 1)
        assert second.seq == player.seq


async def test_an_input_outside_a_trial_says_so(consent_player: Player) -> None:
    await consent_player.hands((0, 0, 1))
    while not isinstance(error := await consent_player.next(), Error):
        pass
    assert (error.code, error.field) == ("illegal", "type")
    assert "'consent'" in error.message


# --- before hello ------------------------------------------------------------------------------------------------


async def test_nothing_comes_before_hello_and_hello_can_be_said_again(link: str) -> None:
    access = await enter(link)
    async with connect(
        access.socket_url, additional_headers={"Cookie": access.cookie}, compression=None, proxy=None
    ) as connection:

        async def ask(frame: str | bytes) -> dict[str, Any]:
            await connection.send(frame)
            answer: dict[str, Any] = json.loads(await connection.recv())
            return answer

        for frame, code, field in (
            (text(INPUT), "protocol", "type"),
            (text(SUBMIT), "protocol", "type"),
            (b"\x00", "malformed", None),
            ("{", "malformed", None),
            (text(HELLO, client=""), "invalid", "client"),
            (text(HELLO, protocol=PROTOCOL_VERSION + 1), "protocol", "protocol"),
        ):
            answer = await ask(frame)
            assert (answer["type"], answer["code"], answer["field"]) == ("error", code, field)
        assert str(PROTOCOL_VERSION) in answer["message"] and "reload" in answer["message"]
        assert (await ask(text(HELLO)))["type"] == "welcome"


# --- anything at all ---------------------------------------------------------------------------------------------

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters()),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(st.characters(), max_size=8), inner, max_size=4)
    ),
    max_leaves=12,
)
TYPES = st.sampled_from(["hello", "input", "heartbeat", "submit", "note", "view", "pong", "tick", ""])
FIELDS = st.sampled_from(["id", "seq", "step", "name", "n", "data", "direction", "client_ms", "protocol", "client"])
LOOKS_RIGHT = st.builds(
    lambda kind, fields: {"type": kind, **fields}, TYPES, st.dictionaries(FIELDS, JSON | st.just("a"), max_size=5)
)


@given(JSON | LOOKS_RIGHT)
def test_any_json_is_a_message_or_an_error_that_can_be_sent(data: Any) -> None:
    answer = sockets.parse(json.dumps(data))
    answer.model_dump_json()
    if isinstance(answer, Error):
        assert answer.code in ("malformed", "invalid", "too_large")
        with pytest.raises((ValidationError, UnicodeEncodeError, ValueError)):
            keep(CLIENT_MESSAGE.validate_python(data))
    else:
        assert CLIENT_MESSAGE.validate_python(answer.model_dump()) == answer


def keep(message: Message) -> None:
    """As the record does: JSON that every reader takes, in UTF-8."""
    json.dumps(message.model_dump(), allow_nan=False, ensure_ascii=False).encode()


@given(st.text(st.characters()) | st.binary())
def test_any_frame_is_answered(frame: str | bytes) -> None:
    sockets.parse(frame).model_dump_json()


async def test_a_burst_of_random_messages_ends_nothing(quick_lab: LabServer) -> None:
    """Over a real socket, into a running trial; some of them are well formed."""
    rng = random.Random(7)
    kinds = ["hello", "input", "heartbeat", "submit", "note", "view", "pong", "tick", None]
    values: list[Any] = [None, 1, -1, 2**60, 0.5, "a", "start", "help", [0, 0, 1], {}, {"a": 1}, True, [], "\x00"]
    fields = ["id", "seq", "step", "name", "n", "data", "direction", "client_ms", "gripper", "visible"]
    async with visit(invite(quick_lab)["link"]) as player:
        await player.reach_trial()
        for _ in range(300):
            drawn = {field: rng.choice(values) for field in rng.sample(fields, rng.randint(0, 6))}
            kind = rng.choice(kinds)
            await player.send(json.dumps({"type": kind, **drawn}))
        await player.in_step()
        assert not [error for error in player.heard(Error) if error.code == "internal"]
        assert player.heard(Error)


# --- pages that do not keep up -----------------------------------------------------------------------------------


class StalledSocket:
    """A page whose connection takes nothing any more."""

    def __init__(self) -> None:
        self.closed: list[int] = []
        self._first = itertools.count()

    async def receive(self) -> dict[str, Any]:
        if next(self._first) == 0:
            return {"type": "websocket.receive", "text": Hello(protocol=PROTOCOL_VERSION, client="x").model_dump_json()}
        await asyncio.Event().wait()
        raise AssertionError("it says nothing more")

    async def send_text(self, data: str) -> None:
        await asyncio.Event().wait()

    async def close(self, code: int, reason: str = "") -> None:
        self.closed.append(code)


class Recorder:
    """Stands for a session: it remembers who came and went."""

    def __init__(self) -> None:
        self.enrolment = SimpleNamespace(pace="real_time")
        self.attached: asyncio.Queue[sockets.SocketClient] = asyncio.Queue()
        self.gone: list[sockets.SocketClient] = []

    def attach(self, client: sockets.SocketClient) -> None:
        self.attached.put_nowait(client)

    def detach(self, client: sockets.SocketClient) -> None:
        self.gone.append(client)


async def serve(socket: StalledSocket, session: Recorder) -> None:
    """The lab's side of that socket and session."""
    await sockets.serve(cast(WebSocket, socket), cast(LiveSession, session), "participant")


async def test_a_page_that_takes_nothing_is_cut_off_and_blocks_nobody() -> None:
    socket, session = StalledSocket(), Recorder()
    serving = asyncio.create_task(serve(socket, session))
    client = await asyncio.wait_for(session.attached.get(), 5.0)
    for number in range(Limits().unsent_messages + 2):
        client.deliver(Ping(n=number))  # returns at once, every time
    await asyncio.wait_for(serving, 10.0)
    assert session.gone == [client]
    assert socket.closed == [1013]


class LeavingSocket(StalledSocket):
    """A page that is closed before it says anything a session can be made of; what is sent to it goes nowhere."""

    def __init__(self, *frames: str) -> None:
        super().__init__()
        self._frames = iter(frames)

    async def receive(self) -> dict[str, Any]:
        frame = next(self._frames, None)
        return {"type": "websocket.disconnect", "code": 1001} if frame is None else {"type": "x", "text": frame}

    async def send_text(self, data: str) -> None:
        raise WebSocketDisconnect(1006)

    async def close(self, code: int, reason: str = "") -> None:
        raise WebSocketDisconnect(1006)


@pytest.mark.parametrize("frames", [(), ("{",)], ids=["silent", "while it is being answered"])
async def test_a_page_that_leaves_before_hello_is_no_error(frames: tuple[str, ...]) -> None:
    session = Recorder()
    await asyncio.wait_for(serve(LeavingSocket(*frames), session), 5.0)
    assert session.attached.empty() and session.gone == []


async def test_more_sockets_than_allowed_are_refused(quick_lab: LabServer) -> None:
    link = invite(quick_lab)["link"]
    access = await enter(link)
    async with contextlib.AsyncExitStack() as stack:

        async def open_one() -> Any:
            return await stack.enter_async_context(
                connect(
                    access.socket_url,
                    additional_headers={"Cookie": access.cookie},
                    compression=None,
                    proxy=None,
                )
            )

        silent = [await open_one() for _ in range(Limits().sockets_per_session)]
        with pytest.raises(BotError, match="did not open a socket"):
            async with visit(link):
                pass
        await silent.pop().close()
        async with visit(link) as player:
            await player.page("consent")
