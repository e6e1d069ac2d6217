"""The experimenters' 3-D view: opened and closed as they wish, steered by them, no trace of it at the participant's."""

from __future__ import annotations

import asyncio
import json
import re
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any, cast

import httpx
import pytest
from playwright.async_api import Browser as AsyncBrowser
from playwright.async_api import async_playwright
from playwright.async_api import expect as expect_async
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Subprotocol

from app.session.spectators import Spectators
from app.session.worker_link import WorkerLink
from app.simulated.connection import enter
from app.worker.messages import Begin, Ready, Spectate, SpectatorPort, Stop, Ticked
from app.worker.spectator_view import EVERY_SLICES, OnDemandView
from sim.interface import SLICES_PER_TICK
from sim.kinematic import KinematicRobot
from sim.layouts import scene
from sim.view.looks import own_look
from sim.view.scene import SceneView
from sim.view.spectator import FULL_M, SpectatorView
from sim.view.viewpoints import SPECTATOR
from tests.conftest import CHROMIUM_ARGUMENTS
from tests.sim.view.test_scene import LAYOUT, SIX, joined, world
from tests.support.lab_server import LabServer
from tests.support.simulated_pipe import Schedule, beats, of, simulate
from tests.support.viser_client import PROTOCOL, ViserClient, decoded
from tests.support.wire_client import Player, invite, visit, write_study
from tests.worker.test_worker import Screen, spec

BELIEF = {name: (0.5 if name == "sponge_pack" else 0.1) for name in (placed.spec.id for placed in SIX.objects)}


# --- the two servers -----------------------------------------------------------------------------------------------


def shown_to_a_participant(with_spectator: bool) -> dict[tuple[str, str], str]:
    """What a participant's browser was last told of each thing, over a few slices. (Of what comes in quick succession
    viser sends the newest alone.)"""
    with SceneView(look=own_look()) as view, SpectatorPart(with_spectator) as spectator:
        view.open()
        view.show(SIX)
        view.update(world(SIX))
        spectator.draw()
        with ViserClient(view.open()) as client:
            client.backlog()
            joined(view)
            for height_m in (0.90, 0.95, 1.0):
                view.update(world(SIX, sponge_pack=(0.8, -0.4, height_m)))
                spectator.draw()
            gone = scene(LAYOUT, [name for name in BELIEF if name != "spray_bottle"])
            view.update(world(gone))
            # What is said to all and what is said to one go their own ways: the last of each has to be here.
            client.until(type="SetSceneNodeVisibilityMessage", name="/object/spray_bottle", visible=False)
            client.until(type="SetCameraFovMessage", initial=False)
            told = [{**message, "run_id": None} for message in client.messages]  # a server's own number
            return {(message["type"], message.get("name", "")): repr(message) for message in told}


class SpectatorPart:
    """A spectator's view beside, or nothing."""

    def __init__(self, wanted: bool) -> None:
        self.view = SpectatorView(own_look()) if wanted else None

    def __enter__(self) -> SpectatorPart:
        if self.view is not None:
            self.view.open()
            self.view.show(SIX)
        return self

    def __exit__(self, *_: object) -> None:
        if self.view is not None:
            self.view.close()

    def draw(self) -> None:
        if self.view is not None:
            self.view.update(world(SIX), {}, BELIEF, "sponge_pack")


def test_the_participant_is_sent_the_same_whether_somebody_looks_on_or_not() -> None:
    alone, beside = (shown_to_a_participant(wanted) for wanted in (False, True))
    assert alone == beside
    assert not [name for _, name in beside if re.match(r"/(belief|mark)", name)]


@pytest.fixture
def spectators() -> Iterator[SpectatorView]:
    view = SpectatorView(own_look())
    view.open()
    view.show(SIX)
    yield view
    view.close()


