"""The HTTP API: participants, sessions, export, and the arbiter as a function. Decides nothing itself."""

from __future__ import annotations

import asyncio
import itertools
import math
import tempfile
import time
from collections.abc import Callable, Coroutine
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal
from urllib.parse import unquote

import numpy as np
from fastapi import APIRouter, Depends, FastAPI, HTTPException, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, Response
from fastapi.routing import APIRoute
from pydantic import BaseModel, ConfigDict, Field
from starlette.background import BackgroundTask

from app.autonomy.actions import DIRECTIONS
from app.autonomy.arbiter import ArbiterParameters, evaluate
from app.autonomy.errors import AutonomyError
from app.config import Pace
from app.lab.lab import Lab, NoSuchParticipant
from app.lab.tokens import Attempts
from app.session.commands import ACTS, Circumstances, Command, CommandName, NotNow, why_not
from app.trial.setup import StudySetup
from app.wire import CLIENT_MESSAGE, PROTOCOL_VERSION, SERVER_MESSAGE
from study.export.export import export_zip
from study.flow.protocol import allowed
from study.store import Kind, StoredSession

Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Vector = Annotated[tuple[Number, Number, Number], Field(description="x, y, z in the world frame")]
Axis = Literal[-1, 0, 1]
MAX_GOALS = 100
MAX_WEIGHT = 1e15
"""Beyond it a score has no digits left to tell two actions apart, and much beyond it none that is finite."""
Weight = Annotated[float, Field(ge=0, le=MAX_WEIGHT, allow_inf_nan=False, strict=True)]
MAX_INVITATIONS = 200
WHO_HEADER = "Salab-Who"
"""Tells experimenters apart who share the one token. It proves nothing."""
MAX_INITIALS = 20


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid")


class InviteRequest(_Body):
    """Who to enrol."""

    demo: bool = False
    """Short for kind "demo"."""
    kind: Literal["study", "pilot", "demo"] = "study"
    """Pilot and demo participants hold no cell of the counterbalancing, and no export has them unless asked for."""
    pace: Pace | None = None
    label: Annotated[str, Field(max_length=200)] | None = None
    """A name or recruitment id for the experimenter's eyes; kept apart and never exported."""
    count: Annotated[int, Field(ge=1, le=MAX_INVITATIONS)] = 1


class InvitationReply(BaseModel):
    """A new participant's links. They cannot be shown again: only hashes of their tokens are stored."""

    participant: str
    link: str
    panel_link: str
    demo: bool
    kind: str


class InviteReply(InvitationReply):
    """The first new participant, and all of them."""

    created: list[InvitationReply]


class SessionReply(BaseModel):
    """One session at a glance."""

    participant: str
    label: str | None
    demo: bool
    kind: str
    state: str
    place: str
    causes: list[str]
    trial: int
    trials: int
    condition: str
    order: list[str]
    pace: str
    connected: bool
    panel_connected: bool
    held: bool
    help_wanted: bool
    done_tasks: int | None
    tasks: int | None
    round_trip_ms: float | None
    overruns: int
    device: str | None
    created_utc: str
    allowed: list[str]
    """Events of the protocol that are possible now."""
    why_not: dict[str, str]
    """Act of an experimenter to the reason why it is not possible now; "" when it is."""


class CommandRequest(_Body):
    """Why. The words are kept apart from the record and never exported; an abort must have some."""

    reason: Annotated[str, Field(max_length=1000)] | None = None


class EvaluateRequest(_Body):
    """A state, a belief, an input, and either a condition or the weights.

    What is left out is as in the study this lab runs. The stickiness of the study's arbiter is not part of this.
    """

    position_m: Vector
    momentum: Vector
    goals_m: Annotated[list[Vector], Field(min_length=1, max_length=MAX_GOALS)]
    belief: Annotated[list[Number], Field(min_length=1, max_length=MAX_GOALS)] | None = None
    user_action: tuple[Axis, Axis, Axis] | None = None
    condition: Literal["teleoperation", "goal_oriented", "balanced"] = "balanced"
    alpha: Weight | None = None
    beta: Weight | None = None
    gamma: Weight | None = None
    step_m: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False, strict=True)] | None = None
    planning_delay: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False, strict=True)] | None = None
    transition: Literal["mix", "replan"] | None = None
    rationality_per_m: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False, strict=True)] | None = None


