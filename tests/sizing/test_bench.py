"""`salab bench sessions` as it is typed: a whole run on the robot without physics, what it leaves, what it refuses."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from app.__main__ import main
from app.sizing.capacity import NAME
from app.sizing.machine import cores
from tests.support import lab_server as labs
from tests.support.lab_server import ROOT
from tests.support.wire_client import write_study

WITHIN_S = 120.0


def bench(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    command = ["bench", "sessions", "--robot", "kinematic", "--study", str(write_study(folder))]
    return subprocess.Popen(
        [sys.executable, "-m", "app", *command, "--data", str(folder / "data"), *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def steps_in(folder: Path) -> list[dict[str, str]]:
    with (folder / "sessions.csv").open(encoding="utf-8", newline="") as source:
        return list(csv.DictReader(source))


@pytest.mark.slow
def test_a_run_leaves_its_figures_and_a_number_that_the_lab_keeps_to(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with bench(tmp_path, "--steps", "1,2", "--seconds", "2", "--out", str(out)) as run:
        said, problems = run.communicate(timeout=WITHIN_S)
    assert run.returncode == 0, problems
    steps = steps_in(out)
    assert {step["sessions"] for step in steps} == {"1", "2"}
    for what in ("ticks", "scene_kb_s"):  # of any step: in two seconds everybody may be reading a page
        assert sum(float(step[what]) for step in steps) > 0, what
    assert all(float(step["worker_cores"]) > 0 and float(step["mb_per_session"]) > 1 for step in steps)
    told = json.loads((out / "sessions.json").read_text(encoding="utf-8"))
    assert (told["robot"], told["views"], len(told["steps"])) == ("kinematic", True, len(steps))
    assert "This machine holds" in said and "at once, with the 3-D view open" in said
    assert {path.name for path in out.iterdir()} == {f"sessions.{kind}" for kind in ("csv", "json", "png", "svg")}
    assert {path.name for path in tmp_path.iterdir()} <= {"study.toml", "data", "out"}, "the lab's folder is gone"
    if "Not kept: other programs took the machine" not in said:  # as the other tests may
        kept = json.loads((tmp_path / "data" / NAME).read_text(encoding="utf-8"))
        assert kept["sessions"] == told["verdict"]["capacity"] >= 1


@pytest.mark.slow
def test_what_was_measured_before_ctrl_c_is_kept(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with bench(tmp_path, "--steps", "1,2", "--seconds", "3", "--no-views", "--out", str(out)) as run:
        assert run.stdout is not None
        lines = iter(run.stdout)
        while not next(lines).strip().startswith("1 "):
            pass
        run.send_signal(signal.SIGINT)
        said, problems = run.communicate(timeout=WITHIN_S)
    assert run.returncode == 130, problems
    assert "Interrupted: the lab keeps what it knew before." in said and "Traceback" not in problems
    assert [step["sessions"] for step in steps_in(out)] == ["1"]
    assert {path.name for path in tmp_path.iterdir()} == {"study.toml", "out"}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--steps", "0,1"), "--steps 0,1: must be numbers of people from 1 to 2000"),
        (("--steps", "4,2"), "--steps 4,2: must rise from each to the next"),
        (("--steps", "1,9999"), "from 1 to 2000"),
        (("--seconds", "0"), "--seconds 0: must be from 1 to 3600"),
        (("--seconds", "nan"), "--seconds nan: must be from 1 to 3600"),
        (("--people-cores", str(cores())), f"--people-cores {cores()}: this machine has {cores()} for lab and people"),
        (("--people-cores", "-1"), "--people-cores -1: "),
        (("--study", "nowhere.toml"), "nowhere.toml"),
    ],
)
def test_what_cannot_be_measured_is_one_line(
    arguments: tuple[str, ...], says: str, own_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "sessions", "--robot", "kinematic", *arguments]) == 1
    said = capsys.readouterr()
    assert said.out == "" and says in said.err and said.err.count("\n") == 1
    assert list(own_folder.iterdir()) == []


def test_only_what_there_is_can_be_measured(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "people"]) == 2
    assert "'people' is not one of sessions" in capsys.readouterr().err
    assert main(["bench", "sessions", "--robot", "r2d2"]) == 2
    assert "'r2d2' is not one of" in capsys.readouterr().err
    assert main(["bench", "sessions", "--seconds", "long"]) == 2


def test_too_few_open_files_are_told_before_anything_starts(
    own_folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.sizing.machine.open_files", lambda: 256)
    assert main(["bench", "sessions", "--robot", "kinematic", "--steps", "64"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("salab: 64 at once want about 918 open files, and a process may have 256 here")
    assert list(own_folder.iterdir()) == []


def test_nobody_is_made_late_by_a_measurement_beside_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = write_study(tmp_path)
    with labs.start(tmp_path / "data", "--robot", "kinematic", "--no-scene", "--study", str(study)) as lab:
        assert main(["bench", "sessions", "--robot", "kinematic", "--data", str(lab.data_dir)]) == 1
        assert "a lab runs on this data folder" in capsys.readouterr().err
        assert httpx.get(f"{lab.base_url}/api/health", trust_env=False).status_code == 200
