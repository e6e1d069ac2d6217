"""Checking, recording and scoring answers: questionnaires, demographics, comprehension check, debrief.

An answer that is missing, unknown or out of range is named, never dropped. Answers are recorded as given; reversing
and averaging happen in `score`, which only the analysis calls.
"""

from __future__ import annotations

import sys
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from study.definition.builtin_questionnaires import INSTRUMENTS, Instrument, Item
from study.definition.sections import DemographicItem
from study.definition.study import Study
from study.definition.toml_reader import closest
from study.flow.typed_number import Asked, Flaw, flaw_of, number_of, sentence
from study.language.words import ENGLISH, Words
from study.records import RecordProblem, StudyError, SurveyAnswerRow

MAX_TEXT_CHARACTERS = 4000
"""Of anything that is typed freely, counted as Unicode characters; the pages are told."""
MAX_NUMBER_CHARACTERS = 100


@dataclass(frozen=True)
class AnswerProblem:
    """One answer that cannot be taken; `field` is its place in the submitted data, such as `answers.tlx_raw.effort`."""

    field: str
    message: str


class AnswerError(StudyError):
    """Answers that cannot be scored or recorded; `problems` names each."""

    def __init__(self, problems: Iterable[AnswerProblem]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(f"{problem.field}: {problem.message}" for problem in self.problems))


def instrument(instrument_id: str) -> Instrument:
    """The built-in questionnaire of that id; `StudyError` names the ones there are."""
    if instrument_id not in INSTRUMENTS:
        raise StudyError(f"no questionnaire {instrument_id!r}; there are {list(INSTRUMENTS)}")
    return INSTRUMENTS[instrument_id]


def validate_answers(
    questionnaire: str | Instrument, answers: object, field: str = "answers"
) -> tuple[AnswerProblem, ...]:
    """Everything wrong with the answers {item: 1…points} to one questionnaire; empty when complete."""
    form = _form(questionnaire)
    if not isinstance(answers, Mapping):
        return (AnswerProblem(field, "must be an object of item id to answer"),)
    found = [*_unknown(answers, [item.id for item in form.items], field)]
    for item in form.items:
        sentence = _scale_problem(item, answers, form.points)
        if sentence:
            found.append(AnswerProblem(f"{field}.{item.id}", f"{sentence}; answers are 1 to {form.points}"))
    return tuple(found)


def validate_surveys(study: Study, answers: object) -> tuple[AnswerProblem, ...]:
    """Everything wrong with the answers {questionnaire: {item: point}} after a trial."""
    if not isinstance(answers, Mapping):
        return (AnswerProblem("answers", "must be an object of questionnaire id to answers"),)
    found = [*_unknown(answers, study.surveys, "answers")]
    for form in study.instruments:
        found += validate_answers(form, answers.get(form.id, {}), f"answers.{form.id}")
    return tuple(found)


def validate_demographics(study: Study, answers: object) -> tuple[AnswerProblem, ...]:
    """Everything wrong with the answers {item: option id, text, or number as it was typed or as a number}; not required
    items may be left out."""
    if not isinstance(answers, Mapping):
        return (AnswerProblem("answers", "must be an object of item id to answer"),)
    found = [*_unknown(answers, [item.id for item in study.demographics], "answers")]
    for item in study.demographics:
        field, value = f"answers.{item.id}", answers.get(item.id)
        if value is None or value == "":
            if item.required:
                found.append(AnswerProblem(field, "is missing"))
        elif item.kind == "choice":
            found += _choice_problem(field, value, [option.id for option in item.options])
        else:
            problem = (
                _number_problem(value, _asked(item, study.words), study.words)
                if item.kind == "number"
                else text_problem(value, study.words)
            )
            if problem:
                found.append(AnswerProblem(field, problem))
    return tuple(found)


