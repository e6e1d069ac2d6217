"""The study file: everything a researcher decides, read from TOML, checked, and turned into one plan per participant.

`load_study` reads a file (or the paper's study, which ships as `default.toml`), `orders` and `next_order`
counterbalance the conditions, `plan_session` draws everything random about one participant from one seed.

Each random choice has its own stream, named by trial and purpose (`numpy.random.SeedSequence` with a spawn key):
drawing more stimuli, or one object more, shifts nothing else.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from study.definition.builtin_questionnaires import Instrument, built_in
from study.definition.checks import cross_problems
from study.definition.field_types import Flag, Identifier, Part, Text, number
from study.definition.files_beside import with_files_beside
from study.definition.layouts import (
    LayoutInUse,
    LayoutSection,
    MeshFile,
    WorldCheck,
    in_use,
    known_to,
    shipped_layouts,
)
from study.definition.named_parts import part_problems
from study.definition.questionnaires import Questionnaire
from study.definition.sections import (
    ArbiterSettings,
    CodeText,
    Condition,
    Consent,
    DemographicItem,
    DistractorSettings,
    Eligibility,
    InferenceSettings,
    Instructions,
    QualityRules,
    Recruitment,
    RobotSettings,
    Texts,
    ViewSettings,
)
from study.definition.text_placeholders import text_problems
from study.definition.toml_reader import (
    FieldPath,
    FileBeside,
    Problem,
    StudyFileError,
    model_problems,
    parse_toml,
    report,
)
from study.definition.translations import LanguageTag, TranslationFile, TranslationName
from study.language.catalogue import words_for
from study.language.words import Words
from study.parts.code import Code
from study.parts.shelf import Shelf
from study.records import TICK_S, StudyError

__all__ = [
    "Pickup",
    "SessionPlan",
    "Study",
    "StudyFileError",
    "TrialPlan",
    "drafted",
    "load_study",
    "next_order",
    "orders",
    "parse_study",
    "plan_session",
    "stimulus_rng",
]

DEFAULT_STUDY = Path(__file__).with_name("default.toml")
MOST_PERMUTED = 5
"""Up to so many conditions are run in every order there is (120); nobody would ever fill the 720 of six."""
_ANY_SEQUENCE = 3
"""With so few conditions every sequence of the orders is filled soon."""

_PLACEMENT, _OBJECTS, _BINS, _STIMULI = range(4)
"""Purposes of the random streams of a trial. Appending is safe, reordering changes every plan."""


class Study(Part):
    """A checked study file. Equal hashes mean equal files, byte for byte."""

    NOT_IN_FILE: ClassVar[tuple[str, ...]] = ("hash", "source_text")

    title: Text
    """Name of the study, as participants see it."""
    language: LanguageTag = "en"
    """What its participants read, as a tag such as `de` or `pt-BR`. The lab's own texts are shown in it; the study's
    texts stand in this file as they are."""
    dir: Literal["ltr", "rtl"] | None = None
    """Which way the pages run; the language's own if left out."""
    translation: TranslationName = ""
    """A file beside this one, such as `my-study.de.po`, that translates the lab's texts, or words them anew. What it
    lacks is as in the translation that ships, or in English."""
    translations: Annotated[tuple[TranslationFile, ...], Field(max_length=1)] = ()
    show_assistance: Flag = False
    """Whether the participant is told who is driving; the paper gave no cue."""
    practice: Flag = True
    practice_task: Literal["table", "round"] = "table"
    """`round`: practice asks for what the rounds ask for: the block stands to the side and goes into a bin, and one
    reading comes meanwhile. `table`: the block stands ahead of the arm, is put down elsewhere on the table, and no
    reading comes."""
    heartbeat_timeout_s: float = number(default=TICK_S, ge=0.3, le=30.0)
    """No tick starts when the page was last heard of longer ago: the default is one tick, so that silence is never
    taken for hands off."""
    layout: Identifier
    """Where the objects stand on the table, in front of which bins: a layout that ships, or the study's own."""
    objects: Annotated[tuple[Identifier, ...], Field(min_length=1)]
    """What stands there, as many as the layout has places, or fewer: objects that ship, and the layout's own."""
    bins: Annotated[tuple[Identifier, ...], Field(min_length=1)]
    """Which of the layout's bins objects are brought to."""
    pickups_per_trial: int = number(default=3, ge=1)
    task_limit_s: float = number(default=0.0, ge=0.0, le=86_400.0)
    """Trial time after which a pickup or a dropoff is over, all its attempts together: it fails with the reason
    `time_limit`, and the next object follows. 0 = none."""
    trial_limit_s: float = number(default=0.0, ge=0.0, le=86_400.0)
    """Trial time after which a trial is over, with what is not done left undone; a practice that takes as long gives
    way to its trial. 0 = none."""
    surveys: tuple[Identifier, ...] = ("sus_modified", "tlx_raw")
    """Questionnaires after every trial: built in, or the study's own. The paper's unless the file says otherwise:
    nobody is to find out after the study that none was asked."""
    english_questionnaires: tuple[Identifier, ...] = ()
    """Built-in ones that are asked in their English words although the study's language is another."""
    questionnaires: tuple[Questionnaire, ...] = ()
    layouts: tuple[LayoutSection, ...] = ()
    meshes: tuple[MeshFile, ...] = ()
    consent: Consent
    demographics: tuple[DemographicItem, ...] = ()
    instructions: Instructions
    texts: Texts
    conditions: Annotated[tuple[Condition, ...], Field(min_length=1)]
    arbiter: ArbiterSettings = ArbiterSettings()
    inference: InferenceSettings = InferenceSettings()
    robot: RobotSettings = RobotSettings()
    view: ViewSettings = ViewSettings()
    distractor: DistractorSettings = DistractorSettings()
    quality: QualityRules = QualityRules()
    eligibility: Eligibility = Eligibility()
    recruitment: Recruitment = Recruitment()
    code: tuple[CodeText, ...] = ()
    """Sources of the arbiters and other parts that do not ship with the lab. The lab writes them; a file that holds
    them needs no other file and no other version of a package."""

    hash: str = Field(default="", exclude=True)
    """SHA-256 of `source_text`: the file's bytes, when nothing of it stands in files beside it."""
    source_text: str = Field(default="", exclude=True, repr=False)
    """The file's text, with what stands in files beside it: all that is needed to run the study again."""

    @property
    def condition_ids(self) -> tuple[str, ...]:
        """Condition ids in the order of the file."""
        return tuple(condition.id for condition in self.conditions)

    @property
    def codes(self) -> tuple[Code, ...]:
        """The sources of the parts that do not ship with the lab."""
        return tuple(text.code for text in self.code)

    @property
    def instruments(self) -> tuple[Instrument, ...]:
        """The questionnaires after every trial, in the order asked."""
        own = {form.id: form.instrument for form in self.questionnaires}
        return tuple(own.get(name) or built_in(name, self.distractor.kind) for name in self.surveys)

    @property
    def words(self) -> Words:
        """The lab's texts in the study's language."""
        return words_for(self.language, self.dir, "".join(file.text for file in self.translations))

    @property
    def own_layout(self) -> LayoutSection | None:
        """The layout, if it is the study's own."""
        return next((layout for layout in self.layouts if layout.id == self.layout), None)

    @property
    def layout_in_use(self) -> LayoutInUse:
        """The layout with the study's objects."""
        layout = self.own_layout or shipped_layouts()[self.layout]
        known = known_to(layout)
        objects = tuple(known[name] for name in self.objects)
        meshes = {mesh.file: mesh.text for mesh in self.meshes}
        return LayoutInUse(layout, objects, meshes, practised_aside=self.practice_task == "round")

    @property
    def tasks_per_trial(self) -> int:
        """A pickup and a dropoff for each object moved."""
        return 2 * self.pickups_per_trial

    def condition(self, condition_id: str) -> Condition:
        """The condition of that id; `StudyError` names the ones there are."""
        for condition in self.conditions:
            if condition.id == condition_id:
                return condition
        raise StudyError(f"no condition {condition_id!r} in the study; it has {list(self.condition_ids)}")


