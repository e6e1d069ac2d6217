"""How far tests of a mixed model can be trusted: the degrees of freedom of their t and F.

    Satterthwaite    as lmerTest has it: Kuznetsova, Brockhoff & Christensen (2017), J. Stat. Softw. 82(13), sec. 2
    Kenward-Roger    as pbkrtest has it: Kenward & Roger (1997), Biometrics 53; Halekoh & Højsgaard (2014),
                     J. Stat. Softw. 59(9)

Both look at how much the covariance C of the conditions' means hangs on variances that are themselves estimates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study.analysis.design_matrix import FloatArray
from study.analysis.restricted_likelihood import RestrictedLikelihood

SAME = 1e-8


@dataclass(frozen=True)
class Estimates:
    """The conditions' means (k,) at the best ratios, their covariance C (k, k), and what C hangs on."""

    means: FloatArray
    covariance: FloatArray
    ratios: FloatArray
    variance: float
    """Residual variance, s^2."""
    criterion: float
    observations: int
    cross: FloatArray
    """Z'W^-1X, (levels, k), with V = s^2 W."""


def estimates(model: RestrictedLikelihood, ratios: FloatArray) -> Estimates:
    """Generalised least squares at these ratios."""
    slopes = model.slopes(ratios)
    d = model.spread(ratios)
    right = d[:, None] * model.zx
    middle = np.linalg.solve(np.eye(len(d)) + d[:, None] * model.squares * d, right)
    inverse = np.diag(model.sizes) - right.T @ middle  # X'W^-1X
    cross = model.zx - model.squares @ (d[:, None] * middle)
    # The plain means, less what the levels that each condition met would have added.
    _, _, vector, _ = model.solve(ratios)
    effects = d**2 * vector  # b
    means = model.means(model.y - model.z @ effects)
    covariance = np.linalg.inv(inverse) * slopes.variance
    return Estimates(means, covariance, ratios, slopes.variance, slopes.criterion, len(model.y), cross)


# ---- Satterthwaite --------------------------------------------------------------------------------------------------


