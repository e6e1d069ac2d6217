"""Coloured triangle meshes made in code, and their GLB form.

Normals follow from the triangles that share a vertex, so an edge is sharp exactly where vertices are doubled: every
primitive here doubles them where a real thing has an edge. Lengths are metres, z is up.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.interface import Rgb, SimError

Material = Literal["lit", "unlit", "blend"]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """Triangles: `vertices_m` (V, 3), `faces` (F, 3) indices, `srgba` (V, 4) display colours in 0…1."""

    vertices_m: FloatArray
    faces: NDArray[np.int64]
    srgba: FloatArray

    @property
    def normals(self) -> FloatArray:
        """Unit normals by area, shape (V, 3); straight up where a vertex has no area around it."""
        corners = self.vertices_m[self.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        totals = np.zeros_like(self.vertices_m)
        for corner in range(3):
            np.add.at(totals, self.faces[:, corner], across)
        lengths = np.linalg.norm(totals, axis=1, keepdims=True)
        return np.where(lengths > 1e-14, totals / np.maximum(lengths, 1e-14), [0.0, 0.0, 1.0])

    @property
    def bounds_m(self) -> tuple[FloatArray, FloatArray]:
        """The lowest and the highest corner, shape (3,) each."""
        return self.vertices_m.min(axis=0), self.vertices_m.max(axis=0)

    def moved(self, offset_m: ArrayLike) -> Mesh:
        """The mesh shifted by `offset_m`."""
        return Mesh(self.vertices_m + np.asarray(offset_m, dtype=np.float64), self.faces, self.srgba)

    def turned(self, rotation: ArrayLike) -> Mesh:
        """The mesh turned about the origin by a (3, 3) rotation matrix."""
        return Mesh(self.vertices_m @ np.asarray(rotation, dtype=np.float64).T, self.faces, self.srgba)

    def fitted(self, size_m: Sequence[float]) -> Mesh:
        """The mesh stretched so that its bounding box is exactly `size_m`, centred at the origin."""
        low_m, high_m = self.bounds_m
        scale = np.asarray(size_m, dtype=np.float64) / np.maximum(high_m - low_m, 1e-9)
        return Mesh((self.vertices_m - (low_m + high_m) / 2.0) * scale, self.faces, self.srgba)


def rgba(color: Rgb, alpha: float = 1.0) -> FloatArray:
    """An 8-bit display colour as four numbers in 0…1."""
    return np.array([*(channel / 255.0 for channel in color), alpha])


def merge(*parts: Mesh) -> Mesh:
    """All parts as one mesh."""
    if not parts:
        raise SimError("nothing to merge: a mesh needs at least one part")
    starts = np.cumsum([0, *(len(part.vertices_m) for part in parts[:-1])])
    return Mesh(
        np.concatenate([part.vertices_m for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
        np.concatenate([part.srgba for part in parts]),
    )


def painted(vertices_m: FloatArray, faces: NDArray[np.int64], color: Rgb, alpha: float = 1.0) -> Mesh:
    """A mesh of one colour."""
    return Mesh(vertices_m, faces, np.tile(rgba(color, alpha), (len(vertices_m), 1)))


def _strip(rings: FloatArray) -> NDArray[np.int64]:
    # rings (R, N, 3), each counter-clockwise seen from the end the list grows towards
    count, n = rings.shape[:2]
    here = np.arange(count - 1)[:, None] * n + np.arange(n)[None, :]
    beside = np.arange(count - 1)[:, None] * n + (np.arange(n)[None, :] + 1) % n
    lower = np.stack([here, beside, beside + n], axis=-1)
    upper = np.stack([here, beside + n, here + n], axis=-1)
    return np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])


def _fan(ring: FloatArray, *, up: bool) -> tuple[FloatArray, NDArray[np.int64]]:
    n = len(ring)
    vertices = np.concatenate([ring.mean(axis=0, keepdims=True), ring])
    around = np.arange(n)
    faces = np.stack([np.zeros(n, dtype=np.int64), 1 + around, 1 + (around + 1) % n], axis=-1)
    return vertices, faces if up else faces[:, ::-1]


def loft(
    rings_m: Sequence[FloatArray], color: Rgb, *, bottom: bool = True, top: bool = True, flat: bool = False
) -> Mesh:
    """A skin over closed rings of equal length, (N, 3) each, counter-clockwise seen from the last one's side.

    The skin is smooth along and around, except where two neighbouring rings coincide (a sharp rim) and, if `flat`,
    at every corner of the rings. `bottom` and `top` close the ends with flat caps.
    """
    rings = [np.asarray(ring, dtype=np.float64) for ring in rings_m]
    if flat:
        rings = [np.repeat(ring, 2, axis=0) for ring in rings]
        rings = [np.roll(ring, -1, axis=0) for ring in rings]  # pairs now span the sides, not the corners
    parts: list[tuple[FloatArray, NDArray[np.int64]]] = []
    run = [rings[0]]
    for ring in rings[1:]:
        if np.allclose(ring, run[-1]):
            if len(run) > 1:
                parts.append((np.concatenate(run), _strip(np.stack(run))))
            run = [ring]
        else:
            run.append(ring)
    if len(run) > 1:
        parts.append((np.concatenate(run), _strip(np.stack(run))))
    if bottom:
        parts.append(_fan(rings[0], up=False))
    if top:
        parts.append(_fan(rings[-1], up=True))
    return merge(*(painted(vertices, faces, color) for vertices, faces in parts))


def circle(radius_m: float, z_m: float, *, n: int = 20, squash: float = 1.0) -> FloatArray:
    """A horizontal ring; `squash` scales its y radius. Shape (n, 3)."""
    angle = np.arange(n) * (2.0 * np.pi / n)
    return np.stack([radius_m * np.cos(angle), squash * radius_m * np.sin(angle), np.full(n, z_m)], axis=-1)


def rectangle(
    size_x_m: float, size_y_m: float, z_m: float, *, corner_m: float = 0.0, per_corner: int = 4
) -> FloatArray:
    """A horizontal rectangle, with rounded corners if `corner_m` is positive. Shape (N, 3)."""
    x_m, y_m = size_x_m / 2.0, size_y_m / 2.0
    if corner_m <= 0.0:
        return np.array([[x_m, -y_m, z_m], [x_m, y_m, z_m], [-x_m, y_m, z_m], [-x_m, -y_m, z_m]])
    corner_m = min(corner_m, x_m, y_m)
    points: list[FloatArray] = []
    for quadrant, (sign_x, sign_y) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angle = (quadrant + np.linspace(0.0, 1.0, per_corner)) * (np.pi / 2.0)
        points.append(
            np.stack(
                [
                    sign_x * (x_m - corner_m) + corner_m * np.cos(angle),
                    sign_y * (y_m - corner_m) + corner_m * np.sin(angle),
                    np.full(per_corner, z_m),
                ],
                axis=-1,
            )
        )
    return np.concatenate(points)


def lathe(profile_m: Sequence[tuple[float, float]], color: Rgb, *, n: int = 20, squash: float = 1.0) -> Mesh:
    """A body of revolution from (radius, z) pairs going up; repeat a pair for a sharp rim."""
    return loft([circle(radius, z, n=n, squash=squash) for radius, z in profile_m], color)


def box(size_m: Sequence[float], center_m: Sequence[float], color: Rgb, *, bevel_m: float = 0.0) -> Mesh:
    """An upright box; `bevel_m` rounds its vertical edges and chamfers top and bottom."""
    x_m, y_m, z_m = (float(value) for value in size_m)
    half_m = z_m / 2.0
    if bevel_m <= 0.0:
        rings = [rectangle(x_m, y_m, -half_m), rectangle(x_m, y_m, half_m)]
        return loft(rings, color, flat=True).moved(center_m)
    inner = (x_m - 2 * bevel_m, y_m - 2 * bevel_m)
    corner_m = bevel_m * 1.5
    low = rectangle(x_m, y_m, -half_m + bevel_m, corner_m=corner_m)
    high = rectangle(x_m, y_m, half_m - bevel_m, corner_m=corner_m)
    rings = [
        rectangle(*inner, -half_m, corner_m=corner_m / 2),
        low,
        low,
        high,
        high,
        rectangle(*inner, half_m, corner_m=corner_m / 2),
    ]
    return loft(rings, color).moved(center_m)


def rod(start_m: Sequence[float], end_m: Sequence[float], radius_m: float, color: Rgb, *, n: int = 10) -> Mesh:
    """A straight round rod between two points."""
    start, end = np.asarray(start_m, dtype=np.float64), np.asarray(end_m, dtype=np.float64)
    along = end - start
    length_m = float(np.linalg.norm(along))
    if length_m <= 0.0:
        raise SimError(f"a rod needs two different ends, both are {tuple(start)}")
    axis = along / length_m
    aside = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    aside /= np.linalg.norm(aside)
    frame = np.stack([aside, np.cross(axis, aside), axis], axis=1)
    straight = loft([circle(radius_m, 0.0, n=n), circle(radius_m, length_m, n=n)], color)
    return straight.turned(frame).moved(start)


def ball(radius_m: float, color: Rgb, *, n: int = 14) -> Mesh:
    """A sphere about the origin."""
    angle = np.linspace(-np.pi / 2.0, np.pi / 2.0, n // 2 + 1)
    rings = [circle(radius_m * max(float(np.cos(a)), 1e-3), radius_m * float(np.sin(a)), n=n) for a in angle]
    return loft(rings, color)


def glow(radius_m: float, color: Rgb, alpha: float, *, n: int = 24, squash: float = 1.0, core: float = 0.35) -> Mesh:
    """A flat disc facing up whose opacity falls from `alpha` to 0 at the rim: a soft shadow. For `blend`."""
    shares = np.linspace(core, 1.0, 5)
    opacity = alpha * (1.0 - np.linspace(0.0, 1.0, 5) ** 2 * (3.0 - 2.0 * np.linspace(0.0, 1.0, 5)))
    rings = np.stack([circle(radius_m * share, 0.0, n=n, squash=squash) for share in shares])
    vertices = np.concatenate([np.zeros((1, 3)), rings.reshape(-1, 3)])
    # The rings grow outwards in one plane, so the strip faces down: turn it over.
    _, fan = _fan(rings[0], up=True)
    faces = np.concatenate([fan, _strip(rings)[:, ::-1] + 1])
    colors = np.tile(rgba(color), (len(vertices), 1))
    colors[:, 3] = np.concatenate([[alpha], np.repeat(opacity, n)])
    return Mesh(vertices, faces, colors)


def linear_rgb(srgb: FloatArray) -> FloatArray:
    """Display colours to the linear ones a GLB stores (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def display_rgb(linear: FloatArray) -> FloatArray:
    """The way back of `linear_rgb`."""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0.0) ** (1.0 / 2.4) - 0.055)


