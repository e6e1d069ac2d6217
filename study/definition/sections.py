"""The tables of a study file: what a researcher decides, part by part, with defaults and bounds."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any, ClassVar, Literal, Union

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from study.definition.field_types import Flag, Identifier, Link, Paragraphs, ParameterName, Part, Text, number


def _calibrated_or_number(value: object) -> object:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if value == "calibrated" or (is_number and 0 <= float(value) < float("inf")):  # type: ignore[arg-type]
        return value
    raise PydanticCustomError("alpha", 'must be a number at least 0, or "calibrated"')


Alpha = Annotated[Union[float, Literal["calibrated"]], BeforeValidator(_calibrated_or_number)]  # noqa: UP007


class Option(Part):
    """One answer to choose."""

    id: Identifier
    """What the data hold when it is chosen."""
    label: Text
    """What the participant reads."""


class DemographicItem(Part):
    """One question about the participant. Only a `choice` has options."""

    id: Identifier
    """Name of the question in the data."""
    prompt: Text
    """The question."""
    kind: Literal["choice", "text", "number"] = "choice"
    """How it is answered."""
    options: tuple[Option, ...] = ()
    required: Flag = True
    """Whether the page waits for an answer."""


class ComprehensionQuestion(Part):
    """One question about the instructions; `correct` is the id of the right option."""

    id: Identifier
    """Name of the question in the data."""
    prompt: Text
    """The question."""
    options: Annotated[tuple[Option, ...], Field(min_length=2)]
    correct: Identifier
    """Id of the right option."""


class OpenQuestion(Part):
    """A question of the debrief, answered in the participant's own words or not at all."""

    id: Identifier
    """Name of the question in the data."""
    prompt: Text
    """The question."""


class Consent(Part):
    """What a participant agrees to, and whom to ask."""

    text: Paragraphs
    """What is agreed to, one text a paragraph."""
    contact: Text
    """Who answers questions about the study."""
    on_withdrawal: Literal["keep", "erase"] = "keep"
    """What becomes of the data of somebody who withdraws, as the text says; the experimenter may still choose."""

    @property
    def hash(self) -> str:
        """SHA-256 of the consent text and contact, stored with the agreement."""
        return hashlib.sha256("\n\n".join([*self.text, self.contact]).encode()).hexdigest()


class Instructions(Part):
    """The text before practice and the questions that check it was understood."""

    text: Paragraphs
    """What the participant reads before practice."""
    questions: tuple[ComprehensionQuestion, ...] = ()


class Texts(Part):
    """The lab's words between and after the trials."""

    between_trials: Paragraphs
    """On the break between two trials."""
    debrief: Paragraphs
    """After the last trial."""
    debrief_questions: tuple[OpenQuestion, ...] = ()
    thanks: Paragraphs
    """The last page of who completed the study."""
    withdrawn: Paragraphs
    """The last page of who ended it."""
    aborted: Paragraphs = ("The experimenter has ended the session. Thank you for your time. You can close this page.",)
    """The last page when the experimenter ended it."""
    screened_out: Paragraphs = (
        "This study cannot be done on this device, so that it ends here. Thank you for your interest.",
    )
    """The last page of who was screened out."""


class Condition(Part):
    """One way the robot assists. `alpha` weighs information, `beta` goals, `gamma` the person (paper III-F)."""

    id: Identifier
    """Its name in the data."""
    arbiter: Literal["teleoperation", "goal_oriented", "balanced"]
    alpha: Alpha = 0.0
    beta: float = number(default=1.0, ge=0.0)
    """Weight of getting closer to the goals."""
    gamma: float = number(default=1e6, ge=0.0)


class ArbiterSettings(Part):
    """The model of the person and of the robot's motion that the arbiter reasons with."""

    rationality_per_m: float = number(default=5.0, gt=0.0, le=1000.0)
    step_m: float = number(default=0.05, gt=0.0, le=0.2)
    planning_delay: float = number(default=0.2, ge=0.0, le=1.0)
    """Share of a tick in which the arm still follows the previous direction."""
    transition: Literal["mix", "replan"] = "mix"
    entropy_floor: float = number(default=0.1, gt=0.0, le=1.0)
    """Below this entropy the weights change no more; 0.1 in the paper."""
    stickiness: float = number(default=0.003, ge=0.0, le=1.0)


class RobotSettings(Part):
    """How fast the robot is and how long its own actions take, in ticks."""

    speed_m_s: float = number(default=0.04, gt=0.0, le=0.1)
    """0.1 m/s is 5 cm a tick, the paper's largest Cartesian step."""
    gripper_ticks: int = number(default=2, ge=1, le=20)
    settle_timeout_ticks: int = number(default=12, ge=1, le=120)
    """How long a released object may take to come to rest before the dropoff is judged as it lies."""
    reset_ticks: int = number(default=4, ge=1, le=120)
    """How long the arm takes back to its start."""


