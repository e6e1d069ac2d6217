"""The steps a page can submit: what each must contain, and what follows from it for the session and the record.

A step either is refused, with the field that is wrong, or leads to an `Outcome`. Nothing is stored here.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from study.definition.study import Study
from study.flow.answers import (
    AnswerProblem,
    answer_rows,
    validate_comprehension,
    validate_debrief,
    validate_demographics,
    validate_surveys,
)
from study.flow.eligibility import Check, Device, browser_of, checks_of, shortcomings, tones_of
from study.flow.protocol import Event, Session
from study.records import SurveyAnswerRow

Text = Annotated[str, Field(max_length=4000)]
Name = Annotated[str, Field(max_length=200)]


class Refused(ValueError):
    """A submission the lab cannot take: `problems` are (field, message).

    `kept` are answers, `log` is an event (kind, data) recorded all the same.
    """

    def __init__(
        self,
        code: Literal["invalid", "illegal"],
        *problems: tuple[str | None, str],
        kept: tuple[SurveyAnswerRow, ...] = (),
        log: tuple[str, Mapping[str, Any]] | None = None,
    ) -> None:
        self.code = code
        self.problems = problems
        self.kept = kept
        self.log = log
        super().__init__("; ".join(message for _, message in problems))


@dataclass(frozen=True)
class Outcome:
    """What a step leads to: an event of the protocol, answers for the record, lines for the event log."""

    event: Event | None = None
    answers: tuple[SurveyAnswerRow, ...] = ()
    consent_hash: str | None = None
    log: Mapping[str, Any] | None = None
    words: str | None = None
    """What was typed freely and may identify somebody: kept apart, never exported."""


@dataclass(frozen=True)
class StepContext:
    """What a step is checked against."""

    study: Study
    session: Session
    condition: str
    utc: str
    public_id: str = ""
    round_trip_ms: float | None = None
    """Median the lab measured while the device was checked; None = not measured."""
    lacking: tuple[Check, ...] = ()
    """What the last check of the device found wanting."""


class _Data(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


Pixels = Annotated[int, Field(ge=0, le=100_000)]


class EligibilityData(_Data):
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


class ConsentData(_Data):
    """Agreement to the text with this hash."""

    accepted: Literal[True]
    """Must be true."""
    hash: str
    """The `hash` of the consent page's content."""


class AnswersData(_Data):
    """Answers by item (or by questionnaire and item); `study.flow.answers` checks what is in them."""

    answers: dict[Name, Any]
    """demographics: by item, an option's id, text or number. instructions: by question, an option's id. survey: by
    questionnaire, then by item, 1 to the number of points. debrief: by question, text.
    """


class SetupData(_Data):
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


class ReasonData(_Data):
    """Free words, if any."""

    reason: Text | None = None
    """Kept apart from the record and never exported."""


class HelpData(_Data):
    """Free words, if any."""

    text: Text | None = None
    """Kept apart from the record and never exported."""


class AlertData(_Data):
    """Which reading, and what was typed."""

    alert: Annotated[int, Field(ge=1)]
    """Number of the reading, as in `alert`."""
    value: Text | None = None
    """What was typed, for `alert_answer`."""


class NoData(_Data):
    """Nothing."""


DataType = TypeVar("DataType", bound=_Data)


