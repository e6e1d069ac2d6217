"""The distractor as a function of trial time: when readings come, what becomes of answers, when the pad is ignored."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.definition.sections import DistractorSettings
from study.flow.distractors.interface import Stimulus
from study.flow.distractors.readings import ReadingParameters, Readings
from study.flow.distractors.state import DistractorState, from_rows, stimuli_of
from study.records import StudyError

UTC = "2026-01-01T00:00:00+00:00"


def reading(alert: int) -> Stimulus:
    return Stimulus(f"{100 + alert}.5", entry="number")


def _shown(text: str, alert: int) -> Stimulus:
    return Stimulus(text, entry="number")


def start(**changes: object) -> DistractorState:
    return DistractorState(Readings(ReadingParameters(), DistractorSettings.model_validate(changes)))


def at(state: DistractorState, trial_s: float) -> DistractorState:
    """The state after ticking to `trial_s`."""
    for tick in range(int(trial_s * 2) + 1):
        state, _ = state.advance(tick * 0.5, reading)
    return state


def statuses(state: DistractorState) -> list[str]:
    return [alert.status for alert in state.alerts]


def test_readings_come_at_ten_seconds_and_every_twenty() -> None:
    state, raised = start(), []
    for tick in range(200):
        state, changed = state.advance(tick * 0.5, reading)
        raised += [(tick * 0.5, alert.alert, alert.stimulus.text) for alert in changed if alert.status == "open"]
    assert raised == [(10, 1, "101.5"), (30, 2, "102.5"), (50, 3, "103.5"), (70, 4, "104.5"), (90, 5, "105.5")]


def test_a_reading_nobody_logs_expires_when_the_next_one_comes() -> None:
    state = at(start(), 29.5)
    assert statuses(state) == ["open"]
    state, changed = state.advance(30.0, reading)
    assert [(alert.alert, alert.status) for alert in changed] == [(1, "expired"), (2, "open")]


def test_a_shorter_time_to_answer_ends_it_earlier() -> None:
    state = at(start(answer_within_s=8), 17.5)
    assert statuses(state) == ["open"]
    state, changed = state.advance(18.0, reading)
    assert [(alert.alert, alert.status) for alert in changed] == [(1, "expired")]
    assert state.open_alert is None


ALL_ALIKE = [
    "101.5",
    " 101,5 ",
    "101.50",
    "0101.5",
    "+101.5",
    "１０１．５",
    "１０１，５",
    "101。5",
    "١٠١٫٥",
    "۱۰۱٫۵",
    "۱۰۱،۵",
    "१०१.५",
    "၁၀၁.၅",
    "\N{MATHEMATICAL DOUBLE-STRUCK DIGIT ONE}01.5",
    "\u200e101.5\u200f",
    "\u2066101.5\u2069",
    "1\u200d01.5",
    "101.5\ufeff",
    "101.5\N{NO-BREAK SPACE}",
    "\N{NARROW NO-BREAK SPACE}101.5",
    "1015e-1",
]


@pytest.mark.parametrize(
    ("typed", "correct"),
    [
        *((typed, 1) for typed in ALL_ALIKE),
        ("101.6", 0),
        ("1015", 0),
        ("-101.5", 0),
        ("1,015", 0),
        ("101.5000000000000000000001", 0),
    ],
)
def test_an_answer_is_recorded_as_typed_and_judged(typed: str, correct: int) -> None:
    state, result = at(start(), 12.0).answer(1, typed, 12.0, UTC)
    row = state.row(state.alerts[0], "P001", "balanced", 2)
    assert result == "accepted"
    assert (row.status, row.correct, row.answered_trial_s, row.answered_utc) == ("answered", correct, 12.0, UTC)
    assert row.answer == typed


@pytest.mark.parametrize(
    ("typed", "result"),
    [
        ("", "empty"),
        (" \N{NO-BREAK SPACE}", "empty"),
        ("1" * 41, "too_long"),
        ("101.5\0", "unreadable"),
        ("101.5\x1b", "unreadable"),
        *((typed, "no_number") for typed in ("abc", "101.5.", "101..5", "1o1.5", "10¹.5", "101½", "١٠١.٥٫", "\u200e")),
    ],
)
def test_what_is_no_reading_is_refused_and_nothing_is_recorded(typed: str, result: str) -> None:
    state = at(start(), 12.0)
    assert state.answer(1, typed, 12.0, UTC) == (state, result)


def test_a_mark_that_may_be_of_either_kind_counts_for_the_reading_that_is_shown() -> None:
    for shown, typed in (
        ("1.234", "1,234"),
        ("1234", "1,234"),
        ("1234567.8", "1,234,567.8"),
        ("1234567.8", "1 234 567,8"),
    ):
        state, _ = start().advance(10.0, partial(_shown, shown))
        answered, result = state.answer(1, typed, 12.0, UTC)
        assert (result, answered.alerts[0].correct, answered.alerts[0].answer) == ("accepted", True, typed)


def test_answers_that_cannot_count_change_nothing() -> None:
    state = at(start(), 12.0)
    assert state.answer(2, "1", 12.0, UTC) == (state, "unknown")
    assert state.answer(0, "1", 12.0, UTC) == (state, "unknown")
    assert state.answer(-1, "1", 12.0, UTC) == (state, "unknown")
    assert state.answer(1, "  ", 12.0, UTC) == (state, "empty")
    answered, _ = state.answer(1, "101.5", 12.0, UTC)
    assert answered.answer(1, "999", 13.0, UTC) == (answered, "duplicate")
    later = at(state, 31.0)
    assert later.answer(1, "101.5", 31.0, UTC) == (later, "late")
    assert state.answer(1, "101.5", 30.0, UTC) == (state, "late")  # the tick at 30 s has not run yet
    over, _ = state.close()
    assert over.answer(1, "101.5", 12.5, UTC) == (over, "late")


def test_the_first_report_of_seen_and_heard_counts() -> None:
    state = at(start(), 10.0).shown(1, "a").shown(1, "b").heard(1, "c").heard(1, "d").shown(7, "e")
    assert (state.alerts[0].shown_utc, state.alerts[0].heard_utc) == ("a", "c")


def test_the_end_of_the_trial_closes_what_is_open_and_raises_no_more() -> None:
    state, closed = at(start(), 12.0).close()
    assert [alert.status for alert in closed] == ["trial_ended"]
    assert state.advance(1000.0, reading) == (state, ())
    assert not state.locked(12.0)
    assert at(start(), 5.0).close()[1] == ()


def test_one_screen_ignores_the_pad_until_the_answer_is_in_and_five_seconds_have_passed() -> None:
    state = at(start(), 9.5)
    assert not state.locked(9.5)
    state = at(state, 11.0)
    assert state.locked(11.0)
    quick, _ = state.answer(1, "101.5", 11.0, UTC)
    assert quick.locked(11.0)
    assert quick.release_in_s(11.0) == 4.0
    assert quick.locked(14.5)
    assert not quick.locked(15.0)
    assert quick.release_in_s(15.0) == 0.0
    slow = at(state, 20.0)
    assert slow.locked(20.0)
    slow, _ = slow.answer(1, "101.5", 20.0, UTC)
    assert not slow.locked(20.0)


def test_an_expired_reading_releases_the_pad() -> None:
    state = at(start(answer_within_s=8), 18.0)
    assert statuses(state) == ["expired"]
    assert not state.locked(18.0)


def test_a_second_device_never_locks_the_pad() -> None:
    state = at(start(placement="second_device"), 11.0)
    assert state.open_alert is not None
    assert not state.locked(11.0)
    assert state.release_in_s(11.0) == 0.0


def test_a_study_without_distractor_raises_nothing() -> None:
    assert at(start(enabled=False), 100.0).alerts == ()


@pytest.mark.parametrize(("first_s", "due_s"), [(10.0, 10.0), (60.0, 10.0), (4.0, 4.0)])
def test_a_practice_has_one_reading_early_enough_to_come_in_it(first_s: float, due_s: float) -> None:
    state = replace(start(first_s=first_s), practice=True)
    assert at(state, due_s - 0.5).alerts == ()
    raised = at(state, due_s)
    assert [alert.due_trial_s for alert in raised.alerts] == [due_s]
    assert raised.locked(due_s)
    answered, result = raised.answer(1, "101.5", due_s + 3.0, UTC)
    assert result == "accepted"
    assert answered.locked(due_s + 4.5) and not answered.locked(due_s + 5.0)
    assert len(at(answered, 200.0).alerts) == 1
    ignored = at(state, 200.0)
    assert statuses(ignored) == ["expired"] and not ignored.locked(200.0)


def test_what_a_practice_shows_is_not_what_its_trial_shows() -> None:
    readings = Readings(ReadingParameters(), DistractorSettings())
    shown = {
        readings.stimulus(7, stimuli_of(trial, practice), 1).text for trial in (1, 2, 3) for practice in (True, False)
    }
    assert len(shown) == 6


def test_the_state_comes_back_from_its_rows() -> None:
    state, _ = at(start(), 35.0).shown(2, UTC).answer(2, "7", 35.0, UTC)
    state = at(state, 52.0)
    rows = [state.row(alert, "P001", "balanced", 1) for alert in state.alerts]
    assert from_rows(state.distractor, 7, reversed(rows)) == state
    assert [one.stimulus.entry for one in from_rows(state.distractor, 7, rows).alerts] == ["number"] * 3
    with pytest.raises(StudyError, match="found 3, expected 2"):
        from_rows(state.distractor, 7, [rows[0], rows[2]])


@settings(deadline=None)
@given(st.floats(0, 30), st.floats(0.5, 40), st.floats(0.1, 1), st.lists(st.integers(0, 400), max_size=30))
def test_there_is_never_more_than_one_open_and_times_are_kept(
    first_s: float, every_s: float, share: float, ticks: list[int]
) -> None:
    state = start(first_s=first_s, every_s=every_s, answer_within_s=every_s * share, away_min_s=0)
    for tick in sorted(ticks):  # ticks may be missing: what is due in between still happens
        trial_s = tick * 0.5
        state, _ = state.advance(trial_s, reading)
        assert statuses(state).count("open") <= 1
        assert all(alert.due_trial_s <= trial_s for alert in state.alerts)
        assert state.due_s(len(state.alerts) + 1) > trial_s
        if tick % 3 == 0 and state.open_alert:
            state, result = state.answer(state.open_alert.alert, "1", trial_s, UTC)
            assert result == "accepted"
    assert [alert.alert for alert in state.alerts] == list(range(1, len(state.alerts) + 1))
