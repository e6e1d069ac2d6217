"""The pages of remote participants: the open link, the check of the device, the way back to the recruitment service."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from app.simulated.connection import PageAccess, open_wire
from tests.support import lab_server as labs
from tests.support.fake_lab import FakeLab
from tests.support.fake_pad import FakePad
from tests.support.lab_server import LabServer
from tests.support.wire_client import OPEN, SHORT, Player, asked, invite, write_study

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Page

pytestmark = pytest.mark.usefixtures("no_script_errors")

numbers = itertools.count(1)


@pytest.fixture
def fake() -> Iterator[FakeLab]:
    with FakeLab() as running:
        yield running


def visible(page: Page, testid: str) -> None:
    page.get_by_test_id(testid).wait_for(state="visible")


def link_of(lab: LabServer) -> str:
    return f"{lab.base_url}/join?PROLIFIC_PID=b0b0b0b0{next(numbers):04d}&STUDY_ID=64a1"


def state_of(page: Page, check: str) -> str | None:
    return page.get_by_test_id(f"check-{check}").get_attribute("data-state")


# ---- a real lab, behind a proxy with a path


def drive_to(lab: LabServer, context: BrowserContext, page: Page, state: str) -> None:
    """Fill in what comes, over the page's own socket and with its cookie."""
    cookie = next(one for one in context.cookies(page.url) if one["name"] == "salab")
    access = PageAccess(page.url, f"salab={cookie['value']}")

    async def go() -> None:
        async with open_wire(access, "hand") as wire:
            await Player(wire).reach(state)

    with ThreadPoolExecutor(1) as pool:  # a loop of its own: the browser's runs in this thread
        pool.submit(asyncio.run, go()).result(60)


def test_from_the_open_link_to_the_robot_and_a_second_tab_takes_over(
    page: Page, context: BrowserContext, open_lab: LabServer
) -> None:
    link = link_of(open_lab)
    page.goto(link)
    page.get_by_test_id("join-begin").click()
    visible(page, "page-consent")  # the device fits: its check has come and gone by itself
    assert page.url.startswith(f"{open_lab.base_url}/s/") and "PROLIFIC_PID" not in page.url
    second = context.new_page()
    second.goto(link)
    assert second.get_by_test_id("join-begin").inner_text() == "Go on"
    second.get_by_test_id("join-begin").click()
    visible(second, "page-consent")
    visible(page, "page-superseded")
    assert second.url == page.url
    drive_to(open_lab, context, page, "trial_ready")
    page.get_by_test_id("page-superseded").get_by_test_id("take-over").click()
    visible(page, "page-drive")
    page.locator("[data-testid=scene-sign]").wait_for(state="hidden")  # the picture of the robot is there
    frame = page.frame_locator("[data-testid=scene-frame]")
    frame.locator("canvas").first.wait_for()


def test_a_browser_in_which_the_picture_would_stay_empty_does_not_fit(page: Page, open_lab: LabServer) -> None:
    page.add_init_script("""{ const get = HTMLCanvasElement.prototype.getContext;
        HTMLCanvasElement.prototype.getContext = function (kind, ...wishes) {
          return kind === "webgl2" ? null : get.call(this, kind, ...wishes); }; }""")  # WebGL 1 alone is left
    page.goto(link_of(open_lab))
    page.get_by_test_id("join-begin").click()
    visible(page, "check-summary")
    assert (state_of(page, "window"), state_of(page, "webgl")) == ("good", "bad")


def test_a_window_that_is_too_small_is_mended_or_ends_the_study(
    browser: Browser, page: Page, open_lab: LabServer
) -> None:
    page.set_viewport_size({"width": 900, "height": 700})
    page.goto(link_of(open_lab))
    page.get_by_test_id("join-begin").click()
    visible(page, "check-summary")
    assert (state_of(page, "window"), state_of(page, "webgl"), state_of(page, "round_trip")) == ("bad", "good", "good")
    assert "900 pixels wide, and the study needs 1000." in page.get_by_test_id("check-window").inner_text()
    page.get_by_test_id("check-submit").click()  # again, after the connection was measured anew
    page.locator("[data-testid=check-submit]:not([aria-busy])").wait_for()
    assert state_of(page, "round_trip") == "good"
    page.set_viewport_size({"width": 1280, "height": 720})
    page.get_by_test_id("check-submit").click()
    visible(page, "page-consent")

    other = browser.new_context(viewport={"width": 900, "height": 700}).new_page()
    link = link_of(open_lab)
    other.goto(link)
    other.get_by_test_id("join-begin").click()
    other.get_by_test_id("check-leave").click()
    other.get_by_test_id("dialog-confirm").click()
    visible(other, "page-screened_out")
    person = httpx.URL(link).params["PROLIFIC_PID"]
    assert other.get_by_test_id("completion-link").get_attribute("href") == f"http://127.0.0.1:9/out?of={person}"
    other.context.close()


