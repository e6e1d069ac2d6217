"""The suite as an author runs it: one pytest line, from any folder; or a class of two lines."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
GOOD = """
from dataclasses import dataclass
from typing import Annotated
from annotated_types import Ge, Le
from app.autonomy.interface import Arbiter


@dataclass(frozen=True)
class Parameters:
    confidence: Annotated[float, Ge(0.0), Le(1.0)]


class Follow(Arbiter):
    Parameters = Parameters

    def decide(self, state, belief, user, feasible):
        return user if user and self.parameters.confidence == {confidence} else (0, 0, 0)
"""
ROBOT = "from sim.kinematic import KinematicRobot\nclass Other(KinematicRobot): ...\n"
SUITE = """
from app.contracts.arbiter import ArbiterContract
class TestFollow(ArbiterContract):
    arbiter = "follow.py:Follow"
"""


def run(folder: Path, *arguments: str) -> tuple[int, str]:
    """pytest in that folder, where the lab is installed; exit status and what it printed."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "app.contracts.plugin", "-p", "no:cacheprovider", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "300"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "follow.py").write_text(GOOD.format(confidence=0.5), encoding="utf-8")
    (tmp_path / "other.py").write_text(ROBOT, encoding="utf-8")
    (tmp_path / "test_follow.py").write_text(SUITE, encoding="utf-8")
    return tmp_path


def test_parts_named_on_the_command_line_are_held_to_it(folder: Path) -> None:
    named = ("--arbiter", "follow.py:Follow", "--arbiter", "teleoperation", "--robot", "other.py:Other")
    status, said = run(folder, "--pyargs", "app.contracts", *named, "-k", "answers_with or command or time")
    assert status == 0, said
    assert "skipped" not in said
    assert " passed" in said and "failed" not in said, said


def test_an_installed_lab_brings_the_options_by_itself(folder: Path) -> None:
    """As pip leaves it: pytest finds the entry point. Naming the plug-in as well loads it once."""
    points = PROJECT["entry-points"]["pytest11"]
    info = folder / "installed_lab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: installed-lab\nVersion: 1.0\n", encoding="utf-8")
    lines = [f"{name} = {place}" for name, place in points.items()]
    (info / "entry_points.txt").write_text("[pytest11]\n" + "\n".join(lines) + "\n", encoding="utf-8")
    for named in ((), ("-p", "app.contracts.plugin")):
        arguments = ("--pyargs", "app.contracts", "--arbiter", "teleoperation", "-k", "answers_with")
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *named, *arguments]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])}
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
        assert "1 passed" in done.stdout, done.stdout + done.stderr


def test_only_what_is_named_is_looked_at_and_the_slowest_answer_is_told(folder: Path) -> None:
    status, said = run(folder, "--pyargs", "app.contracts", "--inference", "boltzmann", "-k", "within or same_goals")
    assert status == 0, said
    assert "inference 'boltzmann': the slowest of 240 answers took" in said
    assert "2 passed" in said


def test_what_a_part_takes_may_be_said(folder: Path) -> None:
    given = ("--parameters", '{"confidence": 2.0}')
    status, said = run(folder, "--pyargs", "app.contracts", "--arbiter", "follow.py:Follow", *given)
    assert status != 0
    assert "'follow.py:Follow' takes confidence, which must be a number at least 0.0 and at most 1.0; say" in said, said
    assert "Traceback" not in said


def test_a_class_of_two_lines_does_the_same(folder: Path) -> None:
    status, said = run(folder, "test_follow.py", "-k", "answers or memory_is_json")
    assert status == 0, said
    assert "4 passed" in said


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((), "name what to check: --arbiter, --inference or --robot"),
        (("--arbiter", "nobody"), "no arbiter 'nobody'; arbiters are teleoperation, goal_oriented, balanced"),
        (("--arbiter", "gone.py:Gone"), "arbiter 'gone.py:Gone': gone.py cannot be read: No such file"),
        (("--arbiter", "follow.py:Follow", "--parameters", "{"), "--parameters '{' is not JSON"),
    ],
)
def test_what_cannot_be_checked_is_told(folder: Path, arguments: tuple[str, ...], told: str) -> None:
    status, said = run(folder, "--pyargs", "app.contracts", *arguments)
    assert status != 0
    assert told in said, said


def test_without_pytest_it_is_said_what_is_missing(folder: Path) -> None:
    code = "import sys; sys.modules['pytest'] = None\nimport app.contracts.arbiter"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)
    assert "the contract suite runs under pytest, which a lab that only runs studies does not need" in done.stderr
