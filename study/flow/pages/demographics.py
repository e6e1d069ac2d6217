"""Questions about the person, once, before anything else is asked of them."""

from __future__ import annotations

from study.definition.study import Study
from study.flow.answers import answer_rows, numbers_of, validate_demographics
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


def asks_nothing(study: Study) -> bool:
    """Whether the study has no such questions."""
    return not study.demographics


def content(session: Session, context: PageContext) -> Content:
    """The questions."""
    return {"items": [item.model_dump() for item in context.study.demographics]}


def scripted(content: Content, person: Person) -> HandedIn:
    """What the person says of themselves."""
    told = {item["id"]: person.about(item) for item in content["items"]}
    return HandedIn("demographics", {"answers": {name: value for name, value in told.items() if value is not None}})


def _follow(context: StepContext, data: AnswersData) -> Outcome:
    answers = data.answers
    check(validate_demographics(context.study, answers))
    rows = answer_rows(
        context.session.participant, "demographics", answers, context.utc, numbers=numbers_of(context.study)
    )
    return Outcome(Event("demographics_done"), answers=rows)


PAGE = FlowPage(
    state="demographics",
    leads_on="demographics_done",
    content=content,
    steps={"demographics": Step(AnswersData, _follow)},
    scripted=scripted,
    left_out=asks_nothing,
)
