"""Two robots' values, person by person: differences with their intervals, and what the rule says of them.

    equivalence(first, other, conditions, participants)  →  one `Equivalence` for each measure and outcome

The unit is a person: the mean of one's values under a condition. A difference is the other robot's less the first's, of
the same person, with Student's t interval over people.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from scipy import stats

from app.physics_comparison.closed_loop import BLOCKED, MEASURES, OUTCOMES
from app.physics_comparison.rule import Rule, rule
from app.replication.studies import Key, Values

EVERY = "every condition"
"""In place of a condition: all of a person's values."""

Shown = Literal["within", "beyond", "open"]
Verdict = Literal["interchangeable", "effects carry over", "differs", "not shown", "no bound"]


@dataclass(frozen=True)
class Difference:
    """A difference over people, the other robot's less the first's, with its standard error; NaN where fewer than two
    people tell. `attempts`: of an outcome, how many there were on each robot."""

    people: int
    mean: float
    error: float
    attempts: int = 0

    @classmethod
    def of(cls, values: Sequence[float], attempts: int = 0) -> Difference:
        """Of one value a person."""
        mean, spread = _spread(values)
        return cls(len(values), mean, spread / math.sqrt(len(values)) if len(values) > 1 else math.nan, attempts)

    @property
    def has_no_spread(self) -> bool:
        """An outcome that never came out differently: Student's interval would have no width, however few tell."""
        return self.error == 0.0 and self.attempts > 0

    def reach(self, confidence: float) -> float:
        """Half of Student's interval of that confidence; of an outcome without spread the share that so many attempts
        without a difference do not rule out (the exact binomial bound, of which the rule of three is a short form)."""
        if self.people < 2:
            return math.nan
        if self.has_no_spread:
            return float(1.0 - ((1.0 - confidence) / 2.0) ** (1.0 / self.attempts))
        return float(stats.t.ppf(0.5 + confidence / 2.0, self.people - 1)) * self.error

    def shown(self, bound: float, alpha: float, tests: int) -> Shown:
        """Whether it is shown to be within the bound by two one-sided tests, or beyond it as one of so many tests."""
        if abs(self.mean) + self.reach(1.0 - 2.0 * alpha) < bound:
            return "within"
        return "beyond" if abs(self.mean) - self.reach(1.0 - 2.0 * alpha / tests) > bound else "open"

    def people_needed(self, bound: float, alpha: float) -> float:
        """With how many people it would be shown to be within, were it and its spread as they are; infinite when it is
        not within."""
        spare = bound - abs(self.mean)
        if self.people < 2:
            return math.nan
        if self.has_no_spread and 0.0 < spare < 1.0:
            return math.ceil(self.people / self.attempts * math.log(alpha) / math.log(1.0 - spare))
        return math.ceil(self.people * (self.reach(1.0 - 2.0 * alpha) / spare) ** 2) if spare > 0.0 else math.inf


@dataclass(frozen=True)
class Level:
    """A measure under one condition on both robots: means and SDs over people's means, and the difference."""

    condition: str
    first: tuple[float, float]
    other: tuple[float, float]
    difference: Difference


@dataclass(frozen=True)
class Effect:
    """The difference between two conditions on both robots, and how far it differs itself."""

    conditions: tuple[str, str]
    first: float
    other: float
    difference: Difference


@dataclass(frozen=True)
class Equivalence:
    """One measure on two robots. `bound` is NaN where there is none."""

    robot: str
    measure: str
    kind: str
    levels: tuple[Level, ...]
    effects: tuple[Effect, ...]
    bound: float
    verdict: Verdict
    people_needed: float
    """For what is not shown; infinite where more people would not help."""

    @property
    def key(self) -> Key:
        """Measure and kind."""
        return self.measure, self.kind


