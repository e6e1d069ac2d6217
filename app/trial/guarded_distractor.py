"""A study's distractor as a trial asks it: whatever it raises becomes a `PartFault` that names it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import Any, TypeVar

import numpy as np

from app.trial.reasoning import Limit, PartFault, TookTooLong
from study.flow.distractors.interface import Distractor, Stimulus
from study.parts.errors import one_line

Answer = TypeVar("Answer")


class GuardedDistractor(Distractor[Any]):
    """Answers as the distractor in it does.

    Attributes:
        inner: that distractor.
    """

    def __init__(self, inner: Distractor[Any], limit: Limit = nullcontext) -> None:
        """`limit` is what it is asked within: it is asked where everybody's sessions run, and has to be quick."""
        super().__init__(inner.parameters, inner.settings)
        self.inner = inner
        self._limit = limit
        self.words = inner.words  # type: ignore[misc]  # of the kind in it

    def due_s(self, number: int) -> float:
        return self._asked(lambda: self.inner.due_s(number))

    def deadline_s(self, number: int) -> float:
        return self._asked(lambda: self.inner.deadline_s(number))

    def stimulus(self, seed: int, trial: int, number: int) -> Stimulus:
        def asked() -> Stimulus:
            shown = self.inner.stimulus(seed, trial, number)
            if not isinstance(shown, Stimulus):
                raise TypeError(f"stimulus {number} is of type {type(shown).__name__}; it must be a Stimulus")
            of_choices = [text for one in shown.choices for text in (one.id, one.label, one.key)]
            if not all(text.isprintable() for text in (shown.text, shown.prompt, *of_choices)):
                raise ValueError(f"stimulus {number} has a text that cannot be shown")
            return shown

        return self._asked(asked)

    def right_answer(self, stimuli: Sequence[Stimulus]) -> str:
        return self._asked(lambda: self.inner.right_answer(stimuli))

    def is_right(self, answer: str, stimuli: Sequence[Stimulus]) -> bool:
        return self._asked(lambda: self.inner.is_right(answer, stimuli))

    def simulated_answer(self, stimuli: Sequence[Stimulus], error_rate: float, rng: np.random.Generator) -> str:
        return self._asked(lambda: self.inner.simulated_answer(stimuli, error_rate, rng))

    def _asked(self, ask: Callable[[], Answer]) -> Answer:
        called = f"distractor {self.settings.kind!r}"
        try:
            with self._limit():
                return ask()
        except TookTooLong as late:
            raise PartFault(called, one_line(late)) from late
        except (Exception, SystemExit) as error:  # somebody else's code may raise whatever it likes
            raise PartFault(called, f"raised {type(error).__name__}: {one_line(error)}") from error
