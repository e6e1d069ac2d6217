"""The scene proxy: its page, what it lets through, how it ends; and a real browser that shows the scene through it."""

from __future__ import annotations

import asyncio
import gzip
import io
import socket
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, closing, contextmanager, suppress
from typing import Any

import msgspec
import numpy as np
import pytest
import uvicorn
import viser
from PIL import Image
from playwright.sync_api import Frame, Page
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket
from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from app.simulated.connection import camera_message
from app.web import scene_proxy
from app.web.scene_proxy import SceneError, may_pass, patched, proxy_scene, scene_client_html, scene_page_response
from sim.view.looks import own_look
from sim.view.scene import SceneView
from sim.view.viewpoints import INSET
from tests.sim.view.test_scene import SIX, joined, world
from tests.support.viser_client import PROTOCOL, TIMEOUT_S, ViserClient


def packed(**fields: Any) -> bytes:
    return msgspec.msgpack.encode(fields)


# -- the page


def test_the_page_is_visers_with_our_script_before_its_own() -> None:
    html = scene_client_html().decode()
    assert html.index('document, "hasFocus"') < html.index("DecompressionStream")
    assert html.count("<head>") == 1
    with pytest.raises(SceneError, match="no <head>"):
        patched("<html></html>")


def test_the_page_of_the_inset_names_its_near_plane_by_which_the_scene_knows_it() -> None:
    html = scene_client_html().decode()
    assert f"initialCameraNear={INSET.near_m:g}&initialCameraFar={INSET.far_m:g}" in html
    assert "INSET_" not in html[: html.index("DecompressionStream")]


def test_the_page_comes_compressed_once_and_not_again() -> None:
    first = scene_page_response(Headers({"accept-encoding": "gzip, br"}))
    assert first.headers["content-encoding"] == "gzip"
    assert gzip.decompress(bytes(first.body)) == scene_client_html()
    assert first.media_type == "text/html; charset=utf-8"
    plain = scene_page_response(Headers({}))
    assert bytes(plain.body) == scene_client_html()
    again = scene_page_response(Headers({"if-none-match": f'"other", W/{first.headers["etag"]}'}))
    assert (again.status_code, bytes(again.body)) == (304, b"")


def test_without_viser_the_error_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(SceneError, match="viser is not installed"):
        scene_proxy.client_path()


# -- the filter


@pytest.mark.parametrize(
    ("message", "passes"),
    [
        (camera_message(), True),
        (packed(type="GetRenderResponseMessage", payload=b"x" * 100_000, render_uuid="u"), True),
        (packed(render_uuid="u", type="GetRenderResponseMessage", payload=b""), True),
        (packed(type="ShareUrlRequest"), False),
        (packed(type="ShareUrlDisconnect"), False),
        (packed(type="GuiUpdateMessage", uuid="u", updates={}), False),
        (packed(type="FileTransferStartUpload", filename="x"), False),
        (packed(type="ViewerCameraMessage", padding="x" * 5_000), False),
        (packed(type="GetRenderResponseMessage", payload=b"x" * 8_000_001), False),
        (packed(type=["ViewerCameraMessage"]), False),
        (packed(kind="ViewerCameraMessage"), False),
        (packed(type="ViewerCameraMessage") + packed(type="ShareUrlRequest"), False),
        (msgspec.msgpack.encode(["ViewerCameraMessage"]), False),
        (b"", False),
        (b"\xff\x00garbage", False),
    ],
)
def test_only_camera_and_render_messages_pass(message: bytes, passes: bool) -> None:
    assert may_pass(message) is passes


@pytest.mark.parametrize(
    "order", [("ViewerCameraMessage", "ShareUrlRequest"), ("ShareUrlRequest", "ViewerCameraMessage")]
)
def test_a_type_given_twice_does_not_slip_through(order: tuple[str, str]) -> None:
    pairs = [msgspec.msgpack.encode("type") + msgspec.msgpack.encode(kind) for kind in order]
    message = b"\x82" + b"".join(pairs)
    as_viser_reads_it = msgspec.msgpack.decode(message)["type"]
    assert may_pass(message) is (as_viser_reads_it == "ViewerCameraMessage")


# -- the tunnel, against a stand-in for viser


class Upstream:
    """A WebSocket server that tells all it sends and hears."""

    def __init__(self) -> None:
        self.heard: asyncio.Queue[bytes | str] = asyncio.Queue()
        self.connections: asyncio.Queue[ServerConnection] = asyncio.Queue()
        self.gone = asyncio.Event()

    async def __call__(self, connection: ServerConnection) -> None:
        await self.connections.put(connection)
        with suppress(ConnectionClosed):
            async for message in connection:
                await self.heard.put(message)
        self.gone.set()


