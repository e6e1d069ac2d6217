"""A distractor from somebody else's installed package, live, simulated, exported and analysed: no file of the lab
touched. N-back, which ships, goes the same way."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from app.simulated.bot import run_bot
from app.simulated.connection import BotError
from tests.support.lab_server import ROOT, LabDidNotStart, LabServer
from tests.support.outside_package import DISTRACTOR, install_distractor
from tests.support.wire_client import SHORT, invite, visit, write_study

pytestmark = pytest.mark.slow

READINGS = "digits = 4\ndecimals = 1"
KINDS = {"sums": 'kind = "sums"\nmost = 20', "nback": 'kind = "nback"\nn = 1\ntarget_rate = 0.4'}


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """That of a machine on which such a package is installed."""
    site = tmp_path / "site"
    site.mkdir()
    install_distractor(site, {"sums": "outside_distractors:Sums"})
    return {"PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}


def salab(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "app", *arguments]
    return subprocess.run(
        command, cwd=ROOT, env={**os.environ, **environment}, capture_output=True, text=True, timeout=300, check=False
    )


def is_right(kind: str, shown: list[str], answer: str) -> bool:
    """Worked out once more, from the text alone."""
    if kind == "sums":
        return answer == str(sum(int(part) for part in shown[-1].split(" + ")))
    return answer == ("same" if shown[-1:] == shown[-2:-1] else "different")


def judged(kind: str, export: Path) -> list[dict[str, str]]:
    """The rows of an export's alerts, after checking each against its text."""
    with (export / "alerts.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    trials = {(row["participant"], row["trial"]) for row in rows}
    for trial in trials:
        shown: list[str] = []
        for row in (row for row in rows if (row["participant"], row["trial"]) == trial):
            shown.append(row["reading"])
            if row["answer"]:
                assert row["correct"] == str(int(is_right(kind, shown, row["answer"])))
            else:
                assert row["correct"] == ""
    return rows


def test_one_for_a_single_study_stands_in_a_file_beside_it(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(DISTRACTOR, encoding="utf-8")
    study = write_study(tmp_path, {READINGS: KINDS["sums"].replace('"sums"', '"own.py:Sums"')})
    checked = salab({}, "check", str(study))
    assert checked.returncode == 0, checked.stderr
    assert "own.py:Sums" in checked.stdout
    out = tmp_path / "out"
    simulate = ("simulate", "--study", str(study), "--participants", "1", "--out", str(out))
    refused = salab({}, *simulate)
    assert refused.returncode != 0 and "--trust" in refused.stderr and not out.exists()
    done = salab({}, *simulate, "--trust")
    assert done.returncode == 0, done.stderr
    assert [row for row in judged("sums", out) if row["status"] == "answered"]
    (text,) = (path.read_text(encoding="utf-8") for path in out.glob("**/*.toml"))
    assert 'name = "own.py:Sums"' in text and "class Sums" in text


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_simulated_people_answer_it_and_the_analysis_counts_it(
    kind: str, environment: dict[str, str], tmp_path: Path
) -> None:
    study = write_study(tmp_path, {READINGS: KINDS[kind]})
    checked = salab(environment, "check", str(study))
    assert checked.returncode == 0, checked.stderr
    out = tmp_path / "out"
    done = salab(environment, "simulate", "--study", str(study), "--participants", "2", "--out", str(out))
    assert done.returncode == 0, done.stderr
    rows = judged(kind, out)
    answered = [row for row in rows if row["status"] == "answered"]
    right = sum(int(row["correct"]) for row in answered)
    assert len(answered) > 0.8 * len(rows) > 20
    assert 0.85 * len(answered) < right
    report = tmp_path / "report"
    analysed = salab(environment, "analyze", str(out), "--out", str(report))
    assert analysed.returncode == 0, analysed.stderr
    with (report / "tables" / "distractor.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert sum(int(row["raised"]) for row in table) == len(rows)
    assert sum(int(row["correct"]) for row in table) == right
    assert "reading" not in (report / "report.html").read_text(encoding="utf-8").lower()


async def test_it_runs_a_live_session_and_its_export(
    start_lab: Callable[..., LabServer], environment: dict[str, str], tmp_path: Path
) -> None:
    study = str(write_study(tmp_path, {**SHORT, READINGS: KINDS["sums"]}))
    arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", study)
    lab = start_lab(*arguments, data_dir=tmp_path / "data", environment=environment)
    report = await run_bot(invite(lab)["link"])
    out = tmp_path / "out"
    exported = salab(environment, "export", "--data", str(tmp_path / "data"), "--out", str(out))
    assert exported.returncode == 0, exported.stderr
    rows = judged("sums", out)
    with (out / "trials.csv").open(encoding="utf-8", newline="") as file:
        ran_s = {trial["trial"]: 0.5 * int(trial["ticks"]) for trial in csv.DictReader(file)}
    assert report.alerts == len(rows) == sum(1 + int((end_s - 6.0) // 25.0) for end_s in ran_s.values())
    assert {row["due_trial_s"] for row in rows if row["alert"] == "2"} <= {"31", "31.0"}
    assert {row["correct"] for row in rows if row["status"] == "answered"} == {"1"}
    assert json.loads((out / "meta.json").read_text(encoding="utf-8"))


async def test_one_that_is_gone_or_broken_is_one_line_and_no_half_started_lab(
    start_lab: Callable[..., LabServer], environment: dict[str, str], tmp_path: Path
) -> None:
    study = write_study(tmp_path, {**SHORT, READINGS: KINDS["sums"]})
    unknown = salab({}, "check", str(study))
    assert unknown.returncode == 1
    assert "not known; distractors: readings, nback" in unknown.stderr.splitlines()[0]
    install_distractor(tmp_path / "site", {"sums": "outside_distractors:Sums"}, DISTRACTOR + "\nimport not_there\n")
    with pytest.raises(LabDidNotStart) as caught:
        start_lab("--study", str(study), data_dir=tmp_path / "data", environment=environment)
    said = str(caught.value).splitlines()[1:]
    assert len(said) == 1
    assert "distractor 'sums' (outside_distractors:Sums) cannot be loaded: ModuleNotFoundError" in said[0]
    assert not (tmp_path / "data" / "lab.sqlite").exists()


async def test_who_took_part_with_it_is_told_in_one_line_when_it_is_gone(
    start_lab: Callable[..., LabServer], environment: dict[str, str], tmp_path: Path
) -> None:
    study = str(write_study(tmp_path, {**SHORT, READINGS: KINDS["sums"]}))
    arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene")
    lab = start_lab(*arguments, "--study", study, data_dir=tmp_path / "data", environment=environment)
    made = invite(lab)
    async with visit(made["link"]) as player:
        await player.reach("setup")
    lab.kill()
    again = start_lab(*arguments, data_dir=tmp_path / "data")  # the shipped study, and no such package
    link = again.base_url + "/p/" + made["link"].rpartition("/")[2]
    with pytest.raises(BotError, match="403"):
        async with visit(link):
            pass
    async with visit(invite(again)["link"]) as player:  # everybody else is let in
        await player.reach("setup")
    again.close()  # and all that it said is in its log
    (said,) = [line for line in again.log().splitlines() if "turned away" in line]
    assert "P001 cannot go on: distractor 'sums' was outside-distractors 1.0, source " in said
    assert said.endswith('when the study was made; it is not installed. Install that version to go on"')
