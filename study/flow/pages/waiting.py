"""The two pages on which nothing is done: the break between two trials, and the pause."""

from __future__ import annotations

from study.flow.facts import as_read
from study.flow.page import Content, FlowPage, HandedIn, PageContext, Person, button
from study.flow.pages import driving
from study.flow.protocol import CLEARS, DRIVEN, PAUSED, Session


def break_content(session: Session, context: PageContext) -> Content:
    """The study's words, and which round comes next."""
    return {"text": list(as_read(context.study).texts.between_trials), "next_trial": session.trial + 1}


def go_on(content: Content, person: Person) -> HandedIn:
    """No rest is needed."""
    return HandedIn("continue")


def pause_content(session: Session, context: PageContext) -> Content:
    """Why it stands still, over the scene if there is one."""
    words = context.study.words
    if "experimenter" in session.causes:
        text = words.t("The experimenter has paused the session. It goes on when they say so.")
    elif "fault" in session.causes:
        text = words.t(
            "Something in the lab did not work and the robot stopped. Nothing you did is lost. Please try to go on."
        )
    elif "picture" in session.causes:
        text = words.t(
            "The picture of the robot is missing on this screen, so the robot has stopped and no time passes. The "
            "round goes on by itself as soon as the picture is back."
        )
    else:
        text = words.t("The connection was lost and the robot stopped. Go on when you are ready.")
    return {
        **(driving.content(session, context) if session.worker else {}),
        "causes": sorted(session.causes),
        "can_resume": bool(session.causes & CLEARS["resume"]),
        "can_free": session.place in DRIVEN,
        "text": text,
    }


def resume(content: Content, person: Person) -> HandedIn | None:
    """Go on, where that is the participant's to say."""
    return HandedIn("resume") if content["can_resume"] else None


BREAK = FlowPage(
    state="break",
    leads_on="continue",
    content=break_content,
    steps={"continue": button("continue")},
    scripted=go_on,
    per_trial=True,
    between_trials=True,
)
PAUSE = FlowPage(
    state=PAUSED,
    content=pause_content,
    steps={"resume": button("resume"), "free_arm": driving.FREE_ARM},
    scripted=resume,
    per_trial=True,
)
