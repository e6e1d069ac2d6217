"""What was tested, as plain tables: every model's F, adjusted means and pairs, with a description of each column."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple
from typing import Any

from scipy import stats

from study.analysis.analysis import Analysis, Comparison
from study.analysis.csv_table import CsvTable
from study.analysis.effect_sizes import LEVEL, Interval, NotFitted
from study.analysis.linear_model import AdjustedMean, Anova, RepeatedMeasures
from study.analysis.mixed_model import MixedModel

Row = tuple[Any, ...]
RANDOM_PARTS = ("position", "goal", "participant")

_WHICH = {
    "measure": "id of the measure or questionnaire",
    "tasks": "pickup or all; blank for questionnaires",
}
_MODEL = {
    "model": "random covariates (the paper's: position and goal as random), repeated measures, random covariates and "
    "participants, or fixed covariates",
    "reported": "1 for the model that report and figures show, 0 for those beside it",
}
COLUMNS: dict[str, dict[str, str]] = {
    "descriptives": {
        **_WHICH,
        "condition": "id of the condition",
        "n": "number of values",
        "mean": "plain mean of the values, not adjusted",
        "sd": "standard deviation of the values",
    },
    "anova": {
        **_WHICH,
        **_MODEL,
        "n": "number of values",
        "F": "of the condition",
        "df_effect": "numerator degrees of freedom",
        "df_error": "denominator degrees of freedom; Satterthwaite's in a mixed model",
        "p": "of F",
        "partial_eta_squared": "from F and its degrees of freedom",
        "eta_ci90_low": "lower limit of its 90 % interval",
        "eta_ci90_high": "upper limit of its 90 % interval",
        "p_greenhouse_geisser": "corrected p; repeated measures alone",
        "F_kenward_roger": "Kenward and Roger's F of the condition; mixed models alone",
        "df_kenward_roger": "its denominator degrees of freedom",
        "p_kenward_roger": "its p",
        **{
            f"sd_{name}": f"SD of the random intercepts of each {name}; blank = not in the model"
            for name in RANDOM_PARTS
        },
        "sd_residual": "SD of what is left",
        "reml_criterion": "-2 log of the restricted likelihood; mixed models alone",
        "p_equal_variances": "Brown and Forsythe's test of the values",
        "note": "what to know about the fit: covariates left out, variances of 0",
        "not_fitted_because": "why there are no numbers",
    },
    "adjusted_means": {
        **_WHICH,
        **_MODEL,
        "condition": "id of the condition",
        "adjusted_mean": "mean of the condition given the covariates",
        "se": "its standard error",
        "df": "degrees of freedom of the standard error",
        "ci95_low": "lower limit of its 95 % interval, one condition at a time",
        "ci95_high": "upper limit of its 95 % interval",
        "df_kenward_roger": "Kenward and Roger's degrees of freedom; mixed models alone",
        "se_kenward_roger": "Kenward and Roger's standard error",
    },
    "pairwise": {
        **_WHICH,
        "first": "condition",
        "second": "condition it is compared with",
        "adjusted_difference": "adjusted mean of the first less that of the second, in the reported model",
        "ci95_low": "lower limit of its simultaneous 95 % interval",
        "ci95_high": "upper limit of its simultaneous 95 % interval",
        "p_tukey": "p with Tukey's adjustment",
        "se": "standard error of the difference",
        "df": "degrees of freedom of the standard error",
        "effect_size": "Hedges' g of the plain values, or d_z of the participants' differences",
        "effect": "its value",
        "effect_ci95_low": "lower limit of its 95 % interval",
        "effect_ci95_high": "upper limit of its 95 % interval",
    },
}
"""Table to its columns and what they mean."""


def result_tables(analysis: Analysis) -> tuple[CsvTable, ...]:
    """The tables of `COLUMNS`, and the descriptions themselves."""
    rows = {
        "descriptives": _descriptives(analysis),
        "anova": _anovas(analysis),
        "adjusted_means": _means(analysis),
        "pairwise": _pairs(analysis),
    }
    described = tuple((table, *item) for table, columns in COLUMNS.items() for item in columns.items())
    return (
        *(CsvTable(name, tuple(COLUMNS[name]), tuple(found)) for name, found in rows.items()),
        CsvTable("columns", ("table", "column", "description"), described),
    )


def place_of(comparison: Comparison) -> tuple[str, str | None]:
    """Its first two columns."""
    return comparison.measure.id, comparison.kind


Model = MixedModel | RepeatedMeasures | Anova | NotFitted


def _models(comparison: Comparison) -> Iterator[tuple[str, int, Model]]:
    """Name, whether it is the reported one, and the model."""
    named = "random covariates" if comparison.measure.per != "participant" else "repeated measures"
    yield ("fixed covariates" if isinstance(comparison.model, Anova) else named), 1, comparison.model
    if comparison.beside is not None:
        yield "random covariates and participants", 0, comparison.beside.with_participant
        yield "fixed covariates", 0, comparison.beside.fixed


def _tested(model: Model) -> Anova | NotFitted:
    return model.anova if isinstance(model, (MixedModel, RepeatedMeasures)) else model


def _anovas(analysis: Analysis) -> Iterator[Row]:
    for comparison in analysis.comparisons:
        for name, reported, model in _models(comparison):
            first, anova = (*place_of(comparison), name, reported), _tested(model)
            if isinstance(anova, NotFitted):
                yield (*first, *[None] * (len(COLUMNS["anova"]) - len(first) - 1), anova.reason)
                continue
            mixed = model if isinstance(model, MixedModel) else None
            adjusted = mixed.kenward_roger if mixed else None
            sds = {part.name: part.sd for part in mixed.random} if mixed else {}
            yield (
                *first,
                *(anova.observations, anova.f, anova.df_effect, anova.df_error, anova.p),
                *astuple(anova.eta_squared),
                model.p_corrected if isinstance(model, RepeatedMeasures) else None,
                *((adjusted.f, adjusted.df_error, adjusted.p) if isinstance(adjusted, Anova) else (None,) * 3),
                *(sds.get(part) for part in RANDOM_PARTS),
                mixed.residual_sd if mixed else None,
                mixed.criterion if mixed else None,
                comparison.equal_variance_p,
                "; ".join(_notes(mixed)) or None if mixed else None,
                None,
            )


def _notes(model: MixedModel) -> list[str]:
    adjusted = model.kenward_roger
    return [*model.notes, *([adjusted.reason] if isinstance(adjusted, NotFitted) else [])]


def _means(analysis: Analysis) -> Iterator[Row]:
    for comparison in analysis.comparisons:
        for name, reported, model in _models(comparison):
            anova = _tested(model)
            if isinstance(anova, NotFitted):
                continue
            adjusted = model.kenward_roger if isinstance(model, MixedModel) else None
            others = adjusted.adjusted_means if isinstance(adjusted, Anova) else [None] * len(anova.conditions)
            for of, other in zip(anova.adjusted_means, others, strict=True):
                told = (*place_of(comparison), name, reported, of.condition, of.mean, of.se, of.df, *limits(of))
                yield (*told, *((other.df, other.se) if other else (None, None)))


def limits(of: AdjustedMean) -> tuple[float, float]:
    """95 % interval of one adjusted mean."""
    reach = float(stats.t.ppf(0.5 + LEVEL / 2.0, of.df)) * of.se
    return of.mean - reach, of.mean + reach


def _pairs(analysis: Analysis) -> Iterator[Row]:
    for comparison in analysis.comparisons:
        anova = comparison.anova
        if isinstance(anova, NotFitted):
            continue
        for pair in comparison.pairs:
            effect = pair.effect if isinstance(pair.effect, Interval) else None
            row, column = anova.conditions.index(pair.first), anova.conditions.index(pair.second)
            yield (
                *place_of(comparison),
                pair.first,
                pair.second,
                *astuple(pair.difference),
                pair.p,
                anova.contrast_se[row][column],
                anova.contrast_df[row][column],
                pair.effect_name,
                *(astuple(effect) if effect else (None, None, None)),
            )


def _descriptives(analysis: Analysis) -> Iterator[Row]:
    for comparison in analysis.comparisons:
        for condition, found in comparison.summaries.items():
            yield (*place_of(comparison), condition, found.n, found.mean, found.sd)


def comparisons_json(analysis: Analysis) -> list[dict[str, Any]]:
    """The reported tests as plain data for JSON, under the names of the tables' columns."""
    found = []
    for table, rows in (
        ("anova", _anovas(analysis)),
        ("adjusted_means", _means(analysis)),
        ("pairwise", _pairs(analysis)),
    ):
        for row in rows:
            named = dict(zip(COLUMNS[table], row, strict=True))
            if named.pop("reported", 1):
                found.append({"table": table, **named})
    return found
