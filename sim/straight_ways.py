"""Whether going straight ever ends where the arm cannot fold further. Pure.

The arm carries its elbow behind the gripper: straight ahead of the robot, and the more so the higher the gripper is,
there is a hole in its reach. Whoever goes straight back between two bins (a person; an arbiter that is unsure which
bin is meant, whose best place lies between them) ends there if the bins stand on either side of the hole. A layout
need not promise otherwise, and `arc` and `rows` do not; `crescent` does:

- **ways**: from the start and from each grasp point, there and lifted by `LIFT_M`, every straight way to each release
  point and to every point between two release points is within reach, there and back, and so is the way between them;
- **room**: no point of the box that spans start, grasp points, lifted grasp points and release points is where the arm
  cannot fold further or the wrist is at its limit, nor is any up to `spare_m` nearer to the robot, or above. Whoever
  brings some coordinates nearer to a goal's, and none past the last goal's, stays in that box. So from anywhere
  between start, goals and bins no motion along any of the 26 directions is stopped by folding before it is past all
  goals.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sim import ik
from sim.interface import Vector3
from sim.layouts import LIFT_M, Layout

BETWEEN = 21
"""So many points between two release points are tried."""
GRID_M = 0.01
FOLDED = (ik.REASONS.index("the arm cannot fold further"), ik.REASONS.index("the wrist is at its limit"))
"""What stops an arm that is drawn in, by code."""

Array = NDArray[np.float64]


def carried_from(layout: Layout) -> tuple[Vector3, ...]:
    """The start, and every grasp point there can be, there and lifted by `LIFT_M`."""
    heights_m = sorted({spec.grasp_height_m for spec in layout.objects})
    return (
        layout.start_world_m,
        *(
            (x_m, y_m, layout.table.top_z_m + height_m + lift_m)
            for x_m, y_m in layout.places
            for height_m in heights_m
            for lift_m in (0.0, LIFT_M)
        ),
    )


def carried_to(layout: Layout) -> tuple[Vector3, ...]:
    """The release points, and `BETWEEN` points from each to each other, both included."""
    releases = [np.array(item.release_world_m) for item in layout.bins]
    shares = np.linspace(0.0, 1.0, BETWEEN)
    points = releases if len(releases) == 1 else []
    for one, other in combinations(releases, 2):
        points = [*points, *(one + share * (other - one) for share in shares)]
    return tuple((float(x_m), float(y_m), float(z_m)) for x_m, y_m, z_m in points)


def lost_ways(layout: Layout) -> tuple[tuple[Vector3, Vector3, str], ...]:
    """Every straight way, from where to where, that leaves the reach, and what stops it. None in `crescent`."""
    froms, tos = carried_from(layout), carried_to(layout)
    releases = [item.release_world_m for item in layout.bins]
    ways = [(a, b) for here in froms for there in tos for a, b in ((here, there), (there, here))]
    ways += [(a, b) for a, b in combinations(releases, 2)]
    return tuple((a, b, ik.REASONS[code]) for a, b in ways if (code := ik.path_code(a, b)))


def folded_points(layout: Layout, spare_m: float = 0.0) -> Array:
    """Points, shape (N, 3), at which the arm cannot be drawn in so far, of a grid over the box that spans start, grasp
    points and release points, made larger by `spare_m` towards the robot and upwards. None in `crescent`."""
    corners = np.array([*carried_from(layout), *(item.release_world_m for item in layout.bins)])
    low, high = corners.min(axis=0) - [spare_m, 0.0, 0.0], corners.max(axis=0) + [0.0, 0.0, spare_m]
    sides = [
        np.linspace(low[axis], high[axis], int(np.ceil((high[axis] - low[axis]) / GRID_M)) + 1) for axis in range(3)
    ]
    points = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3)
    folded: Array = points[np.isin(ik.solve_many(points)[1], FOLDED)]
    return folded
