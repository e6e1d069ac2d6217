"""What a dashboard opens in frames and tabs, where a browser sends no header of ours: a cookie opens these instead.

POST   /api/desk                         with the token: a cookie for /dashboard, which scripts cannot read
DELETE /api/desk                         takes it away
GET    /dashboard/scene/{participant}/   the 3-D view with a camera to steer, and its WebSocket without the slash
GET    /dashboard/report/                the report of the data so far, and its figures below
"""

from __future__ import annotations

from fastapi import FastAPI, Request, Response, WebSocket
from fastapi.responses import FileResponse, JSONResponse

from app.lab.lab import Lab
from app.lab.tokens import dashboard_key, same_token
from app.report.process import PAGE
from app.web.access import Experimenter, TheLab, experimenters_router
from app.web.addresses import prefix
from app.web.participant_socket import Places, same_origin
from app.web.scene_proxy import proxy_scene, scene_page_response
from app.web.security_headers import CSP, REPORT

COOKIE = "salab_desk"
PATH = "/dashboard"

private = experimenters_router("experimenter")


@private.post("/desk")
async def open_views(request: Request, lab: TheLab, who: Experimenter) -> Response:
    """Get the cookie that opens the 3-D views and the report, which browsers ask for without a token."""
    response = JSONResponse({"desk": PATH})
    response.set_cookie(
        COOKIE,
        dashboard_key(lab.experimenter_token),
        path=prefix(lab) + PATH,
        httponly=True,
        samesite="strict",
        secure=request.url.scheme == "https" or lab.base_url.startswith("https"),
    )
    return response


@private.delete("/desk")
async def close_views(lab: TheLab, who: Experimenter) -> Response:
    """Give the cookie back, when the dashboard forgets its token."""
    response = JSONResponse({"desk": None})
    response.delete_cookie(COOKIE, path=prefix(lab) + PATH, httponly=True, samesite="strict")
    return response


def holds_dashboard_cookie(lab: Lab, cookies: dict[str, str]) -> bool:
    """Whether a request comes from a dashboard that has shown its token."""
    return same_token(cookies.get(COOKIE, ""), dashboard_key(lab.experimenter_token))


def _forbidden() -> Response:
    return JSONResponse({"detail": "open this from the dashboard"}, 403)


def add_dashboard_frames(app: FastAPI, lab: Lab) -> None:
    """Put all routes of this file into an app."""
    app.include_router(private)
    places = Places(lab.config.limits.spectators)

    @app.get("/dashboard/scene/{participant}/", include_in_schema=False)
    async def scene_page(request: Request, participant: str) -> Response:
        if not holds_dashboard_cookie(lab, request.cookies):
            return _forbidden()
        return scene_page_response(request.headers, steered=True)

    @app.get("/dashboard/report/", include_in_schema=False)
    async def report_page(request: Request) -> Response:
        return _report_file(request, PAGE)

    @app.get("/dashboard/report/figures/{name}", include_in_schema=False)
    async def report_figure(request: Request, name: str) -> Response:
        drawn = {f"{figure}.{ending}" for figure, _ in lab.reporter.status.figures for ending in ("svg", "png")}
        return _report_file(request, f"figures/{name}" if name in drawn else None)

    def _report_file(request: Request, name: str | None) -> Response:
        if not holds_dashboard_cookie(lab, request.cookies):
            return _forbidden()
        if lab.reporter.status.state != "made" or name is None:
            return JSONResponse({"detail": "there is no report now; make it from the dashboard"}, 404)
        headers = {CSP: REPORT, "Cache-Control": "no-store"}
        return FileResponse(lab.reporter.folder / name, headers=headers)

    @app.websocket("/dashboard/scene/{participant}")
    async def scene_socket(websocket: WebSocket, participant: str) -> None:
        allowed = holds_dashboard_cookie(lab, websocket.cookies) and same_origin(websocket, lab.config.public_url)
        if not allowed:
            await websocket.close(1008)
            return
        session = lab.live_session(participant)
        with places.take("scenes") as is_free:
            if not is_free:
                lab.refusals.add("sockets")
            if session is None or not is_free:
                await websocket.close(1013)
                return
            async with session.spectators.look() as port:
                if port is None:
                    await websocket.close(1013)
                    return
                await proxy_scene(websocket, port)
