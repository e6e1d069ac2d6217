"""The arm and the gripper of the lab's own look, a mesh a link.

    a flex joint   is a drum along y: the half at −y, with its grey lid, belongs to the link before it, the half at +y
                   to the link behind it, and each link bends from its half to the middle
    a roll joint   is a blue ring

Joints and the fingers' faces are those of `sim.fetch`; outer measures follow the real robot's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from sim import fetch
from sim.interface import Rgb, Vector3
from sim.view.bodies import Section, drum, sweep
from sim.view.meshes import FloatArray, Mesh, box, loft, merge, rectangle

SHELL: Rgb = (236, 237, 238)
GREY: Rgb = (92, 95, 100)
DARK: Rgb = (48, 50, 55)
BLACK: Rgb = (26, 27, 30)
BLUE: Rgb = (0, 134, 188)

RADIUS_M = 0.052
"""Of the arm, wherever it is round."""
SHOULDER_M = 0.0595
"""Radius of the shoulder's drum, the largest."""
GAP_M = 0.001
"""From the middle of a flex joint to either half."""
LID_M = 0.0115
EDGE_M = 0.003


def _tube(*sections: tuple[float, float, float, float, float]) -> Mesh:
    """A sweep along x through (x, y, half of y, half of z, roundness): 0 is a rounded rectangle, 1 round."""
    return sweep(
        [Section((x, y, 0.0), half_y, half_z, 0.0, 2.6 - 0.6 * round_) for x, y, half_y, half_z, round_ in sections],
        SHELL,
    )


def _ring(low_m: float, high_m: float) -> Mesh:
    """The blue ring of a roll joint, along x."""
    return drum("x", RADIUS_M + 0.0004, low_m, high_m, BLUE)


def _lid(side: int, y_m: float, radius_m: float, at_m: Vector3) -> Mesh:
    """What closes a drum whose end is at `y_m`: a dark seam, a grey lid, and in it a dish."""

    def between(radius_m: float, from_m: float, to_m: float, color: Rgb, edge_m: float, *, closed: bool) -> Mesh:
        low_m, high_m = sorted((side * from_m, side * to_m))
        edges_m = (0.0, edge_m) if side > 0 else (edge_m, 0.0)
        return drum("y", radius_m, low_m, high_m, color, at_m=at_m, edges_m=edges_m, closed=closed)

    out_m = side * y_m
    return merge(
        between(radius_m - 0.004, out_m - 0.002, out_m + 0.003, BLACK, 0.0, closed=False),
        between(radius_m - 0.0005, out_m + 0.0015, out_m + LID_M, GREY, 0.004, closed=True),
        between(0.6 * radius_m, out_m + LID_M - 0.002, out_m + LID_M + 0.0005, DARK, 0.0, closed=True),
    )


def _half(side: int, at_m: Vector3, wide_m: float, radius_m: float) -> Mesh:
    """One half of a flex joint, from the middle to `side` of y, with its lid."""
    low_m, high_m = sorted((side * GAP_M, side * wide_m))
    shell = drum("y", radius_m, low_m, high_m, SHELL, at_m=at_m, edges_m=(EDGE_M, EDGE_M))
    return merge(shell, _lid(side, side * wide_m, radius_m, at_m))


def _shoulder_pan() -> Mesh:
    lift_m = fetch.ARM_JOINTS[1].origin_m
    bend = sweep(
        [
            Section((0.0, 0.0, -0.002), 0.050, 0.050, 90.0),
            Section((0.0, 0.0, 0.000), RADIUS_M, RADIUS_M, 90.0),
            Section((0.0, 0.0, 0.012), RADIUS_M, RADIUS_M, 90.0),
            Section((0.004, -0.003, 0.034), 0.0515, 0.051, 72.0),
            Section((0.017, -0.011, 0.054), 0.047, 0.049, 48.0),
            Section((0.038, -0.021, 0.065), 0.040, 0.047, 22.0, 2.3),
            Section((0.062, -0.029, 0.066), 0.034, 0.047, 2.0, 2.6),
            Section((0.090, -0.031, 0.062), 0.032, 0.049, -4.0, 2.6),
            Section((lift_m[0], -0.031, lift_m[2]), 0.030, 0.050, 0.0, 2.6),
        ],
        SHELL,
    )
    ring = drum("z", RADIUS_M + 0.0004, -0.050, -0.003, BLUE)
    return merge(ring, bend, _half(-1, lift_m, 0.063, SHOULDER_M))


