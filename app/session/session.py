"""One participant's live session: their pages, their worker, their distractor and their record, kept in step.

Everything that happens comes through one queue and is dealt with one at a time, so there is one order of events and it
is the order in the log. The only thing that does not queue is the state of the hands: it goes straight to the worker,
which takes the newest (see `app.worker.input_latch`).

    page ── submit/note ──►┐                                  ┌──► store (committed first)
    worker ── reports ────►├─► queue ─► one at a time ─► ... ─┼──► worker commands (effects of the protocol)
    experimenter ─────────►┘                                  └──► pages (after the commit)

`context` is what the parts share, `transitions` moves the session on, `submissions` takes what the pages hand in,
`worker_link` is the line to the worker. Here are the queue, the connections, the hands and the experimenter.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from app.monitoring.log_lines import about
from app.session import pages
from app.session.commands import EVENTS, CannotSave, Circumstances, Command, NotNow, Remark, refuse_unless
from app.session.connections import Connections, panel_page, refuse
from app.session.context import SessionContext
from app.session.hands import Hands
from app.session.history import History
from app.session.interfaces import Client, Enrolment, LabServices, Resumed, Vitals
from app.session.private_text import apart
from app.session.round_trips import RoundTrips
from app.session.running_trial import RunningTrial
from app.session.saving import Saving
from app.session.spectators import Spectators
from app.session.submissions import Submissions
from app.session.transitions import Transitions
from app.session.worker_link import WorkerLink
from app.trial.labels import Labels
from app.trial.values import TrialSetup, TrialView
from app.wire import Heartbeat, Input, Message, Pong
from app.worker.messages import WorkerReport
from study.flow.protocol import Event, Session
from study.store import Batch, Trouble

log = logging.getLogger(__name__)


@dataclass
class _Work:
    """One thing in the queue, with somebody waiting for it, perhaps."""

    kind: Literal["restore", "settle", "attach", "detach", "message", "report", "exit", "command", "remark", "ping"]
    payload: Any = None
    client: Client | None = None
    dealt: Callable[[], None] | None = field(default=None, repr=False)
    """Called when it has been dealt with, or has come to nothing."""
    done: asyncio.Future[None] | None = field(default=None, repr=False)


class LiveSession:
    """See the module's text."""

    def __init__(self, enrolment: Enrolment, session: Session, resumed: Resumed, services: LabServices) -> None:
        self.enrolment = enrolment
        self._services = services
        self._queue: asyncio.Queue[_Work] = asyncio.Queue()
        self._connections = Connections(enrolment, services)
        self._link = WorkerLink(services, enrolment.participant, self._on_worker_report, self._on_worker_exit)
        self._context = SessionContext(
            enrolment=enrolment,
            services=services,
            session=session,
            vitals=Vitals(
                overruns=resumed.overruns, frees=resumed.frees, sound=resumed.sound, help=resumed.help_wanted
            ),
            connections=self._connections,
            link=self._link,
            spectators=Spectators(self._link),
            running=RunningTrial.resumed(resumed.distractor, resumed.tick, resumed.freed_by),
            history=History(resumed.events),
            round_trips=RoundTrips(services.now_unix_s),
            saving=Saving(services.store, services.config.unsaved_pause_s, self._on_saving),
            last_seq=resumed.last_seq,
        )
        self._transitions = Transitions(self._context)
        self._hands = Hands(self._context)
        self._submissions = Submissions(self._context, self._transitions)
        self._task: asyncio.Task[None] | None = None
        self._promised: set[asyncio.Future[None]] = set()
        self._settling = False
        self._left_s = services.now_unix_s()
        self._panel_name = ""

    # ---- what the lab and the server call -----------------------------------------------------------------------

    async def open(self) -> None:
        """Start dealing with the queue, first with what a restart of the lab interrupted: that is brought back when
        this returns, unless the lab cannot save now."""
        self._task = asyncio.create_task(self._run(), name=f"session {self.enrolment.participant}")
        work = _Work("restore")
        if self._context.saving.refuses:
            self._queue.put_nowait(work)
            return
        with contextlib.suppress(NotNow):
            await self._done(work)

    async def close(self) -> None:
        """Stop the worker and the queue. What is stored stays."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        while not self._queue.empty():
            _closed(self._queue.get_nowait())
        self._context.saving.close()
        self._context.spectators.end()
        self._context.forget_running_trial()
        await self._link.stop()
        self._connections.end()

    def attach(self, client: Client) -> None:
        """A page connected and said hello."""
        if not self._context.saving.works:  # it would not hear before the disk does
            client.deliver(self._context.unsaved())
        self._queue.put_nowait(_Work("attach", client=client))

    def detach(self, client: Client) -> None:
        """A page is gone."""
        self._queue.put_nowait(_Work("detach", client=client))

    def receive(self, client: Client, message: Message, dealt: Callable[[], None] | None = None) -> None:
        """A page sent a message. The state of the hands does not wait in the queue. Of the others, `dealt` tells when
        it has been dealt with: whoever reads the page's messages need not read more than fit."""
        if isinstance(message, (Input, Heartbeat)):
            self._hands.on_hands(client, message)
        else:
            self._queue.put_nowait(_Work("message", message, client, dealt))

    async def command(self, command: Command, by: str) -> None:
        """Something an experimenter does with the session. Raises `app.session.commands.NotNow`."""
        await self._done(_Work("command", (command, by)))

    async def remark(self, remark: Remark, by: str) -> None:
        """Something an experimenter says about the session or to its participant. Raises `NotNow`."""
        await self._done(_Work("remark", (remark, by)))

    def probe(self) -> None:
        """Ask the page for a sign of life, to measure the round trip."""
        self._queue.put_nowait(_Work("ping"))

    def look_after(self) -> None:
        """End a worker that hangs, and make up for what went wrong. To be called a few times a second."""
        hangs = self._link.end_if_hung(self.enrolment.pace == "lockstep")
        if hangs is not None:
            self._queue.put_nowait(_Work("report", (self._link.epoch, hangs)))
        if not self._transitions.is_settled:
            self._settle_soon()
        if self._task is not None and self._task.done() and not self._task.cancelled():
            log.error("a session's queue had ended", extra=about(participant=self.enrolment.participant))
            self._task = asyncio.create_task(self._run(), name=f"session {self.enrolment.participant}")

    def excuse_worker(self) -> None:
        """The lab itself did not listen for a while: no worker hangs for that."""
        self._link.excuse()

    def expect(self) -> None:
        """Somebody is about to connect."""
        self._left_s = self._services.now_unix_s()

    def deserted(self, for_s: float) -> bool:
        """Whether nobody has been connected for so long. It can then be closed: it is brought back where it was. While
        the lab cannot save it holds what must not be lost."""
        idle = self._queue.empty() and self._context.saving.trouble is None
        alone = not self.connected and not self.panel_connected and idle
        return alone and self._services.now_unix_s() - self._left_s > for_s

    # ---- what spectators read ------------------------------------------------------------------------------------

    @property
    def session(self) -> Session:
        """Where the participant is in the study."""
        return self._context.session

    @property
    def vitals(self) -> Vitals:
        """How the page is doing."""
        return self._context.vitals

    @property
    def history(self) -> History:
        """The last ticks and events."""
        return self._context.history

    @property
    def circumstances(self) -> Circumstances:
        """What decides what an experimenter can do now."""
        context = self._context
        return Circumstances(
            session=context.session,
            connected=self.connected,
            ready=self._link.ready,
            lacks_panel=context.lacks_panel(),
            lacks_picture=context.vitals.picture is False,
            help_wanted=context.vitals.help is not None,
            flow=context.services.flow,
        )

    @property
    def view(self) -> TrialView | None:
        """The trial as it stands, if one is under way."""
        return self._context.running.view

    @property
    def trial_s(self) -> float | None:
        """Trial time at the end of the last tick; None when no worker is needed."""
        return self._context.running.trial_s if self._context.session.worker else None

    @property
    def signals_per_s(self) -> float:
        """How often the page told of the hands over the last seconds."""
        return self._context.history.signals_per_s(self._services.now_unix_s())

    @property
    def unsaved(self) -> Trouble | None:
        """Why nothing of it can be saved now."""
        return self._context.saving.trouble

    @property
    def problem(self) -> str:
        """What keeps its worker from running, while it is being seen to; "" when nothing does."""
        return "" if self._link.ready else self._link.problem

    @property
    def held(self) -> bool:
        """Whether the robot waits for the page's heartbeat."""
        return self._link.held

    @property
    def scene_port(self) -> int | None:
        """Port of the session's viser server on loopback, while a worker with a scene is up."""
        return self._link.scene_port

    @property
    def spectators(self) -> Spectators:
        """The experimenters who look at it in 3-D."""
        return self._context.spectators

    @property
    def setup(self) -> TrialSetup | None:
        """What the worker was started with, while there is one."""
        return self._link.setup

    @property
    def labels(self) -> Labels:
        """The words for objects and bins."""
        return self._services.labels

    @property
    def queue_length(self) -> int:
        """How much waits to be dealt with."""
        return self._queue.qsize()

    @property
    def unsent(self) -> int:
        """How many messages the slower of its pages has not been sent yet."""
        return self._connections.waiting

    @property
    def has_worker(self) -> bool:
        """Whether there is a process of its own, ready or not."""
        return self._link.is_up

    @property
    def connected(self) -> bool:
        """Whether the participant's page is connected."""
        return self._connections.participant is not None

    @property
    def panel_connected(self) -> bool:
        """Whether the second device is connected."""
        return self._connections.panel is not None

    @property
    def panel_link(self) -> str | None:
        """The second device's link, once one was made."""
        return self._context.panel_link

    # ---- the queue ----------------------------------------------------------------------------------------------

    async def _done(self, work: _Work) -> None:
        """Queue a piece of work and wait until it has been dealt with. Raises `NotNow` when that is not in sight."""
        refuses = self._context.saving.refuses
        if refuses:
            raise CannotSave(refuses)
        work.done = asyncio.get_running_loop().create_future()
        self._promised.add(work.done)
        self._queue.put_nowait(work)
        try:
            await work.done
        finally:
            self._promised.discard(work.done)

    def _on_saving(self) -> None:
        """The lab cannot save, or can again: the robot holds, everybody is told, at once and past the queue."""
        context = self._context
        self._link.ticks(context.may_tick())
        context.connections.show_saves(context.unsaved())
        context.connections.show_status(context.status())
        refuses = context.saving.refuses
        for promised in self._promised if refuses else ():
            if not promised.done():
                promised.set_exception(CannotSave(f"{refuses} What you asked for is done when it can.", True))
        self._services.changed(self.enrolment.participant)
        self._settle_soon()

    def _settle_soon(self) -> None:
        """At most one piece of work of this kind waits."""
        if not self._settling:
            self._settling = True
            self._queue.put_nowait(_Work("settle"))

    def _on_worker_report(self, epoch: int, report: WorkerReport) -> None:
        self._queue.put_nowait(_Work("report", (epoch, report)))

    def _on_worker_exit(self, epoch: int) -> None:
        self._queue.put_nowait(_Work("exit", epoch))

    async def _run(self) -> None:
        handlers: Mapping[str, Callable[[_Work], Any]] = {
            "restore": lambda work: self._transitions.restore(),
            "settle": self._on_settle,
            "attach": self._on_attach,
            "detach": self._on_detach,
            "message": self._on_message,
            "report": lambda work: self._transitions.on_report(*work.payload),
            "exit": lambda work: self._transitions.on_exit(work.payload),
            "command": self._on_command,
            "remark": self._on_remark,
            "ping": self._on_ping,
        }
        while True:
            work = await self._queue.get()
            try:
                await self._context.note_clock()
                await self._transitions.after_trouble()
                await handlers[work.kind](work)
                await self._transitions.settle()
                if work.done is not None and not work.done.done():
                    work.done.set_result(None)
            except asyncio.CancelledError:
                _closed(work)
                raise
            except Exception as error:
                self._could_not(work, error)
            if work.dealt is not None:
                work.dealt()
            self._services.changed(self.enrolment.participant)

    def _could_not(self, work: _Work, error: Exception) -> None:
        """Something went wrong with one piece of work; the session goes on with the next."""
        if work.done is not None:
            if not work.done.done():
                work.done.set_exception(error)
            return
        fields = about(participant=self.enrolment.participant, work=work.kind)
        log.error("a piece of a session's work failed", exc_info=error, extra=fields)
        if work.kind == "attach" and work.client is not None:
            work.client.end()  # it comes back; otherwise it would wait for its page
        if work.client is not None:
            text = "the lab could not deal with this; nothing was lost, please try again"
            refuse(work.client, "internal", None, text, getattr(work.payload, "id", None))
        if work.kind == "report":
            self._transitions.report_failed(work.payload[0], f"{type(error).__name__}: {error}")

    # ---- connections --------------------------------------------------------------------------------------------

    async def _on_settle(self, work: _Work) -> None:
        self._settling = False

    async def _on_attach(self, work: _Work) -> None:
        client, context = _present(work.client), self._context
        previous = self._connections.join(client)
        kind = "tab_taken_over" if previous is not None else "connected"
        event = context.event(kind, "participant", {"role": client.role, "client": client.name})
        await context.commit(Batch(events=(event,)))
        if self._services.study.distractor.placement == "second_device" and context.panel_link is None:
            context.panel_link = await self._services.panel_link()
        self._connections.welcome(client, context.last_seq)
        client.deliver(context.unsaved())
        client.deliver(context.page() if client.role == "participant" else panel_page(context.session))
        if client.role == "panel" and client.name != self._panel_name:
            self._panel_name, context.vitals.panel_heard = client.name, None  # another device
        self._connections.show_panel(context.vitals.panel_heard)
        if client.role == "participant":
            context.vitals.picture = None  # of the page before
            context.measure()
        status = context.status()
        if status is not None:
            client.deliver(status)
        self._connections.show_world(context.running.world)
        self._connections.show_cover(context.running.distractor, context.running.trial_s)

    async def _on_detach(self, work: _Work) -> None:
        client, context = _present(work.client), self._context
        if not self._connections.leave(client):
            return
        self._left_s = self._services.now_unix_s()
        self._connections.show_panel(context.vitals.panel_heard)
        event = context.event("disconnected", "participant", {"role": client.role, "client": client.name})
        if client.role == "participant" and not context.session.is_over:
            await self._transitions.advance(Event("connection_lost"), Batch(events=(event,)))
        else:
            await context.commit(Batch(events=(event,)))

    async def _on_ping(self, work: _Work) -> None:
        client = self._connections.participant
        if client is not None:
            self._context.round_trips.probe(client)

    async def _on_message(self, work: _Work) -> None:
        client, message = _present(work.client), work.payload
        if not self._connections.holds(client):
            return  # taken over: it has been told, and its socket is about to close
        if not isinstance(message, Pong):
            await self._submissions.on_message(client, message)
        elif client.role == "participant":
            round_trip_ms = self._context.round_trips.answered(client, message)
            if round_trip_ms is not None:
                self.vitals.round_trip_ms = round_trip_ms
                self._context.notice("round_trip", "lab", {"ms": round(round_trip_ms, 1)})

    # ---- the experimenter ---------------------------------------------------------------------------------------

    async def _on_command(self, work: _Work) -> None:
        command, by = work.payload
        refuse_unless(command.name, self.circumstances)
        kind = EVENTS.get(command.name, command.name)
        data, private = apart(kind, command.words)
        event = self._context.event(kind, "experimenter", {"by": by, **data})
        batch = Batch(events=(event,), identities=self._context.identities(private))
        if command.name == "free_arm":
            await self._transitions.free("experimenter", batch)
            return
        await self._transitions.advance(Event(kind), batch)
        if command.name == "abort_trial":
            self._connections.show_notice(self._services.study.words.t(pages.ENDED_EARLY))
        self._context.measure()

    async def _on_remark(self, work: _Work) -> None:
        remark, by = work.payload
        context, view = self._context, self.view
        refuse_unless(remark.name, self.circumstances)
        task = {"task": view.done_tasks + 1, "kind": view.kind} if view and remark.name == "task_marked" else {}
        data, private = apart(remark.name, remark.text)
        event = context.event(remark.name, "experimenter", {"by": by, **task, **data})
        await context.commit(Batch(events=(event,), identities=context.identities(private)))
        if remark.name == "message":
            self._connections.show_notice(remark.text)
        elif remark.name == "help_seen":
            context.vitals.help = None
            self._connections.show_notice(self._services.study.words.t(pages.HELP_SEEN))


def _closed(work: _Work) -> None:
    """Tell whoever waits for a piece of work that nothing will come of it."""
    if work.done is not None and not work.done.done():
        work.done.set_exception(NotNow("The session was closed in this moment."))


def _present(client: Client | None) -> Client:
    assert client is not None  # by the kind of work
    return client
