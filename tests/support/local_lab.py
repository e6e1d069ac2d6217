"""A lab in the test's own process, and a page that speaks to it without a socket."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from app.config import LabConfig
from app.lab.lab import Lab
from app.session.interfaces import Role
from app.session.session import LiveSession
from app.wire import Input, Message, Page, Status, Submit, Tick, WireDirection
from tests.support.wire_client import COMPREHENSION, write_study

RIGHT: WireDirection = (0, -1, 0)
ENDS_WITHIN_S = 20.0


class LocalPage:
    """A page without a socket, in the lab's own process."""

    role: Role = "participant"
    name = "here"
    telemetry = False

    def __init__(self, session: LiveSession) -> None:
        self._session = session
        self._arrived: asyncio.Queue[Message] = asyncio.Queue()
        session.attach(self)

    @property
    def waiting(self) -> int:
        return 0

    def deliver(self, message: Message) -> None:
        self._arrived.put_nowait(message)

    def end(self) -> None:
        """Nothing to close."""

    async def until(self, kind: type[Any] | tuple[type[Any], ...], **equal: object) -> Any:
        """The next such message. Whatever else comes meanwhile, it comes in time, or the test fails with the rest."""
        others: list[Message] = []

        async def found() -> Any:
            while True:
                message = await self._arrived.get()
                if isinstance(message, kind) and all(getattr(message, name) == value for name, value in equal.items()):
                    return message
                others.append(message)

        try:
            return await asyncio.wait_for(found(), ENDS_WITHIN_S)
        except (TimeoutError, asyncio.TimeoutError):
            raise AssertionError(f"no {kind} {equal} within {ENDS_WITHIN_S:g} s; these came: {others}") from None

    async def submit(self, step: str, **data: Any) -> None:
        self._session.receive(self, Submit.model_validate({"id": step, "step": step, "data": data}))

    async def tick(self, seq: int) -> Tick:
        self._session.receive(self, Input(seq=seq, client_ms=0.0, direction=RIGHT))
        ticked: Tick = await self.until(Tick)
        return ticked


@contextlib.asynccontextmanager
async def lab_in_here(
    folder: Path, wall_unix_s: Callable[[], float] = time.time, **settings: Any
) -> AsyncIterator[Lab]:
    """A lab with the short study on a folder's `data`, open as long as the block runs; `settings` are `LabConfig`'s."""
    lab = Lab(
        LabConfig(
            data_dir=folder / "data",
            study_file=write_study(folder),
            robot="kinematic",
            pace="lockstep",
            scene=False,
            **settings,
        ),
        now_unix_s=wall_unix_s,
    )
    lab.prepare()
    await lab.open()
    try:
        yield lab
    finally:
        await lab.close()


async def in_first_trial(session: LiveSession) -> LocalPage:
    """A page that has gone as far as the first trial, which runs."""
    page = LocalPage(session)
    consent = await page.until(Page, state="consent")
    await page.submit("consent", accepted=True, hash=consent.content["hash"])
    shown = await page.until(Page, state="demographics")
    options = {item["id"]: item["options"][0]["id"] for item in shown.content["items"] if item["required"]}
    await page.submit("demographics", answers=options)
    await page.submit("setup", device="keyboard", sound=True)
    await page.submit("instructions", answers=COMPREHENSION)
    await page.until(Status, status="ready")
    await page.submit("start")
    await page.until(Status, status="running")
    return page
