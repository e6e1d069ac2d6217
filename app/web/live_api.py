"""What the experimenter sees while it happens, and says about it: one WebSocket, a few routes. Decides nothing.

    dashboard ── {"type": "hello", "token": …} ──► (nothing is sent before)
              ◄── {"type": "overview", "sessions": […], "gone": […], "trouble": {…} | null, "crowding": {…} | null}
                  all of them, then those that changed; `trouble`: the lab cannot save; `crowding`: it is nearly full
              ── {"type": "watch", "participant": "P001" | null} ──►
              ◄── {"type": "watched", …, "ticks": […], "events": […], "since_start": true}   the last minute, then more

A page that is slow gets the newest state when it is ready for it: lines are remembered as changed, not queued.
The token is said in the first message, so that no address and no log holds it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from fastapi import FastAPI, HTTPException, Query, WebSocket, WebSocketDisconnect
from pydantic import BaseModel, ConfigDict, Field

from app.lab.crowding import Crowding
from app.lab.lab import Lab, NoSuchParticipant
from app.lab.tokens import Attempts
from app.session.commands import NotNow, Remark, RemarkName
from app.session.explanation import Plane, PlaneKind, TickExplanation, explain_tick, plane_of
from app.session.history import KEPT_EVENTS
from app.session.pages import instruction
from app.session.private_text import with_words
from app.session.session import LiveSession
from app.web.access import Experimenter, ParticipantId, TheLab, experimenters_router, not_now, refusals
from app.web.guard import address_of
from app.web.participant_socket import Places, same_origin
from app.web.sessions_api import Known, SessionReply, in_order_of_enrolment, session_reply, unreadable_reply
from study.flow.page import Text
from study.flow.protocol import Session
from study.flow.recorded import data_of, kind_of
from study.records import EventRow, utc_text
from study.store import WHAT_TO_DO, StoredSession, StoreTroubled, Trouble, UnreadableSession

GAP_S = 0.1
"""Least time between two messages to one dashboard."""
ALIVE_S = 2.0
"""How often a dashboard to which nothing new is to be told hears that the lab is there."""
REFRESH_S = 10.0
"""How often everything is looked at again, changed or not."""
MAX_HELLO_BYTES = 2_000


class HelpReply(BaseModel):
    """A participant's call for help."""

    words: str
    """What they typed; kept apart from the record and never exported."""
    since_utc: str
    """When they called, in UTC."""


class LiveReply(SessionReply):
    """One session at a glance, with what can be done about it now."""

    trial_s: float | None
    """Trial time, in seconds; null when no robot is needed."""
    signals_per_s: float
    """Messages about the hands a second, over the last five seconds."""
    driving_share: float | None
    """Share of the last twenty ticks in which the person drove or pressed; null before the first."""
    visible: bool | None
    """Whether the page is shown; null while it is away."""
    focused: bool | None
    """Whether the page has the focus; null while it is away."""
    sound: bool | None
    """Whether the participant heard the test sound; null before they were asked."""
    picture: bool | None
    """Whether the participant's page draws the robot; null before it said so."""
    help: HelpReply | None
    """The participant's call that nobody has answered; null for none."""
    instruction: str | None
    """The current task as a sentence; null without one."""
    scene: str
    """Why there is no 3-D view of this session now; "" when there is one."""


class TroubleReply(BaseModel):
    """That the lab cannot save: nothing is acknowledged, robots stand still, and it tries again by itself."""

    kind: str
    """full, locked, read_only, io, corrupt, gone, slow or unreachable."""
    text: str
    """What is wrong and what helps."""
    since_utc: str
    """Since when, in UTC."""
    rescue: str | None
    """The folder that everything recorded was copied to, when the data folder is gone; null otherwise."""


class CrowdingReply(BaseModel):
    """That nearly as many people take part as the lab takes at once, or more."""

    level: str
    """near, full or beyond."""
    text: str
    """How many there are, and what follows."""


