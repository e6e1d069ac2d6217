"""The transitions of a session: events of the protocol with their effects, and what the worker reports on the way.

Everything is on disk before it is shown, and shown before the next thing is dealt with.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

from app.monitoring.log_lines import about
from app.session import pages
from app.session.context import SessionContext
from app.session.interfaces import Freer
from app.trial.reasoning import PartFault
from app.trial.values import CycleStart, EngineEvent, cycle_from_json
from app.worker.messages import (
    Failed,
    HoldChanged,
    PartFailed,
    Ready,
    SpectatorPort,
    Ticked,
    WorkerReport,
)
from study.flow.distractors.state import of_practice, stimuli_of
from study.flow.protocol import PAUSED, BeginTicks, Effect, Event, StartWorker, StopWorker, WorkerKind
from study.flow.quality import judged
from study.records import EventRow, StudyError, TrialRow, utc_text
from study.store import WHAT_TO_DO, Batch

log = logging.getLogger(__name__)


class Transitions:
    """Moves one session on."""

    def __init__(self, context: SessionContext) -> None:
        self._context = context

    # ---- the protocol -------------------------------------------------------------------------------------------

    async def restore(self) -> None:
        """Bring back what a restart of the lab interrupted."""
        context = self._context
        before = context.session
        context.session, effects = context.services.flow.restore(before, context.services.now_unix_s())
        if context.session != before:
            event = context.event("lab_restarted", "lab", {"state": before.state})
            await context.commit(Batch(session=context.session, events=(event,)))
        self._carry_out(effects)

    async def advance(
        self,
        event: Event,
        batch: Batch = Batch(),
        on_disk: Callable[[], None] = lambda: None,
    ) -> None:
        """Take an event of the protocol: commit it with what else is in `batch`, call `on_disk`, carry out its effects,
        show the new page.

        Raises `study.flow.protocol.IllegalEvent`.
        """
        context = self._context
        before = context.session
        after, effects = context.services.flow.advance(before, event, context.services.now_unix_s())
        if after != before:
            data = {"event": event.name, "from": before.state, "to": after.state, "reason": event.reason}
            batch = replace(batch, events=(*batch.events, context.event("state", "lab", data)))
        if after.is_over:
            batch = replace(batch, finished_utc=context.services.now_utc())
        if before.place == "trial" and after.place != "trial" and event.name != "trial_done":
            trials = (await self._closed_trial("aborted"),)
            events = (
                *context.noticed,
                *batch.events,
            )  # the verdict counts them, and no tick follows to write them with
            alerts = context.alert_rows(item.alert for item in context.running.close_distractor())
            batch = replace(batch, trials=trials, events=events, alerts=alerts)
        elif after.state == "trial" and any(isinstance(effect, BeginTicks) for effect in effects):
            context.vitals.overruns = 0
            begun = replace(context.services.trial_row(after.trial), started_utc=context.services.now_utc())
            batch = replace(batch, trials=(begun,))
        again = await self._practice_again() if event.name == "repeat_practice" else None
        if again is not None:
            batch = replace(batch, cycles=context.cycle_rows(again, practice=True))
        await context.commit(replace(batch, session=after))
        context.session = after
        context.is_shown = context.is_shown and after == before
        self._carry_out(effects)
        if again is not None:
            context.running.numbered_on(again.first_tick)
        if before.state == PAUSED != after.state and not context.link.is_up:
            context.link.anew()  # another try, also where workers had ended too often
        on_disk()
        await self.settle()

    async def free(self, by: Freer, batch: Batch, on_disk: Callable[[], None] = lambda: None) -> None:
        """Have the next tick free the arm, and commit that it was asked for. While no ticks run it waits for one, and
        outlives worker and lab; an arm that goes back already need not be freed."""
        context, running = self._context, self._context.running
        if running.view is not None and running.view.phase == "reset" and running.freed_by is None:
            event = context.event("free_not_needed", "lab", {"reason": "the arm was going back already"})
            await context.commit(replace(batch, events=(*batch.events, event)))
        else:
            await context.commit(batch)
            running.freed_by = running.freed_by or by
        on_disk()

    async def _practice_again(self) -> CycleStart:
        """Practice goes on after its last tick with another cycle, as it does when the block was not moved: what was
        recorded keeps its numbers, and a worker that is replaced re-runs this cycle alone."""
        participant, trial = self._context.enrolment.participant, self._context.session.trial
        last, rows = await self._context.services.store.keep(
            lambda store: (
                store.last_cycle(participant, trial, practice=True),
                store.rows_of("practice_ticks", participant, trial=trial),
            )
        )
        start = cycle_from_json(last.start) if last else CycleStart()
        return start.repeated(start.cycle + 1, rows[-1].tick + 1 if rows else 0)

    def _carry_out(self, effects: tuple[Effect, ...]) -> None:
        """What effects change here. What they change elsewhere `settle` makes so, from where the session is then."""
        context = self._context
        for effect in effects:
            if isinstance(effect, StopWorker):
                context.forget_running_trial()
            elif isinstance(effect, StartWorker) and effect.kind == "practice":
                context.running.distractor = of_practice(context.services.distractor, context.services.study)

    # ---- what should be, and is made so -------------------------------------------------------------------------

    async def settle(self) -> None:
        """Make it so: the worker that the session needs, what that worker is to do, what the pages show.

        Called after every piece of work, and again and again (`is_settled`): whatever went wrong on the way is made up
        for, or the session is paused and says why.
        """
        context, link = self._context, self._context.link
        if link.runs is not None and link.runs != context.session.worker:
            await self._stop_worker()
        if context.session.worker and link.may_start:
            await self._start_worker(context.session.worker)
        link.free(context.running.freed_by is not None)
        link.ticks(context.may_tick())
        link.view(context.view)
        if not context.is_shown:
            context.show_all()

    @property
    def is_settled(self) -> bool:
        """Whether `settle` would find nothing to do."""
        context, link = self._context, self._context.link
        runs_another = link.runs is not None and link.runs != context.session.worker
        return context.is_shown and not runs_another and not (context.session.worker and link.may_start)

    async def _stop_worker(self) -> None:
        try:
            await self._context.link.stop()
        except Exception:  # it is not this session's any more, whatever becomes of it
            fields = about(participant=self._context.enrolment.participant)
            log.exception("a worker could not be stopped", extra=fields)

    async def _start_worker(self, needed: tuple[WorkerKind, int]) -> None:
        context, link = self._context, self._context.link
        try:
            await link.start(*needed)
        except Exception as error:
            log.exception("a worker could not be started", extra=about(participant=context.enrolment.participant))
            failing_s = link.could_not_start(f"cannot be started: {type(error).__name__}: {error}")
            event = context.event("worker_failed", "lab", {"reason": link.problem})
            if failing_s > context.services.config.unsaved_pause_s:
                link.wanted = False
                await self.advance(Event("part_failed", f"the robot's process {link.problem}"), Batch(events=(event,)))
            elif link.failed_starts == 1:
                await context.commit(Batch(events=(event,)))
                context.connections.show_status(context.status())

    async def _give_up(self, event: EventRow) -> None:
        """The worker has ended too often: whoever lets the session go on gets another one."""
        context, link = self._context, self._context.link
        link.wanted = False
        reason = "the robot's process keeps ending" + (f": {link.problem}" if link.problem else "")
        if context.session.is_over or "experimenter" in context.session.causes:
            await context.commit(Batch(events=(event,)))
        else:
            await self.advance(Event("experimenter_pause", reason), Batch(events=(event,)))

    async def after_trouble(self) -> None:
        """The disk does again: the record says for how long it did not, and pauses what that interrupted for long."""
        context, saving = self._context, self._context.saving
        over = saving.over
        if over is None or saving.trouble is not None:
            return
        trouble, lasted_s = over
        was_long, lasts = saving.is_long, f"{lasted_s:.0f} s"
        event = context.event("not_saved", "lab", {"why": trouble.kind, "for_s": round(lasted_s, 3)})
        if was_long and context.session.is_ticking:
            reason = f"the lab could not save for {lasts}. {WHAT_TO_DO[trouble.kind]}"
            await self.advance(Event("part_failed", reason), Batch(events=(event,)))
        else:
            await context.commit(Batch(events=(event,)))
        saving.recorded(over)
        context.connections.show_saves(context.unsaved())
        context.connections.show_status(context.status())

    # ---- what the worker reports --------------------------------------------------------------------------------

    async def on_report(self, epoch: int, report: WorkerReport) -> None:
        """The worker said something."""
        context, link = self._context, self._context.link
        if epoch != link.epoch or (isinstance(report, Ticked) and not link.ready):
            return  # of a worker that has been stopped, or is being replaced
        if isinstance(report, Ready):
            await self._on_ready(report)
        elif isinstance(report, Ticked):
            before = context.running.copy()
            try:
                await self._on_ticked(report)
            except PartFault as fault:
                context.running.restore(before)
                await self.distractor_failed(fault)
            except Exception:
                context.running.restore(before)
                raise
        elif isinstance(report, HoldChanged):
            if not context.session.is_ticking:
                return  # of the moment before a pause, which says more
            link.held = report.held
            kind = "robot_held" if report.held else "robot_released"
            await context.commit(Batch(events=(context.event(kind, "lab", {}),)))
            context.connections.show_status(context.status())
        elif isinstance(report, SpectatorPort):
            context.spectators.told(report.port)
        elif isinstance(report, PartFailed):
            link.faulted = True
            await self._part_failed(report.part, report.reason)
        elif isinstance(report, Failed):
            await context.commit(Batch(events=(context.event("worker_failed", "lab", {"reason": report.reason}),)))

    async def distractor_failed(self, fault: PartFault) -> None:
        """The distractor cannot be used: the session pauses. A tick that is not on disk did not happen, so that another
        worker takes over from the record."""
        await self._part_failed(fault.part, fault.reason)
        await self._stop_worker()

    async def _part_failed(self, part: str, reason: str) -> None:
        """A part of the study cannot be used: the session pauses, and says why."""
        context = self._context
        event = context.event("part_failed", "robot", {"part": part, "reason": reason})
        await self.advance(Event("part_failed", f"{part} {reason}"), Batch(events=(event,)))

    def report_failed(self, epoch: int, problem: str) -> None:
        """A report could not be dealt with. A tick that is not on disk did not happen: the worker is ended and the
        next one starts from the record."""
        if epoch == self._context.link.epoch:
            self._context.link.kill(problem)

    async def on_exit(self, epoch: int) -> None:
        """The worker's process ended by itself: another one takes over, a few times."""
        context, link = self._context, self._context.link
        if epoch != link.epoch or not link.is_up:
            return
        was_ready, asking = link.ready, link.asking
        link.lost()  # before all else: whatever comes in between, the session knows that it has no worker
        if asking is not None or link.faulted:
            # Its arbiter ended it. Another worker stands by for whoever lets the session go on, unless the record
            # itself cannot be re-run: then the next one is started by them.
            link.restarts, link.asking = 0, None
            link.wanted = False
            if asking is not None:
                await self._part_failed(asking.part, "ended the process that it runs in")
            link.wanted = was_ready or context.session.state != PAUSED  # or somebody has said so meanwhile
            return
        data = {"restarts": link.restarts} | ({"why": link.problem} if link.problem else {})
        event = context.event("worker_lost", "lab", data)
        if link.restarts > context.services.config.worker_restarts:
            await self._give_up(event)
            return
        await context.commit(Batch(events=(event,)))
        context.connections.show_status(context.status())

    async def _on_ready(self, report: Ready) -> None:
        context, link = self._context, self._context.link
        link.ready, link.scene_port = True, report.scene_port
        context.running.ready(report)
        phase, _ = context.session.worker or ("", 0)
        told = {
            **context.services.ran_on,
            **report.look,
            **({"look_note": report.look_note} if report.look_note else {}),
        }
        events = [context.event("robot", "lab", {**told, "phase": phase})]
        if report.mismatch is not None:
            events.append(context.event("replay_mismatch", "robot", {"tick": report.mismatch}))
        await context.commit(Batch(events=tuple(events)))
        if report.finished:
            await self._running_trial_done(Batch())
            return
        link.free(context.running.freed_by is not None)
        link.ticks(context.may_tick())
        context.connections.show_page(context.page(), context.session)
        context.connections.show_world(context.running.world)
        context.connections.show_status(context.status())

    async def _on_ticked(self, report: Ticked) -> None:
        """Record a tick with everything that happened in it, then show it."""
        context, connections, running = self._context, self._context.connections, self._context.running
        result, practice, labels = report.result, context.session.place == "practice", context.services.labels
        study = context.services.study
        row = replace(result.row, started_utc=utc_text(report.started_unix_s), late_ms=report.late_ms)
        was = running.view if result.view.ended is not None else None
        before = pages.instruction(was, labels, practice, study.words) if was is not None else None
        running.ticked(report)
        events = [self._of_the_robot(event) for event in result.events]
        if running.freed_by is not None and (report.freeing or result.finished):
            if row.source != "free":
                reason = "it was over" if result.finished else "the arm was going back already"
                events.append(context.event("free_not_needed", "lab", {"reason": reason}))
            running.freed_by = None
        context.vitals.frees += row.source == "free"
        if report.overrun:
            context.vitals.overruns += 1
            events.append(context.event("overrun", "lab", {"late_ms": report.late_ms, "missed": report.missed}))
        noticed = tuple(context.noticed)
        seed, trial, distractor = context.enrolment.plan.seed, context.session.trial, context.services.distractor
        try:
            changed = running.advance_distractor(
                lambda number: distractor.stimulus(seed, stimuli_of(trial, practice), number), result.finished
            )
        except StudyError as error:  # its schedule cannot be
            raise PartFault(f"distractor {distractor.settings.kind!r}", str(error)) from error
        batch = Batch(
            ticks=() if practice else (row,),
            practice_ticks=(row,) if practice else (),
            tasks=() if practice else result.tasks,
            alerts=context.alert_rows(item.alert for item in changed),
            events=(*noticed, *events),
            cycles=context.cycle_rows(result.cycle_start, practice),
        )
        tick = pages.tick_message(result, report.seq, before, labels, practice, study.show_assistance, study.words)

        def show_all() -> None:
            connections.show_world(running.world)
            connections.show_tick(tick)
            context.services.metrics.ticked(report.late_ms, report.missed)
            for item in changed:
                connections.show_alert(item, running.distractor, running.trial_s)

        if result.finished:
            await self._running_trial_done(batch, on_disk=show_all)
        else:
            await context.commit(batch)
            show_all()
            context.history.add_tick(row, report.explanation)
        del context.noticed[: len(noticed)]

    def _of_the_robot(self, event: EngineEvent) -> EventRow:
        """An event of a tick; that the arm was freed is the doing of whoever asked for it."""
        source = self._context.running.freed_by if event.kind == "arm_freed" else None
        return self._context.event(event.kind, source or "robot", dict(event.data))

    async def _running_trial_done(self, batch: Batch, on_disk: Callable[[], None] = lambda: None) -> None:
        """The practice or the trial is over: its last tick and the step to the next state are one commit."""
        if self._context.session.place == "practice":
            await self.advance(Event("practice_done"), batch, on_disk)
        else:
            batch = replace(batch, trials=(await self._closed_trial("completed"),))
            await self.advance(Event("trial_done"), batch, on_disk)

    async def _closed_trial(self, outcome: Literal["completed", "aborted"]) -> TrialRow:
        """The row of the trial that ends now, judged by the study's rules."""
        context, running = self._context, self._context.running
        participant, trial = context.enrolment.participant, context.session.trial
        found, stored = await context.services.store.keep(
            lambda store: (
                store.rows_of("trials", participant, trial=trial),
                store.rows_of("events", participant, trial=trial),
            )
        )
        row: TrialRow = found[0] if found else context.services.trial_row(trial)
        ended_utc = context.services.now_utc()
        ticks, overruns = 0 if running.tick is None else running.tick + 1, context.vitals.overruns
        row = replace(row, outcome=outcome, ticks=ticks, overruns=overruns, finished_utc=ended_utc)
        expired = sum(alert.status == "expired" for alert in running.distractor.alerts)
        stimuli, rules = context.services.distractor.words.many, context.services.study.quality
        try:
            return judged(row, (*stored, *context.noticed), expired, rules, stimuli, context.vitals.frees)
        except Exception as error:  # a trial ends, whatever its record holds
            log.exception("a trial could not be judged", extra=about(participant=participant, trial=trial))
            reason = f"it could not be judged: {type(error).__name__}: {error}"
            return replace(row, quality="suspect", quality_broken=json.dumps([reason]))
