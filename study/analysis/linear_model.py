"""Tests of one measure between conditions: ANOVA, Tukey HSD, repeated measures.

The distributions are scipy's. Everything takes plain sequences of equal length and
gives frozen values. What cannot be fitted is a `NotFitted` with the reason in one sentence, never a NaN.

    anova(values, condition, {"position": ..., "goal": ...})   fixed factors without interactions, type II = III
    tukey(model)                                               all pairs of *adjusted* means, Tukey-Kramer
    repeated_measures(values, condition, participant)          one value per participant and condition
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy import stats

from study.analysis.design_matrix import FloatArray, design_matrix, levels_of, problem, rank_of
from study.analysis.effect_sizes import LEVEL, NO_VARIANCE, Interval, NotFitted, eta_squared
from study.analysis.least_squares import least_squares
from study.analysis.studentized_range import critical, upper_tail


@dataclass(frozen=True)
class AdjustedMean:
    """Mean of a condition at equal shares of every level of the covariates."""

    condition: str
    mean: float
    se: float
    df: float
    """Of its standard error."""


@dataclass(frozen=True)
class Anova:
    """The test of the condition given the covariates, F(df_effect, df_error)."""

    f: float
    df_effect: int
    df_error: float
    p: float
    eta_squared: Interval
    """Partial eta squared and its 90 % interval."""
    mean_square_error: float
    observations: int
    conditions: tuple[str, ...]
    adjusted_means: tuple[AdjustedMean, ...]
    contrast_se: tuple[tuple[float, ...], ...]
    """Standard error of the difference of two adjusted means, by index of the conditions."""
    contrast_df: tuple[tuple[float, ...], ...]
    """Its degrees of freedom; in an analysis of variance those of the error, throughout."""
    covariates: tuple[str, ...]


@dataclass(frozen=True)
class Pair:
    """`first` less `second`: adjusted difference with its simultaneous 95 % interval, Tukey's p, effect size."""

    first: str
    second: str
    difference: Interval
    p: float
    effect_name: str
    effect: Interval | NotFitted


@dataclass(frozen=True)
class RepeatedMeasures:
    """One value per participant and condition: F, and p after Greenhouse and Geisser's correction."""

    anova: Anova
    participants: int
    epsilon: float
    p_corrected: float


@dataclass(frozen=True)
class Slope:
    """A straight line through values: change per unit with its 95 % interval, and the p of no change."""

    per_unit: Interval
    p: float
    observations: int


# ---- the fixed part -------------------------------------------------------------------------------------------------


def anova(
    values: Sequence[float],
    condition: Sequence[str],
    covariates: Mapping[str, Sequence[object]] | None = None,
    conditions: Sequence[str] | None = None,
) -> Anova | NotFitted:
    """Analysis of variance: condition fixed, covariates as categories, no interactions.

    Each effect is tested given all others (type II, here the same as III). A covariate with one level is left out.
    `conditions` is the order of the levels (default: as they first occur); levels that do not occur are left out.
    """
    y = np.asarray(values, dtype=np.float64)
    levels = levels_of(condition, conditions)
    used = {name: list(of) for name, of in (covariates or {}).items() if len(set(of)) > 1}
    if reason := problem(y, condition, levels):
        return NotFitted(reason)
    design = design_matrix(condition, levels, used)
    own = list(range(1, len(levels)))
    rest = [column for column in range(design.shape[1]) if column not in own]
    rank = rank_of(design)
    if rank - rank_of(design[:, rest]) < len(own):
        return NotFitted(f"the condition cannot be told apart from {' and '.join(used)}: they always change together")
    if len(y) - rank < 1:
        return NotFitted(f"{len(y)} values are too few for {rank} parameters; at least {rank + 1} are needed")
    fit = least_squares(y, design, rank)
    if fit.residual_squares <= NO_VARIANCE * float(y @ y):
        return NotFitted("the values do not vary within the conditions, so that there is nothing to test against")
    f, df_error = fit.f_test(own), float(fit.df_residual)
    means = _mean_rows(design, len(levels))
    spread = means @ fit.covariance @ means.T
    variances = np.diag(spread)[:, None] + np.diag(spread)[None, :] - 2.0 * spread
    return Anova(
        f=f,
        df_effect=len(own),
        df_error=df_error,
        p=float(stats.f.sf(f, len(own), df_error)),
        eta_squared=eta_squared(f, len(own), df_error),
        mean_square_error=fit.mean_square_error,
        observations=len(y),
        conditions=levels,
        adjusted_means=tuple(
            AdjustedMean(level, float(row @ fit.coefficients), math.sqrt(max(variance, 0.0)), df_error)
            for level, row, variance in zip(levels, means, np.diag(spread), strict=True)
        ),
        contrast_se=tuple(tuple(float(math.sqrt(max(cell, 0.0))) for cell in row) for row in variances),
        contrast_df=((df_error,) * len(levels),) * len(levels),
        covariates=tuple(used),
    )


def tukey(model: Anova, *, intervals: bool = True) -> tuple[Pair, ...]:
    """Every pair of adjusted means by Tukey's HSD (Kramer's for unequal n), as emmeans has it: each difference with its
    own standard error and degrees of freedom; no effect sizes.

    Without `intervals` the limits are the difference itself, which saves some milliseconds.
    """
    count = len(model.conditions)
    pairs = []
    for i, j in combinations(range(count), 2):
        difference = model.adjusted_means[i].mean - model.adjusted_means[j].mean
        se, df = model.contrast_se[i][j], model.contrast_df[i][j]
        p = upper_tail(abs(difference) / se * math.sqrt(2.0), count, df)
        reach = critical(LEVEL, count, df) / math.sqrt(2.0) if intervals else 0.0
        limits = Interval(difference, difference - reach * se, difference + reach * se)
        pair = Pair(model.conditions[i], model.conditions[j], limits, p, "", NotFitted("not asked"))
        pairs.append(pair)
    return tuple(pairs)


