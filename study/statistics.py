"""Tests of one measure between conditions: ANOVA, Tukey HSD, a mixed model, effect sizes with intervals.

The only file that imports statsmodels; distributions are scipy's. Everything takes plain sequences of equal length and
gives frozen values. What cannot be fitted is a `NotFitted` with the reason in one sentence, never a NaN.

    anova(values, condition, {"position": ..., "goal": ...})   fixed factors without interactions, type II = III
    tukey(model)                                               all pairs of *adjusted* means, Tukey-Kramer
    mixed_model(values, condition, covariates, participant)    the same fixed part, participants as random intercepts
    repeated_measures(values, condition, participant)          one value per participant and condition
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy import optimize, special, stats
from statsmodels.regression.linear_model import OLS
from statsmodels.regression.mixed_linear_model import MixedLM
from statsmodels.tools.sm_exceptions import ConvergenceWarning

FloatArray = npt.NDArray[np.float64]

ETA_LEVEL = 0.90
"""Partial eta squared cannot be negative: its 90 % interval excludes 0 exactly when p < .05 (Steiger 2004)."""
LEVEL = 0.95
_NO_VARIANCE = 1e-12
"""Residual sum of squares, as a share of the squared values, below which there is nothing to test."""


@dataclass(frozen=True)
class NotFitted:
    """A model that could not be fitted, and why."""

    reason: str


@dataclass(frozen=True)
class Interval:
    """An estimate and its confidence limits."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class AdjustedMean:
    """Mean of a condition at equal shares of every level of the covariates."""

    condition: str
    mean: float
    se: float


@dataclass(frozen=True)
class Anova:
    """The test of the condition given the covariates, F(df_effect, df_error)."""

    f: float
    df_effect: int
    df_error: int
    p: float
    eta_squared: Interval
    """Partial eta squared and its 90 % interval."""
    mean_square_error: float
    observations: int
    conditions: tuple[str, ...]
    adjusted_means: tuple[AdjustedMean, ...]
    contrast_se: tuple[tuple[float, ...], ...]
    """Standard error of the difference of two adjusted means, by index of the conditions."""
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
class MixedModel:
    """Random intercept per participant, fixed part as the ANOVA's; REML. `against` is the reference condition."""

    chi_squared: float
    df: int
    p: float
    """Wald test of the condition."""
    against: str
    estimates: tuple[tuple[str, Interval, float], ...]
    """Condition, difference from `against` with its 95 % interval, p."""
    participant_sd: float
    residual_sd: float
    participants: int
    note: str | None
    """What to know about the fit; None = nothing."""


@dataclass(frozen=True)
class RepeatedMeasures:
    """One value per participant and condition: F, and p after Greenhouse and Geisser's correction."""

    anova: Anova
    participants: int
    epsilon: float
    p_corrected: float


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
    levels = _levels(condition, conditions)
    used = {name: list(of) for name, of in (covariates or {}).items() if len(set(of)) > 1}
    if reason := _unfit(y, condition, levels):
        return NotFitted(reason)
    design = _design(condition, levels, used)
    own = list(range(1, len(levels)))
    rest = [column for column in range(design.shape[1]) if column not in own]
    rank = int(np.linalg.matrix_rank(design))
    if rank - int(np.linalg.matrix_rank(design[:, rest])) < len(own):
        return NotFitted(f"the condition cannot be told apart from {' and '.join(used)}: they always change together")
    if len(y) - rank < 1:
        return NotFitted(f"{len(y)} values are too few for {rank} parameters; at least {rank + 1} are needed")
    fit = OLS(y, design).fit()
    if fit.ssr <= _NO_VARIANCE * float(y @ y):
        return NotFitted("the values do not vary within the conditions, so that there is nothing to test against")
    test = fit.f_test(np.eye(design.shape[1])[own])
    f, df_error = float(np.squeeze(test.fvalue)), int(fit.df_resid)
    means = _mean_rows(design, len(levels))
    covariance = np.asarray(fit.cov_params())
    spread = means @ covariance @ means.T
    variances = np.diag(spread)[:, None] + np.diag(spread)[None, :] - 2.0 * spread
    return Anova(
        f=f,
        df_effect=len(own),
        df_error=df_error,
        p=float(stats.f.sf(f, len(own), df_error)),
        eta_squared=eta_squared(f, len(own), df_error),
        mean_square_error=float(fit.mse_resid),
        observations=len(y),
        conditions=levels,
        adjusted_means=tuple(
            AdjustedMean(level, float(row @ fit.params), math.sqrt(max(variance, 0.0)))
            for level, row, variance in zip(levels, means, np.diag(spread), strict=True)
        ),
        contrast_se=tuple(tuple(float(math.sqrt(max(cell, 0.0))) for cell in row) for row in variances),
        covariates=tuple(used),
    )


