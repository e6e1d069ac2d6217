"""The hand on the fake gamepad: a thin wrapper around `window.__pad` of a playwright page (fake_gamepad.js).

    pad = FakePad(page)          # before page.goto(): the fake must be there before the page's own scripts
    page.goto(url)
    pad.connect()
    pad.press(0)                 # the page may now see it

`page.evaluate` counts as a user gesture in Chromium: do not conclude from these tests that sound may start.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from playwright.sync_api import Page

SCRIPT = Path(__file__).with_name("fake_gamepad.js")

STANDARD_ID = "Wireless Controller (STANDARD GAMEPAD Vendor: 054c Product: 09cc)"
PS3_RAW_ID = "054c-0268-Sony PLAYSTATION(R)3 Controller"  # how one browser shows it: mapping "", ✕ is button 14
PS3_RAW_CROSS = 14
STANDARD_BOTTOM = 0


class FakePad:
    """One gamepad, plugged into the computer the page's browser runs on. Indices count from 0, axes run -1 to 1."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._boots = 0
        page.add_init_script(path=SCRIPT)

    def connect(
        self,
        pad_id: str = STANDARD_ID,
        mapping: str = "standard",
        *,
        index: int = 0,
        axes: int = 4,
        buttons: int = 17,
    ) -> None:
        """Plugs it in. The page sees nothing until a button is pressed; a reload keeps it plugged in, gated anew."""
        shape = {"index": index, "axes": axes, "buttons": buttons}
        self._page.evaluate(
            "([id, mapping, shape]) => window.__pad.connect(id, mapping, shape)", [pad_id, mapping, shape]
        )
        self._boot({"id": pad_id, "mapping": mapping, **shape})

    def disconnect(self) -> None:
        """Pulls the plug: `gamepaddisconnected`, and the slot is null."""
        self._page.evaluate("() => window.__pad.disconnect()")
        self._boot(None)

    def press(self, button: int) -> None:
        self._page.evaluate("(i) => window.__pad.press(i)", button)

    def release(self, button: int) -> None:
        self._page.evaluate("(i) => window.__pad.release(i)", button)

    def value(self, button: int, value: float) -> None:
        """An analogue trigger, 0 to 1."""
        self._page.evaluate("([i, v]) => window.__pad.value(i, v)", [button, value])

    def axis(self, axis: int, value: float) -> None:
        self._page.evaluate("([i, v]) => window.__pad.axis(i, v)", [axis, value])

    def stick(self, x: float, y: float, *, first_axis: int = 0) -> None:
        """Both axes of one stick (first axis 0: left, 2: right, on a standard pad); y points down, as on pads."""
        self._page.evaluate(
            "([i, x, y]) => { window.__pad.axis(i, x); window.__pad.axis(i + 1, y); }", [first_axis, x, y]
        )

    def tap(self, button: int, *, frames: int = 3) -> None:
        """Press and release, held for a few of the page's animation frames so that a poll per frame sees it."""
        with self.held(button):
            self.frames(frames)
        self.frames(1)

    @contextmanager
    def held(self, button: int) -> Iterator[None]:
        self.press(button)
        try:
            yield
        finally:
            self.release(button)

    def frames(self, count: int) -> None:
        """Lets the page draw `count` frames."""
        self._page.evaluate(
            "async (n) => { while (n-- > 0) await new Promise((done) => requestAnimationFrame(done)); }", count
        )

    def state(self) -> dict[str, bool]:
        """`plugged`, `exposed`, `activated`."""
        state: dict[str, bool] = self._page.evaluate("() => window.__pad.state()")
        return state

    def _boot(self, device: dict[str, Any] | None) -> None:
        # Init scripts pile up and their order is not promised: the highest number wins.
        self._boots += 1
        boot = json.dumps({"n": self._boots, "device": device})
        self._page.add_init_script(f"if ({self._boots} > (window.__padBoot?.n ?? 0)) window.__padBoot = {boot};")