def equivalences(
    robot: str, first: Values, other: Values, conditions: Sequence[str], participants: int, by: Rule | None = None
) -> tuple[Equivalence, ...]:
    """Every measure and outcome of the robot `robot`, whose values are `other`, beside those of the first."""
    by = by or rule()
    found = []
    for key in (*MEASURES, *OUTCOMES, *BLOCKED):
        here, there = _means(first, key, conditions), _means(other, key, conditions)
        attempts = min(len(one.observations[key]) for one in (first, other)) if key in OUTCOMES else 0
        levels = tuple(_levels(here, there, (EVERY, *conditions) if key in OUTCOMES else conditions, attempts))
        effects = () if key in OUTCOMES else tuple(_effects(here, there, conditions))
        bound = (
            by.outcome if key in OUTCOMES else math.nan if key in BLOCKED else _bound(here, effects, participants, by)
        )
        tested = [levels[0].difference] if key in OUTCOMES else [level.difference for level in levels]
        told, needed = _verdict(tested, [effect.difference for effect in effects], bound, by.alpha)
        found.append(Equivalence(robot, *key, levels, effects, bound, told, needed))
    return tuple(found)


PersonMeans = Mapping[str, Mapping[str, float]]
"""Condition to person to the mean of what that person has under it."""


def _means(values: Values, key: Key, conditions: Sequence[str]) -> PersonMeans:
    found: dict[str, dict[str, list[float]]] = {condition: {} for condition in (EVERY, *conditions)}
    for one in values.observations[key]:
        for place in (EVERY, one.condition) if one.condition in found else ():
            found[place].setdefault(one.participant, []).append(one.value)
    return {place: {who: math.fsum(of) / len(of) for who, of in people.items()} for place, people in found.items()}


def _levels(here: PersonMeans, there: PersonMeans, places: Sequence[str], attempts: int) -> Iterator[Level]:
    for place in places:
        both = sorted(here[place].keys() & there[place].keys())
        one, two = ([of[place][who] for who in both] for of in (here, there))
        of_this = attempts if place == EVERY else 0  # the one that is tested
        yield Level(place, _spread(one), _spread(two), Difference.of(np.subtract(two, one).tolist(), of_this))


def _effects(here: PersonMeans, there: PersonMeans, conditions: Sequence[str]) -> Iterator[Effect]:
    for a, b in combinations(conditions, 2):
        both = sorted(here[a].keys() & here[b].keys() & there[a].keys() & there[b].keys())
        one, two = ([of[a][who] - of[b][who] for who in both] for of in (here, there))
        yield Effect((a, b), _spread(one)[0], _spread(two)[0], Difference.of(np.subtract(two, one).tolist()))


def _spread(values: Sequence[float]) -> tuple[float, float]:
    mean = float(np.mean(values)) if values else math.nan
    return mean, float(np.std(values, ddof=1)) if len(values) > 1 else math.nan


def _bound(here: PersonMeans, effects: Sequence[Effect], participants: int, by: Rule) -> float:
    """From the largest difference between two conditions on the first robot; NaN where there is none to go by."""
    known = [effect for effect in effects if effect.first == effect.first]
    if not known:
        return math.nan
    largest = max(known, key=lambda effect: abs(effect.first))
    a, b = (here[condition] for condition in largest.conditions)
    spread = _spread([a[who] - b[who] for who in sorted(a.keys() & b.keys())])[1]
    error = spread / math.sqrt(participants) if spread == spread else 0.0
    return max(by.share_of_difference * abs(largest.first), by.share_of_standard_error * error)


def _verdict(
    levels: Sequence[Difference], effects: Sequence[Difference], bound: float, alpha: float
) -> tuple[Verdict, float]:
    """What the rule says, and how many people it would take to be shown interchangeable."""
    if bound != bound:
        return "no bound", math.nan
    tests = len(levels) + len(effects)
    of_levels, of_effects = ({one.shown(bound, alpha, tests) for one in part} for part in (levels, effects))
    if "beyond" in of_effects or ("beyond" in of_levels and of_effects != {"within"}):
        return "differs", math.inf
    needed = max(one.people_needed(bound, alpha) for one in (*levels, *effects))
    if of_levels == {"within"} and of_effects <= {"within"}:
        return "interchangeable", needed
    return ("effects carry over" if of_effects == {"within"} else "not shown"), needed
