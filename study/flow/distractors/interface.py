"""What a distractor is: the second task that calls the hands away from the robot, of any kind.

A kind is one class. It says what is shown for stimulus number k and what the right answer to it is; when stimuli come
and how long they can be answered it takes from the study's settings, unless it says otherwise. Everything is a
function of the participant's seed, the trial and the stimulus's number, so that a restart shows the very same.

    class Sums(Distractor[SumParameters]):
        Parameters = SumParameters
        words = Words("sum", "sums")

        def stimulus(self, seed, trial, number):
            first, second = stimulus_rng(seed, trial, number).integers(10, 90, size=2)
            return Stimulus(f"{first} + {second}", "Type the sum, then press Enter", entry="number")

        def right_answer(self, stimuli):
            return str(sum(int(part) for part in stimuli[-1].text.split(" + ")))

The pages draw any kind from the data of its stimuli: nothing is added to `static/`.
"""

from __future__ import annotations

import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, Literal, TypeVar

import numpy as np

from study.definition.sections import DistractorSettings
from study.definition.study import stimulus_rng
from study.flow.typed_number import numerals, same_number

__all__ = [
    "MAX_ANSWER_CHARACTERS",
    "MAX_TEXT_CHARACTERS",
    "Choice",
    "Distractor",
    "Entry",
    "Stimulus",
    "Words",
    "stimulus_rng",
]

MAX_TEXT_CHARACTERS = 40
"""Of what is shown: it is drawn large enough to be read from two metres away."""
MAX_ANSWER_CHARACTERS = 40

Entry = Literal["text", "number"]
ParametersType = TypeVar("ParametersType")


@dataclass(frozen=True)
class Words:
    """What pages and reports call a stimulus: `reading`, `readings`."""

    one: str
    many: str


@dataclass(frozen=True)
class Choice:
    """An answer to choose."""

    id: str
    """What the record holds when it is chosen."""
    label: str
    """What stands on its button."""
    key: str
    """The key that chooses it: one character, best a digit, because letters drive the robot."""


@dataclass(frozen=True)
class Stimulus:
    """What is shown, and how it is answered."""

    text: str
    """Drawn large, and recorded as it stands."""
    prompt: str = ""
    """What to do with it, in one line."""
    choices: tuple[Choice, ...] = ()
    """What can be chosen; empty = the answer is typed."""
    entry: Entry = "text"
    """What is typed. With `number`, the page takes nothing else, and numbers are compared: `0482,10` is `482.1`."""

    def takes(self, answer: str) -> bool:
        """Whether this can be an answer at all, right or wrong."""
        if self.choices:
            return answer in [choice.id for choice in self.choices]
        return self.entry == "text" or bool(numerals(answer))


class Distractor(ABC, Generic[ParametersType]):
    """One kind of second task, with its parameters and the study's settings common to all kinds."""

    Parameters: ClassVar[type]
    """A frozen dataclass: its fields are the fields of `[distractor]` beside the common ones."""
    words: ClassVar[Words] = Words("task", "tasks")

    def __init__(self, parameters: ParametersType, settings: DistractorSettings) -> None:
        self.parameters = parameters
        self.settings = settings

    # ---- when ---------------------------------------------------------------------------------------------------

    def due_s(self, number: int) -> float:
        """Trial time at which stimulus `number`, from 1, is shown; each is due after the one before it."""
        return self.settings.first_s + (number - 1) * self.settings.every_s

    def deadline_s(self, number: int) -> float:
        """Trial time from which on it takes no answer; the next stimulus ends it in any case."""
        return self.due_s(number) + self.settings.answer_within_s

    # ---- what ---------------------------------------------------------------------------------------------------

    @abstractmethod
    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        """What is shown as stimulus `number` of a trial, both from 1. The same arguments give the same stimulus: draw
        from `stimulus_rng(seed, trial, number)` and nothing else."""

    @abstractmethod
    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        """A right answer to the last of all stimuli that the trial has shown so far."""

    def is_right(self, answer: str, stimuli: Sequence[Stimulus]) -> bool:
        """Whether the answer to the last of these stimuli counts as right: unless the kind says otherwise, it has to
        be the same number, or the same text with capitals as small letters, full-width forms as plain ones, and
        without marks that nobody sees."""
        right = self.right_answer(stimuli)
        if stimuli[-1].entry == "number" and not stimuli[-1].choices:
            return any(same_number(answer, numeral) for numeral in numerals(right)[:1])
        return _compared(answer) == _compared(right)

    # ---- as a simulated person answers --------------------------------------------------------------------------

    def simulated_answer(self, stimuli: Sequence[Stimulus], error_rate: float, rng: np.random.Generator) -> str:
        """What a simulated person answers, wrong at this rate: one of the other choices, or a text with one character
        too many."""
        right = self.right_answer(stimuli)
        if rng.random() >= error_rate:
            return right
        others = [choice.id for choice in stimuli[-1].choices if not self.is_right(choice.id, stimuli)]
        if others:
            return others[int(rng.integers(len(others)))]
        return right if stimuli[-1].choices else right + str(int(rng.integers(10)))


def _compared(text: str) -> str:
    """A text as it is compared."""
    seen = "".join(one for one in text if unicodedata.category(one) != "Cf")
    return unicodedata.normalize("NFKC", seen).strip().casefold()
