"""A package that somebody else wrote and installed: a module, and the entry points it registers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

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
