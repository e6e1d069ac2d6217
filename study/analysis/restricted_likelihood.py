"""The restricted likelihood of a linear mixed model with crossed random intercepts, and where it is greatest.

    y = X beta + sum over factors of Z_i b_i + e,   b_i ~ N(0, ratio_i s^2),   e ~ N(0, s^2)

X says which condition a value belongs to and Z_i which level of a factor, both as columns of 0 and 1. After Bates,
Mächler, Bolker & Walker (2015), J. Stat. Softw. 67(1), sec. 3: beta and s^2 follow from the ratios, so that the
likelihood is searched over the ratios alone. Ours differs in that the conditions are taken out of y and Z once, before
the search (Patterson & Thompson 1971): what is left has n - k dimensions, and with M = I - X (X'X)^-1 X', G = Z'MZ,
g = Z'My, D = diag(sqrt(ratio)), B = I + D G D the criterion (-2 log of the restricted likelihood) is

    log |B| + (n - k) (1 + log(2 pi r^2 / (n - k))) + log |X'X|,   r^2 = y'My - g'D B^-1 D g
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import linalg

from study.analysis.design_matrix import FloatArray

IntArray = npt.NDArray[np.intp]
SMALLEST_RATIO = 1e-10
"""A variance below this share of the residual's is 0, as in lme4, whose boundary is at 1e-5 of the SD."""
GRID = (0.0, 0.2, 0.6, 2.0, 10.0)
"""Ratios of the SDs, in every combination of which the criterion is looked at first."""
MOST_STEPS = 60


@dataclass(frozen=True)
class Slopes:
    """The criterion at some ratios, with its first and second derivatives by them; s^2 at its best."""

    criterion: float
    gradient: FloatArray
    """(factors,)"""
    hessian: FloatArray
    """(factors, factors)"""
    variance: float
    """s^2 = r^2 / (n - k)"""
    joint_hessian: FloatArray
    """(factors + 1, factors + 1), by the ratios and by log s^2, which is not profiled out here."""


