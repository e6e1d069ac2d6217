"""A day of a study as its researcher spends it: a study file of one's own, twelve enrolled, three at once, and trouble.

The dashboard is a real browser's; the participants are scripted ones over the wire.
"""

from __future__ import annotations

import asyncio
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd
import pytest
from frictionless import validate

from app.__main__ import main
from app.simulated.bot import BotReport, run_bot
from tests.browser.test_live_page import driving
from tests.support.lab_server import LabServer
from tests.support.wire_client import SHORT

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

pytestmark = pytest.mark.slow

WITHIN_MS = 30_000
ENROLLED = 12


def own_study(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """`salab new`, then shortened in an editor: one object a trial, no practice."""
    monkeypatch.chdir(folder)
    assert main(["new", "spill"]) == 0
    path = folder / "spill.toml"
    text = path.read_text(encoding="utf-8")
    for old, new in SHORT.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path


def session_row(page: Page, participant: str) -> Locator:
    return page.locator(f"[data-testid=session-row][data-participant={participant}]")


def roster_row(page: Page, participant: str) -> Locator:
    return page.locator(f"[data-testid=roster-row][data-participant={participant}]")


def create(page: Page, count: int) -> dict[str, str]:
    """Participants made with the dashboard's button: id to link."""
    before = page.get_by_test_id("new-link").count()
    page.get_by_test_id("create-count").fill(str(count))
    page.get_by_test_id("create-label").fill("Ada Lovelace")
    page.get_by_test_id("create-participant").click()
    page.get_by_test_id("new-link").nth(before + count - 1).wait_for(timeout=WITHIN_MS)
    made = page.get_by_test_id("new-link").all()[:count]  # the newest stand first
    return {
        str(one.get_attribute("data-participant")): one.get_by_test_id("participant-link").input_value() for one in made
    }


def orders(page: Page) -> dict[str, str]:
    """Participant to order of conditions, from the grid."""
    found = {}
    for row in page.get_by_test_id("order-row").all():
        order = row.locator("th").inner_text()
        found.update({str(chip.get_attribute("data-participant")): order for chip in row.locator(".chip").all()})
    return found


def bot(link: str) -> BotReport:
    return asyncio.run(run_bot(link))


def test_a_day_of_a_study(
    page: Page,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    start_lab: Callable[..., LabServer],
    screenshot_dir: Path,
) -> None:
    study = own_study(tmp_path, monkeypatch)
    lab = start_lab("--study", str(study), "--robot", "kinematic", "--pace", "lockstep", "--no-scene")
    page.goto(lab.experimenter_link)
    page.get_by_test_id("order-grid").wait_for()
    links = create(page, ENROLLED)
    assert len(links) == ENROLLED
    page.locator(".chip").nth(ENROLLED - 1).wait_for()
    first = orders(page)
    assert sorted(pd.Series(first).value_counts().tolist()) == [2] * 6, "twelve fill six orders twice"

    with ThreadPoolExecutor(3) as at_once:
        reports = list(at_once.map(bot, [links[name] for name in ("P001", "P002", "P003")]))
    assert [report.pages[-1] for report in reports] == ["done"] * 3
    for name in ("P001", "P002", "P003"):
        session_row(page, name).get_by_text("Complete", exact=False).first.wait_for(timeout=WITHIN_MS)

    with driving(links["P004"], 3), driving(links["P005"], 3), driving(links["P006"], 3):
        session_row(page, "P004").get_by_test_id("pause").click()
        page.get_by_test_id("dialog-confirm").click()
        session_row(page, "P004").get_by_text("Paused", exact=False).first.wait_for(timeout=WITHIN_MS)
        session_row(page, "P005").get_by_test_id("abort").click()
        page.get_by_test_id("abort-dialog").get_by_role("textbox").fill("Ada felt unwell")
        page.get_by_test_id("dialog-confirm").click()
        session_row(page, "P005").get_by_text("Aborted", exact=False).first.wait_for(timeout=WITHIN_MS)
        roster_row(page, "P006").get_by_test_id("roster-withdraw").click()
        page.get_by_test_id("dialog-confirm").click()
        session_row(page, "P006").get_by_text("Withdrawn", exact=False).first.wait_for(timeout=WITHIN_MS)
        session_row(page, "P004").get_by_test_id("resume").click()
        page.get_by_test_id("dialog-confirm").click()
        session_row(page, "P004").get_by_text("In a trial", exact=False).first.wait_for(timeout=WITHIN_MS)
        for gone in ("P005", "P006"):
            page.locator(f".chip[data-participant={gone}]").wait_for(state="detached", timeout=WITHIN_MS)
        refilled = create(page, 2)
        page.locator(".chip[data-participant=P014]").wait_for(timeout=WITHIN_MS)
        now = orders(page)
        assert {now[name] for name in refilled} == {first["P005"], first["P006"]}, "the free cells were filled again"
        page.screenshot(path=screenshot_dir / "study_day.png", full_page=True)

        with page.expect_download(timeout=WITHIN_MS) as download:
            page.get_by_test_id("download-export").click()
        package = tmp_path / "export.zip"
        download.value.save_as(package)

    out = tmp_path / "out"
    with zipfile.ZipFile(package) as archive:
        archive.extractall(out)
    descriptor = next(out.rglob("datapackage.json"))
    report = validate(str(descriptor))
    assert report.valid and not report.warnings, report.to_summary()
    folder = descriptor.parent
    tasks = pd.read_csv(folder / "tasks.csv")
    done = tasks[tasks.participant.isin(["P001", "P002", "P003"])]
    assert done.groupby("participant").size().tolist() == [6, 6, 6]
    people = pd.read_csv(folder / "participants.csv").set_index("participant")
    assert people.state["P001"] == "done"
    assert people.state[["P005", "P006"]].tolist() == ["aborted", "withdrawn"]
    for file in (path for path in folder.rglob("*") if path.is_file()):
        for personal in (b"Ada Lovelace", b"Ada felt unwell"):  # long enough not to occur in compressed bytes by chance
            assert personal not in file.read_bytes(), f"{file.name} names somebody"
