"""Whether a trial went as it should: a verdict by the study file's rules, from what was recorded. Pure.

What is measured comes from the events between the trial's first tick and its end: the page's round trips
(`round_trip`), when it was hidden (`page.hidden`, `page.visible`), when it lost the focus (`focus_lost`) or the gamepad
(`page.pad_unplugged`), that the computer's clock was set (`clock_set`), and from the late ticks, the alerts and the
freed arms of the trial. What cannot be read of the record is passed over: no event keeps a trial from ending.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from study.definition.sections import QualityRules
from study.flow.recorded import (
    CLOCK_SET,
    CONNECTED,
    FOCUS_LOST,
    PAD_UNPLUGGED,
    PAGE_HIDDEN,
    PAGE_VISIBLE,
    ROUND_TRIP,
    TAB_TAKEN_OVER,
    time_of,
)
from study.records import EventRow, TrialRow, unix_s

Verdict = Literal["good", "suspect"]


@dataclass(frozen=True)
class Measured:
    """What the rules are about. `round_trip_ms` is the 95th percentile; None = never measured (as in lockstep)."""

    round_trip_ms: float | None
    hidden_s: float
    missed_ticks: int
    focus_losses: int
    pad_losses: int
    unanswered_alerts: int
    frees: int = 0
    clock_set_s: tuple[float, ...] = ()
    """By how much the computer's clock was set, each time; back is negative."""
    lasted_s: float | None = None
    """From start to end; below 0 where a clock was set back that the times came from."""


def measure(
    events: Iterable[EventRow],
    *,
    started_utc: str,
    ended_utc: str,
    missed_ticks: int,
    unanswered_alerts: int,
    frees: int = 0,
) -> Measured:
    """What happened in a trial. `events` are the participant's in order; those outside the trial's time are left out,
    but a page that was hidden before its start counts as hidden from the start on."""
    started, ended = unix_s(started_utc), unix_s(ended_utc)
    trips: list[float] = []
    clock_set_s: list[float] = []
    focus_losses = pad_losses = 0
    hidden_s, hidden_since = 0.0, None
    for event in events:
        at = time_of(event.utc)
        if at is None or at > ended:
            continue
        if PAGE_HIDDEN.of(event):
            hidden_since = at if hidden_since is None else hidden_since
        elif _is_seen(event):
            hidden_s += 0.0 if hidden_since is None else max(0.0, at - max(hidden_since, started))
            hidden_since = None
        elif at < started:
            continue
        elif FOCUS_LOST.of(event):
            focus_losses += 1
        elif PAD_UNPLUGGED.of(event):
            pad_losses += 1
        elif clock_set := CLOCK_SET.of(event):
            clock_set_s.append(clock_set.by_s)
        elif round_trip := ROUND_TRIP.of(event):
            trips.append(round_trip.ms)
    if hidden_since is not None:
        hidden_s += ended - max(hidden_since, started)
    trips.sort()
    return Measured(
        round_trip_ms=trips[math.ceil(0.95 * len(trips)) - 1] if trips else None,
        hidden_s=round(hidden_s, 3),
        missed_ticks=missed_ticks,
        focus_losses=focus_losses,
        pad_losses=pad_losses,
        unanswered_alerts=unanswered_alerts,
        clock_set_s=tuple(clock_set_s),
        lasted_s=ended - started,
        frees=frees,
    )


def _is_seen(event: EventRow) -> bool:
    """Whether the participant's page is in front of them again: shown, or loaded anew."""
    arrived = CONNECTED.of(event) or TAB_TAKEN_OVER.of(event)
    return PAGE_VISIBLE.of(event) is not None or (arrived is not None and arrived.role == "participant")


def broken_rules(rules: QualityRules, measured: Measured, stimuli: str = "readings") -> tuple[str, ...]:
    """One sentence for each rule the trial broke; none = the verdict is good. That a clock was set is one whatever the
    study file says. `stimuli` is what the study's second task
    calls its own."""
    checks = (
        ("round trip (95th percentile)", measured.round_trip_ms, rules.max_round_trip_ms, "ms"),
        ("page hidden", measured.hidden_s, rules.max_hidden_s, "s"),
        ("late ticks", measured.missed_ticks, rules.max_missed_ticks, ""),
        ("focus lost", measured.focus_losses, rules.max_focus_losses, "times"),
        ("gamepad lost", measured.pad_losses, rules.max_pad_losses, "times"),
        (f"{stimuli} unanswered", measured.unanswered_alerts, rules.max_unanswered_alerts, ""),
        ("arm freed", measured.frees, rules.max_frees, "times"),
    )
    clock = [f"the computer's clock was set by {by_s:+.1f} s" for by_s in measured.clock_set_s]
    if measured.lasted_s is not None and measured.lasted_s < 0.0:
        clock.append(f"by its times it ended {-measured.lasted_s:.1f} s before it began")
    broken = (
        f"{what}: {value:g} {unit}, at most {most:g} allowed".replace(" ,", ",")
        for what, value, most, unit in checks
        if value is not None and most is not None and value > most
    )
    return (*broken, *clock)


def verdict(broken: tuple[str, ...]) -> Verdict:
    """The word for it."""
    return "suspect" if broken else "good"


def judged(
    row: TrialRow,
    events: Iterable[EventRow],
    unanswered_alerts: int,
    rules: QualityRules,
    stimuli: str = "readings",
    frees: int = 0,
) -> TrialRow:
    """The row of a trial that has ended, with its verdict; one that never began is returned as it is."""
    if row.started_utc is None or row.finished_utc is None or time_of(row.started_utc) is None:
        return row
    measured = measure(
        events,
        started_utc=row.started_utc,
        ended_utc=row.finished_utc,
        missed_ticks=row.overruns,
        unanswered_alerts=unanswered_alerts,
        frees=frees,
    )
    broken = broken_rules(rules, measured, stimuli)
    return replace(
        row,
        quality=verdict(broken),
        quality_broken=json.dumps(broken),
        round_trip_ms=measured.round_trip_ms,
        hidden_s=measured.hidden_s,
        focus_losses=measured.focus_losses,
        pad_losses=measured.pad_losses,
        unanswered_alerts=measured.unanswered_alerts,
        frees=measured.frees,
    )
