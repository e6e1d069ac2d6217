"""The light of the scene, and the same light put into the colours of what never moves.

What never moves is drawn unlit: a browser without a graphics card then shades nothing of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sim.interface import Rgb, Vector3
from sim.view.meshes import FloatArray, Mesh, display_rgb, linear_rgb, rgba

SKY: Rgb = (255, 255, 255)
GROUND: Rgb = (120, 120, 130)
SKY_INTENSITY = 1.7
KEY_INTENSITY = 2.3
KEY_FROM_M: Vector3 = (-1.2, 1.6, 3.0)
"""Where the sun-like light comes from; only its direction counts."""


def baked(mesh: Mesh, rotation: FloatArray | None = None, shade: Sequence[tuple[Vector3, float]] = ()) -> Mesh:
    """The mesh with the scene's light in its colours, for things that never turn.

    The result is what a browser makes of a matt surface under the lights above.

    Args:
        mesh: what is lit.
        rotation: (3, 3), how it is turned in the world; not at all when None.
        shade: spheres that take light away, as (centre in the mesh's frame, radius): each as much of the sky above a
            point as it covers (an unshadowed sphere's form factor).
    """
    normals = mesh.normals
    facing = normals if rotation is None else normals @ np.asarray(rotation).T
    toward = np.array(KEY_FROM_M) / np.linalg.norm(KEY_FROM_M)
    share = 0.5 + 0.5 * facing[:, 2:]
    sky = SKY_INTENSITY * (share * linear_rgb(rgba(SKY)[:3]) + (1.0 - share) * linear_rgb(rgba(GROUND)[:3]))
    light = (sky + KEY_INTENSITY * np.clip(facing @ toward, 0.0, None)[:, None]) / math.pi
    for center_m, radius_m in shade:
        away = np.asarray(center_m) - mesh.vertices_m
        distance_m = np.maximum(np.linalg.norm(away, axis=1), radius_m)
        covers = np.clip(np.einsum("ij,ij->i", normals, away) / distance_m, 0.0, None) * (radius_m / distance_m) ** 2
        light = light * (1.0 - np.clip(covers, 0.0, 0.85))[:, None]
    srgba = mesh.srgba.copy()
    srgba[:, :3] = display_rgb(np.clip(linear_rgb(srgba[:, :3]) * light, 0.0, 1.0))
    return Mesh(mesh.vertices_m, mesh.faces, srgba)
