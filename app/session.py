"""One participant's live session: their pages, their worker, their distractor and their record, kept in step.

Everything that happens comes through one queue and is dealt with one at a time, so there is one order of events and it
is the order in the log. The only thing that does not queue is the state of the hands: it goes straight to the worker,
which takes the newest (see `app.hands`).

    page ── submit/note ──►┐                                  ┌──► store (committed first)
    worker ── reports ────►├─► queue ─► one at a time ─► ... ─┼──► worker commands (effects of the protocol)
    experimenter ─────────►┘                                  └──► pages (after the commit)
"""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from typing import Any, Literal, Protocol

from app import pages
from app.config import LabConfig
from app.cycles import cycle_to_json
from app.messages import (
    Ack,
    Alert,
    AlertClosed,
    Error,
    Heartbeat,
    Input,
    Instruction,
    Message,
    Note,
    Notice,
    Ping,
    Pong,
    Status,
    Submit,
    Superseded,
    View,
    Welcome,
    World,
)
from app.pages import Labels, PageContext
from app.steps import STEPS, AlertData, Outcome, Refused, StepContext, parse
from app.trial import CycleStart, TrialView
from app.worker_messages import (
    Begin,
    Failed,
    Hands,
    Hold,
    HoldChanged,
    Pace,
    Ready,
    SetView,
    Ticked,
    WorkerCommand,
    WorkerReport,
    WorkerSpec,
)
from sim.interface import TICK_S
from study import protocol
from study.design import SessionPlan, Study, reading
from study.distractor import Alert as DistractorAlert
from study.distractor import DistractorState
from study.protocol import BeginTicks, Event, PauseTicks, ResumeTicks, Session, StartWorker, StopWorker
from study.records import EventRow, TrialRow
from study.store import Cycle
from study.writer import AsyncStore

log = logging.getLogger(__name__)

Role = Literal["participant", "panel"]
Source = Literal["participant", "experimenter", "lab", "robot"]


class Client(Protocol):
    """A connected page or bot, as the session sees it. `deliver` never blocks."""

    role: Role
    name: str
    telemetry: bool

    def deliver(self, message: Message) -> None:
        """Queue a message for the page."""

    def end(self) -> None:
        """Close the connection after what is queued has been sent."""


class WorkerHandle(Protocol):
    """A live worker, as the session sees it."""

    def send(self, command: WorkerCommand) -> None:
        """Hand over a command."""

    async def stop(self) -> None:
        """End it and wait for it."""


StartWorkerProcess = Callable[[WorkerSpec, Callable[[WorkerReport], None], Callable[[], None]], WorkerHandle]


@dataclass(frozen=True)
class Enrolment:
    """What is fixed about a participant from the start."""

    participant: str
    public_id: str
    plan: SessionPlan
    pace: Pace
    demo: bool


@dataclass(frozen=True)
class Resumed:
    """Where a stored session stood: its distractor, the last tick of the phase, the last input's number."""

    distractor: DistractorState
    tick: int | None = None
    last_seq: int = 0


@dataclass
class Vitals:
    """What the experimenter sees of a session besides its state."""

    round_trip_ms: float | None = None
    visible: bool | None = None
    focused: bool | None = None
    device: str | None = None
    overruns: int = 0
    ticks: int = 0
    help_wanted: bool = False


@dataclass(frozen=True)
class Surroundings:
    """What a live session needs from the lab it lives in."""

    store: AsyncStore
    study: Study
    config: LabConfig
    labels: Labels
    start_worker: StartWorkerProcess
    make_spec: Callable[[Literal["practice", "trial"], int], Awaitable[WorkerSpec]]
    """(kind, trial) -> a worker's spec, with the log of the current cycle."""
    trial_row: Callable[[int], TrialRow]
    now_unix_s: Callable[[], float]
    panel_link: Callable[[], Awaitable[str]]
    """A link for the second device."""


@dataclass
class _Work:
    """One thing in the queue, with somebody waiting for it, perhaps."""

    kind: Literal["attach", "detach", "message", "report", "exit", "command", "ping"]
    payload: Any = None
    client: Client | None = None
    done: asyncio.Future[Any] | None = field(default=None, repr=False)


