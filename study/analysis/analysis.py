"""The paper's analysis (V-B) of a loaded data set: which values are compared, by which model, as plain results.

    analyse(dataset) -> Analysis          everything the report shows
    compare(...)                          one measure at a time, for whoever runs many studies

Objective measures are compared task by task (belief gain: window by window) by the model that the paper states:
condition fixed, condition order and task goal as random covariates. Its F, adjusted means and pairs are what tables,
figures and brackets show. Beside it stand the same with a random participant too, because tasks of one participant are
not independent, and with the covariates as fixed. Window rate, usability and workload have one value per participant
and condition and are compared within participants: F(k - 1, (k - 1)(n - 1)), F(2, 22) for twelve.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

from study.analysis import effect_sizes as effects
from study.analysis import linear_model as statistics
from study.analysis.dataset import DataSet
from study.analysis.effect_sizes import NotFitted
from study.analysis.hazard_model import Hazards, until_done
from study.analysis.linear_model import Anova, Pair, RepeatedMeasures, Slope
from study.analysis.measures import Measures, TaskKind
from study.analysis.mixed_model import MixedModel, mixed_model
from study.analysis.observations import Observation, observations, survey_observations
from study.analysis.sensitivity import LEFT_OUT, LeftOut, timed_tasks, without
from study.analysis.summaries import Summary, summarise, summary
from study.definition.builtin_questionnaires import Instrument
from study.definition.questionnaires import own_instruments
from study.records import TICK_S

MeasureId = Literal[
    "belief_gain", "convergence_user_actions", "efficiency_ticks", "window_rate", "sus_modified", "tlx_raw"
]
KIND_TITLES: dict[TaskKind, str] = {"pickup": "pickups", "dropoff": "dropoffs", "all": "all tasks"}


@dataclass(frozen=True)
class MeasureInfo:
    """How a measure is named and what one value of it belongs to."""

    id: str
    """A `MeasureId`, or the id of a questionnaire of the study's own."""
    title: str
    unit: str
    decimals: int
    per: Literal["window", "task", "participant"]


MEASURES: dict[str, MeasureInfo] = {
    item.id: item
    for item in (
        MeasureInfo("belief_gain", "Belief accuracy gain after windows", "Δ probability", 4, "window"),
        MeasureInfo("convergence_user_actions", "Belief convergence speed", "user actions", 2, "task"),
        MeasureInfo("efficiency_ticks", "Total task efficiency", f"ticks of {TICK_S:g} s", 1, "task"),
        MeasureInfo("window_rate", "Window rate", "windows per control tick", 4, "participant"),
        MeasureInfo("sus_modified", "Usability (modified SUS)", "score, 1–7", 2, "participant"),
        MeasureInfo("tlx_raw", "Workload (modified raw TLX)", "score, 1–7", 2, "participant"),
    )
}
Covariates = Literal["random", "fixed"]
"""How position and goal enter: random as the paper states it, or as fixed categories."""
OBJECTIVE: tuple[MeasureId, ...] = ("belief_gain", "convergence_user_actions", "efficiency_ticks")
COMPARED_KINDS: tuple[TaskKind, ...] = ("pickup", "all")
AT_ONCE = 2
"""Mixed models that are fitted at the same time: nearly all of it is matrices, during which other threads run."""


@dataclass(frozen=True)
class Beside:
    """Models that stand beside the one that is reported."""

    with_participant: MixedModel | NotFitted
    """A random participant as well."""
    fixed: Anova | NotFitted
    """Position and goal as fixed categories."""


@dataclass(frozen=True)
class Comparison:
    """One measure compared between the conditions."""

    measure: MeasureInfo
    kind: TaskKind | None
    """None for questionnaires, which are about a whole trial."""
    observations: tuple[Observation, ...]
    summaries: dict[str, Summary]
    model: MixedModel | Anova | RepeatedMeasures | NotFitted
    """What is reported: an `Anova` is that of fixed covariates, where it was asked for."""
    pairs: tuple[Pair, ...]
    beside: Beside | None
    """Other models of the same values; None = not asked for, or there are none."""
    equal_variance_p: float | None
    left_out: str | None = None
    """Values that could not enter, in one sentence."""

    @property
    def anova(self) -> Anova | NotFitted:
        """The model's F test, adjusted means and differences, whichever kind it is."""
        return self.model.anova if isinstance(self.model, (RepeatedMeasures, MixedModel)) else self.model


