"""What every kind of distractor keeps to: the two that ship, and one that somebody else wrote."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.definition.sections import DistractorSettings
from study.flow.distractors.contract import broken_promise
from study.flow.distractors.interface import Choice, Distractor, Stimulus, Words
from study.flow.distractors.nback import NBack, NBackParameters
from study.flow.distractors.readings import ReadingParameters, Readings
from study.flow.distractors.state import DistractorState, from_rows
from study.records import StudyError
from tests.support.outside_package import DISTRACTOR

UTC = "2026-01-01T00:00:00+00:00"
SEED, TRIAL = 11, 2


def outside() -> Any:
    """The module of the outside package, without installing it."""
    module = ModuleType("outside_distractors")
    exec(compile(DISTRACTOR, "outside_distractors.py", "exec", dont_inherit=True), vars(module))
    return module


def kinds() -> list[Distractor[Any]]:
    common = DistractorSettings()
    quick = DistractorSettings(first_s=2.0, every_s=3.0, answer_within_s=2.5, away_min_s=1.0)
    sums = outside()
    return [
        Readings(ReadingParameters(), common),
        NBack(NBackParameters(), quick),
        NBack(NBackParameters(n=1, letters="AB", target_rate=1.0), common),
        sums.Sums(sums.SumParameters(), common),
    ]


each = pytest.mark.parametrize("kind", kinds(), ids=["readings", "nback", "1-back", "outside"])


def run(kind: Distractor[Any], until_s: float, answer: Callable[[DistractorState], str | None]) -> DistractorState:
    """A trial up to a time, each alert answered (or not) at the tick it is raised."""
    state = DistractorState(kind)
    for tick in range(int(until_s * 2) + 1):
        state, changed = state.advance(tick * 0.5, lambda number: kind.stimulus(SEED, TRIAL, number))
        for alert in changed:
            typed = answer(state) if alert.status == "open" else None
            if typed is not None:
                state, result = state.answer(alert.alert, typed, tick * 0.5, UTC)
                assert result == "accepted"
    return state


def right(state: DistractorState) -> str:
    return state.right_answer(len(state.alerts))


@each
def test_it_keeps_what_a_distractor_promises(kind: Distractor[Any]) -> None:
    assert broken_promise(kind) is None


@each
def test_its_right_answers_count_and_are_recorded(kind: Distractor[Any]) -> None:
    state = run(kind, 130.0, right)
    rows = [state.row(alert, "P001", "balanced", TRIAL) for alert in state.alerts]
    assert len(rows) >= 5
    assert {(row.status, row.correct) for row in rows} == {("answered", 1)}
    assert [row.reading for row in rows] == [
        kind.stimulus(SEED, TRIAL, number).text for number in range(1, len(rows) + 1)
    ]


@each
def test_nobody_answers_and_all_but_the_last_expire(kind: Distractor[Any]) -> None:
    state = run(kind, 100.0, lambda state: None)
    assert {alert.status for alert in state.alerts[:-1]} == {"expired"}
    assert {alert.correct for alert in state.alerts} == {None}
    late, result = state.answer(1, state.right_answer(1), 100.0, UTC)
    assert (late, result) == (state, "late")


@each
def test_it_comes_back_from_its_rows_and_goes_on_alike(kind: Distractor[Any]) -> None:
    whole = run(kind, 130.0, right)
    half = run(kind, 47.0, right)
    rows = [half.row(alert, "P001", "balanced", TRIAL) for alert in half.alerts]
    back = from_rows(kind, SEED, rows)
    assert back == half
    for tick in range(95, 261):
        back, changed = back.advance(tick * 0.5, lambda number: kind.stimulus(SEED, TRIAL, number))
        if any(alert.status == "open" for alert in changed):
            back, _ = back.answer(len(back.alerts), right(back), tick * 0.5, UTC)
    assert back == whole


@each
@pytest.mark.parametrize("rate", [0.0, 0.4, 1.0])
def test_a_simulated_person_errs_at_their_rate(kind: Distractor[Any], rate: float) -> None:
    stimuli = [kind.stimulus(SEED, TRIAL, number) for number in range(1, 6)]
    rng = np.random.default_rng(3)
    answers = [kind.simulated_answer(stimuli, rate, rng) for _ in range(500)]
    assert all(stimuli[-1].takes(answer) for answer in answers)
    wrong = sum(not kind.is_right(answer, stimuli) for answer in answers) / len(answers)
    # A reading's point is drawn as often as its digits, and cannot be mistyped.
    assert wrong == pytest.approx(rate * (0.8 if isinstance(kind, Readings) else 1.0), abs=0.06)


# ---- N-back -----------------------------------------------------------------------------------------------------


def letters(parameters: NBackParameters, count: int, seed: int = SEED) -> list[str]:
    kind = NBack(parameters, DistractorSettings())
    return [kind.stimulus(seed, TRIAL, number).text for number in range(1, count + 1)]


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**63), st.integers(1, 5), st.floats(0, 1))
def test_a_letter_is_the_same_as_n_back_as_often_as_asked(seed: int, n: int, rate: float) -> None:
    parameters = NBackParameters(n=n, target_rate=rate)
    drawn = letters(parameters, 60, seed)
    same = [drawn[place] == drawn[place - n] for place in range(n, 60)]
    # Nothing but the targets comes back after n letters.
    assert sum(same) / len(same) == pytest.approx(rate, abs=5 * math.sqrt(0.25 / len(same)))
    assert set(drawn) <= set(parameters.letters)
    kind = NBack(parameters, DistractorSettings())
    stimuli = [kind.stimulus(seed, TRIAL, number) for number in range(1, 61)]
    told = [kind.right_answer(stimuli[: number + 1]) == "same" for number in range(60)]
    assert told == [False] * n + same


def test_letters_stay_what_they_were() -> None:
    """Recorded data refer to seeds: the same seed must mean the same letters in every later version."""
    assert "".join(letters(NBackParameters(), 12, seed=7)) == "KHRMBMBMBRFQ"


def test_each_trial_and_each_person_has_letters_of_their_own() -> None:
    kind = NBack(NBackParameters(), DistractorSettings())
    drawn = {
        tuple(kind.stimulus(seed, trial, number).text for number in range(1, 9)) for seed in (1, 2) for trial in (1, 2)
    }
    assert len(drawn) == 4


def test_an_answer_that_is_no_choice_changes_nothing() -> None:
    kind = NBack(NBackParameters(), DistractorSettings())
    state, _ = DistractorState(kind).advance(10.0, lambda number: kind.stimulus(SEED, TRIAL, number))
    assert state.answer(1, "perhaps", 10.0, UTC) == (state, "no_choice")
    assert state.answer(1, " ", 10.0, UTC) == (state, "empty")
    answered, result = state.answer(1, "same", 10.0, UTC)
    assert (result, answered.alerts[0].correct) == ("accepted", False)  # nothing to be the same as


# ---- what a kind of somebody's own may get wrong ----------------------------------------------------------------


class Plain(Distractor[ReadingParameters]):
    Parameters = ReadingParameters
    words = Words("word", "words")
    shown = Stimulus("hello")

    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        return self.shown

    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        return stimuli[-1].choices[0].id if stimuli[-1].choices else stimuli[-1].text


YES, NO = Choice("yes", "Yes", "1"), Choice("no", "No", "2")


@pytest.mark.parametrize(
    ("stimulus", "sentence"),
    [
        ("hello", "stimulus 1 is 'hello'; it must be a Stimulus"),
        (Stimulus(""), "stimulus 1 shows ''; it must be a text of 1 to 40 characters"),
        (Stimulus("x" * 41), "it must be a text of 1 to 40 characters"),
        (Stimulus("x", "y" * 121), "it must be a text of at most 120 characters"),
        (Stimulus("x", choices=(YES,)), "they must be none .* or a tuple of 2 to 9"),
        (Stimulus("x", choices=(YES, replace(NO, id=" "))), "it must have a label and an id of 1 to 40 characters"),
        (Stimulus("x", choices=(YES, replace(NO, key="12"))), "its key must be one character"),
        (Stimulus("x", choices=(YES, replace(NO, key=" "))), "its key must be one character"),
        (Stimulus("x", choices=(YES, replace(NO, id="yes"))), "choices with the ids yes, yes; they must be different"),
        (Stimulus("x", choices=(YES, replace(NO, key="1"))), "choices with the keys 1, 1; they must be different"),
    ],
)
def test_a_stimulus_that_cannot_be_shown_is_told(stimulus: Any, sentence: str) -> None:
    kind = Plain(ReadingParameters(), DistractorSettings())
    kind.shown = stimulus
    told = broken_promise(kind)
    assert told is not None
    assert "\n" not in told
    assert re.search(sentence, told)


class Restless(Plain):
    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.count = 0

    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        self.count += 1
        return Stimulus(str(self.count))


class Unanswerable(Plain):
    def is_right(self, answer: str, stimuli: Sequence[Stimulus]) -> bool:
        return False


class Speechless(Plain):
    words = "words"  # type: ignore[assignment]


class Elsewhere(Plain):
    shown = Stimulus("x", choices=(YES, NO))

    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        return "maybe"


class Mute(Plain):
    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        return ""


class Standing(Plain):
    def due_s(self, number: int) -> float:
        return 10.0


class Failing(Plain):
    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        raise ValueError("nothing\nto show")


@pytest.mark.parametrize(
    ("broken", "sentence"),
    [
        (Restless, "stimulus 1 is another one when it is asked for again"),
        (Unanswerable, "its own right answer 'hello' to stimulus 1 does not count as right"),
        (Speechless, "words is 'words'; it must be Words"),
        (Elsewhere, "the right answer 'maybe' to stimulus 1 is none of its choices: yes, no"),
        (Mute, "the right answer '' to stimulus 1 must be 1 to 40 characters"),
        (Standing, "stimulus 1 is due at 10.0 s, ends at 30.0 s, and the next one is due at 10.0 s"),
        (Failing, "raises ValueError: nothing to show"),
    ],
)
def test_a_kind_that_breaks_a_promise_is_told_in_one_line(broken: type[Plain], sentence: str) -> None:
    told = broken_promise(broken(ReadingParameters(), DistractorSettings()))
    assert told is not None
    assert told.startswith(sentence)
    assert "\n" not in told


def test_a_schedule_that_stands_still_later_on_ends_the_trial_with_a_sentence() -> None:
    state = DistractorState(Standing(ReadingParameters(), DistractorSettings()))
    with pytest.raises(StudyError, match=r"alert 2 is due at 10\.0 s, (not|which is not) after"):
        state.advance(40.0, lambda number: Stimulus("x"))
