"""T(x, u): what one action does to the state x = (position, momentum) (paper III-A).

The momentum is "the currently active movement plan's direction": while a new plan is made, the arm still
follows the old one. Two models of that delay:

- ``mix``: for the share tau of the step the arm still follows the old direction,
  p' = p + step (tau m + (1 - tau) u).
- ``replan``: the arm stops and plans anew at each change of direction, so that continuing moves the full step
  and any other direction (1 - d) of it; staying moves nothing.

In both, m' = u. tau and d are ``planning_delay``, a share of one tick.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from app.autonomy.actions import ACTION_COUNT, UNIT_DIRECTIONS, nearest_moves
from app.autonomy.arrays import FloatArray, checked_momenta, checked_momentum, checked_points_m, frozen
from app.autonomy.errors import AutonomyError

TransitionKind = Literal["mix", "replan"]

MAX_STEP_M = 10.0


@dataclass(frozen=True)
class TransitionModel:
    """The arbiter's model of the arm, not the arm itself.

    Args:
        kind: ``mix`` or ``replan``.
        step_m: length of one modelled step in metres, in (0, 10]; the paper's largest Cartesian step is 0.05.
        planning_delay: share of a tick lost to planning, in [0, 1].

    Raises:
        AutonomyError: a value outside these bounds.
    """

    kind: TransitionKind = "mix"
    step_m: float = 0.05
    planning_delay: float = 0.2

    def __post_init__(self) -> None:
        if self.kind not in get_args(TransitionKind):
            raise AutonomyError(f"kind is {self.kind!r}; choose one of {', '.join(get_args(TransitionKind))}")
        if not 0.0 < self.step_m <= MAX_STEP_M:
            raise AutonomyError(f"step_m is {self.step_m!r}; it must be in (0, {MAX_STEP_M:g}] metres")
        if not 0.0 <= self.planning_delay <= 1.0:
            raise AutonomyError(f"planning_delay is {self.planning_delay!r}; it must be in [0, 1] of a tick")

    def displacements(self, momentum: npt.ArrayLike) -> FloatArray:
        """p' - p in metres for each of the 27 actions: (..., 3) -> (..., 27, 3).

        Raises:
            AutonomyError: a momentum that is not finite or longer than 1.
        """
        if isinstance(momentum, tuple) and len(momentum) == 3 and type(momentum[0]) is float:  # as every tick has it
            x, y, z = momentum
            return _here_and_next(self, (x, y, z))[1]
        momenta = checked_momenta(momentum)
        if momenta.shape == (3,):
            return _displacements_of_one(self, momenta.tobytes())
        return self._displacements(momenta)

    def here_and_next(self, momentum: tuple[float, float, float]) -> FloatArray:
        """Staying where one is, and then the ``displacements`` of one momentum, an axis at a time: (3, 28, 1), metres,
        read-only."""
        return _here_and_next(self, momentum)[0]

    def displacements_ahead(self) -> FloatArray:
        """p'' - p' in metres of each of the person's 27 actions after each of the arm's 27, read-only:
        (27 of the person, 27 of the arm, 3). An action leaves its own momentum, so this is the same everywhere."""
        return _displacements_ahead(self)

    def _displacements(self, momenta: FloatArray) -> FloatArray:
        if self.kind == "mix":
            kept = (self.step_m * self.planning_delay) * momenta[..., None, :]  # (..., 1, 3)
            return kept + (self.step_m * (1.0 - self.planning_delay)) * UNIT_DIRECTIONS
        continues = np.arange(ACTION_COUNT) == nearest_moves(momenta)[..., None]  # (..., 27)
        lengths_m = np.where(continues, self.step_m, self.step_m * (1.0 - self.planning_delay))
        return lengths_m[..., None] * UNIT_DIRECTIONS

    def next_positions(self, position_world_m: npt.ArrayLike, momentum: npt.ArrayLike) -> FloatArray:
        """p' of T(x, u) for every action u: (..., 3) -> (..., 27, 3), world frame, metres.

        ``position_world_m`` and ``momentum`` may be one state or a batch; their leading shapes broadcast.

        Raises:
            AutonomyError: values that are not finite, or a momentum longer than 1.
        """
        positions_m = checked_points_m("position_world_m", position_world_m)
        return positions_m[..., None, :] + self.displacements(momentum)


@lru_cache(maxsize=4096)
def _here_and_next(model: TransitionModel, momentum: tuple[float, float, float]) -> tuple[FloatArray, FloatArray]:
    """As `here_and_next`, and the displacements alone, (27, 3)."""
    next_m = model.displacements(np.array(checked_momentum(momentum)))
    both_m = np.concatenate((np.zeros((1, 3)), next_m))
    return frozen(np.ascontiguousarray(both_m.T)[..., None]), next_m


@lru_cache(maxsize=4096)
def _displacements_of_one(model: TransitionModel, momentum: bytes) -> FloatArray:
    """Read-only, (27, 3): an arm has few momenta, and asks for the same ones tick after tick."""
    return frozen(model._displacements(np.frombuffer(momentum)))


@lru_cache(maxsize=64)
def _displacements_ahead(model: TransitionModel) -> FloatArray:
    return frozen(np.ascontiguousarray(model._displacements(UNIT_DIRECTIONS).swapaxes(0, 1)))
