"""A person at the participant's page, for end-to-end tests: reads the page, fills in forms, drives by keys or gamepad.

Driving follows `app.simulated.pilot` with the delay a person has: what is pressed after seeing a tick counts one tick
later, so the position is first carried forward by the tick that is already running.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from playwright.sync_api import TimeoutError as PlaywrightTimeout

from app.simulated.pilot import Pilot, Sight
from app.trial.values import UserInput
from tests.support.fake_pad import FakePad

if TYPE_CHECKING:
    from playwright.sync_api import Page

TELEMETRY = Path(__file__).with_name("telemetry.js")
KEYS = ({1: "KeyW", -1: "KeyS"}, {1: "KeyA", -1: "KeyD"}, {1: "KeyR", -1: "KeyF"})
GRIPPER_KEYS = {"close": "KeyC", "open": "KeyO"}
# What this person's pad does: sticks for x and y, shoulder buttons for z, two face buttons for the gripper.
PAD_AXES = ({1: (1, -1.0), -1: (1, 1.0)}, {1: (0, -1.0), -1: (0, 1.0)})
PAD_Z_BUTTONS = {1: 5, -1: 4}
PAD_GRIPPER = {"close": 0, "open": 1}
STEP_TIMEOUT_MS = 60_000
REACTION_MS = 120

COVER = """() => {
  const visible = (id) => document.querySelector(`[data-testid=${id}]`)?.checkVisibility() ?? false;
  const field = document.querySelector("[data-testid=alert-input]");
  const asked = visible("alert-input") && !field.disabled && document.activeElement === field;
  const reading = asked ? document.querySelector("[data-testid=alert-reading]").innerText : null;
  return [visible("alert"), reading];
}"""

ASKED_NEXT = """(step) =>
  document.querySelector("[data-testid=calibration]")?.getAttribute("data-step") !== step"""
LEARNS_MS = 2000

PLANNING_DELAY = 0.2

Device = Literal["keyboard", "gamepad"]
Direction = tuple[int, int, int]
NOTHING: Direction = (0, 0, 0)


class BrowserPerson:
    """One participant at one page. Make it before the page is opened."""

    def __init__(self, page: Page, step_m: float, shot: Callable[[str], None] = lambda name: None) -> None:
        self.page = page
        self.pad = FakePad(page)
        self.device: Device = "keyboard"
        self._shot = shot
        self._step_m = step_m
        self._held: Direction = NOTHING
        self._held_before: Direction = NOTHING
        self._ticks = 0
        self._logged: str | None = None
        page.add_init_script(path=TELEMETRY)

    # ---- forms --------------------------------------------------------------------------------------------------

    def come_to_the_robot(self, device: Device, right: dict[str, str]) -> None:
        """From the consent to the page on which the robot is driven; `right`: as for `instructions`."""
        self.consent()
        self.demographics()
        self.setup(device)
        self.instructions(right)
        self.at("drive")

    def at(self, name: str) -> None:
        """Wait for a page by its test id."""
        self.page.get_by_test_id(f"page-{name}").wait_for(timeout=STEP_TIMEOUT_MS)

    def click(self, test_id: str) -> None:
        """Click a control by its test id."""
        self.page.get_by_test_id(test_id).click(timeout=STEP_TIMEOUT_MS)

    def consent(self) -> None:
        """Read and agree."""
        self.at("consent")
        self._shot("consent")
        self.page.get_by_test_id("consent-box").check()
        self.click("consent-agree")

    def demographics(self) -> None:
        """Give the last answer to every question."""
        self.at("demographics")
        for group in self.page.get_by_test_id("page-demographics").locator("fieldset").all():
            group.get_by_role("radio").last.check()
        self._shot("demographics")
        self.click("demographics-submit")

    def setup(self, device: Device) -> None:
        """Choose how to drive (a gamepad is set up by pressing what the page asks) and check the sound."""
        self.at("setup")
        self._shot("setup")
        if device == "gamepad":
            self.page.get_by_test_id("device-gamepad").click()
            self.calibrate()
        else:
            self.page.get_by_test_id("device-keyboard").click()
        self.device = device
        if self.page.get_by_test_id("setup-sound").count() == 0:  # it sounds on the second device
            self.click("setup-submit")
            return
        self.click("sound-play")
        self.click("sound-yes")
        self._shot(f"setup_{device}")
        self.click("setup-submit")

    def calibrate(self) -> None:
        """Press what the page asks until it knows every control."""
        self.pad.connect()
        asked = self.page.get_by_test_id("calibration")
        self.pad.tap(9)
        for _ in range(40):
            if not asked.count():
                return
            step = asked.get_attribute("data-step")
            if step == "done" or step is None:
                return
            if step in ("wake", "rest"):
                self.pad.tap(9) if step == "wake" else self.pad.frames(3)
                continue
            if step == "view":
                self.page.get_by_test_id("calibration-skip").click()
            else:
                self._push_for(step)
        raise AssertionError(f"the calibration did not end; it asks for {step!r}")

    def _push_for(self, step: str) -> None:
        axes = {"forward": (1, -1.0), "back": (1, 1.0), "left": (0, -1.0), "right": (0, 1.0)}
        buttons = {"up": 5, "down": 4, "close": 0, "open": 1}
        if step in axes:
            axis, value = axes[step]
            self.pad.axis(axis, value)
            self.pad.frames(4)
            self.pad.axis(axis, 0.0)
        else:
            self.pad.tap(buttons[step], frames=4)
        # Let go, and look what is asked next; a pad that was taken for another control is pushed once more.
        with contextlib.suppress(PlaywrightTimeout):
            self.page.wait_for_function(ASKED_NEXT, arg=step, timeout=LEARNS_MS)

    def instructions(self, right: dict[str, str]) -> None:
        """Answer the comprehension check; `right` is question id to option id."""
        self.at("instructions")
        self._shot("instructions")
        for question, option in right.items():
            self.page.get_by_test_id(f"question-{question}").locator(f"input[value='{option}']").check()
        self.click("instructions-submit")

    def survey(self) -> None:
        """Answer every item."""
        self.at("survey")
        self._shot("survey")
        for item in self.page.get_by_test_id("page-survey").locator("fieldset").all():
            if item.get_by_role("radio").count():
                item.get_by_role("radio").nth(4).press("Space")
        self.click("survey-submit")

    # ---- driving ------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Press Start when the robot is ready."""
        self.click("start-button")

    def seen(self, kind: str) -> Any:
        """The newest message of a kind."""
        return self.page.evaluate("(kind) => window.__seen.last[kind] ?? null", kind)

    def next_tick(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Wait for a committed tick that was not returned yet; returns the newest (world, tick)."""
        self.page.wait_for_function(
            "(count) => (window.__seen.counts.tick ?? 0) > count", arg=self._ticks, timeout=STEP_TIMEOUT_MS
        )
        self._ticks, world, tick = self.page.evaluate(
            "() => [window.__seen.counts.tick, window.__seen.last.world, window.__seen.last.tick]"
        )
        # A person reacts later than this. It is also past the deadline of the tick that follows, so that what is done
        # now counts exactly one tick later, however busy the machine is.
        self.page.wait_for_timeout(REACTION_MS)
        return world, tick

    def drive(self, pilot: Pilot, until: Callable[[dict[str, Any], dict[str, Any]], bool], limit: int = 400) -> None:
        """Drive with the pilot until a tick fulfils `until`. Readings that appear are logged on the way."""
        for _ in range(limit):
            world, tick = self.next_tick()
            if until(world, tick):
                self.hold(NOTHING)
                return
            if self.answer_alert():
                continue
            act = UserInput()
            task = tick["instruction"]
            if tick["status"] == "running" and task["object"] in world["objects_m"]:
                act = pilot.act(task["object"], self._world_in_numbers(world, task))
                if tick["blocked"] and world["held"]:
                    act = UserInput((1, 0, 0))  # too close before the robot: out first
            wanted = act.direction or NOTHING
            at_rest = self._held == self._held_before == NOTHING
            if wanted != self._held and not at_rest:
                # A careful person: stop first, look where the arm has come to rest, then go on another way.
                self.hold(NOTHING)
                continue
            self.hold(wanted)
            if act.gripper is not None:
                self.press_gripper(act.gripper)
        raise AssertionError(f"not there after {limit} ticks; last: {world}, {tick}")

    def _world_in_numbers(self, world: dict[str, Any], task: dict[str, Any]) -> Sight:
        """What is seen, carried forward by the tick that runs now with the keys as they are held."""
        release_m = world["bins_m"][task["bin"]] if task["bin"] else None
        if task["kind"] == "pickup":
            release_m = next(iter(world["bins_m"].values()))
        held = world["held"]
        return Sight(self._ahead(world), held, world["gripper"], tuple(world["objects_m"][task["object"]]), release_m)

    def go_to(self, target_m: tuple[float | None, float | None, float | None], limit: int = 60) -> bool:
        """Drive straight to a point; None leaves an axis alone. Readings that appear are logged on the way.

        Gives up after `limit` ticks. Returns False when the trial ended before.
        """
        for _ in range(limit):
            world, tick = self.next_tick()
            if tick["status"] == "finished":
                self.hold(NOTHING)
                return False
            if self.answer_alert() or tick["status"] != "running":
                continue
            here_m = self._ahead(world)
            direction = tuple(
                0 if there is None or abs(there - here) <= 0.6 * self._step_m else (1 if there > here else -1)
                for here, there in zip(here_m, target_m, strict=True)
            )
            if not any(direction) and not any(self._held):
                return True
            self.hold((direction[0], direction[1], direction[2]))
        self.hold(NOTHING)
        return True  # as near as the arm gets

    def wait_for(self, until: Callable[[dict[str, Any], dict[str, Any]], bool], limit: int = 120) -> None:
        """Keep doing what is being done until a tick fulfils `until`; readings are logged."""
        for _ in range(limit):
            world, tick = self.next_tick()
            if until(world, tick):
                self.hold(NOTHING)
                return
            self.answer_alert()
        raise AssertionError(f"not there after {limit} ticks; last: {world}, {tick}")

    def knock_over(self, top_m: float) -> None:
        """Close the gripper and push against the instructed object at height `top_m` above the grasp point."""
        world, tick = self.next_tick()
        x_m, y_m, z_m = world["objects_m"][tick["instruction"]["object"]]
        self.press_gripper("close")
        if not (self.go_to((x_m - 0.14, None, None)) and self.go_to((None, y_m, z_m + top_m))):
            return  # the robot, helping with closed fingers, has done it already
        for _ in range(60):
            _, tick = self.next_tick()
            if tick["done_tasks"] or tick["status"] in ("finished", "resetting"):
                break
            self.hold(NOTHING if self.answer_alert() else (1, 0, 0))
        self.hold(NOTHING)

    def _ahead(self, world: dict[str, Any]) -> tuple[float, float, float]:
        """Where the gripper would come to rest if everything were let go now.

        The tick that runs now still moves with the controls as they are held, and in this study a fifth of each tick
        goes on in the direction of the one before (the planning delay).
        """
        before, now = _unit(self._held_before), _unit(self._held)
        x_m, y_m, z_m = (
            position + self._step_m * (held + PLANNING_DELAY * was)
            for position, held, was in zip(world["position_m"], now, before, strict=True)
        )
        return x_m, y_m, z_m

    def hold(self, direction: Direction) -> None:
        """Hold these directions down and no others."""
        for axis, (before, after) in enumerate(zip(self._held, direction, strict=True)):
            if before != after:
                self._set_axis(axis, before, after)
        self._held_before, self._held = self._held, direction

    def _set_axis(self, axis: int, before: int, after: int) -> None:
        if self.device == "keyboard":
            if before:
                self.page.keyboard.up(KEYS[axis][before])
            if after:
                self.page.keyboard.down(KEYS[axis][after])
        elif axis == 2:
            if before:
                self.pad.release(PAD_Z_BUTTONS[before])
            if after:
                self.pad.press(PAD_Z_BUTTONS[after])
        else:
            number, value = PAD_AXES[axis][after or before]
            self.pad.axis(number, value if after else 0.0)

    def press_gripper(self, what: Literal["open", "close"]) -> None:
        """Press a gripper button once."""
        if self.device == "keyboard":
            self.page.keyboard.press(GRIPPER_KEYS[what])
        else:
            self.pad.tap(PAD_GRIPPER[what])

    def answer_alert(self) -> bool:
        """Whether a reading covers the view: hands off then, and log it if that is still to be done."""
        covering, reading = self.page.evaluate(COVER)
        if covering:
            self.hold(NOTHING)
        if reading is not None and reading != self._logged:
            self._logged = reading
            self._shot("alert")
            # The keys go to whatever has the focus; a person types just as blindly.
            self.page.keyboard.type(re.sub(r"[^0-9.]", "", reading))
            self.page.keyboard.press("Enter")
        return bool(covering)


def _unit(direction: Direction) -> tuple[float, float, float]:
    length = sum(value * value for value in direction) ** 0.5 or 1.0
    return direction[0] / length, direction[1] / length, direction[2] / length
