"""What the participant is shown, as messages of the wire: their page, the task, a tick.

What each page holds stands in its own file (`study.flow.pages`). Nothing in here carries the condition, the belief or a
score: a page cannot leak what it never gets.
"""

from __future__ import annotations

from collections.abc import Mapping

from app.trial.labels import Labels
from app.trial.values import TickResult, TrialView
from app.trial.verdicts import Verdict
from app.wire import Instruction, Page, Tick
from sim.view import viewpoints
from study.flow.flow import FLOW, Flow
from study.flow.page import PageContext
from study.flow.protocol import Session
from study.language.words import ENGLISH, Words, phrase

VIEWS: tuple[tuple[str, str], ...] = tuple((view.name, view.label) for view in viewpoints.VIEWS.values())
"""Names and labels of the camera views, the one a session starts with first."""

FAILURES: Mapping[str, str] = {
    "off_table": phrase("The {object} fell off the table."),
    "knocked_over": phrase("The {object} fell over and cannot be picked up any more."),
    "out_of_reach": phrase("The {object} is out of the arm's reach now."),
    "wrong_bin": phrase("The {object} went into the other bin."),
    "left_on_table": phrase("The {object} came down on the table, not in the bin."),
    "outside_bin": phrase("The {object} landed outside the bin."),
    "time_limit": phrase("The time for the {object} is over. It goes on from here by itself."),
    "not_moved": phrase("The {object} was put down too close to where it stood."),
}
HELP_SEEN = phrase("The experimenter has seen your call for help.")
SLIPPED = phrase("The {object} slipped out of the gripper.")
ENDED_EARLY = phrase("This round was ended early. Please go on from here.")
FREED = phrase("The arm is free again, and the object stands where it stood. Please pick it up once more.")
FREED_LATE = phrase("The arm is free again, and the object stands where it stood.")
"""Where time runs out: a pickup that may be over before it is begun is not asked for."""


def instruction(view: TrialView, labels: Labels, practice: bool, words: Words = ENGLISH) -> Instruction:
    """The current task in words and ids."""
    object_label = words.t(labels.objects[view.object])
    bin_label = words.t(labels.bins[view.bin]) if view.bin else None
    named = {"object": object_label, "bin": bin_label or ""}
    if view.phase == "reset":
        text, kind = words.t("The arm goes back to its start. Please wait."), "reset"
    elif practice and view.kind == "pickup":
        text, kind = words.t("Practice: pick up the {object}.", **named), "practice"
    elif practice and view.bin is None:
        moved = words.t("Practice: move the {object} to another place on the table and let go.", **named)
        text, kind = moved, "practice"
    elif practice:
        text, kind = words.t("Practice: drop the {object} into the {bin}.", **named), "dropoff"
    elif view.kind == "pickup":
        text, kind = words.t("Pick up the {object}.", **named), "pickup"
    else:
        text, kind = words.t("Drop the {object} into the {bin}.", **named), "dropoff"
    shows_bin = kind == "dropoff"
    return Instruction.model_validate(
        {
            "text": text,
            "kind": kind,
            "object": view.object,
            "object_label": object_label,
            "bin": view.bin if shows_bin else None,
            "bin_label": bin_label if shows_bin else None,
        }
    )


def notice(
    ended: Verdict | None,
    before: Instruction | None,
    labels: Labels,
    again: bool = False,
    words: Words = ENGLISH,
) -> str | None:
    """One line about the task that just ended. `before` is the instruction that was shown during it; `again`: this was
    a practice, and it is repeated."""
    if ended is None or before is None or before.object is None:
        return None
    if ended.outcome == "success":
        if before.kind == "dropoff":
            return words.t("Well done: the {object} is in the bin.", object=before.object_label or "")
        return words.t("Well done.") if before.kind == "practice" else None
    said = words.t(FAILURES[ended.reason or ""], object=words.t(labels.objects[before.object]))
    return " ".join((said, words.t("Please try once more."))) if again else said


def tick_message(
    result: TickResult,
    seq: int,
    before: Instruction | None,
    labels: Labels,
    practice: bool,
    show_assistance: bool,
    words: Words = ENGLISH,
) -> Tick:
    """What the participant's page learns of a tick."""
    view = result.view
    slipped = next((event.data["object"] for event in result.events if event.kind == "slipped"), None)
    told = notice(view.ended, before, labels, again=practice and not result.finished, words=words)
    if told is None and slipped is not None:
        told = words.t(SLIPPED, object=words.t(labels.objects[slipped]))
    if told is None and result.row.source == "free":
        told = words.t(FREED if view.ending is None else FREED_LATE)
    status = {"operating": "running", "gripper": "gripper", "settling": "gripper", "reset": "resetting"}
    return Tick.model_validate(
        {
            "tick": result.row.tick,
            "seq": seq,
            "status": status.get(view.phase, "finished"),
            "instruction": instruction(view, labels, practice, words),
            "done_tasks": view.done_tasks,
            "tasks": view.tasks,
            "gripper": view.gripper,
            "holding": view.holding,
            "blocked": view.blocked,
            "hint": {"cause": view.hint.cause, "ways": view.hint.ways} if view.hint else None,
            "assisting": view.source in ("robot", "blend") if show_assistance else None,
            "notice": told,
            "slipped": slipped is not None,
            "ending": view.ending,
        }
    )


def page(session: Session, context: PageContext, flow: Flow = FLOW) -> Page:
    """The page for the session's state."""
    shown = flow.page(session.state)
    return Page(
        state=session.state,
        trial=session.trial if shown.per_trial else None,
        trials=session.trials,
        content=dict(shown.content(session, context)),
    )
