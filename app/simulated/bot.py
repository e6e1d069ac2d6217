"""Scripted clients of the wire: `salab bot` completes a whole study as a participant would, without a browser.

The bot follows the link (HTTP, for the cookie), opens the WebSocket, fills in every form, drives the robot with
`app.simulated.pilot` and answers every alert. It must run in lockstep: it has no hands to time.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from app.autonomy.actions import Direction
from app.simulated.answers import PlainPerson
from app.simulated.clumsy import Clumsy, Finding
from app.simulated.connection import BotError, Wire, enter, open_wire
from app.simulated.pilot import Pilot, Sight
from app.trial.values import UserInput
from app.wire import (
    Ack,
    Alert,
    Error,
    Input,
    Instruction,
    Message,
    Note,
    Page,
    Ping,
    Pong,
    Status,
    Superseded,
    Tick,
    Welcome,
    World,
)
from study.flow.flow import FLOW, Flow
from study.flow.page import HandedIn, Person
from study.flow.protocol import NEEDS, PAUSED, TERMINAL

MAX_PHASE_TICKS = 3000
MAX_FAULTS = 2
"""So often the bot goes on after a fault of the lab's."""
"""A trial takes a few hundred ticks; after this many the bot is stuck and says so."""


@dataclass
class BotReport:
    """What a bot did."""

    ticks: int = 0
    alerts: int = 0
    surveys: int = 0
    pages: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    """What must not be; only a clumsy bot looks for it."""


def handed_in(page: Page, person: Person, flow: Flow = FLOW) -> HandedIn | None:
    """What the script of a page hands in, or None where it has nothing to."""
    scripted = flow.page(page.state).scripted
    return scripted(page.content, person) if scripted else None


def alert_steps(alert: Alert) -> tuple[tuple[str, dict[str, Any]], ...]:
    """What is submitted about a stimulus: seen, heard, answered."""
    number = {"alert": alert.alert}
    answer = alert.reading if alert.right_answer is None else alert.right_answer
    return ("alert_shown", number), ("alert_heard", number), ("alert_answer", {**number, "value": answer})


