"""The scene as a client sees it: what a browser would be sent, read from the server's own socket."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from app.contracts.driving import START_JOINTS_RAD
from sim import fetch
from sim.interface import ObjectState, Pose, SceneSpec, SimError, WorldState
from sim.layouts import practice_scene, scene
from sim.view.looks import own_look
from sim.view.scene import SceneOptions, SceneView
from sim.view.viewpoints import DEFAULT_VIEW, INSET, VIEWS
from tests.support.shipped_world import ARC, STUDY_OBJECTS
from tests.support.viser_client import TIMEOUT_S, ViserClient, names

LAYOUT = ARC
SIX = scene(LAYOUT, list(STUDY_OBJECTS))
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def world(
    spec: SceneSpec, joints_rad: Sequence[float] = START_JOINTS_RAD, **moved: tuple[float, float, float]
) -> WorldState:
    """The world of a scene at rest, with some objects elsewhere."""
    objects = []
    for placed in spec.objects:
        pose = Pose(moved[placed.spec.id]) if placed.spec.id in moved else placed.rest_pose
        objects.append(ObjectState(placed.spec.id, pose, pose.position_world_m, True))
    position = fetch.link_poses(joints_rad, 0.1)["gripper_link"][0]
    return WorldState(0.0, position, tuple(joints_rad), 0.1, "open", None, False, tuple(objects))


def joined(view: SceneView, count: int = 1) -> None:
    """Wait until viser has taken note of so many clients; it gives no event for that."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while view.clients < count:
        assert time.monotonic() < deadline_s, f"{view.clients} of {count} clients joined"
        time.sleep(0.005)


