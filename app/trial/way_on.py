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

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, Direction, index_of, nearest_action
from app.autonomy.belief import Belief
from app.autonomy.interface import Feasible, State
from app.trial.feasibility import Feasibility
from sim.interface import SceneSpec, Vector3, WorldState
from sim.obstacles import Obstacles
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
        self._ways: Ways | None = None
        self._ways_of: tuple[Obstacles, NDArray[np.float64], SceneSpec] | None = None
        self._of_question: tuple[object, ...] = ()
        self._question: WayOn | None = None

    def question(
        self, feasible: Feasibility, state: State, belief: Belief, world: WorldState, scene: SceneSpec
    ) -> Feasible:
        """That of a tick; nothing is looked at before it is asked."""
        made: WayOn | None = None

        def may(action: Direction) -> bool:
            nonlocal made
            if made is None:
                made = self._now(feasible, state, belief, world, scene)
            return made(action)

        return may

    def _now(self, feasible: Feasibility, state: State, belief: Belief, world: WorldState, scene: SceneSpec) -> WayOn:
        of_question = (state.position_m, state.momentum, belief, world.objects, world.held, scene)
        if self._question is None or of_question != self._of_question:
            self._of_question = of_question
            self._question = WayOn(feasible, state, belief, scene, self._ways_now(feasible.obstacles, state, scene))
        return self._question

    def _ways_now(self, obstacles: Obstacles, state: State, scene: SceneSpec) -> Ways:
        before = self._ways_of
        if (
            self._ways is None
            or before is None
            or before[0] is not obstacles
            or before[1] is not state.goals_m
            or before[2] is not scene
            or not (state.held is None or self._ways.is_settled)
        ):
            self._ways_of = obstacles, state.goals_m, scene
            self._ways = Ways(_targets_m(state, scene), obstacles)
        return self._ways


def _targets_m(state: State, scene: SceneSpec) -> NDArray[np.float64]:
    """In front of the objects, or above the bins; the last one is where the arm started, (G + 1, 3)."""
    back_m = 0.0 if state.held is not None else IN_FRONT_M
    return np.vstack((state.goals_m - np.array((back_m, 0.0, 0.0)), scene.start_world_m))


class WayOn:
    """The question for one tick with the hands off. It is worked out as far as it is asked, and each action once."""

    def __init__(self, feasible: Feasibility, state: State, belief: Belief, scene: SceneSpec, ways: Ways) -> None:
        self._feasible, self._state, self._belief, self._scene, self._ways = feasible, state, belief, scene, ways
        self._answers: dict[int, bool] = {}
        self._ways_open: dict[tuple[Vector3, int], bool] = {}

    def __call__(self, action: Sequence[int]) -> bool:
        """Whether the arm may take it by itself. Raises `AutonomyError` for what is no action."""
        index = index_of(action)
        if index not in self._answers:
            self._answers[index] = self._feasible(action) and self._leads_on(index)
        return self._answers[index]

    def _leads_on(self, index: int) -> bool:
        if not any(self._counts):
            return True
        if index == NULL_ACTION:
            return self._may_stay
        place_m = self._place_after(index)
        return self._approaches_favourite(place_m) or self._goes_back(index, place_m) or self._all_open(place_m)

    # ---- the rules ----------------------------------------------------------------------------------------------

    def _all_open(self, place_m: Vector3) -> bool:
        return has_margin(place_m, MARGIN_M) and self._ways.are_open(place_m, self._start)

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
        return nearer_m >= half_m and self._is_open(here_m, self._start) and self._is_open(place_m, self._start)

    @cached_property
    def _may_stay(self) -> bool:
        here_m, favourite = self._state.position_m, self._favourite
        if favourite is not None and self._is_open(here_m, favourite):
            return True
        return has_margin(here_m, MARGIN_M) and self._ways.is_any_open(here_m, self._start)

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
    def _counts(self) -> list[bool]:
        """Which goals the gripper can be in front of."""
        counts: list[bool] = self._ways.possible[: self._start].tolist()
        return counts

    @cached_property
    def _favourite(self) -> int | None:
        most = int(self._belief.probabilities.argmax())
        return most if self._belief.probabilities[most] > CLEAR_FAVOURITE and self._counts[most] else None

    @cached_property
    def _back(self) -> float:
        """The way back along x: 1 is forward, -1 towards the robot, 0 neither, at about the distance of the start."""
        here_m = self._state.position_m
        before_m, is_open = self._scene.start_world_m[0] - here_m[0], self._is_open(here_m, self._start)
        if is_open and abs(before_m) <= MARGIN_M:
            return 0.0
        return 1.0 if before_m > 0.0 and (is_open or not self._ways.is_reached(here_m, self._start)) else -1.0

    @cached_property
    def _straight_back(self) -> int | None:
        """The action that goes on as in the last tick, if that can be done and is a way back."""
        index = nearest_action(self._state.momentum)
        if index is None or not self._is_way_back(self._place_after(index)):
            return None
        return index if self._feasible(DIRECTIONS[index]) else None

    @cached_property
    def _all_open_here(self) -> bool:
        return self._all_open(self._state.position_m)

    def _is_open(self, place_m: Vector3, which: int) -> bool:
        """The way from there to a goal, by its index, or to the start."""
        if (place_m, which) not in self._ways_open:
            self._ways_open[place_m, which] = self._ways.is_open(place_m, which)
        return self._ways_open[place_m, which]
