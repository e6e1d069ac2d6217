"""What the participant is shown in each state, as data; the words come from the study file.

Nothing in here carries the condition, the belief or a score: a page cannot leak what it never gets.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from app.trial.labels import Labels
from app.trial.values import TickResult, TrialView
from app.trial.verdicts import Verdict
from app.wire import Instruction, Page, Tick
from sim import views
from study.definition.link_placeholders import filled
from study.definition.study import Study
from study.flow.answers import describe
from study.flow.eligibility import checks_of, tones_of
from study.flow.protocol import Session

VIEWS: tuple[tuple[str, str], ...] = tuple((view.name, view.label) for view in views.VIEWS.values())
"""Names and labels of the camera views, the one a session starts with first."""

FAILURES: Mapping[str, str] = {
    "off_table": "The {object} fell off the table.",
    "knocked_over": "The {object} fell over and cannot be picked up any more.",
    "out_of_reach": "The {object} is out of the arm's reach now.",
    "wrong_bin": "The {object} went into the other bin.",
    "left_on_table": "The {object} was let go over the table.",
    "outside_bin": "The {object} landed outside the bin.",
    "not_moved": "The {object} was put down too close to where it stood. Please try once more.",
}


ENDED_EARLY = "This round was ended early. Please go on from here."


def instruction(view: TrialView, labels: Labels, practice: bool) -> Instruction:
    """The current task in words and ids."""
    object_label = labels.objects[view.object]
    bin_label = labels.bins[view.bin] if view.bin else None
    if view.phase == "reset":
        text, kind = "The arm goes back to its start. Please wait.", "reset"
    elif practice and view.kind == "pickup":
        text, kind = f"Practice: pick up the {object_label}.", "practice"
    elif practice:
        text, kind = f"Practice: move the {object_label} to another place on the table and let go.", "practice"
    elif view.kind == "pickup":
        text, kind = f"Pick up the {object_label}.", "pickup"
    else:
        text, kind = f"Drop the {object_label} into the {bin_label}.", "dropoff"
    shows_bin = view.kind == "dropoff" and kind != "reset"
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


def notice(ended: Verdict | None, before: Instruction | None, labels: Labels) -> str | None:
    """One line about the task that just ended; `before` is the instruction that was shown during it."""
    if ended is None or before is None or before.object is None:
        return None
    if ended.outcome == "success":
        done = {"dropoff": f"Well done: the {before.object_label} is in the bin.", "practice": "Well done."}
        return done.get(before.kind)
    return FAILURES[ended.reason or ""].format(object=labels.objects[before.object])


def tick_message(
    result: TickResult, seq: int, before: Instruction | None, labels: Labels, practice: bool, show_assistance: bool
) -> Tick:
    """What the participant's page learns of a tick."""
    view = result.view
    status = {"operating": "running", "gripper": "gripper", "settling": "gripper", "reset": "resetting"}
    return Tick.model_validate(
        {
            "tick": result.row.tick,
            "seq": seq,
            "status": status.get(view.phase, "finished"),
            "instruction": instruction(view, labels, practice).model_dump(),
            "done_tasks": view.done_tasks,
            "tasks": view.tasks,
            "gripper": view.gripper,
            "holding": view.holding,
            "blocked": view.blocked,
            "assisting": view.source == "robot" if show_assistance else None,
            "notice": notice(view.ended, before, labels),
        }
    )


@dataclass(frozen=True)
class PageContext:
    """What pages are made from, besides the session's state."""

    study: Study
    scene_path: str
    panel_link: str | None
    instruction: Instruction | None
    worker_ready: bool
    public_id: str = ""
    ids: Mapping[str, str] = field(default_factory=dict)
    """The ids of the open link the participant came over, by parameter."""
    looks: Mapping[str, Any] = field(default_factory=dict)
    """How the objects and bins of a layout of the study's own are drawn (`app.trial.looks`)."""


def page(session: Session, context: PageContext) -> Page:
    """The page for the session's state."""
    return Page(
        state=session.state,
        trial=session.trial if session.state not in _WITHOUT_TRIAL else None,
        trials=session.trials,
        content=_CONTENT[session.state](session, context),
    )


_WITHOUT_TRIAL = frozenset(
    {
        *("eligibility", "consent", "demographics", "setup", "instructions", "debrief"),
        *("done", "withdrawn", "aborted", "screened_out"),
    }
)


