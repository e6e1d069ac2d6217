"""Where an arm stands when the hands leave it: states and beliefs on which alpha rests (`calibrated_on = "visited"`).

A plain person drives through the study's own layouts with pure teleoperation: along one axis or two at a time, up to in
front of the instructed object and on to it; then with it out, across, and to above the instructed bin. A reading may
call them away in any tick. What is met then, the place, the momentum, the goals and the belief, is a visit.

The person is made of what the study file says and of nothing else: no trait of simulated participants, no physics. So
alpha is the same in every lab and worker, and in the next version, for the same study file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from app.autonomy.actions import UNIT_DIRECTIONS, Direction, index_of
from app.autonomy.arrays import FloatArray
from app.autonomy.belief import Belief
from app.autonomy.calibration import Visit
from app.autonomy.inference.boltzmann import Boltzmann
from app.autonomy.interface import Models, NoParameters, State
from sim.interface import Vector3
from sim.layouts import Layout

CYCLES = 90
TWO_AXES = 0.5
"""Share of movements along two axes at once, where two are left to go."""
STOPS = 0.04
"""Share of ticks after which a movement ends before it is there."""
CALLED_AWAY = 0.25
"""For each tick of driving, ticks spent at a reading: five seconds of every twenty."""
PAUSE = 3
"""Ticks with the hands off after each movement. In the first one the arm still has its direction, then it rests."""
IN_FRONT_M, LIFT_M = 0.10, 0.06
NEAR_STEPS = 0.55
_STILL: Vector3 = (0.0, 0.0, 0.0)


def visits(
    layout: Layout, objects: Sequence[str], bins: Sequence[str], pickups: int, models: Models, way_m: float, seed: int
) -> list[Visit]:
    """Those of `CYCLES` pickups and dropoffs; `way_m` is how far the arm goes in a tick."""
    rng = np.random.default_rng(seed)
    found: list[Visit] = []
    specs = {spec.id: spec for spec in layout.objects}
    release_m = {item.id: item.release_world_m for item in layout.bins}
    walker = _Walker(rng, models, way_m)
    for cycle in range(CYCLES):
        placed = [str(name) for name in rng.permutation(list(objects))]
        grasps_m = {
            name: (x_m, y_m, layout.table.top_z_m + specs[name].grasp_height_m)
            for name, (x_m, y_m) in zip(placed, layout.places, strict=False)
        }
        left = dict(list(grasps_m.items())[cycle % pickups :])
        goal_m = list(left.values())[int(rng.integers(len(left)))]
        x_m, y_m, z_m = goal_m
        to_object = ((x_m - IN_FRONT_M, y_m, z_m), goal_m)
        found += walker.walk(layout.start_world_m, to_object, np.array(list(left.values())))
        bin_m = release_m[str(rng.choice(list(bins)))]
        high_m = max(bin_m[2], z_m + LIFT_M)
        to_bin = ((x_m, y_m, high_m), (layout.aisle_x_m, y_m, high_m), (layout.aisle_x_m, bin_m[1], high_m), bin_m)
        found += walker.walk(goal_m, to_bin, np.array([release_m[name] for name in bins]))
    return found


class _Walker:
    """One person, who is not quick and makes no mistakes."""

    def __init__(self, rng: np.random.Generator, models: Models, way_m: float) -> None:
        self._rng, self._models = rng, models
        self._inference = Boltzmann(NoParameters(), models)
        self._share = way_m / models.transition.step_m
        self._near_m = NEAR_STEPS * way_m

    def walk(self, start_m: Vector3, places_m: Sequence[Vector3], goals_m: FloatArray) -> Iterator[Visit]:
        """What is met on the way from one place to another, and another; the belief begins anew."""
        names = tuple(str(number) for number in range(len(goals_m)))
        here, momentum, belief = np.array(start_m), _STILL, Belief.uniform(names)
        for place_m in places_m:
            while open_axes := [axis for axis in range(3) if abs(place_m[axis] - here[axis]) > self._near_m]:
                two = len(open_axes) > 1 and self._rng.random() < TWO_AXES
                axes = self._rng.permutation(open_axes)[: 2 if two else 1].tolist()
                action = _along(np.array(place_m) - here, axes)
                momentum = _STILL
                while all((place_m[axis] - here[axis]) * action[axis] > self._near_m for axis in axes):
                    x_m, y_m, z_m = here.tolist()
                    belief = self._inference.update(State((x_m, y_m, z_m), momentum, names, goals_m), belief, action)
                    moved_m = self._models.transition.displacements(momentum)[index_of(action)]
                    here, momentum = here + self._share * moved_m, _unit(action)
                    if self._rng.random() < CALLED_AWAY:
                        yield Visit(here, np.array(_STILL), goals_m, belief.probabilities)
                    if self._rng.random() < STOPS:
                        break
                for tick in range(PAUSE):
                    yield Visit(here, np.array(_STILL if tick else momentum), goals_m, belief.probabilities)


def _along(way_m: FloatArray, axes: Sequence[int]) -> Direction:
    x, y, z = (int(math.copysign(1, way_m[axis])) if axis in axes else 0 for axis in range(3))
    return (x, y, z)


def _unit(action: Direction) -> Vector3:
    x, y, z = UNIT_DIRECTIONS[index_of(action)].tolist()
    return (x, y, z)
