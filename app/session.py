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
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from app import pages
from app.audience import Audience, acknowledge, panel_page, refuse
from app.cycles import cycle_to_json
from app.messages import Heartbeat, Input, Instruction, Message, Note, Ping, Pong, Status, Submit, View, World
from app.pages import PageContext
from app.recent import Recent
from app.remarks import Remark, refuse_unless
from app.steps import STEPS, AlertData, Refused, StepContext, parse
from app.surroundings import Client, Enrolment, Resumed, Surroundings, Vitals, WorkerHandle, utc_text
from app.trial import CycleStart, TrialView
from app.trial_values import TrialSetup
from app.worker_messages import (
    Begin,
    Failed,
    Hands,
    Hold,
    HoldChanged,
    Ready,
    SetView,
    Ticked,
    WorkerCommand,
)
from sim.interface import TICK_S
from study import protocol
from study.design import reading
from study.distractor import DistractorState
from study.protocol import BeginTicks, Event, PauseTicks, ResumeTicks, Session, StartWorker, StopWorker, WorkerKind
from study.quality import judged
from study.records import EventRow, TrialRow
from study.store import Cycle

log = logging.getLogger(__name__)

Source = Literal["participant", "experimenter", "lab", "robot"]
OVERRUN_MS = 50.0
HUNG_AFTER_S = 5.0
"""A worker that reports nothing for this long, while its page is heard, is replaced."""
MAX_SEQ_STEP = 1_000_000
"""Inputs may be numbered with gaps, but one number must not use up all that come after it."""


@dataclass
class _Work:
    """One thing in the queue, with somebody waiting for it, perhaps."""

    kind: Literal["attach", "detach", "message", "report", "exit", "command", "remark", "ping"]
    payload: Any = None
    client: Client | None = None
    done: asyncio.Future[None] | None = field(default=None, repr=False)


