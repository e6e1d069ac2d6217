"""A lab without robot or database, for tests of the pages: serves static/, speaks the wire, walks a script of states.

It checks what the page sends with the real message models, keeps it all in `received`, and does nothing by itself but
acknowledge, and go on to the next state when the step that ends the present one arrives.

    with FakeLab() as lab:
        page.goto(lab.participant_url)
        lab.show("trial")
        lab.send(tick(0))
        lab.wait_for(lambda m: m["type"] == "input")
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import threading
from collections.abc import Callable
from contextlib import asynccontextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from app.web.page_words import in_language
from app.web.participant_views import with_views
from app.wire import CLIENT_MESSAGE, SERVER_MESSAGE
from study.flow.answers import MAX_TEXT_CHARACTERS
from study.flow.flow import FLOW
from study.language.words import ENGLISH, Words
from tests.support.fake_pages import CONTENT, ENDS, NEXT

STATIC = Path(__file__).resolve().parents[2] / "static"
WAIT_S = 10.0
Message = dict[str, Any]
SCENE = """<!doctype html><body style="margin:0;background:#3c444e"><canvas></canvas>
<script>parent.postMessage({type: "scene", connected: true}, location.origin)</script></body>"""


class FakeLab:
    """One session, one server on a loopback port of its own."""

    def __init__(
        self,
        *,
        placement: str = "same_page_away",
        pace: str = "real_time",
        state: str = "consent",
        stimuli: Message | None = None,
    ) -> None:
        self.words: Words = ENGLISH  # what its documents are written in
        self.welcome: Message = {
            "type": "welcome",
            "protocol": 1,
            "role": "participant",
            "session": "test",
            "study_title": "Moving objects with a robot arm",
            "pace": pace,
            "tick_s": 0.5,
            "heartbeat_ms": 200,
            "placement": placement,
            "show_assistance": False,
            "last_seq": 0,
            "demo": True,
            "words_limit": MAX_TEXT_CHARACTERS,
            "stimuli": stimuli,
        }
        self.content: dict[str, Message] = dict(CONTENT)
        """What each state shows; a test may put something else."""
        self.state = state
        self.trial = 1
        self.acknowledges = True
        self.accepts = True
        self.refuses: dict[str, list[Message]] = {}
        """Step to the errors it is answered with, once."""
        self.received: list[Message] = []
        self.sessions: list[Message] = []
        self.commands: list[tuple[str, Message]] = []
        self._acknowledged: set[str] = set()
        self._clients: dict[str, tuple[WebSocket, asyncio.Queue[Message | None]]] = {}
        self._changed = threading.Condition()
        self._started = threading.Event()
        self._server = uvicorn.Server(
            uvicorn.Config(self._app(), host="127.0.0.1", port=0, log_level="error", ws="websockets-sansio")
        )
        self._thread = threading.Thread(target=self._server.run, name="fake-lab", daemon=True)

    # --- for tests -------------------------------------------------------------------------------------------

    @property
    def base_url(self) -> str:
        port = self._server.servers[0].sockets[0].getsockname()[1]
        return f"http://127.0.0.1:{port}"

    @property
    def participant_url(self) -> str:
        return f"{self.base_url}/s/test/"

    @property
    def panel_url(self) -> str:
        return f"{self.base_url}/s/test/panel/"

    def send(self, message: Message, role: str = "participant") -> None:
        """To the page, after checking that the real lab could have sent it."""
        SERVER_MESSAGE.validate_python(message)
        self._loop.call_soon_threadsafe(self._put, role, message)

    def show(self, state: str, trial: int | None = None) -> None:
        """Another page of the script."""
        self.state, self.trial = state, trial or self.trial
        for role in list(self._clients):
            self.send(self.page(), role)

    def page(self) -> Message:
        return {
            "type": "page",
            "state": self.state,
            "trial": self.trial,
            "trials": 3,
            "content": self.content[self.state],
        }

    def acknowledge_all(self) -> None:
        """What was left unacknowledged so far, now."""
        for message in self.received:
            if "id" in message:
                self.send({"type": "ack", "id": message["id"]})

    def drop(self) -> None:
        """Cuts every connection without a word."""
        for role in list(self._clients):
            self._loop.call_soon_threadsafe(self._put, role, None)

    def wait_for(self, wanted: Callable[[Message], bool], *, after: int = 0) -> Message:
        """The first message received (from position `after`) for which `wanted` holds."""
        found: list[Message] = []

        def there() -> bool:
            found[:] = [message for message in self.received[after:] if wanted(message)]
            return bool(found)

        with self._changed:
            if not self._changed.wait_for(there, WAIT_S):
                seen = "\n".join(json.dumps(message) for message in self.received[after:][-20:])
                raise AssertionError(f"the page did not send what was waited for; the last it sent:\n{seen}")
        return found[0]

    def wait_submit(self, step: str, *, after: int = 0) -> Message:
        return self.wait_for(lambda message: message["type"] == "submit" and message["step"] == step, after=after)

    def submits(self, step: str) -> list[Message]:
        return [message for message in self.received if message["type"] == "submit" and message["step"] == step]

    def inputs(self, *, after: int = 0) -> list[Message]:
        return [message for message in self.received[after:] if message["type"] == "input"]

    def mark(self) -> int:
        """A position in `received`, for `after`."""
        return len(self.received)

    def close(self) -> None:
        self._server.should_exit = True
        self.drop()
        self._thread.join(WAIT_S)

    def __enter__(self) -> FakeLab:
        self._thread.start()
        assert self._started.wait(WAIT_S), "the fake lab did not start"
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    # --- the wire --------------------------------------------------------------------------------------------

    def _put(self, role: str, message: Message | None) -> None:
        if role in self._clients:
            self._clients[role][1].put_nowait(message)

    async def _converse(self, websocket: WebSocket, role: str) -> None:
        if not self.accepts:
            await websocket.close()
            return
        await websocket.accept()
        with contextlib.suppress(WebSocketDisconnect):
            self._note(json.loads(await websocket.receive_text()), role)
            if role in self._clients:
                self._put(role, {"type": "superseded"})
                self._put(role, None)
            queue: asyncio.Queue[Message | None] = asyncio.Queue()
            mine = self._clients[role] = (websocket, queue)
            queue.put_nowait({**self.welcome, "role": role})
            queue.put_nowait(self.page())
            sending = asyncio.create_task(self._send_all(websocket, queue))
            try:
                while True:
                    self._receive(json.loads(await websocket.receive_text()), role)
            finally:
                sending.cancel()
                if self._clients.get(role) is mine:
                    del self._clients[role]

    async def _send_all(self, websocket: WebSocket, queue: asyncio.Queue[Message | None]) -> None:
        while (message := await queue.get()) is not None:
            await websocket.send_json(message)
        await websocket.close(1001)

    def _note(self, message: Message, role: str) -> None:
        CLIENT_MESSAGE.validate_python(message)  # what the real lab would refuse ends the test's connection
        with self._changed:
            self.received.append({**message, "role": role} if role == "panel" else message)
            self._changed.notify_all()

    def _receive(self, message: Message, role: str) -> None:
        self._note(message, role)
        if message["type"] not in ("submit", "note") or not self.acknowledges:
            return
        errors = self.refuses.pop(message.get("step", ""), None)
        if errors is not None:
            for error in errors:
                self._put(role, {"type": "error", "id": message["id"], **error})
            return
        self._put(role, {"type": "ack", "id": message["id"]})
        if message["id"] in self._acknowledged or message["type"] == "note":
            return
        self._acknowledged.add(message["id"])
        self._advance(message["step"])

    def _advance(self, step: str) -> None:
        if step in ENDS:
            self.state = ENDS[step]
        elif (self.state, step) in NEXT:
            self.state = NEXT[self.state, step]
        else:
            return
        for role in list(self._clients):
            self._put(role, self.page())

    # --- pages -----------------------------------------------------------------------------------------------

    def _app(self) -> Starlette:
        @asynccontextmanager
        async def lifespan(_: Starlette) -> Any:
            self._loop = asyncio.get_running_loop()
            self._loop.call_later(0.05, self._when_listening)
            yield

        def document(html: str) -> Response:
            return HTMLResponse(in_language(html, self.words), headers={"Cache-Control": "no-store"})

        def file(name: str) -> Callable[[Request], Any]:
            async def answer(_: Request) -> Response:
                return document((STATIC / name).read_text(encoding="utf-8"))

            return answer

        async def participant_page(_: Request) -> Response:
            return document(with_views((STATIC / "participant.html").read_text(encoding="utf-8"), FLOW))

        async def scene(_: Request) -> Response:
            return HTMLResponse(SCENE)

        async def participant(websocket: WebSocket) -> None:
            await self._converse(websocket, "participant")

        async def panel(websocket: WebSocket) -> None:
            await self._converse(websocket, "panel")

        return Starlette(
            lifespan=lifespan,
            routes=[
                Route("/", file("index.html")),
                Route("/dashboard", file("dashboard.html")),
                Route("/forbidden", file("forbidden.html")),
                Route("/s/test/", participant_page),
                Route("/s/test/panel/", file("panel.html")),
                Route("/s/test/scene/", scene),
                WebSocketRoute("/s/test/socket", participant),
                WebSocketRoute("/s/test/panel/socket", panel),
                Route("/api/sessions", self._sessions),
                Route("/api/participants", self._participants, methods=["POST"]),
                Route("/api/sessions/{participant}/{action}", self._command, methods=["POST"]),
                Route("/api/export", self._export, methods=["POST", "DELETE"]),
                Route("/api/export/progress", self._export),
                Route("/api/export/file", self._archive),
                Mount("/static", StaticFiles(directory=STATIC)),
            ],
        )

    def _when_listening(self) -> None:
        if self._server.started:
            self._started.set()
        else:
            self._loop.call_later(0.02, self._when_listening)

    @staticmethod
    def _allowed(request: Request) -> bool:
        return request.headers.get("authorization") == "Bearer right-token"

    async def _sessions(self, request: Request) -> Response:
        if not self._allowed(request):
            return JSONResponse({"detail": "the experimenter's token is needed"}, 403)
        return JSONResponse(self.sessions)

    async def _participants(self, request: Request) -> Response:
        body = await request.json()
        self.commands.append(("create", body))
        number = len(self.commands)
        made = [
            {
                "participant": f"p{number:03d}{chr(97 + index)}",
                "link": f"{self.base_url}/p/secret{number}{index}",
                "panel_link": f"{self.base_url}/d/secret{number}{index}",
                "second_device": True,
                "demo": body["demo"],
            }
            for index in range(body.get("count", 1))
        ]
        return JSONResponse({**made[0], "created": made}, 201)

    async def _command(self, request: Request) -> Response:
        participant, action = request.path_params["participant"], request.path_params["action"]
        body = await request.json()
        self.commands.append((f"{participant} {action}", body))
        if action == "abort" and participant == "p002":
            detail = "event 'abort' is not allowed in state 'done'"
            return JSONResponse({"detail": detail}, 409)
        return JSONResponse({"participant": participant, "state": "paused"})

    async def _export(self, request: Request) -> Response:
        """It is made at once."""
        told = {"step": 9, "of": 9, "text": "", "made_utc": None, "include_pilot": False}
        size = {"excel_safe": False, "bytes": 22, "rows": 0}
        return JSONResponse({"state": "none" if request.method == "DELETE" else "made", **told, **size})

    async def _archive(self, _: Request) -> Response:
        headers = {"Content-Disposition": 'attachment; filename="export.zip"'}
        return Response(b"PK\x05\x06" + bytes(18), media_type="application/zip", headers=headers)
