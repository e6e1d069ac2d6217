"""Readings: they take the view and the hands, are heard, answered, and go."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import alert
from tests.support.participant_page import LOUDEST, driving, visible

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def test_a_reading_covers_the_view_takes_the_hands_and_typing_never_drives(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    page.keyboard.down("KeyW")
    lab.wait_for(lambda message: message.get("direction") == [1, 0, 0])
    mark = lab.mark()
    lab.send(alert(1, "582.4"))
    visible(page, "alert")
    lab.wait_for(lambda message: message["type"] == "input" and message["direction"] is None, after=mark)
    assert lab.wait_submit("alert_shown")["data"] == {"alert": 1}
    page.keyboard.up("KeyW")
    covered = lab.mark()
    cover, view = page.get_by_test_id("alert").bounding_box(), page.get_by_test_id("scene").bounding_box()
    assert cover and view
    assert cover["x"] <= view["x"] and cover["y"] <= view["y"]
    assert cover["x"] + cover["width"] >= view["x"] + view["width"]
    assert cover["y"] + cover["height"] >= view["y"] + view["height"]
    page.keyboard.type("wasd 5")
    page.get_by_test_id("alert-input").fill("582.4")
    page.keyboard.press("Enter")
    assert lab.wait_submit("alert_answer")["data"] == {"alert": 1, "value": "582.4"}
    lab.send({"type": "alert_closed", "alert": 1, "status": "answered", "release_in_s": 0.5})
    page.get_by_text("The controls come back", exact=False).wait_for()
    page.get_by_test_id("alert").wait_for(state="hidden")
    assert lab.inputs(after=covered) == []
    page.keyboard.down("KeyD")
    lab.wait_for(lambda message: message.get("direction") == [0, -1, 0], after=covered)


def test_the_alarm_is_heard_where_the_browser_lets_it_and_reported_only_then(page: Page, panel_lab: FakeLab) -> None:
    page.goto(panel_lab.panel_url)
    page.get_by_test_id("panel-start").click()
    visible(page, "panel-waiting")
    page.wait_for_function(LOUDEST.replace("OF", "< 1e-4"))
    panel_lab.send(alert(2, "77.1"), "panel")
    page.wait_for_function(LOUDEST.replace("OF", "> 0.05"))
    assert panel_lab.wait_submit("alert_heard")["data"] == {"alert": 2}
    page.keyboard.type("77.1")
    page.keyboard.press("Enter")
    answer = panel_lab.wait_submit("alert_answer")
    assert (answer["role"], answer["data"]) == ("panel", {"alert": 2, "value": "77.1"})
    panel_lab.send({"type": "alert_closed", "alert": 2, "status": "answered", "release_in_s": 0.0}, "panel")
    visible(page, "panel-waiting")
    assert page.get_by_test_id("panel-last").inner_text() == "Reading saved."
    assert not [message for message in panel_lab.received if message["type"] in ("heartbeat", "input")]


def test_a_pause_hides_the_reading_and_leaves_going_on_in_reach(page: Page, lab: FakeLab) -> None:
    lab.state = "paused"
    page.goto(lab.participant_url)  # as after a reload in mid-trial
    visible(page, "resume-button")
    lab.send(alert(4, "33.3", elapsed_s=6.0))
    lab.send({"type": "ping", "n": 1})
    lab.wait_for(lambda message: message["type"] == "pong")
    assert page.get_by_test_id("alert").is_hidden()
    assert not [message for message in lab.received if message.get("step") == "alert_shown"]
    page.get_by_test_id("resume-button").click()
    visible(page, "alert")
    assert lab.wait_submit("alert_shown")["data"] == {"alert": 4}
    assert page.get_by_test_id("alert-countdown").inner_text() == "14 s left", "time stood still meanwhile"


def test_an_unanswered_reading_goes_away_when_the_lab_says_so(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    lab.send(alert(3, "10.0", elapsed_s=19.0))
    visible(page, "alert")
    assert page.get_by_test_id("alert-countdown").inner_text() in ("1 s left", "0 s left")
    page.keyboard.press("Enter")
    page.get_by_text("Type the number shown above first.").wait_for()
    lab.send({"type": "alert_closed", "alert": 3, "status": "expired", "release_in_s": 0.0})
    page.get_by_test_id("alert").wait_for(state="hidden")
    assert "Time ran out" in page.get_by_test_id("notice").inner_text()
    assert not [message for message in lab.received if message.get("step") == "alert_answer"]


def test_what_became_of_one_reading_is_not_said_of_the_next(page: Page, panel_lab: FakeLab) -> None:
    panel_lab.state = "trial"
    page.goto(panel_lab.panel_url)
    page.get_by_test_id("panel-start").click()
    visible(page, "panel-waiting")
    panel_lab.send(alert(5, "10.0", elapsed_s=19.0), "panel")
    visible(page, "alert")
    panel_lab.send({"type": "alert_closed", "alert": 5, "status": "expired", "release_in_s": 0.0}, "panel")
    visible(page, "panel-waiting")
    assert page.get_by_test_id("panel-last").inner_text() == "Time ran out for the last reading."
    panel_lab.send(alert(6, "20.0"), "panel")
    visible(page, "alert")
    panel_lab.show("survey")  # the study went on without it
    visible(page, "panel-waiting")
    assert page.get_by_test_id("panel-last").inner_text() == ""


def test_a_reading_that_is_no_number_stays_in_its_field_and_time_goes_on(page: Page, panel_lab: FakeLab) -> None:
    page.goto(panel_lab.panel_url)
    visible(page, "panel-locked")
    page.locator("[data-testid=connection][data-state=open]").wait_for()
    panel_lab.send(alert(1, elapsed_s=3.0), "panel")
    field = page.get_by_test_id("alert-input")
    field.wait_for()
    assert field.get_attribute("inputmode") == "decimal"
    for typed in ("58a.4", "582.4.", "5-8"):
        field.fill(typed)
        page.get_by_test_id("alert-submit").click()
        page.get_by_text(f"“{typed}” is not a number. Type the number shown above.").wait_for()
        assert field.input_value() == typed
        assert field.evaluate("(element) => element === document.activeElement")
    assert not panel_lab.submits("alert_answer")
    page.get_by_test_id("alert-countdown").get_by_text(re.compile("^1[0-6] s left")).wait_for()
    field.fill("\u200e ５８２，４0 ")
    page.get_by_test_id("alert-submit").click()
    assert panel_lab.wait_submit("alert_answer")["data"] == {"alert": 1, "value": "\u200e ５８２，４0 "}
