"""Robots by their names: those that ship, and those that another installed package brings."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from app.errors import LabError
from app.trial.robots import ROBOTS, ChosenRobot, chosen_robot, look_here, make_robot, why_no_look
from app.worker.process_source import process_source
from sim.view import published
from study.definition.sections import ViewSettings
from study.parts.errors import PartError
from study.parts.registry import Registry
from tests.support.outside_package import ROBOT, install

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def registry() -> Registry:
    """The robots, looked up anew: a registry remembers what it found."""
    return Registry(ROBOTS.noun, ROBOTS.group, ROBOTS.shipped, ROBOTS.methods)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of installed packages, on the path of this process."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "outside_robots", raising=False)
    return tmp_path


@pytest.mark.parametrize(
    "name",
    [pytest.param("bullet", marks=pytest.mark.bullet), pytest.param("mujoco", marks=pytest.mark.mujoco), "kinematic"],
)
def test_a_shipped_robot_is_made_by_its_name(name: str) -> None:
    robot = make_robot(name)
    assert type(robot).__name__.lower() == f"{name}robot"
    robot.close()


def test_an_unknown_name_tells_the_ones_there_are() -> None:
    with pytest.raises(PartError, match="no robot 'sawyer'; robots are bullet, mujoco, kinematic"):
        make_robot("sawyer")


@pytest.mark.parametrize(
    ("absent", "name"), [((), "bullet"), (("pybullet",), "mujoco"), (("pybullet", "mujoco"), "bullet")]
)
def test_where_nobody_names_one_it_is_pybullets_or_else_mujocos(
    absent: tuple[str, ...], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for library in ("pybullet", "mujoco"):
        monkeypatch.setitem(sys.modules, library, None if library in absent else pytest)
    chosen = chosen_robot(None)
    assert chosen.name == name
    assert ("pybullet is not installed" in chosen.note) == (name == "mujoco")
    assert chosen_robot("kinematic") == ChosenRobot("kinematic")


@pytest.mark.parametrize(
    ("name", "asked"), [("bullet", r"'shared-autonomy-lab\[bullet\]'"), ("mujoco", "mujoco-core==")]
)
def test_physics_that_is_not_installed_is_one_line_that_says_what_to_install(
    name: str, asked: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, ROBOTS.libraries[name].module, None)
    with pytest.raises(PartError, match=f"^robot '{name}' needs .*, which is not installed: pip install {asked}"):
        make_robot(name)


def test_what_to_install_is_what_the_lab_itself_asks_for() -> None:
    asked = [
        line.strip().split(";")[0].strip('"')
        for line in (ROOT / "pyproject.toml").read_text(encoding="utf-8").splitlines()
        if "mujoco-core==" in line
    ]
    assert asked == ["mujoco-core==4.0.1"]
    assert f"pip install {asked[0]} " in ROBOTS.libraries["mujoco"].remedy


def test_another_package_brings_a_robot(site: Path, registry: Registry) -> None:
    install(site, {"other": "outside_robots:OtherRobot"}, ROBOT)
    assert registry.names == ("bullet", "mujoco", "kinematic", "other")
    assert registry.module_of("other") == "outside_robots"
    assert "outside_robots" not in sys.modules  # nothing is imported to know a name
    assert registry.load("other").__name__ == "OtherRobot"


@pytest.mark.parametrize(
    ("place", "source", "complaint"),
    [
        ("nowhere:Robot", "", r"'other' \(nowhere:Robot\) cannot be loaded: ModuleNotFoundError: .*nowhere"),
        ("outside_robots:Missing", ROBOT, "cannot be loaded: AttributeError: .*Missing"),
        ("outside_robots:OtherRobot", "1 / 0", "cannot be loaded: ZeroDivisionError"),
        (
            "outside_robots:Half",
            "class Half:\n    def reset(self): ...\n    def close(self): ...",
            "lacks command, advance, observe, feasible; it must have reset, command, advance, observe, feasible, close",
        ),
    ],
)
def test_a_robot_that_cannot_be_loaded_is_one_line(
    site: Path, registry: Registry, place: str, source: str, complaint: str
) -> None:
    install(site, {"other": place}, source)
    with pytest.raises(PartError, match=complaint) as caught:
        registry.load("other")
    assert "\n" not in str(caught.value)


def test_a_name_that_is_taken_is_refused_whoever_asks(site: Path, registry: Registry) -> None:
    install(site, {"kinematic": "outside_robots:OtherRobot"}, ROBOT)
    with pytest.raises(
        PartError, match=r"outside-robots registers robot 'kinematic', which is sim\.kinematic:.* already"
    ):
        _ = registry.names


def test_a_look_that_cannot_be_had_is_one_line_with_what_helps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(published, "published_meshes_dir", lambda: None)
    told = why_no_look(ViewSettings(look="published"))
    assert "\n" not in told and "rtb-data" in told and "extra `meshes`" in told and 'look = "own"' in told
    assert why_no_look(ViewSettings(look="own")) == why_no_look(ViewSettings(look="installed")) == ""
    assert look_here(ViewSettings(look="installed")) == "own"
    monkeypatch.setattr(published, "why_missing", lambda: "")
    assert why_no_look(ViewSettings(look="published")) == ""


def test_a_robot_that_cannot_be_made_is_told_before_anything_is_served() -> None:
    source = process_source("kinematic")
    source.warm_up("kinematic")
    with pytest.raises(LabError, match="no robot 'sawyer'; robots are bullet, mujoco, kinematic"):
        source.warm_up("sawyer")