class Satterthwaite:
    """Degrees of freedom from the curvature of the criterion: 2 var^2 / Var(var), by the delta method.

    A variance of 0 counts as known: at the boundary C does not hang on the SD to first order, and lmerTest, which
    differentiates by the SD, leaves it out in the same way.
    """

    def __init__(self, model: RestrictedLikelihood, found: Estimates) -> None:
        free = [index for index, ratio in enumerate(found.ratios) if ratio > 0.0]
        joint = model.slopes(found.ratios).joint_hessian
        own = [*free, len(found.ratios)]
        values, vectors = np.linalg.eigh(joint[np.ix_(own, own)])
        kept = values > 0.0  # lmerTest drops directions in which the criterion does not curve upwards
        self._spread = 2.0 * (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
        self._covariance = found.covariance
        self._slopes = []
        for index in free:
            root = found.cross[model.blocks[index]] @ found.covariance  # Z_i'W^-1X C
            self._slopes.append(root.T @ root / found.variance)
        self._slopes.append(found.covariance)

    def of(self, contrast: FloatArray) -> float:
        """Of one contrast of the means, (k,)."""
        variance = float(contrast @ self._covariance @ contrast)
        gradient = np.array([float(contrast @ slope @ contrast) for slope in self._slopes])
        return 2.0 * variance**2 / float(gradient @ self._spread @ gradient)

    def of_all(self, contrasts: FloatArray) -> float:
        """Of the F test of several contrasts (q, k): those of independent t tests, put together by their mean."""
        values, vectors = np.linalg.eigh(contrasts @ self._covariance @ contrasts.T)
        found = [self.of(vector @ contrasts) for vector in vectors.T[values > 1.5e-8 * values.max()]]
        if max(found) - min(found) < SAME:
            return float(np.mean(found))
        if min(found) <= 2.0:
            return 2.0  # the mean of such an F does not exist
        expected = sum(df / (df - 2.0) for df in found)
        return 2.0 * expected / (expected - len(found))


# ---- Kenward-Roger --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ScaledTest:
    """F and its degrees of freedom under Kenward and Roger's adjustment."""

    f: float
    df_error: float


class KenwardRoger:
    """The covariance made larger for small samples, and tests with it. All variances count, those of 0 too."""

    def __init__(self, model: RestrictedLikelihood, found: Estimates) -> None:
        self._means, self._plain = found.means, found.covariance
        firsts, seconds, marks = _derivatives(model, found)
        count = len(firsts)
        information = np.zeros((count, count))
        for i in range(count):
            for j in range(count):
                product = self._plain @ firsts[i] @ self._plain
                information[i, j] = marks[i, j] - 2.0 * float((self._plain * seconds[i][j]).sum())
                information[i, j] += float((product * firsts[j]).sum())
        self._weights = 2.0 * np.linalg.pinv(information, rcond=1e-12, hermitian=True)
        inner = np.zeros_like(self._plain)
        for i in range(count):
            for j in range(count):
                inner += self._weights[i, j] * (seconds[i][j] - firsts[i] @ self._plain @ firsts[j])
        self._firsts = firsts
        self.covariance: FloatArray = self._plain + self._plain @ (inner + inner.T) @ self._plain

    def of(self, contrasts: FloatArray) -> tuple[float, float]:
        """Degrees of freedom and scale of the F of contrasts (q, k)."""
        q = len(contrasts)
        theta = contrasts.T @ np.linalg.solve(contrasts @ self._plain @ contrasts.T, contrasts) @ self._plain
        terms = [theta @ first @ self._plain for first in self._firsts]
        traces = np.array([np.trace(u) for u in terms])
        products = np.array([[float((u * v.T).sum()) for v in terms] for u in terms])
        a1, a2 = float(traces @ self._weights @ traces), float((self._weights * products).sum())
        b = (a1 + 6.0 * a2) / (2.0 * q)
        g = ((q + 1.0) * a1 - (q + 4.0) * a2) / ((q + 2.0) * a2)
        base = 3.0 * q + 2.0 * (1.0 - g)
        v0, v1, v2 = 1.0 + g / base * b, 1.0 - (q - g) / base * b, 1.0 - (q + 2.0 - g) / base * b
        v0 = 0.0 if abs(v0) < 1e-10 else v0
        top = 1.0 - a2 / q
        quotient = 1.0 if abs(top) < 1e-14 and abs(v1) < 1e-14 else top / v1
        df = 4.0 + (q + 2.0) / (quotient**2 * v0 / v2 - 1.0)
        scale = 1.0 if abs(df - 2.0) < 0.01 else df * top / (df - 2.0)
        return df, scale

    def test(self, contrasts: FloatArray) -> ScaledTest:
        """That all contrasts are 0."""
        df, scale = self.of(contrasts)
        values = contrasts @ self._means
        wald = float(values @ np.linalg.solve(contrasts @ self.covariance @ contrasts.T, values))
        return ScaledTest(scale * wald / len(contrasts), df)


def _derivatives(
    model: RestrictedLikelihood, found: Estimates
) -> tuple[list[FloatArray], list[list[FloatArray]], FloatArray]:
    """Kenward and Roger's P_i, Q_ij and tr(V^-1 V_i V^-1 V_j), by the factors' variances and then the residual's.

    V_i = Z_i Z_i' for a factor and 1 for the residual, and V = s^2 W; nothing larger than (n, levels) is formed.
    """
    z, blocks, count = model.z, model.blocks, len(model.blocks)
    d = model.spread(found.ratios)
    inner = np.eye(len(d)) + d[:, None] * model.squares * d

    def weigh(values: FloatArray) -> FloatArray:
        """W^-1 times that."""
        return np.asarray(values - z @ (d[:, None] * np.linalg.solve(inner, d[:, None] * (z.T @ values))))

    x = np.eye(len(model.sizes))[model.group]
    once, weighed_z = weigh(x), weigh(z)  # W^-1X, W^-1Z
    twice, between = weigh(once), z.T @ weighed_z  # W^-2X, Z'W^-1Z
    small = np.linalg.solve(inner, inner - np.eye(len(d)))
    firsts = [-found.cross[block].T @ found.cross[block] for block in blocks] + [-once.T @ once]
    seconds = [[np.zeros_like(firsts[0])] * (count + 1) for _ in range(count + 1)]
    marks = np.zeros((count + 1, count + 1))
    for i, own in enumerate(blocks):
        for j, other in enumerate(blocks):
            seconds[i][j] = found.cross[own].T @ between[own, other] @ found.cross[other]
            marks[i, j] = float((between[own, other] ** 2).sum())
        seconds[i][count] = found.cross[own].T @ (z[:, own].T @ twice)
        seconds[count][i] = seconds[i][count].T
        marks[i, count] = marks[count, i] = float((weighed_z[:, own] ** 2).sum())
    seconds[count][count] = once.T @ twice
    marks[count, count] = len(model.y) - 2.0 * float(np.trace(small)) + float((small * small.T).sum())
    unit = found.variance
    return [p / unit**2 for p in firsts], [[q / unit**3 for q in row] for row in seconds], marks / unit**2


def sequential_contrasts(sizes: FloatArray) -> FloatArray:
    """Contrasts (k - 1, k) of k conditions as lmerTest tests a single factor: rows of the Doolittle factor of X'X, X in
    treatment coding. All such sets give the same F; the degrees of freedom differ a little between them."""
    moments = np.diag(sizes[1:]) - np.outer(sizes[1:], sizes[1:]) / sizes.sum()
    factor = np.linalg.cholesky(moments)
    unit = (factor / np.diag(factor)).T
    against_first = np.column_stack([-np.ones(len(sizes) - 1), np.eye(len(sizes) - 1)])
    return np.asarray(unit @ against_first)
