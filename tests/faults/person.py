"""A participant's page without pixels: it comes back, resends and beats as static/wire does, and forgets nothing.

    connect ─► hello ─► welcome ─► hear, beat, resend ─► (closed, or silent for too long) ─► wait ─► connect …

Whatever it did and heard is kept with the time by this machine's monotonic clock (`tests.faults.memory`), so that
`tests.faults.checker` can hold the record against it.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Any, Literal
from urllib.parse import urlsplit, urlunsplit

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidMessage

from app.simulated.answers import PlainPerson
from app.simulated.bot import handed_in
from app.simulated.connection import BotError, PageAccess, enter
from app.simulated.pilot import Pilot, Sight
from app.wire import (
    PROTOCOL_VERSION,
    SERVER_MESSAGE,
    Ack,
    Alert,
    Error,
    Heartbeat,
    Hello,
    Input,
    Instruction,
    Message,
    Notice,
    Page,
    Panel,
    Ping,
    Pong,
    Saves,
    Status,
    Submit,
    Superseded,
    Tick,
    Welcome,
    World,
)
from study.flow.protocol import TERMINAL
from tests.faults.memory import Hands, HeardTick, Memory, Seen
from tests.support.wire_client import COMPREHENSION, Direction

FIRST_RETRY_S = 0.4
LAST_RETRY_S = 8.0
RETRY_GROWS = 1.7
RESEND_S = 4.0
SILENT_S = 10.0
"""As static/wire/socket.js: so long without a word, and the other side is taken to be gone."""
OPEN_WITHIN_S = 10.0
GONE = (OSError, InvalidHandshake, InvalidMessage, ConnectionClosed, BotError, asyncio.TimeoutError, EOFError)
"""How a lab that is away shows."""
ANSWERS_AFTER_S = 1.0
GOES_ON_AFTER_S = 0.5
"""So long a person looks at a pause before they press the button."""


class Person:
    """See the module's text. `address` is where the page's requests go: the lab's host and port, or a proxy's."""

    def __init__(
        self,
        link: str,
        name: str,
        address: str,
        *,
        drives: bool = False,
        role: Literal["participant", "panel"] = "participant",
    ) -> None:
        self.link = link
        self.name = name
        self.address = address
        self.drives = drives
        self.role = role
        self.second_device: Person | None = None
        self.memory = Memory()
        self.life = 0
        self.board_seen: list[Seen] = []
        """What an experimenter saw on the dashboard's page, where one is open."""
        self.page: Page | None = None
        self.status = ""
        self.connected = False
        self.beats = True
        """Whether timers run: a page on a computer whose lid is closed says nothing."""
        self.ended = False
        self._access: PageAccess | None = None
        self._wire: ClientConnection | None = None
        self._direction: Direction | None = None
        self._seq = 0
        self._numbers = 0
        self._waiting: dict[str, float] = {}
        """Ids that are not acknowledged, and when each was sent last."""
        self._given: set[tuple[str, int | None, bool]] = set()
        self._answered: set[tuple[int | None, int]] = set()
        self._changed = asyncio.Event()
        self._person = PlainPerson()
        self._pilot = Pilot()
        self._world: World | None = None
        self._task: asyncio.Task[None] | None = None
        self._later: set[asyncio.Task[None]] = set()

    # ---- what a test does with it -----------------------------------------------------------------------------------

    def begin(self) -> None:
        """Open the page."""
        self._task = asyncio.create_task(self._live(), name=f"person {self.name}")

    async def end(self) -> None:
        """Close it."""
        self.ended = True
        tasks = [*self._later, *([self._task] if self._task else [])]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def until(self, is_so: Callable[[], bool], within_s: float) -> bool:
        """Wait until something that was heard makes this true; False when it does not in time."""
        ends_s = time.monotonic() + within_s
        while not is_so():
            left_s = ends_s - time.monotonic()
            if left_s <= 0:
                return False
            self._changed.clear()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._changed.wait(), left_s)
        return True

    async def ticks(self, count: int, within_s: float) -> bool:
        """Wait for so many more ticks."""
        wanted = len(self.memory.ticks) + count
        return await self.until(lambda: len(self.memory.ticks) >= wanted, within_s)

    async def hold(self, direction: Direction | None, gripper: str | None = None) -> None:
        """Do this with the hands from now on."""
        self._direction = direction
        self.memory.hands.append(Hands(time.monotonic(), direction))
        self._seq += 1
        if gripper is not None:
            self.memory.presses[self._seq] = gripper
        given = {"seq": self._seq, "client_ms": time.monotonic() * 1e3, "direction": direction, "gripper": gripper}
        await self._say(Input.model_validate(given))

    async def call(self, words: str) -> str:
        """Hand in a call for help with these words, which is resent until it is acknowledged; its id."""
        return await self._submit("help", {"text": words})

    async def until_acknowledged(self, identifier: str, within_s: float) -> bool:
        """Wait for an acknowledgement."""
        return await self.until(lambda: identifier in self.memory.acknowledged, within_s)

    def remembered(self) -> Memory:
        """Everything, what the second device handed in too."""
        if self.second_device is None:
            return self.memory
        there = self.second_device.memory
        return replace(
            self.memory,
            sent={**self.memory.sent, **there.sent},
            acknowledged={**self.memory.acknowledged, **there.acknowledged},
        )

    def take_back(self, other: Person) -> None:
        """After another tab took over: drive on in this one. What the other did and heard was the same person's."""
        now_s = time.monotonic()
        theirs = other.memory
        self.memory.hands = sorted([*self.memory.hands, *theirs.hands[1:]], key=lambda hands: hands.at_s)
        self.memory.ticks = sorted([*self.memory.ticks, *theirs.ticks], key=lambda heard: heard.at_s)
        self.memory.hands.append(Hands(now_s, None))
        self._direction, self.ended = None, False
        self.begin()

    def leave(self) -> None:
        """The browser is killed: its socket is gone without a word, and nobody comes back by themselves."""
        self.drop_connection()
        if self._task is not None:
            self._task.cancel()
        self.connected = False
        self._see("sign", "gone")

    def drop_connection(self) -> None:
        """As a browser that is killed: the socket is gone without a word."""
        if self._wire is not None:
            self._wire.transport.abort()

    async def raw(self, frame: str) -> None:
        """Send a frame as it is, if there is a socket."""
        if self._wire is not None:
            with contextlib.suppress(ConnectionClosed, OSError):
                await self._wire.send(frame)

    @property
    def sign(self) -> str:
        """What the page's sign says last."""
        return next((seen.name for seen in reversed(self.memory.seen) if seen.kind == "sign"), "")

    # ---- the line ----------------------------------------------------------------------------------------------------

    async def _live(self) -> None:
        tries = 0
        while not self.ended:
            with contextlib.suppress(*GONE):
                await self._converse()
            tries = 0 if self.connected else tries + 1
            self.connected, self._wire = False, None
            if self.ended:
                return
            self._see("sign", "lost")
            await asyncio.sleep(min(LAST_RETRY_S, FIRST_RETRY_S * RETRY_GROWS**tries))

    async def _converse(self) -> None:
        if self._access is None:
            entered = await asyncio.wait_for(enter(self._here(self.link)), OPEN_WITHIN_S)
            self._access = entered
        opening = connect(
            self._here(self._access.socket_url),
            additional_headers={"Cookie": self._access.cookie},
            compression=None,
            proxy=None,
            ping_interval=None,  # as a browser
            close_timeout=1.0,
            open_timeout=OPEN_WITHIN_S,
        )
        async with opening as wire:
            self._wire = wire
            await wire.send(Hello(protocol=PROTOCOL_VERSION, client=self.name, telemetry=self.drives).model_dump_json())
            beating = asyncio.create_task(self._beat())
            try:
                while not self.ended:
                    frame = await asyncio.wait_for(wire.recv(), SILENT_S)
                    await self._hear(SERVER_MESSAGE.validate_json(frame))
            finally:
                beating.cancel()
                await asyncio.gather(beating, return_exceptions=True)

    def _here(self, url: str) -> str:
        """The same address at whoever passes it on."""
        return urlunsplit(urlsplit(url)._replace(netloc=self.address))

    async def _beat(self) -> None:
        """Heartbeats, and what was not acknowledged once more, on a timer."""
        with contextlib.suppress(ConnectionClosed, OSError):
            while True:
                await asyncio.sleep(0.1)
                if not (self.connected and self.beats) or self.role == "panel":
                    continue
                beat = {"seq": self._seq, "direction": self._direction, "device": "keyboard", "focused": True}
                await self._say(Heartbeat.model_validate(beat))
                now_s = time.monotonic()
                for identifier, sent_s in tuple(self._waiting.items()):
                    if now_s - sent_s > RESEND_S:
                        await self._transmit(identifier)

    async def _say(self, message: Message) -> bool:
        """For what is worthless late: dropped while there is no connection."""
        if self._wire is None or not self.connected or not self.beats:
            return False
        try:
            await self._wire.send(message.model_dump_json())
        except (ConnectionClosed, OSError):
            return False
        return True

    async def _submit(self, step: str, data: dict[str, Any]) -> str:
        self._numbers += 1
        identifier = f"{self.name}.{self._numbers}"
        self.memory.sent[identifier] = Submit.model_validate({"id": identifier, "step": step, "data": data})
        self._waiting[identifier] = 0.0
        await self._transmit(identifier)
        return identifier

    async def _transmit(self, identifier: str) -> None:
        if await self._say(self.memory.sent[identifier]):
            self._waiting[identifier] = time.monotonic()

    # ---- what is heard -----------------------------------------------------------------------------------------------

    def _see(self, kind: str, name: str, text: str = "", data: Any = None) -> None:
        last = self.memory.seen[-1] if self.memory.seen else None
        if last is None or (last.kind, last.name, last.text) != (kind, name, text) or kind != "sign":
            self.memory.seen.append(Seen(time.monotonic(), kind, name, text, data))
        self._changed.set()

    async def _hear(self, message: Message) -> None:
        if isinstance(message, Welcome):
            self.connected = True
            self._seq = max(self._seq, message.last_seq)
            for identifier in tuple(self._waiting):
                await self._transmit(identifier)
        elif isinstance(message, Page):
            await self._on_page(message)
        elif isinstance(message, Status):
            await self._on_status(message)
        elif isinstance(message, World):
            self._world = message
        elif isinstance(message, Tick):
            trial = self.page.trial if self.page and self.page.trial else 0
            self.memory.ticks.append(HeardTick(time.monotonic(), self.life, trial, message))
            self._see("sign", "running")
            if self.drives:
                await self._drive(message)
        elif isinstance(message, Ack):
            self.memory.acknowledged.setdefault(message.id, time.monotonic())
            self._waiting.pop(message.id, None)
        elif isinstance(message, Error):
            self._on_error(message)
        elif isinstance(message, Alert):
            self._on_alert(message)
        elif isinstance(message, Ping):
            await self._say(Pong(n=message.n))
        elif isinstance(message, Notice):
            self._see("notice", "notice", message.text)
        elif isinstance(message, Panel):
            self._see("panel", "connected" if message.connected else "gone")
        elif isinstance(message, Saves) and not message.works:
            self._see("sign", "unsaved", message.text or "")
        elif isinstance(message, Superseded):
            self.ended = True
            self._see("sign", "superseded")
        self._changed.set()

    def _on_error(self, message: Error) -> None:
        self._see("error", message.code, message.message, message)
        if message.id is not None and message.code != "internal":
            self._waiting.pop(message.id, None)
            self.memory.refused[message.id] = message
            if message.id in self.memory.sent and self.memory.sent[message.id].step == "start":
                self._given = {key for key in self._given if not key[2]}  # the robot was not ready: it will say when

    async def _on_page(self, page: Page) -> None:
        if self.role == "panel":
            self._see("page", page.state)
            return
        was, self.page = self.page, page
        is_new = was is None or (was.state, was.trial) != (page.state, page.trial)
        if page.state == "paused":
            self._see("sign", "paused", ", ".join(page.content.get("causes", ())), page.content.get("text"))
            if page.content.get("can_resume"):
                self._soon(self._go_on(), GOES_ON_AFTER_S)
            return
        if not is_new and (page.state, page.trial, False) in self._given:
            return
        if page.state.endswith("_ready") or page.state in ("trial", "practice") or page.state in TERMINAL:
            self._given.discard((page.state, page.trial, True))
            return
        self._see("page", page.state)
        self._given.add((page.state, page.trial, False))
        if page.state == "instructions":
            asked = {question["id"] for question in page.content["questions"]}
            answers = {name: answer for name, answer in COMPREHENSION.items() if name in asked}
            await self._submit("instructions", {"answers": answers})
            return
        given = handed_in(page, self._person)
        if given is not None:
            await self._submit(given.step, dict(given.data))

    async def _on_status(self, status: Status) -> None:
        self.status = status.status
        if status.status != "paused":  # the page of a pause says more
            self._see("sign", status.status, status.reason or "")
        page = self.page
        if status.status == "ready" and page is not None and page.state.endswith("_ready"):
            key = (page.state, page.trial, True)
            if key not in self._given:
                self._given.add(key)
                await self._submit("start", {})

    async def _go_on(self) -> None:
        if self.page is not None and self.page.state == "paused" and "resume" not in self._waiting_steps():
            await self._submit("resume", {})

    def _waiting_steps(self) -> set[str]:
        return {self.memory.sent[identifier].step for identifier in self._waiting}

    def _on_alert(self, alert: Alert) -> None:
        key = (self.page.trial if self.page else None, alert.alert)
        if key in self._answered:
            return
        self._answered.add(key)
        self._soon(self._answer(alert), ANSWERS_AFTER_S)

    async def _answer(self, alert: Alert) -> None:
        number = {"alert": alert.alert}
        for step, data in (
            ("alert_shown", number),
            ("alert_heard", number),
            ("alert_answer", {**number, "value": alert.reading}),
        ):
            await self._submit(step, data)

    def _soon(self, work: Awaitable[None], after_s: float) -> None:
        async def later() -> None:
            await asyncio.sleep(after_s)
            await work

        task = asyncio.create_task(later())
        self._later.add(task)
        task.add_done_callback(self._later.discard)

    # ---- driving ----------------------------------------------------------------------------------------------------

    async def _drive(self, tick: Tick) -> None:
        """Every second tick a press, with the eyes on where the arm came to rest."""
        world, task = self._world, tick.instruction
        if tick.status != "running" or world is None or tick.tick % 2 or task.object not in world.objects_m:
            if self._direction is not None:
                await self.hold(None)
            return
        act = self._pilot.act(task.object, self._sight(world, task, task.object))
        await self.hold(act.direction, act.gripper)
        if act.direction is not None:
            await self.hold(None)

    @staticmethod
    def _sight(world: World, task: Instruction, object_id: str) -> Sight:
        release_m = world.bins_m[task.bin] if task.bin else next(iter(world.bins_m.values()))
        return Sight(world.position_m, world.held, world.gripper, world.objects_m[object_id], release_m)
