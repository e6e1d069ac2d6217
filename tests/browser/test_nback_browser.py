"""N-back on a running lab, in a real browser and against the clock: by key on the participant's page, by button on the
second device."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.support.browser_person import BrowserPerson
from tests.support.lab_server import LabServer
from tests.support.wire_client import COMPREHENSION, SHORT, invite, stored, write_study

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Page

pytestmark = [pytest.mark.usefixtures("no_script_errors"), pytest.mark.slow]

NBACK = {
    **SHORT,
    "first_s = 10.0 ": "first_s = 1.0 ",
    "every_s = 20.0": "every_s = 12.0",
    "answer_within_s = 20.0": "answer_within_s = 11.0",
    "away_min_s = 5.0 ": "away_min_s = 1.0 ",
    "digits = 4\ndecimals = 1": 'kind = "nback"\nn = 1\nletters = "KQ"\ntarget_rate = 0.5',
}
WITHIN_MS = 30_000


@pytest.mark.parametrize("placement", ["same_page_away", "second_device"])
def test_two_letters_are_answered(
    start_lab: Callable[..., LabServer],
    page: Page,
    context: BrowserContext,
    screenshot_dir: Path,
    tmp_path: Path,
    placement: str,
) -> None:
    study = write_study(tmp_path, {**NBACK, 'placement = "same_page_away" ': f'placement = "{placement}" '})
    lab = start_lab("--study", str(study), "--robot", "kinematic", "--no-scene")
    made = invite(lab)
    person = BrowserPerson(page, 0.02)
    page.goto(made["link"])
    asked = page
    if placement == "second_device":
        asked = context.new_page()
        asked.goto(made["panel_link"])
        asked.get_by_role("heading", name="Letters").wait_for()
        asked.get_by_test_id("panel-start").click()
        asked.get_by_test_id("panel-heard").click()
        page.bring_to_front()
    person.come_to_the_robot("keyboard", COMPREHENSION)
    person.start()
    if placement == "second_device":
        asked.bring_to_front()
    shown: list[str] = []
    for number in (1, 2):
        asked.get_by_test_id("alert-choice-same").wait_for(timeout=WITHIN_MS)
        shown.append(asked.get_by_test_id("alert-reading").inner_text())
        asked.screenshot(path=screenshot_dir / f"nback_live_{placement}_{number}.png")
        assert "reading" not in asked.get_by_test_id("alert").inner_text().lower()
        answer = "same" if shown[-1:] == shown[-2:-1] else "different"
        if number == 1:
            asked.keyboard.press({"same": "1", "different": "2"}[answer])
        else:
            asked.get_by_test_id(f"alert-choice-{answer}").click()
        asked.get_by_test_id("alert").wait_for(state="hidden", timeout=WITHIN_MS)
    with stored(lab) as store:
        rows = store.rows_of("alerts", made["participant"])
    assert [(row.reading, row.status, row.correct) for row in rows[:2]] == [(text, "answered", 1) for text in shown]
    assert all(row.shown_utc and row.placement == placement for row in rows[:2])
