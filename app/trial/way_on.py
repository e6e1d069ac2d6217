"""Which actions an arm that moves by itself may take, so that whatever is wanted next, it can go on.

A person may drive anywhere. With the hands off the arm keeps, where the study says `keep_way_on`, to places from which
it can go straight on to in front of the candidate goals (to above the bins). A goal more probable than all others
together is the *clear favourite*. The way to a goal is *open* from a place when the gripper could go straight from
there to in front of that goal, within reach and pushing nothing over. An action is taken if it can be done
(`app.trial.feasibility`) and the place it leads to is one of these:

1. *All ways are open* from there, and it is `MARGIN_M` away, along each axis, from where the arm's reach ends.
2. *It approaches the clear favourite*: that goal is nearer from there, and the way to it open.
3. *It is the way back*: where the arm is now, 1 does not hold, and at least half of where the action leads is nearer to
   the place where the arm started, the way to which stays open, or nearer to the distance from the robot at which that
   is. While no straight way leads to it because something stands in between, it is back towards the robot that counts.
   An open way to the clear favourite stays open. Where to go on in the direction of the last tick is a way back, no
   other way back is taken: a change of direction costs most of a tick, and an arm that went to and fro would hardly
   come out.

To stay is taken where the way to the clear favourite is open, or that margin is kept and the way to any goal is open:
whoever lines something up is left alone. So the arm, by itself, neither enters a pocket nor comes to rest in one; a
place where it cannot fold further is no optimum. Goals that the gripper cannot be in front of, such as one that has
fallen out of reach, do not count; when none is left, all actions that can be done may be taken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, index_of, nearest_action
from app.autonomy.belief import Belief
from app.autonomy.interface import State
from app.trial.feasibility import Feasibility
from sim.interface import SceneSpec, Vector3, WorldState
from sim.open_ways import Ways, has_margin

MARGIN_M = 0.03
"""What a person needs to go on in any direction: a tick or two."""
IN_FRONT_M = 0.10
"""How far in front of an object's grasp point the gripper lines up."""
CLEAR_FAVOURITE = 0.5
"""More than this, and a goal is more probable than all others together."""
_LEAST_M = 1e-9


class Gate:
    """Makes the question of each tick. What it rests on is kept for as long as it holds: an arm that stands asks the
    same in every tick, and the ways are the same ones as long as nothing else moves."""

    def __init__(self) -> None:
        self._of_ways: tuple[object, ...] = ()
        self._of_question: tuple[object, ...] = ()
        self._ways: Ways | None = None
        self._question: WayOn | None = None

    def question(
        self, feasible: Feasibility, state: State, belief: Belief, world: WorldState, scene: SceneSpec
    ) -> WayOn:
        """That of a tick."""
        of_ways = (world.objects, world.held, world.finger_opening_m, scene)
        if self._ways is None or of_ways != self._of_ways:
            self._of_ways, self._of_question = of_ways, ()
            self._ways = Ways(world, scene, _targets_m(state, scene))
        of_question = (state.position_m, state.momentum, belief)
        if self._question is None or of_question != self._of_question:
            self._of_question = of_question
            self._question = WayOn(feasible, state, belief, scene, self._ways)
        return self._question


def _targets_m(state: State, scene: SceneSpec) -> NDArray[np.float64]:
    """In front of the objects, or above the bins; the last one is where the arm started, (G + 1, 3)."""
    back_m = 0.0 if state.held is not None else IN_FRONT_M
    return np.vstack((state.goals_m - np.array((back_m, 0.0, 0.0)), scene.start_world_m))


