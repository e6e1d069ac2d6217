"""How much of the spread of a measure lies between people, and how much between one person's tasks.

    spread(observations, pickup_goals)      standard deviations, from the variance components of a one-way random model
    table(studies)                          for every condition, pickups and all tasks, beside the paper's SDs

Tasks of one kind are compared with one another: pickups and dropoffs are each centred at their own mean first.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

from app.replication.formats import columns
from app.replication.paper import CONDITIONS_IN_ORDER, reported
from app.replication.studies import Values
from study.analysis.observations import Observation

MEASURE = "efficiency_ticks"
KINDS = ("pickup", "all")


@dataclass(frozen=True)
class PeopleSpread:
    """Standard deviations in the measure's own unit: between people, within one, and of all values together. Between is
    0 where people's means differ no more than chance would have it."""

    people: int
    between: float
    within: float
    total: float


def spread(observations: Iterable[Observation], pickup_goals: Collection[str]) -> PeopleSpread | None:
    """Of one condition. None where nobody has two values, or there is but one person."""
    of = list(observations)
    centred: dict[str, list[float]] = {}
    within_squares, freedom = 0.0, 0
    for picking in (True, False):
        kind = [one for one in of if (one.goal in pickup_goals) == picking]
        middle = _mean([one.value for one in kind]) if kind else 0.0
        people: dict[str, list[float]] = {}
        for one in kind:
            people.setdefault(one.participant, []).append(one.value - middle)
        for person, values in people.items():
            centred.setdefault(person, []).extend(values)
            within_squares += sum((value - _mean(values)) ** 2 for value in values)
            freedom += len(values) - 1
    if not freedom or len(centred) < 2:
        return None
    within = within_squares / freedom
    counts = [len(values) for values in centred.values()]
    # The number of values a person, as an unbalanced one-way table counts it.
    usual = (sum(counts) - sum(count**2 for count in counts) / sum(counts)) / (len(counts) - 1)
    among = sum(count * _mean(values) ** 2 for count, values in zip(counts, centred.values(), strict=True))
    between = max(among / (len(counts) - 1) - within, 0.0) / usual
    values = [one.value for one in of]
    total = sum((value - _mean(values)) ** 2 for value in values) / (len(values) - 1)
    return PeopleSpread(len(centred), math.sqrt(between), math.sqrt(within), math.sqrt(total))


def of_studies(studies: Sequence[Values], condition: str, kind: str) -> PeopleSpread | None:
    """The people of all studies together, each one of their own."""
    pickup_goals = {one.goal for study in studies for one in study.observations[MEASURE, "pickup"]}
    everybody = (
        replace(one, participant=f"{number}-{one.participant}")
        for number, study in enumerate(studies)
        for one in study.observations[MEASURE, kind]
        if one.condition == condition
    )
    return spread(everybody, pickup_goals)


def table(studies: Sequence[Values]) -> str:
    """Between and within people, in ticks."""
    rows: list[tuple[str, ...]] = [("efficiency (ticks)", "between", "within", "SD", "paper's SD", "larger")]
    for kind in KINDS:
        for condition in CONDITIONS_IN_ORDER:
            found, paper = of_studies(studies, condition, kind), reported(MEASURE, kind).sds[condition]
            numbers: tuple[str, ...] = ("", "", "", f"{paper:.0f}", "not known: too few values")
            if found is not None:
                larger = "within" if found.within > found.between else "BETWEEN"
                numbers = (*(f"{one:.0f}" for one in (found.between, found.within, found.total, paper)), larger)
            rows.append((f"{condition} {kind}", *numbers))
    return columns(rows, ends_in_words=True)


LEGEND = (
    "Standard deviations between people and between one person's tasks of the same kind, from variance components over "
    "the people of all studies; SD is that of all values. The paper gives no such parts. Of its SDs only pure "
    "teleoperation's were looked at for the fit."
)


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values)
