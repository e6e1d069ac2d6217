"""The study file: everything a researcher decides, read from TOML, checked, and turned into one plan per participant.

`load_study` reads a file (or the paper's study, which ships as `default.toml`), `orders` and `next_order`
counterbalance the conditions, `plan_session` draws everything random about one participant from one seed.

Each random choice has its own stream, named by trial and purpose (`numpy.random.SeedSequence` with a spawn key):
drawing more readings, or one object more, shifts nothing else.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Union

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from study.design_checks import cross_problems
from study.records import StudyError
from study.study_file import Problem, StudyFileError, model_problems, parse_toml, report

__all__ = [
    "Pickup",
    "SessionPlan",
    "Study",
    "StudyFileError",
    "TrialPlan",
    "load_study",
    "next_order",
    "orders",
    "parse_study",
    "plan_session",
    "reading",
]

DEFAULT_STUDY = Path(__file__).with_name("default.toml")
MAX_CONDITIONS = 5
"""120 orders; with six conditions nobody would ever fill the 720."""

_PLACEMENT, _OBJECTS, _BINS, _READINGS = range(4)
"""Purposes of the random streams of a trial. Appending is safe, reordering changes every plan."""


def _calibrated_or_number(value: object) -> object:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if value == "calibrated" or (is_number and 0 <= float(value) < float("inf")):  # type: ignore[arg-type]
        return value
    raise PydanticCustomError("alpha", 'must be a number at least 0, or "calibrated"')


Text = Annotated[str, Field(min_length=1, strict=True)]
Identifier = Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[a-z0-9][a-z0-9_]*$", strict=True)]
Paragraphs = Annotated[tuple[Text, ...], Field(min_length=1)]
Flag = Annotated[bool, Field(strict=True)]
Alpha = Annotated[Union[float, Literal["calibrated"]], BeforeValidator(_calibrated_or_number)]  # noqa: UP007


def _number(**bounds: Any) -> Any:
    return Field(strict=True, allow_inf_nan=False, **bounds)


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Option(_Part):
    """One answer to choose."""

    id: Identifier
    label: Text


class DemographicItem(_Part):
    """One question about the participant. Only a `choice` has options."""

    id: Identifier
    prompt: Text
    kind: Literal["choice", "text", "number"] = "choice"
    options: tuple[Option, ...] = ()
    required: Flag = True


class ComprehensionQuestion(_Part):
    """One question about the instructions; `correct` is the id of the right option."""

    id: Identifier
    prompt: Text
    options: Annotated[tuple[Option, ...], Field(min_length=2)]
    correct: Identifier


class OpenQuestion(_Part):
    """A question of the debrief, answered in the participant's own words or not at all."""

    id: Identifier
    prompt: Text


class Consent(_Part):
    """What a participant agrees to, and whom to ask."""

    text: Paragraphs
    contact: Text

    @property
    def hash(self) -> str:
        """SHA-256 of the consent text and contact, stored with the agreement."""
        return hashlib.sha256("\n\n".join([*self.text, self.contact]).encode()).hexdigest()


class Instructions(_Part):
    """The text before practice and the questions that check it was understood."""

    text: Paragraphs
    questions: tuple[ComprehensionQuestion, ...] = ()


class Texts(_Part):
    """The lab's words between and after the trials. `completion_link` is opened from the last page, if given."""

    between_trials: Paragraphs
    debrief: Paragraphs
    debrief_questions: tuple[OpenQuestion, ...] = ()
    thanks: Paragraphs
    withdrawn: Paragraphs
    aborted: Paragraphs = ("The experimenter has ended the session. Thank you for your time. You can close this page.",)
    completion_link: Annotated[str, Field(strict=True)] = ""


class Condition(_Part):
    """One way the robot assists. `alpha` weighs information, `beta` goals, `gamma` the person (paper III-F)."""

    id: Identifier
    arbiter: Literal["teleoperation", "goal_oriented", "balanced"]
    alpha: Alpha = 0.0
    beta: float = _number(default=1.0, ge=0.0)
    gamma: float = _number(default=1e6, ge=0.0)


class ArbiterSettings(_Part):
    """The model of the person and of the robot's motion that the arbiter reasons with."""

    rationality_per_m: float = _number(default=5.0, gt=0.0, le=1000.0)
    step_m: float = _number(default=0.05, gt=0.0, le=0.2)
    planning_delay: float = _number(default=0.2, ge=0.0, le=1.0)
    """Share of a tick in which the arm still follows the previous direction."""
    transition: Literal["mix", "replan"] = "mix"
    entropy_floor: float = _number(default=0.1, gt=0.0, le=1.0)
    stickiness: float = _number(default=0.003, ge=0.0, le=1.0)


