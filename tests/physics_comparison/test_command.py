"""`salab compare-physics` as it is typed: a tiny study, its files, and what cannot be compared."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from app.errors import LabError
from app.physics_comparison import comparing
from app.physics_comparison.comparing import chosen_robots
from app.physics_comparison.files import TABLES
from app.trial.robots import ROBOTS
from study.parts.errors import PartError
from study.parts.registry import Registry
from tests.support.study_samples import small_study
from tests.support.typed_command import run


def lines_of(path: Path) -> list[Mapping[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(autouse=True)
def trailing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second robot that costs next to nothing."""
    monkeypatch.setitem(dict_of(ROBOTS), "trailing", "tests.physics_comparison.test_open_loop:Trailing")


def dict_of(robots: Registry) -> dict[str, str]:
    assert isinstance(robots.shipped, dict)
    return robots.shipped


def test_a_tiny_study_on_two_robots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study, out = tmp_path / "study.toml", tmp_path / "out"
    study.write_text(small_study().source_text, encoding="utf-8")
    typed = ("compare-physics", "--robots", "kinematic", "trailing", "--participants", "2", "--recorded", "1")
    status, said, told = run(capsys, *typed, "--study", str(study), "--seed", "5", "--out", str(out))
    assert status == 0, told
    assert "people on robots: 4/4" in told, "progress"
    assert "rule of equivalence" in said and "kinematic and trailing: up to first contact" in said
    assert {path.name for path in out.iterdir()} == {
        *TABLES, "columns.csv", "comparison.json", "comparison.md", "comparison.png", "comparison.svg", "people",
    }  # fmt: skip
    for name, columns in TABLES.items():
        rows = lines_of(out / name)
        assert rows or name == "blocked.csv"
        assert all(list(row) == list(columns) for row in rows)
    listed = {(row["file"], row["column"]) for row in lines_of(out / "columns.csv")}
    assert listed == {(name, column) for name, columns in TABLES.items() for column in columns}
    found = json.loads((out / "comparison.json").read_text(encoding="utf-8"))
    (paths,) = found["paths"]
    assert paths["ticks"] > 50 and paths["behind_mm"] > 1.0 > paths["beside_mm"]
    assert "33 ms later: the drives follow" in said
    assert found["reasons"] and len(found["verdicts"]) == 1
    report = (out / "comparison.md").read_text(encoding="utf-8")
    assert all(sentence in report for sentence in found["rule"]["sentences"])
    assert "nan" not in report and "inf" not in said.split("rule of")[0]
    other = refused(capsys, *typed[1:], "--study", str(study), "--seed", "6", "--out", str(out))
    assert "another seed" in other, "before anything is run: no progress was told"


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    status, said, told = run(capsys, "compare-physics", *arguments)
    assert status != 0 and said == "" and told.count("\n") == 1 and "Traceback" not in told
    return told


def test_what_cannot_be_compared_is_said_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    alone = refused(capsys, "--robots", "kinematic")
    assert "kinematic alone" in alone and "bullet" in alone
    assert "named twice" in refused(capsys, "--robots", "kinematic", "kinematic")
    assert "'wooden' is not one of" in refused(capsys, "--robots", "kinematic", "wooden")


def test_what_cannot_be_read_or_is_out_of_bounds_is_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    both = ("--robots", "kinematic", "trailing")
    assert "no such folder" in refused(capsys, *both, "--data", str(tmp_path / "missing"))
    assert "meta.json" in refused(capsys, *both, "--data", str(tmp_path))
    assert "leave --study" in refused(capsys, *both, "--data", str(tmp_path), "--preset", "lab")
    assert "recorded is 13; it must be from 1 to 12" in refused(capsys, *both, "--recorded", "13")
    assert "at least two participants" in refused(capsys, *both, "--participants", "1")
    assert "studies is 0" in refused(capsys, *both, "--studies", "0")
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    assert "not of an earlier run" in refused(capsys, *both, "--out", str(tmp_path))


def with_robots(shipped: Mapping[str, str]) -> Registry:
    return replace(ROBOTS, shipped=shipped, group="salab.none")


def test_a_robot_that_is_not_installed_is_named_and_passed_over_where_none_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    here = {"plain": "sim.kinematic:KinematicRobot", "other": "sim.kinematic:KinematicRobot"}
    monkeypatch.setattr(comparing, "ROBOTS", with_robots({**here, "absent": "no_such_physics:Robot"}))
    assert chosen_robots(()) == ("plain", "other")
    with pytest.raises(PartError, match=r"'absent'.*no_such_physics") as caught:
        chosen_robots(("plain", "absent"))
    assert "\n" not in str(caught.value)
    monkeypatch.setattr(comparing, "ROBOTS", with_robots({"plain": here["plain"], "absent": "no_such_physics:Robot"}))
    with pytest.raises(LabError, match=r"only plain is installed; robot 'absent' .* cannot be loaded"):
        chosen_robots(())