def crowding_reply(crowding: Crowding) -> CrowdingReply | None:
    """What the dashboard shows of how full it is; None while there is room for many."""
    return CrowdingReply(level=crowding.level, text=crowding.text) if crowding.text else None


def trouble_reply(trouble: Trouble | None) -> TroubleReply | None:
    """What the dashboard shows of the store's trouble."""
    if trouble is None:
        return None
    rescue = str(trouble.rescue) if trouble.rescue else None
    text, since_utc = WHAT_TO_DO[trouble.kind], utc_text(trouble.since_unix_s)
    return TroubleReply(kind=trouble.kind, text=text, since_utc=since_utc, rescue=rescue)


class _Said(BaseModel):
    model_config = ConfigDict(extra="forbid")

    text: Annotated[Text, Field(pattern=r"\S")]
    """The words; kept apart from the record and never exported."""


class _Empty(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _Hello(BaseModel):
    model_config = ConfigDict(extra="forbid")

    type: str = Field(pattern="^hello$")
    """Always `hello`."""
    token: Annotated[str, Field(max_length=500)]
    """The experimenter's token."""


class _Watch(BaseModel):
    model_config = ConfigDict(extra="forbid")

    type: str = Field(pattern="^watch$")
    """Always `watch`."""
    participant: Annotated[str, Field(max_length=100)] | None
    """Whose session is open on the page; null for none."""


def live_reply(lab: Lab, known: Known, label: str | None) -> LiveReply:
    """What the dashboard shows of one session; one that cannot be shown says so, and keeps nobody else from it."""
    if isinstance(known, UnreadableSession):
        return _unreadable(known, label, known.reason)
    try:
        return _live_reply(lab, known, label)
    except Exception as error:
        return _unreadable(known, label, lab.cannot_show(known.participant, error))


def _unreadable(known: Known, label: str | None, reason: str) -> LiveReply:
    return LiveReply(
        **unreadable_reply(known, label, reason).model_dump(),
        trial_s=None,
        signals_per_s=0.0,
        driving_share=None,
        visible=None,
        focused=None,
        sound=None,
        picture=None,
        help=None,
        instruction=None,
        scene="The session cannot be shown.",
    )


def _live_reply(lab: Lab, stored: StoredSession, label: str | None) -> LiveReply:
    live = lab.live_session(stored.participant)
    session = live.session if live else stored.session
    connected = live.connected if live else False
    view = live.view if live else None
    practice = session.place in ("practice_ready", "practice")
    return LiveReply(
        **session_reply(lab, stored, label).model_dump(),
        trial_s=live.trial_s if live else None,
        signals_per_s=live.signals_per_s if live else 0.0,
        driving_share=live.history.driving_share() if live else None,
        visible=live.vitals.visible if connected and live else None,
        focused=live.vitals.focused if connected and live else None,
        sound=live.vitals.sound if live else None,
        picture=live.vitals.picture if live else None,
        help=HelpReply(**vars(live.vitals.help)) if live and live.vitals.help else None,
        instruction=instruction(view, live.labels, practice).text if live and view else None,
        scene=_no_scene(lab, stored, session, live),
    )


def _no_scene(lab: Lab, stored: StoredSession, session: Session, live: LiveSession | None) -> str:
    if not lab.config.scene:
        return "This lab runs without 3-D scenes."
    if stored.pace != "real_time":
        return "Sessions in lockstep have no 3-D scene."
    if session.worker is None:
        return "There is no robot now: it is there before and during practices and trials."
    return "" if live is not None and live.circumstances.ready else "The robot is not in place yet."


@dataclass(frozen=True)
class _Known:
    """What does not change about a participant while a dashboard is open."""

    stored: Known
    label: str | None


class Stream:
    """One dashboard's socket, from its accepted hello to its end."""

    def __init__(self, websocket: WebSocket, lab: Lab) -> None:
        self._websocket = websocket
        self._lab = lab
        self._known: dict[str, _Known] = {}
        self._sent: dict[str, str] = {}
        self._changed: set[str] = set()
        self._wake = asyncio.Event()
        self._trouble: TroubleReply | None = None
        self._crowding: CrowdingReply | None = None
        self._watched: str | None = None
        self._watched_live: LiveSession | None = None
        self._fresh = False
        self._ticks_seen = 0
        self._events_seen = 0

    async def run(self) -> None:
        """Send and receive until the dashboard leaves."""
        unlisten = self._lab.store.listen(lambda trouble: self._wake.set())
        with self._lab.watching(self._note), contextlib.ExitStack() as until_the_end:
            until_the_end.callback(unlisten)
            tasks = (asyncio.create_task(self._send_all()), asyncio.create_task(self._receive_all()))
            try:
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                done = await asyncio.gather(*tasks, return_exceptions=True)
        for result in done:
            if isinstance(result, Exception) and not isinstance(result, (WebSocketDisconnect, RuntimeError)):
                raise result

    def _note(self, participant: str) -> None:
        self._changed.add(participant)
        self._wake.set()

    async def _receive_all(self) -> None:
        while True:
            message = await _message(self._websocket, _Watch)
            if message is None:
                await self._send({"type": "error", "message": "expected {type: watch, participant: id or null}"})
                continue
            self._watched, self._watched_live, self._fresh = message.participant, None, True
            self._wake.set()

    # ---- sending ------------------------------------------------------------------------------------------------

    async def _send_all(self) -> None:
        loop = asyncio.get_running_loop()
        refreshed_s = said_s = -REFRESH_S
        while True:
            changed, self._changed = self._changed, set()
            self._wake.clear()
            due = loop.time() - refreshed_s >= REFRESH_S
            if due or any(self._lab.live_session(one) is None or one not in self._known for one in changed):
                with contextlib.suppress(StoreTroubled):  # then they stay as they were, and `trouble` says why
                    changed = await self._look_up()
                refreshed_s = loop.time()
            if await self._send_overview(changed, is_sign_of_life=due or loop.time() - said_s >= ALIVE_S):
                said_s = loop.time()
            try:
                await self._send_watched()
            except (WebSocketDisconnect, RuntimeError):
                raise
            except Exception as error:  # the overview goes on
                await self._send_unshown(error)
            await asyncio.sleep(GAP_S)
            with contextlib.suppress(asyncio.TimeoutError):
                next_s = min(refreshed_s + REFRESH_S, said_s + ALIVE_S)
                await asyncio.wait_for(self._wake.wait(), max(0.0, next_s - loop.time()))

    async def _look_up(self) -> set[str]:
        """Read everybody again, beside the writing thread: ticks do not wait for it."""
        store = self._lab.store.store

        def read() -> dict[str, _Known]:
            labels, everyone = store.labels(), in_order_of_enrolment(*store.everyone())
            return {one.participant: _Known(one, labels.get(one.participant)) for one in everyone}

        self._known = await asyncio.to_thread(read)
        return set(self._known) | set(self._sent)

    async def _send_overview(self, participants: set[str], is_sign_of_life: bool) -> bool:
        """What changed, or only that the lab is there; whether anything was sent."""
        lines = []
        for participant, known in self._known.items():
            if participant in participants:
                text = live_reply(self._lab, known.stored, known.label).model_dump_json()
                if self._sent.get(participant) != text:
                    self._sent[participant] = text
                    lines.append(json.loads(text))
        gone = [participant for participant in self._sent if participant not in self._known]
        for participant in gone:
            del self._sent[participant]
        trouble = trouble_reply(self._lab.store.trouble)
        crowding = crowding_reply(self._lab.door.crowding())
        is_news = trouble != self._trouble or crowding != self._crowding
        if not (lines or gone or is_sign_of_life or is_news):
            return False
        self._trouble, self._crowding = trouble, crowding
        of_all = {"trouble": trouble, "crowding": crowding}
        told = {name: one.model_dump() if one else None for name, one in of_all.items()}
        await self._send({"type": "overview", "sessions": lines, "gone": gone, **told})
        return True

    async def _send_unshown(self, error: Exception) -> None:
        """That the open session cannot be shown, in place of its news."""
        problem = self._lab.cannot_show(self._watched or "", error)
        nothing = {"since_start": True, "ticks": [], "events": []}
        await self._send({"type": "watched", "participant": self._watched, **nothing, "problem": problem})

    async def _send_watched(self) -> None:
        """What is new about the session that is open on the page."""
        participant = self._watched
        if participant is None:
            return
        if participant not in self._known:
            if self._fresh:
                self._fresh = False
                await self._send({"type": "error", "message": f"no participant {participant!r}"})
            return
        live = self._lab.live_session(participant)
        if live is None:
            if self._fresh:
                self._fresh = False
                stored = await asyncio.to_thread(self._lab.store.store.rows_of, "events", participant)
                await self._send_news(participant, True, [], list(stored[-KEPT_EVENTS:]))
            return
        if live is not self._watched_live:
            self._watched_live, self._fresh = live, True
        fresh, self._fresh = self._fresh, False
        history, setup = live.history, live.setup
        rows = history.ticks_since(0 if fresh else self._ticks_seen)
        events = list(history.events) if fresh else history.events_since(self._events_seen)
        self._ticks_seen, self._events_seen = history.ticks_seen, history.events_seen
        explanations: list[TickExplanation] = []
        if setup is not None and rows:
            explanations = [explain_tick(row, told, setup, live.labels) for row, told in rows]
        if fresh or explanations or events:
            await self._send_news(participant, fresh, explanations, events)

    async def _send_news(
        self,
        participant: str,
        fresh: bool,
        explanations: list[TickExplanation],
        events: list[EventRow],
    ) -> None:
        if participant != self._watched:
            return  # another one was opened meanwhile
        has_words = any("words" in data_of(row) for row in events)
        identities = await asyncio.to_thread(self._lab.store.store.identities, participant) if has_words else ()
        told = zip(events, with_words(events, identities), strict=True)
        await self._send(
            {
                "type": "watched",
                "participant": participant,
                "since_start": fresh,
                "ticks": [asdict(explanation) for explanation in explanations],
                "events": [{**asdict(row), "kind": kind_of(row), "data": data} for row, data in told],
            }
        )

    async def _send(self, message: Mapping[str, Any]) -> None:
        await self._websocket.send_text(json.dumps(message))


async def _message(websocket: WebSocket, kind: type[Any]) -> Any:
    """The next message; None when it is not of this kind. Raises `WebSocketDisconnect`."""
    received = await websocket.receive()
    if received["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(received.get("code", 1005))
    text = received.get("text")
    if text is None or len(text) > MAX_HELLO_BYTES:
        return None
    try:
        return kind.model_validate_json(text)
    except ValueError:
        return None


async def _why_refused(websocket: WebSocket, lab: Lab) -> str:
    """Why the dashboard is not let in, "" when it is. Wrong tokens are counted with those of the HTTP API."""
    try:
        hello = await asyncio.wait_for(_message(websocket, _Hello), lab.config.limits.hello_s)
    except (asyncio.TimeoutError, WebSocketDisconnect):
        lab.refusals.add("hello")
        hello = None
    token = hello.token.strip() if hello is not None else ""
    if lab.is_experimenter(token):
        return ""
    wrong_tokens: Attempts = websocket.app.state.wrong_tokens
    wait_s = math.ceil(wrong_tokens.add(address_of(websocket.scope), token, time.monotonic())) if token else 0
    if wait_s:
        lab.refusals.add("wrong_tokens")
    return f"too many wrong tokens; try again in {wait_s} s" if wait_s else "the experimenter's token is needed"


def add_live(app: FastAPI, lab: Lab) -> None:
    """Put the socket and the routes of this file into an app."""
    places = Places(lab.config.limits.dashboards)
    strangers = Places(lab.config.limits.strangers_per_address)
    app.include_router(private)

    @app.websocket("/dashboard/socket")
    async def dashboard_socket(websocket: WebSocket) -> None:
        if not same_origin(websocket, lab.config.public_url):
            await websocket.close(1008)
            return
        with strangers.take(address_of(websocket.scope)) as is_free:
            if not is_free:
                lab.refusals.add("hello")
                await websocket.close(1013)
                return
            await websocket.accept()
            refused = await _why_refused(websocket, lab)
        if refused:
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await websocket.close(1008, refused)
            return
        with places.take("dashboard") as is_free:
            if is_free:
                await Stream(websocket, lab).run()
            else:
                lab.refusals.add("sockets")
                await websocket.close(1013, "too many dashboards are open")


# ---- routes -------------------------------------------------------------------------------------------------------

private = experimenters_router("experimenter")


class PlaneReply(BaseModel):
    """One of the heatmaps of the paper's Fig. 2 for the last tick. `values` has a row for each x."""

    kind: str
    """information or reward."""
    tick: int
    """Number of the tick it is of."""
    z_m: float
    """Height of the plane, in metres in the world frame."""
    x_m: list[float]
    """Its rows, in metres in the world frame."""
    y_m: list[float]
    """Its columns, in metres in the world frame."""
    values: list[list[float]]
    """A row for each x, a column for each y."""
    unit: str
    """The unit of `values`."""
    caption: str
    """What it shows, in words."""
    goals: list[dict[str, Any]]
    """The goals, with their places and belief."""
    gripper_m: tuple[float, float, float]
    """The gripper, in metres in the world frame."""
    table_m: tuple[float, float, float, float]
    """The table top, in metres: least x, most x, least y, most y."""


@private.get("/sessions/{participant}/heatmap", responses=refusals(404, 409))
async def heatmap(
    participant: ParticipantId,
    lab: TheLab,
    who: Experimenter,
    kind: Annotated[PlaneKind, Query(description="Which of the two heatmaps.")] = "information",
) -> PlaneReply:
    """What each place of the table is worth, for the last tick's belief: expected information or approach to goals."""
    live = lab.live_session(participant)
    if live is None:
        await _or_404(lab, participant)
    if live is None or live.setup is None or not live.history.ticks:
        raise HTTPException(409, "no tick has run: there is a heatmap while the robot is being driven")
    row, setup, labels = live.history.ticks[-1], live.setup, live.labels
    plane: Plane = await asyncio.to_thread(plane_of, row, setup, labels, kind)
    return PlaneReply.model_validate(asdict(plane))


async def _or_404(lab: Lab, participant: str) -> None:
    try:
        await lab.stored_session(participant)
    except NoSuchParticipant as error:
        raise HTTPException(404, str(error)) from None


async def _remark(lab: Lab, participant: str, remark: Remark, who: str) -> dict[str, str]:
    try:
        await lab.remark(participant, remark, who)
    except NoSuchParticipant as error:
        raise HTTPException(404, str(error)) from None
    except NotNow as error:
        raise not_now(error) from None
    return {"participant": participant, "recorded": remark.name}


def _remark_route(path: str, name: RemarkName, text: str) -> None:
    async def route(participant: ParticipantId, body: _Said, lab: TheLab, who: Experimenter) -> dict[str, str]:
        return await _remark(lab, participant, Remark(name, body.text), who)

    route.__doc__ = text
    private.post(f"/sessions/{{participant}}/{path}", name=path, responses=refusals(404, 409))(route)


_remark_route("note", "note", "Write something into the session's record.")
_remark_route("mark", "task_marked", "Mark the task that is under way, with words of your own.")
_remark_route("message", "message", "Show the participant a line, which stays until they put it away.")


@private.post("/sessions/{participant}/help_seen", responses=refusals(404, 409))
async def help_seen(participant: ParticipantId, body: _Empty, lab: TheLab, who: Experimenter) -> dict[str, str]:
    """The participant's call for help has been answered."""
    return await _remark(lab, participant, Remark("help_seen", ""), who)