@asynccontextmanager
async def proxied(port: int, results: list[int]) -> AsyncIterator[str]:
    """A server whose `/s/x/scene` is the proxy to `port`; gives its address."""

    async def endpoint(websocket: WebSocket) -> None:
        results.append(await proxy_scene(websocket, port))

    app = Starlette(routes=[WebSocketRoute("/s/x/scene", endpoint)])
    async with running(app) as number:
        yield f"ws://127.0.0.1:{number}/s/x/scene"


@asynccontextmanager
async def running(app: Starlette) -> AsyncIterator[int]:
    listener = socket.create_server(("127.0.0.1", 0))
    config = uvicorn.Config(
        app, log_level="warning", lifespan="off", ws="websockets-sansio", ws_per_message_deflate=False
    )
    server = uvicorn.Server(config)
    task = asyncio.create_task(server.serve(sockets=[listener]))
    try:
        yield listener.getsockname()[1]
    finally:
        server.should_exit = True
        await task


@asynccontextmanager
async def tunnel(
    results: list[int] | None = None,
) -> AsyncIterator[tuple[Upstream, ServerConnection, ClientConnection]]:
    upstream = Upstream()
    async with serve(upstream, "127.0.0.1", 0, subprotocols=[Subprotocol(PROTOCOL)]) as server:
        port = server.sockets[0].getsockname()[1]
        async with (
            proxied(port, [] if results is None else results) as url,
            connect(url, subprotocols=[Subprotocol(PROTOCOL)], max_size=None, proxy=None) as browser,
        ):
            yield upstream, await asyncio.wait_for(upstream.connections.get(), TIMEOUT_S), browser


async def test_frames_pass_down_and_only_allowed_ones_up() -> None:
    results: list[int] = []
    async with tunnel(results) as (upstream, viser, browser):
        assert browser.subprotocol == viser.subprotocol == PROTOCOL
        assert not viser.protocol.extensions, "viser's frames are compressed already"
        frame = b"\x00" * 3_000_000
        await viser.send(frame)
        assert await asyncio.wait_for(browser.recv(), TIMEOUT_S) == frame
        await browser.send(packed(type="ShareUrlRequest"))
        await browser.send("text is nothing viser understands")
        await browser.send(camera_message())
        assert await asyncio.wait_for(upstream.heard.get(), TIMEOUT_S) == camera_message()
        assert upstream.heard.empty()
        await browser.close()
        await asyncio.wait_for(upstream.gone.wait(), TIMEOUT_S)
    assert results == [2]


async def test_when_the_scene_ends_the_browser_is_told() -> None:
    async with tunnel() as (_, viser, browser):
        await viser.close()
        with pytest.raises(ConnectionClosed) as closed:
            await asyncio.wait_for(browser.recv(), TIMEOUT_S)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 1001


async def test_a_version_mismatch_keeps_its_code() -> None:
    async with tunnel() as (_, viser, browser):
        await viser.close(1002, "Version mismatch")
        with pytest.raises(ConnectionClosed) as closed:
            await asyncio.wait_for(browser.recv(), TIMEOUT_S)
        assert closed.value.rcvd is not None
        assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1002, "Version mismatch")


async def test_a_browser_that_vanishes_leaves_nothing_open() -> None:
    async with tunnel() as (upstream, _, browser):
        browser.transport.abort()
        await asyncio.wait_for(upstream.gone.wait(), TIMEOUT_S)


async def test_no_scene_no_viser_client_and_too_much_end_cleanly() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as unused:
        dead_port = unused.getsockname()[1]
    async with proxied(dead_port, []) as url:
        closings: tuple[tuple[list[Subprotocol] | None, int], ...] = (([Subprotocol(PROTOCOL)], 1013), (None, 1002))
        for protocols, code in closings:
            async with connect(url, subprotocols=protocols, proxy=None) as browser:
                with pytest.raises(ConnectionClosed) as closed:
                    await asyncio.wait_for(browser.recv(), TIMEOUT_S)
                assert closed.value.rcvd is not None and closed.value.rcvd.code == code
    async with tunnel() as (upstream, _, browser):
        with suppress(ConnectionClosed):
            await browser.send(b"x" * (scene_proxy.RENDER_LIMIT_BYTES + 1))
        with pytest.raises(ConnectionClosed) as closed:
            await asyncio.wait_for(browser.recv(), TIMEOUT_S)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 1009
        await asyncio.wait_for(upstream.gone.wait(), TIMEOUT_S)


# -- the real thing

PATH = "/s/x/scene"
PARENT = """<!doctype html><title>page</title><style>body{margin:0}iframe{border:0;width:100vw;height:100vh}</style>
<iframe src="/s/x/scene/"></iframe>
<script>window.heard = []; addEventListener("message", (event) => heard.push(event.data));</script>"""


