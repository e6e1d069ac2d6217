"""Rounded bodies: drums along an axis, and skins swept along a bent way. Lengths are metres.

A section of a sweep is a superellipse: exponent 2 is an ellipse, a higher one a rectangle with ever tighter corners.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sim.interface import Rgb, Vector3
from sim.view.meshes import FloatArray, Mesh, circle, loft

Axis = Literal["x", "y", "z"]
_TO: dict[Axis, tuple[tuple[int, int, int], ...]] = {
    "x": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
}
"""Rotations that bring z to an axis."""


@dataclass(frozen=True)
class Section:
    """One ring of a sweep, in the plane across its way.

    The way runs in planes y = const.: `slope_deg` is its direction there, 0 along +x, 90 along +z.
    """

    center_m: Vector3
    half_y_m: float
    half_up_m: float
    """Half of the other width: along z where the way runs along x."""
    slope_deg: float = 0.0
    power: float = 2.0

    def ring(self, n: int) -> FloatArray:
        """Its points, counter-clockwise seen from where the way leads. Shape (n, 3)."""
        angle = (np.arange(n) + 0.5) * (2.0 * np.pi / n)
        cos, sin = np.cos(angle), np.sin(angle)
        aside = self.half_y_m * np.sign(cos) * np.abs(cos) ** (2.0 / self.power)
        up = self.half_up_m * np.sign(sin) * np.abs(sin) ** (2.0 / self.power)
        slope_rad = math.radians(self.slope_deg)
        away = np.stack([-math.sin(slope_rad) * up, aside, math.cos(slope_rad) * up], axis=-1)
        ring: FloatArray = np.array(self.center_m) + away
        return ring


def sweep(sections: Sequence[Section], color: Rgb, *, n: int = 20) -> Mesh:
    """A closed skin over sections; one that stands twice is a sharp rim."""
    return loft([section.ring(n) for section in sections], color)


def rounded(
    radius_m: float, low_m: float, high_m: float, edges_m: tuple[float, float], *, steps: int = 2
) -> list[tuple[float, float]]:
    """The profile (radius, place along the axis) of a drum whose lower and upper edge are rounded by `edges_m`."""
    angles = np.linspace(0.0, math.pi / 2.0, steps + 1)
    below_m, above_m = edges_m
    low = [(radius_m - below_m * (1.0 - math.sin(a)), low_m + below_m * (1.0 - math.cos(a))) for a in angles]
    high = [(radius_m - above_m * (1.0 - math.cos(a)), high_m - above_m * (1.0 - math.sin(a))) for a in angles]
    return (low if below_m > 0.0 else low[:1]) + (high if above_m > 0.0 else high[:1])


def drum(
    axis: Axis,
    radius_m: float,
    low_m: float,
    high_m: float,
    color: Rgb,
    *,
    at_m: Vector3 = (0.0, 0.0, 0.0),
    edges_m: tuple[float, float] = (0.0, 0.0),
    n: int = 20,
    closed: bool = True,
) -> Mesh:
    """A round drum from `low_m` to `high_m` along an axis through `at_m`; `edges_m` rounds its two edges.

    Without `closed` its ends are open, where something else hides them.
    """
    # Turned by half a step, as the rings of a sweep are, so that where both meet nothing shimmers.
    half = math.pi / n
    twist = np.array([[math.cos(half), -math.sin(half), 0.0], [math.sin(half), math.cos(half), 0.0], [0.0, 0.0, 1.0]])
    profile = rounded(radius_m, low_m, high_m, edges_m)
    rings = [circle(radius, along, n=n) @ twist.T for radius, along in profile]
    return loft(rings, color, bottom=closed, top=closed).turned(_TO[axis]).moved(at_m)
