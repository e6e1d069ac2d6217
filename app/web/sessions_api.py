"""The HTTP API of participants, sessions and the export. Decides nothing itself."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Annotated, Any, Literal, TypeAlias

from fastapi import APIRouter, FastAPI, HTTPException
from pydantic import BaseModel, Field

from app.config import Pace
from app.lab.lab import Lab, NoSuchParticipant
from app.lab.tokens import Attempts
from app.session.commands import ACTS, Circumstances, Command, CommandName, NotNow, why_not
from app.web.access import (
    Experimenter,
    ParticipantId,
    RequestBody,
    StrictRoute,
    TheLab,
    experimenters_router,
    not_now,
    refusals,
)
from app.wire import PROTOCOL_VERSION, SERVER_MESSAGE
from study.flow.page import Text
from study.flow.roster import EnrolmentKind
from study.store import WHAT_TO_DO, StoredSession, UnreadableSession

MAX_INVITATIONS = 200


class InviteRequest(RequestBody):
    """Who to enrol."""

    demo: bool = False
    """Short for kind "demo"."""
    kind: Literal["study", "pilot", "demo"] = "study"
    """Pilot and demo participants hold no cell of the counterbalancing, and no export has them unless asked for."""
    pace: Pace | None = None
    """Ticks by the clock, or one for each input; left out, as the lab was started."""
    label: Annotated[str, Field(max_length=200)] | None = None
    """A name or recruitment id for the experimenter's eyes; kept apart and never exported."""
    count: Annotated[int, Field(ge=1, le=MAX_INVITATIONS)] = 1
    """How many to enrol; their labels are numbered."""


class InvitationReply(BaseModel):
    """A new participant's links. They cannot be shown again: only hashes of their tokens are stored."""

    participant: str
    """Id, such as P001."""
    link: str
    """For the participant."""
    panel_link: str
    """For their second device; its page says so where the study has none."""
    second_device: bool
    """Whether the study has one."""
    demo: bool
    """Whether this is a demo."""
    kind: str
    """study, pilot or demo."""


class InviteReply(InvitationReply):
    """The first new participant, and all of them."""

    created: list[InvitationReply]
    """All of them, in order."""


class SessionReply(BaseModel):
    """One session at a glance."""

    participant: str
    """Id, such as P001."""
    label: str | None
    """The experimenter's name for them, never exported; null for none."""
    demo: bool
    """Whether this is a demo."""
    kind: str
    """study, pilot or demo."""
    state: str
    """Where the session is."""
    place: str
    """The state, or while paused the one that will be resumed."""
    causes: list[str]
    """Why it is paused: `connection`, `experimenter`, `fault`, `picture`; empty otherwise."""
    pause_reason: str | None
    """While it is paused for a fault: which part of the lab did what."""
    trial: int
    """Number of the trial, from 1; 1 before the first."""
    trials: int
    """How many trials the session has."""
    condition: str
    """Id of the trial's condition."""
    order: list[str]
    """The conditions' ids, first to last."""
    pace: str
    """real_time or lockstep."""
    connected: bool
    """Whether the participant's page is there."""
    panel_connected: bool
    """Whether the second device is there."""
    panel_missing: bool
    """Whether it is not there though the second task of a practice or trial, next or under way, appears on it."""
    held: bool
    """Whether the robot waits for the page's heartbeat."""
    not_saving: str
    """Why nothing of it can be saved now, and what helps; "" when it can. The lab tries again by itself."""
    robot_problem: str
    """Why its robot is not there, while the lab tries again; "" when it is."""
    help_wanted: bool
    """Whether the participant has called and nobody has answered."""
    done_tasks: int | None
    """Tasks that have ended; null without a trial under way."""
    tasks: int | None
    """Tasks there are in all; null without a trial under way."""
    round_trip_ms: float | None
    """Time to the page and back, in milliseconds; null if not measured."""
    overruns: int
    """Ticks of this trial that started more than 50 ms late."""
    frees: int
    """How often the arm was freed in this practice or trial, by whomever."""
    device: str | None
    """What the hands are read from; null before the page said so."""
    created_utc: str
    """When they were enrolled, in UTC."""
    allowed: list[str]
    """Events of the protocol that are possible now."""
    why_not: dict[str, str]
    """Act of an experimenter to the reason why it is not possible now; "" when it is."""
    problem: str | None = None
    """Why this session cannot be shown: its state is then `unreadable`, and nothing else here says anything of it. Null
    as a rule."""


class CommandRequest(RequestBody):
    """Why. The words are kept apart from the record and never exported; an abort must have some."""

    reason: Text | None = None
    """In words."""


public = APIRouter(prefix="/api", tags=["open"], route_class=StrictRoute)
private = experimenters_router("experimenter")


@public.get("/protocol")
async def protocol_schemas(lab: TheLab) -> dict[str, Any]:
    """JSON schemas of every message on a participant's WebSocket."""
    return {
        "protocol": PROTOCOL_VERSION,
        "client": lab.client_message.json_schema(),
        "server": SERVER_MESSAGE.json_schema(),
    }


@private.post("/participants", status_code=201)
async def invite(body: InviteRequest, lab: TheLab, who: Experimenter) -> InviteReply:
    """Enrol participants (or pilots, or demo visitors) and get their links."""
    created = []
    kind: EnrolmentKind = "demo" if body.demo else body.kind
    for number in itertools.count(1):
        identities = {"label": body.label if body.count == 1 else f"{body.label} {number}"} if body.label else None
        invitation = await lab.invite(kind=kind, pace=body.pace, identities=identities)
        created.append(
            InvitationReply(
                participant=invitation.participant,
                link=lab.link(invitation.participant_token),
                panel_link=lab.link(invitation.panel_token, "panel"),
                second_device=lab.setup.study.distractor.on_second_device,
                demo=kind == "demo",
                kind=kind,
            )
        )
        if number == body.count:
            break
    return InviteReply(**created[0].model_dump(), created=created)