class EvaluateReply(BaseModel):
    """What the arbiter thinks. Rows and entries follow `actions`; `chosen` is an index into it."""

    actions: list[tuple[int, int, int]]
    likelihood: list[list[float]]
    posterior: list[float]
    entropy: float
    information_gain: list[float]
    hindsight_reward: list[float]
    score: list[float]
    chosen: int
    alpha: float


def evaluate_request(request: EvaluateRequest, setup: StudySetup) -> EvaluateReply:
    """`POST /api/arbiter/evaluate` as a function. Raises `AutonomyError` for values that do not fit together."""
    parameters = _parameters(request, setup)
    prior = None if request.belief is None else np.array(request.belief)
    goals = np.array(request.goals_m)
    result = evaluate(request.position_m, request.momentum, goals, prior, request.user_action, parameters)
    return EvaluateReply(
        actions=list(DIRECTIONS),
        likelihood=result.likelihood.tolist(),
        posterior=result.posterior.tolist(),
        entropy=result.entropy,
        information_gain=result.information_gain.tolist(),
        hindsight_reward=result.hindsight_reward.tolist(),
        score=result.score.tolist(),
        chosen=result.chosen,
        alpha=parameters.alpha,
    )


def _parameters(request: EvaluateRequest, setup: StudySetup) -> ArbiterParameters:
    """The request's weights and model, the study's where it names none."""
    if request.condition == "goal_oriented" and request.alpha:
        raise AutonomyError(f"alpha is {request.alpha:g}; it must be 0 or left out with condition 'goal_oriented'")
    usual = setup.parameters_like(request.condition)
    alpha = request.alpha if request.alpha is not None else usual.alpha
    named = request.model_dump(include={"beta", "gamma", "rationality_per_m"}, exclude_none=True)
    model = replace(
        usual.transition,
        **request.model_dump(include={"step_m", "planning_delay"}, exclude_none=True),
        kind=request.transition or usual.transition.kind,
    )
    return replace(usual, alpha=alpha, transition=model, stickiness=0.0, **named)


def lab_of(request: Request) -> Lab:
    """The lab this app serves."""
    lab: Lab = request.app.state.lab
    return lab


def experimenter(request: Request) -> str:
    """Lets only the experimenter through."""
    scheme, _, token = request.headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer" and lab_of(request).is_experimenter(token.strip()):
        return who_says(request.headers.get(WHO_HEADER, ""))
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
    address = request.client.host if request.client else ""
    wait_s = math.ceil(wrong_tokens.add(address, token, time.monotonic()))
    if wait_s > 0:
        text = f"too many wrong tokens from this address; try again in {wait_s} s"
        raise HTTPException(429, text, headers={"Retry-After": str(wait_s)})


class ExperimenterRoute(APIRoute):
    """Asks who it is before it reads what was sent: to a stranger every request is answered alike."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler behind the check."""
        handle = super().get_route_handler()

        async def checked(request: Request) -> Response:
            experimenter(request)
            return await handle(request)

        return checked


Experimenter = Annotated[str, Depends(experimenter)]
TheLab = Annotated[Lab, Depends(lab_of)]

public = APIRouter(prefix="/api", tags=["open"])
private = APIRouter(prefix="/api", tags=["experimenter"], route_class=ExperimenterRoute)


@public.get("/health")
async def health(lab: TheLab) -> dict[str, str]:
    """Whether the lab is up, and which study it runs."""
    return {"status": "ok", "study": lab.setup.study.title, "robot": lab.config.robot}


@public.get("/protocol")
async def protocol_schemas() -> dict[str, Any]:
    """JSON schemas of every message on a participant's WebSocket."""
    return {
        "protocol": PROTOCOL_VERSION,
        "client": CLIENT_MESSAGE.json_schema(),
        "server": SERVER_MESSAGE.json_schema(),
    }


@public.post("/arbiter/evaluate")
async def arbiter_evaluate(body: EvaluateRequest, lab: TheLab) -> EvaluateReply:
    """Update a belief and weigh all 27 actions (paper III). Limits of the arm and stickiness are not part of this."""
    try:
        return await asyncio.to_thread(evaluate_request, body, lab.setup)
    except AutonomyError as error:
        problem = {"type": "value_error", "loc": ("body", str(error).split()[0]), "msg": str(error)[:300]}
        raise RequestValidationError([problem]) from None


