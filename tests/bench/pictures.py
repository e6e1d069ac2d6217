"""How quickly the driving page draws, with the inset and without, in one page of Chromium. See `tests.bench`.

Turn by turn, so that what else the machine does meets both. The page is 1280 by 720 and drawn without a graphics card.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from playwright.sync_api import sync_playwright

from tests.bench.figure import Figure
from tests.conftest import CHROMIUM_ARGUMENTS
from tests.support import chromium, lab_server
from tests.support.browser_person import BrowserPerson
from tests.support.wire_client import COMPREHENSION, invite, write_study

if TYPE_CHECKING:
    from playwright.sync_api import Frame, Page

TURNS = 6
TURN_S = 8.0
WAKE_S = 4.0
PUSH_S = 0.8
STEP_M = 0.02
NO_READINGS = {"practice = true ": "practice = false ", "first_s = 10.0": "first_s = 1000.0"}

# A picture is a task that draws at least once.
COUNT = """(() => {
  window.__pictures = 0;
  let drawing = false;
  for (const name of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced"]) {
    const draw = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...given) {
      if (!drawing) {
        drawing = true;
        window.__pictures += 1;
        queueMicrotask(() => { drawing = false; });
      }
      return draw.apply(this, given);
    };
  }
})()"""


def picture_figures() -> Iterator[Figure]:
    """Pictures a second of the main view with the inset and without, turn by turn, and of the inset."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        study = write_study(Path(folder), NO_READINGS)
        browser = playwright.chromium.launch(executable_path=chromium.ensure(), args=CHROMIUM_ARGUMENTS)
        with lab_server.start(Path(folder) / "data", "--study", str(study)) as lab:
            page = browser.new_context(viewport={"width": 1280, "height": 720}).new_page()
            page.add_init_script(COUNT)
            person = BrowserPerson(page, STEP_M)
            page.goto(invite(lab)["link"])
            person.come_to_the_robot("keyboard", COMPREHENSION)
            person.start()
            with_it, without_it, inset = _turns(page, person)
        browser.close()
    shares = [one / other for one, other in zip(with_it, without_it, strict=True)]
    yield Figure("main view, pictures a second, without the inset", f"{statistics.median(without_it):.1f}")
    yield Figure("main view, pictures a second, with the inset", f"{statistics.median(with_it):.1f}")
    yield Figure(f"with / without, median of {TURNS} turns", f"{statistics.median(shares):.2f}", "0.90 or more")
    yield Figure("with / without, each turn", " ".join(f"{share:.2f}" for share in shares))
    yield Figure("inset, pictures a second", f"{statistics.median(inset):.1f}")


def _turns(page: Page, person: BrowserPerson) -> tuple[list[float], list[float], list[float]]:
    """Rates of the main view with the inset and without, and of the inset, by turn."""
    frame = page.get_by_test_id("inset-frame")
    source = frame.get_attribute("src")
    rates: dict[bool, list[float]] = {True: [], False: []}
    inset: list[float] = []
    for turn in range(TURNS):
        for shown in (True, False) if turn % 2 else (False, True):
            frame.evaluate("(frame, src) => { frame.src = src; }", source if shown else "about:blank")
            _drive(page, person, WAKE_S)
            frames = [one for one in page.frames if "/scene/" in one.url]
            main = next(one for one in frames if "initialCameraNear" not in one.url)
            beside = next((one for one in frames if "initialCameraNear" in one.url), None)
            before, started_s = _counts(main, beside), time.monotonic()
            _drive(page, person, TURN_S)
            after, seconds = _counts(main, beside), time.monotonic() - started_s
            rates[shown].append((after[0] - before[0]) / seconds)
            if shown:
                inset.append((after[1] - before[1]) / seconds)
    return rates[True], rates[False], inset


def _counts(main: Frame, beside: Frame | None) -> tuple[int, int]:
    counted = [one.evaluate("window.__pictures") if one is not None else 0 for one in (main, beside)]
    return counted[0], counted[1]


def _drive(page: Page, person: BrowserPerson, seconds: float) -> None:
    """To and fro, so that there is always something to draw."""
    ends_s, way = time.monotonic() + seconds, 1
    while time.monotonic() < ends_s:
        person.hold((0, way, 0))
        page.wait_for_timeout(1000 * PUSH_S)
        way = -way
    person.hold((0, 0, 0))
