"""The same person at a real page: a Chromium of their own, driven by the keyboard, every frame of it remembered.

What the page shows is told by an observer in the page (signs, cards, messages), what it says and hears by its socket.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from typing import Any

from playwright.async_api import Browser, CDPSession, Page, Playwright, WebSocket, async_playwright
from playwright.async_api import Error as PlaywrightError

from app.wire import CLIENT_MESSAGE, SERVER_MESSAGE, Ack, Error, Submit, Tick
from app.wire import Page as LabPage
from tests.conftest import CHROMIUM_ARGUMENTS
from tests.faults.memory import Hands, HeardTick, Seen
from tests.faults.person import GOES_ON_AFTER_S, Person
from tests.faults.row import CannotRun
from tests.support import chromium
from tests.support.lab_server import EXPERIMENTER_TOKEN
from tests.support.wire_client import Direction, visit

KEYS = {(0, 1, 0): "KeyA", (0, 0, 1): "KeyR", (1, 0, 0): "KeyW", (0, -1, 0): "KeyD", (0, 0, -1): "KeyF"}
READY_WITHIN_S = 60.0
OBSERVER = """
(() => {
  const seen = new Map();
  const tell = (kind, name, text) => {
    if (seen.get(kind) === name) return;
    seen.set(kind, name);
    window.saw(kind, name, text ?? "");
  };
  const look = () => {
    const one = (id) => document.querySelector(`[data-testid=${id}]`);
    const sign = one("state-sign");
    if (sign?.dataset.state) tell("sign", sign.dataset.state, sign.innerText);
    const connection = one("connection");
    if (connection?.dataset.state) tell("connection", connection.dataset.state, connection.innerText);
    for (const card of ["page-paused", "page-superseded", "page-denied", "page-trial_ready", "toast-problem"]) {
      tell(card, one(card) ? "there" : "gone", one(card)?.innerText);
    }
    const start = one("start-button"), resume = one("resume-button");
    tell("button", resume ? "resume" : start && !start.disabled ? "start" : "none");
  };
  const begin = () => {
    new MutationObserver(look).observe(document.documentElement, {
      subtree: true, childList: true, attributes: true, characterData: true,
    });
    look();
  };
  document.documentElement ? begin() : addEventListener("DOMContentLoaded", begin);
})();
"""


BOARD_OBSERVER = """
(() => {
  let told = "";
  const look = () => {
    const row = document.querySelector("[data-testid=session-row]");
    const updated = document.querySelector("[data-testid=last-updated]");
    const alerts = [...document.querySelectorAll("[role=alert]")].map((one) => one.innerText);
    const stale = updated?.classList.contains("stale") ? updated.innerText.replace(/ at .*/, "") : "";
    const trouble = document.querySelector("[data-testid=lab-trouble]");
    const unsaved = trouble?.hidden ? "" : trouble?.innerText;
    const text = [stale, unsaved, row?.innerText, ...alerts].filter(Boolean).join(" | ").replaceAll(/\\s+/g, " ");
    if (text && text !== told) window.sawBoard((told = text));
  };
  addEventListener("DOMContentLoaded", () => {
    const watch = { subtree: true, childList: true, attributes: true, characterData: true };
    new MutationObserver(look).observe(document.documentElement, watch);
    look();
  });
})();
"""
"""The participant's line as the dashboard's page shows it, and what else it says aloud."""


class PagePerson(Person):
    """See the module's text. Hands are keys; a call for help goes through the page's own outbox."""

    def __init__(self, link: str, name: str, address: str) -> None:
        super().__init__(link, name, address)
        self.keys_work = True
        """Whether the page hears of the keyboard; what the hands do is remembered all the same."""
        self._playwright: Playwright | None = None
        self.browser: Browser | None = None
        self.tab: Page | None = None
        self._board: Browser | None = None
        self._pressed: str | None = None
        self._clicking: set[asyncio.Task[None]] = set()

    # ---- the browser ------------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """Open the page in a browser that has never been there."""
        self._task = asyncio.create_task(self._open(), name=f"page of {self.name}")

    async def end(self) -> None:
        """Close the browser."""
        self.ended = True
        for task in (*self._clicking, *([self._task] if self._task else [])):
            task.cancel()
        await asyncio.gather(*self._clicking, return_exceptions=True)
        for browser in (self.browser, self._board):
            with contextlib.suppress(PlaywrightError):
                if browser is not None:
                    await browser.close()
        if self._playwright is not None:
            await self._playwright.stop()

    async def _open(self) -> None:
        if self._playwright is None:
            async with visit(self._here(self.link)) as player:
                await player.reach("trial_ready")
            self._playwright = await async_playwright().start()
        try:
            executable = await asyncio.to_thread(chromium.find)
        except chromium.NoChromium as error:
            raise CannotRun(str(error)) from None
        self.browser = await self._playwright.chromium.launch(executable_path=executable, args=CHROMIUM_ARGUMENTS)
        context = await self.browser.new_context(viewport={"width": 1280, "height": 720}, reduced_motion="reduce")
        await context.expose_function("saw", self._saw)
        await context.add_init_script(OBSERVER)
        self.tab = await self._tab()
        if not self.board_seen:
            await self._open_board()

    async def _open_board(self) -> None:
        """The dashboard's page, in a browser of the experimenter's."""
        assert self._playwright is not None
        self._board = await self._playwright.chromium.launch(
            executable_path=await asyncio.to_thread(chromium.find), args=CHROMIUM_ARGUMENTS
        )
        context = await self._board.new_context(viewport={"width": 1400, "height": 900}, reduced_motion="reduce")
        await context.expose_function("sawBoard", self._saw_board)
        await context.add_init_script(BOARD_OBSERVER)
        page = await context.new_page()
        await page.goto(f"http://{self.address}/dashboard#token={EXPERIMENTER_TOKEN}")

    async def _saw_board(self, text: str) -> None:
        self.board_seen.append(Seen(time.monotonic(), "board", "row", text))

    async def _tab(self) -> Page:
        """Another tab of the same browser, with the link open."""
        assert self.browser is not None
        tab = await self.browser.contexts[0].new_page()
        tab.on("websocket", self._on_socket)
        await tab.goto(self._here(self.link))
        return tab

    async def another_tab(self) -> Page:
        """The link is opened once more."""
        return await self._tab()

    async def devtools(self) -> CDPSession:
        """What the browser's own tools can do with the page."""
        assert self.tab is not None
        return await self.tab.context.new_cdp_session(self.tab)

    async def process_ids(self, kind: str) -> list[int]:
        """The browser's processes of a kind: browser, renderer, GPU."""
        assert self.browser is not None
        session = await self.browser.new_browser_cdp_session()
        told = await session.send("SystemInfo.getProcessInfo")
        return [int(one["id"]) for one in told["processInfo"] if one["type"] == kind]

    # ---- what is seen -----------------------------------------------------------------------------------------------

    async def _saw(self, kind: str, name: str, text: str) -> None:
        if kind == "sign" and name != "paused":
            self._see("sign", name, text)
        elif kind == "page-paused" and name == "there":
            causes = self.page.content.get("causes", ()) if self.page else ()
            self._see("sign", "paused", ", ".join(causes), text)
        elif kind == "page-superseded" and name == "there":
            self._see("sign", "superseded", text)
        elif kind == "toast-problem" and name == "there":
            self._see("message", "problem", text)
        elif kind == "connection" and name == "lost":
            self._see("sign", "lost", text)
        elif kind == "button" and name != "none":
            self._soon(self._click(f"{name}-button"), GOES_ON_AFTER_S)
        self._changed.set()

    async def _click(self, button: str) -> None:
        with contextlib.suppress(PlaywrightError):
            if self.tab is not None and not self.ended:
                await self.tab.get_by_test_id(button).click(timeout=5_000)

    def _on_socket(self, socket: WebSocket) -> None:
        if not socket.url.endswith("/socket"):
            return
        socket.on("framesent", self._said)
        socket.on("framereceived", self._heard)

    def _said(self, frame: Any) -> None:
        with contextlib.suppress(ValueError):
            message = CLIENT_MESSAGE.validate_json(frame)
            if isinstance(message, Submit):
                self.memory.sent.setdefault(message.id, message)

    def _heard(self, frame: Any) -> None:
        message = SERVER_MESSAGE.validate_json(frame)
        if isinstance(message, Tick):
            trial = self.page.trial if self.page and self.page.trial else 0
            self.memory.ticks.append(HeardTick(time.monotonic(), self.life, trial, message))
        elif isinstance(message, LabPage):
            self.page = message
        elif isinstance(message, Ack):
            self.memory.acknowledged.setdefault(message.id, time.monotonic())
        elif isinstance(message, Error):
            self._see("error", message.code, message.message, message)
        self._changed.set()

    # ---- what is done -----------------------------------------------------------------------------------------------

    async def hold(self, direction: Direction | None, gripper: str | None = None) -> None:
        """Press the key for a direction, after letting go of the one before."""
        self.memory.hands.append(Hands(time.monotonic(), direction))
        key = KEYS[direction] if direction is not None else None
        if not self.keys_work or self.tab is None:
            return
        released, self._pressed = self._pressed, key
        with contextlib.suppress(PlaywrightError, asyncio.TimeoutError):  # a page that is gone or stands hears nothing
            if released is not None:
                await asyncio.wait_for(self.tab.keyboard.up(released), 1.0)
            if key is not None:
                await asyncio.wait_for(self.tab.keyboard.down(key), 1.0)

    async def call(self, words: str) -> str:
        """Through the page's outbox, which resends it until it is acknowledged; its id, or the words where the page
        stands still and will say it later; "" where there is no page."""
        if self.tab is None:
            return ""
        asked = """(text) => {
          salab.socket.submit("help", { text }).catch(() => {});
          return salab.socket.outbox.waiting().at(-1)?.id ?? text;
        }"""
        try:
            identifier: str = await asyncio.wait_for(self.tab.evaluate(asked, words), 1.0)
        except asyncio.TimeoutError:
            return words
        except PlaywrightError:
            return ""
        return identifier

    async def until_acknowledged(self, identifier: str, within_s: float) -> bool:
        """Wait for an acknowledgement of an id, or of words."""
        if identifier == "":
            return True
        acknowledged = self.memory.acknowledged
        return await self.until(
            lambda: identifier in acknowledged or self._said_words().get(identifier) in acknowledged, within_s
        )

    def _said_words(self) -> dict[str, str]:
        return {str(one.data.get("text")): identifier for identifier, one in self.memory.sent.items()}

    def leave(self) -> None:
        """Nobody is at the page any more (whoever calls this has killed the browser)."""
        self.connected = False
        self._pressed = None
        self._see("sign", "gone")
