"""What stands around the robot: objects, table, bins, floor, depth cues.

An object is drawn by its look: one of the drawings here, a mesh of its own, or its shape in its colour with a white
band. Of the drawings, shapes differ before colours do, and the colours are those of Okabe and Ito (2008, "Color
Universal Design"), which people with any common colour vision tell apart. Everything is drawn at the size the physics
uses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np

from sim.interface import BIN_WALL_M, STEEL, Bin, ObjectSpec, Rgb, SimError, Table
from sim.view.meshes import (
    FloatArray,
    Mesh,
    ball,
    box,
    circle,
    glow,
    lathe,
    loft,
    merge,
    painted,
    rectangle,
    rod,
)
from sim.view.wavefront import read_obj

BLUE: Rgb = (0, 114, 178)
SKY: Rgb = (86, 180, 233)
GREEN: Rgb = (0, 158, 115)
YELLOW: Rgb = (240, 205, 50)
VERMILION: Rgb = (213, 94, 0)
MAGENTA: Rgb = (204, 121, 167)
WHITE: Rgb = (246, 246, 242)
CREAM: Rgb = (236, 228, 208)
CARDBOARD: Rgb = (160, 118, 76)
DARK: Rgb = (44, 50, 58)

FLOOR: Rgb = (96, 106, 118)
TABLE_TOP: Rgb = (205, 200, 190)
TABLE_SIDE: Rgb = (128, 124, 118)


def _spray_bottle() -> Mesh:
    body = lathe(
        [
            (0.033, -0.12),
            (0.036, -0.113),
            (0.036, -0.113),
            (0.036, 0.01),
            (0.033, 0.03),
            (0.016, 0.058),
            (0.013, 0.064),
        ],
        SKY,
    )
    label = lathe([(0.0364, -0.085), (0.0364, -0.02)], WHITE)
    collar = lathe([(0.018, 0.06), (0.018, 0.078)], DARK, n=14)
    head = box((0.062, 0.026, 0.03), (-0.004, 0, 0.1), VERMILION, bevel_m=0.006)
    neck = box((0.026, 0.022, 0.03), (0.008, 0, 0.08), VERMILION, bevel_m=0.004)
    nozzle = rod((-0.034, 0, 0.103), (-0.046, 0, 0.103), 0.007, DARK)
    trigger = loft(
        [rectangle(0.008, 0.014, z).__add__([x, 0, 0]) for x, z in ((-0.03, 0.056), (-0.026, 0.07), (-0.014, 0.09))],
        DARK,
    )
    return merge(body, label, collar, neck, head, nozzle, trigger)


def _bleach_bottle() -> Mesh:
    def ring(x_m: float, y_m: float, z_m: float, corner_m: float = 0.02) -> FloatArray:
        return rectangle(x_m, y_m, z_m, corner_m=corner_m, per_corner=5)

    base = ring(0.072, 0.066, -0.12)
    rim = ring(0.08, 0.074, -0.113)
    body = loft(
        [
            base,
            rim,
            rim,
            ring(0.08, 0.074, 0.02),
            ring(0.07, 0.064, 0.045),
            ring(0.046, 0.044, 0.075),
            ring(0.03, 0.03, 0.088, 0.0149),
        ],
        YELLOW,
    )
    cap = lathe([(0.02, 0.086), (0.02, 0.086), (0.02, 0.115), (0.02, 0.115), (0.017, 0.12)], BLUE, n=16)
    label = loft([ring(0.081, 0.075, -0.085), ring(0.081, 0.075, -0.01)], BLUE, bottom=False, top=False)
    stripe = loft([ring(0.0818, 0.0758, -0.058), ring(0.0818, 0.0758, -0.036)], WHITE, bottom=False, top=False)
    handle = merge(
        rod((0.036, 0, 0.0), (0.045, 0, 0.035), 0.008, YELLOW),
        rod((0.045, 0, 0.035), (0.036, 0, 0.068), 0.008, YELLOW),
        rod((0.036, 0, 0.068), (0.015, 0, 0.08), 0.008, YELLOW),
        *(ball(0.008, YELLOW, n=10).moved(p) for p in ((0.045, 0, 0.035), (0.036, 0, 0.068))),
    )
    return merge(body, cap, label, stripe, handle)


def _paper_towels() -> Mesh:
    outer, inner, half = 0.04, 0.013, 0.12
    side = lathe([(outer, -half), (outer, half)], WHITE, n=28)
    lines = merge(
        *(
            loft(
                [circle(outer * 1.006, z - 0.0016, n=28), circle(outer * 1.006, z + 0.0016, n=28)],
                STEEL,
                bottom=False,
                top=False,
            )
            for z in (-0.06, 0.0, 0.06)
        )
    )
    hole = np.concatenate([circle(inner, half + 0.0004, n=16), circle(inner * 1.35, half + 0.0004, n=16)])
    around = np.arange(16)
    ahead = (around + 1) % 16
    ring = painted(
        hole,
        np.concatenate([np.stack([around, around + 16, ahead + 16], -1), np.stack([around, ahead + 16, ahead], -1)]),
        CARDBOARD,
    )
    core = lathe([(inner, half), (inner, half + 0.0002)], DARK, n=16)
    sheet = box((0.003, 0.05, 0.24), (-outer - 0.0015, 0.012, 0.0), WHITE)
    edge = box((0.0036, 0.004, 0.24), (-outer - 0.0015, -0.013, 0.0), STEEL)
    return merge(side, lines, ring, core, sheet, edge)


def _wipes_tub() -> Mesh:
    body = lathe(
        [(0.036, -0.09), (0.039, -0.086), (0.039, -0.086), (0.037, 0.05), (0.037, 0.05), (0.035, 0.052)], GREEN, n=26
    )
    band = lathe([(0.0393, -0.055), (0.0384, 0.01)], WHITE, n=26)
    dot = merge(
        *(
            ball(0.007, GREEN, n=8).moved((-0.0345 * np.cos(a), 0.0345 * np.sin(a), -0.022))
            for a in np.arange(6) * np.pi / 3
        )
    )
    lid = lathe(
        [(0.04, 0.05), (0.04, 0.05), (0.04, 0.066), (0.034, 0.075), (0.034, 0.075), (0.028, 0.077)], WHITE, n=26
    )
    wipe = loft(
        [
            rectangle(0.012, 0.03, 0.075),
            rectangle(0.006, 0.034, 0.085).__add__([0.004, 0, 0]),
            rectangle(0.002, 0.022, 0.1).__add__([-0.004, 0, 0]),
        ],
        CREAM,
        flat=True,
    )
    return merge(body, band, dot, lid, wipe)


def _absorbent_can() -> Mesh:
    rim_low = [(0.04, -0.08), (0.04, -0.08), (0.04, -0.072), (0.037, -0.07)]
    rim_high = [(0.037, 0.062), (0.04, 0.064), (0.04, 0.072), (0.04, 0.072), (0.036, 0.073)]
    foot = lathe([*rim_low, (0.037, -0.07), (0.037, -0.056)], STEEL, n=26)
    neck = lathe([(0.037, 0.048), (0.037, 0.062), *rim_high], STEEL, n=26)
    label = lathe([(0.0376, -0.056), (0.0376, 0.048)], VERMILION, n=26)
    bands = [lathe([(0.0381, z), (0.0381, z + 0.012)], DARK, n=26) for z in (-0.05, 0.03)]
    shaker = lathe([(0.026, 0.073), (0.026, 0.073), (0.024, 0.08)], DARK, n=20)
    holes = [
        lathe([(0.003, 0.08), (0.003, 0.0806)], CREAM, n=8).moved((0.014 * np.cos(a), 0.014 * np.sin(a), 0))
        for a in np.arange(6) * np.pi / 3
    ]
    return merge(foot, neck, label, *bands, shaker, *holes)


def _sponge_pack() -> Mesh:
    layers: list[Mesh] = []
    for index in range(3):
        z_m = -0.06 + 0.04 * index
        layers.append(box((0.07, 0.07, 0.028), (0, 0, z_m - 0.006), MAGENTA, bevel_m=0.005))
        layers.append(box((0.07, 0.07, 0.012), (0, 0, z_m + 0.014), (92, 45, 88), bevel_m=0.002))
    wrap = box((0.0712, 0.03, 0.122), (0, 0, -0.02), WHITE)
    return merge(*layers, wrap)


def _practice_block() -> Mesh:
    body = box((0.06, 0.06, 0.16), (0, 0, 0), CARDBOARD, bevel_m=0.006)
    bands = [box((0.0606, 0.0606, 0.016), (0, 0, z), CREAM, bevel_m=0.006) for z in (-0.04, 0.04)]
    return merge(body, *bands)


_DRAWINGS: Mapping[str, Callable[[], Mesh]] = {
    "spray_bottle": _spray_bottle,
    "bleach_bottle": _bleach_bottle,
    "paper_towels": _paper_towels,
    "wipes_tub": _wipes_tub,
    "absorbent_can": _absorbent_can,
    "sponge_pack": _sponge_pack,
    "practice_block": _practice_block,
}
DRAWINGS = tuple(_DRAWINGS)
"""What an object can be drawn as, whatever its id."""


def object_mesh(spec: ObjectSpec) -> Mesh:
    """The look of an object, its bounding box exactly `spec.size_m` about the origin.

    Raises:
        SimError: no such drawing, or a mesh that cannot be read.
    """
    look = spec.look
    if look.drawing:
        if look.drawing not in _DRAWINGS:
            raise SimError(f"no drawing {look.drawing!r}; drawings are {', '.join(DRAWINGS)}")
        mesh = _DRAWINGS[look.drawing]()
    elif look.mesh_obj:
        mesh = read_obj(look.mesh_obj, look.color_rgb)
    elif spec.shape == "cylinder":
        mesh = _can(spec, look.color_rgb)
    else:
        mesh = _carton(spec, look.color_rgb)
    return mesh.fitted(spec.size_m)


def _band(color: Rgb) -> Rgb:
    """White, or dark on something that is nearly white."""
    return DARK if min(color) > 200 else WHITE


def _can(spec: ObjectSpec, color: Rgb) -> Mesh:
    x_m, _, z_m = spec.size_m
    half_m, rim_m = z_m / 2.0, min(0.006, x_m / 8.0)
    body = lathe(
        [
            (x_m / 2.0 - rim_m, -half_m),
            (x_m / 2.0, -half_m + rim_m),
            (x_m / 2.0, half_m - rim_m),
            (x_m / 2.0 - rim_m, half_m),
        ],
        color,
        n=26,
    )
    band = lathe([(x_m / 2.0 + 0.0004, -0.25 * z_m), (x_m / 2.0 + 0.0004, 0.1 * z_m)], _band(color), n=26)
    return merge(body, band)


def _carton(spec: ObjectSpec, color: Rgb) -> Mesh:
    x_m, y_m, z_m = spec.size_m
    bevel_m = min(0.006, x_m / 8.0, y_m / 8.0)
    body = box(spec.size_m, (0.0, 0.0, 0.0), color, bevel_m=bevel_m)
    low, high = (
        rectangle(x_m + 0.0006, y_m + 0.0006, share * z_m, corner_m=bevel_m * 1.5, per_corner=4)
        for share in (-0.25, 0.1)
    )
    return merge(body, loft([low, high], _band(color), bottom=False, top=False))


def shaded(mesh: Mesh, *, dark_share: float = 0.0) -> Mesh:
    """Bakes soft light from above into the colours, for things that never move and are drawn unlit.

    Faces looking up keep their colour, sides lose a fifth, faces looking down two fifths; `dark_share` darkens
    towards the lower end of the mesh.
    """
    normals = mesh.normals
    light = 0.8 + 0.2 * normals[:, 2] + 0.05 * normals[:, 1] - 0.03 * normals[:, 0]
    low_m, high_m = mesh.bounds_m
    height = (mesh.vertices_m[:, 2] - low_m[2]) / max(high_m[2] - low_m[2], 1e-9)
    light = light * (1.0 - dark_share * (1.0 - height) ** 1.5)
    srgba = mesh.srgba.copy()
    srgba[:, :3] = np.clip(srgba[:, :3] * light[:, None], 0.0, 1.0)
    return Mesh(mesh.vertices_m, mesh.faces, srgba)


def table_mesh(table: Table) -> Mesh:
    """The table about its own centre: a slab as thick as the physics says, on a plinth down to the floor."""
    x_m, y_m, z_m = table.size_m
    top = box((x_m, y_m, z_m), (0, 0, 0), TABLE_TOP)
    floor_m = -table.center_world_m[2]
    parts = [shaded(top)]
    if floor_m < -z_m / 2 - 0.02:
        plinth_m = -z_m / 2 - floor_m
        legs = box((x_m * 0.9, y_m * 0.94, plinth_m), (0.02 * x_m, 0, floor_m + plinth_m / 2), TABLE_SIDE)
        parts.append(shaded(legs, dark_share=0.45))
    lip_m = 0.012
    edge = [box((lip_m, y_m, 0.0012), (sign * (x_m - lip_m) / 2, 0, z_m / 2), (170, 164, 154)) for sign in (-1, 1)] + [
        box((x_m, lip_m, 0.0012), (0, sign * (y_m - lip_m) / 2, z_m / 2), (170, 164, 154)) for sign in (-1, 1)
    ]
    return merge(*parts, *edge)


_STROKES: Mapping[str, str] = {
    "A": "00 26 40|12 32",
    "B": "00 06 36 45 44 33 03|33 42 41 30 00",
    "C": "45 36 16 05 01 10 30 41",
    "D": "00 06 26 44 42 20 00",
    "E": "40 00 06 46|03 33",
    "F": "00 06 46|03 33",
    "G": "45 36 16 05 01 10 30 41 43 23",
    "H": "00 06|40 46|03 43",
    "I": "20 26|10 30|16 36",
    "J": "01 10 20 31 36",
    "K": "00 06|46 03 40",
    "L": "06 00 40",
    "M": "00 06 23 46 40",
    "N": "00 06 40 46",
    "O": "10 01 05 16 36 45 41 30 10",
    "P": "00 06 36 45 44 33 03",
    "Q": "10 01 05 16 36 45 41 30 10|22 40",
    "R": "00 06 36 45 44 33 03|23 40",
    "S": "45 36 16 05 04 13 33 42 41 30 10 01",
    "T": "20 26|06 46",
    "U": "06 01 10 30 41 46",
    "V": "06 20 46",
    "W": "06 10 24 30 46",
    "X": "00 46|06 40",
    "Y": "06 23 46|23 20",
    "Z": "06 46 00 40",
    "0": "10 01 05 16 36 45 41 30 10",
    "1": "15 26 20|10 30",
    "2": "05 16 36 45 44 00 40",
    "3": "05 16 36 45 44 33 42 41 30 10 01|23 33",
    "4": "30 36 02 42",
    "5": "46 06 03 33 42 41 30 00",
    "6": "45 36 16 05 01 10 30 41 42 33 03",
    "7": "06 46 10",
    "8": "10 01 05 16 36 45 41 30 10|03 43",
    "9": "01 10 30 41 45 36 16 05 04 13 43",
}
"""The strokes of each letter: corners as x from 0 to 4 and y from 0 to 6, left and low first; `|` lifts the pen."""


def _letter(letter: str, size_m: float, color: Rgb) -> Mesh:
    """A letter of that height in the y–z plane, facing −x (towards the robot), so that +y is the reader's left."""
    unit_m, bar_m = size_m / 6.0, size_m * 0.18
    strokes = []
    for line in _STROKES[letter].split("|"):
        corners = [((2 - int(at[0])) * unit_m, (int(at[1]) - 3) * unit_m) for at in line.split()]
        for (y_m, z_m), (to_y_m, to_z_m) in pairwise(corners):
            along = np.array([to_y_m - y_m, to_z_m - z_m])
            length_m = float(np.linalg.norm(along))
            cos, sin = along / length_m
            bar = box((0.003, length_m + 0.7 * bar_m, bar_m), (0.0, 0.0, 0.0), color)
            turn = [[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]]
            strokes.append(bar.turned(turn).moved((0.0, (y_m + to_y_m) / 2.0, (z_m + to_z_m) / 2.0)))
    return merge(*strokes)