class RestrictedLikelihood:
    """`group` (n,) holds the number of each value's condition, `factors` that of its level of each factor, from 0."""

    def __init__(self, y: FloatArray, group: Sequence[int], factors: Sequence[IntArray]) -> None:
        self.group = np.asarray(group)
        self.sizes = np.bincount(self.group).astype(np.float64)  # X'X is diagonal: these
        self.y = y
        self.z, self.blocks = _indicators(len(y), factors)
        self.degrees = len(y) - len(self.sizes)
        self.squares = self.z.T @ self.z
        self.zx = np.stack([self.z[self.group == index].sum(axis=0) for index in range(len(self.sizes))], axis=1)
        centred_z = self.z - (self.zx / self.sizes).T[self.group]
        self._centred_y = y - self.means(y)[self.group]
        self.gram = centred_z.T @ centred_z  # G
        self._projection = centred_z.T @ self._centred_y  # g
        self._sides = np.column_stack([self.gram, self._projection])
        self._squares = float(self._centred_y @ self._centred_y)

    def means(self, values: FloatArray) -> FloatArray:
        """Plain mean of each condition."""
        return np.asarray(np.bincount(self.group, values, len(self.sizes)) / self.sizes)

    def rank(self) -> int:
        """How many values conditions and levels, all as fixed, could tell exactly."""
        return len(self.sizes) + int(np.linalg.matrix_rank(self.gram, tol=1e-9, hermitian=True)) if self.blocks else 0

    def residual_squares(self) -> float:
        """What conditions and levels, all as fixed, leave of the squares: 0 = every value is told by them."""
        solution = np.linalg.pinv(self.gram, rcond=1e-10, hermitian=True) @ self._projection
        left = self._centred_y - (self.z - (self.zx / self.sizes).T[self.group]) @ solution
        return float(left @ left)

    def is_told_apart(self, index: int, kept: Sequence[int]) -> bool:
        """Whether a factor's variance differs in its mark on the data from those of `kept` and of single values."""
        own = [*kept, index]
        marks = np.zeros((len(own) + 1, len(own) + 1))  # inner products of the matrices that the variances multiply
        for row, first in enumerate(own):
            for column, second in enumerate(own):
                marks[row, column] = float((self.gram[self.blocks[first], self.blocks[second]] ** 2).sum())
            marks[row, -1] = marks[-1, row] = float(np.trace(self.gram[self.blocks[first], self.blocks[first]]))
        marks[-1, -1] = self.degrees
        length = np.sqrt(np.diag(marks))
        return bool(np.linalg.eigvalsh(marks / np.outer(length, length))[0] > 1e-9)

    def varies_within_conditions(self, index: int) -> bool:
        """Whether a factor has more than one level under some condition."""
        own = self.blocks[index]
        return float(np.trace(self.gram[own, own])) > 1e-9

    def solve(self, ratios: FloatArray) -> tuple[float, FloatArray, FloatArray, float]:
        """log |B|; T = Z'K W^-1 K'Z; t = Z'K W^-1 K'y; r^2. K spans what is orthogonal to X."""
        log_b, right, solution = self._solved(ratios, self._sides)
        full = self._sides - right[:, :-1].T @ solution
        squares = max(self._squares - float(right[:, -1] @ solution[:, -1]), 0.0)
        return log_b, full[:, :-1], full[:, -1], squares

    def _solved(self, ratios: FloatArray, sides: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """log |B|, D times `sides`, and B^-1 times that."""
        d = self.spread(ratios)
        if not len(d):
            return 0.0, sides, sides
        inner = d[:, None] * self.gram * d
        inner.flat[:: len(d) + 1] += 1.0  # B
        factor = linalg.cho_factor(inner, lower=True, overwrite_a=True, check_finite=False)
        right = d[:, None] * sides
        solution = linalg.cho_solve(factor, right, check_finite=False)
        return 2.0 * float(np.log(np.diag(factor[0])).sum()), right, solution

    def spread(self, ratios: FloatArray) -> FloatArray:
        """The diagonal of D: the SD of each level's effect in residual SDs."""
        d = np.zeros(self.z.shape[1])
        for ratio, block in zip(ratios, self.blocks, strict=True):
            d[block] = math.sqrt(ratio)
        return d

    def slopes(self, ratios: FloatArray) -> Slopes:
        """Criterion and derivatives, all exact."""
        log_b, full, vector, squares = self.solve(ratios)
        count, n = len(self.blocks), self.degrees
        variance = squares / n
        traces = np.array([np.trace(full[block, block]) for block in self.blocks])
        pushes = np.array([float(vector[block] @ vector[block]) for block in self.blocks])
        joint = np.zeros((count + 1, count + 1))
        for i, first in enumerate(self.blocks):
            for j, second in enumerate(self.blocks):
                cell = full[first, second]
                curve = float(vector[first] @ cell @ vector[second])
                joint[i, j] = 2.0 * curve / variance - float((cell**2).sum())
            joint[i, -1] = joint[-1, i] = pushes[i] / variance
        joint[-1, -1] = n
        return Slopes(
            criterion=self._criterion(log_b, variance),
            gradient=traces - pushes / variance,
            hessian=joint[:-1, :-1] - np.outer(pushes, pushes) / (variance**2 * n),
            variance=variance,
            joint_hessian=joint,
        )

    def criterion(self, ratios: FloatArray) -> float:
        """-2 log of the restricted likelihood, at the best s^2."""
        log_b, right, solution = self._solved(ratios, self._projection[:, None])
        squares = self._squares - float(right[:, 0] @ solution[:, 0])
        return self._criterion(log_b, squares / self.degrees)

    def _criterion(self, log_b: float, variance: float) -> float:
        # At a variance of 0 it falls without end; the caller sees to it that the values do not allow that.
        log_variance = math.log(2.0 * math.pi * max(variance, 1e-300))
        return log_b + self.degrees * (1.0 + log_variance) + float(np.log(self.sizes).sum())

    def best(self) -> FloatArray:
        """The ratios at which the criterion is least; 0 where it rises from 0 on.

        Looked for from every dip of a coarse grid, because there may be more than one summit of the likelihood.
        """
        count = len(self.blocks)
        if not count:
            return np.zeros(0)
        found = np.empty((len(GRID),) * count)
        for place in np.ndindex(found.shape):
            found[place] = self.criterion(np.array([GRID[index] ** 2 for index in place]))
        dips = np.ones_like(found, dtype=bool)
        for axis in range(count):
            rise = np.diff(found, axis=axis)
            edge = np.full_like(found.take([0], axis=axis), np.inf)
            dips &= np.concatenate([rise, edge], axis=axis) >= 0.0
            dips &= np.concatenate([-edge, rise], axis=axis) <= 0.0
        starts = [np.array([GRID[index] ** 2 for index in place]) for place in zip(*np.nonzero(dips), strict=True)]
        return min((self._descend(start) for start in starts), key=self.criterion)

    def _descend(self, ratios: FloatArray) -> FloatArray:
        """Newton's method until nothing moves. A ratio stays at 0 unless the criterion falls from there."""
        slopes = self.slopes(ratios)
        for _ in range(MOST_STEPS):
            free = (ratios > 0.0) | (slopes.gradient < -1e-9)
            if not free.any():
                break
            step = np.zeros_like(ratios)
            step[free] = _downhill(slopes.hessian[np.ix_(free, free)], slopes.gradient[free], ratios[free])
            for halving in range(40):
                trial = np.maximum(ratios + step * 0.5**halving, 0.0)
                trial[trial < SMALLEST_RATIO] = 0.0
                there = self.slopes(trial)
                if there.criterion <= slopes.criterion + 1e-13 * abs(slopes.criterion):
                    break
            else:
                break
            moved = float(np.max(np.abs(trial - ratios) / (ratios + trial + SMALLEST_RATIO)))
            ratios, slopes = trial, there
            if moved < 1e-11:
                break
        return ratios


def _downhill(hessian: FloatArray, gradient: FloatArray, ratios: FloatArray) -> FloatArray:
    """Newton's step, turned downhill where the criterion curves downwards, and no longer than ten times the ratio."""
    scale = np.sqrt(ratios + 1e-3)  # the ratios may differ by powers of ten
    values, vectors = np.linalg.eigh(hessian * np.outer(scale, scale))
    bound = np.maximum(np.abs(values), 1e-9 * float(np.abs(values).max()) + 1e-300)
    step = -scale * (vectors @ ((vectors.T @ (scale * gradient)) / bound))
    return np.asarray(step / max(1.0, float(np.max(np.abs(step) / (10.0 * ratios + 1.0)))))


def _indicators(count: int, factors: Sequence[IntArray]) -> tuple[FloatArray, list[slice]]:
    """Z with a column of 0 and 1 for each level, (n, levels of all factors), and which columns are each factor's."""
    blocks, columns, first = [], [], 0
    for codes in factors:
        own = np.zeros((count, int(codes.max()) + 1))
        own[np.arange(count), codes] = 1.0
        columns.append(own)
        blocks.append(slice(first, first + own.shape[1]))
        first += own.shape[1]
    return (np.column_stack(columns) if columns else np.zeros((count, 0))), blocks
