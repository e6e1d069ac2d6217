"""Sockets of a lab as it is served: another process, a network, a robot that runs. The session that is fuzzed is in its
first trial, and has to go on ticking."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

from app.simulated.connection import BotError
from app.wire import Error, Input, Tick
from tests.fuzz.sockets import FRAMES, _frame, _said
from tests.fuzz.surface import Surface
from tests.support import lab_server
from tests.support.wire_client import invite, visit, write_study

AT_ONCE = 25
PAUSE_S = 0.02
"""Between frames: a page that says more than that is slowed down, which is tested elsewhere."""


class LiveSockets(Surface):
    """A context: a lab in lockstep and a participant in their first trial."""

    name = "live"

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __enter__(self) -> LiveSockets:
        study = write_study(self._folder)
        arguments = ("--study", str(study), "--robot", "kinematic", "--no-scene", "--pace", "lockstep")
        self._lab = lab_server.start(self._folder / "data", *arguments)
        return self

    def __exit__(self, *_: object) -> None:
        self._lab.close()

    def inputs(self, count: int, random: Random) -> Iterator[tuple[Any, int]]:
        """Frames that are said on one socket."""
        done = 0
        while done < count:
            frames = [_frame(FRAMES, random) for _ in range(min(AT_ONCE, count - done))]
            done += len(frames)
            yield {"frames": frames}, len(frames)

    def problem(self, given: Any) -> str:
        """A traceback in the log, or a session that does not tick any more."""
        said = len(self._lab.log())
        wrong = asyncio.run(self._said(given["frames"]))
        log = self._lab.log()[said:]
        return wrong or (log if "Traceback" in log or "ERROR" in log else "")

    async def _said(self, frames: list[dict[str, str]]) -> str:
        link = invite(self._lab, kind="pilot")["link"]
        async with visit(link) as page:
            await page.reach_trial()
            with contextlib.suppress(BotError):  # a bound is beyond: the socket is closed, and the session goes on
                for frame in frames:
                    await page.send(_said(frame))
                    await asyncio.sleep(PAUSE_S)
        async with visit(link) as page:
            try:
                return await self._ticks(page)
            except (asyncio.TimeoutError, BotError, AssertionError) as error:
                return f"the session is dead: {type(error).__name__}: {error}"

    @staticmethod
    async def _ticks(page: Any) -> str:
        """ "" when the session can be driven, or is over because one of the frames was a good one that ended it."""
        state = ""
        while True:
            message = await page.next()
            state = getattr(message, "state", state)
            if state in ("withdrawn", "aborted", "survey", "done"):
                return ""
            if state == "paused" and getattr(message, "content", {}).get("can_resume"):
                await page.done("resume")
                state = "resumed"
            if getattr(message, "status", "") == "running" and message.type in ("status", "tick"):
                break
        for _ in range(3):
            await page.send(Input.model_validate({"seq": page.seq + 1, "client_ms": 0.0, "direction": (0, 0, 1)}))
            page.seq += 1
            heard = await page.next()
            while not isinstance(heard, (Tick, Error)):
                heard = await page.next()
            if isinstance(heard, Tick):
                return ""
        return f"an input is answered by {heard}"