def test_a_spectator_sees_the_belief_over_the_goals_and_which_is_instructed(spectators: SpectatorView) -> None:
    spectators.update(world(SIX), {}, BELIEF, "sponge_pack")
    with ViserClient(spectators.open()) as client:
        client.backlog()
        top_m = SIX.object("sponge_pack").base_world_m[2] + SIX.object("sponge_pack").spec.size_m[2]
        assert client.position("/belief/column/sponge_pack")[2] > top_m
        updates = {m["name"]: m["updates"] for m in client.messages if m["type"] == "SceneNodeUpdateMessage"}
        assert updates["/belief/column/sponge_pack"]["scale"][2] == pytest.approx(FULL_M * 0.5)
        assert updates["/belief/label/sponge_pack"]["text"] == "▸ pack of sponges 0.50"
        assert updates["/belief/label/wipes_tub"]["text"] == "tub of wipes 0.10"
        assert client.position("/mark/object")[:2] == pytest.approx(
            SIX.object("sponge_pack").base_world_m[:2], abs=2e-5
        )
        # Something is held: the bins are the goals now.
        client.forget()
        spectators.update(world(SIX), {}, {"left_bin": 0.25, "right_bin": 0.75}, "right_bin")
        client.until(type="SetSceneNodeVisibilityMessage", name="/belief/column/sponge_pack", visible=False)
        assert client.position("/belief/column/right_bin")[:2] == pytest.approx(SIX.bin("right_bin").center_xy_m)


def test_every_spectator_steers_a_camera_of_their_own(spectators: SpectatorView) -> None:
    spectators.update(world(SIX), {}, BELIEF, None)
    with ViserClient(spectators.open()) as client:
        client.backlog()
        start = [m for m in client.messages if m["type"] == "SetCameraPositionMessage"][-1]
        assert start["position"] == pytest.approx(SPECTATOR.position_world_m)
        client.forget()
        joined(spectators._view)
        spectators.update(world(SIX, sponge_pack=(0.8, -0.4, 1.0)), {}, BELIEF, None)
        client.until(type="SetPositionMessage", name="/object/sponge_pack")
        assert not [message for message in client.messages if "Camera" in message["type"]]


# --- the control loop ------------------------------------------------------------------------------------------------


class FakeSpectators:
    """A view that notes what it is asked."""

    def __init__(self, calls: list[str]) -> None:
        self._calls = calls

    def open(self) -> int:
        self._calls.append("open")
        return 4712

    def close(self) -> None:
        self._calls.append("close")

    def show(self, scene: Any, delivered: Any) -> None:
        self._calls.append("show")

    def update(self, state: Any, delivered: Any, belief: Mapping[str, float], goal: str | None) -> None:
        assert goal == "spray_bottle"
        self._calls.append("update")


def fake_view(calls: list[str]) -> OnDemandView:
    """A view that notes what it is asked, once somebody looks on."""
    return OnDemandView(lambda: cast(SpectatorView, FakeSpectators(calls)))


def ran(monkeypatch: pytest.MonkeyPatch, *looking: tuple[float, bool]) -> tuple[list[Any], list[str], Screen]:
    """What a worker of three ticks reports, what its spectator_view did, and what the participant was shown."""
    calls: list[str] = []
    screen = Screen()
    spectator_view = fake_view(calls)
    asked = [(at_s, Spectate(on)) for at_s, on in looking]
    schedule = [*beats(0.0, 3.0), (1.0, Begin()), *asked]
    sent = simulate(
        monkeypatch, spec(), KinematicRobot(), [*schedule, (2.4, Stop())], screen, spectator_view=spectator_view
    )
    return sent, calls, screen


def test_looking_on_leaves_ticks_digests_and_the_participants_picture_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    alone, _, screen_alone = ran(monkeypatch)
    watched, calls, screen_watched = ran(monkeypatch, (1.2, True), (2.1, False))
    ticks = [(entry.at_s, entry.report) for entry in alone if isinstance(entry.report, Ticked)]
    assert len(ticks) == 3
    assert [(entry.at_s, entry.report) for entry in watched if isinstance(entry.report, Ticked)] == ticks
    assert screen_watched.calls == screen_alone.calls
    assert [report.port for report in of(watched, SpectatorPort)] == [4712, None]
    assert calls[:3] == ["open", "show", "update"] and calls[-1] == "close"
    assert calls.count("open") == calls.count("close") == 1
    drawn_s = 2.1 - 1.2
    assert calls.count("update") == pytest.approx(drawn_s / 0.5 * SLICES_PER_TICK / EVERY_SLICES, abs=2)


