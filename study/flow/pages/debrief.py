"""What it was about, and room for a word about it."""

from __future__ import annotations

from study.flow.answers import answer_rows, validate_debrief
from study.flow.facts import as_read
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


def content(session: Session, context: PageContext) -> Content:
    """The study's words and questions."""
    texts = as_read(context.study).texts
    return {
        "text": list(texts.debrief),
        "questions": [question.model_dump() for question in texts.debrief_questions],
    }


def scripted(content: Content, person: Person) -> HandedIn:
    """Nothing to add."""
    return HandedIn("debrief", {"answers": {}})


def _follow(context: StepContext, data: AnswersData) -> Outcome:
    answers = data.answers
    check(validate_debrief(context.study, answers))
    return Outcome(
        Event("debrief_done"), answers=answer_rows(context.session.participant, "debrief", answers, context.utc)
    )


PAGE = FlowPage(
    state="debrief",
    leads_on="debrief_done",
    content=content,
    steps={"debrief": Step(AnswersData, _follow)},
    scripted=scripted,
)
