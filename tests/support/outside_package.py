"""A package that somebody else wrote and installed: a module, and the entry points it registers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

ROBOT = '''
from sim.kinematic import KinematicRobot


class OtherRobot(KinematicRobot):
    """The kinematic robot under another name."""
'''


def install(site: Path, robots: Mapping[str, str], source: str) -> None:
    """Put `outside_robots` into a folder of installed packages, as pip leaves it there."""
    (site / "outside_robots.py").write_text(source, encoding="utf-8")
    info = site / "outside_robots-1.0.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: outside-robots\nVersion: 1.0\n", encoding="utf-8")
    lines = [f"{name} = {place}" for name, place in robots.items()]
    (info / "entry_points.txt").write_text("[salab.robots]\n" + "\n".join(lines) + "\n", encoding="utf-8")
