"""How long after a press the robot moves, and its picture. See `tests.bench`.

A key is pressed in headless Chromium at moments that have nothing to do with the lab's ticks. Counted is what comes on
top of the wait for the next deadline, so a press that is not in time for it counts half a second. The page and the lab
have one clock. The study's planning delay, which a robot stands still for by design, is 0; nobody else moves the robot.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from playwright.sync_api import sync_playwright

from sim.interface import TICK_S
from study.store import open_store
from tests.bench.figure import Figure
from tests.conftest import CHROMIUM_ARGUMENTS
from tests.support import chromium, lab_server
from tests.support.browser_person import BrowserPerson
from tests.support.outside_package import install, installed_at
from tests.support.study_samples import lab_text
from tests.support.wire_client import COMPREHENSION, invite, write_study

if TYPE_CHECKING:
    from playwright.sync_api import Frame, Page

PRESSES = 40
SEED = 2020
HELD_MS = 1200
AT_REST_MS = 1500
WAY_THERE_AND_BACK = ("KeyA", "KeyD")
ROBOT = '''
import os
import time

from sim.bullet import BulletRobot


class TimedRobot(BulletRobot):
    """Writes down, in Unix seconds, when it is told to move."""

    def command(self, command):
        verdict = super().command(command)
        if any(any(segment.direction) for segment in verdict.executed):
            with open(os.environ["SALAB_TOLD_TO_MOVE"], "a", encoding="ascii") as file:
                print(repr(time.time()), file=file)
        return verdict
'''
PRESSED = """() => {
  window.__pressedMs = [];
  addEventListener("keydown", (event) => event.repeat
    || window.__pressedMs.push(performance.timeOrigin + event.timeStamp), true);
}"""
# When each picture that differs from the one before was there: what was drawn is read back, so nothing is under way.
CHANGED = """() => {
  const names = ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced"];
  let pixels = new Uint8Array(0), last = 0, drawing = false;
  window.__changedMs = [];
  const look = (gl) => {
    drawing = false;
    const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
    if (pixels.length !== width * height * 4) pixels = new Uint8Array(width * height * 4);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const words = new Uint32Array(pixels.buffer);
    let sum = 0;
    for (let at = 0; at < words.length; at += 3) sum = (Math.imul(sum, 31) + words[at]) | 0;
    if (sum !== last) window.__changedMs.push(performance.timeOrigin + performance.now());
    last = sum;
  };
  for (const name of names) {
    const draw = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...given) {
      if (!drawing) { drawing = true; queueMicrotask(() => look(this)); }
      return draw.apply(this, given);
    };
  }
}"""


@dataclass(frozen=True)
class Press:
    """One press and what came of it, in milliseconds after the deadline that followed it."""

    motion_ms: float
    picture_ms: float


def press_figures() -> Iterator[Figure]:
    """From a press to the first motion and to the first changed picture, without the wait for the tick."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        place = Path(folder)
        told = place / "told.txt"
        install(place, {"timed": "outside_robots:TimedRobot"}, ROBOT)
        environment = {**installed_at(place), "SALAB_TOLD_TO_MOVE": str(told)}
        arguments = ("--study", str(_study(place)), "--robot", "timed")
        browser = playwright.chromium.launch(executable_path=chromium.ensure(), args=CHROMIUM_ARGUMENTS)
        with lab_server.start(place / "data", *arguments, environment=environment) as lab:
            page = browser.new_context(viewport={"width": 1280, "height": 720}).new_page()
            made = invite(lab)
            frame = _to_the_robot(page, made["link"])
            rate = _press(page, frame)
            pressed_s = [ms / 1e3 for ms in page.evaluate("window.__pressedMs")]
            changed_s = [ms / 1e3 for ms in frame.evaluate("window.__changedMs")]
            moved_s = [float(line) for line in told.read_text(encoding="ascii").split()]
            with open_store(lab.data_dir, must_exist=True) as store:
                ticks = store.rows_of("ticks", made["participant"])
        browser.close()
    due_s = [datetime.fromisoformat(row.started_utc).timestamp() - row.late_ms / 1e3 for row in ticks]
    presses = [_after(one_s, due_s, moved_s, changed_s) for one_s in pressed_s]
    yield from _shares("press to motion, beyond the wait", [press.motion_ms for press in presses], 30)
    yield from _shares("press to changed pixels, beyond the wait", [press.picture_ms for press in presses], 90)
    yield Figure("presses; pictures a second meanwhile", f"{len(presses)}; {rate:.1f}")


def _shares(what: str, found_ms: list[float], aim_ms: int) -> Iterator[Figure]:
    p50, p95 = np.percentile(found_ms, (50, 95))
    yield Figure(f"{what}, p50", f"{p50:.0f} ms")
    yield Figure(f"{what}, p95", f"{p95:.0f} ms", f"{aim_ms} ms")


def _after(pressed_s: float, due_s: list[float], moved_s: list[float], changed_s: list[float]) -> Press:
    """The deadlines are those of ticks that were run; between them they are half a second apart."""
    before_s = max(one for one in due_s if one <= pressed_s)
    deadline_s = before_s + TICK_S
    motion_s = min(one for one in moved_s if one > pressed_s)
    picture_s = min(one for one in changed_s if one > motion_s)
    return Press(1e3 * (motion_s - deadline_s), 1e3 * (picture_s - deadline_s))


def _study(folder: Path) -> Path:
    text = lab_text()
    others = text[text.index('[[conditions]]\nid = "goal_oriented"') : text.index("[arbiter]")]
    changes = {
        others: "",
        "practice = true ": "practice = false ",
        "first_s = 10.0": "first_s = 1000.0",
        "planning_delay = 0.2 ": "planning_delay = 0.0 ",
    }
    return write_study(folder, changes)


def _to_the_robot(page: Page, link: str) -> Frame:
    person = BrowserPerson(page, 0.02)
    page.goto(link)
    person.come_to_the_robot("keyboard", COMPREHENSION)
    person.start()
    person.next_tick()
    frame = next(one for one in page.frames if "/scene/" in one.url and "initialCameraNear" not in one.url)
    page.evaluate(PRESSED)
    frame.evaluate(CHANGED)
    return frame


def _press(page: Page, frame: Frame) -> float:
    """Press, hold, let go, come to rest, again and again. Pictures a second."""
    rng = np.random.default_rng(SEED)
    counted: list[float] = []
    for number in range(PRESSES):
        page.wait_for_timeout(AT_REST_MS + float(rng.uniform(0.0, 1e3 * TICK_S)))
        key = WAY_THERE_AND_BACK[number % len(WAY_THERE_AND_BACK)]
        before = frame.evaluate("[window.__changedMs.length, performance.now()]")
        page.keyboard.down(key)
        page.wait_for_timeout(HELD_MS)
        after = frame.evaluate("[window.__changedMs.length, performance.now()]")
        page.keyboard.up(key)
        counted.append(1e3 * (after[0] - before[0]) / (after[1] - before[1]))
    print(f"  pressed {PRESSES} times", file=sys.stderr)
    return statistics.median(counted)
