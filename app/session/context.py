"""What the parts of a live session share: where the participant stands, who is there, and the one way to the record."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from app.session import pages
from app.session.connections import Connections
from app.session.history import History
from app.session.interfaces import Enrolment, LabServices, Vitals
from app.session.private_text import Private
from app.session.round_trips import RoundTrips
from app.session.running_trial import RunningTrial
from app.session.saving import Saving
from app.session.spectators import Spectators
from app.session.worker_link import WorkerLink
from app.trial.looks import looks_of
from app.trial.values import CycleStart, cycle_to_json
from app.wire import Page, Saves, Status
from study.flow.distractors.state import DistractorState
from study.flow.eligibility import PINGS, Check, checks_of
from study.flow.page import PageContext
from study.flow.protocol import Session
from study.language.words import phrase
from study.records import AlertRow, EventRow, utc_text
from study.store import Batch, Cycle, Identity, Submission

Source = Literal["participant", "experimenter", "lab", "robot"]
UNSAVED = phrase("The lab cannot save at the moment. Nothing is lost. Please wait: it goes on by itself.")
LONG = phrase("The lab has not been able to save for a while. Nothing is lost. Please tell the experimenter.")


@dataclass
class SessionContext:
    """One session, to the parts that act on it (`app.session.session` says who does what).

    `noticed` is what was measured during a trial and not written yet: it goes to disk with the next tick.
    `lacking` is what the last check of the device found wanting. `last_seq` numbers the last input taken. `panel_link`
    is the second device's link, once one was made. `view` is the camera that was chosen. `is_shown`: the pages show
    where the session is.
    """

    enrolment: Enrolment
    services: LabServices
    session: Session
    vitals: Vitals
    connections: Connections
    link: WorkerLink
    spectators: Spectators
    running: RunningTrial
    history: History
    round_trips: RoundTrips
    saving: Saving
    lacking: tuple[Check, ...] = ()
    last_seq: int = 0
    panel_link: str | None = None
    view: str | None = None
    is_shown: bool = True
    noticed: list[EventRow] = field(default_factory=list)

    # ---- the record ---------------------------------------------------------------------------------------------

    async def commit(self, batch: Batch) -> None:
        """Write one batch; it is on disk when this returns, however long the disk takes."""
        began_s = time.perf_counter()
        await self.services.store.commit(batch)
        self.services.metrics.committed(time.perf_counter() - began_s)
        self.history.add_events(event for event in batch.events if event.kind != "round_trip")

    async def note_clock(self) -> None:
        """An event where the computer's clock was set; the session's own goes on."""
        by_s = self.services.clock.jump_s()
        if by_s is not None:
            await self.commit(Batch(events=(self.event("clock_set", "lab", {"by_s": round(by_s, 3)}),)))

    def alert_rows(self, numbers: Iterable[int]) -> tuple[AlertRow, ...]:
        """The rows of these alerts of the trial as they stand."""
        participant, trial, distractor = self.enrolment.participant, self.session.trial, self.running.distractor
        if distractor.practice:
            return ()  # a practice's readings stand in no table
        condition = self.enrolment.plan.trial(trial).condition
        found = [distractor.alert(number) for number in dict.fromkeys(numbers)]
        return tuple(distractor.row(alert, participant, condition, trial) for alert in found if alert)

    def cycle_rows(self, start: CycleStart | None, practice: bool) -> tuple[Cycle, ...]:
        """The start of a cycle of the practice, or the trial, for the store."""
        if start is None:
            return ()
        return (Cycle(self.enrolment.participant, self.session.trial, practice, start.cycle, cycle_to_json(start)),)

    def submission(self, message_id: str, response: Mapping[str, Any] | None = None) -> Submission:
        """The message that caused a batch, and what a resend of it is answered with."""
        return Submission(self.enrolment.participant, message_id, dict(response or {}))

    def identities(self, private: Private) -> tuple[Identity, ...]:
        """Words that no export holds (see `app.session.private_text`), for the store."""
        return tuple(Identity(self.enrolment.participant, kind, text) for kind, text in private)

    def event(self, kind: str, source: Source, data: Mapping[str, Any]) -> EventRow:
        """A row about this moment."""
        in_trial = self.session.worker is not None
        return EventRow(
            participant=self.enrolment.participant,
            trial=self.session.trial if in_trial else None,
            tick=self.running.tick if in_trial else None,
            utc=utc_text(self.services.now_unix_s()),
            kind=kind,
            source=source,
            data=json.dumps(dict(data), default=str),
        )

    def notice(self, kind: str, source: Source, data: Mapping[str, Any]) -> None:
        """Keep what is measured during a trial; it goes to disk with the next tick."""
        if self.session.state == "trial":
            self.noticed.append(self.event(kind, source, data))

    # ---- the practice or trial under way ---------------------------------------------------------------------------

    def forget_running_trial(self) -> None:
        """Forget the practice or trial under way: its alerts, its ticks, what was noticed, the camera."""
        self.running = RunningTrial(DistractorState(self.services.distractor))
        self.noticed.clear()
        self.vitals.frees = 0
        self.history.forget_ticks()
        self.view = None

    @property
    def has_scene(self) -> bool:
        """Whether the robot is drawn: without a scene nobody misses its picture."""
        return self.services.config.scene and self.enrolment.pace == "real_time"

    def lacks_panel(self) -> bool:
        """Whether a practice or a trial is next or under way, its alerts on a second device that is not there."""
        on_panel = self.services.study.distractor.on_second_device
        drives = self.session.place in ("practice_ready", "practice", "trial_ready", "trial")
        return drives and on_panel and self.connections.panel is None

    def is_away(self) -> bool:
        """Whether an alert keeps the hands off the pad."""
        if self.session.place not in ("practice", "trial"):
            return False
        paced = self.enrolment.pace == "real_time" and self.session.is_ticking and not self.link.held
        return self.running.is_away(self.services.now_unix_s(), paced)

    # ---- what the pages get -------------------------------------------------------------------------------------

    def page(self) -> Page:
        """The participant's page."""
        practice = self.session.place in ("practice_ready", "practice")
        view, words = self.running.view, self.services.study.words
        shown = pages.instruction(view, self.services.labels, practice, words) if view is not None else None
        context = PageContext(
            study=self.services.study,
            scene_path=f"/s/{self.enrolment.public_id}/scene/" if self.has_scene else "",
            panel_link=self.panel_link,
            instruction=shown.model_dump() if shown else None,
            worker_ready=self.link.ready,
            views=tuple((name, words.t(label)) for name, label in pages.VIEWS),
            public_id=self.enrolment.public_id,
            ids=self.enrolment.ids,
            looks=looks_of(self.services.study),
        )
        return pages.page(self.session, context, self.services.flow)

    def measure(self) -> None:
        """Measure the round trip of a page whose device is being checked, if the study asks for it."""
        client = self.connections.participant
        is_asked = "round_trip" in checks_of(self.services.study.eligibility)
        if client is not None and self.session.state == "eligibility" and is_asked:
            self.round_trips.measure(client, PINGS)

    def status(self) -> Status | None:
        """Whether ticks run, and if not, why; None when no robot is needed."""
        if self.session.worker is None:
            return None
        if self.session.state == "paused":
            return Status(status="paused", reason=", ".join(sorted(self.session.causes)))
        if not self.link.ready:
            return Status(status="recovering" if self.link.restarts or self.link.failed_starts else "starting")
        if not self.session.is_ticking:
            return Status(status="ready")
        if not self.saving.works:
            return Status(status="held", reason=self.unsaved().text)
        return Status(status="held" if self.link.held else "running")

    def unsaved(self) -> Saves:
        """Whether what happens can be saved, in words for the participant."""
        words = self.services.study.words
        if self.saving.works:
            return Saves(works=True)
        return Saves(works=False, text=words.t(LONG if self.saving.is_long else UNSAVED))

    def may_tick(self) -> bool:
        """Whether ticks are to run now. In lockstep each waits for its input, which waits for the tick before."""
        saves = self.saving.works or self.enrolment.pace == "lockstep"
        return self.session.is_ticking and saves

    def show_all(self) -> None:
        """The page and the status, to everybody it concerns."""
        self.connections.show_page(self.page(), self.session)
        self.connections.show_status(self.status())
        self.is_shown = True
