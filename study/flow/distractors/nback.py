"""N-back: letters come one by one, and each is or is not the same as the one n before it (W. K. Kirchner, 1958)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from study.definition.part_fields import WrongParameter
from study.flow.distractors.interface import Choice, Distractor, Stimulus, Words, stimulus_rng
from study.language.words import phrase

PROMPTS = {
    1: phrase("Is this letter the same as the one before?"),
    2: phrase("Is this letter the same as the one 2 before?"),
    3: phrase("Is this letter the same as the one 3 before?"),
    4: phrase("Is this letter the same as the one 4 before?"),
    5: phrase("Is this letter the same as the one 5 before?"),
}
"""By how far back the letter is compared."""


@dataclass(frozen=True)
class NBackParameters:
    """Which letters come, and how often one comes back."""

    n: Annotated[int, Field(ge=1, le=5)] = 2
    """How far back the letter is compared."""
    letters: Annotated[str, Field(min_length=2, max_length=26)] = "BFHJKLMQRX"
    """The letters that are drawn from; they should look and sound different."""
    target_rate: Annotated[float, Field(ge=0.0, le=1.0)] = 0.3
    """Share of the letters that are the same as the one n back; the first n of a trial are none."""

    def __post_init__(self) -> None:
        if not self.letters.isalnum() or len(set(self.letters.casefold())) < len(self.letters):
            raise WrongParameter("letters", "must be letters or digits, each of them once")


class NBack(Distractor[NBackParameters]):
    """The first n letters of a trial have nothing to be compared with: `different` is right."""

    Parameters = NBackParameters
    words = Words(phrase("letter"), phrase("letters"))

    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        """The letter, and the two answers."""
        choices = (Choice("same", phrase("Same"), "1"), Choice("different", phrase("Different"), "2"))
        return Stimulus(self._letters(seed, trial, number)[-1], PROMPTS[self.parameters.n], choices)

    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        """Whether the last letter is the same as the one n back."""
        n = self.parameters.n
        return "same" if len(stimuli) > n and stimuli[-1].text == stimuli[-1 - n].text else "different"

    def _letters(self, seed: int, trial: int, count: int) -> list[str]:
        """The first letters of a trial. Each has its own stream, so that they do not depend on how many are drawn."""
        n, letters = self.parameters.n, self.parameters.letters
        drawn: list[str] = []
        for number in range(1, count + 1):
            rng = stimulus_rng(seed, trial, number)
            before = drawn[-n] if len(drawn) >= n else None
            is_target = before is not None and rng.random() < self.parameters.target_rate
            others = [letter for letter in letters if letter != before]
            drawn.append(before if is_target and before else others[int(rng.integers(len(others)))])
        return drawn
