"""The HTTP API of the archive of all data: made in a process of its own, with its progress, and sent."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated, Literal

from fastapi import FastAPI, HTTPException, Query
from fastapi.responses import FileResponse
from pydantic import BaseModel
from starlette.background import BackgroundTask

from app.lab.lab import Lab
from app.session.commands import NotNow
from app.web.access import Experimenter, TheLab, experimenters_router, refusals

router = experimenters_router("export")

NAME = "export.zip"
ExcelSafe = Annotated[bool, Query(description="Whether no cell of the CSV may begin what a spreadsheet would run.")]
IncludePilot = Annotated[bool, Query(description="Whether pilots are in it too.")]
_ARCHIVE = {"description": "A file, application/zip", "content": {"application/zip": {}}}


class ExportReply(BaseModel):
    """The archive of all data: `state` none, making, made or cannot, and how far it is or why it cannot be."""

    state: Literal["none", "making", "made", "cannot"]
    """Whether there is one."""
    text: str
    """What is being written, or why there is none."""
    step: int
    """Number of the step under way."""
    of: int
    """How many steps there are."""
    made_utc: str | None
    """When it was made, in UTC; null for none."""
    include_pilot: bool
    """Whether pilot participants are in it."""
    excel_safe: bool
    """Whether no cell of the CSV begins what a spreadsheet would run."""
    bytes: int
    """Its size."""
    rows: int
    """How many ticks are in it."""


def _told(lab: Lab) -> ExportReply:
    return ExportReply.model_validate(vars(lab.exporter.status))


def _sent(path: Path, *, removed: bool) -> FileResponse:
    after = BackgroundTask(asyncio.to_thread, path.unlink, missing_ok=True) if removed else None
    return FileResponse(path, media_type="application/zip", filename=NAME, background=after)


@router.get("/export", response_class=FileResponse, responses={200: _ARCHIVE, **refusals(503)})
async def export(
    lab: TheLab, who: Experimenter, include_pilot: IncludePilot = False, excel_safe: ExcelSafe = False
) -> FileResponse:
    """All data as a zipped data package, made now. Demo participants and identities are not in it, pilots when asked
    for. Several who ask are served one after the other."""
    return _sent(await lab.exporter.fresh(include_pilot, excel_safe), removed=True)


@router.post("/export", status_code=202, responses=refusals(409))
async def start_export(
    lab: TheLab, who: Experimenter, include_pilot: IncludePilot = False, excel_safe: ExcelSafe = False
) -> ExportReply:
    """Make such an archive beside the sessions; `GET /api/export/progress` says how far it is."""
    try:
        lab.exporter.start(include_pilot, excel_safe)
    except NotNow as error:
        raise HTTPException(409, str(error)) from None
    return _told(lab)


@router.get("/export/progress")
async def read_export(lab: TheLab, who: Experimenter) -> ExportReply:
    """How far the archive is."""
    return _told(lab)


@router.delete("/export")
async def cancel_export(lab: TheLab, who: Experimenter) -> ExportReply:
    """End the making of the archive, and remove what there is of it."""
    await lab.exporter.discard()
    return _told(lab)


@router.get("/export/file", response_class=FileResponse, responses={200: _ARCHIVE, **refusals(409)})
async def export_file(lab: TheLab, who: Experimenter) -> FileResponse:
    """The archive that was made last. It is there until another one is made, somebody is erased, or the lab ends."""
    if lab.exporter.status.state != "made":
        raise HTTPException(409, "No export is there; make one first.")
    return _sent(lab.exporter.archive, removed=False)


def add_export_api(app: FastAPI) -> None:
    """Put all routes of this file into an app whose `state.lab` is the lab."""
    app.include_router(router)
