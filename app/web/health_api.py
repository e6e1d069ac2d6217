"""Whether the lab does what it is for, to those who look after it: probes of a service manager, and Prometheus.

Three questions, open to everybody, answered from what the lab keeps up to date by itself (see `app.lab.health`); and
the metrics, for whoever has a token.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, FastAPI, Response
from pydantic import BaseModel

from app.lab.health import HEALTH, Check, CheckName
from app.monitoring.metrics import CONTENT_TYPE
from app.web.access import TheLab, metrics_reader, refusals

router = APIRouter(prefix="/api", tags=["open"])
metrics_router = APIRouter(prefix="/api", tags=["experimenter"])


class CheckReply(BaseModel):
    """One part of the lab."""

    name: CheckName
    """`store`: what is acknowledged is on disk; `data_folder`: it is where it was; `workers`: a session gets its
    process; `room`: there is room for more data; `scene`: the robot looks as the study says."""
    reason: str
    """What is wrong and what helps; "" while it is well."""


class AliveReply(BaseModel):
    """The process answers."""

    status: Literal["ok"] = "ok"
    """Always `ok`: there is no answer otherwise."""


class ReadyReply(BaseModel):
    """Whether new people can begin."""

    status: Literal["ok", "not_ready"]
    """`ok` or `not_ready`."""
    detail: str
    """What is wrong, in one line; "" for nothing."""
    checks: list[CheckReply]
    """All that it depends on."""


class HealthReply(BaseModel):
    """Whether the lab is well, and which study it runs."""

    status: Literal["ok", "failing"]
    """`ok` or `failing`."""
    study: str
    """Title of the study that new participants get."""
    robot: str
    """Which robot moves."""
    robot_note: str
    """What to know of that choice: whose physics is not installed, so that another's moves it; "" for nothing."""
    look: str
    """How it is drawn for new participants: `own`, `published`, or `none` without a scene."""
    people: int
    """How many people take part now in real time."""
    capacity: int | None
    """How many the lab takes at once: beyond it the open link asks others to come back; null where nobody knows."""
    capacity_note: str
    """Why a number that was measured is not used; "" for nothing."""
    detail: str
    """What is wrong, in one line; "" for nothing."""
    checks: list[CheckReply]
    """All that it depends on."""


def _replies(checks: Iterable[Check]) -> list[CheckReply]:
    return [CheckReply(name=check.name, reason=check.reason) for check in checks]


def _detail(checks: Iterable[Check]) -> str:
    return "; ".join(dict.fromkeys(check.reason for check in checks if not check.is_well))


def _unwell(model: type[BaseModel], text: str) -> dict[int | str, dict[str, Any]]:
    return {503: {"model": model, "description": text}}


@router.get("/health", responses=_unwell(HealthReply, "something that sessions under way need is wrong"))
async def health(lab: TheLab, response: Response) -> HealthReply:
    """Whether the lab does what its sessions need: 503 when what is acknowledged is not on disk, when the data folder
    is gone or when no session can get its process. For whoever is called when it fails."""
    checks = [check for check in lab.health.checks() if check.name in HEALTH]
    is_well = all(check.is_well for check in checks)
    _set(response, is_well)
    crowding = lab.door.crowding()
    return HealthReply(
        status="ok" if is_well else "failing",
        study=lab.setup.study.title,
        robot=lab.robot.name,
        robot_note=lab.robot.note,
        look=lab.look,
        people=crowding.running,
        capacity=crowding.most,
        capacity_note=lab.door.note,
        detail=_detail(checks),
        checks=_replies(checks),
    )


@router.get("/health/live")
async def live(response: Response) -> AliveReply:
    """Whether the process answers at all. For a service manager, which starts it anew when it does not."""
    _set(response, True)
    return AliveReply()


@router.get("/health/ready", responses=_unwell(ReadyReply, "new people should not begin now"))
async def ready(lab: TheLab, response: Response) -> ReadyReply:
    """Whether new people can begin: all that health asks for, room on the disk, and a robot that can be drawn at once.
    For a proxy, or a script that waits for the lab; sessions under way go on when it says no."""
    checks = lab.health.checks()
    is_well = all(check.is_well for check in checks)
    _set(response, is_well)
    return ReadyReply(status="ok" if is_well else "not_ready", detail=_detail(checks), checks=_replies(checks))


def _set(response: Response, is_well: bool) -> None:
    response.status_code = 200 if is_well else 503
    response.headers["Cache-Control"] = "no-store"


@metrics_router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"description": "Prometheus' text format", "content": {"text/plain": {}}}, **refusals(403, 429)},
)
async def metrics(lab: TheLab, who: Annotated[None, Depends(metrics_reader)]) -> Response:
    """What is counted and measured, for Prometheus; the token is the experimenter's, or the one that opens nothing
    else (`SALAB_METRICS_TOKEN`). Nobody's id is in it."""
    return Response(lab.metrics.text(), media_type=CONTENT_TYPE, headers={"Cache-Control": "no-store"})


def add_health_api(app: FastAPI) -> None:
    """Put all routes of this file into an app whose `state.lab` is the lab."""
    app.include_router(router)
    app.include_router(metrics_router)
