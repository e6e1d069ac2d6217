"""A machine without pybullet: MuJoCo moves the robot there, the lab says so, and a whole study is done on it."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from app.simulated.bot import run_bot
from tests.support.lab_server import ROOT, LabDidNotStart, LabServer
from tests.support.wire_client import asked, events, invite, stored, write_study

pytestmark = [pytest.mark.mujoco, pytest.mark.slow]


@pytest.fixture
def without_pybullet(tmp_path: Path) -> dict[str, str]:
    """The environment of a machine on which it is not installed."""
    site = tmp_path / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text("import sys; sys.modules['pybullet'] = None\n", encoding="utf-8")
    return {"PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}


async def test_mujoco_moves_the_robot_through_a_whole_study_and_the_lab_says_so(
    start_lab: Callable[..., LabServer], without_pybullet: dict[str, str], tmp_path: Path
) -> None:
    lab = start_lab("--no-scene", "--study", str(write_study(tmp_path)), environment=without_pybullet)
    health = asked(lab, "GET", "health").json()
    note = "pybullet is not installed: the robot moves on the physics of mujoco instead"
    assert (health["robot"], health["robot_note"]) == ("mujoco", note)
    assert note in lab.log()
    made = invite(lab, pace="lockstep")
    report = await run_bot(made["link"])
    assert (report.surveys, report.findings, report.pages[-1]) == (3, [], "done")
    told = [data for _, data in events(lab, made["participant"], "robot")]
    assert {one["robot"] for one in told} == {"mujoco"}
    with stored(lab) as store:
        tasks = store.rows_of("tasks", made["participant"])
    assert {task.outcome for task in tasks} == {"success"}


def test_a_robot_whose_physics_is_not_installed_is_one_line(
    start_lab: Callable[..., LabServer], without_pybullet: dict[str, str]
) -> None:
    with pytest.raises(LabDidNotStart) as caught:
        start_lab("--robot", "bullet", environment=without_pybullet)
    said = str(caught.value).splitlines()[1:]
    assert said == [
        "salab: robot 'bullet' needs pybullet, which is not installed: pip install 'shared-autonomy-lab[bullet]' "
        "(Python 3.10 to 3.13), or take --robot mujoco, or --robot kinematic, which has no physics"
    ]
