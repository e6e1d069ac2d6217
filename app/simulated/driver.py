"""How a simulated participant drives: one tick's input from what is seen. Pure; the random stream is passed in.

Driving is made of movements. A movement has one direction along one or two axes and is held until the person thinks
they have come far enough, or stops to look. Between movements the hands are still for one to four ticks.

    what is seen ─► leg (which axes are to be brought where) ─► movement: direction, held for some ticks ─► look ─► …

- Direction: softmax over the sensible directions of progress per step (`rationality`) and habit, with one or two axes
  by habit (`two_axes`); sometimes plainly wrong (`slip`), which is noticed after a tick.
- Stopping: where the remaining way, misjudged by `eye_error`, is less than half a step; often late (`overshoot`).
- Near the target one goes in taps of one tick with a look after each (`fine_m`, `fine_pause`).
- A look ends at once when the arm, by itself, moves away from where it is wanted.
- Before the gripper is used one looks again a few times (`checks`).
- Each task finds a person in another state (`app.simulated.task_state`), who may back out and try again (`second_try`),
  lift high (`lift_m`), hold on after a press that came to nothing (`firmness`), and press a wrong button
  (`wrong_button`).
- A reading takes the hands away (`errand`): reaction, time away, and a moment before going on.

The driver knows nothing of the condition. Whatever the robot did meanwhile, it looks and goes on from there.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from app.autonomy.actions import Direction
from app.simulated.pilot import APPROACH_M, CLEARANCE_M, PRACTICE_OFFSET_M, STUCK_M, Point, Sight
from app.simulated.task_state import Course, TaskState
from app.simulated.traits import Traits
from app.trial.values import NO_INPUT, UserInput

STANDOFF_M = 0.012
"""So far short of the grasp point people stop: at it the palm would touch."""
DEEP_M = 0.065
"""Nearer to the object's depth than this, sideways motion would knock things over: back out first."""
DEEP_SPARE_M = 0.01
"""Nobody takes the place from which one lines up, give or take its tolerance, for too deep."""
AISLE_X_M = 0.67
"""Where things are carried sideways, in front of everything on the table, unless the layout says otherwise."""
AISLE_SHORT_M = 0.005
"""People keep so much off it, towards themselves."""
AISLE_TOLERANCE_M = 0.03
CROSSED_M = 0.15
ASIDE_M = 0.25
"""From here on, on the bin's side, one can cut the corner."""
BIN_TOLERANCE_M = 0.05
CARRY_TOLERANCE_M = 0.02
LIFT_MARGIN_M = 0.015
MOST_TRIES = 3
"""So often in one task somebody backs out because it does not look right."""
TOO_HIGH_M = 0.05
"""Higher than this above where things are carried, the arm folds too far to come back over the bins."""
_AXES = (0, 1, 2)
_PAUSE_MOST = 4
"""Ticks. One more would make a window of five; what keeps hands off that long is the reading."""


@dataclass
class _Movement:
    """One direction, held. `axes` are those it moves along, `errors_m` how far off their ends are judged."""

    direction: Direction
    errors_m: Point
    fine: bool
    ticks: int = 0
    wrong: bool = False


class _Leg(NamedTuple):
    """Where some axes are to be brought, and how exactly. `then` follows when all of them are there."""

    target_m: Point
    axes: tuple[int, ...]
    tolerance_m: float
    then: Literal["next", "again", "close", "open"]
    careful: bool = False
    """Whether the end is approached in taps."""
    moving_in: bool = False
    """Whether the object is straight ahead."""


