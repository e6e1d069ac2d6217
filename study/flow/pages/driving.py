"""The four pages with a robot: practice and trial, each waiting for Start and then under way.

Their workers stand in `study.flow.protocol.NEEDS`. What ends a practice or a trial is its last tick, not the page.
"""

from __future__ import annotations

from study.definition.study import Study
from study.flow.page import (
    Content,
    FlowPage,
    HandedIn,
    NoData,
    Outcome,
    PageContext,
    Person,
    Refused,
    Step,
    StepContext,
    button,
)
from study.flow.protocol import DRIVEN, Session


def _free(context: StepContext, data: NoData) -> Outcome:
    if context.session.place not in DRIVEN:
        raise Refused(
            "illegal", ("step", "the arm can be freed during practice and trials, also while they are paused")
        )
    return Outcome(frees=True)


START = button("start")
FREE_ARM = Step(NoData, _free)
"""The participant frees the arm, which works in a pause as well: a fault may be why it is stuck."""
PRACTICE_TASKS = 2


def has_no_practice(study: Study) -> bool:
    """Whether trials begin without one."""
    return not study.practice


def content(session: Session, context: PageContext) -> Content:
    """The scene and the task."""
    return {
        "scene": context.scene_path,
        "views": [{"name": name, "label": label} for name, label in context.views],
        "inset": context.study.view.inset,
        "practice_task": context.study.practice_task,
        "instruction": context.instruction,
        "tasks": PRACTICE_TASKS if session.place in ("practice_ready", "practice") else context.study.tasks_per_trial,
        "running": session.is_ticking,
        "ready": context.worker_ready,
        **({"panel_link": context.panel_link} if context.study.distractor.on_second_device else {}),
        "away_min_s": context.study.distractor.away_min_s,
        **({"looks": context.looks} if context.looks else {}),
    }


def scripted(content: Content, person: Person) -> HandedIn:
    """Start, once the robot is ready."""
    return HandedIn("start")


PRACTICE_READY = FlowPage(
    state="practice_ready",
    leads_on="start",
    content=content,
    steps={"start": START},
    scripted=scripted,
    left_out=has_no_practice,
    per_trial=True,
)
PRACTICE = FlowPage(
    state="practice",
    leads_on="practice_done",
    content=content,
    steps={"free_arm": FREE_ARM},
    left_out_with="practice_ready",
    per_trial=True,
)
TRIAL_READY = FlowPage(
    state="trial_ready",
    leads_on="start",
    content=content,
    steps={"start": START},
    scripted=scripted,
    aside={"repeat_practice": "practice_ready"},
    per_trial=True,
)
TRIAL = FlowPage(
    state="trial",
    leads_on="trial_done",
    content=content,
    steps={"free_arm": FREE_ARM},
    aside={"abort_trial": None},
    per_trial=True,
)