class WayOn:
    """The question for one tick with the hands off. It is worked out as far as it is asked, and each action once."""

    def __init__(self, feasible: Feasibility, state: State, belief: Belief, scene: SceneSpec, ways: Ways) -> None:
        self._feasible, self._state, self._belief, self._scene, self._ways = feasible, state, belief, scene, ways
        self._answers: dict[int, bool] = {}

    def __call__(self, action: Sequence[int]) -> bool:
        """Whether the arm may take it by itself. Raises `AutonomyError` for what is no action."""
        index = index_of(action)
        if index not in self._answers:
            self._answers[index] = self._feasible(action) and self._leads_on(index)
        return self._answers[index]

    def _leads_on(self, index: int) -> bool:
        if not self._counts.any():
            return True
        if index == NULL_ACTION:
            return self._may_stay
        place_m = self._place_after(index)
        return self._approaches_favourite(place_m) or self._goes_back(index, place_m) or self._all_open(place_m)

    # ---- the rules ----------------------------------------------------------------------------------------------

    def _all_open(self, place_m: Vector3) -> bool:
        return has_margin(place_m, MARGIN_M) and bool(self._ways.open_from(place_m)[: self._start][self._counts].all())

    def _approaches_favourite(self, place_m: Vector3) -> bool:
        favourite = self._favourite
        if favourite is None:
            return False
        x_m, y_m, z_m = self._state.goals_m[favourite].tolist()
        goal_m, here_m = (x_m, y_m, z_m), self._state.position_m
        return math.dist(place_m, goal_m) < math.dist(here_m, goal_m) - _LEAST_M and self._is_open(place_m, favourite)

    def _goes_back(self, index: int, place_m: Vector3) -> bool:
        return (index == self._straight_back or self._straight_back is None) and self._is_way_back(place_m)

    def _is_way_back(self, place_m: Vector3) -> bool:
        here_m, start_m, favourite = self._state.position_m, self._scene.start_world_m, self._favourite
        half_m = math.dist(here_m, place_m) / 2.0
        if half_m < _LEAST_M or self._all_open_here:
            return False
        if favourite is not None and self._is_open(here_m, favourite) and not self._is_open(place_m, favourite):
            return False
        if self._back * (place_m[0] - here_m[0]) >= half_m:
            return True
        nearer_m = math.dist(here_m, start_m) - math.dist(place_m, start_m)
        return bool(self._here[1][self._start]) and nearer_m >= half_m and self._is_open(place_m, self._start)

    @cached_property
    def _may_stay(self) -> bool:
        here_m, favourite = self._state.position_m, self._favourite
        if favourite is not None and self._is_open(here_m, favourite):
            return True
        return has_margin(here_m, MARGIN_M) and bool(self._here[1][: self._start][self._counts].any())

    # ---- what they rest on --------------------------------------------------------------------------------------

    @property
    def _start(self) -> int:
        """The way to the arm's start, behind those to the goals."""
        return len(self._state.goal_ids)

    def _place_after(self, index: int) -> Vector3:
        x_m, y_m, z_m = self._state.position_m
        dx_m, dy_m, dz_m = self._feasible.way_m(index)
        return (x_m + dx_m, y_m + dy_m, z_m + dz_m)

    @cached_property
    def _counts(self) -> NDArray[np.bool_]:
        """Which goals the gripper can be in front of, (G,)."""
        return self._ways.possible[: self._start]

    @cached_property
    def _favourite(self) -> int | None:
        most = int(self._belief.probabilities.argmax())
        return most if self._belief.probabilities[most] > CLEAR_FAVOURITE and self._counts[most] else None

    @cached_property
    def _here(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which ways from here are within reach, and which are open."""
        return self._ways.looked_at_from(self._state.position_m)

    @cached_property
    def _back(self) -> float:
        """The way back along x: 1 is forward, -1 towards the robot, 0 neither, at about the distance of the start."""
        before_m = self._scene.start_world_m[0] - self._state.position_m[0]
        reach, is_open = (bool(of[self._start]) for of in self._here)
        if is_open and abs(before_m) <= MARGIN_M:
            return 0.0
        return 1.0 if before_m > 0.0 and (is_open or not reach) else -1.0

    @cached_property
    def _straight_back(self) -> int | None:
        """The action that goes on as in the last tick, if that can be done and is a way back."""
        index = nearest_action(self._state.momentum)
        if index is None or not self._is_way_back(self._place_after(index)):
            return None
        return index if self._feasible(DIRECTIONS[index]) else None

    @cached_property
    def _all_open_here(self) -> bool:
        is_open = bool(self._here[1][: self._start][self._counts].all())
        return is_open and has_margin(self._state.position_m, MARGIN_M)

    def _is_open(self, place_m: Vector3, which: int) -> bool:
        """The way from there to a goal, by its index, or to the start."""
        if place_m == self._state.position_m:
            return bool(self._here[1][which])
        return bool(self._ways.open_from(place_m, which)[0])
