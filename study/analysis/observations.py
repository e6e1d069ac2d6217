"""Which values of a measure are compared: one for each task, window, or participant and condition. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from study.analysis.measures import Measures, TaskKind, window_rates
from study.flow.answers import SurveyScore


@dataclass(frozen=True)
class Observation:
    """One value and what it belongs to."""

    value: float
    condition: str
    participant: str
    position: int
    goal: str
    goals: int


def observations(measures: Measures, measure: str, kind: TaskKind) -> tuple[Observation, ...]:
    """The values of an objective measure: tasks that converged, windows that count, rates per participant."""
    found: list[Observation] = []
    if measure == "window_rate":
        return tuple(
            Observation(rate.rate, rate.condition, rate.participant, rate.position, "", 0)
            for rate in window_rates(measures, kind)
        )
    if measure == "belief_gain":
        for window in measures.gains(kind):
            if window.gain is not None:
                place = (window.condition, window.participant, window.position, window.goal, window.goals)
                found.append(Observation(window.gain, *place))
        return tuple(found)
    for task in measures.analysed_tasks(kind):
        value = task.efficiency_ticks if measure == "efficiency_ticks" else task.convergence_user_actions
        if value is not None:
            place = (task.condition, task.participant, task.position, task.goal, task.goals)
            found.append(Observation(float(value), *place))
    return tuple(found)


def survey_observations(scores: Iterable[SurveyScore], instrument: str) -> tuple[Observation, ...]:
    """One score per participant and condition."""
    return tuple(
        Observation(item.score, item.condition, item.participant, item.position, "", 0)
        for item in scores
        if item.instrument == instrument
    )
