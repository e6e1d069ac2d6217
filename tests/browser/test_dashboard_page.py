"""The dashboard against a lab that only speaks its API: the token is hidden, commands are asked for and sent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import session_row
from tests.support.participant_page import visible

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def test_dashboard_signs_in_from_the_link_and_hides_the_token(page: Page, lab: FakeLab) -> None:
    lab.sessions = [session_row("p001", "trial", label="R 17"), session_row("p002", "done")]
    page.goto(f"{lab.base_url}/dashboard#token=wrong")
    visible(page, "login-error")
    page.get_by_test_id("token-input").fill("right-token")
    page.get_by_test_id("login-button").click()
    visible(page, "sessions")
    page.goto(f"{lab.base_url}/#")
    page.goto(f"{lab.base_url}/dashboard#token=right-token")
    visible(page, "sessions")
    assert "token" not in page.url
    row = page.locator("[data-testid=session-row][data-participant=p001]")
    assert "In a trial" in row.inner_text() and "R 17" in row.inner_text()
    assert page.get_by_test_id("last-updated").inner_text().startswith("Updated")


def test_dashboard_says_that_a_lab_which_does_not_answer_was_last_heard_a_while_ago(page: Page, lab: FakeLab) -> None:
    lab.sessions = [session_row("p001", "trial")]
    page.clock.install()
    page.goto(f"{lab.base_url}/dashboard#token=right-token")
    visible(page, "sessions")
    updated = page.get_by_test_id("last-updated")
    assert updated.inner_text().startswith("Updated")
    page.route("**/api/sessions", lambda route: None)  # the question is asked, and nothing comes
    page.clock.run_for(6_000)
    page.get_by_text("Not up to date: last heard from the lab at").wait_for()
    assert "stale" in (updated.get_attribute("class") or "")


def test_dashboard_creates_links_and_acts_on_sessions(page: Page, lab: FakeLab) -> None:
    lab.sessions = [session_row("p001", "trial"), session_row("p003", "done")]
    page.goto(f"{lab.base_url}/dashboard#token=right-token")
    visible(page, "sessions")
    page.get_by_test_id("create-count").fill("2")
    page.get_by_test_id("create-demo").click()
    page.get_by_test_id("new-link").nth(1).wait_for()
    assert lab.commands[0] == ("create", {"demo": True, "count": 2})
    assert "/p/secret" in page.get_by_test_id("participant-link").first.input_value()
    row = page.locator("[data-participant=p001]")
    row.get_by_test_id("abort").click()
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_text("Give a reason.").wait_for()
    page.get_by_test_id("abort-dialog").get_by_role("textbox").fill("fire alarm")
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_text("p001: the session is aborted.").wait_for()
    assert lab.commands[1] == ("p001 abort", {"reason": "fire alarm"})
    over = page.locator("[data-participant=p003]").get_by_test_id("pause")
    assert over.get_attribute("aria-disabled") == "true"
    assert over.get_attribute("title") == "The session is over."
    with page.expect_download() as download:
        page.get_by_test_id("download-export").click()
    assert download.value.suggested_filename == "export.zip"
