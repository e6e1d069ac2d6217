"""The analysis as plain tables: `measures.json` and CSV files, numbers unrounded, blank where there is no value."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

from study.analysis.analysis import Analysis, Comparison
from study.analysis.dataset import EndedSummary
from study.analysis.effect_sizes import Interval, NotFitted
from study.analysis.linear_model import RepeatedMeasures
from study.analysis.measures import TaskMeasures, WindowMeasures, window_rates
from study.analysis.mixed_model import MixedModel
from study.analysis.summaries import summarise

MEASURES_FORMAT = "shared-autonomy-lab measures"
MEASURES_VERSION = 1


@dataclass(frozen=True)
class CsvTable:
    """A CSV file: name without ending, column names, rows."""

    name: str
    header: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]

    def write(self, folder: Path) -> None:
        """`name`.csv; None is blank."""
        with (folder / f"{self.name}.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(self.header)
            writer.writerows(["" if cell is None else cell for cell in row] for row in self.rows)


def measures_json(analysis: Analysis) -> str:
    """Per condition and kind of task: n, mean and sd of each measure, and what was counted."""
    data = analysis.data
    content = {
        "format": MEASURES_FORMAT,
        "version": MEASURES_VERSION,
        "participants": data.quality.participants,
        "trials": data.quality.trials,
        "conditions": summarise(data.measures, data.scores),
    }
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def all_tables(analysis: Analysis) -> tuple[CsvTable, ...]:
    """Every table: one row per task, window, rate and score, then the statistics."""
    data = analysis.data
    return (
        _of_values("tasks", TaskMeasures, data.measures.tasks),
        _of_values("windows", WindowMeasures, data.measures.windows),
        CsvTable(
            "window_rates",
            ("participant", "condition", "position", "kind", "windows", "control_ticks", "rate"),
            tuple(
                (*astuple(rate), rate.rate)
                for kind in ("pickup", "dropoff", "all")
                for rate in window_rates(data.measures, kind)
            ),
        ),
        CsvTable(
            "survey_scores",
            ("participant", "condition", "position", "instrument", "score"),
            tuple(astuple(item) for item in data.scores),
        ),
        _descriptives(analysis),
        _anovas(analysis),
        _pairs(analysis),
        _mixed(analysis),
        _trends(analysis),
        CsvTable(
            "freed_and_over_time",
            tuple(item.name for item in fields(EndedSummary)),
            tuple(astuple(item) for item in data.quality.ended),
        ),
        _subsets(analysis),
        _hazards(analysis),
        CsvTable(
            "distractor",
            ("condition", "raised", "answered", "correct", "median_answer_s"),
            tuple(astuple(item) for item in data.quality.alerts),
        ),
    )


def _of_values(name: str, kind: type, values: Sequence[Any]) -> CsvTable:
    header = tuple(item.name for item in fields(kind))
    return CsvTable(name, header, tuple(tuple(getattr(value, column) for column in header) for value in values))


def _descriptives(analysis: Analysis) -> CsvTable:
    return CsvTable(
        "descriptives",
        ("measure", "tasks", "condition", "n", "mean", "sd"),
        tuple(
            (*_place(comparison), condition, found.n, found.mean, found.sd)
            for comparison in analysis.comparisons
            for condition, found in comparison.summaries.items()
        ),
    )


def _anovas(analysis: Analysis) -> CsvTable:
    def rows() -> Iterator[tuple[Any, ...]]:
        for comparison in analysis.comparisons:
            anova = comparison.anova
            if isinstance(anova, NotFitted):
                yield (*_place(comparison), *[None] * 11, anova.reason)
                continue
            within = comparison.model if isinstance(comparison.model, RepeatedMeasures) else None
            yield (
                *_place(comparison),
                "repeated measures" if within else "fixed effects",
                anova.observations,
                anova.f,
                anova.df_effect,
                anova.df_error,
                anova.p,
                anova.eta_squared.value,
                anova.eta_squared.low,
                anova.eta_squared.high,
                within.p_corrected if within else None,
                comparison.equal_variance_p,
                None,
            )

    header: tuple[str, ...] = (
        "measure",
        "tasks",
        "model",
        "n",
        "F",
        "df_effect",
        "df_error",
        "p",
        "partial_eta_squared",
    )
    header += ("eta_ci90_low", "eta_ci90_high", "p_greenhouse_geisser", "p_equal_variances", "not_fitted_because")
    return CsvTable("anova", header, tuple(rows()))


def _pairs(analysis: Analysis) -> CsvTable:
    def rows() -> Iterator[tuple[Any, ...]]:
        for comparison in analysis.comparisons:
            for pair in comparison.pairs:
                effect = pair.effect if isinstance(pair.effect, Interval) else None
                yield (
                    *_place(comparison),
                    pair.first,
                    pair.second,
                    pair.difference.value,
                    pair.difference.low,
                    pair.difference.high,
                    pair.p,
                    pair.effect_name,
                    *(astuple(effect) if effect else (None, None, None)),
                )

    header: tuple[str, ...] = (
        "measure",
        "tasks",
        "first",
        "second",
        "adjusted_difference",
        "ci95_low",
        "ci95_high",
        "p_tukey",
    )
    header += ("effect_size", "effect", "effect_ci95_low", "effect_ci95_high")
    return CsvTable("pairwise", header, tuple(rows()))


def _mixed(analysis: Analysis) -> CsvTable:
    def rows() -> Iterator[tuple[Any, ...]]:
        for comparison in analysis.comparisons:
            model = comparison.mixed
            if isinstance(model, NotFitted):
                yield (*_place(comparison), *[None] * 11, model.reason)
            elif isinstance(model, MixedModel):
                for condition, difference, p in model.estimates:
                    yield (
                        *_place(comparison),
                        condition,
                        model.against,
                        difference.value,
                        difference.low,
                        difference.high,
                        p,
                        model.chi_squared,
                        model.df,
                        model.p,
                        model.participant_sd,
                        model.residual_sd,
                        model.note,
                    )

    header: tuple[str, ...] = (
        "measure",
        "tasks",
        "condition",
        "against",
        "difference",
        "ci95_low",
        "ci95_high",
        "p",
        "chi_squared",
    )
    header += ("df", "p_condition", "participant_sd", "residual_sd", "note")
    return CsvTable("mixed_models", header, tuple(rows()))


def _trends(analysis: Analysis) -> CsvTable:
    return CsvTable(
        "gain_by_goals",
        ("condition", "goals", "n", "mean", "sd"),
        tuple(
            (trend.condition, goals, found.n, found.mean, found.sd)
            for trend in analysis.trends
            for goals, found in trend.by_goals.items()
        ),
    )


def _subsets(analysis: Analysis) -> CsvTable:
    def rows() -> Iterator[tuple[Any, ...]]:
        for subset in analysis.subsets:
            for comparison in subset.comparisons:
                anova = comparison.anova
                tested = (None, None) if isinstance(anova, NotFitted) else (anova.f, anova.p)
                for condition, found in comparison.summaries.items():
                    place = (subset.left_out, subset.tasks, *_place(comparison), condition)
                    yield (*place, found.n, found.mean, found.sd, *tested)

    header = ("left_out", "left_out_tasks", "measure", "tasks", "condition", "n", "mean", "sd", "F", "p")
    return CsvTable("sensitivity", header, tuple(rows()))


def _hazards(analysis: Analysis) -> CsvTable:
    def rows() -> Iterator[tuple[Any, ...]]:
        for kind, model in analysis.hazards:
            if isinstance(model, NotFitted):
                yield (kind, *[None] * 11, model.reason)
                continue
            for condition, ratio, p in model.ratios:
                counts = (model.tasks, model.censored, model.participants)
                tested = (model.chi_squared, model.df, model.p)
                yield (kind, condition, model.against, *astuple(ratio), p, *tested, *counts, None)

    header: tuple[str, ...] = ("tasks", "condition", "against", "hazard_ratio", "ci95_low", "ci95_high", "p")
    header += ("chi_squared", "df", "p_condition", "n", "censored", "participants", "not_fitted_because")
    return CsvTable("hazard_ratios", header, tuple(rows()))


def _place(comparison: Comparison) -> tuple[str, str | None]:
    return comparison.measure.id, comparison.kind
