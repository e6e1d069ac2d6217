"""Names to concrete parts: which robots there are, and the views of a session.

Imports are made when a part is asked for: only worker processes ever load pybullet or viser, and whoever wants the
names alone loads nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from study.extras import how_to_install
from study.parts.code import code_of_package
from study.parts.registry import Library, Registry

if TYPE_CHECKING:
    from sim.interface import Robot
    from sim.view.scene import SceneView
    from sim.view.spectator import SpectatorView
    from study.definition.sections import ViewSettings

ROBOTS = Registry(
    noun="robot",
    group="salab.robots",
    shipped={
        "bullet": "sim.bullet:BulletRobot",
        "mujoco": "sim.mujoco:MujocoRobot",
        "kinematic": "sim.kinematic:KinematicRobot",
    },
    methods=("reset", "command", "advance", "observe", "feasible", "close"),
    libraries={
        "bullet": Library(
            "pybullet",
            f"{how_to_install('bullet')} (Python 3.10 to 3.13), or take --robot mujoco, or --robot kinematic, "
            "which has no physics",
        ),
        "mujoco": Library(
            "mujoco",
            "pip install mujoco-core==4.0.1 (Python 3.11 or later), or take --robot bullet, or "
            "--robot kinematic, which has no physics",
        ),
    },
)
"""Every robot is a row of this table, or registered by an installed package under `salab.robots`."""


def make_robot(name: str) -> Robot:
    """The robot of that name. Raises `LabError` as `Registry.load`."""
    robot: Robot = ROBOTS.load(name)()
    return robot


@dataclass(frozen=True)
class ChosenRobot:
    """The name of the robot that moves, and what to know of the choice; "" for nothing."""

    name: str
    note: str = ""


def chosen_robot(asked: str | None) -> ChosenRobot:
    """The one that was asked for; else the one on pybullet's physics, or on MuJoCo's where that alone is installed."""
    if asked is not None:
        return ChosenRobot(asked)
    first, *others = ROBOTS.libraries
    for name in others if ROBOTS.lacking(first) else ():
        if not ROBOTS.lacking(name):
            absent = ROBOTS.libraries[first].module
            return ChosenRobot(name, f"{absent} is not installed: the robot moves on the physics of {name} instead")
    return ChosenRobot(first)


def robot_facts(name: str) -> dict[str, str]:
    """Which robot that is, for the record: its name, and where it is from if it does not ship. Raises `PartError`."""
    found = ROBOTS.registered.get(name) if name not in ROBOTS.shipped else None
    if found is None:
        return {"robot": name}
    code = code_of_package("robot", name, found)
    return {"robot": name, "package": code.package, "version": code.version, "sha256": code.sha256}


def why_no_look(view: ViewSettings) -> str:
    """Why the robot cannot be drawn here as a study says, and what to do about it, in one line; "" when it can."""
    from sim.view.published import why_missing

    missing = why_missing() if view.look == "published" else ""
    return missing and f'[view] look = "published": {missing}, or let the study file say look = "own"'


def look_here(view: ViewSettings) -> str:
    """How the robot is drawn on this machine: `own` or `published`."""
    from sim.view.looks import chosen

    return chosen(view.look)


def prepared_look(view: ViewSettings) -> str:
    """Have what the robot looks like made ready where it is not; why another look is drawn, "" for none."""
    from sim.view.looks import robot_look

    return robot_look(view.look).note


def make_scene(cues: ViewSettings) -> SceneView:
    """The 3-D view of one session, as the study has it drawn."""
    from sim.view.scene import SceneOptions, SceneView
    from sim.view.viewpoints import INSET

    inset = INSET if cues.inset else None
    options = SceneOptions(look=cues.look, plumb_line=cues.drop_mark, marked=cues.ring, inset=inset)
    return SceneView(options=options)


def make_spectator_view(beside: SceneView) -> SpectatorView:
    """The 3-D view of one session for experimenters, with the meshes of the participant's."""
    from sim.view.spectator import SpectatorView

    return SpectatorView(beside.look)
