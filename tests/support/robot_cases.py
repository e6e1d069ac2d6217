"""Where a robot can be, for tests of layouts and robots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim import ik


def reachable(positions_world_gripper_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which positions, shape (N, 3), the gripper can be at; shape (N,)."""
    within: NDArray[np.bool_] = ik.solve_many(positions_world_gripper_m)[1] == 0
    return within
