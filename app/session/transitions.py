"""The course of a session: events of the protocol with their effects, and what the worker reports on the way.

Everything is on disk before it is shown, and shown before the next thing is dealt with.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

from app.session import pages
from app.session.context import Stage
from app.trial.values import CycleStart, cycle_from_json
from app.worker.messages import Begin, Failed, Hold, HoldChanged, Ready, SpectatorPort, Ticked, WorkerReport
from study.definition.study import reading
from study.flow import protocol
from study.flow.protocol import BeginTicks, Event, PauseTicks, ResumeTicks, StartWorker, StopWorker
from study.flow.quality import judged
from study.records import OVERRUN_MS, EventRow, TrialRow, utc_text


class Course:
    """Moves one session on."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    # ---- the protocol -------------------------------------------------------------------------------------------

    async def restore(self) -> None:
        """Bring back what a restart of the lab interrupted."""
        stage = self._stage
        before = stage.session
        stage.session, effects = protocol.restore(before, stage.around.now_unix_s())
        if stage.session != before:
            event = stage.event("lab_restarted", "lab", {"state": before.state})
            await stage.commit(session=stage.session, events=(event,))
        await self._carry_out(effects)

    async def advance(
        self,
        event: Event,
        events: tuple[EventRow, ...] = (),
        on_disk: Callable[[], None] = lambda: None,
        **rows: Any,
    ) -> None:
        """Take an event of the protocol: commit, call `on_disk`, carry out its effects, show the new page.

        Raises `study.flow.protocol.IllegalEvent`.
        """
        stage = self._stage
        before = stage.session
        after, effects = protocol.advance(before, event, stage.around.now_unix_s())
        if after != before:
            data = {"event": event.name, "from": before.state, "to": after.state, "reason": event.reason}
            events = (*events, stage.event("state", "lab", data))
        if after.is_over:
            rows["finished_utc"] = stage.around.now_utc()
        if before.place == "trial" and after.place != "trial" and event.name != "trial_done":
            rows["trials"] = (await self._closed_trial("aborted"),)
            events = (*stage.noticed, *events)  # the verdict counts them, and no tick follows to write them with
            rows["alerts"] = [item.alert for item in stage.phase.close_distractor()]
        elif after.state == "trial" and any(isinstance(effect, BeginTicks) for effect in effects):
            stage.vitals.overruns = 0
            rows["trials"] = (replace(stage.around.trial_row(after.trial), started_utc=stage.around.now_utc()),)
        again = await self._practice_again() if event.name == "repeat_practice" else None
        if again is not None:
            rows |= {"cycle": again, "practice": True}
        await stage.commit(session=after, events=events, **rows)
        stage.session = after
        on_disk()
        await self._carry_out(effects)
        if again is not None:
            stage.phase.numbered_on(again.first_tick)
        if after.worker and after.state != "paused" and not stage.link.is_up:
            # Another try, after the experimenter let a session go on whose worker had ended too often.
            stage.link.restarts = 0
            await stage.link.start(*after.worker)
        if after != before:
            stage.show_all()

    async def _practice_again(self) -> CycleStart:
        """Practice goes on after its last tick with another cycle, as it does when the block was not moved: what was
        recorded keeps its numbers, and a worker that is replaced re-runs this cycle alone."""
        participant, trial = self._stage.enrolment.participant, self._stage.session.trial
        last, rows = await self._stage.around.store.run(
            lambda store: (
                store.last_cycle(participant, trial, practice=True),
                store.rows_of("practice_ticks", participant, trial=trial),
            )
        )
        cycle = cycle_from_json(last.start).cycle if last else CycleStart().cycle
        return CycleStart(cycle + 1, rows[-1].tick + 1 if rows else 0)

    async def _carry_out(self, effects: tuple[protocol.Effect, ...]) -> None:
        link = self._stage.link
        for effect in effects:
            if isinstance(effect, StartWorker):
                await link.start(effect.kind, effect.trial)
            elif isinstance(effect, StopWorker):
                await self._stage.forget_phase()
            elif isinstance(effect, PauseTicks):
                link.held = False
                link.send(Hold())
            elif isinstance(effect, (BeginTicks, ResumeTicks)):
                link.send(Begin())  # one that is not up yet begins when it is

    # ---- what the worker reports --------------------------------------------------------------------------------

    async def on_report(self, epoch: int, report: WorkerReport) -> None:
        """The worker said something."""
        stage, link = self._stage, self._stage.link
        link.reported()
        if epoch != link.epoch or (isinstance(report, Ticked) and not link.ready):
            return  # of a worker that has been stopped, or is being replaced
        if isinstance(report, Ready):
            await self._on_ready(report)
        elif isinstance(report, Ticked):
            before = stage.phase.copy()
            try:
                await self._on_ticked(report)
            except Exception:
                stage.phase.restore(before)
                raise
        elif isinstance(report, HoldChanged):
            if not stage.session.is_ticking:
                return  # of the moment before a pause, which says more
            link.held = report.held
            kind = "robot_held" if report.held else "robot_released"
            await stage.commit(events=(stage.event(kind, "lab", {}),))
            stage.audience.show_status(stage.status())
        elif isinstance(report, SpectatorPort):
            stage.onlookers.told(report.port)
        elif isinstance(report, Failed):
            await stage.commit(events=(stage.event("worker_failed", "lab", {"reason": report.reason}),))

    def report_failed(self, epoch: int) -> None:
        """A report could not be dealt with. A tick that is not on disk did not happen: the worker is ended and the
        next one starts from the record."""
        if epoch == self._stage.link.epoch:
            self._stage.link.kill()

    async def on_exit(self, epoch: int) -> None:
        """The worker's process ended by itself: another one takes over, a few times."""
        stage, link = self._stage, self._stage.link
        if epoch != link.epoch or not link.is_up:
            return
        link.lost()
        event = stage.event("worker_lost", "lab", {"restarts": link.restarts})
        needed = stage.session.worker
        if needed is None or link.restarts > stage.around.config.worker_restarts:
            await self.advance(Event("experimenter_pause", "the robot's process keeps ending"), events=(event,))
            return
        await stage.commit(events=(event,))
        stage.audience.show_status(stage.status())
        await link.start(*needed)

    async def _on_ready(self, report: Ready) -> None:
        stage, link = self._stage, self._stage.link
        link.ready, link.scene_port = True, report.scene_port
        stage.phase.ready(report)
        if report.mismatch is not None:
            event = stage.event("replay_mismatch", "robot", {"tick": report.mismatch})
            await stage.commit(events=(event,))
        if report.finished:
            await self._phase_done(())
            return
        if stage.session.is_ticking:
            link.send(Begin())
        stage.audience.show_page(stage.page(), stage.session)
        stage.audience.show_world(stage.phase.world)
        stage.audience.show_status(stage.status())

    async def _on_ticked(self, report: Ticked) -> None:
        """Record a tick with everything that happened in it, then show it."""
        stage, audience, phase = self._stage, self._stage.audience, self._stage.phase
        result, practice, labels = report.result, stage.session.place == "practice", stage.around.labels
        row = replace(result.row, started_utc=utc_text(report.started_unix_s), late_ms=report.late_ms)
        before = pages.instruction(phase.view, labels, practice) if phase.view else None
        phase.ticked(report)
        events = [stage.event(event.kind, "robot", dict(event.data)) for event in result.events]
        if report.missed or (report.late_ms or 0.0) > OVERRUN_MS:
            stage.vitals.overruns += 1
            events.append(stage.event("overrun", "lab", {"late_ms": report.late_ms, "missed": report.missed}))
        noticed = tuple(stage.noticed)
        events = [*noticed, *events]
        plan = stage.enrolment.plan.trial(stage.session.trial)
        changed = () if practice else phase.advance_distractor(lambda number: reading(plan, number), result.finished)
        rows: dict[str, Any] = {
            "ticks": () if practice else (row,),
            "practice_ticks": (row,) if practice else (),
            "tasks": () if practice else result.tasks,
            "alerts": [item.alert for item in changed],
            "cycle": result.cycle_start,
            "practice": practice,
        }
        tick = pages.tick_message(result, report.seq, before, labels, practice, stage.around.study.show_assistance)

        def show_all() -> None:
            audience.show_world(phase.world)
            audience.show_tick(tick)
            for item in changed:
                audience.show_reading(item, phase.distractor, phase.trial_s)

        if result.finished:
            await self._phase_done(tuple(events), on_disk=show_all, **rows)
        else:
            await stage.commit(events=events, **rows)
            show_all()
            stage.recent.add_tick(row)
        del stage.noticed[: len(noticed)]

    async def _phase_done(self, events: tuple[EventRow, ...], **rows: Any) -> None:
        """The practice or the trial is over: its last tick and the step to the next state are one commit."""
        if self._stage.session.place == "practice":
            await self.advance(Event("practice_done"), events=events, **rows)
        else:
            trials = (await self._closed_trial("completed"),)
            await self.advance(Event("trial_done"), events=events, trials=trials, **rows)

    async def _closed_trial(self, outcome: Literal["completed", "aborted"]) -> TrialRow:
        """The row of the trial that ends now, judged by the study's rules."""
        stage, phase = self._stage, self._stage.phase
        participant, trial = stage.enrolment.participant, stage.session.trial
        found, stored = await stage.around.store.run(
            lambda store: (
                store.rows_of("trials", participant, trial=trial),
                store.rows_of("events", participant, trial=trial),
            )
        )
        row: TrialRow = found[0] if found else stage.around.trial_row(trial)
        ended_utc = stage.around.now_utc()
        ticks, overruns = 0 if phase.tick is None else phase.tick + 1, stage.vitals.overruns
        row = replace(row, outcome=outcome, ticks=ticks, overruns=overruns, finished_utc=ended_utc)
        expired = sum(alert.status == "expired" for alert in phase.distractor.alerts)
        return judged(row, (*stored, *stage.noticed), expired, stage.around.study.quality)
