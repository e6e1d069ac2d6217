"""A scripted clumsy person: drives into things, slips, presses at random; and notices when the arm does not come free.

It is no model of a person, and apart from the fitted ones: it looks for faults of the lab, in the suite and as
`salab bot --clumsy`. Same seed and same sights, same presses. After `PATIENCE_TICKS` of a trial it pulls itself
together and does the task as `app.simulated.pilot` does, so that every trial ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, Direction
from app.simulated.pilot import Pilot, Sight
from app.trial.values import UserInput

PATIENCE_TICKS = 160
FREE_M = 0.005
"""Two ticks of a way out bring the gripper at least so far."""
WAY_OUT_TICKS = 2
LOST_TICKS, LOST_M = 24, 0.05
"""So long within so little, the one who does the task goes some other way for a while."""
SLIP = 0.1
_MOVES = tuple(way for way in DIRECTIONS if way != DIRECTIONS[NULL_ACTION])


@dataclass(frozen=True)
class Finding:
    """Something that must not be: what kind, in which of the ticks it was told of, and what was seen."""

    kind: str
    tick: int
    detail: str

    def __str__(self) -> str:
        return f"{self.kind} at tick {self.tick}: {self.detail}"


class Clumsy:
    """The hands of one trial; `act` is asked for every tick, `told` what came of it.

    Attributes:
        findings: what must not be, so far: `jam` is an arm that was pressed against something and that the way it came
            did not move within two ticks.
    """

    def __init__(self, rng: np.random.Generator, step_m: float = 0.02) -> None:
        self.findings: list[Finding] = []
        self._rng = rng
        self._pilot = Pilot(step_m)
        self._ticks = 0
        self._direction: Direction | None = None
        self._left = 0
        self._last: Direction | None = None
        self._out: Direction | None = None
        self._out_from_m = (0.0, 0.0, 0.0)
        self._out_ticks = 0
        self._near_m: tuple[float, float, float] | None = None
        self._near_ticks = 0

    def act(self, object_id: str, sight: Sight) -> UserInput:
        """The input for the next tick."""
        self._ticks += 1
        self._near_ticks += 1
        if self._near_m is None or math.dist(self._near_m, sight.position_m) > LOST_M:
            self._near_m, self._near_ticks = sight.position_m, 0
        act = self._choose(object_id, sight)
        self._last = act.direction
        return act

    def _choose(self, object_id: str, sight: Sight) -> UserInput:
        rng = self._rng
        if self._out is not None:
            return UserInput(self._out)
        if self._ticks > PATIENCE_TICKS:
            if self._near_ticks >= LOST_TICKS:
                self._left, self._near_ticks, self._direction = 6, 0, self._anywhere()
            if self._left:
                self._left -= 1
                return UserInput(self._direction)
            return self._pilot.act(object_id, sight)
        if self._left:
            self._left -= 1
            return UserInput(self._direction if rng.random() > SLIP else self._anywhere())
        kind, self._direction = rng.random(), None
        if kind < 0.35:  # the task, for once
            return self._pilot.act(object_id, sight)
        if kind < 0.45:
            return UserInput(gripper="close" if rng.random() < 0.5 else "open")
        self._left = int(rng.integers(1, 14))
        if kind < 0.85:  # straight at something, often too low
            way = [0 if abs(gap) < 0.02 else int(math.copysign(1, gap)) for gap in self._gaps_m(sight)]
            x, y, z = way[0] or 1, way[1], -1 if rng.random() < 0.4 else way[2]
            self._direction = (x, y, z) if rng.random() < 0.6 else self._anywhere()
        return UserInput(self._direction)

    @staticmethod
    def _gaps_m(sight: Sight) -> list[float]:
        target_m = sight.release_m if sight.held and sight.release_m else sight.object_m
        return [there - here for here, there in zip(sight.position_m, target_m, strict=True)]

    def _anywhere(self) -> Direction:
        return _MOVES[int(self._rng.integers(len(_MOVES)))]

    def told(self, pressed: bool, running: bool, position_m: tuple[float, float, float]) -> None:
        """What came of the last input: whether the arm was pressed (or came to the end of its reach), whether it obeyed
        at all (no fingers, no reset, no new task), and where it is now."""
        if not running:
            self._out = None
            return
        if self._out is not None:
            self._out_ticks += 1
            if math.dist(position_m, self._out_from_m) > FREE_M:
                self._out = None
            elif self._out_ticks >= WAY_OUT_TICKS:
                came = math.dist(position_m, self._out_from_m) * 1000.0
                self.findings.append(
                    Finding("jam", self._ticks, f"{self._out} moved the arm {came:.1f} mm in two ticks")
                )
                self._out = None
        elif pressed and self._last is not None and self._rng.random() < 0.5:
            x, y, z = self._last
            self._out, self._out_from_m, self._out_ticks = (-x, -y, -z), position_m, 0
            self._left = 0
