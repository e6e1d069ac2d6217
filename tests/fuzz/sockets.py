"""Sockets: frames of participants, of second devices and of dashboards. After each handful the session must still take
a call for help, in the same words and on disk."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import Iterator
from random import Random
from typing import Any

from study.flow.steps import step_names
from tests.fuzz.in_process import TOKEN, InProcessLab, InProcessSocket
from tests.fuzz.mutations import NASTY_JSON, mutated, mutated_json, spelled_json
from tests.fuzz.surface import Surface

HELLO = {"type": "hello", "protocol": 1, "client": "tab"}
FRAMES: tuple[Any, ...] = (
    HELLO,
    {"type": "input", "seq": 1, "client_ms": 0.5, "direction": [0, -1, 0], "gripper": None},
    {"type": "input", "seq": 2, "client_ms": 0.5, "direction": None, "gripper": "close"},
    {"type": "heartbeat", "seq": 1, "direction": None, "visible": True, "focused": True, "device": "gamepad"},
    {"type": "view", "name": "front"},
    {"type": "pong", "n": 1},
    *(
        {"type": "note", "id": "n1", "name": name, "data": data}
        for name, data in (
            ("round_trip", {"ms": 12.5}),
            ("page_hidden", {}),
            ("pad_lost", {"pad": "x"}),
            ("panel_heard", {"heard": True}),
            ("step_setup", {"sound": True}),
            ("clock_set", {"by_s": 1.0}),
            ("arm_freed", {"phase": "trial"}),
        )
    ),
    *(
        {"type": "submit", "id": "s1", "step": step, "data": data}
        for step, data in (
            ("consent", {"accepted": True, "hash": "0" * 64}),
            ("demographics", {"answers": {"age": 30}}),
            ("instructions", {"answers": {"which_object": "named"}}),
            ("survey", {"answers": {"tlx_raw": {"effort": 4}}}),
            ("setup", {"sound": True}),
            ("start", {}),
            ("resume", {}),
            ("help", {"text": "help"}),
            ("alert_answer", {"alert": 1, "value": "42"}),
            ("alert_shown", {"alert": 1}),
            ("picture", {"there": True}),
        )
    ),
    *({"type": "submit", "id": "s2", "step": step, "data": {}} for step in step_names() if step != "withdraw"),
)
BOARD: tuple[Any, ...] = ({"type": "watch", "participant": "P001"}, {"type": "watch", "participant": None})
AT_ONCE = 100
"""Frames on one socket, before it is asked whether the session is alive."""
SESSIONS = 6


class Sockets(Surface):
    """A lab in this process, some sessions in it, and every socket that leads there."""

    name = "sockets"

    def __init__(self, lab: InProcessLab) -> None:
        self._lab = lab
        self._numbers = itertools.count()
        self.answered = 0
        """How many frames the lab has answered: were it few, it would not have read them."""
        self._cookies: list[tuple[str, str]] = []
        for _ in range(SESSIONS):
            made = lab.invite()
            for name in ("link", "panel_link"):
                entered = lab.ask("GET", "/" + made[name].split("/", 3)[3])
                headers = dict(entered.headers)
                self._cookies.append((headers["location"], headers["set-cookie"].partition(";")[0]))

    def inputs(self, count: int, random: Random) -> Iterator[tuple[Any, int]]:
        """A socket and the frames that are said on it."""
        done = 0
        while done < count:
            which = random.randrange(-1, len(self._cookies))
            known = BOARD if which < 0 else FRAMES
            frames = [_frame(known, random) for _ in range(min(AT_ONCE, count - done))]
            done += len(frames)
            yield {"socket": which, "hello": random.random() < 0.97, "frames": frames}, len(frames)

    def problem(self, given: Any) -> str:
        """Something raised or logged as an error, a session that does not answer."""
        which = given["socket"]
        wrong = self._lab.run(self._board(given) if which < 0 else self._page(given, *self._cookies[which]))
        told = self._lab.complaints.take()
        return wrong or "\n".join(told)

    async def _page(self, given: Any, place: str, cookie: str) -> str:
        socket = self._lab.socket(f"{place}socket", {"cookie": cookie})
        if not await socket.open():
            return f"the socket of {place} was refused"
        if given["hello"]:
            socket.say(json.dumps(HELLO))
        for frame in given["frames"]:
            socket.say(_said(frame))
        await self._left(socket)
        if socket.raised:
            return socket.raised
        return await self._alive(place, cookie)

    async def _alive(self, place: str, cookie: str) -> str:
        """ "" when a page that comes back is welcomed, and a call for help is on disk."""
        if place.endswith("/panel/"):
            return ""
        socket = self._lab.socket(f"{place}socket", {"cookie": cookie})
        if not await socket.open():
            return f"the session of {place} lets nobody in any more"
        identifier = f"alive-{next(self._numbers)}"
        socket.say(json.dumps(HELLO))
        socket.say(json.dumps({"type": "submit", "id": identifier, "step": "help", "data": {"text": "Hello?"}}))
        heard: list[str] = []
        try:
            while (frame := await socket.hear()) is not None:
                heard.append(frame)
                message = json.loads(frame)
                if message["type"] == "ack" and message["id"] == identifier:
                    return ""
                if message["type"] == "error" and message["id"] == identifier and message["code"] == "illegal":
                    return ""  # the session is over: somebody went all the way to its end, or withdrew
        except asyncio.TimeoutError:
            pass
        finally:
            await self._left(socket)
        return f"the session of {place} is dead: {heard[-3:]}"

    async def _board(self, given: Any) -> str:
        socket = self._lab.socket("/dashboard/socket", {})
        if not await socket.open():
            return "the dashboard's socket was refused"
        if given["hello"]:
            socket.say(json.dumps({"type": "hello", "token": TOKEN}))
        for frame in given["frames"]:
            socket.say(_said(frame))
        await self._left(socket)
        return socket.raised

    async def _left(self, socket: InProcessSocket) -> None:
        await socket.close()
        self.answered += socket.answers


def _frame(known: tuple[Any, ...], random: Random) -> dict[str, str]:
    value = random.choice(known)
    if random.random() < 0.05:
        value = random.choice(NASTY_JSON)
    for _ in range(random.choice((0, 1, 1, 1, 2, 3))):
        value = mutated_json(value, random)
    text = spelled_json(value, random)
    if random.random() < 0.1:
        text = mutated(text.encode("utf-8", "surrogatepass"), random).decode("utf-8", "replace")
    if random.random() < 0.02:
        text = text + " " * 70_000
    return {"bytes" if random.random() < 0.02 else "text": text}


def _said(frame: dict[str, str]) -> str | bytes:
    return frame["text"] if "text" in frame else frame["bytes"].encode("utf-8", "surrogatepass")