@dataclass(frozen=True)
class GoalTrend:
    """Belief gain under one condition by the number of candidate goals (the paper's Fig. 4)."""

    condition: str
    by_goals: dict[int, Summary]
    slope: Slope | NotFitted


@dataclass(frozen=True)
class Subset:
    """The objective comparisons once more, over fewer tasks."""

    left_out: LeftOut
    tasks: int
    """How many were left out."""
    comparisons: tuple[Comparison, ...]


@dataclass(frozen=True)
class Analysis:
    """Everything that is reported."""

    data: DataSet
    comparisons: tuple[Comparison, ...]
    trends: tuple[GoalTrend, ...]
    subsets: tuple[Subset, ...] = ()
    """Without freed cycles and without tasks over their time, if there are any."""
    hazards: tuple[tuple[TaskKind, Hazards | NotFitted], ...] = ()
    """Time to the end of a task, with tasks over their time as right-censored; if there are any."""

    def comparison(self, measure: str, kind: TaskKind | None = None) -> Comparison | None:
        """The comparison of that measure and kind; None = it was not measured (such as a questionnaire not asked)."""
        return next((c for c in self.comparisons if c.measure.id == measure and c.kind == kind), None)

    @cached_property
    def summarised(self) -> dict[str, Any]:
        """`summarise` of the data."""
        return summarise(self.data.measures, self.data.scores)


def analyse(data: DataSet) -> Analysis:
    """Every comparison of the paper, on any data set that `study.analysis.dataset.load` takes."""
    conditions = data.conditions

    def compared(of: tuple[MeasureId, TaskKind]) -> Comparison:
        return compare(observations(data.measures, *of), *of, conditions)

    with ThreadPoolExecutor(AT_ONCE) as pool:
        comparisons = list(pool.map(compared, [(measure, kind) for measure in OBJECTIVE for kind in COMPARED_KINDS]))
    comparisons += [
        compare(observations(data.measures, "window_rate", kind), "window_rate", kind, conditions)
        for kind in COMPARED_KINDS
    ]
    own = {name: form for study in data.studies.values() for name, form in own_instruments(study).items()}
    comparisons += [
        compare(survey_observations(data.scores, name), name, None, conditions, own=own.get(name))
        for name in sorted({item.instrument for item in data.scores})
    ]
    return Analysis(
        data,
        tuple(comparisons),
        goal_trends(data.measures, conditions),
        subsets(data.measures, conditions),
        hazards(data.measures, conditions),
    )


def subsets(measures: Measures, conditions: Sequence[str]) -> tuple[Subset, ...]:
    """Whether the results hang on freed cycles, or on tasks that a time limit ended; none where there are none."""
    found = []
    for left_out in LEFT_OUT:
        fewer = without(measures, left_out)
        count = len(measures.tasks) - len(fewer.tasks)
        if count:
            compared = tuple(
                compare(observations(fewer, measure, kind), measure, kind, conditions, beside=False, intervals=False)
                for measure in (*OBJECTIVE, "window_rate")
                for kind in COMPARED_KINDS
            )
            found.append(Subset(left_out, count, compared))
    return tuple(found)


def hazards(measures: Measures, conditions: Sequence[str]) -> tuple[tuple[TaskKind, Hazards | NotFitted], ...]:
    """How much sooner tasks end under each condition, where a time limit ended any."""
    if not any(task.censored for task in measures.tasks):
        return ()
    return tuple((kind, until_done(timed_tasks(measures, kind), conditions)) for kind in COMPARED_KINDS)


# ---- by which model -------------------------------------------------------------------------------------------------


