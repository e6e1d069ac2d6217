"""What parts are asked: moments of trials that never were, drawn from a fixed seed, the awkward ones among them.

1 to 8 goals, some in the same place, the arm at one of them, at rest and moving, hands on and off, something held and
nothing, everything feasible, little or nothing, beliefs that are certain, uniform and between.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, UNIT_DIRECTIONS, Direction
from app.autonomy.arrays import FloatArray, frozen
from app.autonomy.belief import Belief
from app.autonomy.interface import State

SEED = 2020
CYCLES = 12
QUESTIONS = 20
"""In a cycle."""
LONG_CYCLES = 60
"""As many questions as a trial of ten minutes has ticks."""
_MOST_GOALS = 8
_STAY = DIRECTIONS[NULL_ACTION]


@dataclass(frozen=True)
class Situation:
    """One tick's questions. `prior` is what an arbiter is told is believed, and where a cycle's inference starts."""

    state: State
    prior: Belief
    user: Direction | None
    can_do: frozenset[Direction]

    def feasible(self, action: Direction) -> bool:
        """Whether the arm can do it here."""
        return tuple(action) in self.can_do

    def __str__(self) -> str:
        state, moving = self.state, "moving" if any(self.state.momentum) else "at rest"
        hands = "hands off" if self.user is None else f"the person's {self.user}"
        left = len(self.can_do) - 1
        return f"tick {state.tick}, {len(state.goal_ids)} goals, {moving}, {hands}, {left} of 26 moves feasible"


@lru_cache(maxsize=2)
def cycles(count: int = CYCLES) -> tuple[tuple[Situation, ...], ...]:
    """So many pick-and-place cycles, one tick after another; the goals stay the same within half a cycle."""
    rng = np.random.default_rng(SEED)
    made, tick = [], 0
    for number in range(count):
        goals = number % _MOST_GOALS + 1
        questions = []
        for half in (0, 1):
            held = "object_0" if half else None
            goals_m = _goals_m(rng, goals)
            names = tuple(f"{'bin' if half else 'object'}_{index}" for index in range(goals))
            for _ in range(QUESTIONS // 2):
                questions.append(_situation(rng, names, goals_m, held, tick))
                tick += 1
        made.append(tuple(questions))
    return tuple(made)


def _goals_m(rng: np.random.Generator, count: int) -> FloatArray:
    goals_m: FloatArray = rng.uniform((0.6, -0.5, 0.8), (0.9, 0.5, 1.0), (count, 3))
    if count > 1 and rng.random() < 0.3:
        goals_m[-1] = goals_m[0]
    return goals_m


def _situation(
    rng: np.random.Generator, names: tuple[str, ...], goals_m: FloatArray, held: str | None, tick: int
) -> Situation:
    at_a_goal = rng.random() < 0.1
    position_m = goals_m[0] if at_a_goal else rng.uniform((0.5, -0.5, 0.8), (0.9, 0.5, 1.1))
    x_m, y_m, z_m = position_m.tolist()
    m_x, m_y, m_z = UNIT_DIRECTIONS[NULL_ACTION if rng.random() < 0.3 else rng.integers(27)].tolist()
    user = None if rng.random() < 0.5 else DIRECTIONS[rng.integers(27)]
    user = None if user == _STAY else user
    share = rng.choice((0.0, 0.1, 0.6, 1.0))
    drawn = rng.random(len(DIRECTIONS)) < share
    can_do = frozenset(action for action, can in zip(DIRECTIONS, drawn, strict=True) if can or action == _STAY)
    state = State((x_m, y_m, z_m), (m_x, m_y, m_z), names, frozen(goals_m.copy()), held, tick)
    return Situation(state, _belief(rng, names), user, can_do)


def _belief(rng: np.random.Generator, names: tuple[str, ...]) -> Belief:
    kind = rng.integers(3)
    if kind == 0:
        return Belief.uniform(names)
    if kind == 1:
        certain = np.zeros(len(names))
        certain[rng.integers(len(names))] = 1.0
        return Belief(names, certain)
    return Belief(names, rng.dirichlet(np.full(len(names), 0.5)))
