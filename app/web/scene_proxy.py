"""The window onto a worker's viser server: its page, made fit for a study, and its WebSocket, filtered.

    browser ── GET /s/<id>/scene/ ──► the client page, from the installed package, patched here
            ══ WebSocket /s/<id>/scene ══► `proxy_scene` ══► ws://127.0.0.1:<port>  (viser, loopback only)

A participant's page opens a second window onto the same server, the inset: `/s/<id>/scene/?inset`. It is the same page
with another near plane, by which the scene knows it (`sim.view.nodes`), and draws less often, so that it hardly slows
down the first.

The same for experimenters at /dashboard/scene/<participant>/, onto the server of their own, with a camera they steer.

Towards the browser everything passes. From the browser only messages about its camera and rendered frames do: viser
would also let any client open a public tunnel to the session, write files or press controls. Who may connect at all,
cookies and Origin are the server's business, not this module's.

viser itself is never imported: the web process needs one file of it.
"""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import hashlib
import importlib.util
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import msgspec
from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.typing import Subprotocol

from app.errors import LabError
from app.web.security_headers import CSP, SCENE
from sim.view.viewpoints import INSET

CLIENT_MESSAGES = frozenset({"ViewerCameraMessage", "GetRenderResponseMessage"})
"""The message types a browser may send."""
CAMERA_LIMIT_BYTES = 4_096
RENDER_LIMIT_BYTES = 8_000_000
SCENE_LIMIT_BYTES = 50_000_000
"""The largest message viser may send: its whole backlog can come as one."""
CONNECT_TIMEOUT_S = 5.0
PROTOCOL_PREFIX = "viser-v"

INSET_EVERY_MS = 100
"""The inset draws at most so often."""

CLOSE_NORMAL = 1000
CLOSE_GOING_AWAY = 1001
CLOSE_PROTOCOL = 1002
CLOSE_TOO_BIG = 1009
CLOSE_TRY_LATER = 1013

# The page's own background shows through the canvas; a soft light above, the floor's colour below.
PICTURE_STYLE = """
html, body, #root { background: radial-gradient(120% 90% at 50% 30%, #5b6672 0%, #3c444e 55%, #2a3038 100%) !important;
  overflow: hidden; }
body { user-select: none; }
#root * { background: transparent !important; }
/* Only the picture: no panels, notices, logo, palette, frame rate. */
body > *:not(#root):not(script):not(style), .mantine-Notifications-root, .mantine-Paper-root, .mantine-Modal-root,
.mantine-ActionIcon-root, .stats-panel, [title="About Viser"], [data-mantine-shared-portal-node] {
  display: none !important; }
"""
_FIXED_LOOK = """
body { pointer-events: none; }
body * { pointer-events: none !important; }
"""

# Runs before the client does. The client starts a worker that owns the WebSocket and reports "connected" and
# "closed", and it reconnects only while its window has the focus, which inside our page it never has.
_SCRIPT = """
(() => {
  "use strict";
  const url = new URL(location.href);
  const inset = url.searchParams.has("inset");
  url.search = "?fixedDpr=1&hideViserLogo" + (inset ? "&initialCameraNear=INSET_NEAR&initialCameraFar=INSET_FAR" : "");
  history.replaceState(null, "", url);
  Object.defineProperty(document, "hasFocus", { value: () => true });
  // The inset moves a millimetre or two between its pictures; the frames it leaves out are left to the main picture.
  if (inset) {
    const every = window.requestAnimationFrame.bind(window);
    let last = -Infinity;
    let waiting = new Map();
    let number = 0;
    let timer = 0;
    const draw = (now) => {
      last = now;
      const due = waiting;
      waiting = new Map();
      timer = 0;
      for (const callback of due.values()) callback(now);
    };
    window.requestAnimationFrame = (callback) => {
      number += 1;
      waiting.set(number, callback);
      if (!timer) timer = setTimeout(() => every(draw), Math.max(0, last + INSET_EVERY_MS - performance.now()));
      return number;
    };
    window.cancelAnimationFrame = (which) => waiting.delete(which);
  }
  // Without a graphics card smoothed edges cost a third of every frame; with one they cost nothing.
  const software = () => {
    const probe = document.createElement("canvas").getContext("webgl");
    const info = probe && probe.getExtension("WEBGL_debug_renderer_info");
    const name = info ? String(probe.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
    const lose = probe && probe.getExtension("WEBGL_lose_context");
    if (lose) lose.loseContext();
    return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
  };
  const getContext = HTMLCanvasElement.prototype.getContext;
  if (software()) {
    HTMLCanvasElement.prototype.getContext = function (kind, wishes) {
      return getContext.call(this, kind, String(kind).startsWith("webgl") ? { ...wishes, antialias: false } : wishes);
    };
  }
  // A quad as large as the screen waits for background images, of which there are none.
  let inner;
  Object.defineProperty(window, "__viserMutable", {
    configurable: true,
    get: () => inner,
    set: (value) => {
      inner = value;
      if (value && value.backgroundMaterial) value.backgroundMaterial.visible = false;
    },
  });
  const tell = (connected) => {
    if (window.parent !== window) window.parent.postMessage({ type: "scene", connected }, location.origin);
  };
  const Original = window.Worker;
  window.Worker = class extends Original {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", (event) => {
        const type = event.data && event.data.type;
        if (type === "connected") tell(true);
        else if (type === "closed") tell(false);
      });
    }
  };
})();
"""

