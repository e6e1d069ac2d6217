"""Sensor readings to be logged, as in the paper (IV-B): a number is shown, and the same number is typed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from study.definition.part_fields import WrongParameter
from study.flow.distractors.interface import Distractor, Stimulus, Words, stimulus_rng


@dataclass(frozen=True)
class ReadingParameters:
    """How a reading looks."""

    digits: Annotated[int, Field(ge=1, le=9)] = 4
    """How many digits a reading has."""
    decimals: Annotated[int, Field(ge=0, le=4)] = 1
    """How many of the digits stand after the point."""

    def __post_init__(self) -> None:
        if self.decimals >= self.digits:
            raise WrongParameter("decimals", f"must be below digits, which is {self.digits}")


class Readings(Distractor[ReadingParameters]):
    """Numbers such as `482.1`, compared as numbers: however they are typed."""

    Parameters = ReadingParameters
    words = Words("reading", "readings")

    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        """As many digits as asked, the first of them not 0."""
        digits, decimals = self.parameters.digits, self.parameters.decimals
        text = str(stimulus_rng(seed, trial, number).integers(10 ** (digits - 1), 10**digits))
        point = digits - decimals
        return Stimulus(f"{text[:point]}.{text[point:]}" if decimals else text, entry="number")

    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        """The reading itself."""
        return stimuli[-1].text

    def simulated_answer(self, stimuli: Sequence[Stimulus], error_rate: float, rng: np.random.Generator) -> str:
        """The reading, at the rate of errors with one wrong digit."""
        text = stimuli[-1].text
        digit = int(rng.integers(len(text)))
        if rng.random() < error_rate and text[digit].isdigit():
            return text[:digit] + str((int(text[digit]) + int(rng.integers(1, 10))) % 10) + text[digit + 1 :]
        return text
