"""Meshes have the sizes the physics has, and a GLB says what a mesh says."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
import pytest

from sim.interface import ObjectSpec, SimError
from sim.view import props
from sim.view.meshes import Mesh, box, linear_rgb, loft, merge, rectangle, rod, to_glb
from tests.support.shipped_world import ARC, OBJECTS


def parsed(glb: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The JSON of a GLB, and its attributes and indices by name."""
    magic, version, length = struct.unpack("<4sII", glb[:12])
    assert (magic, version, length) == (b"glTF", 2, len(glb))
    (size,) = struct.unpack("<I", glb[12:16])
    document = json.loads(glb[20 : 20 + size])
    data = glb[20 + size + 8 :]
    primitive = document["meshes"][0]["primitives"][0]
    kinds = {5126: "<f4", 5121: "u1", 5123: "<u2", 5125: "<u4"}
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}

    def array(number: int) -> np.ndarray:
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        raw = data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        assert view["byteOffset"] % 4 == 0, "accessors must be aligned"
        values = np.frombuffer(raw, kinds[accessor["componentType"]])
        assert len(values) == accessor["count"] * width[accessor["type"]]
        return values.reshape(accessor["count"], -1)

    arrays = {name: array(number) for name, number in primitive["attributes"].items()}
    return document, {**arrays, "indices": array(primitive["indices"]).reshape(-1, 3)}


def box_of(mesh: Mesh) -> np.ndarray:
    low_m, high_m = mesh.bounds_m
    return high_m - low_m


@pytest.mark.parametrize("spec", OBJECTS.values(), ids=lambda spec: spec.id)
def test_an_object_is_drawn_as_large_as_it_is(spec: ObjectSpec) -> None:
    low_m, high_m = props.object_mesh(spec).bounds_m
    np.testing.assert_allclose(high_m, np.array(spec.size_m) / 2, atol=1e-9)
    np.testing.assert_allclose(low_m, -np.array(spec.size_m) / 2, atol=1e-9)


def test_every_object_has_a_shape_of_its_own_and_an_unknown_one_a_plain_one() -> None:
    looks = {spec.id: props.object_mesh(spec) for spec in OBJECTS.values()}
    assert len({(len(mesh.faces), mesh.srgba.tobytes()) for mesh in looks.values()}) == len(OBJECTS)
    for shape in ("cylinder", "box"):
        unknown = ObjectSpec("unheard_of", "", shape, (0.05, 0.05, 0.2), 0.1, 0.5, 0.1)
        np.testing.assert_allclose(box_of(props.object_mesh(unknown)), unknown.size_m)


def dominant_lab(mesh: Mesh, transform: np.ndarray) -> np.ndarray:
    """CIELAB of the colour that covers most of a mesh, seen through a linear-RGB `transform` (3, 3)."""
    corners = mesh.vertices_m[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    colors, which = np.unique(mesh.srgba[mesh.faces[:, 0], :3], axis=0, return_inverse=True)
    most = colors[np.argmax(np.bincount(which.reshape(-1), weights=area))]
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ np.clip(transform @ linear_rgb(most), 0, 1) / np.array([0.9505, 1.0, 1.089])
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


# Linear-RGB simulations of complete protanopia and deuteranopia (Machado, Oliveira, Fernandes 2009, severity 1).
PROTANOPIA = np.array(
    [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
)
DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
)


@pytest.mark.parametrize("sight", [np.eye(3), PROTANOPIA, DEUTERANOPIA], ids=["full", "protanopia", "deuteranopia"])
def test_the_main_colours_of_the_objects_differ_to_any_eye(sight: np.ndarray) -> None:
    looks = {spec.id: dominant_lab(props.object_mesh(spec), sight) for spec in OBJECTS.values()}
    pairs = [(a, b) for a in looks for b in looks if a < b]
    # A difference of 10 is seen at a glance (2 is just noticeable).
    too_close = {pair: float(np.linalg.norm(looks[pair[0]] - looks[pair[1]])) for pair in pairs}
    assert not {pair: gap for pair, gap in too_close.items() if gap < 10}


def test_table_and_bins_stand_where_the_physics_has_them() -> None:
    layout = ARC
    table = props.table_mesh(layout.table).moved(layout.table.center_world_m)
    low_m, high_m = table.bounds_m
    assert high_m[2] == pytest.approx(layout.table.top_z_m, abs=0.001)
    assert low_m[2] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(high_m[:2] - low_m[:2], layout.table.size_m[:2], atol=1e-9)
    left, right = (props.bin_mesh(target) for target in layout.bins)
    for target, mesh in zip(layout.bins, (left, right), strict=True):
        assert mesh.bounds_m[1][2] == pytest.approx(target.height_m, abs=0.001)
        assert np.all(box_of(mesh)[:2] >= target.inner_size_m)
    assert [target.letter for target in layout.bins] == ["L", "R"]
    assert not np.array_equal(left.srgba[0], right.srgba[0])


def test_triangles_face_outwards() -> None:
    plain = box((0.2, 0.4, 0.6), (0, 0, 0), (1, 2, 3))
    assert np.all(np.einsum("ij,ij->i", plain.normals, plain.vertices_m) > 0)
    round_edged = box((0.2, 0.4, 0.6), (0, 0, 0), (1, 2, 3), bevel_m=0.02)
    stick = rod((0, 0, 0), (0.3, -0.2, 0.5), 0.01, (1, 2, 3))
    for mesh in (plain, round_edged, stick):
        corners = mesh.vertices_m[mesh.faces]
        volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
        assert volume > 0
    assert np.all(props.shadow_mesh(0.1, 0.1).normals[:, 2] > 0.99)
    assert np.all(props.floor_mesh().normals[:, 2] > 0.99)


def test_a_glb_holds_what_the_mesh_held() -> None:
    mesh = merge(box((1, 1, 1), (0, 0, 0), (255, 0, 0)), box((1, 1, 1), (2, 0, 0), (0, 0, 128)))
    document, arrays = parsed(to_glb(mesh))
    np.testing.assert_allclose(arrays["POSITION"], mesh.vertices_m, atol=1e-6)
    np.testing.assert_array_equal(arrays["indices"], mesh.faces)
    np.testing.assert_allclose(arrays["NORMAL"], mesh.normals, atol=0.01)
    np.testing.assert_allclose(arrays["COLOR_0"][0] / 255, [1, 0, 0, 1])
    assert arrays["COLOR_0"][-1][2] / 255 == pytest.approx(0.2158, abs=2e-3)  # sRGB 128 is 21.6 % of the light
    assert "extensions" not in document["materials"][0]
    unlit, _ = parsed(to_glb(mesh, "unlit"))
    assert unlit["extensionsUsed"] == ["KHR_materials_unlit"]
    assert parsed(to_glb(mesh, "blend"))[0]["materials"][0]["alphaMode"] == "BLEND"


@pytest.mark.parametrize(
    "make",
    [
        lambda: merge(),
        lambda: rod((0, 0, 0), (0, 0, 0), 0.1, (0, 0, 0)),
        lambda: to_glb(loft([rectangle(1, 1, 0), rectangle(1, 1, float("nan"))], (0, 0, 0))),
    ],
    ids=["empty", "no length", "not finite"],
)
def test_what_is_no_mesh_is_refused(make: Any) -> None:
    with pytest.raises(SimError):
        make()
