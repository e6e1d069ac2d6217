"""A robot from somebody else's installed package, live and with simulated people: no file of the lab touched."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.lab_server import ROOT, LabDidNotStart, LabServer
from tests.support.outside_package import ROBOT, install
from tests.support.wire_client import asked, invite, visit, write_study

pytestmark = pytest.mark.slow


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """That of a machine on which such a package is installed."""
    site = tmp_path / "site"
    site.mkdir()
    install(site, {"other": "outside_robots:OtherRobot"}, ROBOT)
    return {"PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}


async def test_it_runs_a_live_session(
    start_lab: Callable[..., LabServer], environment: dict[str, str], tmp_path: Path
) -> None:
    study = str(write_study(tmp_path))
    arguments = ("--robot", "other", "--pace", "lockstep", "--no-scene", "--study", study)
    lab = start_lab(*arguments, environment=environment)
    assert asked(lab, "GET", "health").json()["robot"] == "other"
    async with visit(invite(lab)["link"]) as player:
        await player.reach_trial()
        assert [(await player.tick((1, 0, 0))).tick for _ in range(4)] == [0, 1, 2, 3]


def test_it_runs_simulated_people_as_the_robot_it_is(environment: dict[str, str], tmp_path: Path) -> None:
    def simulated(robot: str) -> Path:
        out = tmp_path / robot
        command = [sys.executable, "-m", "app", "simulate", "--participants", "1", "--robot", robot, "--out", str(out)]
        subprocess.run(
            command, cwd=ROOT, env={**os.environ, **environment}, check=True, capture_output=True, timeout=300
        )
        return out

    assert (simulated("other") / "ticks.csv").read_bytes() == (simulated("kinematic") / "ticks.csv").read_bytes()


def test_one_that_is_broken_is_one_line_and_no_half_started_lab(
    start_lab: Callable[..., LabServer], environment: dict[str, str], tmp_path: Path
) -> None:
    install(tmp_path / "site", {"other": "outside_robots:OtherRobot"}, "import not_there")
    with pytest.raises(LabDidNotStart) as caught:
        start_lab("--robot", "other", data_dir=tmp_path / "data", environment=environment)
    said = str(caught.value).splitlines()[1:]
    assert len(said) == 1
    assert said[0].startswith("salab: robot 'other' (outside_robots:OtherRobot) cannot be loaded: ModuleNotFoundError")
    assert not (tmp_path / "data" / "lab.sqlite").exists()