def bin_mesh(target: Bin) -> Mesh:
    """An open bin about the middle of its floor, with its letter outside on the robot's side and inside opposite."""
    color = target.color_rgb
    x_m, y_m = target.inner_size_m
    height_m, wall_m = target.height_m, BIN_WALL_M

    def outside(z_m: float) -> FloatArray:
        return rectangle(x_m + 2 * wall_m, y_m + 2 * wall_m, z_m, corner_m=0.03)

    def inside(z_m: float) -> FloatArray:
        return rectangle(x_m, y_m, z_m, corner_m=0.022)

    deep: Rgb = (round(color[0] * 0.5), round(color[1] * 0.5), round(color[2] * 0.5))
    skin = shaded(loft([outside(0.0), outside(height_m)], color, bottom=False, top=False), dark_share=0.4)
    lining = shaded(loft([inside(height_m), inside(0.004)], deep, bottom=False, top=False), dark_share=0.55)
    bed = loft([inside(0.003), inside(0.004)], (round(color[0] * 0.3), round(color[1] * 0.3), round(color[2] * 0.3)))
    rim_color: Rgb = WHITE
    rim = loft([outside(height_m), outside(height_m), inside(height_m)], rim_color, bottom=False, top=False)
    collar = loft([outside(height_m - 0.03), outside(height_m)], rim_color, bottom=False, top=False)
    collar = Mesh(collar.vertices_m * [1.004, 1.004, 1.0], collar.faces, collar.srgba)
    size_m = min(0.2, height_m * 0.5, y_m * 0.6)
    parts = [skin, lining, bed, rim, shaded(collar)]
    if target.letter in _STROKES:
        letter = _letter(target.letter, size_m, WHITE)
        parts += [
            letter.moved((-x_m / 2 - wall_m - 0.002, 0, height_m * 0.62)),
            letter.moved((x_m / 2 - 0.003, 0, height_m - 0.03 - size_m * 0.62)),
        ]
    return merge(*parts)