@private.get("/sessions")
async def sessions(lab: TheLab, who: Experimenter) -> list[SessionReply]:
    """Every session, demo included, in order of enrolment; one that cannot be shown says so."""
    (stored, unreadable), labels = await lab.store.run(lambda store: (store.everyone(), store.labels()))
    return [
        session_reply(lab, item, labels.get(item.participant)) for item in in_order_of_enrolment(stored, unreadable)
    ]


Known: TypeAlias = StoredSession | UnreadableSession
"""Somebody in a list of all."""


def in_order_of_enrolment(stored: Iterable[StoredSession], unreadable: Iterable[UnreadableSession]) -> list[Known]:
    """Everybody in one list, by the number in their id."""
    return sorted((*stored, *unreadable), key=lambda one: number_of(one.participant))


def number_of(participant: str) -> tuple[int, str]:
    """What participants are sorted by: the number in their id."""
    digits = participant[1:]
    return (int(digits) if digits.isascii() and digits.isdecimal() and len(digits) < 19 else 0, participant)


def session_reply(lab: Lab, known: Known, label: str | None) -> SessionReply:
    """What the experimenter sees of one session: a line of many, which never keeps the others from being seen."""
    if isinstance(known, UnreadableSession):
        return unreadable_reply(known, label, known.reason)
    try:
        return _session_reply(lab, known, label)
    except Exception as error:
        return unreadable_reply(known, label, lab.cannot_show(known.participant, error))


def unreadable_reply(known: Known, label: str | None, reason: str) -> SessionReply:
    """The line of a session that cannot be shown. One that is stored well can still be ended."""
    ends = ("abort", "withdraw") if isinstance(known, StoredSession) else ()
    return SessionReply(
        participant=known.participant,
        label=label,
        demo=known.kind == "demo",
        kind=known.kind,
        state="unreadable",
        place="unreadable",
        causes=[],
        pause_reason=None,
        trial=1,
        trials=0,
        condition="",
        order=[],
        pace="",
        connected=False,
        panel_connected=False,
        panel_missing=False,
        held=False,
        not_saving="",
        robot_problem="",
        help_wanted=False,
        done_tasks=None,
        tasks=None,
        round_trip_ms=None,
        overruns=0,
        frees=0,
        device=None,
        created_utc=known.created_utc,
        allowed=[],
        why_not={act: "" if act in ends else f"The session cannot be shown: {reason}" for act in ACTS},
        problem=reason,
    )


def _session_reply(lab: Lab, stored: StoredSession, label: str | None) -> SessionReply:
    """What the experimenter sees of one session."""
    live = lab.live_session(stored.participant)
    session = live.session if live else stored.session
    view = live.view if live else None
    now = live.circumstances if live else Circumstances(session, flow=lab.flow)
    return SessionReply(
        participant=stored.participant,
        label=label,
        demo=stored.demo,
        kind=stored.kind,
        state=session.state,
        place=session.place,
        causes=sorted(session.causes),
        pause_reason=session.reason if session.state == "paused" else None,
        trial=session.trial,
        trials=session.trials,
        condition=stored.order[session.trial - 1],
        order=list(stored.order),
        pace=stored.pace,
        connected=live.connected if live else False,
        panel_connected=live.panel_connected if live else False,
        panel_missing=now.lacks_panel,
        held=live.held if live else False,
        not_saving=WHAT_TO_DO[live.unsaved.kind] if live and live.unsaved else "",
        robot_problem=live.problem if live else "",
        help_wanted=live is not None and live.vitals.help is not None,
        done_tasks=view.done_tasks if view else None,
        tasks=view.tasks if view else None,
        round_trip_ms=live.vitals.round_trip_ms if live else None,
        overruns=live.vitals.overruns if live else 0,
        frees=live.vitals.frees if live else 0,
        device=live.vitals.device if live else None,
        created_utc=stored.created_utc,
        allowed=list(now.allowed),
        why_not={act: why_not(act, now) for act in ACTS},
    )


def _command_route(name: CommandName, text: str, needs_words: bool = False) -> None:
    async def route(participant: ParticipantId, body: CommandRequest, lab: TheLab, who: Experimenter) -> dict[str, str]:
        words = (body.reason or "").strip() or None
        if needs_words and words is None:
            raise HTTPException(422, "reason: must not be empty; it is kept in the lab, never exported")
        try:
            session = await lab.command(participant, Command(name, words), who)
        except NoSuchParticipant as error:
            raise HTTPException(404, str(error)) from None
        except NotNow as error:
            raise not_now(error) from None
        return {"participant": participant, "state": session.session.state}

    route.__doc__ = text
    private.post(f"/sessions/{{participant}}/{name}", name=name, responses=refusals(404, 409))(route)


_command_route("start", "Begin the practice or the trial that waits for its Start button.")
_command_route("pause", "Hold the session where it is.")
_command_route("resume", "Let the session go on.")
_command_route("free_arm", "Free the arm: the pick-and-place under way begins again, with the next tick.")
_command_route("repeat_practice", "Back from a trial that has not begun to its practice.")
_command_route("abort_trial", "End the trial that is under way; it stays, marked, and the session goes on.", True)
_command_route("abort", "End the session for good; its data stay.", True)


def add_sessions_api(app: FastAPI, lab: Lab) -> None:
    """Put all routes of this file into an app whose `state.lab` is the lab."""
    app.state.wrong_tokens = Attempts(lab.config.limits.wrong_tokens_per_min, addresses=lab.config.limits.addresses)
    app.include_router(public)
    app.include_router(private)
