"""What the parts of a live session share: where the participant stands, who is there, and the one way to the record."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from app.session import pages
from app.session.connections import Audience
from app.session.history import Recent
from app.session.interfaces import Enrolment, Surroundings, Vitals
from app.session.pages import PageContext
from app.session.private_text import Private
from app.session.round_trips import RoundTrips
from app.session.running_trial import Phase
from app.session.spectators import Onlookers
from app.session.worker_link import WorkerLink
from app.trial.engine import CycleStart
from app.trial.values import cycle_to_json
from app.wire import Instruction, Status
from study.flow.distractor import DistractorState
from study.flow.eligibility import PINGS, Check, checks_of
from study.flow.protocol import Session
from study.records import EventRow, utc_text
from study.store import Cycle

Source = Literal["participant", "experimenter", "lab", "robot"]


@dataclass
class Stage:
    """One session, to the parts that act on it (`app.session.session` says who does what).

    `noticed` is what was measured during a trial and not written yet: it goes to disk with the next tick.
    `lacking` is what the last check of the device found wanting. `last_seq` numbers the last input taken. `panel_link`
    is the second device's link, once one was made.
    """

    enrolment: Enrolment
    around: Surroundings
    session: Session
    vitals: Vitals
    audience: Audience
    link: WorkerLink
    onlookers: Onlookers
    phase: Phase
    recent: Recent
    round_trips: RoundTrips
    lacking: tuple[Check, ...] = ()
    last_seq: int = 0
    panel_link: str | None = None
    noticed: list[EventRow] = field(default_factory=list)

    # ---- the record ---------------------------------------------------------------------------------------------

    async def commit(
        self,
        *,
        alerts: Iterable[int] = (),
        cycle: CycleStart | None = None,
        submission: str | None = None,
        response: Mapping[str, Any] | None = None,
        private: Private = (),
        practice: bool = False,
        **rows: Any,
    ) -> None:
        """Write one batch; it is on disk when this returns. Rows of `alerts` (numbers) are made here.

        `submission` is the message that caused it, `response` what a resend of the same message is answered with.
        `private` are words that no export holds (see `app.session.private_text`), `practice` is what a `cycle`
        belongs to.
        """
        participant, trial, distractor = self.enrolment.participant, self.session.trial, self.phase.distractor
        condition = self.enrolment.plan.trial(trial).condition
        found = [distractor.alert(number) for number in dict.fromkeys(alerts)]
        alert_rows = [distractor.row(alert, participant, condition, trial) for alert in found if alert]
        cycles = [Cycle(participant, trial, practice, cycle.cycle, cycle_to_json(cycle))] if cycle else []
        apart = [(participant, kind, text) for kind, text in private]
        sent = (participant, submission, dict(response or {})) if submission else None
        await self.around.store.run(
            lambda store: store.commit(alerts=alert_rows, cycles=cycles, submission=sent, identities=apart, **rows)
        )
        self.recent.add_events(event for event in rows.get("events", ()) if event.kind != "round_trip")

    def event(self, kind: str, source: Source, data: Mapping[str, Any]) -> EventRow:
        """A row about this moment."""
        in_trial = self.session.worker is not None
        return EventRow(
            participant=self.enrolment.participant,
            trial=self.session.trial if in_trial else None,
            tick=self.phase.tick if in_trial else None,
            utc=utc_text(self.around.now_unix_s()),
            kind=kind,
            source=source,
            data=json.dumps(dict(data), default=str),
        )

    def notice(self, kind: str, source: Source, data: Mapping[str, Any]) -> None:
        """Keep what is measured during a trial; it goes to disk with the next tick."""
        if self.session.state == "trial":
            self.noticed.append(self.event(kind, source, data))

    # ---- the phase ----------------------------------------------------------------------------------------------

    async def forget_phase(self) -> None:
        """End the worker and forget the phase it ran."""
        self.phase = Phase(DistractorState(self.around.study.distractor))
        self.noticed.clear()
        self.recent.forget_ticks()
        await self.link.stop()

    def lacks_panel(self) -> bool:
        """Whether a trial is next and its readings would appear on a second device that nobody has opened."""
        distractor = self.around.study.distractor
        on_panel = distractor.enabled and distractor.placement == "second_device"
        return self.session.place == "trial_ready" and on_panel and self.audience.panel is None

    def is_away(self) -> bool:
        """Whether a reading keeps the hands off the pad."""
        if self.session.place != "trial":
            return False
        paced = self.enrolment.pace == "real_time" and self.session.is_ticking and not self.link.held
        return self.phase.is_away(self.around.now_unix_s(), paced)

    # ---- what the pages get -------------------------------------------------------------------------------------

    def page(self) -> pages.Page:
        """The participant's page."""
        practice = self.session.place in ("practice_ready", "practice")
        shown: Instruction | None = None
        if self.phase.view is not None:
            shown = pages.instruction(self.phase.view, self.around.labels, practice)
        scene_path = f"/s/{self.enrolment.public_id}/scene/"
        context = PageContext(
            study=self.around.study,
            scene_path=scene_path,
            panel_link=self.panel_link,
            instruction=shown,
            worker_ready=self.link.ready,
            public_id=self.enrolment.public_id,
            ids=self.enrolment.ids,
        )
        return pages.page(self.session, context)

    def measure(self) -> None:
        """Measure the round trip of a page whose device is being checked, if the study asks for it."""
        client = self.audience.participant
        is_asked = "round_trip" in checks_of(self.around.study.eligibility)
        if client is not None and self.session.state == "eligibility" and is_asked:
            self.round_trips.measure(client, PINGS)

    def status(self) -> Status | None:
        """Whether ticks run, and if not, why; None when no robot is needed."""
        if self.session.worker is None:
            return None
        if self.session.state == "paused":
            return Status(status="paused", reason=", ".join(sorted(self.session.causes)))
        if not self.link.ready:
            return Status(status="recovering" if self.link.restarts else "starting")
        if not self.session.is_ticking:
            return Status(status="ready")
        return Status(status="held" if self.link.held else "running")

    def show_all(self) -> None:
        """The page and the status, to everybody it concerns."""
        self.audience.show_page(self.page(), self.session)
        self.audience.show_status(self.status())