@private.post("/participants", status_code=201)
async def invite(body: InviteRequest, lab: TheLab, who: Experimenter) -> InviteReply:
    """Enrol participants (or pilots, or demo visitors) and get their links."""
    created = []
    kind: Kind = "demo" if body.demo else body.kind
    for number in itertools.count(1):
        identities = {"label": body.label if body.count == 1 else f"{body.label} {number}"} if body.label else None
        invitation = await lab.invite(kind=kind, pace=body.pace, identities=identities)
        created.append(
            InvitationReply(
                participant=invitation.participant,
                link=lab.link(invitation.participant_token),
                panel_link=lab.link(invitation.panel_token, "panel"),
                demo=kind == "demo",
                kind=kind,
            )
        )
        if number == body.count:
            break
    return InviteReply(**created[0].model_dump(), created=created)


@private.get("/sessions")
async def sessions(lab: TheLab, who: Experimenter) -> list[SessionReply]:
    """Every session, demo included, in order of enrolment."""
    stored = await lab.stored_sessions()
    labels = await lab.store.run(lambda store: store.labels())
    return [session_reply(lab, item, labels.get(item.participant)) for item in stored]


def session_reply(lab: Lab, stored: StoredSession, label: str | None) -> SessionReply:
    """What the experimenter sees of one session."""
    live = lab.live_session(stored.participant)
    session = live.session if live else stored.session
    view = live.view if live else None
    return SessionReply(
        participant=stored.participant,
        label=label,
        demo=stored.demo,
        kind=stored.kind,
        state=session.state,
        place=session.place,
        causes=sorted(session.causes),
        trial=session.trial,
        trials=session.trials,
        condition=stored.order[session.trial - 1],
        order=list(stored.order),
        pace=stored.pace,
        connected=live.connected if live else False,
        panel_connected=live.panel_connected if live else False,
        held=live.held if live else False,
        help_wanted=live.vitals.help_wanted if live else False,
        done_tasks=view.done_tasks if view else None,
        tasks=view.tasks if view else None,
        round_trip_ms=live.vitals.round_trip_ms if live else None,
        overruns=live.vitals.overruns if live else 0,
        device=live.vitals.device if live else None,
        created_utc=stored.created_utc,
        allowed=list(allowed(session)),
        why_not={act: why_not(act, live.circumstances if live else Circumstances(session)) for act in ACTS},
    )


def _command_route(name: CommandName, text: str, needs_words: bool = False) -> None:
    async def route(participant: str, body: CommandRequest, lab: TheLab, who: Experimenter) -> dict[str, str]:
        words = (body.reason or "").strip() or None
        if needs_words and words is None:
            raise HTTPException(422, "reason: must not be empty; it is kept in the lab, never exported")
        try:
            session = await lab.command(participant, Command(name, words), who)
        except NoSuchParticipant as error:
            raise HTTPException(404, str(error)) from None
        except NotNow as error:
            raise HTTPException(409, str(error)) from None
        return {"participant": participant, "state": session.session.state}

    route.__doc__ = text
    private.post(f"/sessions/{{participant}}/{name}", name=name)(route)


_command_route("start", "Begin the practice or the trial that waits for its Start button.")
_command_route("pause", "Hold the session where it is.")
_command_route("resume", "Let the session go on.")
_command_route("repeat_practice", "Back from a trial that has not begun to its practice.")
_command_route("abort_trial", "End the trial that is under way; it stays, marked, and the session goes on.", True)
_command_route("abort", "End the session for good; its data stay.", True)


@private.get("/export")
async def export(lab: TheLab, who: Experimenter, include_pilot: bool = False) -> FileResponse:
    """All data as a zipped data package. Demo participants and identities are not in it, pilots when asked for."""
    folder = tempfile.TemporaryDirectory(prefix="salab-export-")
    path = Path(folder.name) / "export.zip"
    await asyncio.to_thread(  # beside the writing thread: ticks do not wait for it
        export_zip, lab.store.store, path, include_pilot=include_pilot
    )
    return FileResponse(
        path,
        media_type="application/zip",
        filename="export.zip",
        background=BackgroundTask(asyncio.to_thread, folder.cleanup),
    )


def add_api(app: FastAPI) -> None:
    """Put all routes of this file into an app whose `state.lab` is the lab."""
    app.state.wrong_tokens = Attempts()
    app.include_router(public)
    app.include_router(private)
