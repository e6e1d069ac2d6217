"""Effect sizes with confidence limits from the noncentral distributions (Smithson 2001; Cumming & Finch 2001)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import integrate, optimize, special, stats

ETA_LEVEL = 0.90
"""Partial eta squared cannot be negative: its 90 % interval excludes 0 exactly when p < .05 (Steiger 2004)."""
LEVEL = 0.95
NO_VARIANCE = 1e-12
"""Share of the squared values below which what is left is rounding, not variance."""


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


def eta_squared(f: float, df_effect: int, df_error: float, level: float = ETA_LEVEL) -> Interval:
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
    if variance <= NO_VARIANCE * (np.mean(np.square(first)) + np.mean(np.square(second))):
        return NotFitted("the values do not vary")
    d = float((np.mean(first) - np.mean(second)) / math.sqrt(variance))
    return _standardised(d, math.sqrt(n1 * n2 / (n1 + n2)), df, level, small_sample_factor(df))


def d_within(first: Sequence[float], second: Sequence[float], level: float = LEVEL) -> Interval | NotFitted:
    """Mean of paired differences in their standard deviations (d_z), limits from the noncentral t."""
    differences = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    if len(differences) < 2:
        return NotFitted("fewer than 2 participants")
    sd = float(np.std(differences, ddof=1))
    if sd <= NO_VARIANCE * max(1.0, float(np.abs(first).max())):
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
        return _root(lambda nc: _noncentral_t(df, nc, t) - probability, t - 2.0, t + 2.0) / root_n

    return Interval(d * factor, limit(0.5 + level / 2.0) * factor, limit(0.5 - level / 2.0) * factor)


def _noncentral_t(df: int, noncentrality: float, t: float) -> float:
    """P(T <= t). With few degrees of freedom scipy's series may give NaN; then by integration over the chi of t."""
    p = float(special.nctdtr(df, noncentrality, t))
    if math.isfinite(p):
        return p

    def density(s: float) -> float:
        return float(special.ndtr(t * s / math.sqrt(df) - noncentrality) * stats.chi.pdf(s, df))

    middle = math.sqrt(df)
    return float(integrate.quad(density, 0.0, middle + 12.0, points=[middle], limit=400)[0])


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
