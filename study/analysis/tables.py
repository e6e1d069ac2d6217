"""The analysis as plain tables: `measures.json` and CSV files, numbers unrounded, blank where there is no value."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import astuple, fields
from typing import Any

from study.analysis.analysis import Analysis
from study.analysis.csv_table import CsvTable
from study.analysis.dataset import EndedSummary
from study.analysis.effect_sizes import NotFitted
from study.analysis.measures import TaskMeasures, WindowMeasures, window_rates
from study.analysis.result_tables import comparisons_json, place_of, result_tables

MEASURES_FORMAT = "shared-autonomy-lab measures"
MEASURES_VERSION = 1


def measures_json(analysis: Analysis) -> str:
    """Per condition and kind of task: n, mean and sd of each measure, and what was counted; then the tests."""
    data = analysis.data
    content = {
        "format": MEASURES_FORMAT,
        "version": MEASURES_VERSION,
        "participants": data.quality.participants,
        "trials": data.quality.trials,
        "conditions": analysis.summarised,
        "comparisons": comparisons_json(analysis),
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
        *result_tables(analysis),
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
                    place = (subset.left_out, subset.tasks, *place_of(comparison), condition)
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
