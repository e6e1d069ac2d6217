"""Asking a trial's goal inference and arbiter: with their memories, and no further than their answers can be used.

Somebody else wrote them, perhaps. Whatever they do, an answer that comes out of here is one the robot can carry out;
everything else is a `PartFault`, raised before anything has moved.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, Direction, index_of
from app.autonomy.belief import Belief
from app.autonomy.interface import Explanation, Feasible, Part, State
from app.errors import LabError
from app.trial.parts import make_arbiter, make_inference
from app.trial.values import CycleStart, TrialSetup
from study.parts.errors import PartError
from study.parts.shelf import Named

MAX_MEMORY_BYTES = 64 * 1024
MAX_EXPLANATION = 24
"""Lines of an explanation that are passed on."""

STAY = DIRECTIONS[NULL_ACTION]
Limit = Callable[[], AbstractContextManager[object]]
"""What a part is asked within; it may end the asking with an exception (`app.worker.time_limit`)."""


class TookTooLong(BaseException):
    """What a limit raises inside a part. No `Exception`, so that a part that catches everything does not catch it."""


class PartFault(LabError):
    """An arbiter, an inference or a distractor did what cannot be used. The tick it was asked for did not happen.

    Attributes:
        part: which, as `arbiter 'blend'`.
        reason: what it did, in one line.
    """

    def __init__(self, part: str, reason: str) -> None:
        self.part, self.reason = part, reason
        super().__init__(f"{part} {reason}")

    def __reduce__(self) -> tuple[type[PartFault], tuple[str, str]]:
        """A process that simulates people hands it over whole."""
        return PartFault, (self.part, self.reason)


class Reasoning:
    """The inference and the arbiter of one trial."""

    def __init__(self, setup: TrialSetup, start: CycleStart, limit: Limit = nullcontext) -> None:
        self._setup = setup
        self._limit = limit
        self._inference_memory, self._arbiter_memory = start.inference_memory, start.arbiter_memory
        self._last: tuple[State, Belief, Direction | None, Direction] | None = None

    @property
    def memories(self) -> tuple[str, str]:
        """What inference and arbiter remember, as JSON."""
        return self._inference_memory, self._arbiter_memory

    def begin_cycle(self) -> None:
        """Make both anew, with what they remember: nothing else outlives a cycle, whether or not it was interrupted.

        That may take its time; only what is asked in a tick is limited. Raises `PartFault`.
        """
        self._last = None
        with _Asking(self._setup.inference):
            self._inference = make_inference(self._setup.inference, self._setup.models)
            _remind(self._inference, self._inference_memory)
        with _Asking(self._setup.arbiter):
            self._arbiter = make_arbiter(self._setup.arbiter, self._setup.models)
            _remind(self._arbiter, self._arbiter_memory)

    def decide(
        self, state: State, belief: Belief, user: Direction | None, feasible: Feasible
    ) -> tuple[Belief, Direction, bool]:
        """The belief after the person's action, the arm's action, and whether the arm moves by itself.

        Raises `PartFault`; inference and arbiter are then to be made anew.
        """
        with self._asking(self._setup.inference):
            after = self._inference.update(state, belief, user)
        self._check_belief(after, belief)
        self._inference_memory = self._remembered(self._setup.inference, self._inference, self._inference_memory)
        with self._asking(self._setup.arbiter):
            answer = self._arbiter.decide(state, after, user, feasible)
        action = self._checked_action(answer, user, feasible)
        self._arbiter_memory = self._remembered(self._setup.arbiter, self._arbiter, self._arbiter_memory)
        self._last = state, after, user, action
        return after, action, user is None and self._arbiter.moves_by_itself

    def explain(self) -> Explanation:
        """What spoke for the last action, as the arbiter says it; its failure is one line of it, and harms nothing."""
        if self._last is None:
            return {}
        try:
            with self._asking(self._setup.arbiter):
                told = self._arbiter.explain(*self._last)
                return {str(name)[:60]: _shown(value) for name, value in list(told.items())[:MAX_EXPLANATION]}
        except (PartFault, AttributeError) as fault:
            return {"explanation": f"failed: {fault}"[:200]}

    def _asking(self, named: Named) -> _Asking:
        return _Asking(named, self._limit())

    def _check_belief(self, after: object, before: Belief) -> None:
        if after is before:
            return
        if not isinstance(after, Belief):
            raise PartFault(_called(self._setup.inference), f"returned {_short(after)}; it must return a Belief")
        if after.goal_ids != before.goal_ids:
            raise PartFault(
                _called(self._setup.inference),
                f"returned a belief over {', '.join(after.goal_ids)}; the goals are {', '.join(before.goal_ids)}",
            )

    def _checked_action(self, answer: Any, user: Direction | None, feasible: Feasible) -> Direction:
        called = _called(self._setup.arbiter)
        try:
            action = DIRECTIONS[index_of(answer)]
        except Exception:
            raise PartFault(called, f"returned {_short(answer)}; it must be three numbers, each -1, 0 or 1") from None
        if user is None and action != STAY and not self._arbiter.moves_by_itself:
            raise PartFault(called, f"returned {action} with the hands off; it says that it does not move by itself")
        if action not in (STAY, user) and not feasible(action):
            raise PartFault(called, f"chose {action}, which the arm cannot do from here")
        return action

    def _remembered(self, named: Named, part: Part, before: str) -> str:
        if part.memory is None and before in ("", "null"):
            return before
        try:
            text = json.dumps(part.memory, allow_nan=False)
        except (TypeError, ValueError, RecursionError) as error:
            raise PartFault(_called(named), f"has a memory that is not JSON: {error}") from None
        size = len(text.encode())
        if size > MAX_MEMORY_BYTES:
            raise PartFault(_called(named), f"has a memory of {size} bytes; at most {MAX_MEMORY_BYTES}")
        return text


class _Asking(AbstractContextManager["_Asking"]):
    """Inside, whatever a part raises becomes a `PartFault` that names it."""

    def __init__(self, named: Named, limit: AbstractContextManager[object] | None = None) -> None:
        self._named, self._limit = named, limit or nullcontext()

    def __enter__(self) -> _Asking:
        self._limit.__enter__()
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        try:
            self._limit.__exit__(kind, error, trace)
        except TookTooLong as late:
            error = late
        if isinstance(error, (PartError, TookTooLong)):
            raise PartFault(_called(self._named), str(error)) from error
        if isinstance(error, (Exception, SystemExit)):
            text = " ".join(str(error).split())[:300]
            raise PartFault(_called(self._named), f"raised {type(error).__name__}: {text}") from error


def _remind(part: Part, memory: str) -> None:
    if memory:
        part.memory = json.loads(memory)


def _called(named: Named) -> str:
    return f"{named.kind} {named.name!r}"


def _short(value: object) -> str:
    try:
        text = " ".join(repr(value).split())
    except Exception as error:
        text = f"something whose repr raises {type(error).__name__}"
    return text if len(text) <= 80 else text[:79] + "…"


def _shown(value: object) -> float | str:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)[:200]
    number = float(value)
    return number if abs(number) < float("inf") else str(number)
