"""The page of practice and rounds: what to do, what is happening, and how to go on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import CONTENT, instruction, tick
from tests.support.participant_page import driving

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def test_the_card_draws_things_of_a_layout_of_ones_own(page: Page, lab: FakeLab) -> None:
    driving(page, lab)

    def look(**looks: Any) -> None:
        lab.send(tick(1, instruction=instruction("pickup", "wipes_tub")))  # so that it draws anew
        page.get_by_text("Pick up the tub of wipes.").wait_for()
        dropoff = instruction("dropoff", "spray_bottle", "left_bin")
        content = {**CONTENT["trial"], "looks": looks, "instruction": dropoff}
        lab.send({"type": "page", "state": "trial", "trial": 1, "trials": 3, "content": content})
        page.get_by_text("Drop the spray bottle into the left bin.").wait_for()

    def colours(thing: str) -> list[str]:
        found: list[str] = page.locator(f"[data-drawing={thing}] [fill]").evaluate_all(
            "(all) => all.map((one) => one.getAttribute('fill'))"
        )
        return found

    carton = {"shape": "box", "color": "#123456", "size_m": [0.05, 0.06, 0.2], "drawing": ""}
    look(spray_bottle=carton, left_bin={"shape": "bin", "color": "#fedcba", "letter": "Q"})
    assert colours("spray_bottle") == ["#123456", "#f6f6f2"]
    assert colours("left_bin")[0] == "#fedcba"
    assert page.locator("[data-drawing=left_bin] text").text_content() == "Q"
    look(spray_bottle={**carton, "shape": "cylinder", "color": "#fafafa"})
    assert colours("spray_bottle") == ["#fafafa", "#2c323a", "#fafafa"], "a dark band on what is nearly white"
    look(spray_bottle={**carton, "outline": "M0 0H100v100H0z"})
    assert colours("spray_bottle") == ["#123456"]
    shape = page.locator("[data-drawing=spray_bottle] path")
    assert shape.get_attribute("d") == "M0 0H100v100H0z"
    look(spray_bottle={**carton, "drawing": "sponge_pack"})
    assert "#cc79a7" in colours("spray_bottle")
    look(left_bin={"shape": "bin", "color": "#fedcba", "letter": ""})
    assert "#56b4e9" in colours("spray_bottle"), "without a look, as it ships"


def test_the_drive_page_tells_what_to_do_and_what_is_happening(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    assert page.get_by_test_id("instruction").inner_text() == "Pick up the spray bottle."
    assert page.locator("[data-drawing=spray_bottle]").is_visible()
    assert page.get_by_test_id("progress").inner_text() == "Task 1 of 6 · Round 1 of 3"
    assert page.get_by_test_id("assisting").is_hidden()
    lab.send(tick(1, blocked=True, assisting=True))
    page.get_by_text("Cannot move further that way. Go another way.").wait_for()
    for cause, ways, words in (
        ("touches_closed", ["back", "open"], "The closed gripper touches something. Go back. Open the gripper."),
        ("low", ["up"], "The gripper is as low as it goes. Go up."),
        ("touches_holding", ["up"], "The gripper, or what it holds, touches something. Go up."),
        ("limit", [], "The arm reaches no further that way."),
    ):
        lab.send(tick(1, blocked=True, assisting=True, hint={"cause": cause, "ways": ways}))
        page.get_by_test_id("drive-hint").get_by_text(words, exact=True).wait_for()
    assert page.get_by_test_id("assisting").inner_text() == "The robot is assisting"
    for status, words in (("resetting", "Resetting"), ("gripper", "Gripper moving"), ("finished", "Finished")):
        lab.send(tick(2, status=status))
        page.get_by_test_id("state-sign").get_by_text(words, exact=True).wait_for()
    for status, words in (("held", "On hold"), ("recovering", "Recovering")):
        lab.send({"type": "status", "status": status})
        page.get_by_test_id("state-sign").get_by_text(words, exact=True).wait_for()
    page.get_by_test_id("view-side").click()
    assert lab.wait_for(lambda message: message["type"] == "view")["name"] == "side"
    mark = lab.mark()
    page.reload()
    assert lab.wait_for(lambda message: message["type"] == "view", after=mark)["name"] == "side", "kept over a reload"
    assert page.get_by_test_id("view-side").get_attribute("aria-pressed") == "true"


def test_paused_page_goes_on_when_the_participant_says_so(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    lab.show("paused")
    page.get_by_test_id("resume-button").click()
    lab.wait_submit("resume")
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()


UNSAVED = "The lab cannot save at the moment. Nothing is lost. Please wait: it goes on by itself."


def test_a_lab_that_cannot_save_is_told_on_every_page_until_it_can(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    lab.send({"type": "saves", "works": False, "text": UNSAVED})
    lab.send({"type": "status", "status": "held", "reason": UNSAVED})
    notice = page.get_by_role("alert").filter(has_text=UNSAVED)
    notice.wait_for()
    sign = page.locator("[data-testid=state-sign][data-state=unsaved]")
    sign.wait_for()
    assert "The robot stands still" in sign.inner_text()
    lab.show("survey")
    page.get_by_test_id("page-survey").wait_for()
    assert notice.is_visible()
    lab.show("trial")
    lab.send({"type": "saves", "works": True, "text": None})
    lab.send({"type": "status", "status": "running", "reason": None})
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()
    assert page.get_by_test_id("unsaved").is_hidden()
