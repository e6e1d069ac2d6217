"""The open link: `/join` shows a page, and only the press of its button enrols. Decides nothing itself."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from fastapi import APIRouter, FastAPI, HTTPException, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from app.lab.lab import Lab
from app.lab.open_enrolment import Offer, OpenEnrolment, cookie_name
from app.lab.tokens import Attempts, new_token
from app.web.access import ErrorReply, StrictRoute, TheLab, refusals
from app.web.addresses import COOKIES, place_of, prefix, set_cookie
from app.web.guard import address_of
from app.web.participant_socket import same_origin
from study.definition.link_placeholders import filled
from study.flow.facts import as_read

PATH = "/join"
AGAIN_S = 30
"""When there is no room at the moment, the page asks again after so many seconds."""
State = Literal["begin", "back", "bad_link", "closed", "full", "elsewhere", "busy"]

router = APIRouter(tags=["open"], route_class=StrictRoute)


class JoinRequest(BaseModel):
    """The parameters of the open link; those the study does not name are left alone."""

    model_config = ConfigDict(extra="forbid")

    parameters: Annotated[dict[str, Annotated[str, Field(max_length=1000)]], Field(max_length=50)]
    """By name, as they stand in the link's query."""


class JoinReply(BaseModel):
    """What the page shows: begin or go on, or why not. `page` is where the study is, once somebody is let in."""

    state: State
    """Begin, go on (`back`), or why neither is possible; `busy`: not at the moment."""
    title: str
    """The study's title."""
    lines: list[str]
    """What the page says, a paragraph each; the study file's words."""
    link: str | None = None
    """Where the study file sends who comes too late."""
    page: str | None = None
    """Path of the participant's page; null for whoever is not let in."""
    again_s: int | None = None
    """Seconds after which to ask again, for whoever is `busy`; no place is taken meanwhile. Null for all others."""


def reply_to(lab: Lab, offer: Offer) -> JoinReply:
    """An offer in the study's words."""
    study = lab.setup.study
    rules = as_read(study).recruitment
    words: Mapping[str, tuple[str, ...]] = {
        "enrol": rules.welcome,
        "back": rules.welcome,
        "full": rules.full,
        "bad_link": offer.wrong,
    }
    return JoinReply(
        state="begin" if offer.answer == "enrol" else offer.answer,
        title=study.title,
        lines=list(words.get(offer.answer, ())),
        link=filled(rules.full_link, offer.ids) if offer.answer == "full" else None,
        again_s=AGAIN_S if offer.answer == "busy" else None,
        page=f"{prefix(lab)}{place_of(offer.public_id, 'participant')}/" if offer.public_id else None,
    )


async def look(request: Request, lab: Lab) -> Offer:
    """What the link of this request offers its browser."""
    given = {name: request.query_params.getlist(name) for name in request.query_params}
    enrolment: OpenEnrolment = request.app.state.open_enrolment
    person = enrolment.person(given)
    token = request.cookies.get(cookie_name(person), "") if person else ""
    return await enrolment.look(given, token)


STATUS: Mapping[str, int] = {"bad_link": 400, "closed": 404, "full": 409, "elsewhere": 409, "busy": 503}
NOT_NOW: dict[int | str, dict[str, Any]] = {
    **{status: {"model": JoinReply} for status in (400, 404, 409)},
    503: {"model": JoinReply | ErrorReply, "description": "no room at the moment (`Retry-After`), or out of order"},
}
REFUSALS: dict[int | str, dict[str, Any]] = {
    403: {"model": ErrorReply, "description": "only the lab's own page may join"},
    **refusals(422),
    429: {"model": ErrorReply, "description": "too many people begin from this address; `Retry-After` has the seconds"},
}


@router.get("/join/offer", responses=NOT_NOW)
async def offer(request: Request, response: Response, lab: TheLab) -> JoinReply:
    """What the open link with these parameters offers: begin, go on, or why not. Changes nothing."""
    reply = reply_to(lab, await look(request, lab))
    response.headers["Cache-Control"] = "no-store"
    _set(response, reply.state)
    return reply


def _set(response: Response, state: str) -> None:
    response.status_code = STATUS.get(state, 200)
    response.headers.update(again(state))


def again(state: str) -> dict[str, str]:
    """The header that says when to come back, for those who should."""
    return {"Retry-After": str(AGAIN_S)} if state == "busy" else {}


@router.post("/join", responses={**NOT_NOW, **REFUSALS})
async def join(body: JoinRequest, request: Request, response: Response, lab: TheLab) -> JoinReply:
    """Enrol the person the parameters name, or let them back in: sets the cookie that opens `page`."""
    if not same_origin(request, lab.config.public_url):
        raise HTTPException(403, "only the lab's own page joins; open the link itself")
    attempts: Attempts = request.app.state.joins
    # Each counts, whatever it says.
    wait_s = math.ceil(attempts.add(address_of(request.scope), new_token(), time.monotonic()))
    if wait_s > 0:
        lab.refusals.add("joins")
        text = lab.setup.study.words.tn(
            "Too many people begin from this address at once. Please try again in one second.",
            "Too many people begin from this address at once. Please try again in {n} seconds.",
            wait_s,
        )
        raise HTTPException(429, text, headers={"Retry-After": str(wait_s)})
    enrolment: OpenEnrolment = request.app.state.open_enrolment
    given = {name: (value,) for name, value in body.parameters.items()}
    person = enrolment.person(given)
    token = request.cookies.get(cookie_name(person), "") if person else ""
    found = await enrolment.join(given, token)
    reply = reply_to(lab, found)
    _set(response, reply.state)
    if person and found.token:
        place = place_of(found.public_id, "participant")
        set_cookie(response, request, lab, COOKIES["participant"], found.token, place)
        set_cookie(response, request, lab, cookie_name(person), found.token, PATH)
    return reply


def add_join(app: FastAPI, lab: Lab) -> None:
    """Put the routes of this file into an app whose `state.lab` is the lab."""
    app.state.open_enrolment = OpenEnrolment(lab)
    app.state.joins = Attempts(lab.config.limits.joins_per_min, addresses=lab.config.limits.addresses)
    app.include_router(router)
