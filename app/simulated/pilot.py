"""A scripted user: the plainest way to do a pick-and-place, for tests and for `salab bot`.

It sees what a person sees (positions, what is held, the instruction) and answers with one tick's input. It is no model
of a person; those are the simulated participants.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from app.autonomy.actions import Direction
from app.trial.values import UserInput

Point = tuple[float, float, float]

APPROACH_M = 0.10
"""How far in front of an object the gripper lines up before it moves in."""
CLEARANCE_M = 0.06
"""How far an object is lifted at least before it is carried."""
CARRY_X_M = 0.66
"""How far from the robot things are carried sideways: in front of everything on the table."""
STUCK_M = 0.001
"""An arm that moved less than this in a tick did not move."""
STUCK_TICKS = 3
BACK_OUT_TICKS = 3
PRACTICE_OFFSET_M = 0.16
"""How far to the side the practice object is put down."""


@dataclass(frozen=True)
class Sight:
    """What is seen before a tick. Positions in the world frame, metres."""

    position_m: Point
    held: str | None
    gripper: Literal["open", "closed", "moving"]
    object_m: Point
    """Grasp point of the instructed object."""
    release_m: Point | None
    """Where to let go; None in practice: anywhere else on the table."""


class Pilot:
    """Lines up, moves in, grasps, lifts, carries and lets go, one thing after another.

    `step_m` is how far the arm moves in one tick; positions within 0.6 of it count as reached.
    """

    def __init__(self, step_m: float = 0.02) -> None:
        self._near_m = 0.6 * step_m
        self._rest_m: Point = (0.0, 0.0, 0.0)
        self._legs_done = 0
        self._was_m: Point | None = None
        self._stuck_ticks = 0
        self._backing_ticks = 0

    def act(self, object_id: str, sight: Sight) -> UserInput:
        """The input for the next tick.

        With the hands off an arbiter may bring a carried object close before the robot, where there is a hole in the
        arm's reach. When it does not move any more there, it is first driven out, away from the robot.
        """
        unmoved = self._was_m is not None and all(
            abs(here - was) < STUCK_M for here, was in zip(sight.position_m, self._was_m, strict=True)
        )
        self._stuck_ticks = self._stuck_ticks + 1 if unmoved else 0
        self._was_m = None
        carried_too_close = sight.held == object_id and sight.position_m[0] < CARRY_X_M
        if self._stuck_ticks >= STUCK_TICKS and carried_too_close:
            self._stuck_ticks, self._backing_ticks = 0, BACK_OUT_TICKS
        act = self._next(object_id, sight)
        if self._backing_ticks and act.gripper is None:
            self._backing_ticks -= 1
            act = UserInput((1, 0, 0))
        if act.direction is not None:
            self._was_m = sight.position_m
        return act

    def _next(self, object_id: str, sight: Sight) -> UserInput:
        if sight.held == object_id:
            return self._carry(sight)
        self._legs_done = 0
        if sight.gripper == "moving":
            return UserInput()
        if sight.gripper == "closed":
            return UserInput(gripper="open")
        self._rest_m = sight.object_m
        return self._reach(sight)

    def _reach(self, sight: Sight) -> UserInput:
        x_m, y_m, z_m = sight.object_m
        aligned = self._near(sight.position_m[1], y_m) and self._near(sight.position_m[2], z_m)
        if not aligned:
            line_up_x_m = min(sight.position_m[0], x_m - APPROACH_M)
            if not self._near(sight.position_m[0], line_up_x_m):
                return self._move(sight, (line_up_x_m, sight.position_m[1], sight.position_m[2]))
            return self._move(sight, (sight.position_m[0], y_m, z_m))
        if not self._near(sight.position_m[0], x_m):
            return self._move(sight, sight.object_m)
        return UserInput(gripper="close")

    def _carry(self, sight: Sight) -> UserInput:
        """Up, out from among the others, sideways, along, down, open: each leg along one axis, in that order."""
        _, rest_y_m, rest_z_m = self._rest_m
        legs: tuple[tuple[int, float], ...]
        if sight.release_m is None:
            legs = ((2, rest_z_m + CLEARANCE_M), (1, rest_y_m + PRACTICE_OFFSET_M), (2, rest_z_m))
        else:
            x_m, y_m, z_m = sight.release_m
            legs = ((2, max(z_m, rest_z_m + CLEARANCE_M)), (0, CARRY_X_M), (1, y_m), (0, x_m), (2, z_m))
        while self._legs_done < len(legs):
            axis, value_m = legs[self._legs_done]
            if not self._near(sight.position_m[axis], value_m):
                target_m = list(sight.position_m)
                target_m[axis] = value_m
                return self._move(sight, (target_m[0], target_m[1], target_m[2]))
            self._legs_done += 1
        if sight.release_m is not None and not all(map(self._near, sight.position_m, sight.release_m)):
            self._legs_done = 1  # moved off meanwhile, by somebody else
            return self._carry(sight)
        return UserInput(gripper="open")

    def _move(self, sight: Sight, target_m: Point) -> UserInput:
        x, y, z = (
            0 if self._near(here, there) else (1 if there > here else -1)
            for here, there in zip(sight.position_m, target_m, strict=True)
        )
        direction: Direction = (x, y, z)
        return UserInput(direction if any(direction) else None)

    def _near(self, here_m: float, there_m: float) -> bool:
        return abs(here_m - there_m) <= self._near_m
