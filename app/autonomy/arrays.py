"""Array types of the package, and the checks that stand between a caller's numbers and the mathematics."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.autonomy.errors import AutonomyError

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

MAX_COORDINATE_M = 1e100
"""Coordinates beyond this would overflow when squared, and turn into NaN."""

_NORM_TOLERANCE = 1e-9
_SUM_TOLERANCE = 1e-6
_SUM_ROUNDING = 1e-12


def frozen(values: FloatArray) -> FloatArray:
    """The same array, marked read-only."""
    values.flags.writeable = False
    return values


def _numbers(name: str, values: npt.ArrayLike, wanted: str) -> FloatArray:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise AutonomyError(f"{name} is {values!r}; it must be {wanted}") from error


def checked_points_m(name: str, values: npt.ArrayLike) -> FloatArray:
    """Points in the world frame, shape (..., 3), metres.

    Raises:
        AutonomyError: wrong shape, or a coordinate that is not finite or beyond ``MAX_COORDINATE_M``.
    """
    if isinstance(values, tuple) and len(values) == 3 and all(type(value) is float for value in values):
        x, y, z = values  # one point, as every tick has it: the same check without arrays
        if abs(x) + abs(y) + abs(z) <= MAX_COORDINATE_M:
            return np.array(values)
    points = _numbers(name, values, "numbers of shape (..., 3), in metres")
    if points.ndim < 1 or points.shape[-1] != 3:
        raise AutonomyError(f"{name} has shape {points.shape}; it must be (..., 3), in metres")
    # A NaN fails this comparison too.
    if not np.abs(points).max(initial=0.0) <= MAX_COORDINATE_M:
        raise AutonomyError(
            f"{name} is {points.tolist()}; coordinates must be finite and at most {MAX_COORDINATE_M:g} m"
        )
    return points


def checked_point_m(name: str, values: npt.ArrayLike) -> FloatArray:
    """One point in the world frame, shape (3,), metres; raises AutonomyError as ``checked_points_m`` does."""
    point = checked_points_m(name, values)
    if point.shape != (3,):
        raise AutonomyError(f"{name} has shape {point.shape}; it must be (3,), in metres")
    return point


def checked_goals_m(values: npt.ArrayLike) -> FloatArray:
    """Goal positions, shape (G, 3) with G >= 1, world frame, metres.

    Raises:
        AutonomyError: no goal, wrong shape, or coordinates out of bounds.
    """
    goals_m = checked_points_m("goals_m", values)
    if goals_m.ndim != 2 or goals_m.shape[0] < 1:
        raise AutonomyError(f"goals_m has shape {goals_m.shape}; it must be (G, 3) with at least one goal")
    return goals_m


def checked_momenta(values: npt.ArrayLike) -> FloatArray:
    """Directions executed in the last tick, shape (..., 3), unitless, each of length <= 1 (0: at rest).

    Raises:
        AutonomyError: wrong shape, not finite, or longer than 1.
    """
    if isinstance(values, tuple) and len(values) == 3 and all(type(value) is float for value in values):
        x, y, z = values  # one momentum, as every tick has it: the same check without arrays
        if x * x + y * y + z * z <= (1.0 + _NORM_TOLERANCE) ** 2:
            return np.array(values)
    momenta = _numbers("momentum", values, "numbers of shape (..., 3), each of length <= 1")
    if momenta.ndim < 1 or momenta.shape[-1] != 3:
        raise AutonomyError(f"momentum has shape {momenta.shape}; it must be (..., 3)")
    squared = np.einsum("...i,...i->...", momenta, momenta)
    if not np.max(squared, initial=0.0) <= (1.0 + _NORM_TOLERANCE) ** 2:
        raise AutonomyError(f"momentum is {momenta.tolist()}; it must be finite and of length <= 1")
    return momenta


def checked_momentum(values: npt.ArrayLike) -> FloatArray:
    """One momentum, shape (3,); raises AutonomyError as ``checked_momenta`` does."""
    momentum = checked_momenta(values)
    if momentum.shape != (3,):
        raise AutonomyError(f"momentum has shape {momentum.shape}; it must be (3,)")
    return momentum


def checked_probabilities(values: npt.ArrayLike, goal_count: int) -> FloatArray:
    """A distribution over ``goal_count`` goals, shape (G,).

    A sum that is 1 within rounding is left bit for bit as it is, so that "no evidence" changes nothing.

    Raises:
        AutonomyError: wrong length, a negative or non-finite entry, or a sum more than 1e-6 away from 1.
    """
    probabilities = _numbers("belief", values, "one probability for each goal")
    if probabilities.shape != (goal_count,):
        raise AutonomyError(
            f"belief has shape {probabilities.shape}; with {goal_count} goals it must be ({goal_count},)"
        )
    total = float(probabilities.sum())
    if not probabilities.min() >= 0.0 or not abs(total - 1.0) <= _SUM_TOLERANCE:
        raise AutonomyError(
            f"belief is {probabilities.tolist()} with sum {total!r}; entries must be >= 0 and sum to 1 "
            f"within {_SUM_TOLERANCE:g}"
        )
    return probabilities if abs(total - 1.0) <= _SUM_ROUNDING else probabilities / total


def check_rationality(rationality_per_m: float) -> None:
    """Refuse a rationality coefficient outside [0, 1e6] per metre, with an AutonomyError."""
    if not 0.0 <= rationality_per_m <= 1e6:
        raise AutonomyError(f"rationality_per_m is {rationality_per_m!r}; it must be in [0, 1e6] per metre")


def distances_m(points_m: FloatArray, goals_m: FloatArray) -> FloatArray:
    """Euclidean distances, (..., 3) to (G, 3) -> (..., G), metres.

    From differences, never from expanded squares: those lose eight digits next to a goal. One axis at a time, which
    is twice as fast as a sum over a last axis of three.
    """
    x = points_m[..., 0, None] - goals_m[:, 0]  # (..., G)
    y = points_m[..., 1, None] - goals_m[:, 1]
    z = points_m[..., 2, None] - goals_m[:, 2]
    x *= x
    y *= y
    z *= z
    x += y
    x += z
    return np.sqrt(x, out=x)
