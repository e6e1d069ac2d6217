"""The report of the data so far: made beside a running lab, without pilots and demos, or a sentence why not."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from app.report.job import STEPS, WORK_PREFIX, make_report, sentence
from app.report.process import PAGE, Reporter
from app.session.commands import NotNow
from study.analysis.report import PAGE_NAME
from study.store import Batch, open_store
from study.store.database import FILE_NAME
from tests.support.accessibility import findings
from tests.support.analysis_samples import data_set, store_study
from tests.support.lab_server import LabServer
from tests.support.study_samples import UTC, shipped_study, trial_row

if TYPE_CHECKING:
    from playwright.sync_api import Page

WITHIN_S = 120.0


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lab's data: six participants who completed everything, two pilots and a demo who did too."""
    folder = tmp_path_factory.mktemp("filled") / "data"
    with open_store(folder) as store:
        store_study(store, data_set(6))
        store_study(store, data_set(2, seed=2), "pilot")
        store_study(store, data_set(1, seed=3), "demo")
    return folder


def test_one_record_that_cannot_be_used_takes_no_report_from_the_others(filled: Path, tmp_path: Path) -> None:
    data = tmp_path / "data"
    shutil.copytree(filled, data)
    with contextlib.closing(sqlite3.connect(data / FILE_NAME)) as file:
        for statement in (
            "UPDATE trials SET parameters = '?' WHERE participant = 'P002'",
            "UPDATE ticks SET belief = '[' WHERE participant = 'P004' AND trial = 2",
            "UPDATE ticks SET entropy = 'much' WHERE participant = 'P005' AND trial = 1 AND tick = 3",
        ):
            assert file.execute(statement).rowcount > 0
        file.execute("UPDATE participants SET created_utc = 'yesterday' WHERE participant = 'P006'")
        file.commit()
    said: list[dict[str, Any]] = []
    make_report(data, tmp_path / "report", said.append)
    assert said[-1]["made"]["participants"] == 2
    page = (tmp_path / "report" / PAGE_NAME).read_text(encoding="utf-8")
    for name in ("P002", "P004", "P005", "P006"):
        assert f"{name} is left out, whose record cannot be used" in page


# --- the job -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_report_is_made_of_the_study_alone_and_says_how_far_it_is(filled: Path, tmp_path: Path) -> None:
    said: list[dict[str, Any]] = []
    out = tmp_path / "report"
    out.mkdir()
    (out / "old.html").write_text("of an earlier one")
    make_report(filled, out, said.append)
    assert [line["text"] for line in said[:-1]] == list(STEPS)
    assert [line["step"] for line in said[:-1]] == [1, 2, 3, 4]
    made = said[-1]["made"]
    assert (made["participants"], made["trials"]) == (6, 18)
    names = [figure["name"] for figure in made["figures"]]
    assert names[0] == "fig3_objective_measures" and len(names) >= 4
    assert {path.stem for path in (out / "figures").iterdir()} == set(names)
    assert "6 participants" in (out / PAGE_NAME).read_text(encoding="utf-8")
    assert not (out / "old.html").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["report"]  # nothing of the work is left


@pytest.mark.parametrize(
    ("conditions", "outcome", "says"),
    [
        ((), "completed", "No completed trial (trials: none); let at least one participant finish."),
        (("balanced",), "aborted", "No completed trial (trials: 1 aborted); let at least one participant finish."),
        (("balanced", "balanced"), "completed", "All 2 completed trials are under balanced; the analysis compares "),
    ],
)
def test_what_cannot_be_computed_yet_is_said_in_a_sentence(
    tmp_path: Path, conditions: tuple[str, ...], outcome: str, says: str
) -> None:
    with open_store(tmp_path / "data") as store:
        for number, condition in enumerate(conditions):
            who = store.create_participant(shipped_study(), seed=1, public_id=str(number), utc=UTC).participant
            store.commit(Batch(trials=(replace(trial_row(who, outcome=outcome), condition=condition),)))
    said: list[dict[str, Any]] = []
    make_report(tmp_path / "data", tmp_path / "report", said.append)
    assert said[-1]["cannot"].startswith(says)
    assert str(tmp_path) not in said[-1]["cannot"]
    assert not (tmp_path / "report").exists()