def tukey(model: Anova, *, intervals: bool = True) -> tuple[Pair, ...]:
    """Every pair of adjusted means by Tukey's HSD (Kramer's for unequal n), with the ANOVA's error; no effect sizes.

    Without `intervals` the limits are the difference itself, which saves a third of a second.
    """
    count = len(model.conditions)
    reach = _critical_range(count, model.df_error) / math.sqrt(2.0) if intervals else 0.0
    pairs = []
    for i, j in combinations(range(count), 2):
        difference = model.adjusted_means[i].mean - model.adjusted_means[j].mean
        se = model.contrast_se[i][j]
        p = float(stats.studentized_range.sf(abs(difference) / se * math.sqrt(2.0), count, model.df_error))
        limits = Interval(difference, difference - reach * se, difference + reach * se)
        pair = Pair(model.conditions[i], model.conditions[j], limits, min(max(p, 0.0), 1.0), "", NotFitted("not asked"))
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
    levels = _levels(condition, conditions)
    by_person: dict[str, dict[str, float]] = {}
    for value, level, person in zip(values, condition, participant, strict=True):
        if level in by_person.setdefault(person, {}):
            return NotFitted(f"participant {person} has two values for {level}; one is needed")
        by_person[person][level] = float(value)
    complete = {person: cells for person, cells in by_person.items() if len(cells) == len(levels)}
    if len(complete) < 2:
        return NotFitted(
            f"{len(complete)} participants have a value for every condition; at least 2 are needed to compare within "
            "participants"
        )
    table = np.array([[cells[level] for level in levels] for cells in complete.values()])  # (n, k)
    people = [person for person in complete for _ in levels]
    model = anova(table.ravel(), list(levels) * len(complete), {"participant": people}, levels)
    if isinstance(model, NotFitted):
        return model
    epsilon = greenhouse_geisser(table)
    corrected = stats.f.sf(model.f, epsilon * model.df_effect, epsilon * model.df_error)
    return RepeatedMeasures(model, len(complete), epsilon, float(corrected))


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


