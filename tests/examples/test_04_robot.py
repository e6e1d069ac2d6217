"""A robot of one's own as an installed package, docs/examples/04_robot."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from study.export.export import read_table
from tests.support.lab_server import ROOT
from tests.support.outside_package import install_project, installed_at, salab
from tests.support.wire_client import write_study

pytestmark = pytest.mark.slow

EXAMPLE = ROOT / "docs" / "examples" / "04_robot"
UP_TO_THE_CEILING = """
import json
import numpy as np
from app.trial.robots import make_robot
from sim.interface import run_tick, steady
from app.trial.world import shipped_layout
from sim.layouts import practice_scene

robot = make_robot("low_ceiling")
robot.reset(practice_scene(shipped_layout("arc")))
for _ in range(5):
    run_tick(robot, steady((1.0, 0.0, 0.0), 0.04))  # near its base the arm cannot be raised that far
told = []
for _ in range(30):
    can = bool(robot.feasible(np.array([[0.0, 0.0, 0.02]]))[0])
    verdict, world = run_tick(robot, steady((0.0, 0.0, 1.0), 0.04))
    told.append([can, verdict.blocked, verdict.reason, world.position_world_gripper_m[2]])
print(json.dumps(told))
"""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    site = tmp_path / "site"
    site.mkdir()
    install_project(site, EXAMPLE)
    return installed_at(site)


def test_it_stops_below_the_ceiling_and_says_why(environment: dict[str, str]) -> None:
    command = [sys.executable, "-W", "error", "-c", UP_TO_THE_CEILING]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    told = json.loads(done.stdout)
    assert all(can is not blocked for can, blocked, _, _ in told), "what is feasible is done, and nothing else"
    assert told[0][:3] == [True, False, None]
    assert told[-1][:3] == [False, True, "the ceiling is in the way"]
    assert 0.98 < told[-1][3] == max(height_m for *_, height_m in told) <= 1.0


def test_simulated_people_work_with_it(environment: dict[str, str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    study = str(write_study(tmp_path))
    arguments = ("simulate", "--study", study, "--robot", "low_ceiling", "--participants", "1", "--seed", "4")
    done = salab(*arguments, "--out", str(out), environment=environment)
    assert done.returncode == 0, done.stderr
    assert max(row.p_z for row in read_table(out, "ticks")) <= 1.0
    assert json.loads((out / "meta.json").read_text(encoding="utf-8"))["simulated"]["robot"] == "low_ceiling"


def test_without_the_package_there_is_no_such_robot(tmp_path: Path) -> None:
    done = salab("simulate", "--robot", "low_ceiling", "--participants", "1", "--out", str(tmp_path / "out"))
    assert done.returncode != 0
    assert "'low_ceiling' is not one of bullet, mujoco, kinematic" in done.stderr
