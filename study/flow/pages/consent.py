"""What taking part means, and whether the person wants to."""

from __future__ import annotations

from typing import Literal

from study.flow.facts import as_read
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
    button,
)
from study.flow.protocol import LAPSE, Ending, Event, Session


class ConsentData(StepData):
    """Agreement to the text with this hash."""

    accepted: Literal[True]
    """Must be true."""
    hash: str
    """The `hash` of the consent page's content."""


def content(session: Session, context: PageContext) -> Content:
    """The text and its hash."""
    study = as_read(context.study)
    return {
        "title": study.title,
        "text": list(study.consent.text),
        "contact": study.consent.contact,
        "hash": study.consent.hash,
        "needs_picture": bool(context.scene_path),
    }


def scripted(content: Content, person: Person) -> HandedIn:
    """Everybody agrees to what was shown."""
    return HandedIn("consent", {"accepted": True, "hash": content["hash"]})


def _agree(context: StepContext, given: ConsentData) -> Outcome:
    if given.hash != as_read(context.study).consent.hash:
        changed = context.study.words.t("The text has changed since it was shown. Please read it again.")
        raise Refused("invalid", ("data.hash", changed))
    return Outcome(Event("consent_given"), consent_hash=given.hash)


PAGE = FlowPage(
    state="consent",
    leads_on="consent_given",
    content=content,
    steps={"consent": Step(ConsentData, _agree), "decline": button("consent_declined")},
    scripted=scripted,
    ends={"consent_declined": Ending("withdrawn", "declined"), "place_lapsed": LAPSE},
)
