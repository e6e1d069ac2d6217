"""An arbiter of one's own as an installed package, docs/examples/01_arbiter_package."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from app.__main__ import main
from study.export.export import read_table
from tests.support.lab_server import ROOT, LabServer
from tests.support.outside_package import install_project, installed_at, salab
from tests.support.wire_client import invite

EXAMPLE = ROOT / "docs" / "examples" / "01_arbiter_package"
STUDY = str(EXAMPLE / "study.toml")
CONDITIONS = {"teleoperation", "goal_oriented", "balanced", "when_sure"}


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    site = tmp_path / "site"
    site.mkdir()
    install_project(site, EXAMPLE)
    return installed_at(site)


def test_without_the_package_the_name_is_unknown() -> None:
    done = salab("check", STUDY)
    assert done.returncode == 1
    assert 'conditions[4].arbiter = "predict_then_act": not known' in done.stderr
    assert "teleoperation, goal_oriented, balanced" in done.stderr


def test_it_is_checked_simulated_and_analysed(environment: dict[str, str], tmp_path: Path) -> None:
    done = salab("check", STUDY, environment=environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert "runs arbiter predict_then_act from salab-predict-then-act 1.0, SHA-256 " in done.stdout
    out, report = str(tmp_path / "pilot"), str(tmp_path / "report")
    done = salab("simulate", "--study", STUDY, "--participants", "2", "--out", out, environment=environment)
    assert done.returncode == 0, done.stderr
    assert {row.condition for row in read_table(tmp_path / "pilot", "tasks")} == CONDITIONS
    done = salab("analyze", out, "--out", report)  # where nobody has the package
    assert done.returncode == 0, done.stderr
    assert "when_sure" in (tmp_path / "report" / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_it_runs_a_live_session(start_lab: Callable[..., LabServer], environment: dict[str, str]) -> None:
    arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", STUDY)
    lab = start_lab(*arguments, environment=environment)
    assert main(["bot", "--url", invite(lab)["link"], "--quiet"]) == 0
    out = lab.data_dir.parent / "out"
    assert main(["export", "--data", str(lab.data_dir), "--out", str(out)]) == 0
    tasks = read_table(out, "tasks")
    assert {row.condition for row in tasks} == CONDITIONS
    assert [row.outcome for row in tasks] == ["success"] * 8
    # The bot's hands are hardly ever off while it drives; what is recorded of the arbiter is asked here.
    assert '"condition": "predict_then_act", ' in next(
        row.parameters for row in read_table(out, "trials") if row.condition == "when_sure"
    )
