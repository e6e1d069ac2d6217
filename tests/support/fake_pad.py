"""The hand on fake gamepads: a thin wrapper around `window.__pad` of a playwright page (fake_gamepad.js).

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
    """Gamepads of the computer the page's browser runs on, each in a slot. Indices count from 0, axes run -1 to 1."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._boots = 0
        self._devices: dict[int, dict[str, Any]] = {}
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
        self._devices[index] = {"id": pad_id, "mapping": mapping, **shape}
        self._boot()

    def disconnect(self, slot: int | None = None) -> None:
        """Pulls the plug: `gamepaddisconnected`, and the slot is null."""
        self._page.evaluate("(slot) => window.__pad.disconnect(slot)", slot)
        self._devices.pop(next(iter(self._devices)) if slot is None else slot, None)
        self._boot()

    def press(self, button: int, slot: int | None = None) -> None:
        self._page.evaluate("([i, slot]) => window.__pad.press(i, slot)", [button, slot])

    def release(self, button: int, slot: int | None = None) -> None:
        self._page.evaluate("([i, slot]) => window.__pad.release(i, slot)", [button, slot])

    def value(self, button: int, value: float, slot: int | None = None) -> None:
        """An analogue trigger, 0 to 1."""
        self._page.evaluate("([i, v, slot]) => window.__pad.value(i, v, slot)", [button, value, slot])

    def axis(self, axis: int, value: float, slot: int | None = None) -> None:
        self._page.evaluate("([i, v, slot]) => window.__pad.axis(i, v, slot)", [axis, value, slot])

    def stick(self, x: float, y: float, *, first_axis: int = 0) -> None:
        """Both axes of one stick (first axis 0: left, 2: right, on a standard pad); y points down, as on pads."""
        self._page.evaluate(
            "([i, x, y]) => { window.__pad.axis(i, x); window.__pad.axis(i + 1, y); }", [first_axis, x, y]
        )

    def tap(self, button: int, *, frames: int = 3, slot: int | None = None) -> None:
        """Press and release, held for a few of the page's animation frames so that a poll per frame sees it."""
        with self.held(button, slot):
            self.frames(frames)
        self.frames(1)

    @contextmanager
    def held(self, button: int, slot: int | None = None) -> Iterator[None]:
        self.press(button, slot)
        try:
            yield
        finally:
            self.release(button, slot)

    def frames(self, count: int) -> None:
        """Lets the page draw `count` frames."""
        self._page.evaluate(
            "async (n) => { while (n-- > 0) await new Promise((done) => requestAnimationFrame(done)); }", count
        )

    def state(self) -> dict[str, bool]:
        """`plugged`, `exposed`, `activated`."""
        state: dict[str, bool] = self._page.evaluate("() => window.__pad.state()")
        return state

    def _boot(self) -> None:
        # Init scripts pile up and their order is not promised: the highest number wins.
        self._boots += 1
        boot = json.dumps({"n": self._boots, "devices": list(self._devices.values())})
        self._page.add_init_script(f"if ({self._boots} > (window.__padBoot?.n ?? 0)) window.__padBoot = {boot};")
