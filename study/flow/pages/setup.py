"""How the person drives, whether they hear the alarm, and the second device where there is one."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

from pydantic import Field

from study.flow.page import (
    Content,
    FlowPage,
    HandedIn,
    Name,
    Outcome,
    PageContext,
    Person,
    Refused,
    Step,
    StepContext,
    StepData,
)
from study.flow.protocol import Event, Session


class SetupData(StepData):
    """The input device and how it is read."""

    device: Literal["gamepad", "keyboard"]
    """What drives the robot."""
    pad_id: Name | None = None
    """What the gamepad calls itself; null for none."""
    mapping: dict[Name, Any] = Field(default_factory=dict, max_length=40)
    """How the pad's axes and buttons are read; recorded as it is, at most 8000 characters of JSON."""
    dead_zone: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.25
    """Share of an axis's way that counts as none."""
    sound: bool
    """Whether the person heard the alarm."""


def content(session: Session, context: PageContext) -> Content:
    """What has to be set up."""
    distractor = context.study.distractor
    return {
        "placement": distractor.placement if distractor.enabled else "none",
        "panel_link": context.panel_link if distractor.on_second_device else None,
        "gamepad": context.study.eligibility.gamepad,
        "needs_sound": context.study.eligibility.sound,
        "needs_picture": bool(context.scene_path),
    }


def scripted(content: Content, person: Person) -> HandedIn:
    """What the person drives with."""
    return HandedIn("setup", person.controls())


def _follow(context: StepContext, setup: SetupData) -> Outcome:
    rules, words = context.study.eligibility, context.study.words
    if rules.gamepad == "required" and setup.device != "gamepad":
        raise Refused("invalid", ("data.device", words.t("This study is done with a gamepad. Please set one up.")))
    if rules.sound and not setup.sound:
        needs = words.t("This study needs sound. Please play the alarm again and turn it up.")
        raise Refused("invalid", ("data.sound", needs))
    if len(json.dumps(setup.mapping)) > 8000:
        raise Refused("invalid", ("data.mapping", "is larger than 8000 characters of JSON"))
    return Outcome(Event("setup_done"), log=setup.model_dump())


PAGE = FlowPage(
    state="setup",
    leads_on="setup_done",
    content=content,
    steps={"setup": Step(SetupData, _follow)},
    scripted=scripted,
)
