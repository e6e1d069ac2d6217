"""The second task of a trial as it goes: stimuli that call the hands away from the robot (paper IV-B).

Everything is a function of trial time, which stands still during a pause. An alert is one stimulus and what became of
it. It is raised when its distractor says so, `first_s + (k - 1) * every_s` for number k if it has no schedule of its
own, and stays open until it is answered, its time is up, the next one is due, or the trial ends. Wall-clock times are
only carried along, as text.

On one screen (`same_page_away`) the pad is ignored from the moment an alert appears until it is closed and at least
`away_min_s` have passed: that stands for putting the controller down and walking to the laptop.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, cast

from study.definition.sections import DistractorSettings
from study.definition.study import Study
from study.flow.distractors.interface import MAX_ANSWER_CHARACTERS, Distractor, Stimulus
from study.records import AlertRow, StudyError

AlertStatus = Literal["open", "answered", "expired", "trial_ended"]
AnswerResult = Literal[
    "accepted", "late", "duplicate", "unknown", "empty", "too_long", "unreadable", "no_choice", "no_number"
]
"""`late`: the alert was closed without an answer. `duplicate`: it had one already, and that one stays.
`unknown`: no such alert was raised. `empty`: nothing was typed. `too_long`: it has more characters
than an answer may have. `unreadable`: control characters are in it. `no_choice`: there are choices, and it is none of
them. `no_number`: a number is asked for. Only `accepted` changes anything."""


PRACTICE_DUE_S = 10.0
"""The alert of a practice comes at this trial time at the latest."""
_PRACTICE_TRIALS = 1_000_000


def stimuli_of(trial: int, practice: bool) -> int:
    """The number that the stimuli of a trial, or of the practice before it, are drawn with: they are not the same."""
    return trial + _PRACTICE_TRIALS if practice else trial


@dataclass(frozen=True)
class AlertState:
    """One stimulus, raised at `due_trial_s`. Times are as in `records.AlertRow`."""

    alert: int
    stimulus: Stimulus
    due_trial_s: float
    status: AlertStatus = "open"
    shown_utc: str | None = None
    heard_utc: str | None = None
    answered_utc: str | None = None
    answered_trial_s: float | None = None
    answer: str | None = None
    correct: bool | None = None
    """Whether the answer counts as right; None without one."""


@dataclass(frozen=True)
class DistractorState:
    """The alerts of one trial so far. `DistractorState(distractor)` is the state before the first tick."""

    distractor: Distractor[Any]
    alerts: tuple[AlertState, ...] = ()
    is_over: bool = False
    practice: bool = False
    """Of a practice: one alert, early enough to come before the practice is over."""

    @property
    def settings(self) -> DistractorSettings:
        """What the study says about every kind of distractor."""
        return self.distractor.settings

    def due_s(self, alert: int) -> float:
        """Trial time at which an alert is raised. Raises `StudyError` when that is not after the one before."""
        due_s = self.distractor.due_s(alert) - self._sooner_s
        before = self.alert(alert - 1)
        if before is not None and not due_s > before.due_trial_s:
            raise StudyError(
                f"alert {alert} is due at {due_s} s, which is not after the last one: {before.due_trial_s} s"
            )
        return due_s

    def deadline_s(self, alert: int) -> float:
        """Trial time from which on an alert takes no answer."""
        return min(self.distractor.deadline_s(alert) - self._sooner_s, self.due_s(alert + 1))

    @property
    def _sooner_s(self) -> float:
        """How much earlier than in a trial alerts come."""
        return max(0.0, self.distractor.due_s(1) - PRACTICE_DUE_S) if self.practice else 0.0

    @property
    def open_alert(self) -> AlertState | None:
        """The alert that waits for an answer; there is never more than one."""
        return next((alert for alert in self.alerts if alert.status == "open"), None)

    def alert(self, number: int) -> AlertState | None:
        """AlertState `number`, from 1, or None when it was not raised yet."""
        return self.alerts[number - 1] if 1 <= number <= len(self.alerts) else None

    def advance(
        self, trial_s: float, stimulus: Callable[[int], Stimulus]
    ) -> tuple[DistractorState, tuple[AlertState, ...]]:
        """The state at `trial_s`, and the alerts that were raised or expired on the way, in order.

        `stimulus` gives what an alert shows (`Distractor.stimulus` with the participant's seed and the trial).
        """
        state, changed = self, []
        while trial_s >= state.next_change_s:
            waiting, coming = state.open_alert, len(state.alerts) + 1
            if waiting:
                closed = replace(waiting, status="expired")
                state = state._with(closed)
                changed.append(closed)
            else:
                raised = AlertState(coming, stimulus(coming), state.due_s(coming))
                state = replace(state, alerts=(*state.alerts, raised))
                changed.append(raised)
        return state, tuple(changed)

    @cached_property
    def next_change_s(self) -> float:
        """Trial time at which the open alert expires, or else the next one is raised; infinite when nothing will."""
        if self.is_over or not self.settings.enabled:
            return math.inf
        waiting = self.open_alert
        if self.practice and self.alerts and waiting is None:
            return math.inf
        return self.deadline_s(waiting.alert) if waiting else self.due_s(len(self.alerts) + 1)

    def answer(self, number: int, value: str, trial_s: float, utc: str) -> tuple[DistractorState, AnswerResult]:
        """Log what was typed, as it was typed. Anything but `accepted` leaves the state as it is (see
        `AnswerResult`)."""
        alert = self.alert(number)
        if alert is None:
            return self, "unknown"
        if alert.status == "answered":
            return self, "duplicate"
        if alert.status != "open" or self.is_over or trial_s >= self.deadline_s(number):
            return self, "late"
        if not value.strip():
            return self, "empty"
        if len(value) > MAX_ANSWER_CHARACTERS:
            return self, "too_long"
        if any(unicodedata.category(one) in ("Cc", "Cs") for one in value):
            return self, "unreadable"
        if not alert.stimulus.takes(value):
            return self, "no_choice" if alert.stimulus.choices else "no_number"
        answered = replace(
            alert,
            status="answered",
            answer=value,
            correct=self.distractor.is_right(value, self.stimuli(number)),
            answered_trial_s=trial_s,
            answered_utc=utc,
        )
        return self._with(answered), "accepted"

    def stimuli(self, number: int) -> tuple[Stimulus, ...]:
        """Everything the trial has shown, up to alert `number`."""
        return tuple(alert.stimulus for alert in self.alerts[:number])

    def right_answer(self, number: int) -> str:
        """A right answer to alert `number`, which was raised."""
        return self.distractor.right_answer(self.stimuli(number))

    def shown(self, number: int, utc: str) -> DistractorState:
        """The page reported the alert visible; the first report counts, unknown alerts are ignored."""
        alert = self.alert(number)
        return self if alert is None or alert.shown_utc else self._with(replace(alert, shown_utc=utc))

    def heard(self, number: int, utc: str) -> DistractorState:
        """The page reported the sound played; the first report counts, unknown alerts are ignored."""
        alert = self.alert(number)
        return self if alert is None or alert.heard_utc else self._with(replace(alert, heard_utc=utc))

    def close(self) -> tuple[DistractorState, tuple[AlertState, ...]]:
        """The trial is over: no more alerts; the one still open is returned closed."""
        waiting, state = self.open_alert, replace(self, is_over=True)
        if waiting is None:
            return state, ()
        closed = replace(waiting, status="trial_ended")
        return state._with(closed), (closed,)

    def locked(self, trial_s: float) -> bool:
        """Whether the pad is ignored at this trial time (`same_page_away` only)."""
        from_s, until_s = self._covered_s
        return from_s <= trial_s < until_s

    def release_in_s(self, trial_s: float) -> float:
        """Trial time until the panel may uncover the view, once no alert is open; 0 on a second device."""
        if not self._covered_s[0] <= trial_s:
            return 0.0
        return max(0.0, self.alerts[-1].due_trial_s + self.settings.away_min_s - trial_s)

    def row(self, alert: AlertState, participant: str, condition: str, trial: int) -> AlertRow:
        """What is recorded of an alert."""
        return AlertRow(
            participant=participant,
            condition=condition,
            trial=trial,
            alert=alert.alert,
            placement=self.settings.placement,
            reading=alert.stimulus.text,
            due_trial_s=alert.due_trial_s,
            shown_utc=alert.shown_utc,
            heard_utc=alert.heard_utc,
            answered_utc=alert.answered_utc,
            answered_trial_s=alert.answered_trial_s,
            answer=alert.answer,
            correct=None if alert.correct is None else int(alert.correct),
            status=alert.status,
        )

    @cached_property
    def _covered_s(self) -> tuple[float, float]:
        """From and until which trial time the pad is ignored; endless while an alert is open."""
        if self.is_over or not self.alerts or self.settings.placement != "same_page_away":
            return math.inf, math.inf
        due_s = self.alerts[-1].due_trial_s
        return due_s, math.inf if self.open_alert is not None else due_s + self.settings.away_min_s

    def _with(self, alert: AlertState) -> DistractorState:
        position = alert.alert - 1
        return replace(self, alerts=(*self.alerts[:position], alert, *self.alerts[position + 1 :]))


def of_practice(distractor: Distractor[Any], study: Study) -> DistractorState:
    """The state before the first tick of a practice: nothing will come where the study practises without a reading."""
    return DistractorState(distractor, practice=True, is_over=study.practice_task == "table")


def from_rows(distractor: Distractor[Any], seed: int, rows: Iterable[AlertRow]) -> DistractorState:
    """The state that left these rows of one trial behind, of the participant with this seed; alerts must be numbered
    1, 2, 3, …"""
    alerts = []
    for expected, row in enumerate(sorted(rows, key=lambda row: row.alert), start=1):
        if row.alert != expected:
            raise StudyError(
                f"alerts of {row.participant!r}, trial {row.trial}: found {row.alert}, expected {expected}"
            )
        stimulus = distractor.stimulus(seed, row.trial, row.alert)
        alerts.append(
            AlertState(
                alert=row.alert,
                stimulus=replace(stimulus, text=row.reading),  # what was shown is what was recorded
                due_trial_s=row.due_trial_s,
                status=cast(AlertStatus, row.status),
                shown_utc=row.shown_utc,
                heard_utc=row.heard_utc,
                answered_utc=row.answered_utc,
                answered_trial_s=row.answered_trial_s,
                answer=row.answer,
                correct=None if row.correct is None else bool(row.correct),
            )
        )
    return DistractorState(distractor, tuple(alerts), any(alert.status == "trial_ended" for alert in alerts))