class PanelBot:
    """The scripted participant's second device."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    async def catch_up(self) -> int:
        """Answer every alert shown so far; returns how many there were.

        The lab answers in order: once a note sent now is acknowledged, every alert shown before it has arrived.
        """
        logged = 0
        marker = self._wire.new_id()
        await self._wire.send(Note(id=marker, name="in_step"))
        while True:
            message = await self._wire.receive()
            if isinstance(message, Alert):
                logged += 1
                for step, data in alert_steps(message):
                    await self._wire.submit(step, data)
            elif isinstance(message, Error):
                raise BotError(
                    f"the lab refused on the second device: {message.code}, {message.field}: {message.message}"
                )
            elif isinstance(message, Ack) and message.id == marker:
                return logged

    async def finish(self) -> None:
        """The study is over."""
        await self._wire.report_received()


class Bot:
    """One scripted participant over one wire. `say` gets a line for every page."""

    PACE: Literal["lockstep", "real_time"] = "lockstep"
    """Which participants it can be."""

    def __init__(
        self,
        wire: Wire,
        say: Callable[[str], None] | None,
        panel: PanelBot | None = None,
        flow: Flow = FLOW,
        clumsy_seed: int | None = None,
    ) -> None:
        """With `clumsy_seed`, it drives as `app.simulated.clumsy` does and looks for what must not be."""
        self.report = BotReport()
        self._flow = flow
        self._person = PlainPerson()
        self._wire = wire
        self._say = say or (lambda line: None)
        self._panel = panel
        self._pilot = Pilot()
        self._clumsy_seed = clumsy_seed
        self._clumsy: Clumsy | None = None
        self._last_tick = -1
        self._was: World | None = None
        self._world: World | None = None
        self._instruction: Instruction | None = None
        self._page: Page | None = None
        self._ready = False
        self._resumed = False
        self._seq = 0
        self._direction: Direction | None = None
        self._phase_ticks = 0
        self._pending: dict[str, str] = {}
        self._faults = 0
        self._given_up: set[str | None] = set()

    async def run(self) -> BotReport:
        """Go through the whole study."""
        while self._page is None or self._page.state not in TERMINAL:
            await self._handle(await self._wire.receive())
        await self._wire.report_received()
        if self._panel is not None:
            await self._panel.finish()
        return self.report

    async def _handle(self, message: Message) -> None:
        if isinstance(message, Welcome):
            if message.pace != self.PACE:
                runs = {"real_time": "in real time", "lockstep": "in lockstep"}[message.pace]
                raise BotError(f"this participant runs {runs}; the bot needs one made with pace {self.PACE!r}")
            self._seq = message.last_seq
        elif isinstance(message, Page):
            await self._on_page(message)
        elif isinstance(message, World):
            self._world = message
        elif isinstance(message, Status):
            await self._on_status(message)
        elif isinstance(message, Tick):
            await self._on_tick(message)
        elif isinstance(message, Alert):
            self.report.alerts += 1
            for step, data in alert_steps(message):
                await self._submit(step, data)
        elif isinstance(message, Ack):
            self._pending.pop(message.id, None)
        elif isinstance(message, Ping):
            await self._on_ping(message)
        elif isinstance(message, Error):
            await self._on_error(message)
        elif isinstance(message, Superseded):
            raise BotError("somebody else opened the same link")

    async def _on_page(self, page: Page) -> None:
        first = self._page is None or self._page.state != page.state or self._page.trial != page.trial
        self._page = page
        if page.content.get("instruction"):
            self._instruction = Instruction.model_validate(page.content["instruction"])
        if not first:
            return
        self.report.pages.append(page.state)
        self._say(page.state + (f" (trial {page.trial} of {page.trials})" if page.trial else ""))
        self._ready = self._resumed = False
        self._phase_ticks = 0
        if self._clumsy_seed is not None and page.state.endswith("_ready"):
            drive = (self._clumsy_seed, page.trial or 0, page.state == "trial_ready")
            self._clumsy, self._last_tick = Clumsy(np.random.default_rng([int(part) for part in drive])), -1
        if not self._waits(page):
            await self._answer_page()
        if page.state == "survey":
            self.report.surveys += 1

    def _waits(self, page: Page) -> bool:
        """Whether something must come before the answer: the robot, or the measurement of the connection."""
        return page.state == PAUSED or page.state in NEEDS or "round_trip" in page.content.get("checks", ())

    async def _on_ping(self, ping: Ping) -> None:
        await self._wire.send(Pong(n=ping.n))
        if ping.left == 0 and self._page is not None:
            await self._answer_page()

    async def _on_status(self, status: Status) -> None:
        """Start when the robot is ready; the first input of a phase follows when it runs."""
        assert self._page is not None
        if status.status == "ready" and self._page.state.endswith("_ready") and not self._ready:
            self._ready = True
            await self._answer_page()
        elif status.status == "running":
            await self._drive()
        elif status.status == "paused" and self._page.content.get("can_resume") and not self._resumed:
            self._resumed = True  # once a pause: its status is told again when the robot is ready
            self._faults += "fault" in self._page.content.get("causes", ())
            if self._faults > MAX_FAULTS:
                raise BotError(f"the lab paused {MAX_FAULTS} times because of a fault of its own; see its event log")
            await self._answer_page()

    async def _on_tick(self, tick: Tick) -> None:
        self.report.ticks += 1
        self._instruction = tick.instruction
        self._phase_ticks += 1
        if self._phase_ticks > MAX_PHASE_TICKS:
            raise BotError(f"gave up after {MAX_PHASE_TICKS} ticks in one trial, at: {tick.instruction.text}")
        if self._clumsy is not None:
            self._check(tick)
        if self._panel is not None:
            self.report.alerts += await self._panel.catch_up()
        if tick.status != "finished":
            await self._drive(resetting=tick.status == "resetting")

    async def _drive(self, resetting: bool = False) -> None:
        """One input, which runs one tick."""
        act = UserInput()
        world, task = self._world, self._instruction
        if not resetting and world is not None and task is not None and task.object in world.objects_m:
            release_m = world.bins_m[task.bin] if task.bin else self._release(world, task)
            sight = Sight(world.position_m, world.held, world.gripper, world.objects_m[task.object], release_m)
            act = (self._clumsy or self._pilot).act(task.object, sight)
        self._was = world
        self._direction = act.direction
        self._seq += 1
        given = {"seq": self._seq, "client_ms": 0.0, "direction": act.direction, "gripper": act.gripper}
        await self._wire.send(Input.model_validate(given))

    def _check(self, tick: Tick) -> None:
        """What a tick says must agree with the last one, with what was sent and with the world that came with it."""
        world, was, found = self._world, self._was, self.report.findings
        wrong = {
            "unacknowledged": tick.seq != self._seq,
            "tick lost": tick.tick != self._last_tick + 1 and self._last_tick >= 0,
            "hint without blocked, or blocked without hint": tick.blocked != (tick.hint is not None),
            "more tasks than there are": not 0 <= tick.done_tasks <= tick.tasks,
        }
        if world is not None:
            wrong["gripper told in two ways"] = tick.gripper != world.gripper
            wrong["holding told in two ways"] = tick.holding != (world.held is not None)
        found += [Finding(kind, tick.tick, f"{tick!r}") for kind, is_so in wrong.items() if is_so]
        self._last_tick = tick.tick
        if self._clumsy is not None and world is not None:
            running = tick.status == "running" and tick.notice is None and was is not None and was.gripper != "moving"
            self._clumsy.told(tick.blocked, running, world.position_m)
            found += self._clumsy.findings
            self._clumsy.findings.clear()

    @staticmethod
    def _release(world: World, task: Instruction) -> tuple[float, float, float] | None:
        """In a pickup the object is only lifted: any bin is a fine direction to lift it for. None in practice."""
        return next(iter(world.bins_m.values())) if task.kind == "pickup" else None

    async def _answer_page(self) -> None:
        """Hand in what the page's script says."""
        assert self._page is not None
        given = handed_in(self._page, self._person, self._flow)
        if given is not None:
            await self._submit(given.step, given.data)
        elif not (self._page.state in TERMINAL or self._waits(self._page)):
            raise BotError(f"page {self._page.state!r} says nothing of how a scripted client gets past it")

    async def _on_error(self, error: Error) -> None:
        step = self._pending.pop(error.id or "", None)
        if error.id in self._given_up:
            return
        if (error.code, error.field, error.id) == ("illegal", "type", None):
            return  # the worker was being replaced: the lab says when ticks run again
        if step is None or not self._person.was_wrong((error.field or "").removeprefix("answers.")):
            raise BotError(f"the lab refused {step or 'a message'}: {error.code}, {error.field}: {error.message}")
        self._given_up.add(error.id)  # its other wrong answers are put right one by one
        await self._answer_page()

    async def _submit(self, step: str, data: Mapping[str, Any]) -> None:
        self._pending[await self._wire.submit(step, data)] = step


async def run_bot(
    url: str,
    panel_url: str | None = None,
    say: Callable[[str], None] | None = None,
    flow: Flow = FLOW,
    clumsy_seed: int | None = None,
) -> BotReport:
    """Complete a study over a participant's link. Raises `BotError` when the lab refuses something."""
    async with contextlib.AsyncExitStack() as stack:
        panel = None
        if panel_url is not None:
            panel = PanelBot(
                await stack.enter_async_context(open_wire(await enter(panel_url), "bot-panel", telemetry=True))
            )
        wire = await stack.enter_async_context(open_wire(await enter(url), "bot", telemetry=True, flow=flow))
        return await Bot(wire, say, panel, flow, clumsy_seed).run()