def _shoulder_lift() -> Mesh:
    neck = _tube(
        (0.000, 0.0300, 0.0270, 0.046, 0),
        (0.045, 0.0300, 0.0265, 0.0435, 0),
        (0.062, 0.0285, 0.0240, 0.0430, 0),
        (0.076, 0.0215, 0.0300, 0.0430, 0.1),
        (0.090, 0.0115, 0.0405, 0.0445, 0.4),
        (0.104, 0.0035, 0.0485, 0.0490, 0.8),
        (0.118, 0.0, RADIUS_M, RADIUS_M, 1),
        (0.169, 0.0, RADIUS_M, RADIUS_M, 1),
        (0.172, 0.0, 0.0490, 0.0490, 1),
    )
    return merge(_half(1, (0.0, 0.0, 0.0), 0.059, SHOULDER_M), neck)


def _upperarm_roll() -> Mesh:
    neck = _tube(
        (-0.004, 0.0, 0.0500, 0.0500, 1),
        (-0.002, 0.0, RADIUS_M, RADIUS_M, 1),
        (0.012, 0.0, RADIUS_M, RADIUS_M, 1),
        (0.024, -0.0045, 0.0470, 0.0490, 0.8),
        (0.036, -0.0130, 0.0390, 0.0450, 0.4),
        (0.048, -0.0225, 0.0290, 0.0430, 0.1),
        (0.060, -0.0290, 0.0230, 0.0430, 0),
        (0.085, -0.0300, 0.0265, 0.0435, 0),
        (0.133, -0.0300, 0.0270, 0.0445, 0),
    )
    return merge(_ring(-0.048, -0.005), neck, _half(-1, fetch.ARM_JOINTS[3].origin_m, 0.059, RADIUS_M))


def _elbow_flex() -> Mesh:
    neck = _tube(
        (0.000, 0.0300, 0.0270, 0.0445, 0),
        (0.042, 0.0300, 0.0250, 0.0435, 0),
        (0.055, 0.0290, 0.0235, 0.0430, 0),
        (0.068, 0.0210, 0.0310, 0.0435, 0.1),
        (0.082, 0.0105, 0.0415, 0.0450, 0.5),
        (0.096, 0.0030, 0.0490, 0.0495, 0.8),
        (0.108, 0.0, RADIUS_M, RADIUS_M, 1),
        (0.163, 0.0, RADIUS_M, RADIUS_M, 1),
        (0.166, 0.0, 0.0490, 0.0490, 1),
    )
    return merge(_half(1, (0.0, 0.0, 0.0), 0.059, RADIUS_M), neck)


def _forearm_roll() -> Mesh:
    """Its wrist is held from one side by a thin plate."""
    flex_m = fetch.ARM_JOINTS[5].origin_m
    neck = _tube(
        (-0.006, 0.0, 0.0500, 0.0500, 1),
        (-0.004, 0.0, RADIUS_M, RADIUS_M, 1),
        (0.010, 0.0, RADIUS_M, RADIUS_M, 1),
        (0.019, -0.0045, 0.0510, 0.0480, 0.8),
        (0.027, -0.0170, 0.0460, 0.0400, 0.5),
        (0.034, -0.0340, 0.0360, 0.0330, 0.2),
        (0.041, -0.0500, 0.0240, 0.0300, 0),
        (0.050, -0.0610, 0.0135, 0.0300, 0),
        (0.072, -0.0640, 0.0110, 0.0310, 0),
        (0.112, -0.0645, 0.0100, 0.0430, 0),
    )
    plate = drum("y", RADIUS_M, -0.0755, -0.0555, SHELL, at_m=flex_m, edges_m=(EDGE_M, EDGE_M))
    return merge(_ring(-0.032, -0.007), neck, plate, _lid(-1, -0.0755, RADIUS_M, flex_m))


def _wrist_flex() -> Mesh:
    return merge(
        drum("y", RADIUS_M, -0.054, 0.055, SHELL, edges_m=(EDGE_M, EDGE_M)),
        _lid(1, 0.055, RADIUS_M, (0.0, 0.0, 0.0)),
        drum("x", RADIUS_M, 0.0, 0.1155, SHELL, edges_m=(0.0, EDGE_M)),
    )