def test_a_sentence_names_no_folder_and_no_export() -> None:
    text = "/data/x: no completed trial; let one finish, then export again"
    assert sentence(text, Path("/data/x")) == "No completed trial; let one finish."


# --- beside the lab --------------------------------------------------------------------------------------------------


async def test_one_report_at_a_time_and_none_while_somebody_is_erased(filled: Path) -> None:
    assert PAGE == PAGE_NAME
    reporter = Reporter(filled, lambda: "now")
    reporter.start()
    with pytest.raises(NotNow, match="being made already"):
        reporter.start()
    (filled / f"{WORK_PREFIX}killed" / "data").mkdir(parents=True)  # where a job that was killed had exported to
    await reporter.discard()  # as when somebody is erased meanwhile: what is being made may hold them
    assert reporter.status.state == "none"
    assert [name for name in os.listdir(filled) if "report" in name] == []


async def test_a_job_that_breaks_is_told(tmp_path: Path) -> None:
    (tmp_path / "lab.sqlite").write_bytes(b"no database")
    reporter = Reporter(tmp_path, lambda: "now")
    reporter.start()
    status = await reporter.finished()
    assert status.state == "cannot" and "lab.sqlite" in status.text


@pytest.mark.browser
def test_an_experimenter_makes_and_opens_the_report(
    page: Page, start_lab: Callable[..., LabServer], filled: Path, screenshot_dir: Path
) -> None:
    lab = start_lab("--robot", "kinematic", "--no-scene", data_dir=filled)
    place = f"{lab.base_url}/dashboard/report/"
    with httpx.Client(base_url=lab.base_url, trust_env=False, timeout=30.0) as client:
        for path in (place, f"{place}figures/fig3_objective_measures.png"):
            assert client.get(path).status_code == 403
            assert client.get(path, headers=lab.headers).status_code == 403  # a browser would not send these
        assert client.post("/api/report").status_code == 403
    page.goto(lab.experimenter_link)
    status = page.get_by_test_id("report-status")
    status.get_by_text("Not made yet.").wait_for()
    page.get_by_test_id("make-report").click()
    status.get_by_text("18 completed trials of 6 participants").wait_for(timeout=WITHIN_S * 1000)
    pictures = page.get_by_test_id("report-figures").locator("img")
    assert pictures.count() >= 4
    pictures.first.scroll_into_view_if_needed()
    assert pictures.first.evaluate("image => image.decode().then(() => image.naturalWidth > 300)")
    page.get_by_test_id("results").screenshot(path=screenshot_dir / "report-figures.png")
    with page.expect_popup() as opened:
        page.get_by_test_id("open-report").click()
    opened.value.get_by_role("heading", level=1).get_by_text("analysis").wait_for()
    assert opened.value.get_by_text("6 participants, 18 completed trials").count() == 1
    assert findings(page, "dashboard with a report") + findings(opened.value, "report") == []
    names = [path.name for path in (filled / "report").iterdir()]
    assert sorted(names) == ["figures", "measures.json", "report.html", "tables"]
    missing = page.request.get(f"{place}figures/..%2Fmeasures.json")
    assert missing.status == 404 and "made from" not in missing.text()
    first = json.loads(page.request.get(f"{lab.base_url}/api/roster", headers=lab.headers).text())["lines"][-1]
    gone = first["participant"]
    erased = page.request.post(
        f"{lab.base_url}/api/participants/{gone}/erase", headers=lab.headers, data={"confirm": gone}
    )
    assert erased.ok
    assert page.request.get(place).status == 404 and not (filled / "report").exists()
