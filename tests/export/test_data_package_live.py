"""The data package of a lab that runs: a study with a questionnaire of its own, by the scripted client."""

from __future__ import annotations

import asyncio
import io
import json
import zipfile
from pathlib import Path

import httpx
import pytest
from frictionless import validate

from app.simulated.bot import run_bot
from study.export.export import read_table
from tests.support import lab_server
from tests.support.wire_client import SHORT, invite, visit, write_study

pytestmark = pytest.mark.slow

MOOD = """
title = "Mood"
intro = "How was it?"
points = 3
low = "No"
high = "Yes"
score_means = "calmer"

[[items]]
id = "calm"
text = "I was calm."

[[items]]
id = "tense"
text = "I was tense."
reversed = true
"""


async def start_and_leave(link: str) -> None:
    """Somebody who closes the page after consent: an unfinished participant is in the data as well."""
    async with visit(link) as player:
        await player.reach("demographics")


def test_the_download_of_a_running_lab_is_a_valid_data_package(tmp_path: Path) -> None:
    study = write_study(tmp_path, {**SHORT, '["sus_modified", "tlx_raw"] ': '["mood"] '})
    (tmp_path / "mood.toml").write_text(MOOD, encoding="utf-8")
    arguments = ("--robot", "kinematic", "--pace", "lockstep", "--study", str(study))
    with lab_server.start(tmp_path / "data", *arguments) as lab:
        made = invite(lab)
        report = asyncio.run(run_bot(made["link"]))
        # The file beside the study is gone: whoever is enrolled has its questionnaire all the same.
        (tmp_path / "mood.toml").unlink()
        asyncio.run(start_and_leave(invite(lab)["link"]))
        answer = httpx.get(f"{lab.base_url}/api/export", headers=lab.headers, trust_env=False, timeout=60.0)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/zip")
    assert report.surveys == 3
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        archive.extractall(tmp_path / "out")

    checked = validate(str(tmp_path / "out" / "datapackage.json"))
    assert checked.valid, checked.flatten(["name", "rowNumber", "fieldName", "message"])
    assert checked.warnings == [] and all(task.warnings == [] for task in checked.tasks)
    assert len(read_table(tmp_path / "out", "participants")) == 2
    answers = [row for row in read_table(tmp_path / "out", "survey_answers") if row.instrument == "mood"]
    assert [(row.trial, row.item, row.value) for row in answers] == [
        (trial, item, "2") for trial in (1, 2, 3) for item in ("calm", "tense")
    ]
    told = json.loads((tmp_path / "out" / "questionnaires.json").read_text(encoding="utf-8"))
    (asked,) = told["studies"].values()
    assert [form["id"] for form in asked["surveys"]] == ["mood"]