class Served:
    """A scene behind the proxy, in a thread of its own, with a page that frames it."""

    def __init__(self, scene_port: int) -> None:
        self.scene_port: int | None = scene_port
        self.port = 0
        self._ready = threading.Event()
        self._stop: Callable[[], object] = lambda: None
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()))

    def __enter__(self) -> Served:
        self._thread.start()
        assert self._ready.wait(TIMEOUT_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()
        self._thread.join(TIMEOUT_S)

    async def _run(self) -> None:
        async def page(request: Request) -> Response:
            return scene_page_response(request.headers)

        async def parent(request: Request) -> Response:
            return HTMLResponse(PARENT)

        async def endpoint(websocket: WebSocket) -> None:
            await proxy_scene(websocket, self.scene_port or 1)

        routes = [Route("/", parent), Route("/s/x/scene/", page), WebSocketRoute("/s/x/scene", endpoint)]
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        self._stop = lambda: loop.call_soon_threadsafe(stop.set)
        async with running(Starlette(routes=routes)) as self.port:
            self._ready.set()
            await stop.wait()


@contextmanager
def opened_view() -> Iterator[SceneView]:
    """A view of six objects; the robot looks as the lab draws it."""
    with SceneView(look=own_look()) as view:
        view.open()
        view.show(SIX)
        view.update(world(SIX))
        yield view


def test_two_clients_get_the_same_scene_and_neither_can_publish_it(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = threading.Semaphore(0)
    monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda self: asked.release())
    with opened_view() as view, Served(view.open()) as served:
        with ViserClient(served.port, PATH, silent=True) as one, ViserClient(served.port, PATH) as other:
            one.backlog()
            other.backlog()
            assert sorted(one.nodes()) == sorted(other.nodes()) != []
            one.send({"type": "ShareUrlRequest"})
            one.send(msgspec.msgpack.decode(camera_message()))
            joined(view, 2)  # what followed it on the same connection has arrived: so would it have
            assert not asked.acquire(blocking=False)
        with ViserClient(view.open()) as direct:  # without the proxy it does get through
            direct.send({"type": "ShareUrlRequest"})
            assert asked.acquire(timeout=TIMEOUT_S)


def colours(png: bytes) -> np.ndarray:
    """The pixels of a screenshot, shape (N, 3)."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=np.int64).reshape(-1, 3)


def show_scene(page: Page, served: Served) -> Frame:
    """Open the page around the scene and wait until the robot and the objects are drawn; gives the scene's frame."""
    page.goto(f"http://127.0.0.1:{served.port}/")
    page.wait_for_function("heard.some((m) => m.type === 'scene' && m.connected)", timeout=60_000)
    frame = page.frames[1]
    frame.wait_for_function(
        "window.__viserTestpoints && window.__viserTestpoints.rendererInfo.render.calls > 25", timeout=60_000
    )
    return frame


def test_a_browser_shows_the_scene_and_nothing_else(page: Page) -> None:
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error.stack)))
    page.on("requestfailed", lambda request: errors.append(request.url))
    with opened_view() as view, Served(view.open()) as served:
        frame = show_scene(page, served)
        seen = colours(page.screenshot())
        yellow = (seen[:, 0] > 150) & (seen[:, 1] > 120) & (seen[:, 2] < 70)  # the bleach bottle
        orange = (seen[:, 0] > 170) & (abs(seen[:, 1] - 130) < 40) & (seen[:, 2] < 60)  # the right bin
        blue = (seen[:, 0] < 40) & (seen[:, 2] > 90) & (seen[:, 2] - seen[:, 1] > 30)  # the left bin
        white = np.all(seen > 190, axis=1)  # the arm, the table
        for name, part in (("yellow", yellow), ("orange", orange), ("blue", blue), ("white", white)):
            assert part.sum() > 100, name
        assert white.mean() < 0.5
        assert frame.evaluate("document.body.innerText.trim()") == ""
        assert frame.evaluate("document.querySelector('canvas[data-engine]').width === innerWidth") is True
        assert errors == []


def test_keys_leave_the_camera_alone_and_reach_the_page_around(page: Page) -> None:
    with opened_view() as view, Served(view.open()) as served:
        frame = show_scene(page, served)
        where = "window.__viserMutable.camera.position.toArray()"
        before = frame.evaluate(where)
        frame.evaluate("window.focus()")
        page.keyboard.down("w")
        page.wait_for_function("heard.some((m) => m.type === 'scene_key' && m.code === 'KeyW')")
        frame.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        page.keyboard.up("w")
        page.mouse.move(400, 300)
        page.mouse.down()
        page.mouse.move(600, 350, steps=4)
        page.mouse.up()
        frame.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        assert frame.evaluate(where) == pytest.approx(before, abs=1e-6)


def test_a_page_nobody_looks_at_reconnects_and_says_so(page: Page) -> None:
    with opened_view() as first, Served(first.open()) as served:
        show_scene(page, served)
        page.evaluate("heard.length = 0")
        served.scene_port = None
        first.close()
        page.wait_for_function("heard.some((m) => m.type === 'scene' && !m.connected)", timeout=30_000)
        with opened_view() as second:
            page.evaluate("heard.length = 0")
            served.scene_port = second.open()
            page.wait_for_function("heard.some((m) => m.type === 'scene' && m.connected)", timeout=30_000)
