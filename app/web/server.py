"""create_app(lab): pages, links, sockets. Routes and checks of who may, no decisions."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request, WebSocket
from fastapi.exception_handlers import http_exception_handler
from fastapi.exceptions import RequestValidationError
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import FileResponse, HTMLResponse, JSONResponse, RedirectResponse, Response
from fastapi.staticfiles import StaticFiles
from fastapi_offline import FastAPIOffline
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Scope

from app.errors import LabError
from app.lab.lab import Lab, NoSuchParticipant, StudyUnreadable
from app.lab.tokens import Attempts
from app.limits import Meter
from app.monitoring.log_lines import about
from app.session.interfaces import Role
from app.session.session import LiveSession
from app.static_folder import STATIC
from app.web import participant_socket as sockets
from app.web.access import ErrorReply, Problem
from app.web.addresses import COOKIES, Prefixed, place_of, prefix, set_cookie
from app.web.arbiter_api import add_arbiter_api
from app.web.counted import Counted, Named
from app.web.dashboard_frames import add_dashboard_frames
from app.web.export_api import add_export_api
from app.web.guard import Guard, address_of
from app.web.health_api import add_health_api
from app.web.join_api import STATUS, add_join, again, look
from app.web.live_api import add_live
from app.web.page_words import in_language
from app.web.participant_views import own_views, with_views
from app.web.qr_code import qr_svg
from app.web.results_api import add_results_api
from app.web.roster_api import add_roster_api
from app.web.scene_proxy import proxy_scene, scene_page_response
from app.web.security_headers import CSP, PAGE, api_pages
from app.web.sessions_api import add_sessions_api
from study.language.words import ENGLISH, Words
from study.store import WHAT_TO_DO, StoreTroubled

log = logging.getLogger(__name__)

MAX_PROBLEMS = 20
"""So many mistakes of a request are told."""
MAX_LENGTH_DIGITS = 18
"""Of a Content-Length: more of them Python might refuse to read."""
LET_PASS = 4
"""A body of up to so many times the bound is read before it is refused."""
AGAIN_AFTER_S = 3
"""After so long a browser asks for a page again that a database which is away has none for."""


EVERYWHERE: dict[int | str, dict[str, Any]] = {
    411: {"model": ErrorReply, "description": "the request does not say how large it is"},
    413: {"model": ErrorReply, "description": "the request is too large"},
    422: {"model": ErrorReply, "description": "what was sent is wrong"},
    503: {"model": ErrorReply, "description": "the lab cannot do this now"},
}
"""What every route may answer."""


class ServedFiles(StaticFiles):
    """What pages load. The folders' own READMEs are for those who work on them."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """404 for Markdown as for what is not there."""
        if path.lower().endswith(".md"):
            raise HTTPException(404)
        return await super().get_response(path, scope)


def create_app(lab: Lab) -> FastAPI:
    """The web application of one prepared lab; it opens the lab when it starts and closes it when it ends."""

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        await lab.open()
        try:
            yield
        finally:
            app.state.evaluations.close()
            await lab.close()

    app = FastAPIOffline(
        title="Shared Autonomy Lab",
        description="Run, log, replay and analyse shared-autonomy studies.",
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
        responses=EVERYWHERE,
    )
    app.state.lab = lab
    app.add_middleware(Named)  # around the router, inside of everything that answers by itself
    _add_guard(app, lab)
    add_sessions_api(app, lab)
    add_health_api(app)
    add_arbiter_api(app, lab)
    add_roster_api(app)
    add_results_api(app)
    add_export_api(app)
    add_live(app, lab)
    add_join(app, lab)
    add_dashboard_frames(app, lab)
    _add_errors(app, lab)
    _add_pages(app, lab)
    _add_sockets(app, lab)
    app.add_middleware(Prefixed, lab=lab)
    _add_views(app, lab)
    app.mount("/static", ServedFiles(directory=STATIC), name="static")
    return app


def _add_guard(app: FastAPI, lab: Lab) -> None:
    """Around all that the framework answers by itself, too: errors in the lab's own code are outside its middleware."""
    build = app.build_middleware_stack

    def guarded() -> ASGIApp:
        return Counted(Guard(build(), lab), lab.metrics)

    app.build_middleware_stack = guarded  # type: ignore[method-assign]


