"""The tables of a study file: what a researcher decides, part by part, with defaults and bounds."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from study.definition.field_types import Flag, Identifier, Link, Paragraphs, ParameterName, Part, PartName, Text, number
from study.language.words import phrase
from study.parts.code import Code


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
    whole: Flag = False
    """Of a number: whether only a whole one is taken."""
    least: Annotated[float, number()] | None = None
    """Of a number: the least that is taken; left out = any."""
    most: Annotated[float, number()] | None = None
    """Of a number: the most that is taken; left out = any."""


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
    aborted: Paragraphs = (
        phrase("The experimenter has ended the session. Thank you for your time. You can close this page."),
    )
    """The last page when the experimenter ended it."""
    screened_out: Paragraphs = (
        phrase("This study cannot be done on this device, so that it ends here. Thank you for your interest."),
    )
    """The last page of who was screened out."""


class InferenceSettings(Part):
    """How the goal is inferred from what the person does, with what the inference takes beside `kind`."""

    model_config = ConfigDict(extra="allow", frozen=True)

    kind: PartName = "boltzmann"
    """The paper's, one that an installed package registers, or `file.py:Class` beside the study file."""

    @property
    def parameters(self) -> dict[str, Any]:
        """What the inference takes, as the file says it."""
        return dict(self.model_extra or {})


class Condition(Part):
    """One way the robot assists. What the arbiter takes stands beside these fields; what is left out is as in
    `[arbiter]`, and after that as the arbiter has it."""

    model_config = ConfigDict(extra="allow", frozen=True)

    id: Identifier
    """Its name in the data."""
    arbiter: PartName
    """One that ships, one that an installed package registers, or `file.py:Class` beside the study file."""
    inference: InferenceSettings | None = None
    """How the goal is inferred under this condition, if not as in `[inference]`."""
    rationality_per_m: float | None = number(default=None, gt=0.0, le=1000.0)
    """As in `[arbiter]`, for this condition alone."""
    step_m: float | None = number(default=None, gt=0.0, le=0.2)
    """As in `[arbiter]`, for this condition alone."""
    planning_delay: float | None = number(default=None, ge=0.0, le=1.0)
    """As in `[arbiter]`, for this condition alone; the arm moves so, too."""
    transition: Literal["mix", "replan"] | None = None
    """As in `[arbiter]`, for this condition alone; the arm moves so, too."""

    @property
    def parameters(self) -> dict[str, Any]:
        """What the arbiter takes, as the file says it."""
        return dict(self.model_extra or {})


MODEL_FIELDS = ("rationality_per_m", "step_m", "planning_delay", "transition")
"""Of `[arbiter]`: the models of the person and of the arm, which every condition has."""


SAID_FIELDS = ("information", "look_ahead_m")
"""Of `[arbiter]`: what arbiters are given only where the file says it; one of somebody else's may call it so, too."""


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
    information: Literal["next", "ahead", "at_rest", "averaged"] = "next"
    """Where an arbiter looks at expected information: `next` is the paper's equation."""
    look_ahead_m: float = number(default=0.20, gt=0.0, le=1.0)
    """How far on `ahead` looks."""
    calibrated_on: Literal["sampled", "visited"] = "sampled"
    """What a calibrated alpha rests on: states and beliefs drawn at random from the layout, or those in which a plain
    person's hands leave the controls in pure teleoperation."""
    keep_way_on: Flag = False
    """Whether the arm, with the hands off, goes only where it can go on from toward every goal it may have to serve."""


class RobotSettings(Part):
    """How fast the robot is and how long its own actions take, in ticks."""

    speed_m_s: float = number(default=0.04, gt=0.0, le=0.1)
    """0.1 m/s is 5 cm a tick, the paper's largest Cartesian step."""
    gripper_ticks: int = number(default=2, ge=1, le=20)
    settle_timeout_ticks: int = number(default=12, ge=1, le=120)
    """How long a released object may take to come to rest before the dropoff is judged as it lies."""
    reset_ticks: int = number(default=4, ge=1, le=120)
    """How long the arm takes back to its start."""


