"""The second picture of the driving page follows the gripper and holds up nobody; what slips is said and heard."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from sim.view.viewpoints import INSET
from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import CONTENT, tick
from tests.support.lab_server import LabServer
from tests.support.participant_page import LOSE_CONTEXT, LOUDEST, driving, left_at, opened
from tests.support.shipped_world import ARC
from tests.support.wire_client import invite

if TYPE_CHECKING:
    from playwright.sync_api import Frame, Page

WITHIN_MS = 60_000
EYE = "(() => { const eye = window.__viserMutable?.camera; return eye && [eye.near, ...eye.position.toArray()]; })()"


def in_trial(page: Page, lab: LabServer) -> Frame:
    """Somebody drives a trial; gives the inset's frame."""
    link = invite(lab)["link"]
    left_at(link, "trial")
    page.goto(link)
    go_on = page.get_by_test_id("resume-button")
    go_on.click(timeout=WITHIN_MS)
    page.locator("[data-testid=state-sign][data-state=running]").wait_for(timeout=WITHIN_MS)
    inset = page.get_by_test_id("inset-frame").element_handle().content_frame()
    assert inset is not None
    return inset


def test_the_inset_follows_the_gripper_and_its_loss_stops_nothing(page: Page, drawing_lab: LabServer) -> None:
    inset = in_trial(page, drawing_lab)
    # It stands a little above the gripper; up is y in there. Until it is aimed it stands where the overview does.
    start_m = ARC.start_world_m[2] + INSET.eye_from_gripper_m[2]
    inset.wait_for_function(f"{EYE}?.[0] === {INSET.near_m}", timeout=WITHIN_MS)
    inset.wait_for_function(f"Math.abs({EYE}[2] - {start_m}) < 0.01", timeout=WITHIN_MS)
    page.keyboard.down("KeyR")
    inset.wait_for_function(f"Math.abs({EYE}[2] - {start_m} - 0.05) < 0.03", timeout=WITHIN_MS)
    page.keyboard.up("KeyR")
    main = page.get_by_test_id("scene-frame").element_handle().content_frame()
    assert main is not None and main.evaluate(EYE)[0] != pytest.approx(INSET.near_m)
    inset.evaluate(LOSE_CONTEXT)
    page.get_by_test_id("inset-sign").wait_for(timeout=WITHIN_MS)
    assert page.locator("[data-testid=state-sign][data-state=running]").is_visible()
    # It comes back by itself, and still nothing has stopped.
    page.get_by_test_id("inset-sign").wait_for(state="hidden", timeout=WITHIN_MS)
    assert page.locator("[data-testid=state-sign][data-state=running]").is_visible()


def test_a_study_without_the_inset_has_none(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "trial")
    assert page.get_by_test_id("inset").is_hidden()
    lab.content["trial"] = {**CONTENT["trial"], "inset": True}
    lab.show("trial")
    page.get_by_test_id("inset").wait_for()


def test_the_side_panel_fits_beside_the_picture_with_the_inset(page: Page, lab: FakeLab) -> None:
    lab.content["trial"] = {**CONTENT["trial"], "inset": True}
    for width, height in ((1280, 720), (1366, 768), (1920, 1080)):
        page.set_viewport_size({"width": width, "height": height})
        opened(page, lab, "trial")
        lab.send(tick(0, holding=True))
        page.get_by_text("Gripper holding").wait_for()
        hidden_px = page.locator(".side").evaluate("(side) => side.scrollHeight - side.clientHeight")
        assert hidden_px <= 0, f"{hidden_px} px of the side panel are out of sight at {width} x {height}"


def test_what_slips_is_said_and_heard(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    page.keyboard.press("KeyW")
    page.wait_for_function("() => salab.sound.ready")
    page.wait_for_function(LOUDEST.replace("OF", "< 1e-4"))
    lab.send(tick(1, slipped=True, notice="The spray bottle slipped out of the gripper."))
    page.wait_for_function(LOUDEST.replace("OF", "> 0.02"))
    assert "slipped out of the gripper" in page.get_by_test_id("notice").inner_text()
