"""A robot of one's own: the kinematic one, in a room with a low ceiling.

Install it, and name it wherever a command takes a robot:

    pip install .
    salab simulate --robot low_ceiling --participants 2 --out pilot
    salab serve --robot low_ceiling --pace lockstep --no-scene

A robot is any class with the six methods of `sim.interface.Robot`; a simulator or an arm of your own can stand behind
them. Two promises matter most. The same commands lead to the same states. And what it cannot do it says: beforehand in
`feasible`, which the arbiter asks, and in the verdict of a `command`, whose reason the participant's page shows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim.interface import SLICE_S, SLICES_PER_TICK, MotionSegment, MotionVerdict, RobotCommand
from sim.kinematic import KinematicRobot

CEILING_M = 1.0
"""The gripper goes no higher, in the world frame."""

STAND_STILL = (MotionSegment((0.0, 0.0, 0.0), SLICES_PER_TICK),)


class LowCeilingRobot(KinematicRobot):
    """Everything as the kinematic robot, below `CEILING_M`."""

    def command(self, command: RobotCommand) -> MotionVerdict:
        slices = sum(segment.direction[2] * segment.slices for segment in command.segments)
        if not self._is_below(slices * command.speed_m_s * SLICE_S):
            super().command(replace(command, segments=STAND_STILL))  # the gripper's part is still done
            return MotionVerdict(STAND_STILL, blocked=True, reason="the ceiling is in the way")
        return super().command(command)

    def feasible(self, displacements_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        below = np.array([self._is_below(rise_m) for rise_m in displacements_m[:, 2]], dtype=np.bool_)
        return super().feasible(displacements_m) & below

    def _is_below(self, rise_m: float) -> bool:
        return self.observe().position_world_gripper_m[2] + rise_m <= CEILING_M
