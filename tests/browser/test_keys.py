"""Keys: what counts, and where; with a real keyboard, whose keys repeat and whose menus swallow releases."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from tests.conftest import CHROMIUM_ARGUMENTS
from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import alert
from tests.support.participant_page import driving
from tests.support.real_keys import NoDisplay, RealKeys, are_required

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def let_go(lab: FakeLab, after: int) -> None:
    lab.wait_for(lambda message: message["type"] == "input" and message["direction"] is None, after=after)


def closed(number: int) -> dict[str, Any]:
    return {"type": "alert_closed", "alert": number, "status": "answered", "release_in_s": 0.0}


def grips(lab: FakeLab, after: int = 0) -> list[str]:
    return [message["gripper"] for message in lab.inputs(after=after) if message.get("gripper")]


# --- whatever may hide a release lets go ---------------------------------------------------------------------------

LOSSES = {
    "blur": "dispatchEvent(new Event('blur'))",
    "pagehide": "dispatchEvent(new Event('pagehide'))",
    "contextmenu": "document.body.dispatchEvent(new MouseEvent('contextmenu', {bubbles: true}))",
    "dragstart": "document.body.dispatchEvent(new DragEvent('dragstart', {bubbles: true}))",
    "visibilitychange": "document.dispatchEvent(new Event('visibilitychange', {bubbles: true}))",
    "fullscreenchange": "document.body.dispatchEvent(new Event('fullscreenchange', {bubbles: true}))",
    "pointerlockchange": "document.dispatchEvent(new Event('pointerlockchange', {bubbles: true}))",
    "compositionstart": "document.body.dispatchEvent(new CompositionEvent('compositionstart', {bubbles: true}))",
    "beforeprint": "dispatchEvent(new Event('beforeprint'))",
    "a frame takes the focus": """{ const frame = document.createElement("iframe"); frame.srcdoc = "<input>";
        document.body.append(frame); frame.focus(); frame.remove(); }""",
    "a field appears": """{ const field = document.createElement("input"); document.body.append(field);
        field.focus(); field.remove(); document.querySelector(".drive-scene").focus(); }""",
}


def test_whatever_may_hide_a_release_lets_go_and_the_key_counts_when_pressed_anew(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    for name, happens in LOSSES.items():
        mark = lab.mark()
        page.keyboard.down("KeyW")
        lab.wait_for(lambda message: message.get("direction") == [1, 0, 0], after=mark)
        page.evaluate(f"() => {{ {happens} }}")
        let_go(lab, mark)
        after = lab.mark()
        page.keyboard.down("KeyW")  # only the keyboard's repeat
        page.keyboard.up("KeyW")
        page.keyboard.press("KeyD")
        lab.wait_for(lambda message: message.get("direction") == [0, -1, 0], after=after)
        let_go(lab, after)
        moved = [m["direction"] for m in lab.inputs(after=after) if m["direction"]]
        assert moved == [[0, -1, 0]], name


def test_what_was_held_when_the_computer_slept_is_let_go_before_the_lab_hears_of_it(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    page.keyboard.down("KeyW")
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0])
    page.evaluate("() => { const wakes = performance.now() + 1500; while (performance.now() < wakes); }")
    slept = lab.mark()
    let_go(lab, 0)
    lab.wait_for(lambda message: message["type"] == "heartbeat" and message["direction"] is None)
    assert not [message for message in lab.received[slept:] if message.get("direction")]
    page.keyboard.down("KeyW")  # only the keyboard's repeat
    page.keyboard.up("KeyW")
    page.keyboard.down("KeyW")
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0], after=slept)


@pytest.mark.parametrize("key", ["Meta", "Alt", "ContextMenu"])
def test_a_key_that_takes_the_others_lets_go_of_them(page: Page, lab: FakeLab, key: str) -> None:
    driving(page, lab)
    mark = lab.mark()
    page.keyboard.down("KeyW")
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0], after=mark)
    page.keyboard.down(key)
    let_go(lab, mark)
    # On macOS no release is told of what goes up while Meta is down: here KeyW is never told to go up.
    page.keyboard.up(key)
    page.keyboard.press("KeyD")
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 0], after=mark)


# --- a field takes what is typed in it, and nothing else -----------------------------------------------------------


def test_an_enter_that_comes_after_the_field_has_gone_is_no_grip(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    lab.send(alert(1))
    page.get_by_test_id("alert").wait_for()
    page.keyboard.type("582")
    lab.send({**closed(1), "status": "expired"})  # the time is up in the middle of it
    page.get_by_test_id("alert").wait_for(state="hidden")
    for key in ("Digit4", "Enter", "Space"):
        page.keyboard.press(key)
    page.keyboard.press("KeyD")
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 0])
    assert grips(lab) == []
    page.evaluate("() => new Promise((done) => setTimeout(done, 1100))")  # nobody types any more
    page.keyboard.press("Enter")
    lab.wait_for(lambda message: message.get("gripper") == "open")


def test_after_an_enter_that_was_held_for_long_in_a_field_another_is_no_grip_either(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    lab.send(alert(1))
    page.get_by_test_id("alert").wait_for()
    page.keyboard.type("582.4")
    page.keyboard.down("Enter")
    lab.wait_submit("alert_answer")
    lab.send(closed(1))
    page.get_by_test_id("alert").wait_for(state="hidden")
    page.evaluate("() => new Promise((done) => setTimeout(done, 1100))")
    page.keyboard.down("Enter")  # it is down: a repeat
    page.keyboard.up("Enter")
    page.keyboard.press("Enter")  # and once more, as impatient people do
    page.keyboard.press("KeyD")
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 0])
    assert grips(lab) == []


def test_a_key_whose_release_from_a_field_was_never_seen_is_fresh_when_it_is_pressed_anew(
    page: Page, lab: FakeLab
) -> None:
    driving(page, lab)
    lab.send(alert(1))
    page.get_by_test_id("alert").wait_for()
    page.keyboard.type("582.4")
    page.keyboard.down("Enter")
    lab.wait_submit("alert_answer")
    lab.send(closed(1))
    page.get_by_test_id("alert").wait_for(state="hidden")
    page.evaluate(
        "() => addEventListener('keyup', (event) => event.stopImmediatePropagation(), { capture: true, once: true })"
    )
    page.keyboard.up("Enter")  # into another window
    page.evaluate("() => new Promise((done) => setTimeout(done, 1100))")  # nobody types any more
    for _ in range(2):
        page.keyboard.press("Enter")
    page.keyboard.press("KeyD")
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 0])
    assert grips(lab) == ["open", "open"]


def test_the_key_that_presses_a_button_is_no_grip_and_presses_no_other(page: Page, lab: FakeLab) -> None:
    lab.state = "break"
    page.goto(lab.participant_url)
    page.get_by_test_id("continue-button").focus()
    page.keyboard.down("Enter")
    page.get_by_test_id("page-practice_ready").wait_for()
    page.locator("[data-testid=start-button]:focus").wait_for()
    for _ in range(3):
        page.keyboard.down("Enter")  # it repeats on the next page's button
    page.keyboard.up("Enter")
    assert [m["step"] for m in lab.received if m.get("step") in ("continue", "start")] == ["continue"]
    page.keyboard.press("Enter")
    lab.wait_submit("start")
    page.get_by_test_id("page-drive").wait_for()
    assert grips(lab) == []


# --- keys without a place, and what is printed on those that have one ----------------------------------------------

PRESS = """(init) => document.querySelector(".drive-scene").dispatchEvent(
    new KeyboardEvent(init.type, {...init, bubbles: true, cancelable: true}))"""


def test_keys_without_a_place_drive_by_what_they_type_and_nameless_ones_are_told(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    for key, direction in (("w", [1, 0, 0]), ("A", [0, 1, 0]), ("ArrowUp", [1, 0, 0]), ("PageDown", [0, 0, -1])):
        for code in ("", "Unidentified"):
            mark = lab.mark()
            for kind in ("keydown", "keyup"):
                page.evaluate(PRESS, {"type": kind, "key": key, "code": code})
            let_go(lab, mark)
            assert [message["direction"] for message in lab.inputs(after=mark)] == [direction, None]
    page.evaluate(PRESS, {"type": "keydown", "key": "Enter", "code": ""})
    lab.wait_for(lambda message: message.get("gripper") == "open")
    page.evaluate(PRESS, {"type": "keydown", "key": "Unidentified", "code": "", "keyCode": 229})
    page.get_by_test_id("notice").get_by_text("does not tell which key was pressed").wait_for()


def legend(page: Page) -> str:
    return page.locator(".legend").first.inner_text().replace("\n", " ").replace("\t", " ")


def test_the_legend_prints_what_stands_on_this_keyboard_and_drives_by_place(page: Page, lab: FakeLab) -> None:
    page.add_init_script("delete Navigator.prototype.keyboard")
    driving(page, lab)
    assert "WS" in legend(page) and "AD" in legend(page)
    mark = lab.mark()
    for kind in ("keydown", "keyup"):  # the key at the place of W, on a French keyboard
        page.evaluate(PRESS, {"type": kind, "key": "z", "code": "KeyW"})
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0], after=mark)
    page.get_by_text("Z", exact=True).first.wait_for()
    assert "ZS" in legend(page) and "QD" in legend(page), "one key tells the others"
    page.reload()
    page.get_by_test_id("page-drive").wait_for()
    assert "ZS" in legend(page)


def test_a_browser_that_knows_the_layout_is_asked(page: Page, lab: FakeLab) -> None:
    page.add_init_script(
        """Object.defineProperty(Navigator.prototype, "keyboard", {get: () => ({
          getLayoutMap: async () => new Map([["KeyW", "ц"], ["KeyS", "ы"], ["KeyA", "ф"], ["KeyD", "в"]])})})"""
    )
    driving(page, lab)
    page.get_by_text("Ц", exact=True).first.wait_for()
    assert "ЦЫ" in legend(page) and "ФВ" in legend(page)


# --- with a real keyboard ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def keys() -> Iterator[RealKeys]:
    try:
        with RealKeys() as hand:
            yield hand
    except NoDisplay as error:
        if are_required(os.environ):
            pytest.fail(f"real keys are required: {error}", pytrace=False)
        pytest.skip(f"no real keys here: {error}")


@pytest.fixture
def headed(browser: Browser, chromium_path: Path, keys: RealKeys) -> Iterator[Page]:
    """A page in a Chromium with a window, which has the keyboard."""
    arguments = [*CHROMIUM_ARGUMENTS, "--window-position=0,0", "--window-size=1300,850"]
    window = browser.browser_type.launch(
        executable_path=chromium_path, headless=False, args=arguments, env={"DISPLAY": keys.display}
    )
    yield window.new_context(no_viewport=True).new_page()
    window.close()


def test_a_real_key_repeats_into_no_field_and_a_menu_that_swallows_its_release_lets_go(
    headed: Page, keys: RealKeys, lab: FakeLab
) -> None:
    page = headed
    page.add_init_script("window.repeats = 0; addEventListener('keydown', ({repeat}) => { repeats += repeat; }, true);")
    driving(page, lab)
    keys.click(500, 400)  # the window takes the keyboard
    mark = lab.mark()
    keys.down("r")
    lab.wait_for(lambda message: message.get("direction") == [0, 0, 1], after=mark)
    page.wait_for_function("() => repeats > 2")
    lab.send(alert(1, "601.7"))
    page.get_by_test_id("alert").wait_for()
    let_go(lab, mark)
    page.evaluate("repeats = 0")
    page.wait_for_function("() => repeats > 3")  # it goes on over the field
    keys.up("r")
    for key in "601.7":
        keys.press(key)
    page.wait_for_function("() => document.querySelector('[data-testid=alert-input]').value.length >= 5")
    covered = lab.mark()
    keys.down("Return")
    assert lab.wait_submit("alert_answer")["data"] == {"alert": 1, "value": "601.7"}
    page.evaluate("repeats = 0")
    lab.send(closed(1))
    page.get_by_test_id("alert").wait_for(state="hidden")
    page.wait_for_function("() => repeats > 3")
    keys.up("Return")
    keys.press("Return")  # and once more, as impatient people do
    keys.press("d")
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 0], after=covered)
    assert grips(lab, covered) == []
    # A menu takes the release.
    menu = lab.mark()
    keys.down("w")
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0], after=menu)
    keys.click(500, 400, button=3)
    let_go(lab, menu)
    keys.up("w")
    keys.press("Escape")