def text_problem(value: object, words: Words = ENGLISH) -> str | None:
    """Why words cannot be taken as they are; None when they can."""
    if not isinstance(value, str):
        return f"is {value!r}, must be a text"
    if len(value) > MAX_TEXT_CHARACTERS:
        return words.t(
            "This has {n} characters, and at most {most} can be saved. Please shorten it.",
            n=len(value),
            most=MAX_TEXT_CHARACTERS,
        )
    if not value.strip():
        return words.t("This holds blanks alone. Please write something, or leave it empty.")
    return unseen_problem(value, words)


def unseen_problem(text: str, words: Words = ENGLISH) -> str | None:
    """Why words with control characters cannot be taken; None when there are none."""
    unseen = next((one for one in text if unicodedata.category(one) in ("Cc", "Cs") and one not in "\t\n"), None)
    if unseen is None:
        return None
    code = f"U+{ord(unseen):04X}"
    return words.t("This holds a character that nobody can read ({code}). Please take it out.", code=code)


def _number_problem(value: object, asked: Asked, words: Words) -> str | None:
    flaw: Flaw | None
    if isinstance(value, str):
        flaw = "no_number" if len(value) > MAX_NUMBER_CHARACTERS else number_of(value, asked)[1]
    elif isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
        return f"is {value!r}, must be a finite number"
    else:
        flaw = flaw_of(value, asked)
    return sentence(flaw, value, asked, words) if flaw else None


def numbers_of(study: Study) -> dict[str, Asked]:
    """The questions about the person that are answered by a number, and what each takes."""
    return {item.id: _asked(item, study.words) for item in study.demographics if item.kind == "number"}


def _asked(item: DemographicItem, words: Words) -> Asked:
    """What a question for a number takes."""
    return Asked(words.signs.decimal_mark, item.whole, item.least, item.most)


def validate_comprehension(study: Study, answers: object) -> tuple[AnswerProblem, ...]:
    """Everything missing, unknown or wrong among the answers {question: option id}. The right answer is not told."""
    if not isinstance(answers, Mapping):
        return (AnswerProblem("answers", "must be an object of question id to option id"),)
    questions = study.instructions.questions
    wrong = study.words.t("This is not the right answer. Please read the instructions again.")
    found = [*_unknown(answers, [question.id for question in questions], "answers")]
    for question in questions:
        field, value = f"answers.{question.id}", answers.get(question.id)
        problems = _choice_problem(field, value, [option.id for option in question.options])
        if not problems and value != question.correct:
            problems = [AnswerProblem(field, wrong)]
        found += problems
    return tuple(found)


def validate_debrief(study: Study, answers: object) -> tuple[AnswerProblem, ...]:
    """Everything wrong with the answers {question: text}; all of them may be left out."""
    if not isinstance(answers, Mapping):
        return (AnswerProblem("answers", "must be an object of question id to text"),)
    found = [*_unknown(answers, [question.id for question in study.texts.debrief_questions], "answers")]
    for question in study.texts.debrief_questions:
        value = answers.get(question.id)
        problem = None if value is None or value == "" else text_problem(value, study.words)
        if problem:
            found.append(AnswerProblem(f"answers.{question.id}", problem))
    return tuple(found)


def answer_rows(
    participant: str,
    instrument_id: str,
    answers: Mapping[str, Any],
    utc: str,
    *,
    condition: str | None = None,
    trial: int | None = None,
    numbers: Mapping[str, Asked] = MappingProxyType({}),
) -> tuple[SurveyAnswerRow, ...]:
    """The rows of checked answers, in the order given; blank ones leave no row.

    `instrument_id` is a questionnaire or one of demographics, comprehension and debrief. `numbers` are the items whose
    answer is a number: what was typed stands beside the number that it is read as.
    """
    rows = []
    for item, value in answers.items():
        if _is_blank(value):
            continue
        numeral = number_of(value, numbers[item])[0] if item in numbers and isinstance(value, str) else None
        rows.append(
            SurveyAnswerRow(
                participant=participant,
                condition=condition,
                trial=trial,
                instrument=instrument_id,
                item=item,
                value=str(value) if numeral is None else numeral,
                answered_utc=utc,
                typed=None if numeral is None else value,
            )
        )
    return tuple(rows)