def floor_mesh(radius_m: float = 2.0) -> Mesh:
    """A round floor at z = 0 that fades out to its rim. For `blend`."""
    steps = np.array([0.0, 0.3, 0.5, 0.65, 0.8, 0.9, 1.0]) * radius_m
    shade = np.array([1.15, 1.12, 1.08, 1.04, 1.0, 1.0, 1.0])
    alpha = np.array([1.0, 0.95, 0.8, 0.55, 0.25, 0.08, 0.0])
    n = 48
    rings = [circle(max(step, 1e-3), 0.0, n=n) for step in steps]
    vertices = np.concatenate(rings)
    here = np.arange(len(rings) - 1)[:, None] * n + np.arange(n)[None, :]
    beside = np.arange(len(rings) - 1)[:, None] * n + (np.arange(n)[None, :] + 1) % n
    faces = np.concatenate(
        [
            np.stack([here, here + n, beside + n], -1).reshape(-1, 3),
            np.stack([here, beside + n, beside], -1).reshape(-1, 3),
        ]
    )
    base = np.array(FLOOR) / 255.0
    colors = np.concatenate([np.clip(base[None] * shade[:, None], 0, 1), alpha[:, None]], axis=1)
    return Mesh(vertices, faces, np.repeat(colors, n, axis=0))