def _wrist_roll() -> Mesh:
    return merge(_ring(-0.0225, 0.007), drum("x", 0.044, 0.0, 0.016, DARK))


def _gripper() -> Mesh:
    length_m, wide_m, _ = fetch.PALM_SIZE_M
    front_m = fetch.PALM_CENTER_M[0] + length_m / 2.0
    back_m = front_m - length_m

    def cut(x_m: float, inset_m: float) -> Section:
        return Section((x_m, 0.0, 0.002), wide_m / 2.0 - inset_m, 0.0395 - inset_m, 0.0, 5.0)

    shell = sweep(
        [
            cut(back_m, 0.014),
            cut(back_m + 0.003, 0.007),
            cut(back_m + 0.010, 0.0015),
            cut(back_m + 0.018, 0.0),
            cut(front_m - 0.012, 0.0),
            cut(front_m - 0.005, 0.002),
            cut(front_m, 0.009),
        ],
        SHELL,
        n=32,
    )
    rings = [cut(x_m, -0.0003).ring(32) for x_m in (front_m - 0.0335, front_m - 0.0320)]
    seam = loft(rings, DARK, bottom=False, top=False)
    face = box((0.003, 0.1, 0.042), (front_m - 0.0005, 0.0, 0.002), DARK)
    rail = box((0.003, 0.094, 0.007), (front_m + 0.0005, 0.0, 0.0), BLACK)
    return merge(shell, seam, face, rail, drum("x", 0.043, back_m - 0.006, back_m + 0.012, DARK))


def _finger(side: float) -> Mesh:
    """A finger whose inner face is where the physics has it: `fetch.FINGER_ORIGIN_M` from its frame to the middle."""
    length_m, deep_m, high_m = fetch.FINGER_SIZE_M
    inner_m, pad_m, ribs, half_m = -fetch.FINGER_ORIGIN_M, 0.003, 5, high_m / 2.0
    back_m, tip_m = fetch.FINGER_CENTER_X_M - length_m / 2.0, fetch.FINGER_CENTER_X_M + length_m / 2.0
    outer_m = inner_m + deep_m

    def cut(x_m: float, out_m: float, half_z_m: float) -> FloatArray:
        ring = rectangle(out_m - (inner_m + pad_m), 2.0 * half_z_m, 0.0, corner_m=0.0025, per_corner=2)
        return ring[:, [2, 0, 1]] + [x_m, (out_m + inner_m + pad_m) / 2.0, 0.0]

    jaw = loft(
        [
            cut(back_m - 0.003, outer_m, half_m),
            cut(tip_m - 0.012, outer_m, half_m),
            cut(tip_m - 0.003, outer_m - 0.003, half_m - 0.001),
            cut(tip_m, outer_m - 0.0065, half_m - 0.004),
        ],
        DARK,
    )
    pitch_m = (length_m - 0.010) / ribs
    pads = [
        box(
            (pitch_m - 0.002, pad_m + 0.001, high_m - 0.003),
            (tip_m - 0.002 - pitch_m * (rib + 0.5), inner_m + (pad_m + 0.001) / 2.0, 0.0),
            GREY,
        )
        for rib in range(ribs)
    ]
    foot = box((0.012, 0.0135, 0.016), (back_m - 0.003, outer_m - 0.007, 0.0), BLACK)
    finger = merge(jaw, *pads, foot)
    if side > 0.0:
        return finger
    return Mesh(finger.vertices_m * [1.0, -1.0, 1.0], finger.faces[:, ::-1], finger.srgba)


ARM: Mapping[str, Callable[[], Mesh]] = MappingProxyType(
    {
        "shoulder_pan_link": _shoulder_pan,
        "shoulder_lift_link": _shoulder_lift,
        "upperarm_roll_link": _upperarm_roll,
        "elbow_flex_link": _elbow_flex,
        "forearm_roll_link": _forearm_roll,
        "wrist_flex_link": _wrist_flex,
        "wrist_roll_link": _wrist_roll,
        "gripper_link": _gripper,
        "r_gripper_finger_link": lambda: _finger(fetch.FINGERS["r_gripper_finger_link"]),
        "l_gripper_finger_link": lambda: _finger(fetch.FINGERS["l_gripper_finger_link"]),
    }
)
"""Link → its mesh in the link's own frame."""
