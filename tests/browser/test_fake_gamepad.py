"""The fake gamepad behaves as Chromium's own does, seen from a page: what the page's tests then rest on."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import Error, Page

from tests.support.fake_pad import PS3_RAW_CROSS, PS3_RAW_ID, STANDARD_BOTTOM, STANDARD_ID, FakePad

# The page's own script: what it heard, as a participant's page would listen.
PAGE = """<!doctype html><title>pad</title><script type="module">
window.heard = [];
const note = (event) => heard.push({
  type: event.type, real: event instanceof GamepadEvent, pad: event.gamepad instanceof Gamepad,
  id: event.gamepad.id, index: event.gamepad.index, connected: event.gamepad.connected,
  inList: navigator.getGamepads()[event.gamepad.index] === event.gamepad,
});
addEventListener("gamepadconnected", note);
addEventListener("gamepaddisconnected", note);
</script>"""


@pytest.fixture
def open_page(page: Page) -> Callable[[], Page]:
    page.route("**/*", lambda route: route.fulfill(body=PAGE, content_type="text/html"))

    def open_it() -> Page:
        page.goto("http://127.0.0.1:9/")  # never asked: the route answers
        return page

    return open_it


@pytest.fixture
def pad(page: Page, open_page: Callable[[], Page]) -> FakePad:
    fake = FakePad(page)
    open_page()
    return fake


def test_without_a_press_it_looks_like_the_real_thing(page: Page, open_page: Callable[[], Page]) -> None:
    empty = "JSON.stringify(navigator.getGamepads())"
    real = open_page().evaluate(empty)
    fake = FakePad(page)
    open_page()
    assert page.evaluate(empty) == real
    fake.connect()
    fake.axis(0, 1.0)  # a bumped stick is not a press
    assert page.evaluate(empty) == real
    assert page.evaluate("heard") == []
    assert fake.state() == {"plugged": True, "exposed": False, "activated": False}


def test_the_first_press_exposes_it_and_says_so_once(page: Page, pad: FakePad) -> None:
    pad.connect(PS3_RAW_ID, "", index=1, axes=6, buttons=17)
    pad.axis(5, -0.25)
    pad.press(PS3_RAW_CROSS)
    pad.release(PS3_RAW_CROSS)
    pad.press(PS3_RAW_CROSS)
    assert page.evaluate("heard") == [
        {
            "type": "gamepadconnected",
            "real": True,
            "pad": True,
            "id": PS3_RAW_ID,
            "index": 1,
            "connected": True,
            "inList": True,
        }
    ]
    seen = page.evaluate(
        """() => { const list = [...navigator.getGamepads()], pad = list[1]; return {
            others: list.filter((other) => other !== null).length, mapping: pad.mapping, axes: [...pad.axes],
            pressed: pad.buttons.map((button) => button.pressed), real: pad.buttons[0] instanceof GamepadButton,
        } }"""
    )
    assert seen == {
        "others": 1,
        "mapping": "",
        "axes": [0, 0, 0, 0, 0, -0.25],
        "pressed": [index == PS3_RAW_CROSS for index in range(17)],
        "real": True,
    }


def test_a_kept_pad_goes_stale_and_only_changes_move_the_timestamp(page: Page, pad: FakePad) -> None:
    pad.connect()
    pad.press(STANDARD_BOTTOM)
    page.evaluate("window.kept = navigator.getGamepads()[0]")
    assert page.evaluate("navigator.getGamepads()[0] === kept && navigator.getGamepads() !== navigator.getGamepads()")
    pad.press(STANDARD_BOTTOM)  # already down
    assert page.evaluate("navigator.getGamepads()[0].timestamp === kept.timestamp")
    pad.stick(-1.0, 0.5)
    pad.release(STANDARD_BOTTOM)
    fresh, kept = page.evaluate(
        """[navigator.getGamepads()[0], kept].map(
            (pad) => ({axes: [...pad.axes], pressed: pad.buttons[0].pressed, timestamp: pad.timestamp}))"""
    )
    assert (kept["axes"], kept["pressed"]) == ([0, 0, 0, 0], True)
    assert (fresh["axes"], fresh["pressed"]) == ([-1, 0.5, 0, 0], False)
    assert fresh["timestamp"] > kept["timestamp"] > 0


def test_analogue_buttons_have_a_value(page: Page, pad: FakePad) -> None:
    pad.connect()
    pad.press(STANDARD_BOTTOM)
    pad.value(7, 0.25)
    button = "(({pressed, touched, value}) => ({pressed, touched, value}))(navigator.getGamepads()[0].buttons[7])"
    assert page.evaluate(button) == {"pressed": False, "touched": True, "value": 0.25}
    pad.value(7, 0.75)
    assert page.evaluate(button) == {"pressed": True, "touched": True, "value": 0.75}


def test_pulling_the_plug_and_putting_it_back(page: Page, pad: FakePad) -> None:
    pad.connect()
    pad.press(STANDARD_BOTTOM)
    pad.disconnect()
    assert page.evaluate("navigator.getGamepads().every((slot) => slot === null)")
    heard = page.evaluate("heard.map(({type, connected}) => [type, connected])")
    assert heard == [["gamepadconnected", True], ["gamepaddisconnected", False]]
    pad.connect(PS3_RAW_ID, "")  # this document has seen a press: the next pad shows at once
    assert page.evaluate("navigator.getGamepads()[0].id") == PS3_RAW_ID
    assert page.evaluate("heard.length") == 3


def test_a_reload_keeps_it_plugged_in_and_gates_it_anew(page: Page, pad: FakePad) -> None:
    pad.connect()
    pad.press(STANDARD_BOTTOM)
    page.reload()
    assert pad.state() == {"plugged": True, "exposed": False, "activated": False}
    assert page.evaluate("navigator.getGamepads().every((slot) => slot === null)")
    pad.press(STANDARD_BOTTOM)
    assert page.evaluate("navigator.getGamepads()[0].id") == STANDARD_ID
    pad.disconnect()
    page.reload()
    assert not pad.state()["plugged"]


def test_a_tap_is_seen_by_a_page_that_polls_every_frame(page: Page, pad: FakePad) -> None:
    pad.connect()
    page.evaluate(
        """() => { window.polled = []; const poll = () => {
            const pad = navigator.getGamepads()[0];
            if (pad) polled.push(pad.buttons[3].pressed);
            requestAnimationFrame(poll);
        }; poll(); }"""
    )
    pad.tap(3)
    polled = page.evaluate("polled")
    assert True in polled
    assert polled[-1] is False


def test_a_wrong_hand_on_the_pad_is_an_error(page: Page, pad: FakePad) -> None:
    with pytest.raises(Error, match="no pad is plugged in"):
        pad.press(0)
    pad.connect()
    with pytest.raises(Error, match="plugged in already"):
        pad.connect()
    with pytest.raises(Error, match="this pad has button 0 to 16"):
        pad.press(17)
    with pytest.raises(Error, match="this pad has axis 0 to 3"):
        pad.axis(-1, 0)