def to_glb(mesh: Mesh, material: Material = "lit") -> bytes:
    """The mesh as binary glTF 2.0 with vertex colours, and normals if it is lit (a viewer shades flat without).

    `lit` is a matt surface, `unlit` shows the colours as they are, `blend` is unlit and transparent by vertex alpha.

    Raises:
        SimError: no triangles, or coordinates that are not finite.
    """
    if not len(mesh.faces) or not np.all(np.isfinite(mesh.vertices_m)):
        raise SimError(f"a mesh needs triangles and finite vertices, got {len(mesh.faces)} triangles")
    positions = mesh.vertices_m.astype("<f4")
    linear = np.concatenate([linear_rgb(mesh.srgba[:, :3]), mesh.srgba[:, 3:]], axis=1)
    # Eight bits do for surfaces that are shaded anyway; soft gradients in the dark need sixteen.
    steps, kind, component_type = (255.0, "u1", 5121) if material == "lit" else (65535.0, "<u2", 5123)
    colors = np.round(np.clip(linear, 0.0, 1.0) * steps).astype(kind)
    small = len(positions) <= 65535
    indices = mesh.faces.reshape(-1).astype("<u2" if small else "<u4")
    # In 127 steps normals compress well and nobody sees the difference.
    normals = (np.round(mesh.normals * 127.0) / 127.0).astype("<f4")
    # Columns: attribute, bytes, component type, count, shape. 5121 = uint8, 5123 = uint16, 5125 = uint32, 5126 = float.
    streams = [("POSITION", positions.tobytes(), 5126, len(positions), "VEC3")]
    if material == "lit":
        streams.append(("NORMAL", normals.tobytes(), 5126, len(normals), "VEC3"))
    streams.append(("COLOR_0", colors.tobytes(), component_type, len(colors), "VEC4"))
    attributes = {name: number for number, (name, *_) in enumerate(streams)}
    streams.append(("", indices.tobytes(), 5123 if small else 5125, len(indices), "SCALAR"))
    accessors: list[dict[str, object]] = []
    views: list[dict[str, object]] = []
    start = 0
    for name, data, component, count, shape in streams:
        accessor: dict[str, object] = {"bufferView": len(views), "componentType": component, "count": count}
        accessor["type"] = shape
        if name == "POSITION":
            accessor["min"], accessor["max"] = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
        if name == "COLOR_0":
            accessor["normalized"] = True
        accessors.append(accessor)
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(data), "target": 34962 if name else 34963})
        start += len(data)
    look: dict[str, object] = {
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.75},
        "alphaMode": "BLEND" if material == "blend" else "OPAQUE",
    }
    document: dict[str, object] = {
        "asset": {"version": "2.0", "generator": "shared-autonomy-lab"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": len(streams) - 1, "material": 0}]}],
        "materials": [look],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": start}],
    }
    if material != "lit":
        look["extensions"] = {"KHR_materials_unlit": {}}
        document["extensionsUsed"] = ["KHR_materials_unlit"]
    return _packed(document, b"".join(data for _, data, *_ in streams))


def cap_glb(glb: bytes) -> bytes:
    """What fills a body of `to_glb` where a near plane cuts it open: its triangles, seen from within, in one colour.

    From outside nothing of it is seen. The colour is the body's own on average, darker, and takes no light: the cut
    looks like a cut through something solid.
    """
    (length,) = struct.unpack_from("<I", glb, 12)
    document, binary = json.loads(glb[20 : 20 + length]), glb[28 + length :]
    accessors, views = document["accessors"], document["bufferViews"]
    attributes = document["meshes"][0]["primitives"][0]["attributes"]

    def read(number: int, kind: str, width: int) -> NDArray[np.generic]:
        start, size = views[number]["byteOffset"], views[number]["byteLength"]
        return np.frombuffer(binary[start : start + size], dtype=kind).reshape(-1, width)

    indices = document["meshes"][0]["primitives"][0]["indices"]
    number, shades = attributes["COLOR_0"], accessors[attributes["COLOR_0"]]["componentType"]
    kind, steps = ("u1", 255.0) if shades == 5121 else ("<u2", 65535.0)
    color = read(number, kind, 4)[:, :3].mean(axis=0) / steps * CAP_SHADE
    faces = read(indices, "<u2" if accessors[indices]["componentType"] == 5123 else "<u4", 3)
    streams = (binary[: views[attributes["POSITION"]]["byteLength"]], faces[:, ::-1].tobytes())
    document["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}]
    document["accessors"] = [accessors[attributes["POSITION"]], {**accessors[indices], "bufferView": 1}]
    document["bufferViews"] = [
        {"buffer": 0, "byteOffset": 0, "byteLength": len(streams[0]), "target": 34962},
        {"buffer": 0, "byteOffset": len(streams[0]), "byteLength": len(streams[1]), "target": 34963},
    ]
    document["buffers"] = [{"byteLength": len(streams[0]) + len(streams[1])}]
    document["materials"] = [
        {
            "pbrMetallicRoughness": {"baseColorFactor": [*color.tolist(), 1.0], "metallicFactor": 0.0},
            "extensions": {"KHR_materials_unlit": {}},
        }
    ]
    document["extensionsUsed"] = ["KHR_materials_unlit"]
    return _packed(document, b"".join(streams))


CAP_SHADE = 0.45
"""How bright the colour of a cut is, beside the body's own (linear)."""


def _packed(document: dict[str, object], binary: bytes) -> bytes:
    """A glTF document and its buffer as one GLB."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    total = 12 + 8 + len(text) + 8 + len(binary)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, total),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(binary), b"BIN\0"),
            binary,
        ]
    )
