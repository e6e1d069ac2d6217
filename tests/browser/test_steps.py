"""What a participant hands in: sent, acknowledged, kept over a lost connection, resent, and taken by one tab."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import CONTENT, tick
from tests.support.participant_page import driving, opened, visible

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def test_consent_needs_the_tick_and_sends_the_hash_of_the_text(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "consent")
    page.get_by_test_id("consent-agree").click()
    assert page.get_by_test_id("page-consent").get_by_role("alert").inner_text().startswith("Tick the box")
    assert not [message for message in lab.received if message["type"] == "submit"]
    page.get_by_test_id("consent-box").check()
    page.get_by_test_id("consent-agree").click()
    assert lab.wait_submit("consent")["data"] == {"accepted": True, "hash": CONTENT["consent"]["hash"]}
    visible(page, "page-demographics")


def test_unacknowledged_submit_survives_a_lost_connection_and_a_reload(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "break")
    lab.acknowledges = False
    page.get_by_test_id("continue-button").click()
    first = lab.wait_submit("continue")
    mark = lab.mark()
    lab.drop()
    again = lab.wait_submit("continue", after=mark)
    assert again["id"] == first["id"]
    mark = lab.mark()
    page.reload()
    lab.acknowledges = True
    third = lab.wait_submit("continue", after=mark)
    assert third["id"] == first["id"]
    visible(page, "page-practice_ready")
    page.wait_for_function("() => Object.keys(localStorage).every((key) => !key.endsWith(':outbox'))")


def test_reconnects_by_itself_and_says_so_meanwhile(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    lab.accepts = False
    lab.drop()
    page.locator("[data-testid=state-sign][data-state=lost]").wait_for()
    assert "Connection lost" in page.get_by_test_id("connection").inner_text()
    mark = lab.mark()
    page.keyboard.down("KeyW")
    page.keyboard.up("KeyW")
    lab.accepts = True
    lab.wait_for(lambda message: message["type"] == "hello", after=mark)
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()
    beat = lab.wait_for(lambda message: message["type"] == "heartbeat", after=mark)
    assert beat["direction"] is None
    assert lab.inputs(after=mark) == [], "what was pressed without a connection is never sent late"


def test_a_second_tab_takes_over_and_the_first_can_take_it_back(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "break")
    second = page.context.new_page()
    second.goto(lab.participant_url)
    visible(second, "page-break")
    visible(page, "page-superseded")
    page.get_by_test_id("take-over").click()
    visible(page, "page-break")
    visible(second, "page-superseded")


def test_typed_refusals_are_shown_and_dismissed(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "break")
    lab.refuses["continue"] = [{"code": "illegal", "field": None, "message": "<b>not now</b>"}]
    page.get_by_test_id("continue-button").click()
    toast = page.get_by_test_id("toast-problem")
    toast.wait_for()
    assert "<b>not now</b>" in toast.inner_text(), "what the lab says is text, never markup"
    toast.get_by_role("button").click()
    toast.wait_for(state="detached")
    assert page.get_by_test_id("continue-button").is_enabled()


def test_pings_are_answered(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "break")
    lab.send({"type": "ping", "n": 41})
    assert lab.wait_for(lambda message: message["type"] == "pong")["n"] == 41


def test_heartbeats_come_from_a_worker_and_carry_the_hands(page: Page, lab: FakeLab) -> None:
    with page.expect_worker(lambda worker: worker.url.endswith("/static/wire/heartbeat_worker.js")):
        driving(page, lab)
    page.keyboard.down("ArrowUp")
    beat = lab.wait_for(lambda message: message["type"] == "heartbeat" and message["direction"] == [1, 0, 0])
    assert beat["visible"] is True


def test_stopping_asks_once_and_ends_with_thanks(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    page.get_by_test_id("stop-button").click()
    page.get_by_test_id("dialog-back").click()
    page.get_by_test_id("stop-button").click()
    page.get_by_test_id("dialog-confirm").click()
    visible(page, "page-withdrawn")
    withdrawals = [message for message in lab.received if message.get("step") == "withdraw"]
    assert [message["data"] for message in withdrawals] == [{"reason": None}]
    assert page.get_by_test_id("stop-button").is_hidden()


def test_once_it_is_over_the_page_reports_what_it_was_told_is_saved(page: Page, lab: FakeLab) -> None:
    driving(page, lab)
    for number in (0, 1, 2):
        lab.send(tick(number))
    page.get_by_test_id("stop-button").click()
    page.get_by_test_id("dialog-confirm").click()
    visible(page, "page-withdrawn")
    report = lab.wait_for(lambda message: message.get("name") == "received")
    (withdrawal,) = [message for message in lab.received if message.get("step") == "withdraw"]
    assert lab.received.index(withdrawal) < lab.received.index(report)
    acknowledged = [one for one in lab.received if one.get("id") and one.get("name") != "received"]
    assert report["data"]["acknowledged"] == len({one["id"] for one in acknowledged})
    assert max(report["data"]["ticks"].values()) >= 3
