"""The studentised range of Tukey's test, for degrees of freedom that need not be whole, by quadrature in a millisecond.

    P(Q > q) = integral over s of chi(s; df) times P(range of k standard normals > q s)

scipy has the same distribution, and takes ten milliseconds for a p and two hundred for a critical value.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy import optimize, special

from study.analysis.design_matrix import FloatArray

NODES, WEIGHTS = np.polynomial.legendre.leggauss(128)
"""Of Gauss and Legendre, on -1 to 1."""
REACH_Z = 8.5
"""Where the normal density has become nothing."""
TAIL, SMALLEST = 1e-15, 1e-280
"""What is left of the distribution of s on either side, and the least that is looked at."""
WIDEST = 12.0
"""Of log s, for one set of nodes: with fewer than one degree of freedom s may be anything."""
FARTHEST = 1e12
"""A critical value beyond this is none."""
MOST_DF = 1e6
"""Above this, s is 1."""


def upper_tail(q: float, groups: int, df: float) -> float:
    """P(Q > q) for the range of `groups` means and `df` degrees of freedom of their error."""
    if q <= 0.0:
        return 1.0
    if groups == 2:
        return 2.0 * float(special.stdtr(df, -q / math.sqrt(2.0)))
    if df > MOST_DF:
        return float(_range_tail(np.array([q]), groups)[0])
    s, weights = _chi(df)
    near_zero = max(0.0, 1.0 - float(weights.sum())) if df < 1.0 else 0.0  # an s below `SMALLEST`: any range exceeds it
    return min(1.0, float(weights @ _range_tail(q * s, groups)) + near_zero)


@lru_cache(maxsize=256)
def critical(level: float, groups: int, df: float) -> float:
    """The q with P(Q > q) = 1 - level."""
    if groups == 2:
        return math.sqrt(2.0) * float(special.stdtrit(df, 0.5 + level / 2.0))

    def above(q: float) -> float:
        return upper_tail(q, groups, df) - (1.0 - level)

    high = 8.0
    while above(high) > 0.0:
        if high > FARTHEST:
            return math.inf
        high *= 2.0
    return float(optimize.brentq(above, 1e-6, high, xtol=1e-10))


@lru_cache(maxsize=256)
def _chi(df: float) -> tuple[FloatArray, FloatArray]:
    """Nodes s and weights of the distribution of s = chi / sqrt(df), which add up to 1."""
    half = df / 2.0
    low = max(float(special.gammaincinv(half, TAIL)), SMALLEST)  # of half of chi squared, as the next
    high = float(special.gammainccinv(half, TAIL))
    first, last = (0.5 * math.log(x / half) for x in (low, high))
    edges = np.linspace(first, last, 1 + math.ceil((last - first) / WIDEST))
    reach = 0.5 * np.diff(edges)
    log_s = (0.5 * (edges[1:] + edges[:-1])[:, None] + reach[:, None] * NODES).ravel()
    density = np.exp(df * log_s - half * np.exp(2.0 * log_s) + half * math.log(half) - math.lgamma(half)) * 2.0
    return np.exp(log_s), (reach[:, None] * WEIGHTS).ravel() * density


def _range_tail(widths: FloatArray, groups: int) -> FloatArray:
    """P(range of `groups` standard normals > width): 1 - k integral of phi(z) (Phi(z) - Phi(z - w))^(k - 1).

    As k integral of phi(z) (Phi(z)^(k - 1) - (Phi(z) - Phi(z - w))^(k - 1)), which keeps its digits where it is small.
    """
    z = REACH_Z * NODES
    density = REACH_Z * WEIGHTS * np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi)
    above, both = special.ndtr(z), special.ndtr(z[None, :] - widths[:, None])
    inner = above ** (groups - 1) * -np.expm1((groups - 1) * np.log1p(-np.minimum(both / above, 1.0 - 1e-16)))
    return np.asarray(groups * (inner @ density))