def compare(
    values: Sequence[Observation],
    measure: str,
    kind: TaskKind | None,
    conditions: Sequence[str],
    *,
    covariates: Covariates = "random",
    beside: bool = True,
    intervals: bool = True,
    own: Instrument | None = None,
) -> Comparison:
    """One measure between conditions. Without `beside` and `intervals` it takes a fraction of the time. `own` is the
    questionnaire when it is one of the study's own."""
    info = MEASURES[measure] if own is None else _info(own)
    summaries = {
        condition: summary([item.value for item in values if item.condition == condition]) for condition in conditions
    }
    if info.per == "participant":
        result = _within(values, info, kind, conditions, summaries)
    else:
        result = _between(values, info, kind, conditions, summaries, covariates, beside)
    anova = result.anova
    if isinstance(anova, NotFitted):
        return result
    pairs = statistics.tukey(anova, intervals=intervals)
    return replace(result, pairs=tuple(_with_effect(pair, result) for pair in pairs) if intervals else pairs)


def _info(form: Instrument) -> MeasureInfo:
    low, high = form.score_range
    return MeasureInfo(form.id, form.title, f"score, {low}–{high}; high = {form.score_means}", 2, "participant")


def _between(
    values: Sequence[Observation],
    info: MeasureInfo,
    kind: TaskKind | None,
    conditions: Sequence[str],
    summaries: dict[str, Summary],
    covariates: Covariates,
    beside: bool,
) -> Comparison:
    y, condition = [item.value for item in values], [item.condition for item in values]
    two: dict[str, Sequence[object]] = {
        "position": [item.position for item in values],
        "goal": [item.goal for item in values],
    }
    three = {**two, "participant": [item.participant for item in values]}
    fixed = statistics.anova(y, condition, two, conditions) if beside or covariates == "fixed" else None
    model = fixed if covariates == "fixed" else mixed_model(y, condition, two, conditions, kenward_roger=beside)
    assert model is not None
    return Comparison(
        measure=info,
        kind=kind,
        observations=tuple(values),
        summaries=summaries,
        model=model,
        pairs=(),
        beside=Beside(mixed_model(y, condition, three, conditions), fixed) if beside and fixed is not None else None,
        equal_variance_p=statistics.brown_forsythe(y, condition),
    )


def _within(
    values: Sequence[Observation],
    info: MeasureInfo,
    kind: TaskKind | None,
    conditions: Sequence[str],
    summaries: dict[str, Summary],
) -> Comparison:
    complete = _complete(values, conditions)
    people = {item.participant for item in values}
    left_out = None
    if len(complete) < len(people):
        left_out = (
            f"{len(people) - len(complete)} of {len(people)} participants lack a value for some condition and are "
            "left out of the test; the means include them."
        )
    return Comparison(
        measure=info,
        kind=kind,
        observations=tuple(values),
        summaries=summaries,
        model=statistics.repeated_measures(
            [item.value for item in values],
            [item.condition for item in values],
            [item.participant for item in values],
            conditions,
        ),
        pairs=(),
        beside=None,
        equal_variance_p=None,
        left_out=left_out,
    )


def _complete(values: Sequence[Observation], conditions: Sequence[str]) -> dict[str, dict[str, float]]:
    cells: dict[str, dict[str, float]] = {}
    for item in values:
        cells.setdefault(item.participant, {})[item.condition] = item.value
    return {person: of for person, of in cells.items() if len(of) == len(conditions)}


def _with_effect(pair: Pair, result: Comparison) -> Pair:
    if result.measure.per == "participant":
        cells = _complete(result.observations, list(result.summaries))
        first, second = ([of[name] for of in cells.values()] for name in (pair.first, pair.second))
        return replace(pair, effect_name="d_z", effect=effects.d_within(first, second))
    first, second = (
        [item.value for item in result.observations if item.condition == name] for name in (pair.first, pair.second)
    )
    return replace(pair, effect_name="Hedges' g", effect=effects.hedges_g(first, second))


def goal_trends(measures: Measures, conditions: Sequence[str]) -> tuple[GoalTrend, ...]:
    """Belief gain by the number of candidate goals, and its slope per goal, under each condition."""
    trends = []
    for condition in conditions:
        gains = [item for item in observations(measures, "belief_gain", "all") if item.condition == condition]
        counts = sorted({item.goals for item in gains})
        trends.append(
            GoalTrend(
                condition=condition,
                by_goals={count: summary([g.value for g in gains if g.goals == count]) for count in counts},
                slope=statistics.slope([g.goals for g in gains], [g.value for g in gains]),
            )
        )
    return tuple(trends)