def load_study(path: Path | str | None, *, world: WorldCheck | None = None, shelf: Shelf | None = None) -> Study:
    """Read a study file; None means the paper's study.

    Questionnaires, the layout and meshes in files beside it become a part of its text, and so do questionnaires of
    installed packages and the source of every part it names that does not ship. `world` tells what the robot cannot
    reach or hold (`app.trial.world`), `shelf` which parts there are and whose code may run; without one, parts are not
    looked at. Raises `StudyFileError` with one line for every problem.
    """
    file = DEFAULT_STUDY if path is None else Path(path)
    source, beside, problems, told = with_files_beside(file, shelf)
    try:
        study = parse_study(source, name=str(file), world=world, shelf=shelf, beside=beside, told=told)
    except StudyFileError as error:
        raise StudyFileError([*error.problems, *problems]) from None
    if problems:
        raise StudyFileError(problems)
    return study


def drafted(path: Path) -> LayoutInUse | None:
    """The layout of a study file that may have problems, for a picture of them; None when it cannot be read."""
    try:
        source, *_ = with_files_beside(path, None)
        return in_use(parse_toml(source, str(path))[0])
    except StudyFileError:
        return None


def parse_study(
    source: bytes | str,
    *,
    name: str = "study file",
    world: WorldCheck | None = None,
    shelf: Shelf | None = None,
    beside: Sequence[FileBeside] = (),
    told: Collection[FieldPath] = (),
) -> Study:
    """A study from the text of its file; as `load_study`. `beside` are the files whose text it has taken in, `told`
    the places of parts about which everything is told already."""
    data, text = parse_toml(source.encode() if isinstance(source, str) else source, name)
    reserved = [
        Problem((key,), "unknown field; it is computed from the file") for key in Study.NOT_IN_FILE if key in data
    ]
    wrong = [*reserved, *model_problems(Study, data), *cross_problems(data, world, shelf)]
    if shelf is not None:  # a file, not what was stored of one
        wrong += part_problems(data, shelf, told)
        wrong += text_problems(data)
    if wrong:
        raise report(name, text, data, wrong, beside)
    return Study.model_validate(
        {**data, "hash": hashlib.sha256(text.encode()).hexdigest(), "source_text": text},
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
    """Object id at each place of the layout, in the order of the places."""
    pickups: tuple[Pickup, ...]
    seed: int
    """The participant's seed; `stimulus_rng` draws from it."""


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
    """The orders of the conditions, always in the same sequence; 6 with the paper's three.

    Up to five conditions: every order. More: a Williams design, in which every condition stands in every place, and
    after every other one, equally often (E. J. Williams, 1949). Four and five begin with that design, and go on square
    by square, so that whoever stops early has every condition in every place about equally often too.
    """
    ids = study.condition_ids
    count = len(ids)
    if count <= _ANY_SEQUENCE:
        return tuple(itertools.permutations(ids))
    first = [(place + 1) // 2 if place % 2 else -place // 2 for place in range(count)]  # 0, 1, -1, 2, -2, ...
    rows = _square(first, ids)
    # With an odd number, only the rows and their mirror images together are balanced.
    design = [*rows, *(row[::-1] for row in rows)] if count % 2 else rows
    if count > MOST_PERMUTED:
        return tuple(design)
    squares = [_square((0, *rest), ids) for rest in itertools.permutations(range(1, count))]
    return tuple(dict.fromkeys([*design, *(order for square in squares for order in square)]))


def _square(steps: Sequence[int], ids: Sequence[str]) -> list[tuple[str, ...]]:
    """So many orders as there are conditions, each condition once in each place."""
    return [tuple(ids[(step + shift) % len(ids)] for step in steps) for shift in range(len(ids))]


def next_order(study: Study, taken: Mapping[tuple[str, ...], int]) -> tuple[str, ...]:
    """The order run least often so far; of several, the first in `orders`.

    `taken` counts the participants who hold a cell: demo, rejected and withdrawn ones do not, so that their cell is
    given out again. Orders that are not in `taken` count as 0, orders of another study are ignored.
    """
    return min(orders(study), key=lambda order: taken.get(order, 0))


def plan_session(study: Study, order: tuple[str, ...], seed: int) -> SessionPlan:
    """Draw one participant's placements, objects and bins. Same arguments, same plan, on every machine.

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
            )
        )
    return SessionPlan(seed=seed, order=order, trials=tuple(trials))


def stimulus_rng(seed: int, trial: int, number: int) -> np.random.Generator:
    """The random stream of one stimulus of the distractor; trial and number are from 1."""
    if number < 1:
        raise StudyError(f"stimulus {number} must be at least 1")
    return _stream(seed, trial, _STIMULI, number)


def _stream(seed: int, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
