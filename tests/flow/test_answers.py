"""Answers are checked item by item, recorded as given, and scored only when complete."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.definition.builtin_questionnaires import INSTRUMENTS
from study.definition.study import Study
from study.flow.answers import (
    MAX_TEXT_CHARACTERS,
    AnswerError,
    answer_rows,
    describe,
    instrument,
    numbers_of,
    score,
    validate_answers,
    validate_comprehension,
    validate_debrief,
    validate_demographics,
    validate_surveys,
)
from study.flow.flow import HelpData
from study.flow.page import Refused, parse
from study.records import StudyError
from tests.support.study_samples import shipped_study

UTC = "2026-01-01T00:00:00+00:00"


@pytest.fixture
def study() -> Study:
    return shipped_study()


def full(instrument_id: str, value: int) -> dict[str, int]:
    return {item.id: value for item in instrument(instrument_id).items}


def fields(problems: tuple[Any, ...]) -> list[str]:
    return [problem.field for problem in problems]


def test_the_instruments_have_their_items_and_sources() -> None:
    sus, tlx = INSTRUMENTS["sus_modified"], INSTRUMENTS["tlx_raw"]
    assert (len(sus.items), len(tlx.items), sus.points, tlx.points) == (10, 6, 7, 7)
    assert [number for number, item in enumerate(sus.items, 1) if item.reversed] == [2, 4, 6, 8, 10]
    assert not any(item.reversed for item in tlx.items)
    assert "Brooke" in sus.source
    assert "Hart" in tlx.source
    assert "Staveland" in tlx.source
    assert all("modified" in form.source for form in (sus, tlx))
    assert [(item.low, item.high) for item in tlx.items if item.id == "performance"] == [("Perfect", "Failure")]


def test_usability_counts_the_negative_items_backwards() -> None:
    best = {item.id: 1 if item.reversed else 7 for item in instrument("sus_modified").items}
    worst = {item.id: 8 - value for item, value in zip(instrument("sus_modified").items, best.values(), strict=True)}
    assert score("sus_modified", best) == 7.0
    assert score("sus_modified", worst) == 1.0
    assert score("sus_modified", full("sus_modified", 7)) == 4.0
    assert score("sus_modified", {**best, "sus_02": 6}) == pytest.approx(6.5)


def test_workload_is_the_mean_of_the_six_scales() -> None:
    answers = {**full("tlx_raw", 2), "performance": 7, "effort": 5}
    assert score("tlx_raw", answers) == pytest.approx((2 * 4 + 7 + 5) / 6)


@settings(deadline=None)
@given(st.sampled_from(sorted(INSTRUMENTS)), st.data())
def test_a_score_lies_on_the_scale(instrument_id: str, data: st.DataObject) -> None:
    answers = {item: data.draw(st.integers(1, 7)) for item in full(instrument_id, 1)}
    assert 1.0 <= score(instrument_id, answers) <= 7.0


@pytest.mark.parametrize("value", [0, 8, -1, 3.5, "4", True, None, [4]])
def test_an_answer_off_the_scale_is_named_and_never_scored(value: object) -> None:
    answers: dict[str, Any] = {**full("tlx_raw", 3), "effort": value}
    problems = validate_answers("tlx_raw", answers)
    assert fields(problems) == ["answers.effort"]
    assert "1 to 7" in problems[0].message
    with pytest.raises(AnswerError, match=r"answers\.effort"):
        score("tlx_raw", answers)


def test_what_is_missing_or_unknown_is_named() -> None:
    answers = full("sus_modified", 4)
    del answers["sus_03"]
    answers["sus_3"] = 4
    problems = validate_answers("sus_modified", answers)
    assert fields(problems) == ["answers.sus_3", "answers.sus_03"]
    assert "did you mean" in problems[0].message
    assert "missing" in problems[1].message


def test_a_trial_needs_every_questionnaire_of_the_study(study: Study) -> None:
    complete = {name: full(name, 4) for name in study.surveys}
    assert validate_surveys(study, complete) == ()
    assert set(fields(validate_surveys(study, {"sus_modified": complete["sus_modified"]}))) == {
        f"answers.tlx_raw.{item}" for item in full("tlx_raw", 1)
    }
    assert fields(validate_surveys(study, {**complete, "panas": {}})) == ["answers.panas"]
    assert fields(validate_surveys(study, {**complete, "tlx_raw": 3})) == ["answers.tlx_raw"]
    assert fields(validate_surveys(study, None)) == ["answers"]


def test_demographics(study: Study) -> None:
    declined = {item.id: "no_answer" for item in study.demographics}
    assert validate_demographics(study, declined) == ()
    without_gender = {name: value for name, value in declined.items() if name != "gender"}
    assert validate_demographics(study, without_gender) == ()
    assert fields(validate_demographics(study, {**declined, "age_group": ""})) == ["answers.age_group"]
    problems = validate_demographics(study, {**declined, "handedness": "third"})
    assert fields(problems) == ["answers.handedness"]
    assert "left, right, both, no_answer" in problems[0].message
    assert fields(validate_demographics(study, {**declined, "name": "Ada"})) == ["answers.name"]
    assert fields(validate_demographics(study, [])) == ["answers"]


def test_demographics_of_other_kinds(study: Study) -> None:
    items = study.model_validate(
        {
            **study.model_dump(),
            "demographics": [
                {"id": "years", "prompt": "For how many years?", "kind": "number"},
                {"id": "job", "prompt": "What do you do?", "kind": "text", "required": False},
            ],
        }
    )
    assert validate_demographics(items, {"years": 3.5}) == ()
    assert validate_demographics(items, {"years": 3, "job": "pilot"}) == ()
    for years in ("three", float("nan"), True, [3]):
        assert fields(validate_demographics(items, {"years": years})) == ["answers.years"]
    assert fields(validate_demographics(items, {"years": 3, "job": 7})) == ["answers.job"]
    assert fields(validate_demographics(items, {"years": 3, "job": "x" * 4001})) == ["answers.job"]


def asking(study: Study, **item: object) -> Study:
    """The study with one question about the person, and one in free words at its end."""
    changed = {"id": "asked", "prompt": "?", **item}
    texts = {**study.model_dump()["texts"], "debrief_questions": [{"id": "comments", "prompt": "?"}]}
    return study.model_validate({**study.model_dump(), "demographics": [changed], "texts": texts})


@pytest.mark.parametrize(
    ("typed", "numeral"),
    [
        ("3,5", "3.5"),
        ("٣٫٥", "3.5"),
        (" 3.50 ", "3.50"),
        ("007", "7"),
        ("\N{MINUS SIGN}1", "-1"),
        ("1,234.5", "1234.5"),
        ("1e3", "1e3"),
    ],
)
def test_a_number_is_recorded_as_it_is_read_beside_what_was_typed(study: Study, typed: str, numeral: str) -> None:
    asked = asking(study, kind="number")
    assert validate_demographics(asked, {"asked": typed}) == ()
    (row,) = answer_rows("P001", "demographics", {"asked": typed}, UTC, numbers=numbers_of(asked))
    assert (row.value, row.typed) == (numeral, typed)
    (row,) = answer_rows("P001", "demographics", {"asked": 3.5}, UTC, numbers=numbers_of(asked))
    assert (row.value, row.typed) == ("3.5", None)


@pytest.mark.parametrize(
    ("bounds", "typed", "said"),
    [
        ({}, "12e", "not a number"),
        ({}, "1-2", "not a number"),
        ({}, "1e400", "too large"),
        ({}, 10**400, "must be a finite number"),
        ({}, -(10**309), "must be a finite number"),
        ({}, "1" * 101, "not a number"),
        ({}, "1,234", "could be 1234 or 1.234"),
        ({}, "  ", "not a number"),
        ({"whole": True}, "3,5", "not a whole number"),
        ({"whole": True}, 3.5, "not a whole number"),
        ({"least": 18}, "17", "below 18"),
        ({"most": 99}, "1e3", "above 99"),
        ({"most": 99}, 100, "above 99"),
    ],
)
def test_a_number_that_cannot_be_taken_is_refused_in_words(
    study: Study, bounds: dict[str, Any], typed: object, said: str
) -> None:
    for required in (True, False):
        asked = asking(study, kind="number", required=required, **bounds)
        (problem,) = validate_demographics(asked, {"asked": typed})
        assert problem.field == "answers.asked"
        assert said in problem.message


WORDS = [
    " both ends ",
    "two\nlines\ttab",
    "👩🏽‍🚀 e\u0301 \u202eבא\u202c",
    "NA",
    "=1+1",
    "'",
    '"',
    ",",
    "007",
    "a\u2028b",
    "-",
]


@pytest.mark.parametrize("words", WORDS)
def test_words_are_recorded_as_they_were_typed(study: Study, words: str) -> None:
    asked = asking(study, kind="text")
    assert validate_demographics(asked, {"asked": words}) == ()
    assert validate_debrief(asked, {"comments": words}) == ()
    for where, item in (("demographics", "asked"), ("debrief", "comments")):
        (row,) = answer_rows("P001", where, {item: words}, UTC, numbers=numbers_of(asked))
        assert (row.value, row.typed) == (words, None)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "x" * (MAX_TEXT_CHARACTERS + 1),
            f"{MAX_TEXT_CHARACTERS + 1} characters, and at most {MAX_TEXT_CHARACTERS}",
        ),
        ("a\0b", "U+0000"),
        ("a\rb", "U+000D"),
        ("a\x1bb", "U+001B"),
        ("a\x85b", "U+0085"),
        ("a\ud800b", "U+D800"),
    ],
)
def test_words_that_cannot_be_kept_as_they_are_are_refused(study: Study, words: str, said: str) -> None:
    asked = asking(study, kind="text", required=False)
    for problems in (validate_demographics(asked, {"asked": words}), validate_debrief(asked, {"comments": words})):
        assert [said in problem.message for problem in problems] == [True]
    with pytest.raises(Refused):
        parse(HelpData, {"text": words})  # as everything else that is typed freely


def test_blanks_alone_are_no_words(study: Study) -> None:
    for blank in (" ", "\n\t", "\N{NO-BREAK SPACE}"):
        for required in (True, False):
            asked = asking(study, kind="text", required=required)
            assert fields(validate_demographics(asked, {"asked": blank})) == ["answers.asked"]
        assert fields(validate_debrief(asking(study), {"comments": blank})) == ["answers.comments"]


def test_the_longest_words_fit_whatever_they_are_made_of(study: Study) -> None:
    for character in ("x", "é", "👍"):
        assert validate_debrief(asking(study), {"comments": character * MAX_TEXT_CHARACTERS}) == ()


def test_a_wrong_comprehension_answer_is_named_without_telling_the_right_one(study: Study) -> None:
    right = {question.id: question.correct for question in study.instructions.questions}
    assert validate_comprehension(study, right) == ()
    problems = validate_comprehension(study, {**right, "on_sound": "ignore"})
    assert fields(problems) == ["answers.on_sound"]
    assert "log" not in problems[0].message
    assert fields(validate_comprehension(study, {})) == [f"answers.{name}" for name in right]
    assert fields(validate_comprehension(study, {**right, "on_sound": "dance"})) == ["answers.on_sound"]


def test_the_debrief_may_be_left_empty(study: Study) -> None:
    assert validate_debrief(study, {}) == ()
    assert validate_debrief(study, {"comments": "Fine."}) == ()
    assert fields(validate_debrief(study, {"comments": 3})) == ["answers.comments"]


def test_rows_hold_the_answers_as_given() -> None:
    rows = answer_rows("P001", "tlx_raw", {"effort": 7, "performance": 1}, UTC, condition="balanced", trial=2)
    assert [(row.item, row.value, row.condition, row.trial) for row in rows] == [
        ("effort", "7", "balanced", 2),
        ("performance", "1", "balanced", 2),
    ]
    assert answer_rows("P001", "debrief", {"comments": " ", "problems": None}, UTC) == ()


def test_the_page_gets_no_directions() -> None:
    shown = describe("sus_modified")
    assert set(shown) == {"id", "title", "intro", "source", "points", "items"}
    assert set(shown["items"][0]) == {"id", "text", "low", "high"}
    with pytest.raises(StudyError, match="there are"):
        instrument("sus")