def _add_errors(app: FastAPI, lab: Lab) -> None:
    @app.exception_handler(RequestValidationError)
    async def invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        """What is wrong, without echoing what was sent (it may be NaN, or megabytes)."""
        problems = [Problem(field=_field(item["loc"]), message=item["msg"]) for item in error.errors()]
        return _wrong(problems[:MAX_PROBLEMS])

    @app.exception_handler(HTTPException)
    async def unreadable(request: Request, error: HTTPException) -> Response:
        """JSON that Python gives up on (a number of thousands of digits, endless nesting) is wrong like any other."""
        if error.status_code != 400:
            return await http_exception_handler(request, error)
        return _wrong([Problem(field="body", message="cannot be read as JSON")])

    @app.exception_handler(LabError)
    async def lab_error(_: Request, error: LabError) -> JSONResponse:
        return JSONResponse({"detail": str(error)}, 503)

    @app.exception_handler(StoreTroubled)
    async def not_saved(request: Request, error: StoreTroubled) -> JSONResponse:
        """What was asked for is not on disk, or cannot be read. Whoever follows a link asks again by themselves."""
        is_page = request.method == "GET" and "text/html" in request.headers.get("accept", "")
        again = {"Refresh": str(AGAIN_AFTER_S)} if is_page else {}
        return JSONResponse({"detail": f"The lab cannot save now. {WHAT_TO_DO[error.kind]}"}, 503, headers=again)

    @app.middleware("http")
    async def sized(request: Request, call_next: Any) -> Response:
        response: Response = await _too_large(request, lab) or await call_next(request)
        return response


def _wrong(problems: list[Problem]) -> JSONResponse:
    """The answer to a request with these mistakes."""
    detail = "; ".join(f"{problem.field}: {problem.message}" for problem in problems)
    return JSONResponse(ErrorReply(detail=detail, problems=problems).model_dump(), 422)


def _field(place: Sequence[str | int]) -> str:
    """The name of what is wrong; JSON that cannot be read at all has only a position."""
    inner = place[1:]
    return ".".join(str(part) for part in inner) if inner and isinstance(inner[0], str) else "body"


async def _too_large(request: Request, lab: Lab) -> Response | None:
    """The answer to a request that says it is too large, or does not say how large it is.

    A body that is not many times too large is read, and thrown away, before the answer: on a connection that is closed
    while more comes, proxies lose the answer.
    """
    length, most = request.headers.get("content-length", "0"), lab.config.limits.body_bytes
    closing = {"Connection": "close"}  # what comes is not read
    if "transfer-encoding" in request.headers:
        return JSONResponse({"detail": "the request must say its Content-Length"}, 411, headers=closing)
    if not length.isdecimal() or len(length) > MAX_LENGTH_DIGITS or int(length) > most:
        lab.refusals.add("body")
        waits = "expect" in request.headers  # for a word before it sends the body
        if length.isdecimal() and len(length) <= MAX_LENGTH_DIGITS and int(length) <= LET_PASS * most and not waits:
            async for _ in request.stream():
                pass
            closing = {}
        return JSONResponse({"detail": f"the request is larger than {most} bytes"}, 413, headers=closing)
    return None