def mixed_model(
    values: Sequence[float],
    condition: Sequence[str],
    participant: Sequence[str],
    covariates: Mapping[str, Sequence[object]] | None = None,
    conditions: Sequence[str] | None = None,
) -> MixedModel | NotFitted:
    """The ANOVA's fixed part and a random intercept per participant, by REML."""
    y = np.asarray(values, dtype=np.float64)
    levels = _levels(condition, conditions)
    if reason := _unfit(y, condition, levels):
        return NotFitted(reason)
    people = len(set(participant))
    if people < 3:
        return NotFitted(f"{people} participants; their spread cannot be estimated from fewer than 3")
    design = _design(condition, levels, {name: list(of) for name, of in (covariates or {}).items()})
    keep = _independent_columns(design)
    own = [keep.index(column) for column in range(1, len(levels)) if column in keep]
    if len(own) < len(levels) - 1:
        return NotFitted("the condition cannot be told apart from the covariates")
    design = design[:, keep]
    if len(y) <= design.shape[1] + 1:
        return NotFitted(f"{len(y)} values are too few for {design.shape[1] + 2} parameters")
    scale = float(y.std())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            warnings.simplefilter("ignore", UserWarning)
            warnings.simplefilter("ignore", RuntimeWarning)
            fit = MixedLM(y / scale, design, groups=np.asarray(participant)).fit(reml=True, method=["lbfgs", "powell"])
    except (np.linalg.LinAlgError, ValueError) as error:
        return NotFitted(f"the fit failed ({error})")
    covariance = np.asarray(fit.cov_params())[: design.shape[1], : design.shape[1]]
    effects = np.asarray(fit.fe_params)[own]
    block = covariance[np.ix_(own, own)]
    variance = float(np.asarray(fit.cov_re).ravel()[0])
    if not fit.converged or not np.isfinite(block).all() or not np.isfinite(variance):
        return NotFitted("the fit did not converge")
    chi_squared = float(effects @ np.linalg.solve(block, effects))
    estimates = []
    for index, effect in enumerate(effects):
        se = math.sqrt(block[index, index]) * scale
        reach = float(stats.norm.ppf(0.5 + LEVEL / 2.0)) * se
        value = float(effect) * scale
        p = 2.0 * float(stats.norm.sf(abs(value) / se))
        estimates.append((levels[index + 1], Interval(value, value - reach, value + reach), p))
    note = None
    if variance < 1e-6 * float(fit.scale):
        note = "participants' variance is estimated as 0: the mixed model is then the ANOVA"
    return MixedModel(
        chi_squared=chi_squared,
        df=len(own),
        p=float(stats.chi2.sf(chi_squared, len(own))),
        against=levels[0],
        estimates=tuple(estimates),
        participant_sd=math.sqrt(max(variance, 0.0)) * scale,
        residual_sd=math.sqrt(float(fit.scale)) * scale,
        participants=people,
        note=note,
    )


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


# ---- effect sizes ---------------------------------------------------------------------------------------------------


def eta_squared(f: float, df_effect: int, df_error: int, level: float = ETA_LEVEL) -> Interval:
    """Partial eta squared of an F, with limits from the noncentral F distribution (Smithson 2001)."""
    value = f * df_effect / (f * df_effect + df_error)

    def limit(probability: float) -> float:
        def over(noncentrality: float) -> float:
            return float(special.ncfdtr(df_effect, df_error, noncentrality, f)) - probability

        if float(special.fdtr(df_effect, df_error, f)) <= probability:
            return 0.0
        noncentrality = _root(over, 0.0, max(1.0, f * df_effect))
        return noncentrality / (noncentrality + df_effect + df_error + 1.0)

    return Interval(value, limit(0.5 + level / 2.0), limit(0.5 - level / 2.0))


def hedges_g(first: Sequence[float], second: Sequence[float], level: float = LEVEL) -> Interval | NotFitted:
    """Difference of means in pooled standard deviations, corrected for small samples, limits from the noncentral t."""
    n1, n2 = len(first), len(second)
    if min(n1, n2) < 2:
        return NotFitted("fewer than 2 values in a condition")
    df = n1 + n2 - 2
    variance = ((n1 - 1) * np.var(first, ddof=1) + (n2 - 1) * np.var(second, ddof=1)) / df
    if variance <= _NO_VARIANCE * (np.mean(np.square(first)) + np.mean(np.square(second))):
        return NotFitted("the values do not vary")
    d = float((np.mean(first) - np.mean(second)) / math.sqrt(variance))
    return _standardised(d, math.sqrt(n1 * n2 / (n1 + n2)), df, level, small_sample_factor(df))


def d_within(first: Sequence[float], second: Sequence[float], level: float = LEVEL) -> Interval | NotFitted:
    """Mean of paired differences in their standard deviations (d_z), limits from the noncentral t."""
    differences = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    if len(differences) < 2:
        return NotFitted("fewer than 2 participants")
    sd = float(np.std(differences, ddof=1))
    if sd <= _NO_VARIANCE * max(1.0, float(np.abs(first).max())):
        return NotFitted("the differences do not vary")
    d = float(differences.mean()) / sd
    return _standardised(d, math.sqrt(len(differences)), len(differences) - 1, level, 1.0)


