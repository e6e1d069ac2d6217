"""A browser that draws no robot, or stops to: nobody drives by an empty picture, and everybody is told what to do."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect

from tests.conftest import CHROMIUM_ARGUMENTS
from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import CONTENT, tick
from tests.support.lab_server import LabServer
from tests.support.participant_page import LOSE_CONTEXT, left_at, opened, visible
from tests.support.wire_client import asked, events, invite, seen_by_experimenter

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Frame, Page

WITHIN_MS = 60_000


def says(page: Page, data: str) -> None:
    """The scene's frame says something, as `app.web.scene_proxy` makes it."""
    page.frames[1].evaluate(f"parent.postMessage({data}, location.origin)")


def pictures(lab: FakeLab, mark: int = 0) -> list[dict[str, object]]:
    return [m["data"] for m in lab.received[mark:] if m["type"] == "submit" and m["step"] == "picture"]


def told(lab: FakeLab, there: bool, mark: int = 0) -> dict[str, object]:
    message = lab.wait_for(
        lambda m: m["type"] == "submit" and m["step"] == "picture" and m["data"]["there"] is there, after=mark
    )
    data: dict[str, object] = message["data"]
    return data


# --- the page alone ------------------------------------------------------------------------------------------------


def test_the_lab_is_told_of_a_picture_that_goes_and_comes_and_nothing_twice(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "trial_ready")
    told(lab, there=True)
    lab.show("trial")
    lab.send(tick(0))
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()
    mark = lab.mark()
    says(page, "{type: 'picture', drawn: false, why: 'context_lost'}")
    assert told(lab, there=False, mark=mark) == {"there": False, "why": "context_lost"}
    page.locator("[data-testid=scene-sign][data-kind=context_lost]").wait_for()
    # It is loaded again by itself, and the frame connects.
    told(lab, there=True, mark=mark)
    page.get_by_test_id("scene-sign").wait_for(state="hidden")
    lab.send(tick(1))
    assert len(pictures(lab)) == 3


def test_a_connection_of_the_picture_that_comes_back_soon_is_not_missed(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "trial_ready")
    told(lab, there=True)
    lab.show("trial")
    says(page, "{type: 'scene', connected: false}")
    page.locator("[data-testid=scene-sign][data-kind=stale]").wait_for()
    says(page, "{type: 'scene', connected: true}")
    page.get_by_test_id("scene-sign").wait_for(state="hidden")
    mark = lab.mark()
    says(page, "{type: 'scene', connected: false}")
    assert told(lab, there=False, mark=mark)["why"] == "connection"
    assert len(pictures(lab)) == 2


def test_nobody_starts_or_goes_on_before_the_picture_is_there(page: Page, lab: FakeLab) -> None:
    page.clock.install()
    page.context.route("**/s/test/scene/", lambda route: route.abort())
    lab.state = "trial_ready"
    page.goto(lab.participant_url)
    visible(page, "page-trial_ready")
    assert page.get_by_test_id("start-button").is_disabled()
    assert "Loading the picture" in page.get_by_test_id("state-sign").inner_text()
    assert pictures(lab) == []
    page.clock.fast_forward(16_000)
    assert told(lab, there=False) == {"there": False, "why": "not_loaded"}
    assert "does not load" in page.get_by_test_id("scene-sign").inner_text()
    lab.show("paused")
    visible(page, "page-paused")
    assert page.get_by_test_id("resume-button").is_disabled()
    # The experimenter lets it run all the same: the page says once more that nobody sees anything.
    mark = lab.mark()
    lab.show("trial")
    assert told(lab, there=False, mark=mark) == {"there": False, "why": "not_loaded"}
    page.context.unroute("**/s/test/scene/")
    page.clock.fast_forward(16_000)
    told(lab, there=True, mark=mark)
    lab.show("trial_ready")
    expect(page.get_by_test_id("start-button")).to_be_enabled()
    assert "Press Start" in page.get_by_test_id("state-sign").inner_text()


