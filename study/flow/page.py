"""What a page of the participant's flow is: its place, what it shows, what it takes, and how a scripted client answers.

    PAGE = FlowPage(
        state="comfort",                     the name of the state, and of the view static/participant/views/comfort.js
        leads_on="comfort_done",             the event that leads to the next page
        content=content,                     what the view is given
        steps={"comfort": Step(Data, follow)},   what the view hands in, and what follows
        scripted=scripted,                   what a client without eyes hands in, given the content
    )

Each page is one such value in a file of `study.flow.pages`; `study.flow.flow` makes the flow of them. A step either is
refused, with the field that is wrong, or leads to an `Outcome`. Nothing is stored here. Functions stand at the top of
their module, so that a flow can be handed to another process.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, Protocol, TypeAlias, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from study.definition.study import Study
from study.flow.answers import MAX_TEXT_CHARACTERS, AnswerProblem, unseen_problem
from study.flow.eligibility import Check
from study.flow.protocol import Ending, Event, EventName, Session, State
from study.records import SurveyAnswerRow


def _readable(text: str) -> str:
    problem = unseen_problem(text)
    if problem:
        raise ValueError(problem)
    return text


Text = Annotated[str, Field(max_length=MAX_TEXT_CHARACTERS), AfterValidator(_readable)]
"""What is typed freely. It is taken as it stands, or refused."""
Name = Annotated[str, Field(max_length=200)]
MAX_NOTE_CHARACTERS = 2000
"""How long a note's data may be, as JSON."""
Count = Annotated[int, Field(ge=1, le=2**53 - 1)]
"""Counts from 1, as far as every reader of JSON takes a whole number as it is."""
Content: TypeAlias = Mapping[str, Any]
"""What a view needs, by name; it goes over the wire as JSON."""


# ---- what a page is given -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PageContext:
    """What pages are made from, besides the session."""

    study: Study
    scene_path: str = ""
    """Where the 3-D scene is served; empty where there is none."""
    panel_link: str | None = None
    """The second device's link, once one was made."""
    instruction: Content | None = None
    """The current task, as the wire tells it."""
    worker_ready: bool = False
    """Whether the robot is in place."""
    views: tuple[tuple[str, str], ...] = ()
    """Names and labels of the camera views, the one a session starts with first."""
    public_id: str = ""
    """The id in the page's address."""
    ids: Mapping[str, str] = field(default_factory=dict)
    """The ids of the open link the participant came over, by parameter."""
    looks: Content = field(default_factory=dict)
    """How the objects and bins of a layout of the study's own are drawn; empty for those that ship."""


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


# ---- what a page takes ----------------------------------------------------------------------------------------------


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
    frees: bool = False
    """Whether the arm is freed: the pick-and-place that is under way begins again."""


class StepData(BaseModel):
    """Base of what a step must contain: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class NoData(StepData):
    """Nothing."""


class AnswersData(StepData):
    """Answers by item (or by questionnaire and item); `study.flow.answers` checks what is in them."""

    answers: dict[Name, Any]
    """demographics: by item, an option's id, text or number. instructions: by question, an option's id. survey: by
    questionnaire, then by item, 1 to the number of points. debrief: by question, text.
    """


DataType = TypeVar("DataType", bound=StepData)


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


@dataclass(frozen=True)
class Step(Generic[DataType]):
    """One step: what it must contain, and what follows from that."""

    data: type[DataType]
    follow: Callable[[StepContext, DataType], Outcome]

    def __call__(self, context: StepContext, data: Mapping[str, Any]) -> Outcome:
        """What the step leads to; raises `Refused`."""
        return self.follow(context, parse(self.data, data))


@dataclass(frozen=True)
class _Happens:
    """What follows from a button: its event."""

    event: EventName

    def __call__(self, context: StepContext, data: NoData) -> Outcome:
        return Outcome(Event(self.event))


def button(event: EventName) -> Step[NoData]:
    """The step of a button that hands in nothing and leads to this event."""
    return Step(NoData, _Happens(event))


# ---- who answers without a browser ----------------------------------------------------------------------------------


class Person(Protocol):
    """Whom a scripted client stands for. A page asks, in the words of its content; the person has the opinions."""

    def device(self, asked: Content) -> Mapping[str, Any] | None:
        """What a page reports of a device that fits; None = there is no device to check."""

    def controls(self) -> Mapping[str, Any]:
        """What drives the robot, as the set-up page hands it in."""

    def about(self, item: Content) -> Any:
        """The answer to an item about the person; None = left out."""

    def understood(self, question: Content) -> str:
        """The option taken for right; another one when the question is asked again."""

    def rated(self, form: Content) -> Mapping[str, int]:
        """Points by item for a questionnaire: `id`, `points` and `items` with an `id` each."""


@dataclass(frozen=True)
class HandedIn:
    """What a client hands in: a step and its data."""

    step: str
    data: Mapping[str, Any] = field(default_factory=dict)


# ---- the page -------------------------------------------------------------------------------------------------------


def no_content(session: Session, context: PageContext) -> Content:
    """For a view that needs nothing."""
    return {}


@dataclass(frozen=True, eq=False)
class FlowPage:
    """One page. Pages stand in a tuple; each leads on to the next one in it."""

    state: State
    """The state of the session in which it is shown: small letters, digits and `_`."""
    leads_on: EventName | None = None
    """The event that leads on to the next page. None for what stands beside the line: the pause and the ends."""
    content: Callable[[Session, PageContext], Content] = no_content
    """What its view is given. Never the condition, the belief or a score: a page cannot leak what it never gets."""
    steps: Mapping[str, Step[Any]] = field(default_factory=dict)
    """What its view may hand in, by the name of the step."""
    scripted: Callable[[Content, Person], HandedIn | None] | None = None
    """What a scripted client hands in, given the content. None, or a result of None: nothing is to be answered here."""
    left_out: Callable[[Study], bool] | None = None
    """Whether a study leaves the page out; None = no study does."""
    left_out_with: State | None = None
    """The page that takes this one with it when it is left out."""
    ends: Mapping[EventName, Ending] = field(default_factory=dict)
    """Events that end the session here."""
    aside: Mapping[EventName, State | None] = field(default_factory=dict)
    """Where only the experimenter leads, also from a pause, which then stays one. None = the next page."""
    per_trial: bool = False
    """Whether it comes in every trial. Such pages stand together: the last one leads back to the first."""
    between_trials: bool = False
    """Whether it is left out after the last trial."""
    notes: Mapping[str, type[StepData]] = field(default_factory=dict)
    """What its view may note for the record, by name: `socket.note("own.NAME", data)` becomes the event
    `page.own.NAME`. The model says what a note holds, its docstring what it means; at most `MAX_NOTE_CHARACTERS`."""
    view: str | Path | None = None
    """What shows it: the name of a module of static/participant/views (None = the state's), or a file of one's own."""