def _add_pages(app: FastAPI, lab: Lab) -> None:
    def page(name: str, status: int = 200, words: Words = ENGLISH) -> Response:
        """A page of ours; its addresses begin with the lab's prefix."""
        text = with_views((STATIC / name).read_text(encoding="utf-8"), lab.flow)
        text = in_language(text, words)
        text = text.replace('="/', f'="{prefix(lab)}/')
        headers = {CSP: PAGE, "Cache-Control": "no-cache"}
        return HTMLResponse(text, status, headers=headers)

    wrong_links = Attempts(lab.config.limits.wrong_links_per_min, addresses=lab.config.limits.addresses)

    def forbidden(request: Request, token: str | None) -> Response:
        """One answer for every link that is not valid: it tells nothing about what exists. Whoever tries many has to
        wait."""
        wait_s = math.ceil(wrong_links.add(address_of(request.scope), token, time.monotonic())) if token else 0
        response = page("forbidden.html", 429 if wait_s else 403, lab.setup.study.words)
        if wait_s:
            lab.refusals.add("wrong_links")
            response.headers["Retry-After"] = str(wait_s)
        return response

    async def words_of(request: Request, role: Role) -> Words:
        """The words of the study that the holder of this page's cookie is enrolled in."""
        held = await lab.holder(request.cookies.get(COOKIES[role]) or "")
        try:
            study = await lab.study_of(held[0]) if held is not None else lab.setup.study
        except StudyUnreadable:  # the page's socket tells
            study = lab.setup.study
        return study.words

    async def enter(request: Request, token: str, role: Role) -> Response:
        """Changes nothing: whoever fetches a link may be a mail scanner. The page's socket is what begins a session."""
        place = await lab.place(token)
        if place is None or place[1] != role:
            return forbidden(request, token)
        path = place_of(place[0], role)
        response = RedirectResponse(f"{prefix(lab)}{path}/", 303)
        set_cookie(response, request, lab, COOKIES[role], token, path)
        return response

    def given(request: Request, role: Role = "participant") -> str | None:
        return request.cookies.get(COOKIES[role])

    async def is_holder(request: Request, public_id: str, role: Role) -> bool:
        token = request.cookies.get(COOKIES[role])
        return bool(token) and await lab.place(token or "") == (public_id, role)

    @app.get("/", include_in_schema=False)
    async def front() -> Response:
        return page("index.html")

    @app.get("/dashboard", include_in_schema=False)
    async def dashboard() -> Response:
        return page("dashboard.html")

    @app.get("/join", include_in_schema=False)
    async def join_page(request: Request) -> Response:
        """Whoever fetches it may be a mail scanner: the page's button enrols (see `app.web.join_api`)."""
        state = (await look(request, lab)).answer
        response = page("join.html", STATUS.get(state, 200), lab.setup.study.words)
        response.headers.update(again(state))
        return response

    @app.get("/p/{token}", include_in_schema=False)
    async def participant_link(request: Request, token: str) -> Response:
        return await enter(request, token, "participant")

    @app.get("/d/{token}", include_in_schema=False)
    async def panel_link(request: Request, token: str) -> Response:
        return await enter(request, token, "panel")

    @app.get("/s/{public_id}/", include_in_schema=False)
    async def participant_page(request: Request, public_id: str) -> Response:
        allowed = await is_holder(request, public_id, "participant")
        return (
            page("participant.html", words=await words_of(request, "participant"))
            if allowed
            else forbidden(request, given(request))
        )

    @app.get("/s/{public_id}/panel/", include_in_schema=False)
    async def panel_page(request: Request, public_id: str) -> Response:
        allowed = await is_holder(request, public_id, "panel")
        return (
            page("panel.html", words=await words_of(request, "panel"))
            if allowed
            else forbidden(request, given(request, "panel"))
        )

    @app.get("/s/{public_id}/scene/", include_in_schema=False)
    async def scene_page(request: Request, public_id: str) -> Response:
        allowed = await is_holder(request, public_id, "participant")
        return scene_page_response(request.headers) if allowed else forbidden(request, given(request))

    @app.get("/s/{public_id}/second-device.svg", include_in_schema=False)
    async def second_device_qr(request: Request, public_id: str) -> Response:
        """The second device's link, for its camera: as the participant's page shows it."""
        token = request.cookies.get(COOKIES["participant"])
        holder = await lab.holder(token) if token else None
        if holder is None or (holder[0].public_id, holder[1]) != (public_id, "participant"):
            return forbidden(request, token)
        live = lab.live_session(holder[0].participant)
        if live is None or live.panel_link is None:
            return Response(status_code=404)
        return Response(qr_svg(live.panel_link), media_type="image/svg+xml", headers={"Cache-Control": "no-store"})

    @app.get("/docs", include_in_schema=False)
    async def api_documentation() -> Response:
        """The API's own page, with files of the lab alone."""
        root, files = prefix(lab), "/static-offline-docs"
        html = get_swagger_ui_html(
            openapi_url=f"{root}{app.openapi_url}",
            title=f"{app.title}: HTTP API",
            swagger_js_url=f"{root}{files}/swagger-ui-bundle.js",
            swagger_css_url=f"{root}{files}/swagger-ui.css",
            swagger_favicon_url=f"{root}{files}/favicon.png",
        )
        text = bytes(html.body).decode()
        return HTMLResponse(text, headers={CSP: api_pages(text)})

    @app.get("/favicon.ico", include_in_schema=False)
    async def favicon() -> Response:
        return Response(status_code=204)


