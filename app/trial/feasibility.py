"""Which actions the arm can do from where it is, without pushing anything over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.autonomy.actions import index_of
from app.autonomy.transition import TransitionModel
from sim.clearance import clearance
from sim.interface import Robot, SceneSpec, Vector3, WorldState


class Feasibility:
    """The question for one tick. It is worked out as far as it is asked, and each action once."""

    def __init__(
        self,
        robot: Robot,
        world: WorldState,
        scene: SceneSpec,
        model: TransitionModel,
        momentum: Vector3,
        reach_m: float,
    ) -> None:
        """`reach_m`: how far the arm goes in a tick."""
        self._robot, self._world, self._scene = robot, world, scene
        self._model, self._momentum, self._reach_m = model, momentum, reach_m
        self._answers: dict[int, bool] = {}

    def __call__(self, action: Sequence[int]) -> bool:
        """Whether the arm can do it. Raises `AutonomyError` for what is no action."""
        index = index_of(action)
        if index not in self._answers:
            self._answers[index] = self._is_clear(index) and bool(
                self._robot.feasible(self._ways_m[index : index + 1])[0]
            )
        return self._answers[index]

    def way_m(self, index: int) -> Vector3:
        """Where an action takes the gripper within the tick, from where it is."""
        x_m, y_m, z_m = self._ways_m[index].tolist()
        return (x_m, y_m, z_m)

    @cached_property
    def _ways_m(self) -> NDArray[np.float64]:  # (27, 3)
        ways_m: NDArray[np.float64] = self._reach_m / self._model.step_m * self._model.displacements(self._momentum)
        return ways_m

    @cached_property
    def _pushes_nothing(self) -> Callable[[Vector3], bool]:
        return clearance(self._world, self._scene)

    def _is_clear(self, index: int) -> bool:
        return self._pushes_nothing(self.way_m(index))