def shadow_mesh(size_x_m: float, size_y_m: float) -> Mesh:
    """A soft dark spot on the surface below something of that footprint. For `blend`."""
    return glow(0.5 * size_x_m * 1.55, (0, 0, 0), 0.5, squash=size_y_m / size_x_m)


def plumb_line_mesh(length_m: float = 1.0) -> Mesh:
    """A thin dashed line of unit length hanging down from the origin; stretch it to reach the surface."""
    return rod((0, 0, -length_m), (0, 0, 0), 0.0016, VERMILION, n=6)


def plumb_mark_mesh() -> Mesh:
    """The ring on the surface under the gripper. For `blend`."""
    n = 28
    radii = (0.018, 0.0225)
    rings = np.concatenate([circle(radius, 0.0, n=n) for radius in radii])
    around = np.arange(n)
    ahead = (around + 1) % n
    faces = np.concatenate([np.stack([around, around + n, ahead + n], -1), np.stack([around, ahead + n, ahead], -1)])
    ring = painted(rings, faces, VERMILION, 0.95)
    dot = painted(
        np.concatenate([np.zeros((1, 3)), circle(0.005, 0.0, n=12)]),
        np.stack([np.zeros(12, dtype=np.int64), 1 + np.arange(12), 1 + (np.arange(12) + 1) % 12], -1),
        VERMILION,
        0.95,
    )
    return merge(ring, dot)