class Driver:
    """One person at the controls of one trial or practice.

    `step_m` is how far the arm goes in a tick, `aisle_x_m` where the layout has things carried sideways, `tasks_before`
    how many tasks this person has done in the study.
    """

    def __init__(
        self,
        traits: Traits,
        rng: np.random.Generator,
        step_m: float,
        aisle_x_m: float = AISLE_X_M,
        tasks_before: int = 0,
    ) -> None:
        self._course = Course(traits, rng, tasks_before)
        self._buttons, self._tries, self._firm = rng.spawn(3)
        self._state: TaskState | None = None
        self._traits = traits
        """As they are in the task at hand."""
        self._tick = 0
        self._carrying = False
        self._depth_error_m = 0.0
        self._highest = False
        self._mixed_up = 0
        self._tries_left = 0
        self._tapped: tuple[Direction, float] | None = None
        self._back_m: Point | None = None
        """Where one goes back to, to come again."""
        self._rng = rng
        self._step_m = step_m
        self._aisle_x_m = round(aisle_x_m - AISLE_SHORT_M, 6)
        self._movement: _Movement | None = None
        self._still_ticks = 0
        self._checks_left: int | None = None
        self._away_ticks = 0
        self._carry_leg = 0
        self._rest_m: Point = (0.0, 0.0, 0.0)
        self._last_m: Point | None = None
        self._left_m: float | None = None
        self._stuck = 0
        self._barred: Direction | None = None

    # ---- the readings -------------------------------------------------------------------------------------------

    def leave(self, ticks: int) -> None:
        """Take the hands off for so many ticks, whatever was under way."""
        self._movement = None
        self._away_ticks = max(self._away_ticks, ticks)

    @property
    def away(self) -> bool:
        """Whether the person is at the readings."""
        return self._away_ticks > 0

    # ---- one tick -----------------------------------------------------------------------------------------------

    def act(self, object_id: str, sight: Sight) -> UserInput:
        """The input of the next tick."""
        self._turn_to(object_id, sight)
        sight = self._seen(sight)
        self._notice(sight)
        drifts = self._drifts(object_id, sight)
        if self._away_ticks:
            self._away_ticks -= 1
            self._forget()
            return NO_INPUT
        if sight.gripper == "moving":
            self._forget()
            return NO_INPUT
        if self._still_ticks and not drifts:
            self._still_ticks -= 1
            return NO_INPUT
        self._still_ticks = 0
        if self._movement is not None and self._goes_on(sight.position_m, self._leg(object_id, sight)):
            return self._press(self._movement, sight.position_m)
        if self._movement is not None:
            return self._stop(self._movement)
        return self._decide(object_id, sight, drifts)

    def _turn_to(self, object_id: str, sight: Sight) -> None:
        """Take up the task at hand, if it is another."""
        self._carrying = sight.held == object_id
        state = self._course.state(object_id, self._carrying, self._tick)
        self._tick += 1
        if state is not self._state:
            self._state, self._traits, self._mixed_up = state, state.traits, state.mixed_up
            self._depth_error_m, self._highest, self._tries_left = state.depth_error_m, False, MOST_TRIES

    def _seen(self, sight: Sight) -> Sight:
        """What one who is mixed up takes the aim to be: the same on the other side."""
        if not self._mixed_up:
            return sight
        if sight.held is None:
            return replace(sight, object_m=_other_side(sight.object_m))
        return sight if sight.release_m is None else replace(sight, release_m=_other_side(sight.release_m))

    def _notice(self, sight: Sight) -> None:
        """Whether the last press moved anything."""
        if self._last_m is not None and math.dist(self._last_m, sight.position_m) < STUCK_M:
            self._stuck += 1
            if self._stuck >= 2 and self._movement is not None:
                self._back_m = None
                self._highest = self._traits.lift_m > 0.0 and self._carrying  # too high for the arm: no higher
                self._barred, self._movement, self._stuck = self._movement.direction, None, 0
        else:
            self._stuck = 0
        self._last_m = None

    def _drifts(self, object_id: str, sight: Sight) -> bool:
        """Whether the arm, with hands still, moved away from where it is wanted since the last look."""
        goal_m = sight.release_m if sight.held == object_id and sight.release_m else sight.object_m
        left_m, before_m = math.dist(sight.position_m, goal_m), self._left_m
        self._left_m = left_m if self._movement is None else None
        return before_m is not None and left_m > before_m + STUCK_M

    def _forget(self) -> None:
        self._movement, self._checks_left, self._still_ticks, self._back_m = None, None, 0, None

    def _press(self, movement: _Movement, position_m: Point) -> UserInput:
        movement.ticks += 1
        if self._mixed_up and (movement.direction[1] or not self._carrying):
            self._mixed_up -= 1  # while it is lifted and pulled out nobody goes to a wrong side
        self._last_m = position_m
        return UserInput(direction=movement.direction)

    def _stop(self, movement: _Movement) -> UserInput:
        """End of a movement: hands still, for this tick and perhaps some more."""
        self._movement = None
        self._still_ticks = self._pause(self._traits.fine_pause if movement.fine else self._traits.pause) - 1
        return NO_INPUT

    def _pause(self, mean_ticks: float) -> int:
        """1 to `_PAUSE_MOST` ticks with that mean."""
        more = _PAUSE_MOST - 1
        return 1 + int(self._rng.binomial(more, min(max((mean_ticks - 1.0) / more, 0.0), 1.0)))

    # ---- what to do next ----------------------------------------------------------------------------------------

    def _decide(self, object_id: str, sight: Sight, drifts: bool) -> UserInput:
        if sight.held is not None and sight.held != object_id:
            return UserInput(gripper="open")  # the wrong one
        if sight.held is None and sight.gripper == "closed":
            return UserInput(gripper="open")  # missed, or let go
        leg = self._leg(object_id, sight)
        open_axes = self._open_axes(sight.position_m, leg)
        if open_axes:
            self._checks_left = None
            return self._begin(sight.position_m, leg, open_axes)
        if leg.then == "next":
            self._carry_leg += 1
            return self._decide(object_id, sight, drifts)
        if leg.then == "again":
            self._back_m = None
            return self._decide(object_id, sight, drifts)
        if self._mixed_up:
            self._mixed_up = 0
            return NO_INPUT  # on the spot at the latest one sees that it is the wrong one
        if drifts:
            self._checks_left = 0  # now or never
        elif self._checks_left is None:
            if self._tries_left and self._tries.random() < self._traits.second_try:
                self._tries_left -= 1
                self._back_m = self._withdrawn(sight)
                return self._decide(object_id, sight, drifts)
            self._checks_left = int(self._rng.poisson(self._traits.checks))
        if self._checks_left > 0:
            self._checks_left -= 1
            self._still_ticks = self._pause(self._traits.fine_pause) - 1
            return NO_INPUT
        self._checks_left = None
        return UserInput(gripper=leg.then)

    def _begin(self, position_m: Point, leg: _Leg, open_axes: tuple[int, ...]) -> UserInput:
        if self._buttons.random() < self._traits.wrong_button:
            return UserInput(gripper="open" if self._buttons.random() < 0.5 else "close")
        ways_m = tuple(leg.target_m[axis] - position_m[axis] for axis in _AXES)
        direction, wrong = self._choose(ways_m, open_axes)
        farthest_m = max(abs(ways_m[axis]) for axis in open_axes)
        x, y, z = (self._rng.standard_normal() * self._traits.eye_error * abs(ways_m[axis]) for axis in _AXES)
        holds_on = self._holds_on(direction, position_m)
        fine = leg.careful and farthest_m < self._traits.fine_m and not holds_on
        self._movement = _Movement(direction, (x, y, z), fine, wrong=wrong)
        return self._press(self._movement, position_m)

    def _holds_on(self, direction: Direction, position_m: Point) -> bool:
        """Whether to hold, and not tap, since what was last pressed that way came to nothing: the arm has undone it, or
        the controls were covered by a reading."""
        way_m = sum(part * here_m for part, here_m in zip(direction, position_m, strict=True))
        before, self._tapped = self._tapped, (direction, way_m)
        undone = before is not None and before[0] == direction and way_m < before[1] + STUCK_M
        return undone and bool(self._firm.random() < self._traits.firmness)

    def _choose(self, ways_m: tuple[float, ...], open_axes: tuple[int, ...]) -> tuple[Direction, bool]:
        """A direction along one or two of the open axes; True if it is a slip."""
        rng, traits = self._rng, self._traits
        two = len(open_axes) > 1 and rng.random() < traits.two_axes
        sets = list(itertools.combinations(open_axes, 2 if two else 1))
        if rng.random() < traits.slip:
            axis = int(rng.integers(3))
            return _along((-1.0, 1.0, -1.0) if rng.random() < 0.5 else (1.0, -1.0, 1.0), (axis,)), True
        sets = [axes for axes in sets if _along(ways_m, axes) != self._barred]
        self._barred = None
        if not sets:
            return self._sidestep(), True
        if len(sets) == 1:
            return _along(ways_m, sets[0]), False
        left_m = math.sqrt(sum(ways_m[axis] ** 2 for axis in open_axes))
        values = np.array(
            [
                traits.rationality * sum(abs(ways_m[axis]) for axis in axes) / (left_m * math.sqrt(len(axes)))
                + traits.habit * sum(traits.axis_taste[axis] for axis in axes) / len(axes)
                for axes in sets
            ]
        )
        chances = np.exp(values - values.max())
        index = int(np.searchsorted(np.cumsum(chances / chances.sum()), rng.random()))
        return _along(ways_m, sets[min(index, len(sets) - 1)]), False

    def _sidestep(self) -> Direction:
        """Nothing sensible can be done from here: try anywhere."""
        x, y, z = (int(value) for value in self._rng.integers(-1, 2, size=3))
        return (x, y, z) if (x, y, z) != (0, 0, 0) else (-1, 0, 0)

    def _goes_on(self, position_m: Point, leg: _Leg) -> bool:
        """Whether the movement under way is held for another tick."""
        movement = self._movement
        assert movement is not None
        if movement.wrong or movement.fine:
            return False
        if self._rng.random() < self._traits.look:
            return False
        for axis in _AXES:
            if movement.direction[axis]:
                left_m = (leg.target_m[axis] - position_m[axis]) * movement.direction[axis] + movement.errors_m[axis]
                if left_m <= self._step_m / 2.0:
                    return bool(self._rng.random() < self._traits.overshoot)
                if leg.moving_in and left_m <= self._traits.fine_m / 2.0:
                    return False  # nobody rams the object: the last way is tapped
        return True

    # ---- where to -----------------------------------------------------------------------------------------------

    def _open_axes(self, position_m: Point, leg: _Leg) -> tuple[int, ...]:
        """The leg's axes that are not yet where they should be."""
        reach_m = max(leg.tolerance_m, 0.55 * self._step_m)
        return tuple(axis for axis in leg.axes if abs(leg.target_m[axis] - position_m[axis]) > reach_m)

    def _withdrawn(self, sight: Sight) -> Point:
        """So far back, the way one came, as lining up is from the object: towards oneself, or from over the bin."""
        x_m, y_m, z_m = sight.position_m
        if not self._carrying or sight.release_m is None:
            return x_m - APPROACH_M, y_m, z_m
        return x_m, y_m - math.copysign(APPROACH_M, y_m), z_m

    def _leg(self, object_id: str, sight: Sight) -> _Leg:
        if self._back_m is not None:
            return _Leg(self._back_m, _AXES, CARRY_TOLERANCE_M, "again")
        if sight.held == object_id:
            return self._carry(sight)
        self._carry_leg = 0
        self._rest_m = sight.object_m
        return self._reach(sight)

    def _reach(self, sight: Sight) -> _Leg:
        """Line up in front of the object, then straight in; out again first when too deep beside it."""
        (x_m, y_m, z_m), here_m = sight.object_m, sight.position_m
        exact_m = max(self._traits.tolerance_m, 0.55 * self._step_m)
        aligned = abs(here_m[1] - y_m) <= exact_m and abs(here_m[2] - z_m) <= exact_m
        if aligned:
            target_m = (x_m - STANDOFF_M, y_m, z_m)
            between = target_m[0] - exact_m <= here_m[0] <= x_m + STANDOFF_M  # nothing is left but to close
            axes: tuple[int, ...] = () if between else (0,)
            return _Leg(target_m, axes, self._traits.tolerance_m, "close", careful=True, moving_in=True)
        line_up_x_m = x_m - APPROACH_M
        if here_m[0] > x_m - DEEP_M + max(self._depth_error_m, -DEEP_SPARE_M) and abs(here_m[1] - y_m) > 2.0 * exact_m:
            return _Leg((line_up_x_m, y_m, z_m), (0,), CARRY_TOLERANCE_M, "close")
        axes = (0, 1, 2) if here_m[0] < line_up_x_m else (1, 2)
        return _Leg((line_up_x_m, y_m, z_m), axes, self._traits.tolerance_m, "close", careful=True)

    def _carry(self, sight: Sight) -> _Leg:
        """Up and out from among the others, across, along to the bin; in practice just aside."""
        here_m, (_, rest_y_m, rest_z_m) = sight.position_m, self._rest_m
        if sight.release_m is None:
            up = _Leg((0.0, 0.0, rest_z_m + CLEARANCE_M), (2,), LIFT_MARGIN_M, "next")
            aside = _Leg((0.0, rest_y_m + PRACTICE_OFFSET_M, 0.0), (1,), CARRY_TOLERANCE_M, "next")
            down = _Leg((0.0, 0.0, rest_z_m), (2,), LIFT_MARGIN_M, "open")
            return (up, aside, down)[min(self._carry_leg, 2)]
        x_m, y_m, z_m = sight.release_m
        lifted_m = max(z_m, rest_z_m + CLEARANCE_M)
        aisle_x_m = self._aisle_x_m + self._depth_error_m
        aside_m = here_m[1] * (1.0 if y_m > 0.0 else -1.0)
        far = abs(here_m[1] - y_m) > BIN_TOLERANCE_M
        among = here_m[0] > aisle_x_m + AISLE_TOLERANCE_M
        if far and among and not self._highest:
            lifted_m = max(lifted_m, rest_z_m + CLEARANCE_M + self._traits.lift_m)
        if not -LIFT_MARGIN_M <= here_m[2] - lifted_m <= (LIFT_MARGIN_M if self._highest else TOO_HIGH_M):
            return _Leg((x_m, y_m, lifted_m), (2,), LIFT_MARGIN_M, "open")
        cornered = here_m[0] < aisle_x_m - AISLE_TOLERANCE_M and aside_m < CROSSED_M
        if far and (among or cornered):
            # Out from among the others, or from in front of the robot's chest, where the arm cannot cross.
            return _Leg((aisle_x_m, y_m, lifted_m), (0,), CARRY_TOLERANCE_M, "open")
        if far and aside_m < ASIDE_M:
            return _Leg((aisle_x_m, y_m, lifted_m), (1,), BIN_TOLERANCE_M, "open")
        return _Leg((x_m, y_m, lifted_m), (0, 1), BIN_TOLERANCE_M, "open", careful=True)


def _other_side(place_m: Point) -> Point:
    """What lies over there in the mirror."""
    return place_m[0], -place_m[1], place_m[2]


def _along(ways_m: tuple[float, ...], axes: tuple[int, ...]) -> Direction:
    x, y, z = ((1 if ways_m[axis] > 0.0 else -1) if axis in axes else 0 for axis in _AXES)
    return (x, y, z)
