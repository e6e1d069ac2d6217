"""Every page in every state, looked at by axe-core, which must find nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.browser.test_live_page import WITHIN_MS, driving
from tests.support.accessibility import findings
from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import CONTENT, alert, letter, tick
from tests.support.lab_server import LabServer
from tests.support.wire_client import invite

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.browser


def test_axe_finds_what_is_wrong(page: Page) -> None:
    page.set_content('<html lang="en"><title>x</title><main><h1>x</h1><img src="x"><input></main></html>')
    assert {line.split()[2] for line in findings(page, "page")} == {"image-alt:", "label:"}


def test_the_participants_page_in_every_state(page: Page) -> None:
    with FakeLab() as lab:
        page.goto(lab.participant_url)
        found: list[str] = []
        for state in CONTENT:
            lab.show(state)
            name = "page-drive" if state in ("practice", "trial") else f"page-{state}"
            page.get_by_test_id(name).wait_for()
            found += findings(page, state)
        lab.show("setup")
        page.get_by_test_id("device-gamepad").click()
        found += findings(page, "calibration")
        lab.show("trial")
        page.get_by_test_id("page-drive").wait_for()
        lab.send(tick(0, blocked=True, notice="Well done: the spray bottle is in the bin."))
        page.get_by_text("Cannot move further that way").wait_for()
        lab.send({"type": "notice", "text": "Please wait."})
        page.get_by_text("From the experimenter: Please wait.").wait_for()
        found += findings(page, "trial with notices")
        for button in ("help-button", "stop-button"):
            page.get_by_test_id(button).click()
            found += findings(page, button)
            page.get_by_test_id("dialog-back").click()
        lab.send(alert(1))
        page.get_by_test_id("alert").wait_for()
        found += findings(page, "reading")
        lab.send({"type": "alert_closed", "alert": 1, "status": "answered", "release_in_s": 0.0})
        lab.send(letter(2))
        page.get_by_test_id("alert-choice-same").wait_for()
        found += findings(page, "choices")
        lab.accepts = False
        lab.drop()
        page.locator("[data-testid=state-sign][data-state=lost]").wait_for()
        found += findings(page, "connection lost")
    assert not found, "\n".join(found)


def test_the_second_device(page: Page) -> None:
    with FakeLab(placement="second_device", state="trial") as lab:
        page.goto(lab.panel_url)
        page.get_by_test_id("panel-start").wait_for()
        found = findings(page, "panel before sound")
        page.get_by_test_id("panel-start").click()
        found += findings(page, "panel waiting")
        lab.send(alert(1), "panel")
        page.get_by_test_id("alert-reading").wait_for()
        found += findings(page, "panel reading")
        lab.send(letter(2), "panel")
        page.get_by_test_id("alert-choice-same").wait_for()
        found += findings(page, "panel choices")
    assert not found, "\n".join(found)


def test_the_front_the_open_link_and_a_link_that_opens_nothing(page: Page, quick_lab: LabServer) -> None:
    found: list[str] = []
    for path in ("/", "/p/nothing", "/join"):
        page.goto(quick_lab.base_url + path)
        page.get_by_role("heading", level=1).wait_for()
        found += findings(page, path)
    assert not found, "\n".join(found)


def test_the_dashboard_with_its_dialogs_and_an_opened_session(page: Page, quick_lab: LabServer) -> None:
    made = invite(quick_lab, label="seat 4")
    page.goto(f"{quick_lab.base_url}/dashboard")
    page.get_by_test_id("page-login").wait_for()
    found = findings(page, "login")
    with driving(made["link"], 4):
        page.goto(quick_lab.experimenter_link)
        page.reload()  # the address differed in its fragment alone
        page.get_by_test_id("order-grid").wait_for(timeout=WITHIN_MS)
        page.get_by_test_id("create-participant").click()
        page.get_by_test_id("new-link").wait_for()
        found += findings(page, "board")
        page.get_by_test_id("show-qr").first.click()
        page.get_by_test_id("qr").wait_for()
        found += findings(page, "QR code")
        page.get_by_test_id("dialog-back").click()
        for button in ("roster-withdraw", "roster-erase"):
            page.get_by_test_id(button).first.click()
            found += findings(page, button)
            page.get_by_test_id("dialog-back").click()
        page.locator(f"[data-participant={made['participant']}]").get_by_test_id("open").click()
        page.get_by_test_id("heatmap").wait_for(timeout=WITHIN_MS)
        page.get_by_test_id("why-not").locator("summary").click()
        found += findings(page, "session")
        for button in ("abort_trial", "message", "note"):
            page.get_by_test_id(button).click()
            found += findings(page, button)
            page.get_by_test_id("dialog-back").click()
        page.goto(f"{quick_lab.base_url}/dashboard#session=P999999")
        page.get_by_text("There is no such session").wait_for()
        found += findings(page, "no such session")
    assert not found, "\n".join(found)
