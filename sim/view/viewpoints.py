"""The cameras of the picture: where each stands, what it is called, and how wide it looks. Pure.

The page offers the names and labels, the scene (`sim.view.scene`) places the cameras; both read them here.

Who drives "forward" and "left" must see the gripper go up and left on the screen: a turned camera makes people map
one onto the other in their heads, which costs time and errors that are none of the study's business. So `overview`
looks straight along the robot's forward axis. From there the elbow, which the arm carries above its gripper, hides
the fingers unless the camera is high: 74° above the horizontal it does not, at the start, at a slot or over a bin.
It stands far off with a narrow lens, so that a gripper high above a bin appears to be above that bin.

What it cannot show is depth: a centimetre up is 2.2 pixels of a page of 1280 by 720, a centimetre forward 7, and both
go the same way on the screen. So `INSET`, a second and smaller picture, looks from the robot's right and goes where the
gripper goes. Forward is right and up is up, as large as each other, and its near plane cuts away what would stand
before the fingers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from sim.interface import SimError, Vector3

NARROWEST_ASPECT = 1.45


@dataclass(frozen=True)
class CameraView:
    """A camera, its up direction the world's z: where it stands and what it looks at (world frame, metres)."""

    name: str
    label: str
    position_world_m: Vector3
    look_at_world_m: Vector3
    fov_rad: float
    """Vertical field of view at `narrowest_aspect` and wider."""
    head: bool = True
    """Whether the robot's head is drawn: to a camera above it, it would hide the table."""
    near_m: float = 0.05
    """What is nearer to the camera is cut away."""
    far_m: float = 20.0
    """What is farther from the camera is not drawn."""
    narrowest_aspect: float = NARROWEST_ASPECT
    """Width / height; a narrower picture gets a larger field of view."""

    @property
    def yaw_rad(self) -> float:
        """How far the camera is turned from the robot's forward axis (+x), positive to its left, -π to π."""
        forward_m, left_m = (self.look_at_world_m[axis] - self.position_world_m[axis] for axis in (0, 1))
        return math.atan2(left_m, forward_m)

    def vertical_fov_rad(self, aspect: float) -> float:
        """The vertical field of view in a picture of that width / height.

        A picture narrower than `narrowest_aspect` gets a larger one, so that it shows as much from left to right.

        Raises:
            SimError: the aspect is not a positive number.
        """
        if not (math.isfinite(aspect) and aspect > 0.0):
            raise SimError(f"aspect {aspect}: width / height is a number above 0")
        if aspect >= self.narrowest_aspect:
            return self.fov_rad
        return 2.0 * math.atan(math.tan(self.fov_rad / 2.0) * self.narrowest_aspect / aspect)

    def in_picture(self, point_world_m: Vector3, aspect: float) -> tuple[float, float]:
        """Where a point appears in a picture of that width / height: (right, up), the picture's edges at ±1.

        Raises:
            SimError: the aspect is not a positive number, or the point is not in front of the camera.
        """
        eye = np.array(self.position_world_m)
        ahead = np.array(self.look_at_world_m) - eye
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        offset_m = np.array(point_world_m) - eye
        depth_m = float(offset_m @ ahead)
        if depth_m <= 0.0:
            raise SimError(f"the point {point_world_m} is {-depth_m:g} m behind the camera; it must be in front of it")
        half = math.tan(self.vertical_fov_rad(aspect) / 2.0)
        return (
            float(offset_m @ right) / (depth_m * half * aspect),
            float(offset_m @ np.cross(right, ahead)) / (depth_m * half),
        )


@dataclass(frozen=True)
class FollowingView:
    """A camera that goes where the gripper goes and looks along +y, from the robot's right (metres)."""

    eye_from_gripper_m: Vector3
    look_at_from_gripper_m: Vector3
    half_width_m: float
    """How much is seen to either side of what it looks at, whatever the picture's height."""
    near_m: float
    far_m: float

    def at(self, gripper_world_m: Vector3, aspect: float) -> CameraView:
        """Where it stands now, for a picture of that width / height.

        Raises:
            SimError: the aspect is not a positive number.
        """
        if not (math.isfinite(aspect) and aspect > 0.0):
            raise SimError(f"aspect {aspect}: width / height is a number above 0")
        away_m = self.look_at_from_gripper_m[1] - self.eye_from_gripper_m[1]
        return CameraView(
            "inset",
            "",
            _shifted(gripper_world_m, self.eye_from_gripper_m),
            _shifted(gripper_world_m, self.look_at_from_gripper_m),
            fov_rad=2.0 * math.atan(self.half_width_m / aspect / away_m),
            near_m=self.near_m,
            far_m=self.far_m,
            narrowest_aspect=0.0,
        )


def _shifted(here_m: Vector3, by_m: Vector3) -> Vector3:
    return here_m[0] + by_m[0], here_m[1] + by_m[1], here_m[2] + by_m[2]


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

INSET = FollowingView(
    eye_from_gripper_m=(0.03, -1.20, 0.12),
    look_at_from_gripper_m=(0.03, 0.0, -0.02),
    half_width_m=0.22,
    near_m=1.11,
    far_m=4.0,
)
"""The picture from the side. Its near plane is 9 cm before the middle of the gripper: the fingers of an open gripper
stand behind it, a neighbour of the object that they close around before it."""
