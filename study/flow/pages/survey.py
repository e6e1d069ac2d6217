"""The questionnaires after each trial."""

from __future__ import annotations

from study.definition.study import Study
from study.flow.answers import answer_rows, describe, validate_surveys
from study.flow.page import (
    AnswersData,
    Content,
    FlowPage,
    HandedIn,
    Outcome,
    PageContext,
    Person,
    Step,
    StepContext,
    check,
)
from study.flow.protocol import Event, Session
from study.language.locales import language


def asks_nothing(study: Study) -> bool:
    """Whether the study has no questionnaires."""
    return not study.surveys


def content(session: Session, context: PageContext) -> Content:
    """The questionnaires, without how they are scored. One in another language than
    the study's says so."""
    forms = []
    for instrument in context.study.instruments:
        form = describe(instrument)
        if instrument.language not in ("", context.study.language):
            other = language(instrument.language)
            form |= {"language": instrument.language, "dir": other.direction if other is not None else "ltr"}
        forms.append(form)
    return {"instruments": forms}


def scripted(content: Content, person: Person) -> HandedIn:
    """How the person rates the trial."""
    return HandedIn("survey", {"answers": {form["id"]: person.rated(form) for form in content["instruments"]}})


def _follow(context: StepContext, data: AnswersData) -> Outcome:
    answers = data.answers
    check(validate_surveys(context.study, answers))
    session = context.session
    rows = [
        row
        for instrument, items in answers.items()
        for row in answer_rows(
            session.participant, instrument, items, context.utc, condition=context.condition, trial=session.trial
        )
    ]
    return Outcome(Event("survey_done"), answers=tuple(rows))


PAGE = FlowPage(
    state="survey",
    leads_on="survey_done",
    content=content,
    steps={"survey": Step(AnswersData, _follow)},
    scripted=scripted,
    left_out=asks_nothing,
    per_trial=True,
)