class Clock:
    """A clock that stands still unless told."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def view(clock: Clock) -> Iterator[SceneView]:
    with SceneView(look=own_look(), clock=clock) as opened:
        opened.open()
        yield opened


def test_a_client_gets_robot_table_bins_and_objects_where_they_are(view: SceneView) -> None:
    view.show(SIX)
    view.update(world(SIX, spray_bottle=(0.7, 0.1, 0.9)))
    with ViserClient(view.open()) as client:
        client.backlog()
    sent = set(client.nodes())
    assert {f"/object/{name}" for name in STUDY_OBJECTS} <= sent
    assert {"/fixed/table", "/fixed/bin/left_bin", "/fixed/bin/right_bin", "/floor"} <= sent
    assert {f"/robot/{joint.child}" for joint in fetch.ARM_JOINTS} <= sent
    poses = fetch.link_poses(START_JOINTS_RAD, 0.1)
    np.testing.assert_allclose(client.position("/robot/gripper_link"), poses["gripper_link"][0], atol=2e-5)
    np.testing.assert_allclose(client.position("/object/spray_bottle"), (0.7, 0.1, 0.9), atol=2e-5)
    rest = SIX.object("wipes_tub").rest_pose.position_world_m
    np.testing.assert_allclose(client.position("/object/wipes_tub"), rest, atol=2e-5)


def test_the_whole_scene_with_the_real_meshes_is_below_a_megabyte() -> None:
    with SceneView() as real:
        real.open()
        real.show(SIX)
        real.update(world(SIX))
        with ViserClient(real.open()) as client:
            client.backlog()
        assert client.size_bytes < 1_000_000


def test_an_update_sends_only_what_moved(view: SceneView) -> None:
    view.show(SIX)
    view.update(world(SIX))
    with ViserClient(view.open()) as client:
        client.backlog()
        joined(view)
        view.update(world(SIX))  # aims the new client's camera
        client.until(type="SetCameraPositionMessage", initial=False)
        client.forget()
        view.update(world(SIX))
        view.update(world(SIX, sponge_pack=(0.8, -0.4, 1.0)))
        client.until(type="SetPositionMessage", name="/object/sponge_pack")
    assert names(client.messages) <= {"/object/sponge_pack", "/shade/object/sponge_pack"}


def test_what_was_delivered_stays_and_what_is_gone_is_hidden(view: SceneView) -> None:
    view.show(SIX)
    view.update(world(SIX))
    left = [name for name in STUDY_OBJECTS if name not in ("spray_bottle", "absorbent_can")]
    rest = scene(LAYOUT, list(STUDY_OBJECTS), remaining=left)
    settled = Pose((0.5, 0.45, 0.04), (0.7071, 0.7071, 0.0, 0.0))
    view.show(rest)
    view.update(world(rest), {"spray_bottle": settled})
    with ViserClient(view.open()) as client:
        client.backlog()
    assert client.visible("/object/spray_bottle")
    np.testing.assert_allclose(client.position("/object/spray_bottle"), settled.position_world_m, atol=2e-5)
    assert not client.visible("/object/absorbent_can")
    assert not client.visible("/shade/object/absorbent_can")
    assert client.visible("/object/wipes_tub")


def test_a_new_view_can_show_what_an_earlier_one_delivered(view: SceneView) -> None:
    rest = scene(LAYOUT, list(STUDY_OBJECTS), remaining=["sponge_pack"])
    view.show(rest, {"spray_bottle": Pose((0.5, 0.45, 0.04))})
    with ViserClient(view.open()) as client:
        client.backlog()
    assert client.position("/object/spray_bottle")[2] == pytest.approx(0.04)


def test_showing_again_and_again_leaves_nothing_behind(view: SceneView) -> None:
    def sent() -> int:
        with ViserClient(view.open()) as client:
            client.backlog()
        return len(client.messages)

    def cycle() -> None:
        for spec in (SIX, practice_scene(LAYOUT)):
            view.show(spec)
            view.update(world(spec))

    cycle()
    first = sent()
    for _ in range(5):
        cycle()
    assert sent() <= first


def test_another_layout_replaces_the_furniture(view: SceneView) -> None:
    view.show(SIX)
    moved = replace(SIX, bins=(replace(SIX.bins[0], center_xy_m=(0.2, 0.8)),))
    view.show(moved)
    with ViserClient(view.open()) as client:
        client.backlog()
    assert client.nodes().count("/fixed/table") == 1
    assert "/fixed/bin/right_bin" not in client.nodes()
    np.testing.assert_allclose(client.position("/fixed/bin/left_bin"), (0.2, 0.8, 0.0))


def test_the_plumb_line_ends_on_what_is_below(view: SceneView) -> None:
    view.show(SIX)
    over_table = world(SIX, (0.0, 0.10, 0.0, 1.76, 0.0, -1.86, 0.0))
    assert SIX.table.covers(*over_table.position_world_gripper_m[:2])
    view.update(over_table)
    with ViserClient(view.open()) as client:
        client.backlog()
        assert client.position("/plumb/mark")[2] == pytest.approx(SIX.table.top_z_m, abs=0.005)
        client.forget()
        joined(view)
        view.update(world(SIX, (1.2, 0.10, 0.0, 1.76, 0.0, -1.86, 0.0)))  # turned away from the table
        client.until(type="SetPositionMessage", name="/plumb/mark")
    assert client.position("/plumb/mark")[2] == pytest.approx(0.0, abs=0.01)


def test_depth_cues_can_be_left_out_and_nothing_is_marked_unasked() -> None:
    with SceneView(look=own_look(), options=SceneOptions(plumb_line=False, shadows=False)) as bare:
        bare.open()
        bare.show(SIX)
        bare.mark("sponge_pack")
        bare.update(world(SIX))
        with ViserClient(bare.open()) as client:
            client.backlog()
    assert not [name for name in client.nodes() if name.startswith(("/plumb", "/shade", "/mark", "/fixed/shade"))]


def test_a_study_may_mark_the_instructed_thing() -> None:
    with SceneView(look=own_look(), options=SceneOptions(marked=True)) as marking:
        marking.open()
        marking.show(SIX)
        marking.mark("sponge_pack")
        with ViserClient(marking.open()) as client:
            client.backlog()
            np.testing.assert_allclose(
                client.position("/mark/object")[:2], SIX.object("sponge_pack").base_world_m[:2], atol=2e-5
            )
            client.forget()
            marking.update(world(SIX, sponge_pack=(0.7, 0.1, 0.9)))
            client.until(type="SetPositionMessage", name="/mark/object")
            np.testing.assert_allclose(client.position("/mark/object")[:2], (0.7, 0.1), atol=2e-5)
            marking.mark("left_bin")
            client.until(type="SetPositionMessage", name="/fixed/mark/left_bin")
            np.testing.assert_allclose(client.position("/fixed/mark/left_bin")[:2], SIX.bins[0].center_xy_m, atol=2e-5)
            assert not client.visible("/mark/object")
            client.forget()
            marking.show(SIX)
            client.until(type="SetSceneNodeVisibilityMessage", name="/fixed/mark/left_bin", visible=False)


def test_after_a_reset_the_arm_glides_home(clock: Clock) -> None:
    asked: list[float] = []

    def link_poses(joints_rad: Sequence[float], opening_m: float) -> dict[str, fetch.LinkPose]:
        asked.append(joints_rad[0])
        return fetch.link_poses(joints_rad, opening_m)

    away = (0.8, *START_JOINTS_RAD[1:])
    options = SceneOptions(reset_tween_s=1.0)
    with SceneView(link_poses, own_look(), options, clock) as view, ViserClient(view.open()):
        joined(view)
        view.show(SIX)
        view.update(world(SIX, away))
        view.show(SIX)
        for _ in range(4):
            view.update(world(SIX))
            clock.now_s += 0.5
    assert asked == pytest.approx([0.8, 0.4, 0.0])  # asked only when something moves


def test_what_nobody_sees_is_not_drawn_and_whoever_comes_sees_how_it_is_now() -> None:
    asked: list[float] = []

    def link_poses(joints_rad: Sequence[float], opening_m: float) -> dict[str, fetch.LinkPose]:
        asked.append(joints_rad[0])
        return fetch.link_poses(joints_rad, opening_m)

    with SceneView(link_poses, own_look()) as view:
        view.open()
        view.show(SIX)
        for turned_rad in (0.0, 0.3, 0.6):
            view.update(world(SIX, (turned_rad, *START_JOINTS_RAD[1:]), sponge_pack=(0.8, -0.4, 1.0 + turned_rad)))
        assert asked == [0.0], "the first picture of a scene is whole, and no other is drawn for nobody"
        with ViserClient(view.open()) as client:
            client.backlog()
            client.forget()
            joined(view)
            view.tend()  # as a worker does that holds, or that runs no tick
            client.until(type="SetPositionMessage", name="/object/sponge_pack")
        assert client.position("/object/sponge_pack") == pytest.approx((0.8, -0.4, 1.6))
        assert asked == [0.0, 0.6]


def test_a_view_moves_those_who_look_and_those_who_come(view: SceneView) -> None:
    view.show(SIX)
    view.update(world(SIX))
    with ViserClient(view.open()) as early:
        early.backlog()
        assert early.until(type="SetCameraPositionMessage", initial=True)["position"] == pytest.approx(
            VIEWS[DEFAULT_VIEW].position_world_m
        )
        joined(view)
        view.update(world(SIX))
        early.until(type="SetCameraPositionMessage", initial=False)
        early.forget()
        view.set_view("side")
        moved = early.until(type="SetCameraPositionMessage", initial=False)
        assert moved["position"] == pytest.approx(VIEWS["side"].position_world_m)
        with ViserClient(view.open()) as late:
            late.backlog()
        last = [m for m in late.messages if m["type"] == "SetCameraPositionMessage"][-1]
        assert last["position"] == pytest.approx(VIEWS["side"].position_world_m)


def test_a_narrow_window_gets_a_wider_lens(view: SceneView) -> None:
    view.show(SIX)
    with ViserClient(view.open(), width=600, height=800) as client:
        client.backlog()
        joined(view)
        view.update(world(SIX))
        lens = client.until(type="SetCameraFovMessage", initial=False)
    assert lens["fov"] > VIEWS[DEFAULT_VIEW].fov_rad


@pytest.fixture
def with_inset(clock: Clock) -> Iterator[SceneView]:
    with SceneView(look=own_look(), options=SceneOptions(inset=INSET), clock=clock) as opened:
        opened.open()
        opened.show(SIX)
        opened.update(world(SIX))
        yield opened


def test_the_inset_goes_where_the_gripper_goes_and_nobody_elses_camera_does(with_inset: SceneView) -> None:
    port = with_inset.open()
    with ViserClient(port) as main, ViserClient(port, width=304, height=236, near=INSET.near_m) as inset:
        main.backlog()
        inset.backlog()
        joined(with_inset, 2)
        for joints_rad in (START_JOINTS_RAD, (0.4, *START_JOINTS_RAD[1:])):
            inset.forget()
            seen = world(SIX, joints_rad)
            with_inset.update(seen)
            gripper_m = seen.position_world_gripper_m
            stands = INSET.at(gripper_m, 304 / 236)
            moved = inset.until(type="SetCameraPositionMessage", initial=False)
            assert moved["position"] == pytest.approx(stands.position_world_m, abs=1e-3)
            looks = inset.until(type="SetCameraLookAtMessage", initial=False)
            while looks["look_at"] != pytest.approx(stands.look_at_world_m, abs=1e-3):
                inset.messages.remove(looks)  # the way there: viser moves what it looks at along with the camera
                looks = inset.until(type="SetCameraLookAtMessage", initial=False)
        with_inset.set_view("top")
        main.until(type="SetCameraPositionMessage", initial=False, position=list(VIEWS["top"].position_world_m))
    placed = [m["position"] for m in main.messages if m["type"] == "SetCameraPositionMessage" and not m["initial"]]
    assert {tuple(position) for position in placed} <= {view.position_world_m for view in VIEWS.values()}


def test_whoever_comes_while_nothing_moves_is_aimed_too(with_inset: SceneView) -> None:
    with ViserClient(with_inset.open(), width=304, height=236, near=INSET.near_m) as inset:
        inset.backlog()
        joined(with_inset)
        with_inset.tend()
        inset.until(type="SetCameraPositionMessage", initial=False)


def test_what_the_inset_cuts_open_is_filled_in_the_inset_alone(with_inset: SceneView) -> None:
    port = with_inset.open()
    with ViserClient(port) as main, ViserClient(port, width=304, height=236, near=INSET.near_m) as inset:
        main.backlog()
        inset.backlog()
        joined(with_inset, 2)
        with_inset.update(world(SIX, sponge_pack=(0.7, 0.1, 0.9)))
        inset.until(type="GlbMessage", name="/object/sponge_pack/cap")
        main.until(type="SetPositionMessage", name="/object/sponge_pack")
        caps = {name for name in inset.nodes() if name.endswith("/cap")}
        assert {"/object/sponge_pack/cap", "/fixed/table/cap", "/robot/gripper_link/cap"} <= caps
        assert not any(name.endswith("/cap") for name in main.nodes())
        moved = replace(SIX, bins=(replace(SIX.bins[0], center_xy_m=(0.2, 0.8)),))
        inset.forget()
        with_inset.show(moved)
        with_inset.update(world(moved))
        inset.until(type="GlbMessage", name="/fixed/bin/left_bin/cap")  # of the new one


def test_without_an_inset_in_the_study_its_window_shows_nothing_of_its_own(view: SceneView) -> None:
    view.show(SIX)
    with ViserClient(view.open(), width=304, height=236, near=INSET.near_m) as inset:
        inset.backlog()
        joined(view)
        view.update(world(SIX))
        view.update(world(SIX, sponge_pack=(0.7, 0.1, 0.9)))
        inset.until(type="SetPositionMessage", name="/object/sponge_pack")
    assert not [m for m in inset.messages if m["type"] == "SetCameraPositionMessage" and not m["initial"]]


def test_misuse_is_told(view: SceneView) -> None:
    with pytest.raises(SimError, match="before show"):
        view.update(world(SIX))
    with pytest.raises(SimError, match=r"'upside_down'.*overview.*side"):
        view.set_view("upside_down")
    view.show(SIX)
    with pytest.raises(SimError, match=r"'teapot'.*sponge_pack"):
        view.update(world(SIX), {"teapot": Pose((0, 0, 0))})
    view.close()
    view.close()
    with pytest.raises(SimError, match="not open"):
        view.show(SIX)
