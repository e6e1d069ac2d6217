"""What an arm felt when it was pressed against something: where, and which way it went no further. Pure.

It cannot see what stops it (a bin's wall, what is behind what it carries), so it remembers: an arm that moves by itself
would else go on as before, for ever.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interface import SLICE_S, Vector3

REMEMBERED_SLICES = round(10.0 / SLICE_S)
"""Things move on: what stood in the way may have fallen off the table."""
NEAR_M = 0.03
"""From farther away than this it is another thing that stops the arm, if any."""
INTO = 0.25
"""Least cosine of a motion that leads into what was felt: of the 26 directions, those that have a part of it."""


@dataclass(frozen=True)
class Felt:
    """One contact: where the gripper was, in which direction (of length 1) it could not go, and at which slice."""

    place_m: Vector3
    into: Vector3
    slice: int


class Touch:
    """What was felt lately; one for each world."""

    def __init__(self) -> None:
        self._felt: list[Felt] = []

    def feel(self, place_m: Vector3, wanted_m: Vector3, now: int) -> None:
        """The gripper is at `place_m` and does not come to `wanted_m`."""
        x, y, z = (there - here for here, there in zip(place_m, wanted_m, strict=True))
        length_m = math.hypot(x, y, z)
        if length_m > 0.0:
            self._felt = [*self._lately(now), Felt(place_m, (x / length_m, y / length_m, z / length_m), now)]

    def leads_into(self, place_m: Vector3, moves_m: NDArray[np.float64], now: int) -> NDArray[np.bool_]:
        """Which displacements, shape (N, 3), from there lead into what was felt; shape (N,)."""
        moves_m = np.asarray(moves_m, dtype=np.float64).reshape(-1, 3)
        into = [felt.into for felt in self._lately(now) if math.dist(felt.place_m, place_m) < NEAR_M]
        if not into:
            return np.zeros(len(moves_m), dtype=np.bool_)
        lengths_m = np.linalg.norm(moves_m, axis=1)
        ways = moves_m @ np.array(into).T  # (N, contacts)
        leads: NDArray[np.bool_] = (ways > INTO * np.maximum(lengths_m, 1e-12)[:, None]).any(axis=1)
        return leads

    def _lately(self, now: int) -> list[Felt]:
        return [felt for felt in self._felt if now - felt.slice < REMEMBERED_SLICES]