# Whether there is a picture at all: some browsers draw no 3-D graphics, and any may stop to.
_PICTURE_SCRIPT = """
(() => {
  "use strict";
  const tell = (drawn, why) => {
    if (window.parent !== window) window.parent.postMessage({ type: "picture", drawn, why }, location.origin);
  };
  const getContext = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...wishes) {
    const context = getContext.call(this, kind, ...wishes);
    if (!String(kind).startsWith("webgl")) return context;
    if (context) {
      this.addEventListener("webglcontextlost", () => tell(false, "context_lost"));
      this.addEventListener("webglcontextrestored", () => tell(true, null));
      tell(true, null);
    } else tell(false, "no_webgl");
    return context;
  };
})();
"""

# The participant's camera is the study's: no key or pointer reaches the client. Keys that land here go to the page
# around.
_FIXED_SCRIPT = """
(() => {
  "use strict";
  for (const name of ["keydown", "keyup", "keypress"]) {
    window.addEventListener(name, (event) => {
      event.stopImmediatePropagation();
      if (window.parent === window || name === "keypress") return;
      window.parent.postMessage({ type: "scene_key", phase: name, code: event.code, repeat: event.repeat },
        location.origin);
    }, true);
  }
  for (const name of ["pointerdown", "pointermove", "pointerup", "wheel", "contextmenu", "touchstart", "dblclick"]) {
    window.addEventListener(name, (event) => event.stopImmediatePropagation(), { capture: true, passive: true });
  }
})();
"""

# An experimenter steers their own camera: by pointer, or by keys while the picture has the focus. Escape gives it back.
_STEERED_SCRIPT = """
(() => {
  "use strict";
  window.addEventListener("keydown", (event) => {
    if (event.code === "Escape") window.parent.postMessage({ type: "scene_leave" }, location.origin);
  }, true);
})();
"""


class SceneError(LabError):
    """The scene cannot be served; the text says what is missing."""


@dataclass(frozen=True)
class ScenePage:
    """The patched client page: compressed once, and the tag that says it has not changed."""

    html: bytes
    gzipped: bytes
    etag: str


def client_path() -> Path:
    """Where the installed viser keeps its single-file client.

    Raises:
        SceneError: viser is not installed, or without its built client.
    """
    spec = importlib.util.find_spec("viser")
    if spec is None or spec.origin is None:
        raise SceneError("viser is not installed: the 3-D view cannot be served")
    path = Path(spec.origin).parent / "client" / "build" / "index.html"
    if not path.is_file():
        raise SceneError("the installed viser has no built client (client/build/index.html)")
    return path


def patched(html: str, steered: bool = False) -> str:
    """viser's page with our style and script first in its head; its camera can be `steered`, or is fixed.

    Raises:
        SceneError: the page has no head to put them into.
    """
    before, head, after = html.partition("<head>")
    if not head:
        raise SceneError("viser's client page has no <head>; this version of viser is not known to the lab")
    filled = {"INSET_NEAR": INSET.near_m, "INSET_FAR": INSET.far_m, "INSET_EVERY_MS": INSET_EVERY_MS}
    script = _SCRIPT + _PICTURE_SCRIPT + (_STEERED_SCRIPT if steered else _FIXED_SCRIPT)
    for name, value in filled.items():
        script = script.replace(name, f"{value:g}")
    style = PICTURE_STYLE + ("" if steered else _FIXED_LOOK)
    return f"{before}{head}<script>{script}</script><style>{style}</style>{after}"


@lru_cache(maxsize=2)
def scene_page(steered: bool = False) -> ScenePage:
    """The page, read, patched and compressed once per process. Raises `SceneError` as `client_path` does."""
    html = patched(client_path().read_text(encoding="utf-8"), steered).encode()
    tag = hashlib.sha256(html).hexdigest()[:20]
    return ScenePage(html, gzip.compress(html, 9, mtime=0), f'"{tag}"')


def scene_client_html() -> bytes:
    """The patched page, not compressed. Raises `SceneError` as `client_path` does."""
    return scene_page().html


def scene_page_response(headers: Headers, steered: bool = False) -> Response:
    """Answer `GET /s/<id>/scene/`: 304 when the browser has the page, gzip when it takes it."""
    page = scene_page(steered)
    known = {
        "ETag": page.etag,
        "Cache-Control": "private, no-cache",
        "Vary": "Accept-Encoding",
        CSP: SCENE,
    }
    offered = {tag.strip().removeprefix("W/") for tag in headers.get("if-none-match", "").split(",")}
    if page.etag in offered:
        return Response(status_code=304, headers=known)
    if "gzip" in headers.get("accept-encoding", ""):
        known["Content-Encoding"] = "gzip"
        return Response(page.gzipped, headers=known, media_type="text/html; charset=utf-8")
    return Response(page.html, headers=known, media_type="text/html; charset=utf-8")


