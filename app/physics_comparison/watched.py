"""A robot that is watched: it does what the robot does, and counts which objects are moved without being held."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim.interface import MotionVerdict, Robot, RobotCommand, SceneSpec, Vector3, WorldState

MOVED_M = 0.01
"""An object farther than this from where it stood was moved."""


@dataclass
class World:
    """What became of the objects between two resets."""

    stood: dict[str, Vector3]
    moved: set[str] = field(default_factory=set)
    held: set[str] = field(default_factory=set)

    @property
    def pushed(self) -> int:
        """How many objects were moved that the fingers never held: pushed aside, or knocked over."""
        return len(self.moved - self.held)


class WatchedRobot:
    """A `Robot` around another one. `worlds` has one for each reset."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.worlds: list[World] = []

    def reset(self, scene: SceneSpec) -> None:
        """As the robot's; a world more is watched."""
        self._robot.reset(scene)
        objects = self._robot.observe().objects
        self.worlds.append(World({item.id: item.pose.position_world_m for item in objects}))

    def command(self, command: RobotCommand) -> MotionVerdict:
        """As the robot's."""
        return self._robot.command(command)

    def advance(self, slices: int = 1) -> None:
        """As the robot's."""
        self._robot.advance(slices)

    def observe(self) -> WorldState:
        """As the robot's; what has moved is noted."""
        state = self._robot.observe()
        if self.worlds:
            world = self.worlds[-1]
            if state.held is not None:
                world.held.add(state.held)
            for item in state.objects:
                if math.dist(item.pose.position_world_m, world.stood[item.id]) > MOVED_M:
                    world.moved.add(item.id)
        return state

    def feasible(self, displacements_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """As the robot's."""
        return self._robot.feasible(displacements_m)

    def close(self) -> None:
        """As the robot's."""
        self._robot.close()
