"""A distractor of one's own: sums such as `17 + 26 = 44`, each to be called right or wrong.

The pages draw it, the lab records and judges it, simulated people answer it: all from this one class.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from study.flow.distractors.interface import Choice, Distractor, Stimulus, Words, stimulus_rng


@dataclass(frozen=True)
class SumParameters:
    """The fields of `[distractor]` beside the common ones. A value out of bounds is told with its line."""

    largest: Annotated[int, Field(ge=2, le=99)] = 50
    """The largest number that is added."""
    wrong_rate: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    """Share of the sums that are wrong."""


class Sums(Distractor[SumParameters]):
    """Is the sum right? A wrong one is off by one or two."""

    Parameters = SumParameters
    words = Words("sum", "sums")

    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        """What is shown is recorded as it stands: here it is all that the answer depends on."""
        rng = stimulus_rng(seed, trial, number)
        first, second = (int(value) for value in rng.integers(1, self.parameters.largest + 1, size=2))
        error = int(rng.integers(1, 3)) if rng.random() < self.parameters.wrong_rate else 0
        choices = (Choice("right", "Right", "1"), Choice("wrong", "Wrong", "2"))
        return Stimulus(f"{first} + {second} = {first + second + error}", "Is this sum right?", choices)

    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        """The last of the stimuli is the one that is asked about; N-back would look at the ones before it too."""
        left, total = stimuli[-1].text.split(" = ")
        return "right" if sum(int(part) for part in left.split(" + ")) == int(total) else "wrong"
