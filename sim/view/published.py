"""The Fetch's published meshes, made small once and kept in the user's cache.

The PyPI package `rtb-data` carries Fetch Robotics' meshes. They are licensed CC BY-NC-SA 4.0 (not for commercial
use), hence a dependency of the extra `meshes` and never a file of this project; neither are the small copies, which
stay in `$XDG_CACHE_HOME/shared-autonomy-lab` (else `~/.cache/shared-autonomy-lab`).
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim.interface import Rgb, SimError
from sim.view.meshes import Mesh, merge, to_glb

BAKE_VERSION = 4
"""Raise it when what is baked changes: the cache is keyed by it."""

_CHARCOAL: Rgb = (74, 78, 86)
_BLACK: Rgb = (34, 36, 40)
_BLUE: Rgb = (34, 124, 190)
_RED: Rgb = (200, 30, 30)


@dataclass(frozen=True)
class _Part:
    """One published mesh, where it sits in the frame of the link it is drawn with, and its colour if it has none."""

    file: str
    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    roll_rad: float = 0.0
    color: Rgb = _CHARCOAL
    keep: float = 0.15
    """Share of the triangles that is kept."""
    bold: int = 3
    """How fast the simplifier raises its threshold; a higher value gets further down and is rougher."""


# Frames and offsets are those of the published fetch.urdf. Parts that never move against a link are drawn with it.
_PARTS: Mapping[str, tuple[_Part, ...]] = {
    "base_link": (
        _Part("base_link.dae", keep=0.05, bold=5),
        _Part("torso_fixed_link.dae", (-0.086875, 0.0, 0.377425), color=_BLUE, keep=0.6),
        _Part("estop_link.dae", (-0.12465, 0.23892, 0.31127), roll_rad=np.pi / 2, color=_RED, keep=0.03),
        _Part("r_wheel_link.STL", (0.0012914, -0.18738, 0.055325), color=_BLACK, keep=0.05),
        _Part("l_wheel_link.STL", (0.0012914, 0.18738, 0.055325), color=_BLACK, keep=0.05),
    ),
    "torso_lift_link": (
        _Part("torso_lift_link.dae", keep=0.055),
        _Part("bellows_link.STL", color=_BLACK, keep=0.12),
    ),
    "head_pan_link": (_Part("head_pan_link.dae", keep=0.12),),
    "head_tilt_link": (_Part("head_tilt_link.dae", keep=0.15),),
    "shoulder_pan_link": (_Part("shoulder_pan_link.dae", keep=0.09),),
    "shoulder_lift_link": (_Part("shoulder_lift_link.dae", color=_BLUE, keep=0.09),),
    "upperarm_roll_link": (_Part("upperarm_roll_link.dae", keep=0.15),),
    "elbow_flex_link": (_Part("elbow_flex_link.dae", color=_BLUE, keep=0.16),),
    "forearm_roll_link": (_Part("forearm_roll_link.dae", keep=0.13),),
    "wrist_flex_link": (_Part("wrist_flex_link.dae", color=_BLUE, keep=0.2),),
    "wrist_roll_link": (_Part("wrist_roll_link.dae", keep=0.16),),
    "gripper_link": (_Part("gripper_link.dae", color=_CHARCOAL, keep=0.16),),
    "r_gripper_finger_link": (_Part("r_gripper_finger_link.STL", (0.0, 0.101425, 0.0), keep=0.9),),
    "l_gripper_finger_link": (_Part("l_gripper_finger_link.STL", (0.0, -0.101425, 0.0), keep=0.9),),
}
LINKS = tuple(_PARTS)
_READERS: Mapping[str, str] = {
    "trimesh": "trimesh",
    "fast-simplification": "fast_simplification",
    "pycollada": "collada",
    "pillow": "PIL",
}
"""What reads them and makes them small: package → what is imported of it."""


def cache_dir(environment: Mapping[str, str] | None = None) -> Path:
    """Where baked meshes are kept: `$XDG_CACHE_HOME` if absolute (as its specification asks), else `~/.cache`."""
    variables = os.environ if environment is None else environment
    named = variables.get("XDG_CACHE_HOME", "")
    base = Path(named) if named and Path(named).is_absolute() else Path.home() / ".cache"
    return base / "shared-autonomy-lab"


def published_meshes_dir() -> Path | None:
    """The folder of the Fetch's meshes inside `rtb-data`, or None when the package is not installed."""
    spec = importlib.util.find_spec("rtbdata")
    if spec is None or not spec.submodule_search_locations:
        return None
    folder = Path(next(iter(spec.submodule_search_locations))) / "xacro" / "fetch_description" / "meshes"
    return folder if folder.is_dir() else None