def score(questionnaire: str | Instrument, answers: Mapping[str, int]) -> float:
    """The mean of all items on 1 to 7 after reversing: usability (modified SUS) or workload (modified raw TLX). A
    study's own questionnaire says whether it is the mean or the sum.

    Raises `AnswerError` when an item is missing, unknown or out of range: there is no score of half a questionnaire.
    """
    form = _form(questionnaire)
    problems = validate_answers(form, answers)
    if problems:
        raise AnswerError(problems)
    points = [form.points + 1 - answers[item.id] if item.reversed else answers[item.id] for item in form.items]
    return sum(points) / (len(points) if form.method == "mean" else 1)


def describe(questionnaire: str | Instrument) -> dict[str, Any]:
    """A questionnaire as the page shows it: without directions and scoring."""
    form = _form(questionnaire)
    return {
        "id": form.id,
        "title": form.title,
        "intro": form.intro,
        "source": form.source,
        "points": form.points,
        "items": [{"id": item.id, "text": item.text, "low": item.low, "high": item.high} for item in form.items],
    }


def _form(questionnaire: str | Instrument) -> Instrument:
    return questionnaire if isinstance(questionnaire, Instrument) else instrument(questionnaire)


def _scale_problem(item: Item, answers: Mapping[str, object], points: int) -> str | None:
    value = answers.get(item.id)
    if value is None:
        return "is missing"
    if isinstance(value, bool) or not isinstance(value, int):
        return f"is {value!r}, must be a whole number"
    return None if 1 <= value <= points else f"is {value}"


def _choice_problem(field: str, value: object, options: list[str]) -> list[AnswerProblem]:
    if _is_blank(value):
        return [AnswerProblem(field, "is missing")]
    if value in options:
        return []
    return [AnswerProblem(field, f"is {value!r}; allowed: {', '.join(options)}")]


def _unknown(answers: Mapping[Any, object], known: Iterable[str], field: str) -> Iterator[AnswerProblem]:
    names = list(known)
    for name in answers:
        if name not in names:
            yield AnswerProblem(
                f"{field}.{name}", f"is not an item{closest(str(name), names) or ';'} items: {', '.join(names)}"
            )


def _is_blank(value: object) -> bool:
    return value is None or (isinstance(value, str) and not value.strip())


@dataclass(frozen=True)
class SurveyScore:
    """One questionnaire of one participant about one condition, 1 to 7 after reversing."""

    participant: str
    condition: str
    position: int
    instrument: str
    score: float


def survey_scores(
    answers: Iterable[SurveyAnswerRow], own: Mapping[str, Instrument] | None = None
) -> tuple[SurveyScore, ...]:
    """Usability and workload after every trial, and the score of every one of the study's `own` questionnaires by id;
    answers about the whole session (demographics) are passed over.

    Raises `StudyError` when an item is missing, unknown, answered twice or out of range, naming the questionnaire.
    """
    given: dict[tuple[str, str, int, str], dict[str, Any]] = {}
    for answer in answers:
        if answer.condition is None or answer.trial is None:
            continue
        items = given.setdefault((answer.participant, answer.condition, answer.trial, answer.instrument), {})
        if answer.item in items:
            raise RecordProblem(
                answer.participant,
                f"participant {answer.participant}, trial {answer.trial}: {answer.instrument}.{answer.item} "
                "is answered twice; keep one of the rows",
            )
        items[answer.item] = _point(answer)
    scores = []
    for (participant, condition, trial, instrument), items in given.items():
        try:
            value = score((own or {}).get(instrument, instrument), items)
        except StudyError as error:
            raise RecordProblem(participant, f"participant {participant}, trial {trial}: {error}") from None
        scores.append(SurveyScore(participant, condition, trial, instrument, value))
    return tuple(scores)


def _point(answer: SurveyAnswerRow) -> int:
    try:
        return int(answer.value)
    except ValueError:
        raise RecordProblem(
            answer.participant,
            f"participant {answer.participant}, trial {answer.trial}: {answer.instrument}.{answer.item} is "
            f"{answer.value!r}; it must be a whole number",
        ) from None