def test_who_comes_too_late_is_told_so_and_led_on(page: Page, open_lab: LabServer) -> None:
    with httpx.Client(
        base_url=open_lab.base_url, headers=open_lab.headers, trust_env=False, timeout=30.0
    ) as experimenter:
        places: dict[str, Any] = experimenter.get("/api/roster").json()["recruitment"]
        made = invite(open_lab, count=places["quota"] - places["held"])["created"]
        try:
            link = link_of(open_lab)
            page.goto(link)
            visible(page, "page-join-full")
            person = httpx.URL(link).params["PROLIFIC_PID"]
            assert page.get_by_test_id("full-link").get_attribute("href") == f"http://127.0.0.1:9/full?of={person}"
            page.goto(open_lab.experimenter_link)
            visible(page, "recruitment")
            assert "30 of 30 places are taken" in page.get_by_test_id("recruitment-places").inner_text()
            assert "/study/join?PROLIFIC_PID={{%PROLIFIC_PID%}}" in page.get_by_test_id("open-link").input_value()
        finally:
            for one in made:
                experimenter.post(f"/api/sessions/{one['participant']}/abort", json={"reason": "the test is over"})
    page.goto(f"{open_lab.base_url}/join?STUDY_ID=64a1")
    visible(page, "page-join-bad_link")
    assert "PROLIFIC_PID is missing in the link." in page.get_by_test_id("page-join-bad_link").inner_text()


def test_who_comes_when_there_is_no_room_waits_on_a_page_that_asks_again(
    page: Page, context: BrowserContext, tmp_path: Path
) -> None:
    study = write_study(tmp_path, {**SHORT, **OPEN})
    arguments = ("--robot", "kinematic", "--study", str(study), "--no-scene", "--capacity", "1")
    with labs.start(tmp_path / "data", *arguments) as lab:
        first = context.new_page()
        first.goto(link_of(lab))
        first.get_by_test_id("join-begin").click()
        visible(first, "page-consent")
        page.clock.install()
        link = link_of(lab)
        shown = page.goto(link)
        assert shown is not None and shown.status == 503
        visible(page, "page-join-busy")
        assert page.get_by_test_id("join-begin").count() == 0
        assert "come back later with the same link" in page.get_by_test_id("page-join-busy").inner_text()
        dashboard = context.new_page()
        dashboard.goto(lab.experimenter_link)
        notice = dashboard.get_by_test_id("lab-crowding")
        notice.wait_for()
        assert "1 person takes part now, as many as the lab takes at once" in notice.inner_text()
        assert notice.get_attribute("data-level") == "full"
        page.clock.run_for(31_000)
        visible(page, "page-join-busy")
        participant = asked(lab, "GET", "sessions").json()[0]["participant"]
        asked(lab, "POST", f"sessions/{participant}/abort", {"reason": "the test goes on"})
        notice.wait_for(state="hidden")
        page.clock.run_for(31_000)
        visible(page, "join-begin")
        page.get_by_test_id("join-begin").click()
        page.wait_for_url(f"{lab.base_url}/s/**")


# ---- a lab that only speaks the wire


def test_a_gamepad_is_pressed_and_tones_are_counted(page: Page, fake: FakeLab) -> None:
    pad = FakePad(page)
    fake.state = "eligibility"
    sound = {"code": "invalid", "field": "sound", "message": "That was not the number of tones."}
    fake.refuses["eligibility"] = [sound]
    page.goto(fake.participant_url)
    visible(page, "page-eligibility")
    page.get_by_test_id("check-submit").click()
    for left in (1, 0):
        assert not [message for message in fake.received if message["type"] == "submit"]  # not before it is measured
        fake.send({"type": "ping", "n": 7 - left, "left": left})
    pad.connect()
    first = fake.wait_submit("eligibility")
    assert first["data"] == {"is_secure": True, "pad_id": None, "tones": None, "tone_try": 0}
    visible(page, "check-summary")
    assert (state_of(page, "sound"), state_of(page, "round_trip")) == ("bad", "good")
    assert page.get_by_test_id("toast-problem").count() == 0
    pad.tap(0)
    page.locator("[data-testid=check-gamepad][data-state=good]").get_by_text("is connected").wait_for()
    page.get_by_test_id("tones-play").click()
    page.wait_for_function("() => salab.sound.ready && salab.sound._playing.size === 2")  # the second try has two
    page.get_by_test_id("check-sound").get_by_label("2", exact=True).check()
    mark = fake.mark()
    fake.send({"type": "ping", "n": 8, "left": 0})
    page.get_by_test_id("check-submit").click()
    data = fake.wait_submit("eligibility", after=mark)["data"]
    assert (data["tones"], data["tone_try"]) == (2, 1)
    assert "STANDARD GAMEPAD" in data["pad_id"]
    visible(page, "page-consent")


def test_the_way_back_opens_only_when_the_lab_holds_everything(page: Page, fake: FakeLab) -> None:
    page.clock.install()
    page.route("https://example.org/**", lambda route: route.fulfill(body="thanks"))
    fake.state = "debrief"
    page.goto(fake.participant_url)
    visible(page, "page-debrief")
    fake.acknowledges = False  # a disk that takes its time
    page.evaluate("() => salab.socket.note('message_dismissed')")
    fake.wait_for(lambda message: message.get("name") == "message_dismissed")
    fake.show("done")
    visible(page, "still-saving")
    page.clock.run_for(20_000)
    assert page.get_by_test_id("completion-link").count() == 0
    assert page.url == fake.participant_url
    fake.acknowledges = True
    fake.acknowledge_all()
    visible(page, "completion-link")
    assert page.get_by_test_id("still-saving").count() == 0
    page.get_by_test_id("forward-stay").click()
    page.clock.run_for(20_000)
    assert page.url == fake.participant_url
    page.reload()
    visible(page, "forward-words")
    page.clock.run_for(9_000)
    assert page.url == fake.participant_url
    page.clock.run_for(2_000)
    page.wait_for_url("https://example.org/done")