def test_a_robot_that_waits_can_be_looked_at_and_one_without_a_scene_says_no(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    spectator_view = fake_view(calls)
    schedule: Schedule = [(0.5, Spectate(True)), (3.0, Stop())]
    sent = simulate(monkeypatch, spec(), KinematicRobot(), schedule, Screen(), spectator_view=spectator_view)
    assert [report.port for report in of(sent, SpectatorPort)] == [4712]
    held: Schedule = [(0.0, Begin()), (0.7, Spectate(True)), (3.0, Stop())]  # no heartbeat: no tick starts
    spectator_view = fake_view(calls)
    sent = simulate(monkeypatch, spec(), KinematicRobot(), held, Screen(), spectator_view=spectator_view)
    assert [report.port for report in of(sent, SpectatorPort)] == [4712] and not of(sent, Ticked)
    bare = simulate(monkeypatch, spec(), KinematicRobot(), schedule)
    assert isinstance(bare[0].report, Ready) and [report.port for report in of(bare, SpectatorPort)] == [None]


def test_a_view_that_fails_costs_the_spectators_their_picture_and_the_participant_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken() -> Any:
        raise OSError("no free port")

    schedule = [*beats(0.0, 3.0), (1.0, Begin()), (1.2, Spectate(True)), (1.8, Spectate(True)), (2.4, Stop())]
    sent = simulate(monkeypatch, spec(), KinematicRobot(), schedule, Screen(), spectator_view=OnDemandView(broken))
    assert len(of(sent, Ticked)) == 3
    assert [report.port for report in of(sent, SpectatorPort)] == [None, None]
    assert "no free port" in caplog.text


class Line:
    """A line to a worker that notes what it is sent."""

    def __init__(self) -> None:
        self.ready = True
        self.spectator_port: int | None = None
        self.sent: list[bool] = []
        self.on_sent: Callable[[bool], None] = lambda looking: None

    def send(self, command: Spectate) -> None:
        self.sent.append(command.looking)
        self.on_sent(command.looking)


async def test_the_view_is_there_from_the_first_spectator_to_the_last() -> None:
    line = Line()
    spectators = Spectators(cast(WorkerLink, line), lingers_s=0.01)
    closed = asyncio.Event()

    def answer(looking: bool) -> None:
        spectators.told(4712 if looking else None)
        if not looking:
            closed.set()

    line.on_sent = answer
    async with spectators.look() as port, spectators.look() as again:
        assert port == again == 4712 and spectators.count == 2
    async with spectators.look() as port:  # a reload finds it again
        assert port == 4712
    assert line.sent == [True]
    await asyncio.wait_for(closed.wait(), 5.0)
    assert line.sent == [True, False]
    line.ready = False
    async with spectators.look() as port:
        assert port is None


# --- a lab -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def lab(start_lab: Callable[..., LabServer], tmp_path: Path) -> LabServer:
    return start_lab("--robot", "kinematic", "--study", str(write_study(tmp_path)))


async def desk_cookie(lab: LabServer) -> str:
    async with httpx.AsyncClient(base_url=lab.base_url, headers=lab.headers, trust_env=False, timeout=30.0) as client:
        answer = await client.post("/api/desk")
    said = answer.headers["set-cookie"]
    assert re.search(r"HttpOnly.*Path=/dashboard;.*SameSite=strict", said)
    return said.partition(";")[0]


async def nodes(url: str, cookie: str) -> set[str]:
    """The nodes a viser server shows to whoever opens it there."""
    found: set[str] = set()
    headers, protocols = {"Cookie": cookie}, [Subprotocol(PROTOCOL)]
    async with connect(url, subprotocols=protocols, additional_headers=headers, max_size=None, proxy=None) as browser:
        while True:
            frame = await asyncio.wait_for(browser.recv(), 20.0)
            assert isinstance(frame, bytes)
            messages = decoded(frame)
            found |= {message["name"] for message in messages if message["type"] in ("GlbMessage", "LabelMessage")}
            if any(message["type"] == "ReplayDoneMessage" for message in messages):
                return found


async def at_the_start(player: Player) -> None:
    await player.reach("trial_ready")
    await player.status("ready")


async def refused(url: str, **headers: str) -> int:
    with pytest.raises(InvalidStatus) as caught:
        async with connect(url, subprotocols=[Subprotocol(PROTOCOL)], additional_headers=headers, proxy=None):
            pass
    return caught.value.response.status_code


async def test_only_experimenters_look_on_and_the_participant_gets_nothing_of_it(lab: LabServer) -> None:
    made = invite(lab)
    page = f"{lab.base_url}/dashboard/scene/{made['participant']}"
    url = page.replace("http", "ws", 1)
    theirs = await enter(made["link"])
    cookie = await desk_cookie(lab)
    async with httpx.AsyncClient(trust_env=False, timeout=30.0) as client:
        for headers in ({}, {"Cookie": theirs.cookie}, {"Cookie": "salab_desk=wrong"}, lab.headers):
            assert (await client.get(f"{page}/", headers=headers)).status_code == 403
        assert (await client.get(f"{page}/", headers={"Cookie": cookie})).status_code == 200
    for cookie_of in ("", theirs.cookie, "salab_desk=wrong", f"salab_desk={lab.experimenter_token}"):
        assert await refused(url, Cookie=cookie_of) == 403
    assert await refused(url, Cookie=cookie, Origin="http://elsewhere.example") == 403
    async with visit(made["link"]) as player:
        await at_the_start(player)
        scene_url = theirs.socket_url.removesuffix("socket") + "scene"
        seen = await nodes(url, cookie)
        participants = await nodes(scene_url, theirs.cookie)
        assert {name for name in seen if name.startswith("/object/")} == {
            name for name in participants if name.startswith("/object/")
        }
        assert "/mark/object" in seen
        assert not [name for name in participants if name.startswith("/belief")]
    async with httpx.AsyncClient(trust_env=False, timeout=30.0) as client:
        assert (await client.get(f"{lab.base_url}/api/health")).json()["look"] == "own"
        file = next(lab.data_dir.glob("lab.sqlite"))
        with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as stored:
            (told,) = stored.execute(
                "SELECT data FROM events WHERE kind = 'robot' AND participant = ?", (made["participant"],)
            )
    assert own_look().facts.items() <= json.loads(told[0]).items(), "what the participant saw is in the record"


@pytest.mark.browser
async def test_an_experimenter_opens_orbits_and_closes_the_view(lab: LabServer, chromium_path: Path) -> None:
    made = invite(lab)
    async with (
        async_playwright() as playwright,
        await playwright.chromium.launch(executable_path=chromium_path, args=CHROMIUM_ARGUMENTS) as browser,
        visit(made["link"]) as player,
    ):
        await at_the_start(player)
        async with player.beating():
            await player.done("start")
            await player.status("running")
            hearing = asyncio.create_task(player.ended())
            await orbit(browser, lab, made["participant"])
            hearing.cancel()


async def orbit(browser: AsyncBrowser, lab: LabServer, participant: str) -> None:
    page = await browser.new_page(viewport={"width": 1280, "height": 720})
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    await page.goto(f"{lab.experimenter_link}")
    await page.locator(f"[data-participant={participant}]").get_by_test_id("open").click()
    toggle = page.get_by_test_id("spectator-toggle")
    await expect_async(toggle).to_have_attribute("aria-disabled", "false")
    await toggle.focus()
    await page.keyboard.press("Enter")
    await expect_async(page.get_by_test_id("spectator-frame")).to_be_visible()
    await expect_async(page.get_by_test_id("spectator-sign")).to_be_hidden(timeout=60_000)
    frame = page.frame(url=re.compile("/dashboard/scene/"))
    assert frame is not None
    await frame.wait_for_function("window.__viserTestpoints?.rendererInfo.render.calls > 25", timeout=60_000)
    where = "window.__viserMutable.camera.position.toArray().map((value) => value.toFixed(3)).join()"
    before = await frame.evaluate(where)
    await page.get_by_test_id("spectator-steer").click()
    await page.keyboard.down("ArrowLeft")
    await frame.wait_for_function(f"(before) => {where} !== before", arg=before)
    await page.keyboard.up("ArrowLeft")
    await page.keyboard.press("Escape")
    await expect_async(page.get_by_test_id("spectator-steer")).to_be_focused()
    turned = await frame.evaluate(where)
    box = await page.get_by_test_id("spectator-frame").bounding_box()
    assert box is not None
    middle = box["x"] + box["width"] / 2, min(box["y"] + box["height"] / 2, 600)
    await page.mouse.move(*middle)
    await page.mouse.down()
    await page.mouse.move(middle[0] + 120, middle[1], steps=5)
    await page.mouse.up()
    await frame.wait_for_function(f"(before) => {where} !== before", arg=turned)
    await toggle.click()
    await expect_async(page.get_by_test_id("spectator-frame")).to_have_count(0)
    assert errors == []
    await page.close()