def utc_text(unix_s: float) -> str:
    """ISO 8601 UTC with milliseconds."""
    return datetime.fromtimestamp(unix_s, timezone.utc).isoformat(timespec="milliseconds").replace("+00:00", "Z")


class LiveSession:
    """See the module's text.

    Attributes:
        enrolment: what is fixed about the participant.
        session: where the participant is in the study (`study.protocol`).
        vitals: what the experimenter sees.
        scene_port: port of the session's viser server on loopback, while a worker with a scene is up.
    """

    def __init__(self, enrolment: Enrolment, session: Session, resumed: Resumed, around: Surroundings) -> None:
        self.enrolment = enrolment
        self.session = session
        self.vitals = Vitals()
        self.scene_port: int | None = None
        self._around = around
        self._distractor = resumed.distractor
        self._panel_link: str | None = None
        self._queue: asyncio.Queue[_Work] = asyncio.Queue()
        self._task: asyncio.Task[None] | None = None
        self._clients: dict[Role, Client | None] = {"participant": None, "panel": None}
        self._worker: WorkerHandle | None = None
        self._worker_epoch = 0
        self._worker_ready = False
        self._restarts = 0
        self._view: TrialView | None = None
        self._world: World | None = None
        self._tick: int | None = resumed.tick
        self._trial_s = 0.0 if resumed.tick is None else (resumed.tick + 1) * TICK_S
        self._last_seq = resumed.last_seq
        self._held = False
        self._pings: dict[int, float] = {}

    # ---- what the lab and the server call -----------------------------------------------------------------------

    async def open(self) -> None:
        """Start dealing with the queue, and bring back what a restart of the lab interrupted."""
        before = self.session
        self.session, effects = protocol.restore(self.session, self._around.now_unix_s())
        if self.session != before:
            await self._commit(events=(self._event("lab_restarted", "lab", {"state": before.state}),))
        self._task = asyncio.create_task(self._run(), name=f"session {self.enrolment.participant}")
        await self._carry_out(effects)

    async def close(self) -> None:
        """Stop the worker and the queue. What is stored stays."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        await self._stop_worker()
        for client in self._clients.values():
            if client is not None:
                client.end()

    def attach(self, client: Client) -> None:
        """A page connected and said hello."""
        self._queue.put_nowait(_Work("attach", client=client))

    def detach(self, client: Client) -> None:
        """A page is gone."""
        self._queue.put_nowait(_Work("detach", client=client))

    def receive(self, client: Client, message: Message) -> None:
        """A page sent a message. The state of the hands does not wait in the queue."""
        if self._clients[client.role] is not client and not self._is_attaching(client):
            return
        if isinstance(message, (Input, Heartbeat)) and client.role == "participant":
            self._on_hands(client, message)
        else:
            self._queue.put_nowait(_Work("message", message, client))

    async def command(self, event: Event, by: str) -> None:
        """An experimenter's pause, resume or abort. Raises `study.protocol.IllegalEvent`."""
        done: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._queue.put_nowait(_Work("command", (event, by), done=done))
        await done

    def probe(self) -> None:
        """Ask the page for a sign of life, to measure the round trip."""
        self._queue.put_nowait(_Work("ping"))

    @property
    def connected(self) -> bool:
        """Whether the participant's page is connected."""
        return self._clients["participant"] is not None

    @property
    def view(self) -> TrialView | None:
        """The trial as it stands, if one is under way."""
        return self._view

    @property
    def held(self) -> bool:
        """Whether the robot waits for the page's heartbeat."""
        return self._held

    # ---- the queue ----------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        handlers: Mapping[str, Callable[[_Work], Any]] = {
            "attach": self._on_attach,
            "detach": self._on_detach,
            "message": self._on_message,
            "report": self._on_report,
            "exit": self._on_worker_exit,
            "command": self._on_command,
            "ping": self._on_ping,
        }
        while True:
            work = await self._queue.get()
            try:
                result = await handlers[work.kind](work)
                if work.done is not None and not work.done.cancelled():
                    work.done.set_result(result)
            except Exception as error:
                if work.done is not None and not work.done.cancelled():
                    work.done.set_exception(error)
                else:
                    log.exception("session %s: %s could not be dealt with", self.enrolment.participant, work.kind)
                    if work.client is not None:
                        identifier = getattr(work.payload, "id", None)
                        text = "the lab could not deal with this; nothing was lost"
                        work.client.deliver(Error(code="internal", field=None, message=text, id=identifier))

    def _is_attaching(self, client: Client) -> bool:
        return any(work.kind == "attach" and work.client is client for work in list(self._queue._queue))  # type: ignore[attr-defined]

    # ---- connections --------------------------------------------------------------------------------------------

    async def _on_attach(self, work: _Work) -> None:
        client = work.client
        assert client is not None
        previous = self._clients[client.role]
        if previous is not None and previous is not client:
            previous.deliver(Superseded())
            previous.end()
        self._clients[client.role] = client
        kind = "tab_taken_over" if previous is not None else "connected"
        await self._commit(events=(self._event(kind, "participant", {"role": client.role}),))
        distractor = self._around.study.distractor
        if distractor.placement == "second_device" and self._panel_link is None:
            self._panel_link = await self._around.panel_link()
        client.deliver(
            Welcome(
                role=client.role,
                session=self.enrolment.public_id,
                study_title=self._around.study.title,
                pace=self.enrolment.pace,
                tick_s=TICK_S,
                heartbeat_ms=self._around.config.heartbeat_ms,
                placement=distractor.placement if distractor.enabled else "none",
                show_assistance=self._around.study.show_assistance,
                last_seq=self._last_seq,
                demo=self.enrolment.demo,
            )
        )
        client.deliver(self._page() if client.role == "participant" else self._panel_page())
        self._deliver_status(client)
        self._deliver_world(client)
        self._deliver_open_alert(client)

    async def _on_detach(self, work: _Work) -> None:
        client = work.client
        assert client is not None
        if self._clients[client.role] is not client:
            return
        self._clients[client.role] = None
        event = self._event("disconnected", "participant", {"role": client.role})
        if client.role == "participant" and not self.session.is_over:
            await self._advance(Event("connection_lost"), events=(event,))
        else:
            await self._commit(events=(event,))

    async def _on_ping(self, work: _Work) -> None:
        client = self._clients["participant"]
        if client is not None:
            number = len(self._pings) + 1 if len(self._pings) < 1000 else 1
            self._pings = {number: self._around.now_unix_s()}
            client.deliver(Ping(n=number))

    # ---- hands --------------------------------------------------------------------------------------------------

    def _on_hands(self, client: Client, message: Input | Heartbeat) -> None:
        locked = self._distractor.locked(self._trial_s)
        if isinstance(message, Heartbeat):
            self.vitals.visible, self.vitals.focused = message.visible, message.focused
            self.vitals.device = message.device
            direction = None if locked else message.direction
            self._send_worker(Hands(message.seq, direction, beat=True))
            return
        if message.seq <= self._last_seq:
            text = f"seq {message.seq} is not above {self._last_seq}, the last one taken; it was ignored"
            client.deliver(Error(code="out_of_order", field="seq", message=text))
            return
        self._last_seq = message.seq
        if self.enrolment.pace == "lockstep" and not (self.session.is_ticking and self._worker_ready):
            text = f"no tick can run in state {self.session.state!r}; the input was ignored"
            client.deliver(Error(code="illegal", field="type", message=text))
            return
        hands = Hands(message.seq, message.direction, message.gripper)
        self._send_worker(replace(hands, direction=None, pressed=None) if locked else hands)

    # ---- messages -----------------------------------------------------------------------------------------------

    async def _on_message(self, work: _Work) -> None:
        client, message = work.client, work.payload
        assert client is not None
        if isinstance(message, Submit):
            await self._on_submit(client, message)
        elif isinstance(message, Note):
            data = {"role": client.role, **message.data}  # a resend of the same id writes nothing
            await self._commit(submission=message.id, events=(self._event(message.name, "participant", data),))
            client.deliver(Ack(id=message.id))
        elif isinstance(message, View):
            self._send_worker(SetView(message.name))
            await self._commit(events=(self._event("view", "participant", {"name": message.name}),))
        elif isinstance(message, Pong) and message.n in self._pings:
            self.vitals.round_trip_ms = (self._around.now_unix_s() - self._pings.pop(message.n)) * 1000.0
        elif isinstance(message, (Input, Heartbeat)):
            client.deliver(Error(code="illegal", field="type", message="a panel does not drive the robot"))

    async def _on_submit(self, client: Client, message: Submit) -> None:
        participant = self.enrolment.participant
        answered = await self._around.store.run(lambda store: store.response(participant, message.id))
        if answered is not None:
            self._answer_again(client, message.id, answered)
            return
        try:
            if message.step.startswith("alert_"):
                await self._on_alert_step(client, message)
            elif client.role != "participant":
                raise Refused("illegal", ("step", f"{message.step!r} is not for the second device"))
            else:
                await self._on_step(client, message)
        except Refused as refused:
            if refused.kept:
                data = {"step": message.step, "fields": [field for field, _ in refused.problems]}
                event = self._event("answers_not_right", "participant", data)
                response = {"code": refused.code, "problems": refused.problems}
                await self._commit(submission=message.id, response=response, answers=refused.kept, events=(event,))
            self._refuse(client, message.id, refused.code, refused.problems)
        except protocol.IllegalEvent as illegal:
            self._refuse(client, message.id, "illegal", (("step", str(illegal)),))
            client.deliver(self._page())

    def _answer_again(self, client: Client, identifier: str, response: Mapping[str, Any]) -> None:
        """A resend of something already dealt with gets the same answer."""
        if response.get("problems"):
            self._refuse(client, identifier, response["code"], response["problems"])
        else:
            client.deliver(Ack(id=identifier))

    def _refuse(self, client: Client, identifier: str, code: Any, problems: Iterable[Any]) -> None:
        for place, text in problems:
            client.deliver(Error(code=code, field=place, message=text, id=identifier))

    async def _on_step(self, client: Client, message: Submit) -> None:
        now_s = self._around.now_unix_s()
        condition = self.enrolment.plan.trial(self.session.trial).condition
        context = StepContext(self._around.study, self.session, condition, utc_text(now_s))
        outcome: Outcome = STEPS[message.step](context, message.data)
        events = (self._event(f"step_{message.step}", "participant", dict(outcome.log or {})),)
        if message.step == "help":
            self.vitals.help_wanted = True
        if outcome.event is None:
            await self._commit(submission=message.id, events=events)
            client.deliver(Ack(id=message.id))
            return
        if message.step == "start" and not self._worker_ready:
            raise Refused("illegal", ("step", "the robot is not ready yet"))
        await self._advance(
            outcome.event,
            events=events,
            submission=message.id,
            answers=outcome.answers,
            consent=(context.utc, outcome.consent_hash) if outcome.consent_hash else None,
            acknowledge=client,
        )

    async def _on_alert_step(self, client: Client, message: Submit) -> None:
        data = parse(AlertData, message.data)
        utc = utc_text(self._around.now_unix_s())
        alert = self._distractor.alert(data.alert)
        if alert is None:
            raise Refused("invalid", ("data.alert", f"no reading {data.alert} has been shown in this trial"))
        if message.step == "alert_shown":
            self._distractor = self._distractor.shown(data.alert, utc)
        elif message.step == "alert_heard":
            self._distractor = self._distractor.heard(data.alert, utc)
        else:
            after, result = self._distractor.answer(data.alert, data.value or "", self._trial_s, utc)
            if result == "empty":
                raise Refused("invalid", ("data.value", "Please type the reading."))
            self._distractor = after
            events = (self._event("alert_answer", "participant", {"alert": data.alert, "result": result}),)
            await self._commit(submission=message.id, alerts=(data.alert,), events=events)
            client.deliver(Ack(id=message.id))
            self._deliver_alert_closed(self._distractor.alert(data.alert))
            return
        await self._commit(submission=message.id, alerts=(data.alert,))
        client.deliver(Ack(id=message.id))

    # ---- the experimenter ---------------------------------------------------------------------------------------

    async def _on_command(self, work: _Work) -> None:
        event, by = work.payload
        data = {"by": by, "reason": event.reason}
        await self._advance(event, events=(self._event(event.name, "experimenter", data),))

    # ---- the worker ---------------------------------------------------------------------------------------------

    async def _on_report(self, work: _Work) -> None:
        epoch, report = work.payload
        if epoch != self._worker_epoch:
            return
        if isinstance(report, Ready):
            await self._on_ready(report)
        elif isinstance(report, Ticked):
            await self._on_ticked(report)
        elif isinstance(report, HoldChanged):
            self._held = report.held
            kind = "robot_held" if report.held else "robot_released"
            await self._commit(events=(self._event(kind, "lab", {}),))
            self._broadcast_status()
        elif isinstance(report, Failed):
            await self._commit(events=(self._event("worker_failed", "lab", {"reason": report.reason}),))

    async def _on_ready(self, report: Ready) -> None:
        self._worker_ready, self._view, self.scene_port = True, report.view, report.scene_port
        self._world = World(**vars(report.sight))
        if report.mismatch is not None:
            event = self._event("replay_mismatch", "robot", {"tick": report.mismatch})
            await self._commit(events=(event,))
        if report.finished:
            await self._phase_done(())
            return
        if self.session.is_ticking:
            self._send_worker(Begin())
        self._deliver_page()
        self._broadcast_status()
        self._broadcast_world()

    async def _on_ticked(self, report: Ticked) -> None:
        result, trial = report.result, self.session.trial
        practice = self.session.place == "practice"
        row = replace(result.row, started_utc=utc_text(report.started_unix_s), late_ms=report.late_ms)
        before = pages.instruction(self._view, self._around.labels, practice) if self._view else None
        self._tick, self._trial_s, self._view = row.tick, (row.tick + 1) * TICK_S, result.view
        self._world = World(**vars(report.sight))
        self.vitals.ticks += 1
        overrun = report.missed > 0 or (report.late_ms or 0.0) > 50.0
        events = [self._event(event.kind, "robot", dict(event.data)) for event in result.events]
        if overrun:
            self.vitals.overruns += 1
            data = {"late_ms": report.late_ms, "missed": report.missed}
            events.append(self._event("overrun", "lab", data))
        changed = ()
        if not practice:
            plan = self.enrolment.plan.trial(trial)
            self._distractor, changed = self._distractor.advance(self._trial_s, lambda number: reading(plan, number))
            if result.finished:
                self._distractor, closed = self._distractor.close()
                changed = (*changed, *closed)
        rows: dict[str, Any] = {
            "ticks": () if practice else (row,),
            "practice_ticks": (row,) if practice else (),
            "tasks": () if practice else result.tasks,
            "alerts": [alert.alert for alert in changed],
            "cycle": result.cycle_start,
        }
        if not result.finished:
            await self._commit(events=events, **rows)
        else:
            await self._phase_done(tuple(events), **rows)
        self._broadcast_tick(result, report.seq, before, practice)
        for alert in changed:
            if alert.status == "open":
                self._deliver_open_alert(self._alert_client())
            else:
                self._deliver_alert_closed(alert)

    async def _phase_done(self, events: tuple[EventRow, ...], **rows: Any) -> None:
        """The practice or the trial is over: its last tick and the step to the next state are one commit."""
        if self.session.place == "practice":
            await self._advance(Event("practice_done"), events=events, **rows)
        else:
            trials = (await self._closed_trial("completed"),)
            await self._advance(Event("trial_done"), events=events, trials=trials, **rows)

    async def _closed_trial(self, outcome: Literal["completed", "aborted"]) -> TrialRow:
        """The row of the trial that ends now."""
        participant, trial = self.enrolment.participant, self.session.trial
        (row,) = await self._around.store.run(lambda store: store.rows_of("trials", participant, trial=trial))
        ticks = 0 if self._tick is None else self._tick + 1
        finished_utc = utc_text(self._around.now_unix_s())
        return replace(row, outcome=outcome, ticks=ticks, overruns=self.vitals.overruns, finished_utc=finished_utc)

    async def _on_worker_exit(self, work: _Work) -> None:
        if work.payload != self._worker_epoch or self._worker is None:
            return
        self._worker, self._worker_ready, self.scene_port = None, False, None
        self._restarts += 1
        event = self._event("worker_lost", "lab", {"restarts": self._restarts})
        if self._restarts > self._around.config.worker_restarts:
            await self._advance(Event("experimenter_pause", "the robot's process keeps ending"), events=(event,))
            return
        await self._commit(events=(event,))
        self._broadcast_status("recovering")
        needed = self.session.worker
        if needed is not None:
            await self._start_worker(*needed)

    # ---- the protocol -------------------------------------------------------------------------------------------

    async def _advance(
        self,
        event: Event,
        events: tuple[EventRow, ...] = (),
        acknowledge: Client | None = None,
        submission: str | None = None,
        **rows: Any,
    ) -> None:
        """Take an event of the protocol: commit, acknowledge, carry out its effects, show the new page."""
        before = self.session
        after, effects = protocol.advance(before, event, self._around.now_unix_s())
        if after != before:
            data = {"event": event.name, "from": before.state, "to": after.state, "reason": event.reason}
            events = (*events, self._event("state", "lab", data))
        if after.is_over:
            rows["finished_utc"] = utc_text(self._around.now_unix_s())
            if before.place == "trial":
                rows["trials"] = (await self._closed_trial("aborted"),)
                self._distractor, closed = self._distractor.close()
                rows["alerts"] = [alert.alert for alert in closed]
        elif any(isinstance(effect, BeginTicks) for effect in effects) and after.state == "trial":
            row = self._around.trial_row(after.trial)
            rows["trials"] = (replace(row, started_utc=utc_text(self._around.now_unix_s())),)
            self.vitals.overruns = 0
        await self._commit(session=after, events=events, submission=submission, **rows)
        self.session = after
        if acknowledge is not None and submission is not None:
            acknowledge.deliver(Ack(id=submission))
        await self._carry_out(effects)
        if after != before:
            self._deliver_page()
            self._broadcast_status()

    async def _carry_out(self, effects: tuple[protocol.Effect, ...]) -> None:
        for effect in effects:
            if isinstance(effect, StartWorker):
                await self._start_worker(effect.kind, effect.trial)
            elif isinstance(effect, StopWorker):
                await self._stop_worker()
            elif isinstance(effect, PauseTicks):
                self._held = False
                self._send_worker(Hold())
            elif isinstance(effect, (BeginTicks, ResumeTicks)):
                if self._worker is None and self.session.worker is not None:
                    self._restarts = 0
                    await self._start_worker(*self.session.worker)
                self._send_worker(Begin())

    async def _start_worker(self, kind: Literal["practice", "trial"], trial: int) -> None:
        self._worker_epoch += 1
        epoch = self._worker_epoch
        self._worker_ready = False
        self.scene_port = None
        spec = await self._around.make_spec(kind, trial)
        self._worker = self._around.start_worker(
            spec,
            lambda report: self._queue.put_nowait(_Work("report", (epoch, report))),
            lambda: self._queue.put_nowait(_Work("exit", epoch)),
        )

    async def _stop_worker(self) -> None:
        worker, self._worker = self._worker, None
        self._worker_ready, self.scene_port, self._view, self._tick = False, None, None, None
        self._held = False
        self._restarts = 0
        self._worker_epoch += 1
        self._distractor, self._trial_s = DistractorState(self._around.study.distractor), 0.0
        if worker is not None:
            await worker.stop()

    def _send_worker(self, command: WorkerCommand) -> None:
        if self._worker is not None and self._worker_ready:
            self._worker.send(command)

    # ---- the record ---------------------------------------------------------------------------------------------

    async def _commit(
        self,
        *,
        alerts: Iterable[int] = (),
        cycle: CycleStart | None = None,
        submission: str | None = None,
        response: Mapping[str, Any] | None = None,
        **rows: Any,
    ) -> None:
        """Write one batch; it is on disk when this returns. Rows of `alerts` (numbers) are made here.

        `submission` is the message that caused it, `response` what a resend of the same message is answered with.
        """
        participant, trial = self.enrolment.participant, self.session.trial
        condition = self.enrolment.plan.trial(trial).condition
        found = [self._distractor.alert(number) for number in dict.fromkeys(alerts)]
        alert_rows = [self._distractor.row(alert, participant, condition, trial) for alert in found if alert]
        practice = bool(rows.get("practice_ticks"))
        cycles = [Cycle(participant, trial, practice, cycle.cycle, cycle_to_json(cycle))] if cycle else []
        sent = (participant, submission, dict(response or {})) if submission else None
        await self._around.store.run(
            lambda store: store.commit(alerts=alert_rows, cycles=cycles, submission=sent, **rows)
        )

    def _event(self, kind: str, source: Source, data: Mapping[str, Any]) -> EventRow:
        in_trial = self.session.worker is not None
        return EventRow(
            participant=self.enrolment.participant,
            trial=self.session.trial if in_trial else None,
            tick=self._tick if in_trial else None,
            utc=utc_text(self._around.now_unix_s()),
            kind=kind,
            source=source,
            data=json.dumps(dict(data), default=str),
        )

    # ---- what the pages get -------------------------------------------------------------------------------------

    def _page(self) -> pages.Page:
        practice = self.session.place in ("practice_ready", "practice")
        shown: Instruction | None = None
        if self._view is not None:
            shown = pages.instruction(self._view, self._around.labels, practice)
        scene_path = f"/s/{self.enrolment.public_id}/scene/"
        context = PageContext(self._around.study, scene_path, self._panel_link, shown, self._worker_ready)
        return pages.page(self.session, context)

    def _panel_page(self) -> pages.Page:
        state = "over" if self.session.is_over else "waiting"
        return pages.Page(state=state, trial=None, trials=self.session.trials, content={})

    def _deliver_page(self) -> None:
        client = self._clients["participant"]
        if client is not None:
            client.deliver(self._page())
        panel = self._clients["panel"]
        if panel is not None and self.session.is_over:
            panel.deliver(self._panel_page())

    def _status(self) -> Status | None:
        if self.session.worker is None:
            return None
        if self.session.state == "paused":
            return Status(status="paused", reason=", ".join(sorted(self.session.causes)))
        if not self._worker_ready:
            return Status(status="recovering" if self._restarts else "starting")
        if not self.session.is_ticking:
            return Status(status="ready")
        return Status(status="held" if self._held else "running")

    def _deliver_status(self, client: Client) -> None:
        status = self._status()
        if status is not None:
            client.deliver(status)

    def _broadcast_status(self, override: Literal["recovering"] | None = None) -> None:
        for client in self._clients.values():
            if client is not None:
                if override:
                    client.deliver(Status(status=override))
                else:
                    self._deliver_status(client)

    def _broadcast_tick(self, result: Any, seq: int, before: Instruction | None, practice: bool) -> None:
        client = self._clients["participant"]
        if client is None:
            return
        self._deliver_world(client)
        show = self._around.study.show_assistance
        client.deliver(pages.tick_message(result, seq, before, self._around.labels, practice, show))

    def _broadcast_world(self) -> None:
        client = self._clients["participant"]
        if client is not None:
            self._deliver_world(client)

    def _deliver_world(self, client: Client) -> None:
        if client.telemetry and self._world is not None:
            client.deliver(self._world)

    def _alert_client(self) -> Client | None:
        on_panel = self._around.study.distractor.placement == "second_device"
        return self._clients["panel" if on_panel else "participant"]

    def _deliver_open_alert(self, client: Client | None) -> None:
        alert = self._distractor.open_alert
        if alert is None or client is None or client is not self._alert_client():
            return
        settings = self._around.study.distractor
        client.deliver(
            Alert(
                alert=alert.alert,
                reading=alert.reading,
                elapsed_s=max(0.0, self._trial_s - alert.due_trial_s),
                answer_within_s=settings.answer_within_s,
                away_min_s=settings.away_min_s,
            )
        )

    def _deliver_alert_closed(self, alert: DistractorAlert | None) -> None:
        client = self._alert_client()
        if alert is None or alert.status == "open" or client is None:
            return
        release_in_s = self._distractor.release_in_s(self._trial_s)
        client.deliver(AlertClosed(alert=alert.alert, status=alert.status, release_in_s=release_in_s))


__all__ = ["Client", "Enrolment", "LiveSession", "Notice", "Surroundings", "World"]