def repeated_measures(
    values: Sequence[float],
    condition: Sequence[str],
    participant: Sequence[str],
    conditions: Sequence[str] | None = None,
) -> RepeatedMeasures | NotFitted:
    """One-way ANOVA within participants, F(k - 1, (k - 1)(n - 1)). Participants without a value for every condition
    are left out (the caller says so)."""
    levels = levels_of(condition, conditions)
    by_person: dict[str, dict[str, float]] = {}
    for value, level, person in zip(values, condition, participant, strict=True):
        if level in by_person.setdefault(person, {}):
            return NotFitted(f"participant {person} has two values for {level}; one is needed")
        by_person[person][level] = float(value)
    complete = {person: cells for person, cells in by_person.items() if len(cells) == len(levels)}
    if len(complete) < 2:
        return NotFitted(
            f"participants with a value for every condition: {len(complete)}; at least 2 are needed to compare within "
            "participants"
        )
    table = np.array([[cells[level] for level in levels] for cells in complete.values()])  # (n, k)
    model = _within(table, levels)
    if isinstance(model, NotFitted):
        return model
    epsilon = greenhouse_geisser(table)
    corrected = stats.f.sf(model.f, epsilon * model.df_effect, epsilon * model.df_error)
    return RepeatedMeasures(model, len(complete), epsilon, float(corrected))


def _within(table: FloatArray, levels: tuple[str, ...]) -> Anova | NotFitted:
    """The ANOVA with participants as a second factor: a full (n, k) table needs sums of squares only."""
    people, count = table.shape
    if reason := problem(table.ravel(), list(levels) * people, levels):
        return NotFitted(reason)
    means = table.mean(axis=0)
    residuals = table - means - table.mean(axis=1, keepdims=True) + table.mean()
    df_effect, df_error = count - 1, (count - 1) * (people - 1)
    error = float((residuals**2).sum()) / df_error
    if error <= NO_VARIANCE * float((table**2).mean()):
        return NotFitted("participants differ between conditions by the same amount, so that there is nothing to test")
    f = people * float(((means - means.mean()) ** 2).sum()) / df_effect / error
    se = math.sqrt(2.0 * error / people)
    return Anova(
        f=f,
        df_effect=df_effect,
        df_error=df_error,
        p=float(stats.f.sf(f, df_effect, df_error)),
        eta_squared=eta_squared(f, df_effect, df_error),
        mean_square_error=error,
        observations=table.size,
        conditions=levels,
        adjusted_means=tuple(
            AdjustedMean(level, float(mean), se / math.sqrt(2.0), df_error)
            for level, mean in zip(levels, means, strict=True)
        ),
        contrast_se=tuple(tuple(0.0 if i == j else se for j in range(count)) for i in range(count)),
        contrast_df=((float(df_error),) * count,) * count,
        covariates=("participant",),
    )


def greenhouse_geisser(table: npt.ArrayLike) -> float:
    """Epsilon of (participants, conditions) values: 1 = spherical, 1 / (k - 1) = as far from it as can be."""
    cells = np.asarray(table, dtype=np.float64)
    count = cells.shape[1]
    centre = np.eye(count) - 1.0 / count
    centred = centre @ np.cov(cells, rowvar=False) @ centre
    squares = float((centred**2).sum())
    if squares <= 0.0 or count < 3:
        return 1.0
    return float(min(1.0, np.trace(centred) ** 2 / ((count - 1) * squares)))


def brown_forsythe(values: Sequence[float], condition: Sequence[str]) -> float | None:
    """p of equal variances (Levene's test about medians); None = cannot be told."""
    groups = [
        [value for value, level in zip(values, condition, strict=True) if level == wanted]
        for wanted in dict.fromkeys(condition)
    ]
    if len(groups) < 2 or min(map(len, groups)) < 2:
        return None
    with np.errstate(all="ignore"):
        p = float(stats.levene(*groups, center="median").pvalue)
    return p if math.isfinite(p) else None


def slope(x: Sequence[float], y: Sequence[float]) -> Slope | NotFitted:
    """Ordinary least squares of y on x."""
    if len(x) < 3 or len(set(x)) < 2:
        return NotFitted(f"{len(x)} values at {len(set(x))} places; a slope needs at least 3 values at 2 places")
    if max(y) - min(y) <= NO_VARIANCE * max(1.0, max(map(abs, y))):
        return NotFitted(f"all {len(y)} values are equal: there is no variance to analyse")
    line = stats.linregress(x, y)
    reach = float(stats.t.ppf(0.5 + LEVEL / 2.0, len(x) - 2)) * float(line.stderr)
    value = float(line.slope)
    return Slope(Interval(value, value - reach, value + reach), float(line.pvalue), len(x))


def _mean_rows(design: FloatArray, count: int) -> FloatArray:
    """What each condition's adjusted mean is made of, (conditions, columns)."""
    rows = np.zeros((count, design.shape[1]))
    rows[:, 0] = 1.0
    rows[range(1, count), range(1, count)] = 1.0
    return rows
