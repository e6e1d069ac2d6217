"""The robot's looks: both fit the robot that moves; which is drawn is what was asked for, or is told."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from sim import fetch
from sim.interface import SimError
from sim.view import looks, published
from sim.view.bodies import Section, drum, rounded, sweep
from sim.view.light import baked
from sim.view.looks import AskedLook, RobotLook, chosen, own_look, robot_look
from sim.view.meshes import ball
from study.definition.sections import ViewSettings
from tests.sim.view.test_meshes import parsed

LIMIT_BYTES = 500_000
"""What all meshes of a look may weigh together: a page loads them."""
MOST_TRIANGLES = 12_525
"""What the published meshes have when they are baked: a browser without a graphics card draws them all the time."""
BODY = ("base_link", "torso_lift_link", "head_pan_link", "head_tilt_link")


def points_m(look: RobotLook) -> dict[str, np.ndarray]:
    """The vertices of each link in its frame."""
    return {link: parsed(glb)[1]["POSITION"].astype(float) for link, glb in look.glb_by_link.items()}


# ---- the lab's own


def test_the_own_look_is_whole_small_and_the_same_each_time() -> None:
    look = own_look()
    assert look.name == "own" and not look.note
    assert set(look.glb_by_link) == set(published.LINKS) <= set(fetch.LINK_NAMES)
    assert sum(map(len, look.glb_by_link.values())) < LIMIT_BYTES
    triangles = 0
    for glb in look.glb_by_link.values():
        _, arrays = parsed(glb)
        assert arrays["indices"].max() < len(arrays["POSITION"])
        triangles += len(arrays["indices"])
    assert triangles < MOST_TRIANGLES
    told = "from sim.view.looks import own_look; print(own_look().facts['look_sha256'])"
    again = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert again.stdout.strip() == look.facts["look_sha256"]


def test_what_stands_still_is_unlit_and_what_moves_is_lit() -> None:
    for link, glb in own_look().glb_by_link.items():
        document, arrays = parsed(glb)
        still = link in BODY
        assert ("KHR_materials_unlit" in document["materials"][0].get("extensions", {})) == still
        assert ("NORMAL" in arrays) != still


def test_own_links_meet_at_the_joints_of_the_kinematics() -> None:
    """Each link of the arm reaches round the joint that moves it, and round the one that it moves."""
    points = points_m(own_look())
    chain = [
        *fetch.ARM_JOINTS[1:],
        fetch.ArmJoint("", "gripper_link", (fetch.GRIPPER_OFFSET_M, 0, 0), (1, 0, 0), 0, 0, 0, 0),
    ]
    for before, joint in zip(fetch.ARM_JOINTS, chain, strict=True):
        mesh = points[before.child]
        assert np.all(mesh.min(axis=0) < 0.0) and np.all(mesh.max(axis=0) > 0.0), before.child
        if joint.child != "gripper_link" and joint.axis == (0.0, 1.0, 0.0):
            # A flex joint: its drum stands round the axis, in x and z, as far as the drum of the next link does.
            radius_m = np.abs(points[joint.child][:, 2]).max()
            near = np.hypot(*(mesh - joint.origin_m)[:, [0, 2]].T)
            assert mesh[:, 0].max() - joint.origin_m[0] == pytest.approx(radius_m, abs=0.001)
            assert np.count_nonzero(near < radius_m + 0.001) > 100
    wrist_m = points["wrist_roll_link"][:, 0].max() - fetch.GRIPPER_OFFSET_M
    assert points["gripper_link"][:, 0].min() < wrist_m, "no gap between wrist and gripper"


def test_the_own_palm_is_the_one_of_the_physics() -> None:
    palm = points_m(own_look())["gripper_link"]
    low_m, high_m = (np.array(fetch.PALM_CENTER_M) + sign * np.array(fetch.PALM_SIZE_M) / 2 for sign in (-1, 1))
    assert palm[:, 0].max() == pytest.approx(high_m[0], abs=0.003)
    np.testing.assert_allclose([palm[:, 1].min(), palm[:, 1].max()], [low_m[1], high_m[1]], atol=0.001)
    np.testing.assert_allclose([palm[:, 2].min(), palm[:, 2].max()], [low_m[2], high_m[2]], atol=0.004)


@pytest.mark.parametrize("opening_m", [0.0, 0.06, fetch.MAX_OPENING_M])
def test_the_own_fingers_are_those_of_the_physics(opening_m: float) -> None:
    points, poses = points_m(own_look()), fetch.link_poses((0.0,) * 7, opening_m)
    tip_m = fetch.FINGER_CENTER_X_M + fetch.FINGER_SIZE_M[0] / 2.0
    for finger, side in fetch.FINGERS.items():
        across_m = side * (points[finger] + poses[finger][0])[:, 1]
        assert across_m.min() == pytest.approx(opening_m / 2.0, abs=1e-5)
        assert across_m.max() == pytest.approx(opening_m / 2.0 + fetch.FINGER_SIZE_M[1], abs=1e-5)
        assert points[finger][:, 0].max() == pytest.approx(tip_m, abs=1e-6)
        assert np.abs(points[finger][:, 2]).max() == pytest.approx(fetch.FINGER_SIZE_M[2] / 2.0, abs=1e-6)


def test_both_looks_fill_the_same_room(published_dir: Path) -> None:
    """A figure made with one fits a figure made with the other."""
    own, real = points_m(own_look()), points_m(RobotLook("published", published.published_glbs(source=published_dir)))
    for link, mesh in own.items():
        if link == "torso_lift_link":  # its bellows hang down to the base, as those of a raised torso do
            mesh = mesh[mesh[:, 2] > 0.0]
        low_m, high_m = real[link].min(axis=0), real[link].max(axis=0)
        if link == "torso_lift_link":
            low_m[2] = mesh[:, 2].min()
        if "finger" in link:
            low_m[0] = mesh[:, 0].min()  # each has a foot that reaches into the palm
        np.testing.assert_allclose(mesh.min(axis=0), low_m, atol=0.011, err_msg=link)
        np.testing.assert_allclose(mesh.max(axis=0), high_m, atol=0.022, err_msg=link)


# ---- bodies and light


def test_a_drum_is_as_long_and_as_wide_as_it_says_and_round_at_its_edges() -> None:
    for axis, along in (("x", 0), ("y", 1), ("z", 2)):
        low_m, high_m = drum(axis, 0.1, -0.2, 0.3, (9, 9, 9), at_m=(1.0, 2.0, 3.0), edges_m=(0.01, 0.0), n=64).bounds_m  # type: ignore[arg-type]
        expected = np.array([0.1] * 3), np.array([0.1] * 3)
        expected[0][along], expected[1][along] = 0.2, 0.3
        np.testing.assert_allclose(low_m, np.array([1.0, 2.0, 3.0]) - expected[0], atol=2e-4)
        np.testing.assert_allclose(high_m, np.array([1.0, 2.0, 3.0]) + expected[1], atol=2e-4)
    assert rounded(0.1, 0.0, 1.0, (0.0, 0.0)) == [(0.1, 0.0), (0.1, 1.0)]
    profile = rounded(0.1, 0.0, 1.0, (0.02, 0.03))
    assert profile[0] == pytest.approx((0.08, 0.0)) and profile[-1] == pytest.approx((0.07, 1.0))


def test_bodies_are_closed_and_face_outwards() -> None:
    way = [Section((x, 0.1 * x, 0.2), 0.05, 0.03, 0.0, 3.0) for x in (0.0, 0.1, 0.3)]
    for body in (drum("y", 0.1, -0.2, 0.3, (9, 9, 9), edges_m=(0.01, 0.01)), sweep(way, (9, 9, 9))):
        corners = body.vertices_m[body.faces]
        volume_m3 = float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()) / 6.0
        assert volume_m3 > 0.0
        corners = np.round(corners, 9)
        edges: dict[tuple[bytes, bytes], int] = {}
        for face in corners:
            for start, end in ((0, 1), (1, 2), (2, 0)):
                edges[face[start].tobytes(), face[end].tobytes()] = (
                    edges.get((face[start].tobytes(), face[end].tobytes()), 0) + 1
                )
        assert all(edges.get((end, start)) == count for (start, end), count in edges.items())


def test_baked_light_comes_from_above_and_spheres_take_some_of_it() -> None:
    lit = baked(ball(0.1, (128, 128, 128)))
    heights, grey = lit.vertices_m[:, 2], lit.srgba[:, 0]
    assert grey[np.argmax(heights)] > grey[np.argmin(heights)] > 0.0
    upside_down = baked(ball(0.1, (128, 128, 128)), np.diag([1.0, -1.0, -1.0]))
    assert upside_down.srgba[np.argmin(heights), 0] == pytest.approx(grey[np.argmax(heights)], abs=0.02)
    below = baked(ball(0.1, (128, 128, 128)), shade=[((0.0, 0.0, 0.3), 0.1)])
    assert below.srgba[np.argmax(heights), 0] < grey[np.argmax(heights)]
    assert below.srgba[np.argmin(heights), 0] == grey[np.argmin(heights)]


# ---- which one


def test_the_study_file_and_the_scene_know_the_same_looks() -> None:
    assert get_args(ViewSettings.model_fields["look"].annotation) == get_args(AskedLook)


def test_as_installed_is_one_or_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (chosen("own"), chosen("published")) == ("own", "published")
    for missing, drawn in (("something", "own"), ("", "published")):
        monkeypatch.setattr(looks, "why_missing", lambda missing=missing: missing)
        assert chosen("installed") == drawn


def test_the_facts_tell_one_look_from_another() -> None:
    glbs = dict(own_look().glb_by_link)
    same, other = RobotLook("own", dict(reversed(glbs.items()))), RobotLook("own", {**glbs, "gripper_link": b"glTF"})
    assert same.facts == own_look().facts != other.facts
    assert own_look().facts["look"] == "own" and len(own_look().facts["look_sha256"]) == 12


def test_an_unknown_look_is_named() -> None:
    with pytest.raises(SimError, match=r"'shiny'.*own, published, installed"):
        robot_look("shiny")  # type: ignore[arg-type]


# ---- the published meshes


def test_the_cache_is_where_the_user_says() -> None:
    assert published.cache_dir({"XDG_CACHE_HOME": "/somewhere"}) == Path("/somewhere/shared-autonomy-lab")
    home = Path.home() / ".cache" / "shared-autonomy-lab"
    assert published.cache_dir({}) == home
    assert published.cache_dir({"XDG_CACHE_HOME": "not/absolute"}) == home


@pytest.fixture
def published_dir() -> Path:
    """Where the published meshes are."""
    if missing := published.why_missing():
        pytest.skip(missing)
    folder = published.published_meshes_dir()
    assert folder is not None
    return folder


@pytest.mark.slow
def test_the_published_meshes_are_baked_small(published_dir: Path, tmp_path: Path) -> None:
    look = robot_look("published", tmp_path / "cache", published_dir)
    assert (look.name, look.note) == ("published", "")
    assert set(look.glb_by_link) == set(published.LINKS) <= set(fetch.LINK_NAMES)
    assert sum(map(len, look.glb_by_link.values())) < LIMIT_BYTES
    for glb in look.glb_by_link.values():
        _, arrays = parsed(glb)
        assert arrays["indices"].max() < len(arrays["POSITION"])


@pytest.fixture
def bakings(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Links that were baked, in order; what comes out are the lab's own shapes, at once."""
    shapes: Mapping[str, bytes] = own_look().glb_by_link
    asked: list[str] = []

    def bake(link: str, source: Path) -> bytes:
        asked.append(link)
        return shapes[link]

    monkeypatch.setattr(published, "bake_link", bake)
    return asked


