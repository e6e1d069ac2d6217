"""Cox's partial likelihood with strata and Efron's treatment of ties, and the effects that make it greatest.

Within a stratum, of those still at risk at a time t, the one with covariates x ends with probability
exp(x·β) / Σ exp(x·β). Of d that end at the same time, the k-th (k = 0 … d - 1) is drawn from those at risk less the
share k/d of those that end (B. Efron, 1977, J. Am. Stat. Assoc. 72, 557-565).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
MOST_STEPS = 50
SMALL_STEP = 1e-10
"""Of an effect, which is a logarithm."""
FAR = 50.0
"""An effect beyond it is on its way to infinity: nothing pulls it back."""


class NoMaximum(ValueError):
    """The likelihood grows without end, or says nothing of some effect."""


def greatest(
    times: FloatArray, design: FloatArray, ended: npt.NDArray[np.bool_], strata: npt.NDArray[np.str_]
) -> tuple[FloatArray, FloatArray]:
    """The effects (p,) of `design` (n, p) on the hazard, and their covariance (p, p), by Newton's method.

    `ended` is false where the time is only known to be longer. Raises `NoMaximum`.
    """
    events = [
        event
        for stratum in np.unique(strata)
        for event in _events(times[strata == stratum], design[strata == stratum], ended[strata == stratum])
    ]
    effects = np.zeros(design.shape[1])
    value, slope, information = _at(effects, events)
    for _ in range(MOST_STEPS):
        try:
            step = np.linalg.solve(information, slope)
        except np.linalg.LinAlgError:
            raise NoMaximum("the likelihood does not change with some effect") from None
        while (there := _at(effects + step, events))[0] < value - 1e-12 * abs(value):
            step = step / 2.0  # too far
        effects = effects + step
        value, slope, information = there
        if not np.isfinite(effects).all() or np.abs(effects).max() > FAR:
            break
        if np.abs(step).max() < SMALL_STEP:
            return effects, np.linalg.inv(information).astype(np.float64)
    raise NoMaximum("the likelihood grows without end")


_Event = tuple[FloatArray, FloatArray]
"""Covariates of all at risk at one time, those that end first, and how much of each is left for each of the latter,
(d, at risk)."""


def _events(times: FloatArray, design: FloatArray, ended: npt.NDArray[np.bool_]) -> Iterator[_Event]:
    for time in np.unique(times[ended]):
        ends = (times == time) & ended
        stays = (times >= time) & ~ends
        count = int(ends.sum())
        left = np.ones((count, count + int(stays.sum())))
        left[:, :count] -= np.arange(count)[:, None] / count
        yield np.concatenate([design[ends], design[stays]]), left


def _at(effects: FloatArray, events: list[_Event]) -> tuple[float, FloatArray, FloatArray]:
    """The logarithm of the likelihood, its slope (p,), and the information (p, p): less its curvature."""
    count = len(effects)
    value, slope, information = 0.0, np.zeros(count), np.zeros((count, count))
    for at_risk, left in events:
        ending = at_risk[: len(left)]
        risks = at_risk @ effects
        shift = float(risks.max())
        weights = left * np.exp(risks - shift)  # (d, at risk)
        total = weights.sum(axis=1)
        shares = weights / total[:, None]
        means = shares @ at_risk  # (d, p)
        value += float((ending @ effects).sum() - np.log(total).sum()) - shift * len(left)
        slope += (ending - means).sum(axis=0)
        information += np.einsum("dr,rp,rq->pq", shares, at_risk, at_risk) - means.T @ means
    return value, slope, information
