"""The participant's page, brought to where a test begins: opened, in a round that runs, or left in one."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from typing import TYPE_CHECKING, Any

from tests.support.fake_pages import tick
from tests.support.wire_client import visit

if TYPE_CHECKING:
    from playwright.sync_api import Page

    from tests.support.fake_lab import FakeLab

WITHIN_S = 60.0
LOUDEST = """() => {
  const samples = new Float32Array(salab.sound.analyser.fftSize);
  salab.sound.analyser.getFloatTimeDomainData(samples);
  return Math.max(...samples.map(Math.abs)) OF;
}"""
"""Whether the loudest sample is OF, such as `> 0.02`."""
LOSE_CONTEXT = """document.querySelector("canvas[data-engine]").getContext("webgl2")
  .getExtension("WEBGL_lose_context").loseContext()"""
"""In a frame that draws: the browser takes its picture away."""


def visible(page: Page, testid: str) -> None:
    page.get_by_test_id(testid).wait_for(state="visible")


def opened(page: Page, lab: FakeLab, state: str) -> None:
    """The participant's page in this state, connected."""
    lab.state = state
    page.goto(lab.participant_url)
    driving = {"practice": "page-drive", "trial": "page-drive"}
    visible(page, driving.get(state, f"page-{state}"))
    page.locator("[data-testid=connection][data-state=open]").wait_for()


def running(page: Page, lab: FakeLab) -> None:
    """The page of a round, once its first tick has come."""
    visible(page, "page-drive")
    page.locator("[data-testid=connection][data-state=open]").wait_for()
    lab.send(tick(0))
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()


def driving(page: Page, lab: FakeLab) -> None:
    """The participant's page in a round that runs."""
    opened(page, lab, "trial")
    running(page, lab)


def in_thread(work: Coroutine[Any, Any, None]) -> None:
    """Run a coroutine to its end: in this thread playwright has the loop."""
    thread = threading.Thread(target=lambda: asyncio.run(work), daemon=True)
    thread.start()
    thread.join(WITHIN_S)
    assert not thread.is_alive()


def left_at(link: str, state: str) -> None:
    """Somebody has gone through a running lab's study as far as `state`, and closed the page."""

    async def go() -> None:
        async with visit(link) as player:
            await player.reach(state)

    in_thread(go())
