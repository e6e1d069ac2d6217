"""Arbiters that misbehave, each in its way, from the tick the test says: a file to be copied beside a study file."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge

from app.autonomy.actions import DIRECTIONS, Direction
from app.autonomy.belief import Belief
from app.autonomy.interface import Arbiter, Explanation, Feasible, GoalInference, State

STAY: Direction = (0, 0, 0)


@dataclass(frozen=True)
class Parameters:
    """When it misbehaves: in tick `tick`, as long as the file `switch` is there (always, if none is named)."""

    tick: Annotated[int, Ge(0)] = 2
    switch: str = ""
    switch_off: bool = False
    """Remove the file when it has misbehaved: it happens once."""


class Faulty(Arbiter):
    """Does what the person does; `misbehave` is what the others differ in."""

    Parameters = Parameters

    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Any:
        switch = Path(self.parameters.switch) if self.parameters.switch else None
        if state.tick == self.parameters.tick and (switch is None or switch.exists()):
            if switch is not None and self.parameters.switch_off:
                switch.unlink()
            return self.misbehave(state, feasible)
        return user or STAY

    def misbehave(self, state: State, feasible: Feasible) -> Any:
        raise NotImplementedError


class Raises(Faulty):
    def misbehave(self, state: State, feasible: Feasible) -> Any:
        raise KeyError(f"goal of tick {state.tick}")


class ReturnsNaN(Faulty):
    def misbehave(self, state: State, feasible: Feasible) -> Any:
        return (math.nan, 0, 0)


class Impossible(Faulty):
    """Chooses what the arm cannot do; what that is, it asks."""

    def misbehave(self, state: State, feasible: Feasible) -> Any:
        return next((action for action in DIRECTIONS if not feasible(action)), "nothing is impossible here")


class Slow(Faulty):
    def misbehave(self, state: State, feasible: Feasible) -> Any:
        time.sleep(0.3)
        return STAY


class CatchesEverything(Faulty):
    """Never gives up."""

    def misbehave(self, state: State, feasible: Feasible) -> Any:
        while True:
            try:
                while True:
                    pass
            except Exception:
                continue


class BlocksInC(Faulty):
    """No signal gets through to it for a second or more."""

    def misbehave(self, state: State, feasible: Feasible) -> Any:
        sum(range(60_000_000))
        return STAY


class HangsInC(Faulty):
    """No signal ever gets through to it."""

    def misbehave(self, state: State, feasible: Feasible) -> Any:
        return sum(range(10**12))


class Interrupts(Faulty):
    def misbehave(self, state: State, feasible: Feasible) -> Any:
        raise KeyboardInterrupt


class CannotBeTold(Faulty):
    """Its error cannot be turned into a text."""

    def misbehave(self, state: State, feasible: Feasible) -> Any:
        class Silent(Exception):
            def __str__(self) -> str:
                raise RuntimeError

        raise Silent


class Unprintable(Faulty):
    """Its error cannot be stored as it is: half a character, and a line end."""

    def misbehave(self, state: State, feasible: Feasible) -> Any:
        raise ValueError("name \ud800\nof a file")


class EndsItsProcess(Faulty):
    def misbehave(self, state: State, feasible: Feasible) -> Any:
        os._exit(3)


class AnswersLater(Faulty):
    """What it returns has yet to be worked out."""

    def misbehave(self, state: State, feasible: Feasible) -> Any:
        def parts() -> Iterator[int]:
            time.sleep(60.0)
            yield from STAY

        return parts()


class CannotRemember(Faulty):
    """Its memory cannot be read in the tick."""

    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Any:
        self.is_forgetful = False
        return super().decide(state, belief, user, feasible)

    def misbehave(self, state: State, feasible: Feasible) -> Any:
        self.is_forgetful = True
        return STAY

    @property
    def memory(self) -> Any:
        if getattr(self, "is_forgetful", False):
            raise LookupError("forgotten")
        return None


class Counting(Arbiter):
    """With the hands off it moves up whenever its count of all it was asked in the trial is a multiple of three."""

    memory = 0

    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Direction:
        self.memory += 1
        if user is not None:
            return user
        up = (0, 0, 1)
        return up if self.memory % 3 == 0 and feasible(up) else STAY

    def explain(self, state: State, belief: Belief, user: Direction | None, action: Direction) -> Explanation:
        return {"asked": self.memory}


class OtherGoals(GoalInference):
    """Forgets a goal."""

    def update(self, state: State, belief: Belief, user: Direction | None) -> Belief:
        return Belief.uniform(state.goal_ids[:-1])
