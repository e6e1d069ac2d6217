"""A scripted participant against the clock: a page that beats, hands that follow the robot, and 3-D views that look on.

It goes through a study as `app.simulated.bot` does, and drives as its pilot does: one input after each tick, and
between them the sign of life of a page. It is no model of a person, who would rest and read: it drives all the time.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence

from app.simulated.bot import Bot, BotReport, PanelBot
from app.simulated.connection import BotError, PageAccess, Wire, enter, open_scene, open_wire
from app.wire import Heartbeat, Message, Page, Status, Welcome
from study.flow.protocol import DRIVEN, NEEDS

LOOK_AGAIN_S = 0.5
"""A 3-D view that was closed, as at the end of each practice and trial, is opened again after this."""


class TimedBot(Bot):
    """One scripted participant in real time.

    Attributes:
        robot: set while there is a robot to look at.
        is_driving: whether ticks run that the hands are for.
        holds: how often the robot stood still because no sign of life had come in time.
    """

    PACE = "real_time"

    def __init__(self, wire: Wire, panel: PanelBot | None = None) -> None:
        super().__init__(wire, None, panel)
        self.robot = asyncio.Event()
        self.is_driving = False
        self.holds = 0
        self._beat_s = 0.1
        self._on_driven_page = False

    async def beat(self) -> None:
        """Be a page that is there, until cancelled."""
        with contextlib.suppress(BotError):  # the socket's reader tells it
            while True:
                await asyncio.sleep(self._beat_s)
                if self._on_driven_page:
                    await self._wire.send(Heartbeat.model_validate({"seq": self._seq, "direction": self._direction}))

    async def _handle(self, message: Message) -> None:
        if isinstance(message, Welcome):
            self._beat_s = message.heartbeat_ms / 1000.0
        elif isinstance(message, Page):
            self._on_driven_page = message.state in DRIVEN
            if message.state not in NEEDS:
                self.is_driving = False
                self.robot.clear()
        elif isinstance(message, Status):
            self.is_driving = message.status == "running"
            self.holds += message.status == "held"
            if message.status in ("ready", "running"):
                self.robot.set()
        await super()._handle(message)


class TimedPerson:
    """A participant with all their windows: page, second device if the study has one, 3-D views.

    Attributes:
        bot: what drives, once the page is open.
        scene_bytes: what the 3-D views have received.
        scenes: how many of them are open.
    """

    def __init__(self, link: str, panel_link: str | None = None, near_m: Sequence[float] = ()) -> None:
        """`near_m`: a 3-D view with this near plane each; by it the scene tells the inset from the picture."""
        self._link = link
        self._panel_link = panel_link
        self._near_m = tuple(near_m)
        self.bot: TimedBot | None = None
        self.scene_bytes = 0
        self.scenes = 0
        self._has_driven = False

    @property
    def has_driven(self) -> bool:
        """Whether the robot has obeyed while every view showed it."""
        is_now = self.bot is not None and self.bot.is_driving and self.scenes == len(self._near_m)
        self._has_driven = self._has_driven or is_now
        return self._has_driven

    async def live(self) -> BotReport:
        """Go through the whole study. Raises `BotError` when the lab refuses something or is gone."""
        async with contextlib.AsyncExitStack() as stack:
            panel = None
            if self._panel_link is not None:
                access = await enter(self._panel_link)
                panel = PanelBot(await stack.enter_async_context(open_wire(access, "bench-panel", telemetry=True)))
            access = await enter(self._link)
            wire = await stack.enter_async_context(open_wire(access, "bench", telemetry=True))
            self.bot = bot = TimedBot(wire, panel)
            beside = [asyncio.create_task(bot.beat())]
            beside += [asyncio.create_task(self._look(access, bot, near_m)) for near_m in self._near_m]
            try:
                return await bot.run()
            finally:
                for task in beside:
                    task.cancel()
                await asyncio.gather(*beside, return_exceptions=True)

    async def _look(self, access: PageAccess, bot: TimedBot, near_m: float) -> None:
        """Have a 3-D view open whenever there is a robot."""
        while True:
            await bot.robot.wait()
            with contextlib.suppress(BotError):  # as when a practice ends
                async with open_scene(access, near_m) as scene:
                    self.scene_bytes += await scene.receive()
                    self.scenes += 1
                    try:
                        while True:
                            self.scene_bytes += await scene.receive()
                    finally:
                        self.scenes -= 1
            await asyncio.sleep(LOOK_AGAIN_S)