class LiveSession:
    """See the module's text.

    Attributes:
        enrolment: what is fixed about the participant.
        session: where the participant is in the study (`study.protocol`).
        vitals: what the experimenter sees.
        view: the trial as it stands, if one is under way.
        held: whether the robot waits for the page's heartbeat.
        scene_port: port of the session's viser server on loopback, while a worker with a scene is up.
        recent: its last ticks and events, for those who look on.
        setup: what the phase's worker was started with, while there is one.
    """

    def __init__(self, enrolment: Enrolment, session: Session, resumed: Resumed, around: Surroundings) -> None:
        self.enrolment = enrolment
        self.session = session
        self.vitals = Vitals(overruns=resumed.overruns, sound=resumed.sound)
        self.view: TrialView | None = None
        self.held = False
        self.scene_port: int | None = None
        self.recent = Recent(resumed.events)
        self.setup: TrialSetup | None = None
        self._around = around
        self._audience = Audience(enrolment, around)
        self._distractor = resumed.distractor
        self._tick: int | None = resumed.tick
        self._trial_s = 0.0 if resumed.tick is None else (resumed.tick + 1) * TICK_S
        self._next_tick_unix_s = 0.0
        self._last_seq = resumed.last_seq
        self._world: World | None = None
        self._panel_link: str | None = None
        self._worker: WorkerHandle | None = None
        self._worker_epoch = 0
        self._worker_ready = False
        self._restarts = 0
        self._heard_s = self._heard_since_s = self._reported_s = 0.0
        self._left_s = around.now_unix_s()
        self._noticed: list[EventRow] = []
        self._queue: asyncio.Queue[_Work] = asyncio.Queue()
        self._task: asyncio.Task[None] | None = None
        self._ping = 0
        self._pinged_s = 0.0

    # ---- what the lab and the server call -----------------------------------------------------------------------

    async def open(self) -> None:
        """Start dealing with the queue, and bring back what a restart of the lab interrupted."""
        before = self.session
        self.session, effects = protocol.restore(before, self._around.now_unix_s())
        if self.session != before:
            event = self._event("lab_restarted", "lab", {"state": before.state})
            await self._commit(session=self.session, events=(event,))
        self._task = asyncio.create_task(self._run(), name=f"session {self.enrolment.participant}")
        await self._carry_out(effects)

    async def close(self) -> None:
        """Stop the worker and the queue. What is stored stays."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        while not self._queue.empty():
            waiting = self._queue.get_nowait().done
            if waiting is not None:
                waiting.cancel()
        await self._stop_worker()
        self._audience.end()

    def attach(self, client: Client) -> None:
        """A page connected and said hello."""
        self._queue.put_nowait(_Work("attach", client=client))

    def detach(self, client: Client) -> None:
        """A page is gone."""
        self._queue.put_nowait(_Work("detach", client=client))

    def receive(self, client: Client, message: Message) -> None:
        """A page sent a message. The state of the hands does not wait in the queue."""
        if isinstance(message, (Input, Heartbeat)):
            self._on_hands(client, message)
        else:
            self._queue.put_nowait(_Work("message", message, client))

    async def command(self, event: Event, by: str) -> None:
        """An experimenter's pause, resume or abort. Raises `study.protocol.IllegalEvent`."""
        done: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._queue.put_nowait(_Work("command", (event, by), done=done))
        await done

    async def remark(self, remark: Remark, by: str) -> None:
        """An experimenter's note, mark or message. Raises `app.remarks.NotNow`."""
        done: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._queue.put_nowait(_Work("remark", (remark, by), done=done))
        await done

    def probe(self) -> None:
        """Ask the page for a sign of life, to measure the round trip."""
        self._queue.put_nowait(_Work("ping"))

    @property
    def trial_s(self) -> float | None:
        """Trial time at the end of the last tick; None when no worker is needed."""
        return self._trial_s if self.session.worker else None

    @property
    def labels(self) -> pages.Labels:
        """The words for objects and bins."""
        return self._around.labels

    @property
    def connected(self) -> bool:
        """Whether the participant's page is connected."""
        return self._audience.participant is not None

    def expect(self) -> None:
        """Somebody is about to connect."""
        self._left_s = self._around.now_unix_s()

    def deserted(self, for_s: float) -> bool:
        """Whether nobody has been connected for so long. It can then be closed: it is brought back where it was."""
        alone = not self.connected and not self.panel_connected and self._queue.empty()
        return alone and self._around.now_unix_s() - self._left_s > for_s

    @property
    def panel_connected(self) -> bool:
        """Whether the second device is connected."""
        return self._audience.panel is not None

    # ---- the queue ----------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        handlers: Mapping[str, Callable[[_Work], Any]] = {
            "attach": self._on_attach,
            "detach": self._on_detach,
            "message": self._on_message,
            "report": self._on_report,
            "exit": self._on_worker_exit,
            "command": self._on_command,
            "remark": self._on_remark,
            "ping": self._on_ping,
        }
        while True:
            work = await self._queue.get()
            try:
                await handlers[work.kind](work)
                if work.done is not None and not work.done.done():
                    work.done.set_result(None)
            except Exception as error:
                self._could_not(work, error)
            self._around.changed(self.enrolment.participant)

    def _could_not(self, work: _Work, error: Exception) -> None:
        """Something went wrong with one piece of work; the session goes on with the next."""
        if work.done is not None:
            if not work.done.done():
                work.done.set_exception(error)
            return
        log.error("session %s: %s failed", self.enrolment.participant, work.kind, exc_info=error)
        if work.client is not None:
            text = "the lab could not deal with this; nothing was lost, please try again"
            refuse(work.client, "internal", None, text, getattr(work.payload, "id", None))
        if work.kind == "report" and work.payload[0] == self._worker_epoch and self._worker is not None:
            # A tick that is not on disk did not happen: the worker is ended and the next one starts from the record.
            self._worker_ready = False
            self._worker.kill()

    # ---- connections --------------------------------------------------------------------------------------------

    async def _on_attach(self, work: _Work) -> None:
        client = _present(work.client)
        previous = self._audience.join(client)
        kind = "tab_taken_over" if previous is not None else "connected"
        await self._commit(events=(self._event(kind, "participant", {"role": client.role, "client": client.name}),))
        if self._around.study.distractor.placement == "second_device" and self._panel_link is None:
            self._panel_link = await self._around.panel_link()
        self._audience.welcome(client, self._last_seq)
        client.deliver(self._page() if client.role == "participant" else panel_page(self.session))
        status = self._status()
        if status is not None:
            client.deliver(status)
        self._audience.show_world(self._world)
        self._audience.show_cover(self._distractor, self._trial_s)

    async def _on_detach(self, work: _Work) -> None:
        client = _present(work.client)
        if not self._audience.leave(client):
            return
        self._left_s = self._around.now_unix_s()
        event = self._event("disconnected", "participant", {"role": client.role, "client": client.name})
        if client.role == "participant" and not self.session.is_over:
            await self._advance(Event("connection_lost"), events=(event,))
        else:
            await self._commit(events=(event,))

    async def _on_ping(self, work: _Work) -> None:
        client = self._audience.participant
        if client is not None:
            self._ping, self._pinged_s = self._ping + 1, self._around.now_unix_s()
            client.deliver(Ping(n=self._ping))

    # ---- hands --------------------------------------------------------------------------------------------------

    def _on_hands(self, client: Client, message: Input | Heartbeat) -> None:
        if self._audience.holds(client):
            self._heard()
        if client.role != "participant":
            refuse(client, "illegal", "type", "the second device does not drive the robot")
        elif not self._audience.holds(client):
            pass  # taken over, or not let in yet: the page says its state again with the next heartbeat
        elif isinstance(message, Heartbeat):
            self.recent.heard(self._around.now_unix_s())
            before = replace(self.vitals)
            self.vitals.visible, self.vitals.focused = message.visible, message.focused
            self.vitals.device = message.device
            if message.focused != before.focused and before.focused is not None:
                self._notice("focus_back" if message.focused else "focus_lost", "participant", {})
            if self.vitals != before:
                self._around.changed(self.enrolment.participant)
            if self.enrolment.pace == "real_time":
                # It repeats an input, so it cannot be ahead of the last one: that one was lost with the connection.
                seq = min(message.seq, self._last_seq)
                self._send_worker(Hands(seq, None if self._is_away() else message.direction, beat=True))
        elif not self._last_seq < message.seq <= self._last_seq + MAX_SEQ_STEP:
            text = (
                f"seq {message.seq} does not follow {self._last_seq}, the last one taken "
                f"(at most {MAX_SEQ_STEP} may be left out); it was ignored"
            )
            refuse(client, "out_of_order", "seq", text)
        else:
            self.recent.heard(self._around.now_unix_s())
            self._last_seq = message.seq
            self._on_input(client, message)

    def _on_input(self, client: Client, message: Input) -> None:
        if self.enrolment.pace == "lockstep" and not (self.session.is_ticking and self._worker_ready):
            text = f"no tick can run in state {self.session.state!r} now; the input was ignored"
            refuse(client, "illegal", "type", text)
            return
        direction, pressed = (None, None) if self._is_away() else (message.direction, message.gripper)
        self._send_worker(Hands(message.seq, direction, pressed))

    def _is_away(self) -> bool:
        """Whether the pad is ignored in the tick that the hands of this moment are for.

        In lockstep that is the tick about to run. In real time it is the one after the running tick, and a busy
        machine leaves open which of two that is: the pad counts only if both are free. So not even the first tick of
        a reading is driven, and the hands are never free too early (half a second too late at most).
        """
        if self.session.place != "trial":
            return False
        starts_s = [self._trial_s]
        is_paced = self.enrolment.pace == "real_time" and self.session.is_ticking and not self.held
        # A tick is reported when its last slice is done, a little before the next one starts.
        if is_paced and self._around.now_unix_s() >= self._next_tick_unix_s:
            starts_s.append(self._trial_s + TICK_S)
        ahead = [(start_s, self._distractor.advance(start_s, lambda number: "")[0]) for start_s in starts_s]
        return any(distractor.locked(start_s) for start_s, distractor in ahead)

    # ---- messages -----------------------------------------------------------------------------------------------

    async def _on_message(self, work: _Work) -> None:
        client, message = _present(work.client), work.payload
        if not self._audience.holds(client):
            return  # taken over: it has been told, and its socket is about to close
        if isinstance(message, Submit):
            await self._on_submit(client, message)
        elif isinstance(message, Note):
            data = {**message.data, "role": client.role}
            event = self._event(message.name, "participant", data)
            await self._commit(submission=message.id, events=(event,))
            acknowledge(client, message.id)
        elif isinstance(message, View):
            if client.role != "participant":
                refuse(client, "illegal", "type", "the second device shows no robot")
                return
            if message.name not in dict(pages.VIEWS):
                refuse(client, "invalid", "name", f"no view {message.name!r}; there are {list(dict(pages.VIEWS))}")
                return
            self._send_worker(SetView(message.name))
            await self._commit(events=(self._event("view", "participant", {"name": message.name}),))
        elif isinstance(message, Pong) and message.n == self._ping:
            self.vitals.round_trip_ms = (self._around.now_unix_s() - self._pinged_s) * 1000.0
            self._notice("round_trip", "lab", {"ms": round(self.vitals.round_trip_ms, 1)})

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
                data = {"step": message.step, "fields": [place for place, _ in refused.problems]}
                event = self._event("answers_not_right", "participant", data)
                response = {"code": refused.code, "problems": refused.problems}
                await self._commit(submission=message.id, response=response, answers=refused.kept, events=(event,))
            for place, text in refused.problems:
                refuse(client, refused.code, place, text, message.id)
        except protocol.IllegalEvent as illegal:
            refuse(client, "illegal", "step", str(illegal), message.id)
            client.deliver(self._page())

    @staticmethod
    def _answer_again(client: Client, identifier: str, response: Mapping[str, Any]) -> None:
        """A resend of something already dealt with gets the same answer."""
        for place, text in response.get("problems", ()):
            refuse(client, response["code"], place, text, identifier)
        if not response.get("problems"):
            acknowledge(client, identifier)

    async def _on_step(self, client: Client, message: Submit) -> None:
        condition = self.enrolment.plan.trial(self.session.trial).condition
        context = StepContext(self._around.study, self.session, condition, self._around.now_utc())
        outcome = STEPS[message.step](context, message.data)
        events = (self._event(f"step_{message.step}", "participant", dict(outcome.log or {})),)
        if message.step == "help":
            self.vitals.help_wanted = True
        elif message.step == "setup":
            self.vitals.sound = bool(message.data.get("sound"))
        if outcome.event is None:
            await self._commit(submission=message.id, events=events, private=outcome.private)
            acknowledge(client, message.id)
            return
        if message.step == "start" and self.session.state == "trial_ready" and self._lacks_panel():
            text = "The second device is not connected. Open its link there first, and press its button."
            raise Refused("illegal", ("panel", text))
        if message.step == "start" and self.session.worker and not self._worker_ready:
            raise Refused("illegal", ("step", "the robot is not ready yet"))
        await self._advance(
            outcome.event,
            events=events,
            submission=message.id,
            answers=outcome.answers,
            private=outcome.private,
            consent=(context.utc, outcome.consent_hash) if outcome.consent_hash else None,
            on_disk=lambda: acknowledge(client, message.id),
        )

    def _lacks_panel(self) -> bool:
        """Whether readings would appear on a second device that nobody has opened."""
        distractor = self._around.study.distractor
        return distractor.enabled and distractor.placement == "second_device" and not self.panel_connected

    async def _on_alert_step(self, client: Client, message: Submit) -> None:
        placement = self._around.study.distractor.placement
        if client.role != ("panel" if placement == "second_device" else "participant"):
            raise Refused("illegal", ("step", f"in this study readings are shown and logged on: {placement}"))
        data, utc = parse(AlertData, message.data), self._around.now_utc()
        if self._distractor.alert(data.alert) is None and not self.session.is_ticking:
            # The trial ended while this was on its way: nobody did anything wrong.
            late = self._event(f"{message.step}_too_late", "participant", data.model_dump())
            await self._commit(submission=message.id, events=(late,))
            acknowledge(client, message.id)
            return
        if self._distractor.alert(data.alert) is None:
            raise Refused("invalid", ("data.alert", f"no reading {data.alert} has been shown in this trial"))
        events: tuple[EventRow, ...] = ()
        if message.step == "alert_shown":
            self._distractor = self._distractor.shown(data.alert, utc)
        elif message.step == "alert_heard":
            self._distractor = self._distractor.heard(data.alert, utc)
        else:
            after, result = self._distractor.answer(data.alert, data.value or "", self._trial_s, utc)
            if result == "empty":
                raise Refused("invalid", ("data.value", "Please type the reading."))
            self._distractor = after
            answer = {"alert": data.alert, "result": result, "value": data.value}
            events = (self._event("alert_answer", "participant", answer),)
        await self._commit(submission=message.id, alerts=(data.alert,), events=events)
        acknowledge(client, message.id)
        if events:
            self._audience.show_reading(self._distractor.alert(data.alert), self._distractor, self._trial_s)

    # ---- the experimenter ---------------------------------------------------------------------------------------

    async def _on_command(self, work: _Work) -> None:
        event, by = work.payload
        data = {"by": by, "reason": event.reason}
        await self._advance(event, events=(self._event(event.name, "experimenter", data),))

    async def _on_remark(self, work: _Work) -> None:
        remark, by = work.payload
        refuse_unless(remark.kind, self.session, self.connected, self.vitals.help_wanted)
        view = self.view
        task = {"task": view.done_tasks + 1, "kind": view.kind} if view and remark.kind == "task_marked" else {}
        await self._commit(events=(self._event(remark.kind, "experimenter", {"by": by, "text": remark.text, **task}),))
        if remark.kind == "message":
            self._audience.show_notice(remark.text)
        elif remark.kind == "help_seen":
            self.vitals.help_wanted = False

    # ---- the worker ---------------------------------------------------------------------------------------------

    async def _on_report(self, work: _Work) -> None:
        epoch, report = work.payload
        self._reported_s = self._around.now_unix_s()
        if epoch != self._worker_epoch or (isinstance(report, Ticked) and not self._worker_ready):
            return  # of a worker that has been stopped, or is being replaced
        if isinstance(report, Ready):
            await self._on_ready(report)
        elif isinstance(report, Ticked):
            before = self._tick, self._trial_s, self._distractor, self.view, self._world
            try:
                await self._on_ticked(report)
            except Exception:
                self._tick, self._trial_s, self._distractor, self.view, self._world = before
                raise
        elif isinstance(report, HoldChanged):
            if not self.session.is_ticking:
                return  # of the moment before a pause, which says more
            self.held = report.held
            kind = "robot_held" if report.held else "robot_released"
            await self._commit(events=(self._event(kind, "lab", {}),))
            self._audience.show_status(self._status())
        elif isinstance(report, Failed):
            await self._commit(events=(self._event("worker_failed", "lab", {"reason": report.reason}),))

    async def _on_ready(self, report: Ready) -> None:
        self._worker_ready, self.view, self.scene_port = True, report.view, report.scene_port
        self._world = World(**vars(report.sight))
        if report.mismatch is not None:
            event = self._event("replay_mismatch", "robot", {"tick": report.mismatch})
            await self._commit(events=(event,))
        if report.finished:
            await self._phase_done(())
            return
        if self.session.is_ticking:
            self._send_worker(Begin())
        self._audience.show_page(self._page(), self.session)
        self._audience.show_world(self._world)
        self._audience.show_status(self._status())

    async def _on_ticked(self, report: Ticked) -> None:
        """Record a tick with everything that happened in it, then show it."""
        result, practice = report.result, self.session.place == "practice"
        row = replace(result.row, started_utc=utc_text(report.started_unix_s), late_ms=report.late_ms)
        labels = self._around.labels
        before = pages.instruction(self.view, labels, practice) if self.view else None
        self._tick, self._trial_s, self.view = row.tick, (row.tick + 1) * TICK_S, result.view
        self._next_tick_unix_s = report.started_unix_s - (report.late_ms or 0.0) / 1000.0 + TICK_S
        self._world = World(**vars(report.sight))
        events = [self._event(event.kind, "robot", dict(event.data)) for event in result.events]
        if report.missed or (report.late_ms or 0.0) > OVERRUN_MS:
            self.vitals.overruns += 1
            events.append(self._event("overrun", "lab", {"late_ms": report.late_ms, "missed": report.missed}))
        noticed = tuple(self._noticed)
        events = [*noticed, *events]
        changed = () if practice else self._advance_distractor(result.finished)
        rows: dict[str, Any] = {
            "ticks": () if practice else (row,),
            "practice_ticks": (row,) if practice else (),
            "tasks": () if practice else result.tasks,
            "alerts": [item.alert for item in changed],
            "cycle": result.cycle_start,
        }
        show = self._around.study.show_assistance
        tick = pages.tick_message(result, report.seq, before, labels, practice, show)

        def show_all() -> None:
            self._audience.show_world(self._world)
            self._audience.show_tick(tick)
            for item in changed:
                self._audience.show_reading(item, self._distractor, self._trial_s)

        if result.finished:
            await self._phase_done(tuple(events), on_disk=show_all, **rows)
        else:
            await self._commit(events=events, **rows)
            show_all()
            self.recent.add_tick(row)
        del self._noticed[: len(noticed)]

    def _advance_distractor(self, finished: bool) -> tuple[Any, ...]:
        plan = self.enrolment.plan.trial(self.session.trial)
        self._distractor, changed = self._distractor.advance(self._trial_s, lambda number: reading(plan, number))
        if finished:
            self._distractor, closed = self._distractor.close()
            changed = (*changed, *closed)
        return changed

    async def _phase_done(self, events: tuple[EventRow, ...], **rows: Any) -> None:
        """The practice or the trial is over: its last tick and the step to the next state are one commit."""
        if self.session.place == "practice":
            await self._advance(Event("practice_done"), events=events, **rows)
        else:
            trials = (await self._closed_trial("completed"),)
            await self._advance(Event("trial_done"), events=events, trials=trials, **rows)

    async def _closed_trial(self, outcome: Literal["completed", "aborted"]) -> TrialRow:
        """The row of the trial that ends now, judged by the study's rules."""
        participant, trial = self.enrolment.participant, self.session.trial
        found, stored = await self._around.store.run(
            lambda store: (
                store.rows_of("trials", participant, trial=trial),
                store.rows_of("events", participant, trial=trial),
            )
        )
        row: TrialRow = found[0] if found else self._around.trial_row(trial)
        ended_utc = self._around.now_utc()
        ticks, overruns = 0 if self._tick is None else self._tick + 1, self.vitals.overruns
        row = replace(row, outcome=outcome, ticks=ticks, overruns=overruns, finished_utc=ended_utc)
        expired = sum(alert.status == "expired" for alert in self._distractor.alerts)
        return judged(row, (*stored, *self._noticed), expired, self._around.study.quality)

    async def _on_worker_exit(self, work: _Work) -> None:
        if work.payload != self._worker_epoch or self._worker is None:
            return
        self._worker, self._worker_ready, self.scene_port, self.held = None, False, None, False
        self._restarts += 1
        event = self._event("worker_lost", "lab", {"restarts": self._restarts})
        needed = self.session.worker
        if needed is None or self._restarts > self._around.config.worker_restarts:
            await self._advance(Event("experimenter_pause", "the robot's process keeps ending"), events=(event,))
            return
        await self._commit(events=(event,))
        self._audience.show_status(self._status())
        await self._start_worker(*needed)

    def check_worker(self) -> None:
        """End a worker that has gone silent while its page has not: it hangs, and another takes over from the log."""
        if not (self.session.is_ticking and self._worker_ready and self.enrolment.pace == "real_time"):
            return
        now_s = self._around.now_unix_s()
        page_is_there = now_s - self._heard_s <= HUNG_AFTER_S / 2
        if page_is_there and now_s - max(self._reported_s, self._heard_since_s) > HUNG_AFTER_S and self._worker:
            log.error("session %s: the worker hangs and is ended", self.enrolment.participant)
            self._reported_s = now_s
            self._worker.kill()

    def _heard(self) -> None:
        """The page said something about the hands; silence before starts a new stretch of being heard."""
        now_s = self._around.now_unix_s()
        if now_s - self._heard_s > HUNG_AFTER_S / 2:
            self._heard_since_s = now_s
        self._heard_s = now_s

    async def _start_worker(self, kind: WorkerKind, trial: int) -> None:
        self._worker_epoch += 1
        epoch = self._worker_epoch
        self._worker_ready, self.scene_port = False, None
        spec = await self._around.make_spec(kind, trial)
        self.setup = spec.setup
        self._worker = self._around.start_worker(
            spec,
            lambda report: self._queue.put_nowait(_Work("report", (epoch, report))),
            lambda: self._queue.put_nowait(_Work("exit", epoch)),
        )

    async def _stop_worker(self) -> None:
        """End the worker and forget the phase it ran."""
        worker, self._worker = self._worker, None
        self._worker_epoch += 1
        self._worker_ready, self.scene_port, self.held, self._restarts = False, None, False, 0
        self.view, self._world, self._tick, self._trial_s = None, None, None, 0.0
        self._noticed.clear()
        self.setup = None
        self.recent.forget_ticks()
        self._distractor = DistractorState(self._around.study.distractor)
        if worker is not None:
            await worker.stop()

    def _send_worker(self, command: WorkerCommand) -> None:
        if self._worker is not None and self._worker_ready:
            self._worker.send(command)

    # ---- the protocol -------------------------------------------------------------------------------------------

    async def _advance(
        self,
        event: Event,
        events: tuple[EventRow, ...] = (),
        on_disk: Callable[[], None] = lambda: None,
        **rows: Any,
    ) -> None:
        """Take an event of the protocol: commit, call `on_disk`, carry out its effects, show the new page."""
        before = self.session
        after, effects = protocol.advance(before, event, self._around.now_unix_s())
        if after != before:
            data = {"event": event.name, "from": before.state, "to": after.state, "reason": event.reason}
            events = (*events, self._event("state", "lab", data))
        if after.is_over:
            rows["finished_utc"] = self._around.now_utc()
            if before.place == "trial":
                rows["trials"] = (await self._closed_trial("aborted"),)
                self._distractor, closed = self._distractor.close()
                rows["alerts"] = [item.alert for item in closed]
        elif after.state == "trial" and any(isinstance(effect, BeginTicks) for effect in effects):
            self.vitals.overruns = 0
            rows["trials"] = (replace(self._around.trial_row(after.trial), started_utc=self._around.now_utc()),)
        await self._commit(session=after, events=events, **rows)
        self.session = after
        on_disk()
        await self._carry_out(effects)
        if after.worker and after.state != "paused" and self._worker is None:
            await self._replace_worker(*after.worker)
        if after != before:
            self._audience.show_page(self._page(), after)
            self._audience.show_status(self._status())

    async def _replace_worker(self, kind: WorkerKind, trial: int) -> None:
        """Another try after the experimenter let a session go on whose worker had ended too often."""
        self._restarts = 0
        await self._start_worker(kind, trial)

    async def _carry_out(self, effects: tuple[protocol.Effect, ...]) -> None:
        for effect in effects:
            if isinstance(effect, StartWorker):
                await self._start_worker(effect.kind, effect.trial)
            elif isinstance(effect, StopWorker):
                await self._stop_worker()
            elif isinstance(effect, PauseTicks):
                self.held = False
                self._send_worker(Hold())
            elif isinstance(effect, (BeginTicks, ResumeTicks)):
                self._send_worker(Begin())  # one that is not up yet begins when it is

    # ---- the record ---------------------------------------------------------------------------------------------

    async def _commit(
        self,
        *,
        alerts: Iterable[int] = (),
        cycle: CycleStart | None = None,
        submission: str | None = None,
        response: Mapping[str, Any] | None = None,
        private: Iterable[tuple[str, str]] = (),
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
        apart = [(participant, kind, text) for kind, text in private]
        sent = (participant, submission, dict(response or {})) if submission else None
        await self._around.store.run(
            lambda store: store.commit(alerts=alert_rows, cycles=cycles, submission=sent, identities=apart, **rows)
        )
        self.recent.add_events(event for event in rows.get("events", ()) if event.kind != "round_trip")

    def _notice(self, kind: str, source: Source, data: Mapping[str, Any]) -> None:
        """Keep what is measured during a trial; it goes to disk with the next tick."""
        if self.session.state == "trial":
            self._noticed.append(self._event(kind, source, data))

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
        if self.view is not None:
            shown = pages.instruction(self.view, self._around.labels, practice)
        scene_path = f"/s/{self.enrolment.public_id}/scene/"
        context = PageContext(self._around.study, scene_path, self._panel_link, shown, self._worker_ready)
        return pages.page(self.session, context)

    def _status(self) -> Status | None:
        if self.session.worker is None:
            return None
        if self.session.state == "paused":
            return Status(status="paused", reason=", ".join(sorted(self.session.causes)))
        if not self._worker_ready:
            return Status(status="recovering" if self._restarts else "starting")
        if not self.session.is_ticking:
            return Status(status="ready")
        return Status(status="held" if self.held else "running")


def _present(client: Client | None) -> Client:
    assert client is not None  # by the kind of work
    return client
