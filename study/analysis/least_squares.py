"""Ordinary least squares of a linear model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from study.analysis.design_matrix import FloatArray


@dataclass(frozen=True)
class LeastSquares:
    """A fit: `coefficients` (p,) with their `covariance` (p, p), and what is left of the values."""

    coefficients: FloatArray
    covariance: FloatArray
    residual_squares: float
    df_residual: int

    @property
    def mean_square_error(self) -> float:
        """Variance of a value about the model."""
        return self.residual_squares / self.df_residual

    def f_test(self, columns: Sequence[int]) -> float:
        """F of the hypothesis that these coefficients are nothing, of which there are `len(columns)` numerator
        degrees of freedom."""
        own = self.coefficients[list(columns)]
        return float(own @ np.linalg.solve(self.covariance[np.ix_(columns, columns)], own)) / len(columns)


def least_squares(y: FloatArray, design: FloatArray, rank: int) -> LeastSquares:
    """Fit `y` (n,) on `design` (n, p) of this `rank` < n. Columns that others make up share their effect, as the
    pseudo-inverse has it; what the others are made of is unique."""
    inverse = np.linalg.pinv(design)  # (p, n)
    coefficients = inverse @ y
    residuals = y - design @ coefficients
    squares, df = float(residuals @ residuals), len(y) - rank
    return LeastSquares(coefficients, squares / df * (inverse @ inverse.T), squares, df)
