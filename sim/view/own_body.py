"""Base, torso and head of the lab's own look, a mesh a link. They never move, so the scene's light is in their colours.

Outer measures follow the real robot's; see `sim.view.own_arm` for the colours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from sim import fetch
from sim.interface import Rgb, Vector3
from sim.view.bodies import Section, drum, sweep
from sim.view.light import baked
from sim.view.meshes import FloatArray, Mesh, box, circle, loft, merge, rectangle
from sim.view.own_arm import BLACK, BLUE, DARK, GREY, SHELL

RED: Rgb = (200, 30, 34)
GLASS: Rgb = (40, 66, 92)
_FORWARD_TO_LEFT = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def _base() -> Mesh:
    def ring(inset_m: float, z_m: float) -> FloatArray:
        return circle(1.0, 0.0, n=32) * [0.287 - inset_m, 0.266 - inset_m, 0.0] + [0.002, 0.0, z_m]

    def belt(color: Rgb, *profile: tuple[float, float]) -> Mesh:
        return loft([ring(inset_m, z_m) for inset_m, z_m in profile], color, bottom=False, top=False)

    skirt = belt(GREY, (0.04, 0.022), (0.006, 0.036), (0.004, 0.195), (0.012, 0.203))
    groove = belt(BLACK, (0.012, 0.195), (0.012, 0.22))
    lower = belt(SHELL, (0.012, 0.210), (0.002, 0.214), (0.0, 0.224), (0.0, 0.260), (0.003, 0.269), (0.014, 0.273))
    slot = belt(BLACK, (0.014, 0.273), (0.032, 0.273), (0.032, 0.273), (0.032, 0.302), (0.032, 0.302), (0.014, 0.302))
    upper = belt(SHELL, (0.014, 0.302), (0.002, 0.306), (0.0, 0.316), (0.003, 0.334), (0.016, 0.353), (0.042, 0.361))
    insets = ((0.042, 0.361), (0.045, 0.364), *((inset_m, 0.365) for inset_m in (0.08, 0.12, 0.17, 0.24)))
    deck = loft([ring(inset_m, z_m) for inset_m, z_m in insets], GREY, bottom=False)
    wheels = [
        drum("y", 0.06, 0.165 + shift, 0.2 + shift, BLACK, at_m=(0.0, 0.0, 0.06), n=12) for shift in (0.0, -0.365)
    ]
    stop_m = (-0.128, 0.226, 0.32)
    stop = merge(
        drum("z", 0.027, 0.0, 0.03, DARK, at_m=stop_m, edges_m=(0.0, 0.004), n=16),
        drum("z", 0.0165, 0.028, 0.048, RED, at_m=stop_m, edges_m=(0.0, 0.006), n=16),
    )
    robot = merge(*wheels, skirt, groove, lower, slot, upper, deck, stop, _column())
    return baked(robot, shade=[((-0.10, 0.0, 0.46), 0.17), ((0.0, 0.0, -0.2), 0.2)])


def _column() -> Mesh:
    """The blue channel that the torso slides on, up to where the torso hides it."""

    def ring(z_m: float, wider_m: float = 0.0) -> FloatArray:
        size_m = (0.165 + wider_m, 0.310 + wider_m)
        return rectangle(*size_m, z_m, corner_m=0.05, per_corner=5) + [-0.176, 0.0, 0.0]

    foot = loft([ring(0.36, 0.012), ring(0.371, 0.012), ring(0.374, 0.006), ring(0.374, 0.0)], DARK, bottom=False)
    heights = (0.365, 0.45, 0.68, 0.76, 0.80)
    return merge(foot, loft([ring(z_m) for z_m in heights], BLUE, bottom=False, top=False))


def _bellows() -> Mesh:
    folds, low_m, high_m = 11, -0.386, 0.06
    rings = []
    for step in range(2 * folds + 1):
        z_m, wider_m = low_m + (high_m - low_m) * step / (2 * folds), 0.0 if step % 2 else 0.014
        ring = rectangle(0.062 + wider_m, 0.262 + wider_m, z_m, corner_m=0.012, per_corner=2) + [-0.003, 0.0, 0.0]
        rings += [ring, ring]  # a sharp fold
    return loft(rings[1:-1], DARK, bottom=False, top=False)


def _torso() -> Mesh:
    def ring(inset_m: float, z_m: float) -> FloatArray:
        size_m = (0.224 - 2.0 * inset_m, 0.342 - 2.0 * inset_m)
        corner_m = max(0.055 - inset_m, 0.02)
        return rectangle(*size_m, z_m, corner_m=corner_m, per_corner=6) + [-0.0715, 0.0, 0.0]

    foot = ((0.012, 0.042), (0.002, 0.045), (0.0, 0.052))
    sides = ((0.0, 0.19), (0.0, 0.33), (0.0, 0.49))
    top = ((0.0015, 0.52), (0.006, 0.548), (0.014, 0.572), (0.026, 0.590), (0.042, 0.600), (0.06, 0.603))
    profile = (*foot, *sides, *top)
    shell = loft([ring(inset_m, z_m) for inset_m, z_m in profile], SHELL)
    back = merge(
        box((0.006, 0.136, 0.42), (-0.183, 0.0, 0.29), GREY, bevel_m=0.0028),
        *(box((0.004, 0.1, 0.006), (-0.1855, 0.0, 0.16 + 0.018 * row), DARK) for row in range(4)),
    )
    shelf = sweep(
        [
            Section((-0.02, 0.0, 0.548), 0.085, 0.052, 0.0, 5.0),
            Section((0.06, 0.0, 0.556), 0.083, 0.046, 0.0, 5.0),
            Section((0.112, 0.0, 0.570), 0.079, 0.032, 0.0, 5.0),
            Section((0.127, 0.0, 0.574), 0.074, 0.026, 0.0, 4.0),
            Section((0.132, 0.0, 0.575), 0.064, 0.018, 0.0, 3.0),
        ],
        SHELL,
        n=24,
    )
    window = box((0.004, 0.07, 0.018), (0.1315, 0.0, 0.576), BLACK)
    pan_x_m, _, pan_z_m = fetch.ARM_JOINTS[0].origin_m
    bracket = merge(
        drum("z", 0.0555, -0.168, -0.0515, SHELL, at_m=(pan_x_m, 0.0, pan_z_m), edges_m=(0.012, 0.006), n=24),
        box((0.12, 0.111, 0.1165), (pan_x_m - 0.06, 0.0, pan_z_m - 0.10975), SHELL),
    )
    shade = [
        ((0.02, 0.0, 0.68), 0.10),
        ((0.13, 0.0, 0.36), 0.06),
        ((0.09, 0.0, 0.13), 0.05),
        ((-0.04, 0.0, 0.12), 0.14),
    ]
    robot = baked(merge(shell, back, shelf, window, bracket), shade=shade[:3])
    return merge(robot, baked(_bellows(), shade=shade[3:]))


def _head_pan() -> Mesh:
    def cut(x_m: float, half_y_m: float, low_m: float, high_m: float) -> Section:
        return Section((x_m, 0.0, (low_m + high_m) / 2.0), half_y_m, (high_m - low_m) / 2.0, 0.0, 3.4)

    skull = sweep(
        [
            cut(-0.128, 0.066, 0.028, 0.056),
            cut(-0.122, 0.092, 0.017, 0.066),
            cut(-0.106, 0.115, 0.007, 0.076),
            cut(-0.080, 0.130, 0.002, 0.084),
            cut(-0.040, 0.140, 0.000, 0.093),
            cut(0.000, 0.141, 0.000, 0.099),
            cut(0.040, 0.136, 0.000, 0.103),
            cut(0.074, 0.132, 0.002, 0.102),
            cut(0.086, 0.126, 0.009, 0.092),
        ],
        GREY,
        n=28,
    )
    # Its sides go on as cheeks around the visor, round about the axis that the visor tilts on.
    tilt_x_m, _, tilt_z_m = _tilt_m()
    ahead = [(0.0555 * math.sin(turn), 0.0555 * math.cos(turn)) for turn in np.radians((0, 24, 44, 60, 74, 84))]
    cheek = [
        (-0.07, 0.0460, 0.0360, 0.0055),
        (-0.03, 0.0480, 0.0450, 0.0125),
        (0.00, 0.0495, 0.0480, 0.0160),
        (0.03, 0.0515, 0.0505, 0.0165),
        (0.09, 0.0560, 0.0540, 0.0165),
        *((tilt_x_m + x, tilt_z_m, half, 0.0165 - 0.35 * max(0.0, x - 0.04)) for x, half in ahead),
    ]
    ears = [
        sweep([Section((x, side * 0.1265, z), half_y, half, 0.0, 4.5) for x, z, half, half_y in cheek], GREY, n=16)
        for side in (-1.0, 1.0)
    ]
    neck = drum("z", 0.075, -0.014, 0.012, DARK, n=24)
    return baked(merge(skull, *ears, neck), shade=[((0.0, 0.0, -0.12), 0.11)])


def _tilt_m() -> Vector3:
    return next(frame.origin_m for frame in fetch.FIXED_FRAMES if frame.name == "head_tilt_link")


def _head_tilt() -> Mesh:
    """The blue visor with the eyes of a depth camera, which look along +x."""
    half_m = ((-0.107, 0.046), (-0.105, 0.051), (-0.100, 0.054), (0.100, 0.054), (0.105, 0.051), (0.107, 0.046))
    along_x = sweep([Section((x, 0.0, 0.0), half, half, 0.0, 3.6) for x, half in half_m], BLUE, n=24)
    face = box((0.004, 0.17, 0.044), (0.0535, 0.0, 0.006), BLACK)
    eyes = [
        merge(
            drum("x", radius_m, 0.0535, 0.0575, GREY, at_m=(0.0, y_m, 0.006), n=16),
            drum("x", 0.66 * radius_m, 0.0565, 0.058, GLASS, at_m=(0.0, y_m, 0.006), n=12),
        )
        for y_m, radius_m in ((0.055, 0.0125), (0.012, 0.0125), (-0.055, 0.0145))
    ]
    cos, sin = math.cos(fetch.HEAD_TILT_RAD), math.sin(fetch.HEAD_TILT_RAD)
    tilted = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    return baked(merge(along_x.turned(_FORWARD_TO_LEFT), face, *eyes), tilted)


BODY: Mapping[str, Callable[[], Mesh]] = MappingProxyType(
    {
        "base_link": _base,
        "torso_lift_link": _torso,
        "head_pan_link": _head_pan,
        "head_tilt_link": _head_tilt,
    }
)
"""Link → its mesh in the link's own frame, lit as it stands in the world."""