def belief_mesh() -> Mesh:
    """A column of unit height; stretched, it says how likely something is."""
    return rod((0, 0, 0), (0, 0, 1), 0.014, SKY, n=16)


def mark_mesh() -> Mesh:
    """A ring on the table that may point out the instructed object. For `blend`."""
    n = 40
    return _flat_band(circle(0.066, 0.0, n=n), circle(0.075, 0.0, n=n))


def bin_mark_mesh(target: Bin) -> Mesh:
    """A band around a bin's rim that may point it out, about the middle of its opening. For `blend`."""
    size_x_m, size_y_m = target.inner_size_m
    inner, outer = (
        rectangle(size_x_m + 2.0 * away_m, size_y_m + 2.0 * away_m, 0.0, corner_m=away_m)
        for away_m in (BIN_WALL_M + 0.012, BIN_WALL_M + 0.030)
    )
    return _flat_band(inner, outer)


def _flat_band(inner_m: FloatArray, outer_m: FloatArray) -> Mesh:
    """The flat white band between two rings of as many points, facing up."""
    n = len(inner_m)
    around = np.arange(n)
    ahead = (around + 1) % n
    faces = np.concatenate([np.stack([around, around + n, ahead + n], -1), np.stack([around, ahead + n, ahead], -1)])
    return painted(np.concatenate([inner_m, outer_m]), faces, WHITE, 0.9)
