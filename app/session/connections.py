"""Who is connected to a session, and what each page is sent: one participant's page and one second device."""

from __future__ import annotations

from app.session.interfaces import Client, Enrolment, LabServices, Role
from app.wire import (
    Ack,
    Alert,
    AlertChoice,
    AlertClosed,
    Error,
    Message,
    Notice,
    Page,
    Panel,
    Saves,
    Status,
    StimulusWords,
    Superseded,
    Welcome,
    World,
)
from sim.interface import TICK_S
from study.flow.distractors.state import AlertState, DistractorState
from study.flow.protocol import Session


class Connections:
    """The connected pages. A newcomer takes its role over from whoever had it."""

    def __init__(self, enrolment: Enrolment, services: LabServices) -> None:
        self._enrolment = enrolment
        self._services = services
        self._clients: dict[Role, Client | None] = {"participant": None, "panel": None}

    def join(self, client: Client) -> Client | None:
        """Let a page in; returns the one it took over from, which has been told and is ending."""
        previous = self._clients[client.role]
        self._clients[client.role] = client
        if previous is None or previous is client:
            return None
        previous.deliver(Superseded())
        previous.end()
        return previous

    def leave(self, client: Client) -> bool:
        """A page is gone; False if it had been taken over before."""
        if self._clients[client.role] is not client:
            return False
        self._clients[client.role] = None
        return True

    def holds(self, client: Client) -> bool:
        """Whether this is the page that has its role."""
        return self._clients[client.role] is client

    @property
    def participant(self) -> Client | None:
        """The participant's page."""
        return self._clients["participant"]

    @property
    def panel(self) -> Client | None:
        """The second device's page."""
        return self._clients["panel"]

    @property
    def waiting(self) -> int:
        """How many messages the slower page has not been sent yet."""
        return max((client.waiting for client in self._clients.values() if client is not None), default=0)

    def end(self) -> None:
        """Close every connection."""
        for client in self._clients.values():
            if client is not None:
                client.end()

    # ---- to one page --------------------------------------------------------------------------------------------

    def welcome(self, client: Client, last_seq: int) -> None:
        """The first message on a socket."""
        distractor, named = self._services.study.distractor, self._services.distractor.words
        words = self._services.study.words
        client.deliver(
            Welcome(
                role=client.role,
                session=self._enrolment.public_id,
                study_title=self._services.study.title,
                pace=self._enrolment.pace,
                tick_s=TICK_S,
                heartbeat_ms=self._services.config.heartbeat_ms,
                placement=distractor.placement if distractor.enabled else "none",
                stimuli=None
                if distractor.kind == "readings"
                else StimulusWords(one=words.t(named.one), many=words.t(named.many)),
                show_assistance=self._services.study.show_assistance,
                last_seq=last_seq,
                demo=self._enrolment.demo,
            )
        )

    # ---- to everybody it concerns -------------------------------------------------------------------------------

    def show_page(self, page: Page, session: Session) -> None:
        """The participant's page, and what the second device is to do."""
        self._tell("participant", page)
        self._tell("panel", panel_page(session))

    def show_status(self, status: Status | None) -> None:
        """Whether ticks run, to both pages."""
        if status is not None:
            self._tell("participant", status)
            self._tell("panel", status)

    def show_saves(self, saves: Saves) -> None:
        """Whether the lab can save, to both pages."""
        self._tell("participant", saves)
        self._tell("panel", saves)

    def show_world(self, world: World | None) -> None:
        """What the scene shows in numbers, if the page asked for it."""
        client = self.participant
        if client is not None and client.telemetry and world is not None:
            client.deliver(world)

    def show_tick(self, tick: Message) -> None:
        """A committed tick."""
        self._tell("participant", tick)

    def show_notice(self, text: str) -> None:
        """A line from the experimenter."""
        self._tell("participant", Notice(text=text))

    def show_panel(self, heard: bool | None) -> None:
        """The second device, to the participant's page, where the study has one."""
        if self._services.study.distractor.on_second_device:
            self._tell("participant", Panel(connected=self.panel is not None, heard=heard))

    def show_alert(self, alert: AlertState | None, distractor: DistractorState, trial_s: float) -> None:
        """An alert, open or closed, to the page the study puts it on."""
        if alert is None:
            return
        settings = self._services.study.distractor
        role: Role = "panel" if settings.placement == "second_device" else "participant"
        if alert.status != "open":
            release_in_s = distractor.release_in_s(trial_s)
            self._tell(role, AlertClosed(alert=alert.alert, status=alert.status, release_in_s=release_in_s))
            return
        client, stimulus, words = self._clients[role], alert.stimulus, self._services.study.words
        is_scripted = client is not None and client.telemetry and self._enrolment.pace == "lockstep"
        message = Alert(
            alert=alert.alert,
            reading=stimulus.text,
            elapsed_s=max(0.0, trial_s - alert.due_trial_s),
            answer_within_s=round(distractor.deadline_s(alert.alert) - alert.due_trial_s, 6),
            away_min_s=settings.away_min_s,
            prompt=words.t(stimulus.prompt) if stimulus.prompt else None,
            entry=stimulus.entry,
            choices=tuple(
                AlertChoice(id=choice.id, label=words.t(choice.label), key=choice.key) for choice in stimulus.choices
            ),
            right_answer=distractor.right_answer(alert.alert) if is_scripted else None,
        )
        self._tell(role, message)

    def show_cover(self, distractor: DistractorState, trial_s: float) -> None:
        """To a page that comes in between: the open alert, or that the controls are not back yet."""
        if distractor.open_alert is not None:
            self.show_alert(distractor.open_alert, distractor, trial_s)
        elif distractor.locked(trial_s):
            self.show_alert(distractor.alerts[-1], distractor, trial_s)

    def _tell(self, role: Role, message: Message) -> None:
        client = self._clients[role]
        if client is not None:
            client.deliver(message)


def acknowledge(client: Client, identifier: str) -> None:
    """What was submitted under this id is on disk."""
    client.deliver(Ack(id=identifier))


def refuse(client: Client, code: str, field: str | None, text: str, identifier: str | None = None) -> None:
    """What was sent cannot be taken."""
    client.deliver(Error.model_validate({"code": code, "field": field, "message": text, "id": identifier}))


def panel_page(session: Session) -> Page:
    """The second device's page: `practice` or `trial` while alerts may come, `paused`, `waiting`, or the end."""
    live = session.state if session.place in ("practice", "trial") else "waiting"
    state = session.state if session.is_over else live
    return Page(state=state, trial=None, trials=session.trials, content={})
