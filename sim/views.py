"""The cameras of the picture: where each stands, what it is called, and how wide it looks. Pure.

The page offers the names and labels, the scene (`sim.scene`) places the cameras; both read them here.

Who drives "forward" and "left" must see the gripper go up and left on the screen: a turned camera makes people map
one onto the other in their heads, which costs time and errors that are none of the study's business. So `overview`
looks straight along the robot's forward axis. From there the elbow, which the arm carries above its gripper, hides
the fingers unless the camera is high: 74° above the horizontal it does not, at the start, at a slot or over a bin.
It stands far off with a narrow lens, so that a gripper high above a bin appears to be above that bin.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from sim.interface import SimError, Vector3


@dataclass(frozen=True)
class CameraView:
    """A camera, its up direction the world's z: where it stands and what it looks at (world frame, metres)."""

    name: str
    label: str
    position_world_m: Vector3
    look_at_world_m: Vector3
    fov_rad: float
    """Vertical field of view at `NARROWEST_ASPECT` and wider."""
    head: bool = True
    """Whether the robot's head is drawn: to a camera above it, it would hide the table."""

    @property
    def yaw_rad(self) -> float:
        """How far the camera is turned from the robot's forward axis (+x), positive to its left, -π to π."""
        forward_m, left_m = (self.look_at_world_m[axis] - self.position_world_m[axis] for axis in (0, 1))
        return math.atan2(left_m, forward_m)

    def vertical_fov_rad(self, aspect: float) -> float:
        """The vertical field of view in a picture of that width / height.

        A picture narrower than `NARROWEST_ASPECT` gets a larger one, so that it shows as much from left to right.

        Raises:
            SimError: the aspect is not a positive number.
        """
        if not (math.isfinite(aspect) and aspect > 0.0):
            raise SimError(f"aspect {aspect}: width / height is a number above 0")
        if aspect >= NARROWEST_ASPECT:
            return self.fov_rad
        return 2.0 * math.atan(math.tan(self.fov_rad / 2.0) * NARROWEST_ASPECT / aspect)


NARROWEST_ASPECT = 1.45
DEFAULT_VIEW = "overview"
VIEWS: Mapping[str, CameraView] = MappingProxyType(
    {
        view.name: view
        for view in (
            CameraView(
                "overview",
                "From behind and above",
                (-0.16, 0.0, 3.60),
                (0.67, 0.0, 0.72),
                math.radians(17.5),
                head=False,
            ),
            CameraView("side", "From the right", (0.84, -1.85, 1.32), (0.6, 0.0, 0.76), math.radians(46)),
            CameraView("top", "From above", (0.36, 0.0, 2.5), (0.6, 0.0, 0.75), math.radians(44), head=False),
        )
    }
)
"""The views by name; the first is the one a session starts with."""

SPECTATOR = CameraView(
    "spectator", "From where a spectator stands", (2.45, -0.75, 2.0), (0.55, 0.0, 0.84), math.radians(32)
)
"""Where the experimenters' own cameras start."""
