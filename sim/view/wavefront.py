"""A Wavefront OBJ file as a coloured mesh: vertices and faces, nothing else of the format. Pure.

`v x y z` with z up, in any unit, or `v x y z r g b` with colours from 0 to 1; `f` with three corners or more, which
may name normals. Vertices are doubled where the file's normals differ; without normals every face is flat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sim.interface import Rgb, SimError
from sim.view.meshes import FloatArray, Mesh

MOST_TRIANGLES = 10_000
"""What a browser without a graphics card draws beside seven more."""


@dataclass
class _Read:
    points: list[tuple[float, float, float]] = field(default_factory=list)
    colors: list[tuple[float, float, float]] = field(default_factory=list)
    corners: dict[tuple[int, int], int] = field(default_factory=dict)
    """Number of a mesh vertex, by point and normal (or, when flat, by a number of the face's own)."""
    triangles: list[tuple[int, int, int]] = field(default_factory=list)


def read_obj(text: str, color: Rgb) -> Mesh:
    """The mesh of an OBJ file's text; what has no colour of its own gets `color`.

    Raises:
        SimError: what is wrong, with the line of the text.
    """
    read = _Read()
    own = (color[0] / 255.0, color[1] / 255.0, color[2] / 255.0)
    for number, line in enumerate(text.split("\n"), start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            if words[0] == "v":
                _point(read, words[1:], own)
            elif words[0] == "f":
                _face(read, words[1:])
        except ValueError as error:
            raise SimError(f"line {number}: {error}") from None
        if len(read.triangles) > MOST_TRIANGLES:
            raise SimError(f"line {number}: more than {MOST_TRIANGLES} triangles")
    if not read.triangles:
        raise SimError("no faces: a mesh has lines that begin with v and lines that begin with f")
    owners = [point for point, _ in read.corners]
    vertices = np.array(read.points, dtype=np.float64)[owners]
    flat = [axis for axis, span in zip("xyz", np.ptp(vertices, axis=0), strict=True) if span <= 0.0]
    if flat:
        raise SimError(f"flat along {' and '.join(flat)}: a mesh has some size along x, y and z")
    srgba = np.concatenate([np.array(read.colors)[owners], np.ones((len(owners), 1))], axis=1)
    return Mesh(vertices, np.array(read.triangles, dtype=np.int64), srgba)


def silhouette(mesh: Mesh, rows: int = 60) -> str:
    """The mesh as one sees it from the robot, as an SVG path in a square of 100 by 100 that it fills.

    The path is a stack of thin strips, so that holes and handles show whatever the mesh is made of.
    """
    low_m, high_m = mesh.bounds_m
    across = 100.0 * (high_m[1] - mesh.vertices_m[:, 1]) / (high_m[1] - low_m[1])  # +y is the robot's left
    down = 100.0 * (high_m[2] - mesh.vertices_m[:, 2]) / (high_m[2] - low_m[2])
    high = 100.0 / rows
    parts = []
    for row in range(rows):
        for begin, end in _covered(across[mesh.faces], down[mesh.faces], (row + 0.5) * high):
            parts.append(f"M{begin:.1f} {row * high:.1f}H{end:.1f}v{high + 0.4:.1f}H{begin:.1f}z")
    return "".join(parts)


def _covered(across: FloatArray, down: FloatArray, at: float) -> list[tuple[float, float]]:
    """Where triangles, (N, 3) each way, cover the line `down` = `at`: stretches that do not touch."""
    left, right = np.full(len(down), np.inf), np.full(len(down), -np.inf)
    for one, other in ((0, 1), (1, 2), (2, 0)):
        fall = down[:, other] - down[:, one]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (at - down[:, one]) / fall
        crosses = (fall != 0.0) & (share >= 0.0) & (share <= 1.0)
        place = across[:, one] + np.where(crosses, share, 0.0) * (across[:, other] - across[:, one])
        left = np.where(crosses, np.minimum(left, place), left)
        right = np.where(crosses, np.maximum(right, place), right)
    found: list[tuple[float, float]] = []
    for begin, end in sorted(zip(left[left <= right].tolist(), right[left <= right].tolist(), strict=True)):
        if found and begin <= found[-1][1] + 0.2:
            found[-1] = (found[-1][0], max(found[-1][1], end))
        else:
            found.append((begin, end))
    return found


def _point(read: _Read, words: list[str], own: tuple[float, float, float]) -> None:
    numbers = [float(word) for word in words]
    if len(numbers) not in (3, 4, 6, 7) or not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"v {' '.join(words)}: a vertex has three numbers, and three more if it has a colour")
    read.points.append((numbers[0], numbers[1], numbers[2]))
    red, green, blue = numbers[-3:] if len(numbers) >= 6 else own
    if not all(0.0 <= share <= 1.0 for share in (red, green, blue)):
        raise ValueError(f"v {' '.join(words)}: a colour's numbers are from 0 to 1")
    read.colors.append((red, green, blue))


def _face(read: _Read, words: list[str]) -> None:
    if len(words) < 3:
        raise ValueError(f"f {' '.join(words)}: a face has at least three corners")
    flat = -len(read.triangles) - 1  # no normal of a file has a number below 0
    corners = []
    for word in words:
        parts = word.split("/")
        point = _index(parts[0], len(read.points))
        normal = int(parts[2]) if len(parts) > 2 and parts[2] else flat
        corners.append(read.corners.setdefault((point, normal), len(read.corners)))
    read.triangles += [(corners[0], corners[at], corners[at + 1]) for at in range(1, len(corners) - 1)]


def _index(word: str, count: int) -> int:
    number = int(word)
    index = number - 1 if number > 0 else count + number
    if number == 0 or not 0 <= index < count:
        raise ValueError(f"corner {word}: there are {count} vertices so far")
    return index
