"""Whether the device fits the study. Only for studies that ask something of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from study.definition.sections import Eligibility
from study.definition.study import Study
from study.flow.eligibility import Check, Device, browser_of, checks_of, shortcomings, tones_of
from study.flow.page import (
    Content,
    FlowPage,
    HandedIn,
    Name,
    NoData,
    Outcome,
    PageContext,
    Person,
    Refused,
    Step,
    StepContext,
    StepData,
)
from study.flow.protocol import LAPSE, Ending, Event, Session

Pixels = Annotated[int, Field(ge=0, le=100_000)]


class EligibilityData(StepData):
    """What the page reports of its device, as far as the study asks."""

    user_agent: Annotated[str, Field(max_length=500)] = ""
    """What the browser calls itself; only the name of the browser is recorded."""
    has_touch_only: bool | None = None
    """Whether there is a touch screen and no mouse."""
    width_px: Pixels | None = None
    """Width of the window, in CSS pixels."""
    height_px: Pixels | None = None
    """Height of the window, in CSS pixels."""
    has_webgl: bool | None = None
    """Whether 3-D can be drawn."""
    is_secure: bool | None = None
    """Whether the page is a secure context, as browsers ask for gamepads."""
    pad_id: Name | None = None
    """What the gamepad calls itself; null for none."""
    tones: Annotated[int, Field(ge=0, le=100)] | None = None
    """How many tones the person says they heard."""
    tone_try: Annotated[int, Field(ge=0, le=1000)] = 0
    """Which playing of the tones this answers, from 0."""


def asks_nothing(study: Study) -> bool:
    """Whether any device fits."""
    return study.eligibility == Eligibility()


def content(session: Session, context: PageContext) -> Content:
    """The checks, and what they need."""
    rules = context.study.eligibility
    checks = checks_of(rules)
    return {
        "title": context.study.title,
        "checks": list(checks),
        "gamepad": rules.gamepad,
        "browsers": list(rules.browsers),
        "tones": list(tones_of(context.public_id)) if "sound" in checks else [],
    }


def scripted(content: Content, person: Person) -> HandedIn | None:
    """A device that has everything."""
    device = person.device(content)
    return None if device is None else HandedIn("eligibility", device)


def _check(context: StepContext, data: EligibilityData) -> Outcome:
    device = Device(**data.model_dump())
    if context.session.state != "eligibility":
        return Outcome(Event("eligible"))  # which the protocol refuses
    rules = context.study.eligibility
    found = shortcomings(rules, device, context.round_trip_ms, tones_of(context.public_id), context.study.words)
    log = _device_log(checks_of(rules), device, context.round_trip_ms)
    if found:
        lacking = {"lacking": [one.check for one in found]}
        problems = [(one.check, one.text) for one in found]
        raise Refused("invalid", *problems, log=("device_not_fit", {**log, **lacking}))
    return Outcome(Event("eligible"), log=log)


def _device_log(checks: tuple[Check, ...], device: Device, round_trip_ms: float | None) -> dict[str, Any]:
    """What is recorded of a device: only what was asked for, and nothing that tells one browser from its like."""
    told: Mapping[Check, Mapping[str, Any]] = {
        "browser": {"browser": browser_of(device.user_agent)},
        "touch": {"has_touch_only": device.has_touch_only},
        "window": {"width_px": device.width_px, "height_px": device.height_px},
        "webgl": {"has_webgl": device.has_webgl},
        "round_trip": {"round_trip_ms": None if round_trip_ms is None else round(round_trip_ms, 1)},
        "gamepad": {"gamepad": device.pad_id is not None},
        "sound": {"tones": device.tones},
    }
    return {name: value for check in checks for name, value in told[check].items()}


def _leave(context: StepContext, _: NoData) -> Outcome:
    if not context.lacking:
        raise Refused(
            "illegal", ("step", context.study.words.t("The device has not been checked yet. Please check it again."))
        )
    return Outcome(Event("screened_out", json.dumps(context.lacking)))


PAGE = FlowPage(
    state="eligibility",
    leads_on="eligible",
    content=content,
    steps={"eligibility": Step(EligibilityData, _check), "leave": Step(NoData, _leave)},
    scripted=scripted,
    left_out=asks_nothing,
    ends={"screened_out": Ending("screened_out", "screened_out"), "place_lapsed": LAPSE},
)