def why_missing() -> str:
    """What has to be installed before the published meshes can be drawn, in one line; "" for nothing."""
    missing = [package for package, module in _READERS.items() if importlib.util.find_spec(module) is None]
    if published_meshes_dir() is None:
        missing.insert(0, "rtb-data 1.1.0")
    if not missing:
        return ""
    return f"the Fetch's published meshes are not installed ({', '.join(missing)}): install the extra `meshes`"


def published_glbs(cache: Path | None = None, source: Path | None = None) -> Mapping[str, bytes]:
    """A GLB per link: from the cache, else baked into it.

    Args:
        cache: folder of baked meshes; `cache_dir()` when None. One that cannot be written costs only the next start.
        source: folder of the published meshes; looked up when None.

    Raises:
        SimError: they are not installed, or cannot be read.
    """
    folder = published_meshes_dir() if source is None else source
    if folder is None:
        raise SimError(why_missing())
    try:
        version = importlib.metadata.version("rtb-data")
    except importlib.metadata.PackageNotFoundError:
        version = "unversioned"
    key = hashlib.sha256(f"{BAKE_VERSION}|{version}|{_PARTS!r}".encode()).hexdigest()[:12]
    home = (cache_dir() if cache is None else cache) / f"fetch-{key}"
    glb_by_link: dict[str, bytes] = {}
    try:
        for link in LINKS:
            kept = _read(home / f"{link}.glb")
            if kept is None:
                kept = bake_link(link, folder)
                _write_whole(home / f"{link}.glb", kept)
            glb_by_link[link] = kept
    except Exception as error:  # third-party loaders raise anything
        raise SimError(why_missing() or f"the Fetch's published meshes could not be prepared ({error!r})") from error
    return glb_by_link


def bake_link(link: str, source: Path) -> bytes:
    """One link's published meshes, decimated and coloured by vertex, as a GLB in the link's frame.

    Raises:
        SimError: an unknown link.
        ImportError, OSError: trimesh, its readers or the files are missing.
    """
    if link not in _PARTS:
        raise SimError(f"no mesh for link {link!r}; there are {list(_PARTS)}")
    return to_glb(merge(*(_load(part, source) for part in _PARTS[link])))


def _load(part: _Part, source: Path) -> Mesh:
    import trimesh  # slow to import, and only needed the first time

    scene: Any = trimesh.load_scene(source / part.file)
    pieces = [_thinned(solid, _face_colors(solid, part.color), part) for solid in scene.dump(concatenate=False)]
    mesh = merge(*pieces)
    cos, sin = np.cos(part.roll_rad), np.sin(part.roll_rad)
    return mesh.turned([[1, 0, 0], [0, cos, -sin], [0, sin, cos]]).moved(part.offset_m)