class DistractorSettings(Part):
    """The second task (paper IV-B): sensor readings, or another kind. The kind's own fields stand in the same table.
    Times are trial time, which stops during a pause."""

    NOT_IN_FILE: ClassVar[tuple[str, ...]] = ("parameters",)

    enabled: Flag = True
    """Whether there is a second task at all."""
    kind: Text = "readings"
    """Which one: a kind that ships with the lab, or one of an installed package."""
    first_s: float = number(default=10.0, ge=0.0, le=3600.0)
    """When the first reading, or other stimulus, appears."""
    every_s: float = number(default=20.0, gt=0.0, le=3600.0)
    """From one to the next."""
    answer_within_s: float = number(default=20.0, gt=0.0, le=3600.0)
    """How long one can be answered."""
    placement: Literal["second_device", "same_page_away"] = "same_page_away"
    away_min_s: float = number(default=5.0, ge=0.0, le=3600.0)
    """`same_page_away` only: the shortest time the pad stays ignored after one appeared."""
    parameters: Any = Field(default=None, exclude=True)
    """The kind's own fields, as its frozen dataclass."""


class QualityRules(Part):
    """When a trial counts as suspect: more than any of these. A rule that is left out has the default; to switch one
    off, set it very high."""

    max_round_trip_ms: float = number(default=150.0, gt=0.0, le=1e6)
    """95th percentile of the time from the lab to the page and back."""
    max_hidden_s: float = number(default=5.0, ge=0.0, le=1e6)
    max_missed_ticks: int = number(default=10, ge=0, le=1_000_000)
    """Ticks that started more than 50 ms late."""
    max_focus_losses: int = number(default=3, ge=0, le=1_000_000)
    """How often the page may lose the focus."""
    max_pad_losses: int = number(default=1, ge=0, le=1_000_000)
    """How often the gamepad may be lost."""
    max_unanswered_alerts: int = number(default=2, ge=0, le=1_000_000)
    """How many readings, or other stimuli of the second task, may expire."""
    exclude_suspect: Flag = False
    """Whether the analysis leaves suspect trials out; an experimenter's verdict overrides the automatic one."""


Browser = Literal["chrome", "edge", "firefox", "opera", "safari"]


class Eligibility(Part):
    """What a device must have, checked before consent. With everything at its default nothing is asked for, and nobody
    sees the check."""

    gamepad: Literal["any", "preferred", "required"] = "any"
    sound: Flag = False
    """Whether the participant has to hear: they count tones."""
    webgl: Flag = False
    """Whether the browser has to draw in 3-D."""
    keyboard_or_mouse: Flag = False
    """Whether devices with nothing but a touch screen are turned away."""
    max_round_trip_ms: float = number(default=0.0, ge=0.0, le=10_000.0)
    """Median from the lab to the page and back, measured by the lab; 0 = not asked for."""
    min_window_width_px: int = number(default=0, ge=0, le=10_000)
    min_window_height_px: int = number(default=0, ge=0, le=10_000)
    """Of the page inside its window, in CSS pixels; 0 = any."""
    browsers: tuple[Browser, ...] = ()
    """Empty = any."""


class Recruitment(Part):
    """An open link, `/join`, over which people enrol themselves, and where they are sent afterwards."""

    open: Flag = False
    quota: int = number(default=0, ge=0, le=100_000)
    """At most so many hold a cell, those with a personal link included. An open study has to say."""
    id_parameters: Annotated[tuple[ParameterName, ...], Field(min_length=1, max_length=10)] = (
        "PROLIFIC_PID",
        "STUDY_ID",
        "SESSION_ID",
    )
    """Parameters of the link that are kept, apart from the data."""
    person: ParameterName = "PROLIFIC_PID"
    """The one of them that says who somebody is. It must be in the link; the same person is enrolled once."""
    completion_link: Link = ""
    """Where the last page leads. In every link `{NAME}` stands for what the parameter NAME was."""
    screened_out_link: Link = ""
    full_link: Link = ""
    welcome: Paragraphs = (
        "Thank you for your interest in this study. It runs in this browser, and nothing has to be installed.",
        "Press Begin when you have time and quiet to take part.",
    )
    """What the open link's page says before Begin."""
    full: Paragraphs = ("This study has all the participants it needs. Thank you for your interest.",)
    """What it says when the places are taken."""
