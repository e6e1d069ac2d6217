"""The mixed model beside the ANOVA: the same fixed part, and a random intercept for every participant, by REML."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats
from statsmodels.regression.mixed_linear_model import MixedLM, MixedLMParams

from study.analysis.design_matrix import FloatArray, design_matrix, independent_columns, levels_of, problem
from study.analysis.effect_sizes import LEVEL, NO_VARIANCE, Interval, NotFitted


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


def mixed_model(
    values: Sequence[float],
    condition: Sequence[str],
    participant: Sequence[str],
    covariates: Mapping[str, Sequence[object]] | None = None,
    conditions: Sequence[str] | None = None,
) -> MixedModel | NotFitted:
    """The ANOVA's fixed part and a random intercept per participant, by REML."""
    y = np.asarray(values, dtype=np.float64)
    levels = levels_of(condition, conditions)
    if reason := problem(y, condition, levels):
        return NotFitted(reason)
    people = len(set(participant))
    if people < 3:
        return NotFitted(f"participants: {people}; their spread cannot be estimated from fewer than 3")
    design = design_matrix(condition, levels, {name: list(of) for name, of in (covariates or {}).items()})
    keep = independent_columns(design)
    own = [keep.index(column) for column in range(1, len(levels)) if column in keep]
    if len(own) < len(levels) - 1:
        return NotFitted("the condition cannot be told apart from the covariates")
    design = design[:, keep]
    if len(y) <= design.shape[1] + 1:
        return NotFitted(f"{len(y)} values are too few for {design.shape[1] + 2} parameters")
    groups = _Groups(y, design, participant)
    if groups.rss(0.0) <= NO_VARIANCE * float(y @ y):
        return NotFitted("the values do not vary within the conditions, so that there is nothing to test against")
    within = groups.fit(0.0) if groups.falls_from_zero() else _fit(y, design, participant, groups.best_fit())
    effects, block = within.effects[own], within.covariance[np.ix_(own, own)]
    chi_squared = float(effects @ np.linalg.solve(block, effects))
    estimates = []
    for index, value in enumerate(map(float, effects)):
        se = math.sqrt(block[index, index])
        reach = float(stats.norm.ppf(0.5 + LEVEL / 2.0)) * se
        p = 2.0 * float(stats.norm.sf(abs(value) / se))
        estimates.append((levels[index + 1], Interval(value, value - reach, value + reach), p))
    return MixedModel(
        chi_squared=chi_squared,
        df=len(own),
        p=float(stats.chi2.sf(chi_squared, len(own))),
        against=levels[0],
        estimates=tuple(estimates),
        participant_sd=within.participant_sd,
        residual_sd=within.residual_sd,
        participants=people,
        note=within.note,
    )


@dataclass(frozen=True)
class _RandomIntercept:
    effects: FloatArray
    covariance: FloatArray
    participant_sd: float
    residual_sd: float
    note: str | None = None


def _fit(y: FloatArray, design: FloatArray, participant: Sequence[str], start: _RandomIntercept) -> _RandomIntercept:
    """statsmodels' fit, begun where the likelihood is greatest; `start` itself where its optimiser stops at a singular
    covariance, as it does near a variance of 0."""
    scale = float(y.std())  # belief gains are thousandths, ticks hundreds: the optimiser sees ones
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ratio = (start.participant_sd / start.residual_sd) ** 2
            begin = MixedLMParams.from_components(start.effects / scale, cov_re=np.array([[ratio]]))
            model = MixedLM(y / scale, design, groups=np.asarray(participant))
            fit = model.fit(start_params=begin, reml=True, method="lbfgs", maxiter=200)
            covariance = np.asarray(fit.cov_params())[: design.shape[1], : design.shape[1]] * scale**2
    except (np.linalg.LinAlgError, ValueError):
        return start
    variance = float(np.asarray(fit.cov_re).ravel()[0])
    if not fit.converged or not np.isfinite(covariance).all() or not variance > 0.0:
        return start
    effects = np.asarray(fit.fe_params) * scale
    return _RandomIntercept(effects, covariance, math.sqrt(variance) * scale, math.sqrt(float(fit.scale)) * scale)


class _Groups:
    """Restricted likelihood of a random intercept as a function of the variances' ratio alone (for the boundary).

    With V = I + ratio Z Z', everything follows from sums over participants: V^-1 = I - Z diag(w) Z',
    w = ratio / (1 + ratio n).
    """

    def __init__(self, y: FloatArray, design: FloatArray, participant: Sequence[str]) -> None:
        codes = np.unique(np.asarray(participant), return_inverse=True)[1]
        count = int(codes.max()) + 1
        self._y, self._design, self._codes = y, design, codes
        self._sizes = np.bincount(codes, minlength=count).astype(np.float64)
        self._sums_x = np.column_stack([np.bincount(codes, column, count) for column in design.T])  # Z'X
        self._sums_y = np.bincount(codes, y, count)

    def _solve(self, ratio: float) -> tuple[FloatArray, FloatArray, float]:
        """(X'V^-1X)^-1, effects, residual sum of squares in the metric of V^-1."""
        weights = ratio / (1.0 + ratio * self._sizes)
        inverse = np.linalg.inv(self._design.T @ self._design - (self._sums_x.T * weights) @ self._sums_x)
        effects = inverse @ (self._design.T @ self._y - self._sums_x.T @ (weights * self._sums_y))
        residuals = self._y - self._design @ effects
        sums = np.bincount(self._codes, residuals, len(self._sizes))
        return inverse, effects, float(residuals @ residuals - weights @ sums**2)

    def rss(self, ratio: float) -> float:
        return self._solve(ratio)[2]

    def falls_from_zero(self) -> bool:
        """Whether the likelihood falls from a ratio of 0 on; its slope there is r'ZZ'r / s^2 - tr(Z'MZ)."""
        inverse, effects, squares = self._solve(0.0)
        sums = self._sums_y - self._sums_x @ effects
        variance = squares / (len(self._y) - self._design.shape[1])
        trace = len(self._y) - float(np.einsum("ij,jk,ik->", self._sums_x, inverse, self._sums_x))
        return bool(float(sums @ sums) / variance <= trace)

    def best_fit(self) -> _RandomIntercept:
        """The ratio of the greatest restricted likelihood."""
        degrees = len(self._y) - self._design.shape[1]

        def loss(log_ratio: float) -> float:
            ratio = math.exp(log_ratio)
            inverse, _, squares = self._solve(ratio)
            log_inverse = float(np.linalg.slogdet(inverse)[1])
            penalty = float(np.log1p(ratio * self._sizes).sum())
            return float(degrees * math.log(squares) + penalty - log_inverse)

        found = optimize.minimize_scalar(loss, bounds=(-20.0, 10.0), method="bounded", options={"xatol": 1e-8})
        return self.fit(math.exp(float(found.x)))

    def fit(self, ratio: float) -> _RandomIntercept:
        inverse, effects, squares = self._solve(ratio)
        variance = squares / (len(self._y) - self._design.shape[1])
        note = "participants' variance is estimated as 0: the mixed model is then the ANOVA" if ratio == 0.0 else None
        return _RandomIntercept(effects, inverse * variance, math.sqrt(ratio * variance), math.sqrt(variance), note)
