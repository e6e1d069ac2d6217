"""The practice or the trial under way, as the lab follows it: which tick, what is on the screen, which alerts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

from app.session.interfaces import Freer
from app.trial.reasoning import PartFault
from app.trial.values import TrialView
from app.wire import World
from app.worker.messages import Ready, Ticked
from sim.interface import TICK_S
from study.flow.distractors.interface import Stimulus
from study.flow.distractors.state import AlertState, DistractorState
from study.records import StudyError

_UNSEEN = Stimulus("")
"""Stands in where only the times of alerts matter."""


@dataclass
class RunningTrial:
    """Where a practice or a trial stands. A tick that could not be recorded did not happen: `copy` before it and
    `restore` after.

    `trial_s` is the trial time at the end of the last tick. `next_tick_unix_s` is when the next one is due in real
    time. `view` and `world` are what the pages show, once a worker has said so. `freed_by` is who has asked to free the
    arm, until a tick has done it.
    """

    distractor: DistractorState
    tick: int | None = None
    trial_s: float = 0.0
    next_tick_unix_s: float = 0.0
    view: TrialView | None = None
    world: World | None = None
    freed_by: Freer | None = None

    @classmethod
    def resumed(cls, distractor: DistractorState, tick: int | None, freed_by: Freer | None = None) -> RunningTrial:
        """The one whose last tick on disk is `tick`."""
        return cls(distractor, tick, 0.0 if tick is None else (tick + 1) * TICK_S, freed_by=freed_by)

    def numbered_on(self, tick: int) -> None:
        """Its first tick will be this one."""
        self.tick, self.trial_s = (tick - 1, tick * TICK_S) if tick else (None, 0.0)

    def copy(self) -> RunningTrial:
        """As it is now."""
        return replace(self)

    def restore(self, before: RunningTrial) -> None:
        """Back to what `copy` gave."""
        for item in fields(self):
            setattr(self, item.name, getattr(before, item.name))

    def ready(self, report: Ready) -> None:
        """The worker stands where the record ends."""
        self.view, self.world = report.view, World(**vars(report.world))

    def ticked(self, report: Ticked) -> None:
        """The worker has run a tick."""
        row = report.result.row
        self.tick, self.trial_s, self.view = row.tick, (row.tick + 1) * TICK_S, report.result.view
        self.next_tick_unix_s = report.started_unix_s - (report.late_ms or 0.0) / 1000.0 + TICK_S
        self.world = World(**vars(report.world))

    def advance_distractor(self, stimulus: Callable[[int], Stimulus], finished: bool) -> tuple[AlertState, ...]:
        """The alerts that were raised, expired, or closed by the end of the trial, in order."""
        self.distractor, changed = self.distractor.advance(self.trial_s, stimulus)
        return (*changed, *self.close_distractor()) if finished else changed

    def close_distractor(self) -> tuple[AlertState, ...]:
        """The trial is over: the alert that was still open, closed."""
        self.distractor, closed = self.distractor.close()
        return closed

    def is_away(self, now_unix_s: float, paced: bool) -> bool:
        """Whether the pad is ignored in the tick that the hands of this moment are for.

        In lockstep that is the tick about to run. In real time (`paced`) it is the one after the running tick, and a
        busy machine leaves open which of two that is: the pad counts only if both are free. So not even the first
        tick of an alert is driven, and the hands are never free too early (half a second too late at most).
        """
        starts_s = [self.trial_s]
        # A tick is reported when its last slice is done, a little before the next one starts.
        if paced and now_unix_s >= self.next_tick_unix_s:
            starts_s.append(self.trial_s + TICK_S)
        try:
            ahead = [(start_s, self.distractor.advance(start_s, lambda number: _UNSEEN)[0]) for start_s in starts_s]
        except (PartFault, StudyError):
            return False  # the tick that asks for it tells what is wrong
        return any(distractor.locked(start_s) for start_s, distractor in ahead)