def _eligibility(session: Session, context: PageContext) -> dict[str, Any]:
    rules = context.study.eligibility
    checks = checks_of(rules)
    return {
        "title": context.study.title,
        "checks": list(checks),
        "gamepad": rules.gamepad,
        "browsers": list(rules.browsers),
        "tones": list(tones_of(context.public_id)) if "sound" in checks else [],
    }


def _consent(session: Session, context: PageContext) -> dict[str, Any]:
    study = context.study
    return {
        "title": study.title,
        "text": list(study.consent.text),
        "contact": study.consent.contact,
        "hash": study.consent.hash,
    }


def _demographics(session: Session, context: PageContext) -> dict[str, Any]:
    return {"items": [item.model_dump() for item in context.study.demographics]}


def _setup(session: Session, context: PageContext) -> dict[str, Any]:
    distractor = context.study.distractor
    return {
        "placement": distractor.placement if distractor.enabled else "none",
        "panel_link": context.panel_link if distractor.placement == "second_device" else None,
        "gamepad": context.study.eligibility.gamepad,
        "needs_sound": context.study.eligibility.sound,
    }


def _instructions(session: Session, context: PageContext) -> dict[str, Any]:
    instructions = context.study.instructions
    return {
        "text": list(instructions.text),
        "questions": [question.model_dump(exclude={"correct"}) for question in instructions.questions],
    }


def _driving(session: Session, context: PageContext) -> dict[str, Any]:
    return {
        "scene": context.scene_path,
        "views": [{"name": name, "label": label} for name, label in VIEWS],
        "instruction": context.instruction.model_dump() if context.instruction else None,
        "tasks": 2 if session.place in ("practice_ready", "practice") else context.study.tasks_per_trial,
        "running": session.is_ticking,
        "ready": context.worker_ready,
        "away_min_s": context.study.distractor.away_min_s,
        **({"looks": context.looks} if context.looks else {}),
    }


def _survey(session: Session, context: PageContext) -> dict[str, Any]:
    return {"instruments": [describe(instrument) for instrument in context.study.instruments]}


def _break(session: Session, context: PageContext) -> dict[str, Any]:
    return {"text": list(context.study.texts.between_trials), "next_trial": session.trial + 1}


def _debrief(session: Session, context: PageContext) -> dict[str, Any]:
    texts = context.study.texts
    return {
        "text": list(texts.debrief),
        "questions": [question.model_dump() for question in texts.debrief_questions],
    }


def _done(session: Session, context: PageContext) -> dict[str, Any]:
    link = filled(context.study.recruitment.completion_link, context.ids)
    return {"text": list(context.study.texts.thanks), "completion_link": link}


def _screened_out(session: Session, context: PageContext) -> dict[str, Any]:
    link = filled(context.study.recruitment.screened_out_link, context.ids)
    return {"text": list(context.study.texts.screened_out), "completion_link": link}


def _ended(session: Session, context: PageContext) -> dict[str, Any]:
    texts = context.study.texts
    words = texts.aborted if session.state == "aborted" else texts.withdrawn
    return {"text": list(words), "completion_link": None}


def _paused(session: Session, context: PageContext) -> dict[str, Any]:
    if "experimenter" in session.causes:
        text = "The experimenter has paused the session. It goes on when they say so."
    elif "fault" in session.causes:
        text = "Something in the lab did not work and the robot stopped. Nothing you did is lost. Please try to go on."
    else:
        text = "The connection was lost and the robot stopped. Go on when you are ready."
    return {
        **(_driving(session, context) if session.worker else {}),
        "causes": sorted(session.causes),
        "can_resume": bool(session.causes & {"connection", "fault"}),
        "text": text,
    }


_CONTENT: Mapping[str, Callable[[Session, PageContext], dict[str, Any]]] = {
    "eligibility": _eligibility,
    "consent": _consent,
    "demographics": _demographics,
    "setup": _setup,
    "instructions": _instructions,
    "practice_ready": _driving,
    "practice": _driving,
    "trial_ready": _driving,
    "trial": _driving,
    "survey": _survey,
    "break": _break,
    "debrief": _debrief,
    "done": _done,
    "withdrawn": _ended,
    "aborted": _ended,
    "screened_out": _screened_out,
    "paused": _paused,
}
