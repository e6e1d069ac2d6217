"""Factors as numbers: the levels that occur, what makes a comparison impossible, and design matrices."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from study.analysis.effect_sizes import NO_VARIANCE

FloatArray = npt.NDArray[np.float64]


def levels_of(condition: Sequence[str], order: Sequence[str] | None) -> tuple[str, ...]:
    """The levels that occur, in the order given or met."""
    present = dict.fromkeys(condition)
    return tuple(level for level in (order or present) if level in present)


def problem(y: FloatArray, condition: Sequence[str], levels: Sequence[str]) -> str | None:
    """Why these values cannot be compared, in a sentence; None = they can."""
    if len(y) == 0:
        return "there are no values"
    if not np.isfinite(y).all():
        return "a value is not a finite number"
    if len(levels) < 2:
        return f"values under {' and '.join(levels)} alone; at least two conditions are needed"
    counts = Counter(condition)
    few = [level for level in levels if counts[level] < 2]
    if few:
        return f"fewer than 2 values under {' and '.join(few)}"
    if float(y.max() - y.min()) <= NO_VARIANCE * max(1.0, float(np.abs(y).max())):
        return f"all {len(y)} values are equal ({y[0]:g}): there is no variance to analyse"
    return None


def design_matrix(
    condition: Sequence[str], levels: Sequence[str], covariates: Mapping[str, Sequence[object]]
) -> FloatArray:
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


def independent_columns(design: FloatArray) -> list[int]:
    """Columns from the left that are not made of those before them."""
    kept: list[int] = []
    for column in range(design.shape[1]):
        if rank_of(design[:, [*kept, column]]) > len(kept):
            kept.append(column)
    return kept


def rank_of(design: FloatArray) -> int:
    """The columns hold -1, 0 and 1, so that the products are exact."""
    return int(np.linalg.matrix_rank(design.T @ design))
