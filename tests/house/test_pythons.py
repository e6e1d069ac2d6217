"""Which Pythons the lab runs on: pyproject.toml, make, the documentation and the program say the same of it."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = ("3.10", "3.11", "3.12", "3.13", "3.14")
PLATFORMS: Mapping[str, tuple[str, str]] = {
    "Linux x86-64": ("linux", "x86_64"),
    "Linux ARM": ("linux", "aarch64"),
    "macOS ARM": ("darwin", "arm64"),
    "macOS Intel": ("darwin", "x86_64"),
    "Windows": ("win32", "AMD64"),
}
"""Name in the documentation to `sys_platform` and `platform_machine`."""


def physics(python: str, platform: str) -> list[str]:
    """The packages with physics that the installation takes there."""
    system, machine = PLATFORMS[platform]
    there = {"python_version": python, "sys_platform": system, "platform_machine": machine}
    asked = [Requirement(line) for line in (*PROJECT["optional-dependencies"]["bullet"], *PROJECT["dependencies"])]
    return [
        one.name
        for one in asked
        if one.name.startswith(("pybullet", "mujoco")) and (one.marker is None or one.marker.evaluate({**there}))
    ]


@pytest.mark.parametrize("platform", PLATFORMS)
def test_the_documentation_tells_what_physics_an_installation_takes(platform: str) -> None:
    page = (ROOT / "docs/how-to/install.md").read_text(encoding="utf-8")
    lines = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith(("| Python |", "| 3."))]
    head, rows = lines[0], {line[0]: line for line in lines[1:]}
    assert tuple(rows) == PYTHONS
    for python in PYTHONS:
        taken = physics(python, platform)
        assert len([name for name in taken if name.startswith("pybullet")]) <= 1, "two packages with the same files"
        assert rows[python][head.index(platform)] == (", ".join(taken) or "none"), python


def test_every_python_of_the_table_is_asked_for_and_looked_for() -> None:
    asked = SpecifierSet(PROJECT["requires-python"])
    assert [f"3.{minor}" for minor in range(30) if f"3.{minor}" in asked] == list(PYTHONS)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (looked_for,) = re.findall(r"^PYTHONS := (.*)$", makefile, re.MULTILINE)
    assert sorted(looked_for.split()) == list(PYTHONS)
    page = " ".join((ROOT / "docs/how-to/install.md").read_text(encoding="utf-8").split())
    *others, last = looked_for.split()
    assert f"`make` looks for {', '.join(others)} and {last}, in this order" in page


def test_an_older_python_is_told_what_to_install(tmp_path: Path) -> None:
    source = (ROOT / "app" / "__main__.py").read_text(encoding="utf-8")
    ast.parse(source, feature_version=(3, 7))  # it gets as far as saying so
    as_an_old_one = (
        "import runpy, sys; sys.version_info = (3, 9, 18, 'final', 0); "
        "runpy.run_path('app/__main__.py', run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-c", as_an_old_one], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("salab: this is Python 3.9, the lab needs 3.10 to 3.14: install one (")
    assert done.stderr.count("\n") == 1