def _face_colors(solid: Any, fallback: Rgb) -> np.ndarray:
    """Display colour of each face in few steps, shape (F, 3): from the texture or the material, else `fallback`."""
    count = len(solid.faces)
    plain = np.tile(np.asarray(fallback, dtype=np.int64), (count, 1))
    material = getattr(solid.visual, "material", None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    uv = getattr(solid.visual, "uv", None)
    if image is None or uv is None:
        factor = getattr(material, "baseColorFactor", None)
        return plain if factor is None else np.tile(np.asarray(factor[:3], dtype=np.int64), (count, 1))
    texels = np.asarray(image.convert("RGB"))
    middle = np.asarray(uv)[np.asarray(solid.faces)].mean(axis=1) % 1.0
    rows = np.minimum(((1.0 - middle[:, 1]) * texels.shape[0]).astype(int), texels.shape[0] - 1)
    columns = np.minimum((middle[:, 0] * texels.shape[1]).astype(int), texels.shape[1] - 1)
    # In few steps: every change of colour doubles vertices.
    in_steps: np.ndarray = np.clip((texels[rows, columns].astype(np.int64) + 24) // 48 * 48, 0, 255)
    return in_steps


def _thinned(solid: Any, face_colors: np.ndarray, part: _Part) -> Mesh:
    """The solid with `part.keep` of its triangles, each coloured as the nearest one it had before."""
    import fast_simplification

    corners = np.asarray(solid.vertices)[np.asarray(solid.faces)]
    # Seams of the texture are no edges: join what lies within 10 µm, and drop the slivers this leaves, for with
    # them in, the simplifier tears whole sides away.
    grid, joined = np.unique(np.round(np.asarray(solid.vertices) * 1e5), axis=0, return_inverse=True)
    points, triangles = grid / 1e5, joined.reshape(-1)[np.asarray(solid.faces)]
    sides = np.stack([triangles[:, i] != triangles[:, (i + 1) % 3] for i in range(3)])
    triangles = triangles[np.all(sides, axis=0)]
    if part.keep < 1.0 and len(triangles) > 60:
        points, triangles = fast_simplification.simplify(
            np.ascontiguousarray(points, dtype=np.float32),
            np.ascontiguousarray(triangles, dtype=np.int32),
            target_reduction=1.0 - part.keep,
            agg=part.bold,
        )
    points, triangles = np.asarray(points, dtype=np.float64), np.asarray(triangles, dtype=np.int64)
    nearest = _nearest(points[triangles].mean(axis=1), corners.mean(axis=1))
    return _creased(points, triangles, face_colors[nearest])


def _nearest(wanted_m: np.ndarray, among_m: np.ndarray) -> np.ndarray:
    """Index of the nearest of `among_m` (M, 3) to each of `wanted_m` (N, 3)."""
    squares = np.einsum("ij,ij->i", among_m, among_m)
    return np.concatenate(
        [
            np.argmin(squares[None, :] - 2.0 * block @ among_m.T, axis=1)
            for block in np.array_split(wanted_m, max(1, len(wanted_m) * len(among_m) // 4_000_000))
        ]
    )


def _creased(points: np.ndarray, triangles: np.ndarray, face_colors: np.ndarray, crease_rad: float = 0.7) -> Mesh:
    """Doubles vertices where two faces meet at more than `crease_rad` or differ in colour, so that edges look sharp.

    Corners of faces that meet smoothly are joined by passing the lowest label across their shared edges.
    """
    corner_points = points[triangles]
    normals = np.cross(corner_points[:, 1] - corner_points[:, 0], corner_points[:, 2] - corner_points[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    triangles, normals = triangles[lengths > 1e-12], normals[lengths > 1e-12]
    face_colors = face_colors[lengths > 1e-12]
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    count = len(triangles)
    # The three edges of each face as (lower vertex, higher vertex), with the face's corners at them.
    first, second = np.array([0, 1, 2]), np.array([1, 2, 0])
    start, end = triangles[:, first].reshape(-1), triangles[:, second].reshape(-1)
    corner_start = (np.arange(count)[:, None] * 3 + first).reshape(-1)
    corner_end = (np.arange(count)[:, None] * 3 + second).reshape(-1)
    turned = start > end
    low, high = np.where(turned, end, start), np.where(turned, start, end)
    corner_low, corner_high = np.where(turned, corner_end, corner_start), np.where(turned, corner_start, corner_end)
    order = np.lexsort((high, low))
    here, there = order[:-1], order[1:]
    same = (low[here] == low[there]) & (high[here] == high[there])
    here, there = here[same], there[same]
    smooth = np.einsum("ij,ij->i", normals[here // 3], normals[there // 3]) > np.cos(crease_rad)
    smooth &= np.all(face_colors[here // 3] == face_colors[there // 3], axis=1)
    here, there = here[smooth], there[smooth]
    left = np.concatenate([corner_low[here], corner_high[here]])
    right = np.concatenate([corner_low[there], corner_high[there]])
    labels = np.arange(3 * count)
    while True:
        before = labels.copy()
        np.minimum.at(labels, left, before[right])
        np.minimum.at(labels, right, before[left])
        if np.array_equal(before, labels):
            break
    kept, faces = np.unique(labels, return_inverse=True)
    colors = np.concatenate([face_colors[kept // 3] / 255.0, np.ones((len(kept), 1))], axis=1)
    return Mesh(points[triangles.reshape(-1)[kept]], faces.reshape(-1, 3).astype(np.int64), colors)


def _read(path: Path) -> bytes | None:
    try:
        data = path.read_bytes()
    except OSError:
        return None
    complete = len(data) > 12 and data[:4] == b"glTF" and int.from_bytes(data[8:12], "little") == len(data)
    return data if complete else None


def _write_whole(path: Path, data: bytes) -> None:
    """Write so that other processes see all of the file or none of it; not being able to write is no error."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            os.replace(temporary, path)
        except OSError:
            Path(temporary).unlink(missing_ok=True)
    except OSError:
        pass