class RobotSettings(_Part):
    """How fast the robot is and how long its own actions take, in ticks of 0.5 s."""

    speed_m_s: float = _number(default=0.04, gt=0.0, le=0.1)
    """0.1 m/s is 5 cm a tick, the paper's largest Cartesian step."""
    gripper_ticks: int = _number(default=2, ge=1, le=20)
    settle_timeout_ticks: int = _number(default=12, ge=1, le=120)
    """How long a released object may take to come to rest before the dropoff is judged as it lies."""
    reset_ticks: int = _number(default=4, ge=1, le=120)


class DistractorSettings(_Part):
    """The second task: readings to be logged (paper IV-B). Times are trial time, which stops during a pause."""

    enabled: Flag = True
    first_s: float = _number(default=10.0, ge=0.0, le=3600.0)
    every_s: float = _number(default=20.0, gt=0.0, le=3600.0)
    answer_within_s: float = _number(default=20.0, gt=0.0, le=3600.0)
    placement: Literal["second_device", "same_page_away"] = "same_page_away"
    away_min_s: float = _number(default=5.0, ge=0.0, le=3600.0)
    """`same_page_away` only: the shortest time the pad stays ignored after a reading appeared."""
    digits: int = _number(default=4, ge=1, le=9)
    decimals: int = _number(default=1, ge=0, le=4)
    """How many of the digits stand after the point."""


class Study(_Part):
    """A checked study file. Equal hashes mean equal files, byte for byte."""

    NOT_IN_FILE: ClassVar[tuple[str, ...]] = ("hash", "source_text")

    title: Text
    show_assistance: Flag = False
    """Whether the participant is told who is driving; the paper gave no cue."""
    practice: Flag = True
    heartbeat_timeout_s: float = _number(default=0.5, ge=0.3, le=30.0)
    """No tick starts when the page was last heard of longer ago: the default is one tick, so that silence is never
    taken for hands off."""
    layout: Identifier
    objects: Annotated[tuple[Identifier, ...], Field(min_length=1)]
    bins: Annotated[tuple[Identifier, ...], Field(min_length=1)]
    pickups_per_trial: int = _number(default=3, ge=1)
    surveys: tuple[Identifier, ...] = ()
    consent: Consent
    demographics: tuple[DemographicItem, ...] = ()
    instructions: Instructions
    texts: Texts
    conditions: Annotated[tuple[Condition, ...], Field(min_length=1, max_length=MAX_CONDITIONS)]
    arbiter: ArbiterSettings = ArbiterSettings()
    robot: RobotSettings = RobotSettings()
    distractor: DistractorSettings = DistractorSettings()

    hash: str = Field(default="", exclude=True)
    """SHA-256 of the file's bytes."""
    source_text: str = Field(default="", exclude=True, repr=False)

    @property
    def condition_ids(self) -> tuple[str, ...]:
        """Condition ids in the order of the file."""
        return tuple(condition.id for condition in self.conditions)

    @property
    def tasks_per_trial(self) -> int:
        """A pickup and a dropoff for each object moved."""
        return 2 * self.pickups_per_trial

    @property
    def skips(self) -> frozenset[str]:
        """States of the session that this study leaves out (see `study.protocol`)."""
        present = {
            "demographics": bool(self.demographics),
            "practice_ready": self.practice,
            "survey": bool(self.surveys),
        }
        return frozenset(state for state, kept in present.items() if not kept)

    def condition(self, condition_id: str) -> Condition:
        """The condition of that id; `StudyError` names the ones there are."""
        for condition in self.conditions:
            if condition.id == condition_id:
                return condition
        raise StudyError(f"no condition {condition_id!r} in the study; it has {list(self.condition_ids)}")


def load_study(
    path: Path | str | None,
    *,
    layouts: Collection[str],
    objects: Collection[str],
    bins: Collection[str] | None = None,
) -> Study:
    """Read a study file; None means the paper's study.

    `layouts`, `objects` and `bins` are the ids the simulated world knows. When `layouts` is a mapping, its values
    are the numbers of slots for objects. Raises `StudyFileError` with one line for every problem.
    """
    file = DEFAULT_STUDY if path is None else Path(path)
    try:
        source = file.read_bytes()
    except OSError as error:
        raise StudyFileError([f"{file}: cannot be read: {error.strerror or error}"]) from None
    return parse_study(source, name=str(file), layouts=layouts, objects=objects, bins=bins)


