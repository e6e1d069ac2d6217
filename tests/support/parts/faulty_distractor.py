"""A distractor that misbehaves as long as a file is there. Copied beside a study file by tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from study.flow.distractors.interface import Distractor, Stimulus, Words


@dataclass(frozen=True)
class Switched:
    """Where the file is."""

    switch: str = ""
    """Path of the file."""


class Breaks(Distractor[Switched]):
    """Shows the number of the stimulus."""

    Parameters: ClassVar[type[Any]] = Switched
    words = Words("number", "numbers")

    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        if Path(self.parameters.switch).exists():
            raise KeyError("no number\ntoday")
        return Stimulus(str(number), "Type the number")

    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        return stimuli[-1].text

    def is_right(self, answer: str, stimuli: Sequence[Stimulus]) -> bool:
        if answer == "break":
            raise ValueError("what is that?")
        return super().is_right(answer, stimuli)
