"""OBJ files as meshes, and what is wrong with one told with its line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.interface import Look, ObjectSpec, Shape, SimError
from sim.view import props
from sim.view.meshes import box, merge, to_glb
from sim.view.wavefront import MOST_TRIANGLES, read_obj, silhouette

CORNERS = "".join(f"v {x} {y} {z}\n" for z in (0, 2) for y in (0, 1) for x in (0, 1))
BOX = CORNERS + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf -7 -5 -1 -3\n"
RED = (255, 0, 0)
JUG = ObjectSpec("jug", "jug", "box", (0.06, 0.05, 0.12), 0.3, 0.65, 0.1, Look(RED, mesh_obj=BOX))


def test_faces_without_normals_are_flat_and_have_the_objects_colour() -> None:
    mesh = read_obj(f"# a box\nmtllib none.mtl\no box\n{BOX}", RED)
    assert (len(mesh.faces), len(mesh.vertices_m)) == (12, 24)
    assert np.all(mesh.srgba == [1, 0, 0, 1])
    assert sorted(map(tuple, mesh.normals.round(6).tolist())) == sorted(
        4 * [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    )


def test_normals_decide_which_faces_share_a_vertex() -> None:
    smooth = "\n".join(
        " ".join([words[0], *(f"{corner}//1" for corner in words[1:])]) if words[0] == "f" else " ".join(words)
        for words in (line.split() for line in BOX.splitlines())
    )
    assert len(read_obj(smooth, RED).vertices_m) == 8


def test_vertices_may_have_colours() -> None:
    mesh = read_obj("v 0 0 0 1 0.5 0\nv 1 0 1 0 0 1\nv 0 1 0 0 0 1\nf 1/1 2/2 3/3\n", RED)
    np.testing.assert_array_equal(mesh.srgba, [[1, 0.5, 0, 1], [0, 0, 1, 1], [0, 0, 1, 1]])


def test_a_mesh_is_drawn_at_the_objects_size() -> None:
    low_m, high_m = props.object_mesh(JUG).bounds_m
    np.testing.assert_allclose(high_m - low_m, JUG.size_m, atol=1e-12)
    np.testing.assert_allclose(high_m + low_m, 0.0, atol=1e-12)
    assert to_glb(props.object_mesh(JUG)).startswith(b"glTF")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no faces: a mesh has lines that begin with v and lines that begin with f"),
        ("v 0 0 0\n", "no faces"),
        ("v 0 0\n", "line 1: v 0 0: a vertex has three numbers"),
        ("v 0 0 nan\n", "line 1: v 0 0 nan: a vertex has three numbers"),
        ("v 0 0 x\n", "line 1: could not convert string to float: 'x'"),
        ("v 0 0 0 255 0 0\n", "line 1: v 0 0 0 255 0 0: a colour's numbers are from 0 to 1"),
        (CORNERS + "f 1 2\n", "line 9: f 1 2: a face has at least three corners"),
        (CORNERS + "\nf 1 2 9\n", "line 10: corner 9: there are 8 vertices so far"),
        (CORNERS + "f 0 1 2\n", "line 9: corner 0: there are 8 vertices so far"),
        (CORNERS + "f 1 2 -9\n", "line 9: corner -9: there are 8 vertices so far"),
        (CORNERS + "f 1 2 3\n", "flat along z: a mesh has some size along x, y and z"),
        (
            CORNERS + "f 1 2 3\n" * (MOST_TRIANGLES + 1),
            f"line {MOST_TRIANGLES + 9}: more than {MOST_TRIANGLES}",
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_line(text: str, says: str) -> None:
    with pytest.raises(SimError) as caught:
        read_obj(text, RED)
    assert says in str(caught.value)


def test_a_silhouette_shows_holes_and_the_robots_left_on_the_left() -> None:
    assert silhouette(read_obj(BOX, RED), rows=2) == "M0.0 0.0H100.0v50.4H0.0zM0.0 50.0H100.0v50.4H0.0z"
    beam, wide, narrow = (
        box(size, middle, RED)
        for size, middle in (((1, 10, 8), (0, 5, 12)), ((1, 4, 8), (0, 2, 4)), ((1, 2, 8), (0, 9, 4)))
    )
    gate = "M0.0 0.0H100.0v50.4H0.0zM0.0 50.0H20.0v50.4H0.0zM60.0 50.0H100.0v50.4H60.0z"
    assert silhouette(merge(beam, wide, narrow), rows=2) == gate


@pytest.mark.parametrize("shape", ["cylinder", "box"])
@pytest.mark.parametrize("color", [RED, (250, 250, 248)])
def test_an_object_without_a_drawing_is_its_shape_in_its_colour_with_a_band(
    shape: Shape, color: tuple[int, int, int]
) -> None:
    spec = replace(JUG, shape=shape, size_m=(0.06, 0.06, 0.12), look=Look(color))
    mesh = props.object_mesh(spec)
    low_m, high_m = mesh.bounds_m
    np.testing.assert_allclose(high_m - low_m, spec.size_m, atol=1e-12)
    shown = {tuple(np.round(rgb * 255).astype(int).tolist()) for rgb in mesh.srgba[:, :3]}
    assert shown == {color, props.DARK if min(color) > 200 else props.WHITE}


def test_an_object_may_be_drawn_as_one_that_ships() -> None:
    drawn = props.object_mesh(replace(JUG, look=Look(drawing="spray_bottle")))
    assert len(drawn.faces) > 200
    with pytest.raises(SimError, match="no drawing 'teapot'; drawings are spray_bottle, "):
        props.object_mesh(replace(JUG, look=Look(drawing="teapot")))