def parse_study(
    source: bytes | str,
    *,
    name: str = "study file",
    layouts: Collection[str],
    objects: Collection[str],
    bins: Collection[str] | None = None,
) -> Study:
    """A study from the text of its file; as `load_study`."""
    raw = source.encode() if isinstance(source, str) else source
    data, text = parse_toml(raw, name)
    reserved = [
        Problem((key,), "unknown field; it is computed from the file") for key in Study.NOT_IN_FILE if key in data
    ]
    wrong = [*reserved, *model_problems(Study, data), *cross_problems(data, layouts, objects, bins)]
    if wrong:
        raise report(name, text, data, wrong)
    return Study.model_validate(
        {**data, "hash": hashlib.sha256(raw).hexdigest(), "source_text": text},
    )


@dataclass(frozen=True)
class Pickup:
    """One pick-and-place cycle: bring the object to the bin."""

    object: str
    bin: str


@dataclass(frozen=True)
class TrialPlan:
    """Everything that was drawn for one trial."""

    trial: int
    """From 1."""
    condition: str
    placement: tuple[str, ...]
    """Object id at each slot of the layout, in slot order."""
    pickups: tuple[Pickup, ...]
    seed: int
    """The participant's seed; `reading` draws from it."""
    digits: int
    decimals: int


@dataclass(frozen=True)
class SessionPlan:
    """One participant's trials in the order they are run."""

    seed: int
    order: tuple[str, ...]
    trials: tuple[TrialPlan, ...]

    def trial(self, number: int) -> TrialPlan:
        """Trial `number`, from 1; `StudyError` names the range."""
        if not 1 <= number <= len(self.trials):
            raise StudyError(f"no trial {number}; trials are 1 to {len(self.trials)}")
        return self.trials[number - 1]


def orders(study: Study) -> tuple[tuple[str, ...], ...]:
    """Every order of the conditions, always in the same sequence; 6 with the paper's three."""
    return tuple(itertools.permutations(study.condition_ids))


def next_order(study: Study, taken: Mapping[tuple[str, ...], int]) -> tuple[str, ...]:
    """The order run least often so far; of several, the first in `orders`.

    `taken` counts the participants who hold a cell: demo, rejected and withdrawn ones do not, so that their cell is
    given out again. Orders that are not in `taken` count as 0, orders of another study are ignored.
    """
    return min(orders(study), key=lambda order: taken.get(order, 0))


def plan_session(study: Study, order: tuple[str, ...], seed: int) -> SessionPlan:
    """Draw one participant's placements, objects, bins and readings. Same arguments, same plan, on every machine.

    Raises `StudyError` when `order` is not one of the study's or the seed is negative.
    """
    if order not in orders(study):
        raise StudyError(f"order {order!r} is not a permutation of the conditions {list(study.condition_ids)}")
    if seed < 0:
        raise StudyError(f"seed {seed} must be at least 0")
    trials = []
    for trial, condition in enumerate(order, start=1):
        placement = _stream(seed, trial, _PLACEMENT).permutation(len(study.objects))
        chosen = _stream(seed, trial, _OBJECTS).permutation(len(study.objects))[: study.pickups_per_trial]
        bins = _stream(seed, trial, _BINS).integers(len(study.bins), size=study.pickups_per_trial)
        trials.append(
            TrialPlan(
                trial=trial,
                condition=condition,
                placement=tuple(study.objects[i] for i in placement),
                pickups=tuple(Pickup(study.objects[i], study.bins[j]) for i, j in zip(chosen, bins, strict=True)),
                seed=seed,
                digits=study.distractor.digits,
                decimals=study.distractor.decimals,
            )
        )
    return SessionPlan(seed=seed, order=order, trials=tuple(trials))


def reading(plan: TrialPlan, alert: int) -> str:
    """The reading of alert `alert` (from 1), such as `482.1`: as many digits as asked, the first of them not 0."""
    if alert < 1:
        raise StudyError(f"alert {alert} must be at least 1")
    draw = _stream(plan.seed, plan.trial, _READINGS, alert)
    number = str(draw.integers(10 ** (plan.digits - 1), 10**plan.digits))
    point = plan.digits - plan.decimals
    return f"{number[:point]}.{number[point:]}" if plan.decimals else number


def _stream(seed: int, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
