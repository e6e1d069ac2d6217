"""A package that somebody else wrote and installed: a module, and the entry points it registers."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from tests.support.lab_server import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROBOT = '''
from sim.kinematic import KinematicRobot


class OtherRobot(KinematicRobot):
    """The kinematic robot under another name."""
'''

DISTRACTOR = '''
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from study.flow.distractors.interface import Distractor, Stimulus, Words, stimulus_rng


@dataclass(frozen=True)
class SumParameters:
    """How hard the sums are."""

    most: Annotated[int, Field(ge=1, le=99)] = 9
    """The largest number that is added."""


class Sums(Distractor[SumParameters]):
    """Two numbers to be added, every 25 seconds from the sixth on whatever the study says."""

    Parameters = SumParameters
    words = Words("sum", "sums")

    def due_s(self, number):
        return 6.0 + 25.0 * (number - 1)

    def stimulus(self, seed, trial, number):
        first, second = stimulus_rng(seed, trial, number).integers(1, self.parameters.most + 1, size=2)
        return Stimulus(f"{first} + {second}", "Type the sum, then press Enter")

    def right_answer(self, stimuli):
        return str(sum(int(part) for part in stimuli[-1].text.split(" + ")))
'''


def install(
    site: Path,
    parts: Mapping[str, str],
    source: str,
    *,
    group: str = "salab.robots",
    module: str = "outside_robots",
) -> None:
    """Put `module` into a folder of installed packages, as pip leaves it there, with its parts by their names."""
    (site / f"{module}.py").write_text(source, encoding="utf-8")
    info = site / f"{module}-1.0.dist-info"
    info.mkdir(exist_ok=True)
    name = module.replace("_", "-")
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    lines = [f"{part} = {place}" for part, place in parts.items()]
    (info / "entry_points.txt").write_text(f"[{group}]\n" + "\n".join(lines) + "\n", encoding="utf-8")


def install_distractor(site: Path, parts: Mapping[str, str], source: str = DISTRACTOR) -> None:
    """Put `outside_distractors` there, with its distractors by their names."""
    install(site, parts, source, group="salab.distractors", module="outside_distractors")


def install_project(site: Path, project: Path) -> None:
    """Put the project of a folder into a folder of installed packages, as `pip install` would from its pyproject.toml:
    modules, packages with their data, and what is registered. Nothing is built, and no registry is asked."""
    said = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))
    about, tool = said["project"], said["tool"]["setuptools"]
    for module in tool.get("py-modules", ()):
        shutil.copy(project / f"{module}.py", site)
    for package in tool.get("packages", ()):
        shutil.copytree(project / package, site / package, ignore=shutil.ignore_patterns("__pycache__"))
    info = site / f"{about['name'].replace('-', '_')}-{about['version']}.dist-info"
    info.mkdir()
    metadata = f"Metadata-Version: 2.1\nName: {about['name']}\nVersion: {about['version']}\n"
    (info / "METADATA").write_text(metadata, encoding="utf-8")
    lines = []
    for group, points in about["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {place}" for name, place in points.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def installed_at(site: Path) -> dict[str, str]:
    """The environment of a machine on which the packages of that folder are installed."""
    return {"PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}


def salab(*arguments: str, environment: Mapping[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """`salab arguments...` in a process of its own, as somebody with that environment types it."""
    command = [sys.executable, "-m", "app", *arguments]
    told = {**os.environ, **(environment or {})}
    return subprocess.run(command, cwd=ROOT, env=told, capture_output=True, text=True, timeout=300)