def test_they_are_baked_once_and_a_broken_file_again(bakings: list[str], tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    glbs = published.published_glbs(cache, tmp_path)
    assert bakings == list(published.LINKS)
    bakings.clear()
    assert published.published_glbs(cache, tmp_path) == glbs
    assert bakings == []
    (broken,) = cache.glob("*/gripper_link.glb")
    broken.write_bytes(broken.read_bytes()[:-100])
    assert published.published_glbs(cache, tmp_path) == glbs
    assert bakings == ["gripper_link"]
    assert broken.read_bytes() == glbs["gripper_link"]
    assert len(list(broken.parent.iterdir())) == len(published.LINKS)  # nothing half-written stays behind


def test_a_cache_that_cannot_be_written_does_not_matter(bakings: list[str], tmp_path: Path) -> None:
    glbs = published.published_glbs(tmp_path / "cache", tmp_path)
    (tmp_path / "file").write_text("in the way")
    assert published.published_glbs(tmp_path / "file", tmp_path) == glbs
    assert bakings == [*published.LINKS, *published.LINKS]


def test_the_published_fingers_touch_where_the_pads_do(published_dir: Path) -> None:
    points_of = {finger: parsed(published.bake_link(finger, published_dir))[1]["POSITION"] for finger in fetch.FINGERS}
    for opening_m in (0.0, 0.06, fetch.MAX_OPENING_M):
        poses = fetch.link_poses((0.0,) * 7, opening_m)
        inner = {}
        for finger, side in fetch.FINGERS.items():
            across = side * (points_of[finger] + poses[finger][0])[:, 1]
            inner[finger] = float(across.min())
        assert sum(inner.values()) == pytest.approx(opening_m, abs=0.003)


def test_meshes_that_are_not_installed_are_told_and_the_own_look_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(published, "published_meshes_dir", lambda: None)
    assert "rtb-data 1.1.0" in published.why_missing() and "extra `meshes`" in published.why_missing()
    look = robot_look("published", tmp_path)
    assert look.name == "own" and look.glb_by_link == own_look().glb_by_link
    assert look.note == f"{published.why_missing()}: the lab's own look is drawn instead"
    assert look.facts == own_look().facts, "what is recorded is what was drawn"
    assert not list(tmp_path.iterdir())


def test_meshes_that_cannot_be_read_are_no_reason_to_stop_a_trial(tmp_path: Path) -> None:
    (tmp_path / "source").mkdir()
    look = robot_look("published", tmp_path / "cache", tmp_path / "source")
    assert look.name == "own" and look.note.endswith("the lab's own look is drawn instead")
    assert look.glb_by_link == own_look().glb_by_link


def test_an_unknown_link_is_named(tmp_path: Path) -> None:
    with pytest.raises(SimError, match=r"'tail'.*gripper_link"):
        published.bake_link("tail", tmp_path)
