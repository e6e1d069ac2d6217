"""A study's distractor as a trial asks it: whatever it raises becomes a `PartFault` that names it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from app.trial.reasoning import PartFault
from study.flow.distractors.interface import Distractor, Stimulus

Answer = TypeVar("Answer")


class GuardedDistractor(Distractor[Any]):
    """Answers as the distractor in it does.

    Attributes:
        inner: that distractor.
    """

    def __init__(self, inner: Distractor[Any]) -> None:
        super().__init__(inner.parameters, inner.settings)
        self.inner = inner
        self.words = inner.words  # type: ignore[misc]  # of the kind in it

    def due_s(self, number: int) -> float:
        return self._asked(lambda: self.inner.due_s(number))

    def deadline_s(self, number: int) -> float:
        return self._asked(lambda: self.inner.deadline_s(number))

    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        return self._asked(lambda: self.inner.stimulus(seed, trial, number))

    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        return self._asked(lambda: self.inner.right_answer(stimuli))

    def is_right(self, answer: str, stimuli: Sequence[Stimulus]) -> bool:
        return self._asked(lambda: self.inner.is_right(answer, stimuli))

    def simulated_answer(self, stimuli: Sequence[Stimulus], error_rate: float, rng: np.random.Generator) -> str:
        return self._asked(lambda: self.inner.simulated_answer(stimuli, error_rate, rng))

    def _asked(self, ask: Callable[[], Answer]) -> Answer:
        try:
            return ask()
        except Exception as error:  # somebody else's code may raise whatever it likes
            text = " ".join(str(error).split())[:300]
            raise PartFault(f"distractor {self.settings.kind!r}", f"raised {type(error).__name__}: {text}") from error