class ViewSettings(Part):
    """How the robot looks, and what helps the participant to see depth. Each is the same under every condition and for
    everybody, and does not depend on what the robot believes. A study of depth itself may do without. A file that says
    nothing of it means what it meant before there were the inset, the ring and the looks."""

    look: Literal["own", "published", "installed"] = "installed"
    """How the robot is drawn: `own` is the lab's own look, `published` the Fetch's published meshes (CC BY-NC-SA 4.0),
    which have to be installed (the extra `meshes`); `installed` is these where they are installed, else the own."""
    inset: Flag = False
    """Whether the side panel shows a second picture, from the side, that goes where the gripper goes."""
    ring: Flag = False
    """Whether a ring lies around the instructed object, or on the instructed bin."""
    drop_mark: Flag = True
    """Whether a line goes down from the gripper, to a mark on what is below it."""


class DistractorSettings(Part):
    """The second task (paper IV-B): sensor readings, or another kind. The kind's own fields stand in the same table.
    Times are trial time, which stops during a pause."""

    model_config = ConfigDict(extra="allow", frozen=True)

    enabled: Flag = True
    """Whether there is a second task at all."""
    kind: PartName = "readings"
    """Which one: a kind that ships, one of an installed package, or `file.py:Class` beside the study file."""
    first_s: float = number(default=10.0, ge=0.0, le=3600.0)
    """When the first reading, or other stimulus, appears."""
    every_s: float = number(default=20.0, gt=0.0, le=3600.0)
    """From one to the next."""
    answer_within_s: float = number(default=20.0, gt=0.0, le=3600.0)
    """How long one can be answered."""
    placement: Literal["second_device", "same_page_away"] = "same_page_away"
    away_min_s: float = number(default=5.0, ge=0.0, le=3600.0)
    """`same_page_away` only: the shortest time the pad stays ignored after one appeared."""

    @property
    def parameters(self) -> dict[str, Any]:
        """What the kind takes, as the file says it."""
        return dict(self.model_extra or {})

    @property
    def on_second_device(self) -> bool:
        """Whether a second device has a part in the study."""
        return self.enabled and self.placement == "second_device"


class CodeFile(Part):
    """One file of such a source."""

    name: Text
    """As in its package, or beside the study file."""
    text: Annotated[str, Field(strict=True)]
    """What stands in it."""


class CodeText(Part):
    """The source of a part that does not ship with the lab; the lab writes it into the study's text."""

    kind: Identifier
    """What it is, such as arbiter."""
    name: PartName
    """What the study calls it."""
    package: str = ""
    """The installed package it is from; empty for a file beside the study file."""
    version: str = ""
    """Of the package."""
    sha256: str
    """Of all its files."""
    files: tuple[CodeFile, ...] = ()
    """Empty when the package is larger than a study's text should be: then it is known by its hash."""

    @property
    def code(self) -> Code:
        """As a value."""
        return Code(
            self.kind,
            self.name,
            self.sha256,
            {file.name: file.text for file in self.files},
            self.package,
            self.version,
        )


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
    max_frees: int = number(default=3, ge=0, le=1_000_000)
    """How often the arm may be freed, by whomever."""
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
    place_lapses_min: float = number(default=0.0, ge=0.0, le=100_000.0)
    """Minutes after which the place of somebody who came over the open link lapses when they have no page open and have
    not agreed to take part. Who comes back later begins anew, if there is a place. 0 = it never does."""
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
        phrase("Thank you for your interest in this study. It runs in this browser, and nothing has to be installed."),
        phrase("Press Begin when you have time and quiet to take part."),
    )
    """What the open link's page says before Begin."""
    full: Paragraphs = (phrase("This study has all the participants it needs. Thank you for your interest."),)
    """What it says when the places are taken."""