def parse(model: type[DataType], data: Mapping[str, Any]) -> DataType:
    """The step's data, or `Refused` naming the first field that is wrong."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(str(part) for part in first["loc"]) or None
        raise Refused("invalid", (f"data.{field}" if field else "data", str(first["msg"]))) from None


def check(problems: tuple[AnswerProblem, ...]) -> None:
    """Refuse answers that have problems."""
    if problems:
        raise Refused("invalid", *((problem.field, problem.message) for problem in problems))


def _eligibility(context: StepContext, data: EligibilityData) -> Outcome:
    device = Device(**data.model_dump())
    if context.session.state != "eligibility":
        return Outcome(Event("eligible"))  # which the protocol refuses
    rules = context.study.eligibility
    found = shortcomings(rules, device, context.round_trip_ms, tones_of(context.public_id))
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
        raise Refused("illegal", ("step", "the device has not been checked since the lab started; check it again"))
    return Outcome(Event("screened_out", json.dumps(context.lacking)))


def _consent(context: StepContext, given: ConsentData) -> Outcome:
    if given.hash != context.study.consent.hash:
        raise Refused("invalid", ("data.hash", "the consent text has changed since it was shown; please read it again"))
    return Outcome(Event("consent_given"), consent_hash=given.hash)


def _decline(context: StepContext, _: NoData) -> Outcome:
    return Outcome(Event("consent_declined"))


def _demographics(context: StepContext, data: AnswersData) -> Outcome:
    answers = data.answers
    check(validate_demographics(context.study, answers))
    participant = context.session.participant
    return Outcome(Event("demographics_done"), answers=answer_rows(participant, "demographics", answers, context.utc))


def _setup(context: StepContext, setup: SetupData) -> Outcome:
    rules = context.study.eligibility
    if rules.gamepad == "required" and setup.device != "gamepad":
        raise Refused("invalid", ("data.device", "This study is done with a gamepad. Please set one up."))
    if rules.sound and not setup.sound:
        raise Refused("invalid", ("data.sound", "This study needs sound. Please play the alarm again and turn it up."))
    if len(json.dumps(setup.mapping)) > 8000:
        raise Refused("invalid", ("data.mapping", "is larger than 8000 characters of JSON"))
    return Outcome(Event("setup_done"), log=setup.model_dump())


def _instructions(context: StepContext, data: AnswersData) -> Outcome:
    answers = data.answers
    problems = validate_comprehension(context.study, answers)
    known = {question.id for question in context.study.instructions.questions}
    given = {item: value for item, value in answers.items() if item in known and isinstance(value, str)}
    rows = answer_rows(context.session.participant, "comprehension", given, context.utc)
    if problems:
        raise Refused("invalid", *((problem.field, problem.message) for problem in problems), kept=rows)
    return Outcome(Event("instructions_done"), answers=rows)


def _survey(context: StepContext, data: AnswersData) -> Outcome:
    answers = data.answers
    check(validate_surveys(context.study, answers))
    session = context.session
    rows = [
        row
        for instrument, items in answers.items()
        for row in answer_rows(
            session.participant, instrument, items, context.utc, condition=context.condition, trial=session.trial
        )
    ]
    return Outcome(Event("survey_done"), answers=tuple(rows))


def _debrief(context: StepContext, data: AnswersData) -> Outcome:
    answers = data.answers
    check(validate_debrief(context.study, answers))
    return Outcome(
        Event("debrief_done"), answers=answer_rows(context.session.participant, "debrief", answers, context.utc)
    )


def _withdraw(context: StepContext, data: ReasonData) -> Outcome:
    return Outcome(Event("withdraw"), words=data.reason)


def _help(context: StepContext, data: HelpData) -> Outcome:
    return Outcome(words=data.text)


def _plain(event: Literal["start", "continue", "resume"]) -> Callable[[StepContext, NoData], Outcome]:
    def follow(context: StepContext, _: NoData) -> Outcome:
        return Outcome(Event(event))

    return follow


@dataclass(frozen=True)
class Step(Generic[DataType]):
    """One step: what it must contain, and what follows from that."""

    data: type[DataType]
    follow: Callable[[StepContext, DataType], Outcome]

    def __call__(self, context: StepContext, data: Mapping[str, Any]) -> Outcome:
        """What the step leads to; raises `Refused`."""
        return self.follow(context, parse(self.data, data))


STEPS: Mapping[str, Step[Any]] = {
    "eligibility": Step(EligibilityData, _eligibility),
    "leave": Step(NoData, _leave),
    "consent": Step(ConsentData, _consent),
    "decline": Step(NoData, _decline),
    "demographics": Step(AnswersData, _demographics),
    "setup": Step(SetupData, _setup),
    "instructions": Step(AnswersData, _instructions),
    "start": Step(NoData, _plain("start")),
    "survey": Step(AnswersData, _survey),
    "continue": Step(NoData, _plain("continue")),
    "resume": Step(NoData, _plain("resume")),
    "debrief": Step(AnswersData, _debrief),
    "withdraw": Step(ReasonData, _withdraw),
    "help": Step(HelpData, _help),
}
"""Every step but those about alerts, which belong to the distractor."""

ALERT_STEPS = ("alert_shown", "alert_heard", "alert_answer")
STEP_DATA: Mapping[str, type[BaseModel]] = {
    **{name: step.data for name, step in STEPS.items()},
    **dict.fromkeys(ALERT_STEPS, AlertData),
}
"""What each step must contain, those about alerts included."""
