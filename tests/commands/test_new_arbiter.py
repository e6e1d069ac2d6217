"""`salab new --arbiter`: what it writes is an arbiter that works, a test that passes and a study that runs."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.__main__ import main
from app.trial.world import open_study
from study.flow.facts import as_read
from tests.support.lab_server import ROOT
from tests.support.study_samples import shipped_study

pytestmark = pytest.mark.usefixtures("own_folder")


def files() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


def test_it_writes_an_arbiter_its_test_and_a_study_with_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "--arbiter", "slow_blend"]) == 0
    said = capsys.readouterr().out
    assert files() == ["slow_blend.py", "slow_blend.toml", "test_slow_blend.py"]
    for next_command in (
        "pytest test_slow_blend.py ",
        "salab check slow_blend.toml --trust",
        "salab simulate --study slow_blend.toml --trust --participants 2",
        "salab serve --study slow_blend.toml --trust",
    ):
        assert next_command in said
    study, shipped = open_study(Path("slow_blend.toml"), trust=True), shipped_study()
    *paper, own = study.conditions
    assert tuple(paper) == shipped.conditions
    assert (own.id, own.arbiter, own.parameters) == ("slow_blend", "slow_blend.py:SlowBlend", {"confidence": 0.6})
    changed = {"title", "conditions", "consent", "instructions", "texts"}
    assert study.model_dump(exclude=changed | {"code"}) == shipped.model_dump(exclude=changed | {"code"})
    text = Path("slow_blend.toml").read_text(encoding="utf-8")
    assert "it went straight to what you most likely wanted" in text
    assert "There are 4 rounds with short breaks" in " ".join(as_read(study).instructions.text)


@pytest.mark.slow
def test_its_test_passes_and_its_study_is_checked_and_simulated(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "--arbiter", "blend"]) == 0
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_blend.py"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    tested = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert tested.returncode == 0, tested.stdout + tested.stderr
    assert main(["check", "blend.toml", "--trust"]) == 0
    assert "runs arbiter blend.py:Blend from " in capsys.readouterr().out
    simulate = ["simulate", "--study", "blend.toml", "--trust", "--participants", "1", "--out", "pilot"]
    assert main(simulate) == 0
    with Path("pilot/ticks.csv").open(encoding="utf-8", newline="") as table:
        sources = {row["source"] for row in csv.DictReader(table) if row["condition"] == "blend"}
    assert {"user", "robot"} <= sources


def test_it_goes_beside_a_study_of_another_name_and_preset() -> None:
    assert main(["new", "study", "--arbiter", "blend", "--preset", "fitted"]) == 0
    assert files() == ["blend.py", "study.toml", "test_blend.py"]
    assert open_study(Path("study.toml"), trust=True).arbiter.transition == "replan"


@pytest.mark.parametrize("there", ["blend.py", "test_blend.py", "blend.toml"])
def test_nothing_is_overwritten_and_then_nothing_is_written(there: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path(there).write_text("years of work", encoding="utf-8")
    assert main(["new", "--arbiter", "blend"]) == 1
    assert capsys.readouterr().err == f"salab: {there}: there already; choose another name, or remove it first\n"
    assert files() == [there]
    assert Path(there).read_text(encoding="utf-8") == "years of work"


THEIR_OWN = ("state", "models", "belief", "parameters", "arbiter", "explanation", "float", "none")


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("Blend", "'Blend' is no name for an arbiter; give lower-case letters, digits and _, such as blend"),
        ("my-blend", "is no name for an arbiter"),
        ("../blend", "is no name for an arbiter"),
        ("class", "is no name for an arbiter"),
        ("test_it", "is no name for an arbiter"),
        ("balanced", "'balanced' is an arbiter already; arbiters are teleoperation, goal_oriented, balanced"),
        *((name, f"{name!r} is a name that the files written need themselves") for name in THEIR_OWN),
        ("random", "'random' is the name of an installed module, which random.py would hide"),
        ("numpy", "'numpy' is the name of an installed module"),
    ],
)
def test_a_name_that_leads_to_trouble_is_refused(name: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "study", "--arbiter", name]) == 1
    assert told in capsys.readouterr().err
    assert files() == []
