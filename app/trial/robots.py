"""Names to concrete parts. A new robot is one new file in `sim/` and one line here.

Imports are made when a part is asked for: only worker processes ever load pybullet or viser, and whoever wants the
names alone loads nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.errors import LabError

if TYPE_CHECKING:
    from sim.interface import Robot
    from sim.scene import SceneView
    from sim.spectator import SpectatorView

ROBOTS = ("bullet", "kinematic")


def make_robot(name: str) -> Robot:
    """The robot of that name; `LabError` names the ones there are."""
    if name == "bullet":
        from sim.bullet import BulletRobot

        return BulletRobot()
    if name == "kinematic":
        from sim.kinematic import KinematicRobot

        return KinematicRobot()
    raise LabError(f"no robot {name!r}; robots are {', '.join(ROBOTS)}")


def make_scene() -> SceneView:
    """The 3-D view of one session."""
    from sim.scene import SceneView

    return SceneView()


def make_spectator_view(beside: SceneView) -> SpectatorView:
    """The 3-D view of one session for experimenters, with the meshes of the participant's."""
    from sim.spectator import SpectatorView

    return SpectatorView(beside.look)
