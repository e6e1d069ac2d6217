"""The linear mixed model of one measure between conditions: condition fixed, covariates as crossed random intercepts.

    mixed_model(values, condition, {"position": ..., "goal": ...})    the paper's model (V-B)
    mixed_model(values, condition, {..., "participant": ...})         and a random intercept for each person

Fitted by REML; F, adjusted means and pairs with Satterthwaite's degrees of freedom, Kenward and Roger's beside them.
What differs from R's lme4, lmerTest, pbkrtest and emmeans, and by how much, stands in docs/topics/statistics.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from study.analysis.degrees_of_freedom import (
    Estimates,
    KenwardRoger,
    Satterthwaite,
    estimates,
    sequential_contrasts,
)
from study.analysis.design_matrix import FloatArray, levels_of, problem
from study.analysis.effect_sizes import NO_VARIANCE, NotFitted, eta_squared
from study.analysis.linear_model import AdjustedMean, Anova
from study.analysis.restricted_likelihood import RestrictedLikelihood


@dataclass(frozen=True)
class RandomPart:
    """A covariate whose levels are taken as drawn from many: how many there are, and their SD in the values' unit."""

    name: str
    levels: int
    sd: float


@dataclass(frozen=True)
class MixedModel:
    """One fit. `anova` has the F test of the condition, the adjusted means and their differences."""

    anova: Anova
    """With Satterthwaite's degrees of freedom."""
    kenward_roger: Anova | NotFitted | None
    """The same means with Kenward and Roger's standard errors and degrees of freedom; None = not asked for."""
    random: tuple[RandomPart, ...]
    residual_sd: float
    criterion: float
    """-2 log of the restricted likelihood, as lme4's REMLcrit."""
    notes: tuple[str, ...]
    """What to know about the fit: covariates left out, variances of 0."""


def mixed_model(
    values: Sequence[float],
    condition: Sequence[str],
    covariates: Mapping[str, Sequence[object]],
    conditions: Sequence[str] | None = None,
    *,
    kenward_roger: bool = True,
) -> MixedModel | NotFitted:
    """Condition fixed, every covariate a random intercept.

    A covariate with one level, or whose variance cannot be told apart from another's, is left out and the notes say so.
    `conditions` is the order of the levels (default: as they first occur); levels that do not occur are left out.
    """
    y = np.asarray(values, dtype=np.float64)
    levels = levels_of(condition, conditions)
    if reason := problem(y, condition, levels):
        return NotFitted(reason)
    group = [levels.index(level) for level in condition]
    names, notes = [name for name, of in covariates.items() if len(set(of)) > 1], []
    notes += [f"{name} has one level and is left out" for name in covariates if name not in names]
    codes = {name: np.unique([str(item) for item in covariates[name]], return_inverse=True)[1] for name in names}
    model = RestrictedLikelihood(y, group, [codes[name] for name in names])
    if tied := [name for index, name in enumerate(names) if not model.varies_within_conditions(index)]:
        return NotFitted(f"the condition cannot be told apart from {' and '.join(tied)}: they always change together")
    kept: list[int] = []
    for index, name in enumerate(names):
        if model.is_told_apart(index, kept):
            kept.append(index)
        else:
            others = " and ".join([*(names[other] for other in kept), "single values"])
            notes.append(f"{name} is left out: its variance cannot be told apart from that of {others}")
    if len(kept) < len(names):
        names = [names[index] for index in kept]
        model = RestrictedLikelihood(y, group, [codes[name] for name in names])
    if (parameters := model.rank()) >= len(y):
        return NotFitted(
            f"{len(y)} values are too few for {len(levels)} conditions and the levels of {' and '.join(names)}; at "
            f"least {parameters + 1} are needed"
        )
    if model.residual_squares() <= NO_VARIANCE * float(y @ y):
        return NotFitted("the values do not vary within the conditions, so that there is nothing to test against")
    found = estimates(model, model.best())
    sds = [math.sqrt(ratio * found.variance) for ratio in found.ratios]
    notes += [f"the variance of {name} is estimated as 0" for name, sd in zip(names, sds, strict=True) if sd == 0.0]
    return MixedModel(
        anova=_satterthwaite(model, found, levels, tuple(names)),
        kenward_roger=_kenward_roger(model, found, levels, tuple(names)) if kenward_roger else None,
        random=tuple(RandomPart(name, len(set(codes[name].tolist())), sd) for name, sd in zip(names, sds, strict=True)),
        residual_sd=math.sqrt(found.variance),
        criterion=found.criterion,
        notes=tuple(notes),
    )


def _satterthwaite(
    model: RestrictedLikelihood, found: Estimates, levels: tuple[str, ...], names: tuple[str, ...]
) -> Anova:
    method = Satterthwaite(model, found)
    contrasts = sequential_contrasts(model.sizes)
    told = contrasts @ found.means
    f = float(told @ np.linalg.solve(contrasts @ found.covariance @ contrasts.T, told)) / len(contrasts)
    single = [method.of(row) for row in np.eye(len(levels))]
    pairs = [[method.of(row) if row.any() else math.inf for row in rows] for rows in _differences(len(levels))]
    return _tested(found, levels, names, f, method.of_all(contrasts), found.covariance, single, pairs)


def _kenward_roger(
    model: RestrictedLikelihood, found: Estimates, levels: tuple[str, ...], names: tuple[str, ...]
) -> Anova | NotFitted:
    method = KenwardRoger(model, found)
    test = method.test(sequential_contrasts(model.sizes))
    single = [method.of(row[None, :])[0] for row in np.eye(len(levels))]
    pairs = [
        [method.of(row[None, :])[0] if row.any() else math.inf for row in rows] for rows in _differences(len(levels))
    ]
    variances = [row @ method.covariance @ row for rows in _differences(len(levels)) for row in rows if row.any()]
    numbers = [test.df_error, *single, *(df for row in pairs for df in row), *variances]
    # Below two degrees of freedom the scale of F may come out negative.
    if not math.isfinite(test.f) or test.f < 0.0 or not all(number > 0.0 for number in numbers):
        return NotFitted("there are too few values for Kenward and Roger's adjustment")
    return _tested(found, levels, names, test.f, test.df_error, method.covariance, single, pairs)


def _tested(
    found: Estimates,
    levels: tuple[str, ...],
    names: tuple[str, ...],
    f: float,
    df_error: float,
    covariance: FloatArray,
    single: Sequence[float],
    pairs: Sequence[Sequence[float]],
) -> Anova:
    df_effect = len(levels) - 1
    spread = np.diag(covariance)
    variances = spread[:, None] + spread[None, :] - 2.0 * covariance
    return Anova(
        f=f,
        df_effect=df_effect,
        df_error=df_error,
        p=float(stats.f.sf(f, df_effect, df_error)),
        eta_squared=eta_squared(f, df_effect, df_error),
        mean_square_error=found.variance,
        observations=found.observations,
        conditions=levels,
        adjusted_means=tuple(
            AdjustedMean(level, float(mean), math.sqrt(variance), df)
            for level, mean, variance, df in zip(levels, found.means, spread, single, strict=True)
        ),
        contrast_se=tuple(tuple(float(math.sqrt(max(cell, 0.0))) for cell in row) for row in variances),
        contrast_df=tuple(tuple(row) for row in pairs),
        covariates=names,
    )


def _differences(count: int) -> FloatArray:
    """Contrast of every two conditions, (count, count, count)."""
    single = np.eye(count)
    return np.asarray(single[:, None, :] - single[None, :, :])
