"""Which actions the arm can do from where it is, without pushing anything over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from app.autonomy.actions import index_of
from app.autonomy.arrays import frozen
from app.autonomy.transition import TransitionModel
from sim.clearance import clearance
from sim.interface import Robot, SceneSpec, Vector3, WorldState
from sim.obstacles import Obstacles


class Surroundings:
    """What stands around the gripper, kept for as long as nothing moves but the gripper and what it holds."""

    def __init__(self) -> None:
        self._obstacles: Obstacles | None = None

    def obstacles(self, world: WorldState, scene: SceneSpec) -> Obstacles:
        """That of a tick."""
        known = self._obstacles
        self._obstacles = Obstacles(world, scene) if known is None else known.as_in(world, scene)
        return self._obstacles


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
        surroundings: Surroundings | None = None,
    ) -> None:
        """`reach_m`: how far the arm goes in a tick. `surroundings`: kept from tick to tick."""
        self._robot, self._world, self._scene = robot, world, scene
        self._way_of = model, momentum, reach_m
        self._ways_m: tuple[NDArray[np.float64], tuple[Vector3, ...]] | None = None
        self._surroundings = surroundings
        self._obstacles: Obstacles | None = None
        self._answers: dict[int, bool] = {}

    def __call__(self, action: Sequence[int]) -> bool:
        """Whether the arm can do it. Raises `AutonomyError` for what is no action."""
        index = index_of(action)
        if index not in self._answers:
            self._answers[index] = self._is_clear(index) and bool(
                self._robot.feasible(self._displacements_m[index : index + 1])[0]
            )
        return self._answers[index]

    def way_m(self, index: int) -> Vector3:
        """Where an action takes the gripper within the tick, from where it is."""
        if self._ways_m is None:
            self._ways_m = _ways_m(*self._way_of)
        return self._ways_m[1][index]

    @property
    def _displacements_m(self) -> NDArray[np.float64]:  # (27, 3)
        if self._ways_m is None:
            self._ways_m = _ways_m(*self._way_of)
        return self._ways_m[0]

    @property
    def obstacles(self) -> Obstacles:
        """What stands around."""
        if self._obstacles is None:  # no `cached_property`: before Python 3.12 it takes a lock, longer than the rest
            self._obstacles = (self._surroundings or Surroundings()).obstacles(self._world, self._scene)
        return self._obstacles

    @cached_property
    def _pushes_nothing(self) -> Callable[[Vector3], bool]:
        return clearance(self._world, self._scene)

    def _is_clear(self, index: int) -> bool:
        x_m, y_m, z_m = self._world.position_world_gripper_m
        way_m = self.way_m(index)
        told = self.obstacles.pushes_nothing(x_m, y_m, z_m, way_m)
        return self._pushes_nothing(way_m) if told is None else told


@lru_cache(maxsize=256)  # few momenta, the same ones tick after tick
def _ways_m(
    model: TransitionModel, momentum: Vector3, reach_m: float
) -> tuple[NDArray[np.float64], tuple[Vector3, ...]]:
    """Where each action takes the gripper, (27, 3), as an array and as numbers; read-only."""
    ways_m = frozen(reach_m / model.step_m * model.displacements(momentum))
    return ways_m, tuple((x_m, y_m, z_m) for x_m, y_m, z_m in ways_m.tolist())
