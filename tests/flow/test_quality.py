"""The automatic verdict over a trial: what is measured, and which rules it breaks."""

from __future__ import annotations

import json

import pytest

from study.definition.sections import QualityRules
from study.flow.quality import Measured, broken_rules, judged, measure
from study.records import EventRow
from tests.support.study_samples import event_row, trial_row

RULES = QualityRules(
    max_round_trip_ms=100.0,
    max_hidden_s=2.0,
    max_missed_ticks=1,
    max_focus_losses=1,
    max_pad_losses=0,
    max_unanswered_alerts=0,
    max_frees=1,
)
FINE = Measured(100.0, 2.0, 1, 1, 0, 0, 1)


def at(second: float, kind: str, **data: float) -> EventRow:
    source = "lab" if kind in ("round_trip", "clock_set") else "participant"
    return event_row("P001", kind, utc=f"2026-01-01T00:00:{second:06.3f}Z", data=json.dumps(data), source=source)


def measured(*events: EventRow) -> Measured:
    started, ended = "2026-01-01T00:00:10.000Z", "2026-01-01T00:00:50.000Z"
    return measure(events, started_utc=started, ended_utc=ended, missed_ticks=4, unanswered_alerts=1, frees=2)


def test_only_what_happened_in_the_trial_counts() -> None:
    found = measured(
        at(5, "round_trip", ms=900.0),
        at(5, "focus_lost"),
        at(20, "focus_lost"),
        at(21, "page.pad_unplugged"),
        *[at(22 + number / 10, "round_trip", ms=float(number)) for number in range(1, 21)],
        at(55, "page.pad_unplugged"),
    )
    assert found == Measured(19.0, 0.0, 4, 1, 1, 1, lasted_s=40.0, frees=2)


@pytest.mark.parametrize("kind", ["clock_set", "round_trip"])
def test_what_a_page_notes_under_a_name_of_the_labs_measures_nothing(kind: str) -> None:
    posing = event_row("P001", kind, utc="2026-01-01T00:00:20.000Z", data='{"role": "participant"}')
    assert posing.source == "participant"
    assert measured(posing) == measured()


def test_a_clock_that_was_set_makes_a_trial_suspect_whatever_the_rules_allow() -> None:
    found = measured(at(5, "clock_set", by_s=9.0), at(20, "clock_set", by_s=-3600.0), at(21, "clock_set", by_s=1.5))
    assert found.clock_set_s == (-3600.0, 1.5)
    assert broken_rules(QualityRules(), found) == (
        "the computer's clock was set by -3600.0 s",
        "the computer's clock was set by +1.5 s",
    )
    row = trial_row("P001", started_utc="2026-01-01T01:00:00.000Z", finished_utc="2026-01-01T00:00:00.000Z")
    told = judged(row, [], 0, QualityRules())
    assert told.quality == "suspect"
    assert json.loads(told.quality_broken or "") == ["by its times it ended 3600.0 s before it began"]


@pytest.mark.parametrize(
    ("events", "hidden_s"),
    [
        ([at(20, "page.hidden"), at(23.5, "page.visible")], 3.5),
        ([at(4, "page.hidden"), at(12, "page.visible")], 2.0),  # before the start
        ([at(45, "page.hidden")], 5.0),  # never came back
        ([at(45, "page.hidden"), at(58, "page.visible")], 5.0),
        ([at(20, "page.hidden"), at(25, "connected")], 5.0),  # reloaded
        ([at(20, "page.hidden"), at(21, "page.hidden"), at(22, "page.visible")], 2.0),
        ([at(4, "page.hidden"), at(6, "page.visible")], 0.0),
    ],
)
def test_a_hidden_page_is_timed_within_the_trial(events: list[EventRow], hidden_s: float) -> None:
    assert measured(*events).hidden_s == hidden_s


def test_a_rule_is_broken_by_more_than_its_bound_and_says_so() -> None:
    assert broken_rules(RULES, FINE) == ()
    assert broken_rules(RULES, Measured(None, 0.0, 0, 0, 0, 0)) == ()  # never measured is not slow
    assert broken_rules(RULES, Measured(100.1, 2.1, 2, 2, 1, 1, 2)) == (
        "round trip (95th percentile): 100.1 ms, at most 100 allowed",
        "page hidden: 2.1 s, at most 2 allowed",
        "late ticks: 2, at most 1 allowed",
        "focus lost: 2 times, at most 1 allowed",
        "gamepad lost: 1 times, at most 0 allowed",
        "readings unanswered: 1, at most 0 allowed",
        "arm freed: 2 times, at most 1 allowed",
    )


def test_a_trial_that_ended_gets_its_verdict_and_one_that_never_began_gets_none() -> None:
    ended = trial_row("P001", started_utc="2026-01-01T00:00:10Z", finished_utc="2026-01-01T00:00:50Z")
    assert judged(ended, (), 0, RULES).quality == "good"
    suspect = judged(ended, (at(20, "page.pad_unplugged"),), 0, RULES)
    assert (suspect.quality, suspect.pad_losses) == ("suspect", 1)
    assert json.loads(suspect.quality_broken or "") == ["gamepad lost: 1 times, at most 0 allowed"]
    freed = judged(ended, (), 0, RULES, frees=2)
    assert (freed.quality, freed.frees) == ("suspect", 2)
    assert judged(trial_row("P001", started_utc=None), (), 0, RULES).quality is None
