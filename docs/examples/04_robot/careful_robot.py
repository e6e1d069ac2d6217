"""A robot of one's own: the kinematic one, but slow while it carries something.

Install it, and name it wherever a command takes a robot:

    pip install .
    salab simulate --robot careful --participants 2 --out pilot
    salab serve --robot careful --pace lockstep --no-scene

A robot is any class with the six methods of `sim.interface.Robot`; a simulator or an arm of your own can stand behind
them. What it promises: the same commands lead to the same states, and what it cannot do it says in its verdict instead
of doing something else. Here five of the six are taken over as they are.
"""

from __future__ import annotations

from dataclasses import replace

from sim.interface import MotionVerdict, RobotCommand
from sim.kinematic import KinematicRobot

CARRYING_M_S = 0.02
"""How fast it moves at most with something in the gripper."""


class CarefulRobot(KinematicRobot):
    """Everything as the kinematic robot, at no more than `CARRYING_M_S` while it carries."""

    def command(self, command: RobotCommand) -> MotionVerdict:
        if self.observe().held is not None:
            command = replace(command, speed_m_s=min(command.speed_m_s, CARRYING_M_S))
        return super().command(command)