class _TypeOnly(msgspec.Struct):
    type: str


_type_decoder = msgspec.msgpack.Decoder(_TypeOnly)


def may_pass(message: bytes) -> bool:
    """Whether a browser's message may reach viser: a known harmless type and not larger than that type needs."""
    if len(message) > RENDER_LIMIT_BYTES:
        return False
    try:
        kind = _type_decoder.decode(message).type
    except (msgspec.DecodeError, UnicodeDecodeError):
        return False
    return kind in CLIENT_MESSAGES and (kind != "ViewerCameraMessage" or len(message) <= CAMERA_LIMIT_BYTES)


def offered_protocol(websocket: WebSocket) -> str | None:
    """The `viser-v<version>` subprotocol the browser offers, if any."""
    offered = websocket.scope.get("subprotocols") or []
    return next((name for name in offered if name.startswith(PROTOCOL_PREFIX)), None)


async def proxy_scene(
    websocket: WebSocket, port: int, allow: Callable[[bytes], bool] = may_pass, host: str = "127.0.0.1"
) -> int:
    """Join a browser's (not yet accepted) WebSocket to the viser server on `port` until either side leaves.

    Messages from the browser for which `allow` is false are dropped and the connection goes on. Returns the number
    of those dropped. Never raises for what the network or the browser does; a cancelled call closes both sides.
    """
    protocol = offered_protocol(websocket)
    if protocol is None:
        await _close(websocket, CLOSE_PROTOCOL, "not a viser client")
        return 0
    try:
        upstream = await connect(
            f"ws://{host}:{port}",
            subprotocols=[Subprotocol(protocol)],
            compression=None,
            max_size=SCENE_LIMIT_BYTES,
            open_timeout=CONNECT_TIMEOUT_S,
            close_timeout=1.0,
            proxy=None,
        )
    except (OSError, TimeoutError, asyncio.TimeoutError, InvalidHandshake, InvalidURI, ConnectionClosed):
        await _close(websocket, CLOSE_TRY_LATER, "the scene is not there now")
        return 0
    pumps: list[asyncio.Task[tuple[int, str]]] = []
    dropped = [0]
    try:
        await websocket.accept(subprotocol=protocol)
        pumps = [
            asyncio.create_task(_to_browser(upstream, websocket)),
            asyncio.create_task(_to_viser(websocket, upstream, allow, dropped)),
        ]
        done, _ = await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
        code, reason = next(iter(done)).result()
        await _close(websocket, code, reason)
    except (WebSocketDisconnect, RuntimeError, OSError):
        pass  # the browser left while we spoke to it
    finally:
        for pump in pumps:
            pump.cancel()
        await asyncio.gather(*pumps, return_exceptions=True)
        await _quietly(upstream.close())
        await _close(websocket, CLOSE_GOING_AWAY, "")
    return dropped[0]


async def _to_browser(upstream: ClientConnection, websocket: WebSocket) -> tuple[int, str]:
    try:
        async for message in upstream:
            if isinstance(message, bytes):
                await websocket.send_bytes(message)
            else:
                await websocket.send_text(message)
    except ConnectionClosed as closed:
        received = closed.rcvd
        if received is not None and received.code == CLOSE_PROTOCOL:
            return CLOSE_PROTOCOL, received.reason  # the client tells a version mismatch by this code
    except (WebSocketDisconnect, RuntimeError, OSError):
        return CLOSE_NORMAL, ""
    return CLOSE_GOING_AWAY, "the scene ended"


async def _to_viser(
    websocket: WebSocket, upstream: ClientConnection, allow: Callable[[bytes], bool], dropped: list[int]
) -> tuple[int, str]:
    try:
        while True:
            received = await websocket.receive()
            if received["type"] == "websocket.disconnect":
                return CLOSE_NORMAL, ""
            message = received.get("bytes")
            if message is not None and len(message) > RENDER_LIMIT_BYTES:
                return CLOSE_TOO_BIG, "message too large"
            if message is not None and allow(message):
                await upstream.send(message)
            else:
                dropped[0] += 1
    except ConnectionClosed:
        return CLOSE_GOING_AWAY, "the scene ended"


async def _close(websocket: WebSocket, code: int, reason: str) -> None:
    if websocket.application_state is WebSocketState.DISCONNECTED:
        return
    if websocket.client_state is WebSocketState.DISCONNECTED:
        return
    if websocket.application_state is WebSocketState.CONNECTING:
        # A browser learns the code of a close only after the handshake.
        await _quietly(websocket.accept(subprotocol=offered_protocol(websocket)))
    await _quietly(websocket.close(code, reason))


async def _quietly(sending: Awaitable[None]) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError, ConnectionClosed):
        await sending