def small_sample_factor(df: int) -> float:
    """Hedges' exact correction J(df)."""
    return float(math.exp(math.lgamma(df / 2.0) - math.lgamma((df - 1) / 2.0)) / math.sqrt(df / 2.0)) if df > 1 else 1.0


def _standardised(d: float, root_n: float, df: int, level: float, factor: float) -> Interval:
    """Limits of the noncentrality of t = d root_n, as effect sizes."""
    t = d * root_n

    def limit(probability: float) -> float:
        # Falls as the noncentrality grows.
        return _root(lambda nc: float(special.nctdtr(df, nc, t)) - probability, t - 2.0, t + 2.0) / root_n

    return Interval(d * factor, limit(0.5 + level / 2.0) * factor, limit(0.5 - level / 2.0) * factor)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a falling function crosses 0; the bracket is widened until it does."""
    width = max(high - low, 1.0)
    for _ in range(60):
        if function(high) <= 0.0:
            break
        high += width
        width *= 2.0
    width = max(high - low, 1.0)
    for _ in range(60):
        if function(low) >= 0.0 or low == 0.0:
            break
        low -= width
        width *= 2.0
    return float(optimize.brentq(function, low, high, xtol=1e-10))


@lru_cache(maxsize=256)
def _critical_range(count: int, df: int) -> float:
    """The studentised range that 5 % exceed; a third of a second to find."""
    return float(stats.studentized_range.ppf(LEVEL, count, df))


# ---- design matrices ------------------------------------------------------------------------------------------------


def _levels(condition: Sequence[str], order: Sequence[str] | None) -> tuple[str, ...]:
    present = dict.fromkeys(condition)
    return tuple(level for level in (order or present) if level in present)


def _unfit(y: FloatArray, condition: Sequence[str], levels: Sequence[str]) -> str | None:
    if len(y) == 0:
        return "there are no values"
    if not np.isfinite(y).all():
        return "a value is not a finite number"
    if len(levels) < 2:
        return f"values under {' and '.join(levels)} alone; at least two conditions are needed"
    few = [level for level in levels if sum(item == level for item in condition) < 2]
    if few:
        return f"fewer than 2 values under {' and '.join(few)}"
    if float(y.max() - y.min()) <= _NO_VARIANCE * max(1.0, float(np.abs(y).max())):
        return f"all {len(y)} values are equal ({y[0]:g}): there is no variance to analyse"
    return None


def _design(condition: Sequence[str], levels: Sequence[str], covariates: Mapping[str, Sequence[object]]) -> FloatArray:
    """Columns: intercept; each condition against the first; covariates as deviations from their levels' plain mean.

    Coded like that, the intercept and conditions alone make the adjusted means.
    """
    given = np.asarray(condition)
    columns = [np.ones(len(given))]
    columns += [(given == level).astype(np.float64) for level in levels[1:]]
    for of in covariates.values():
        kinds = sorted(set(of), key=str)
        codes = np.array([kinds.index(item) for item in of])
        for index in range(len(kinds) - 1):
            columns.append((codes == index).astype(np.float64) - (codes == len(kinds) - 1).astype(np.float64))
    return np.column_stack(columns)


def _mean_rows(design: FloatArray, count: int) -> FloatArray:
    """What each condition's adjusted mean is made of, (conditions, columns)."""
    rows = np.zeros((count, design.shape[1]))
    rows[:, 0] = 1.0
    rows[range(1, count), range(1, count)] = 1.0
    return rows


def _independent_columns(design: FloatArray) -> list[int]:
    """Columns from the left that are not made of those before them."""
    kept: list[int] = []
    for column in range(design.shape[1]):
        if int(np.linalg.matrix_rank(design[:, [*kept, column]])) > len(kept):
            kept.append(column)
    return kept
