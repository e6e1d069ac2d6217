"""`docs/examples/06_distractor` does what the page about it says: installed as a package, checked, simulated, live."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from app.simulated.bot import run_bot
from tests.support.lab_server import ROOT, LabServer
from tests.support.outside_package import install
from tests.support.wire_client import invite, stored

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

pytestmark = pytest.mark.slow

EXAMPLE = ROOT / "docs" / "examples" / "06_distractor"


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """That of a machine on which its package is installed, with what its own pyproject.toml registers."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text(encoding="utf-8"))
    (module,) = project["tool"]["setuptools"]["py-modules"]
    ((group, parts),) = project["project"]["entry-points"].items()
    site = tmp_path / "site"
    site.mkdir()
    install(site, parts, (EXAMPLE / f"{module}.py").read_text(encoding="utf-8"), group=group, module=module)
    return {"PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}


def salab(environment: dict[str, str], *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "app", *arguments],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def is_true(text: str) -> bool:
    left, total = text.split(" = ")
    return sum(int(part) for part in left.split(" + ")) == int(total)


def test_its_study_is_checked_and_simulated(environment: dict[str, str], tmp_path: Path) -> None:
    study = str(EXAMPLE / "study.toml")
    assert "fine. 2 conditions" in salab(environment, "check", study)
    out = tmp_path / "pilot"
    salab(environment, "simulate", "--study", study, "--participants", "2", "--out", str(out))
    with (out / "alerts.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["status"] == "answered"]
    assert len(rows) > 5
    for row in rows:
        assert row["correct"] == str(int(row["answer"] == ("right" if is_true(row["reading"]) else "wrong")))


async def test_it_runs_live(start_lab: Callable[..., LabServer], environment: dict[str, str], tmp_path: Path) -> None:
    arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", str(EXAMPLE / "study.toml"))
    lab = start_lab(*arguments, data_dir=tmp_path / "data", environment=environment)
    made = invite(lab)
    report = await run_bot(made["link"])
    assert report.pages[-1] == "done"
    with stored(lab) as store:
        rows = store.rows_of("alerts", made["participant"])
    assert len(rows) == report.alerts > 0
    assert {row.correct for row in rows if row.status == "answered"} == {1}
