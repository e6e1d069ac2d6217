"""A page of one's own: after each practice, how sure people feel with the arm.

The page is this file and its view, `comfort.js` beside it. Nothing of the lab is edited. Run the lab, and everything
else that `salab` does, with the page in it:

    python docs/examples/08_page/comfort.py serve --pace lockstep
    python docs/examples/08_page/comfort.py bot --url LINK
    python docs/examples/08_page/comfort.py simulate --participants 3 --out pilot

The answers are rows of `survey_answers`. They carry the trial and no condition: the practice comes before the trial,
and what carries a condition is scored as a questionnaire of the study.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from pydantic import Field

from app.__main__ import main
from study.flow.answers import answer_rows
from study.flow.flow import FLOW
from study.flow.page import (
    Content,
    FlowPage,
    HandedIn,
    Outcome,
    PageContext,
    Person,
    Refused,
    Step,
    StepContext,
    StepData,
    Text,
)
from study.flow.protocol import Event, Session

POINTS = 7


class ComfortData(StepData):
    """What the page hands in. A key that is not named here is refused, and so is a value out of its bounds."""

    sure: Annotated[int, Field(ge=1, le=POINTS)]
    """How sure the person feels, 1 to 7."""
    hard: Text = ""
    """What is still hard, in free words. They may identify somebody: no export has them."""


class Changed(StepData):
    """The person took another point of the scale than at first."""

    times: Annotated[int, Field(ge=1, le=1000)]
    """How often."""


def content(session: Session, context: PageContext) -> Content:
    """What the view is given: plain values, which go over the wire as JSON."""
    return {
        "question": "How sure do you feel with the robot arm now?",
        "low": "Not at all",
        "high": "Completely",
        "points": POINTS,
        "round": session.trial,
    }


def follow(context: StepContext, data: ComfortData) -> Outcome:
    """What follows from what was handed in: the event that leads on, and what is recorded."""
    if data.sure == 1 and not data.hard.strip():
        raise Refused("invalid", ("hard", "Please say what is hard, so that we can help."))
    session = context.session
    rows = answer_rows(session.participant, "comfort", {"sure": data.sure}, context.utc, trial=session.trial)
    return Outcome(Event("comfort_done"), answers=rows, words=data.hard or None)


def scripted(content: Content, person: Person) -> HandedIn:
    """What the bot and simulated participants hand in."""
    return HandedIn("comfort", person.rated({"id": "comfort", "points": content["points"], "items": [{"id": "sure"}]}))


PAGE = FlowPage(
    state="comfort",
    leads_on="comfort_done",
    content=content,
    steps={"comfort": Step(ComfortData, follow)},
    notes={"changed": Changed},
    scripted=scripted,
    per_trial=True,
    view=Path(__file__).with_name("comfort.js"),
)
MY_FLOW = FLOW.with_page(PAGE, after="practice")

if __name__ == "__main__":
    sys.exit(main(flow=MY_FLOW))
