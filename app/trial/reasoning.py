"""Asking a trial's goal inference and arbiter: with their memories, and no further than their answers can be used.

Somebody else wrote them, perhaps. Whatever they do, an answer that comes out of here is one the robot can carry out;
everything else is a `PartFault`, raised before anything has moved.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, Direction, index_of
from app.autonomy.belief import Belief
from app.autonomy.interface import Arbiter, Explanation, Feasible, Part, State
from app.errors import LabError
from app.trial.parts import make_arbiter, make_inference
from app.trial.values import CycleStart, TrialSetup
from study.parts.errors import PartError, one_line, plain
from study.parts.shelf import Named

MAX_MEMORY_BYTES = 64 * 1024
MAX_EXPLANATION = 24
"""Lines of an explanation that are passed on."""

ANSWER_WITHIN_S, MAKE_WITHIN_S = 5.0, 60.0
"""A part that no signal reaches, in code of a library perhaps, is ended with its process after so long."""
_LARGEST_EXACT = 2**53

STAY = DIRECTIONS[NULL_ACTION]
Limit = Callable[[], AbstractContextManager[object]]
"""What a part is asked within; it may end the asking with an exception (`app.worker.time_limit`)."""


Told = Callable[[str, float], None]
"""Told before a part is made or asked, with how long that may take; and with "" when it has answered."""


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
    """The inference and the arbiter of one trial.

    `limit` is what they are asked within; without one (simulated people) they may think as long as they like. `asking`
    is told before a part is made or asked, for whoever has to say what a process that hangs was doing.
    """

    def __init__(
        self,
        setup: TrialSetup,
        start: CycleStart,
        limit: Limit | None = None,
        asking: Told | None = None,
    ) -> None:
        self._setup = setup
        self._limit = limit
        self._told = asking or _tell_nobody
        self._unlimited: dict[str, _Asking] = {}
        self.forget(start)
        self._last: tuple[State, Belief, Direction | None, Direction] | None = None

    @property
    def memories(self) -> tuple[str, str]:
        """What inference and arbiter remember, as JSON."""
        return self._inference_memory, self._arbiter_memory

    def forget(self, start: CycleStart) -> None:
        """Take back to what both remembered there; `begin_cycle` follows."""
        self._inference_memory, self._arbiter_memory = start.inference_memory, start.arbiter_memory

    def begin_cycle(self) -> None:
        """Make both anew, with what they remember: nothing else outlives a cycle, whether or not it was interrupted.

        That may take its time; only what is asked in a tick is limited. Raises `PartFault`.
        """
        self._last = None
        with self._asking(self._setup.inference, making=True):
            self._inference = make_inference(self._setup.inference, self._setup.models)
            _remind(self._inference, self._inference_memory)
        self._infers_itself = type(self._inference).__module__.startswith("app.autonomy.")  # and is not to be checked
        with self._asking(self._setup.arbiter, making=True):
            self._arbiter = make_arbiter(self._setup.arbiter, self._setup.models)
            _remind(self._arbiter, self._arbiter_memory)

    def decide(
        self, state: State, belief: Belief, user: Direction | None, allowed: Callable[[Belief], Feasible]
    ) -> tuple[Belief, Direction, bool]:
        """The belief after the person's action, the arm's action, and whether the arm moves by itself. `allowed`: what
        the arm may do, given that belief.

        Raises `PartFault`; inference and arbiter are then to be made anew.
        """
        named = self._setup.inference
        with self._asking(named):
            after = self._inference.update(state, belief, user)
            if after is not belief and not (self._infers_itself and type(after) is Belief):
                after = _checked_belief(named, after, belief)
            self._inference_memory = _remembered(named, self._inference, self._inference_memory)
        named = self._setup.arbiter
        with self._asking(named):
            feasible = allowed(after)
            answer = self._arbiter.decide(state, after, user, feasible)
            keeps_way_on = user is None and self._setup.keep_way_on
            action = _checked_action(named, self._arbiter, answer, user, feasible, keeps_way_on)
            self._arbiter_memory = _remembered(named, self._arbiter, self._arbiter_memory)
            alone = user is None and bool(self._arbiter.moves_by_itself)
        self._last = state, after, user, action
        return after, action, alone

    def explain(self) -> Explanation:
        """What spoke for the last action, as the arbiter says it; its failure is one line of it, and harms nothing."""
        if self._last is None:
            return {}
        named = self._setup.arbiter
        try:
            with self._asking(named):
                told = dict(itertools.islice(self._arbiter.explain(*self._last).items(), MAX_EXPLANATION))
                shown = {plain(str(name))[:60]: _shown(value) for name, value in told.items()}
                if _remembered(named, self._arbiter, self._arbiter_memory) != self._arbiter_memory:
                    self._arbiter.memory = json.loads(self._arbiter_memory) if self._arbiter_memory else None
                    raise PartFault(_called(named), "changed its memory in explain; only decide may")
                return shown
        except PartFault as fault:
            return {"explanation": f"failed: {fault}"[:200]}

    def _asking(self, named: Named, making: bool = False) -> _Asking:
        if self._limit is None and named.code is None:  # it ends nothing and tells nobody: one serves every tick
            if named.kind not in self._unlimited:
                self._unlimited[named.kind] = _Asking(named, None, _tell_nobody, 0.0, live=False)
            return self._unlimited[named.kind]
        limit = self._limit() if self._limit is not None and not making else nullcontext()
        told = self._told if named.code is not None else _tell_nobody
        return _Asking(named, limit, told, MAKE_WITHIN_S if making else ANSWER_WITHIN_S, live=self._limit is not None)


class _Asking(AbstractContextManager["_Asking"]):
    """Inside, whatever a part raises becomes a `PartFault` that names it. Only a person's Ctrl+C is none of its doing:
    in a live trial (`live`) nobody can press that."""

    def __init__(
        self, named: Named, limit: AbstractContextManager[object] | None, told: Told, within_s: float, live: bool
    ) -> None:
        self._named, self._limit, self._told, self._within_s, self._live = named, limit, told, within_s, live

    def __enter__(self) -> _Asking:
        if self._limit is not None:
            self._told(_called(self._named), self._within_s)
            self._limit.__enter__()
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if self._limit is not None:
            try:
                self._limit.__exit__(kind, error, trace)
            except TookTooLong as late:
                error = late
            self._told("", 0.0)
        if error is None or isinstance(error, PartFault) or (isinstance(error, KeyboardInterrupt) and not self._live):
            return
        called = _called(self._named)
        if isinstance(error, (PartError, TookTooLong)):
            raise PartFault(called, one_line(error).removeprefix(f"{called} ")) from error
        raise PartFault(called, f"raised {type(error).__name__}: {one_line(error)}") from error


def _tell_nobody(part: str, within_s: float) -> None:
    """Parts that ship do not hang."""


def _checked_belief(named: Named, after: object, before: Belief) -> Belief:
    if not isinstance(after, Belief):
        raise PartFault(_called(named), f"returned {_short(after)}; it must return a Belief")
    if after.goal_ids != before.goal_ids:
        said, goals = ", ".join(after.goal_ids), ", ".join(before.goal_ids)
        raise PartFault(_called(named), f"returned a belief over {said}; the goals are {goals}")
    return Belief(before.goal_ids, after.probabilities)  # whatever class it is of, and whatever was done to it


def _checked_action(
    named: Named, arbiter: Arbiter, answer: Any, user: Direction | None, feasible: Feasible, keeps_way_on: bool
) -> Direction:
    called = _called(named)
    try:
        action = DIRECTIONS[index_of(answer)]
    except Exception:
        raise PartFault(called, f"returned {_short(answer)}; it must be three numbers, each -1, 0 or 1") from None
    if user is None and action != STAY and not arbiter.moves_by_itself:
        raise PartFault(called, f"returned {action} with the hands off; it says that it does not move by itself")
    if action not in (STAY, user) and not feasible(action):
        or_not = ", or after which it could not go on (keep_way_on)" if keeps_way_on else ""
        raise PartFault(called, f"chose {action}, which the arm cannot do from here{or_not}")
    return action


def _remembered(named: Named, part: Part, before: str) -> str:
    memory = part.memory
    if memory is None and before in ("", "null"):
        return before
    try:
        text = json.dumps(memory, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise PartFault(_called(named), f"has a memory that is not JSON: {one_line(error)}") from None
    size = len(text.encode())
    if size > MAX_MEMORY_BYTES:
        raise PartFault(_called(named), f"has a memory of {size} bytes; at most {MAX_MEMORY_BYTES}")
    return text


def _remind(part: Part, memory: str) -> None:
    if memory:
        part.memory = json.loads(memory)


def _called(named: Named) -> str:
    return f"{named.kind} {named.name!r}"


def _short(value: object) -> str:
    try:
        text = plain(repr(value))
    except Exception as error:
        text = f"something whose repr raises {type(error).__name__}"
    return text if len(text) <= 80 else text[:79] + "…"


def _shown(value: object) -> float | str:
    if isinstance(value, float) and abs(value) < float("inf"):
        return value
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) < _LARGEST_EXACT:
        return float(value)
    return plain(str(value))[:200]