def _add_views(app: FastAPI, lab: Lab) -> None:
    """Views of pages of one's own, beside those in static/."""

    def serve_file(address: str, file: Path) -> None:
        @app.get(address, include_in_schema=False)
        async def view() -> Response:
            return FileResponse(file, media_type="text/javascript", headers={"Cache-Control": "no-cache"})

    for address, file in own_views(lab.flow, STATIC).items():
        serve_file(address, file)


def _add_sockets(app: FastAPI, lab: Lab) -> None:
    async def admitted(websocket: WebSocket, public_id: str, role: Role) -> LiveSession | None:
        """The session a socket belongs to; otherwise the handshake is answered with 403."""
        token = websocket.cookies.get(COOKIES[role]) or ""
        try:
            fits = bool(token) and await lab.place(token) == (public_id, role)
            is_ours = fits and sockets.same_origin(websocket, lab.config.public_url)
            holder = await lab.admit(token) if is_ours else None
            if holder is not None:
                return await lab.session(holder[0])
        except StoreTroubled:  # who has no record yet comes in when one can be made
            await websocket.close(1013)
            return None
        except NoSuchParticipant:  # erased in this moment
            pass
        except StudyUnreadable as error:
            log.error("a participant's page was turned away", extra=about(reason=str(error)))
        await websocket.close(1008)
        return None

    places = sockets.Places(lab.config.limits.sockets_per_session)
    meters: dict[str, Meter] = {}
    """Of each session: another socket says no more than the one before."""

    async def turned_away(request: Request, public_id: str, role: Role) -> Response:
        """Why a page whose link is good is not let in: a browser is not told why its socket was refused."""
        token = request.cookies.get(COOKIES[role]) or ""
        if not token or await lab.place(token) != (public_id, role):
            return JSONResponse({"why": "denied"}, 403)
        why = "too_many" if places.is_full(public_id) else ""
        holder = await lab.holder(token)
        try:
            if holder is not None:
                await lab.session(holder[0])
        except NoSuchParticipant:
            return JSONResponse({"why": "denied"}, 403)
        except StudyUnreadable:
            why = "unusable"
        return JSONResponse({"why": why}, headers={"Cache-Control": "no-store"})

    @app.get("/s/{public_id}/why", include_in_schema=False)
    async def why_not_participant(request: Request, public_id: str) -> Response:
        return await turned_away(request, public_id, "participant")

    @app.get("/s/{public_id}/panel/why", include_in_schema=False)
    async def why_not_panel(request: Request, public_id: str) -> Response:
        return await turned_away(request, public_id, "panel")

    async def converse(websocket: WebSocket, public_id: str, role: Role) -> None:
        session = await admitted(websocket, public_id, role)
        if session is None:
            return
        with places.take(public_id) as is_free:
            if not is_free:
                lab.refusals.add("sockets")
                await websocket.close(1013)
                return
            meter = meters.setdefault(public_id, Meter(lab.config.limits))
            if session.enrolment.pace == "real_time" and not meter.opened(time.monotonic()):
                lab.refusals.add("messages")
                await websocket.accept()
                await sockets.refuse(websocket, "this page has sent too much; it is let in again after a while")
                return
            agent = websocket.headers.get("user-agent", "")[:300]
            lab.note_identity(session.enrolment.participant, f"user_agent_{role}", agent)
            await websocket.accept()
            bounds = sockets.Bounds(lab.config.limits, meter, lab.refusals)
            await sockets.serve(websocket, session, role, lab.client_message, bounds, lab.metrics.refused)

    @app.websocket("/s/{public_id}/socket")
    async def participant_socket(websocket: WebSocket, public_id: str) -> None:
        await converse(websocket, public_id, "participant")

    @app.websocket("/s/{public_id}/panel/socket")
    async def panel_socket(websocket: WebSocket, public_id: str) -> None:
        await converse(websocket, public_id, "panel")

    @app.websocket("/s/{public_id}/scene")
    async def scene_socket(websocket: WebSocket, public_id: str) -> None:
        session = await admitted(websocket, public_id, "participant")
        if session is None:
            return
        with places.take(public_id) as is_free:
            if session.scene_port is None or not is_free:
                await websocket.close(1013)
                return
            await proxy_scene(websocket, session.scene_port)
