"""What is to be done, and a check that it was understood."""

from __future__ import annotations

from study.flow.answers import answer_rows, validate_comprehension
from study.flow.facts import as_read
from study.flow.page import (
    AnswersData,
    Content,
    FlowPage,
    HandedIn,
    Outcome,
    PageContext,
    Person,
    Refused,
    Step,
    StepContext,
)
from study.flow.protocol import Event, Session


def content(session: Session, context: PageContext) -> Content:
    """The text and the questions, without their right answers."""
    study = context.study
    instructions = as_read(study).instructions
    limits = {"task_s": study.task_limit_s, "trial_s": study.trial_limit_s}
    return {
        "text": list(instructions.text),
        "limits": {name: seconds for name, seconds in limits.items() if seconds},
        "questions": [question.model_dump(exclude={"correct"}) for question in instructions.questions],
    }


def scripted(content: Content, person: Person) -> HandedIn:
    """What the person has understood."""
    return HandedIn(
        "instructions",
        {"answers": {question["id"]: person.understood(question) for question in content["questions"]}},
    )


def _follow(context: StepContext, data: AnswersData) -> Outcome:
    answers = data.answers
    problems = validate_comprehension(context.study, answers)
    known = {question.id for question in context.study.instructions.questions}
    given = {item: value for item, value in answers.items() if item in known and isinstance(value, str)}
    rows = answer_rows(context.session.participant, "comprehension", given, context.utc)
    if problems:
        raise Refused("invalid", *((problem.field, problem.message) for problem in problems), kept=rows)
    return Outcome(Event("instructions_done"), answers=rows)


PAGE = FlowPage(
    state="instructions",
    leads_on="instructions_done",
    content=content,
    steps={"instructions": Step(AnswersData, _follow)},
    scripted=scripted,
)
