"""The 27 directional actions: {-1, 0, 1} on each axis (paper IV-A), diagonals as long as axes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from app.autonomy.arrays import FloatArray, checked_momentum, frozen
from app.autonomy.errors import AutonomyError

Direction = tuple[int, int, int]

DIRECTIONS: tuple[Direction, ...] = tuple((x, y, z) for x, y, z in itertools.product((-1, 0, 1), repeat=3))
"""All actions, in the order of ``itertools.product((-1, 0, 1), repeat=3)``; the index is an action's name."""

ACTION_COUNT = 27
NULL_ACTION = 13
"""The index of (0, 0, 0): stay."""

AT_REST = 1e-9
"""A momentum shorter than this has no direction."""


def _unit_directions() -> FloatArray:
    directions = np.array(DIRECTIONS, dtype=np.float64)
    lengths = np.linalg.norm(directions, axis=1)
    lengths[NULL_ACTION] = 1.0
    return frozen(directions / lengths[:, None])


UNIT_DIRECTIONS: FloatArray = _unit_directions()
"""(27, 3), read-only: every move has length 1. Raw diagonals would move 1.73 times as far as axes."""


def index_of(direction: Sequence[int]) -> int:
    """The index of ``direction``, three integers of {-1, 0, 1}, in ``DIRECTIONS``.

    Raises:
        AutonomyError: any other value.
    """
    try:
        x, y, z = direction
        valid = x in (-1, 0, 1) and y in (-1, 0, 1) and z in (-1, 0, 1)
    except (TypeError, ValueError):
        valid = False
    if not valid:
        raise AutonomyError(f"direction is {direction!r}; it must be three numbers, each -1, 0 or 1")
    return int(9 * (x + 1) + 3 * (y + 1) + (z + 1))


def nearest_moves(momenta: FloatArray) -> npt.NDArray[np.intp]:
    """For momenta (..., 3), the index (...) of the move with the smallest angle to each; -1 when at rest."""
    # Some move is always within 55 degrees, so staying, with cosine 0, never comes first.
    cosines = momenta @ UNIT_DIRECTIONS.T  # (..., 27)
    at_rest = np.einsum("...i,...i->...", momenta, momenta) < AT_REST**2
    return np.where(at_rest, -1, cosines.argmax(axis=-1))


def nearest_action(momentum: npt.ArrayLike) -> int | None:
    """The move that continues ``momentum`` (3,): the one at the smallest angle, of any length; None at rest.

    Raises:
        AutonomyError: not three finite numbers of length <= 1.
    """
    if isinstance(momentum, tuple) and len(momentum) == 3 and type(momentum[0]) is float:  # as every tick has it
        x, y, z = momentum
    else:
        x, y, z = checked_momentum(momentum).tolist()
    return _nearest_action(x, y, z)


@lru_cache(maxsize=4096)
def _nearest_action(x: float, y: float, z: float) -> int | None:
    index = int(nearest_moves(checked_momentum((x, y, z))))
    return None if index < 0 else index
