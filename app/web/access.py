"""Who may ask: the experimenter's token, the initials that tell experimenters apart, and how a request is refused."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Coroutine, Mapping
from typing import Annotated, Any
from urllib.parse import unquote

from fastapi import APIRouter, Depends, HTTPException, Path, Request
from fastapi.responses import Response
from fastapi.routing import APIRoute
from pydantic import BaseModel, ConfigDict

from app.lab.lab import Lab
from app.lab.tokens import Attempts
from app.session.commands import CannotSave, NotNow
from app.web.guard import address_of, shows_token
from study.json_text import parse_json

WHO_HEADER = "Salab-Who"
"""Tells experimenters apart who share the one token. It proves nothing."""


MAX_INITIALS = 20


class RequestBody(BaseModel):
    """What is sent with a request: a field that is not known is an error."""

    model_config = ConfigDict(extra="forbid")


class Problem(BaseModel):
    """One mistake in what was sent."""

    field: str
    """Its place, such as `goals_m.0`; `body` for what cannot be read at all."""
    message: str
    """What is wrong with it."""


class ErrorReply(BaseModel):
    """Why a request was refused: the body of every answer from 400 on that has no other."""

    detail: str
    """All of it as one line."""
    problems: list[Problem] | None = None
    """The first twenty mistakes; left out where nothing that was sent is wrong by itself."""


WHY_REFUSED: Mapping[int, str] = {
    403: "the experimenter's token is missing or wrong",
    404: "there is no such participant or trial",
    409: "this is not possible now",
    422: "what was sent is wrong",
    503: "the lab cannot do it now, and says why",
    429: "too many wrong tokens came from this address; `Retry-After` says for how many seconds to wait",
}


def refusals(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The `responses` of a route that may answer with these."""
    return {status: {"model": ErrorReply, "description": WHY_REFUSED[status]} for status in statuses}


def not_now(error: NotNow) -> HTTPException:
    """The answer to an act that is not possible: 503 where it is the disk, 409 where it is the session."""
    return HTTPException(503 if isinstance(error, CannotSave) else 409, str(error))


def lab_of(request: Request) -> Lab:
    """The lab this app serves."""
    lab: Lab = request.app.state.lab
    return lab


def has_token(request: Request) -> bool:
    """Whether it comes from an experimenter."""
    return shows_token(request.headers, lab_of(request))


def experimenter(request: Request) -> str:
    """Lets only the experimenter through."""
    _check_bearer(request, lab_of(request).is_experimenter)
    return who_says(request.headers.get(WHO_HEADER, ""))


def metrics_reader(request: Request) -> None:
    """Lets the experimenter through, and whoever has the token that opens the metrics alone."""
    _check_bearer(request, lab_of(request).reads_metrics)


def _check_bearer(request: Request, is_right: Callable[[str], bool]) -> None:
    scheme, _, token = request.headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer" and is_right(token.strip()):
        return
    if token:
        check_wrong_token(request, token)
    raise HTTPException(403, "the experimenter's token is needed, as 'Authorization: Bearer TOKEN'")


def who_says(given: str) -> str:
    """What events say of who did something: the initials that came with the request, percent-encoded, if any did."""
    initials = unquote(given).strip()
    if len(initials) > MAX_INITIALS or not initials.isprintable():
        raise HTTPException(422, f"{WHO_HEADER}: must be at most {MAX_INITIALS} printable characters")
    return initials or "experimenter"


def check_wrong_token(request: Request, token: str) -> None:
    """Counts it; after too many the answer is 429. Who has the right token never gets here."""
    wrong_tokens: Attempts = request.app.state.wrong_tokens
    wait_s = math.ceil(wrong_tokens.add(address_of(request.scope), token, time.monotonic()))
    if wait_s > 0:
        lab_of(request).refusals.add("wrong_tokens")
        text = f"too many wrong tokens from this address; try again in {wait_s} s"
        raise HTTPException(429, text, headers={"Retry-After": str(wait_s)})


class StrictRequest(Request):
    """A request whose JSON means what the standard says."""

    async def json(self) -> Any:
        """The body's value. Raises `ValueError` for what Python reads beyond JSON, such as a name that stands twice."""
        return parse_json(await self.body(), finite=False)  # the models name the field of a NaN


class StrictRoute(APIRoute):
    """Reads what is sent as `StrictRequest` does."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler, given such a request."""
        handle = super().get_route_handler()

        async def read(request: Request) -> Response:
            return await handle(StrictRequest(request.scope, request.receive))

        return read


class ExperimenterRoute(StrictRoute):
    """Asks who it is before it reads what was sent: to a stranger every request is answered alike."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler behind the check."""
        handle = super().get_route_handler()

        async def checked(request: Request) -> Response:
            experimenter(request)
            return await handle(request)

        return checked


def experimenters_router(tag: str) -> APIRouter:
    """A router whose every route asks for the token."""
    return APIRouter(prefix="/api", tags=[tag], route_class=ExperimenterRoute, responses=refusals(403, 422, 429))


Experimenter = Annotated[str, Depends(experimenter)]


TheLab = Annotated[Lab, Depends(lab_of)]


ParticipantId = Annotated[str, Path(max_length=100, description="The participant's id, such as P001.")]