def test_a_pause_for_the_picture_says_what_may_help(page: Page, lab: FakeLab) -> None:
    lab.content["paused"] = {**CONTENT["paused"], "causes": ["picture"], "can_resume": False, "text": "No picture."}
    page.context.route("**/s/test/scene/", lambda route: route.abort())
    opened(page, lab, "paused")
    card = page.get_by_test_id("page-paused")
    assert "hardware acceleration" in card.inner_text()
    assert "Waiting for the picture" in card.inner_text()
    page.context.unroute("**/s/test/scene/")
    page.get_by_test_id("picture-load").click()
    told(lab, there=True)


def test_a_study_without_a_scene_misses_no_picture(page: Page, lab: FakeLab) -> None:
    lab.content["trial_ready"] = {**CONTENT["trial_ready"], "scene": ""}
    opened(page, lab, "trial_ready")
    expect(page.get_by_test_id("start-button")).to_be_enabled()
    assert page.get_by_test_id("scene-sign").is_hidden()


def test_a_tab_that_comes_into_a_running_trial_does_not_drive_before_it_sees(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "trial")
    assert told(lab, there=False)["why"] == "not_loaded"
    told(lab, there=True)


# --- a lab and a browser --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def flat_browser(browser: Browser, chromium_path: Path) -> Iterator[Browser]:
    """One that draws nothing in 3-D."""
    arguments = [*(item for item in CHROMIUM_ARGUMENTS if "swiftshader" not in item), "--disable-3d-apis"]
    started = browser.browser_type.launch(executable_path=chromium_path, args=arguments)
    yield started
    started.close()


def test_whoever_could_not_see_the_robot_is_told_before_they_agree(
    flat_browser: Browser, drawing_lab: LabServer
) -> None:
    made = invite(drawing_lab)
    page = flat_browser.new_page()
    page.goto(made["link"])
    visible(page, "page-consent")
    warning = page.get_by_test_id("no-picture")
    assert "hardware acceleration" in warning.inner_text()
    page.get_by_test_id("consent-box").check()
    page.get_by_test_id("consent-agree").click()
    expect(warning).to_be_focused()
    page.get_by_test_id("picture-again").click()
    assert warning.is_visible()
    assert seen_by_experimenter(drawing_lab, made["participant"])["state"] == "consent"
    assert events(drawing_lab, made["participant"], "step_picture") == [
        ("step_picture", {"there": False, "why": "no_webgl"})
    ]
    page.close()


def test_a_trial_does_not_run_in_a_browser_that_draws_nothing(flat_browser: Browser, drawing_lab: LabServer) -> None:
    made = invite(drawing_lab)
    left_at(made["link"], "trial")
    page = flat_browser.new_page()
    page.goto(made["link"])
    page.locator("[data-testid=scene-sign][data-kind=no_webgl]").wait_for(timeout=WITHIN_MS)
    assert page.get_by_test_id("resume-button").is_disabled()
    page.close()


def test_a_lost_context_pauses_the_trial_until_the_picture_is_back(page: Page, drawing_lab: LabServer) -> None:
    made = invite(drawing_lab)
    participant = made["participant"]
    left_at(made["link"], "trial")
    page.goto(made["link"])
    go_on = page.get_by_test_id("resume-button")
    expect(go_on).to_be_enabled(timeout=WITHIN_MS)
    go_on.click()
    page.locator("[data-testid=state-sign][data-state=running]").wait_for(timeout=WITHIN_MS)
    scene: Frame = next(frame for frame in page.frames if frame.url.split("?")[0].endswith("/scene/"))
    scene.evaluate(LOSE_CONTEXT)
    page.get_by_text("Waiting for the picture").wait_for(timeout=WITHIN_MS)
    line = seen_by_experimenter(drawing_lab, participant)
    assert (line["state"], line["causes"]) == ("paused", ["picture"])
    refused = asked(drawing_lab, "POST", f"sessions/{participant}/resume", {})
    assert refused.status_code == 409 and "The picture of the robot is missing" in refused.text
    # Nobody presses anything: the frame is loaded again, and the trial goes on.
    page.locator("[data-testid=state-sign][data-state=running]").wait_for(timeout=WITHIN_MS)
    page.get_by_test_id("page-paused").wait_for(state="detached")
    told_events = [data["event"] for _, data in events(drawing_lab, participant, "state")]
    assert told_events[-2:] == ["picture_lost", "picture_back"]
    assert seen_by_experimenter(drawing_lab, participant)["state"] == "trial"
