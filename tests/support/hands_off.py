"""An arm that nobody drives: from any place of a layout, with any belief, tick after tick as a trial would have it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from app.autonomy.actions import Direction
from app.autonomy.belief import Belief
from app.autonomy.calibration import beliefs_of_entropy
from app.autonomy.interface import Arbiter, Feasible, State
from app.trial.feasibility import Feasibility
from app.trial.goals import Goals, candidates
from app.trial.motion import motion_segments, unit_direction
from app.trial.setup import StudySetup
from app.trial.values import STILL
from app.trial.way_on import Gate
from sim.interface import SLICES_PER_TICK, TICK_S, RobotCommand, SceneSpec, Vector3, WorldState
from sim.kinematic import KinematicRobot
from sim.layouts import scene as layout_scene
from sim.obstacles import Obstacles
from sim.open_ways import Ways

LOWEST_M, HIGHEST_M = (0.45, -0.58, 0.83), (0.90, 0.58, 1.0)
AISLE_X_M = 0.65


class PlacedRobot(KinematicRobot):
    """Begins where it is told to, with an object in its gripper if it is told so."""

    def put(self, position_m: Vector3, held: str | None) -> None:
        """After a reset."""
        self._position = position_m
        for thing in self._things:
            if thing.placed.spec.id == held:
                self._held, self._closing, self._opening_m = thing, True, thing.placed.spec.size_m[1]
                self._held_offset_m = (0.0, 0.0, thing.pose.position_world_m[2] - thing.state(0).grasp_world_m[2])
                thing.busy_until = math.inf


@dataclass(frozen=True)
class Done:
    """A tick without a person."""

    state: State
    action: Direction
    place_m: Vector3


class HandsOff:
    """One arm under one condition, `keep_way_on` or not."""

    def __init__(self, setup: StudySetup, condition: str, keep_way_on: bool) -> None:
        self._arbiter: Arbiter = setup.arbiter(condition)
        self._model = setup.models(condition).transition
        self._speed_m_s = setup.study.robot.speed_m_s
        self._setup, self._keep_way_on = setup, keep_way_on
        self.robot = PlacedRobot()

    def begin(self, rng: np.random.Generator, kind: str, objects: int = 6) -> None:
        """Anywhere a person could have come to straight from in front of the table, with any belief."""
        names = [str(name) for name in rng.permutation(self._setup.study.objects)]
        scene = layout_scene(self._setup.layout, names, names[:objects])
        held = names[int(rng.integers(objects))] if kind == "dropoff" else None
        self.robot.reset(scene)
        while True:
            x_m, y_m, z_m = rng.uniform(LOWEST_M, HIGHEST_M).tolist()
            self.robot.put((x_m, y_m, z_m), held)
            out_m = np.array([(min(x_m, AISLE_X_M), y_m, z_m), (x_m, y_m, z_m)])
            ways = Ways(out_m, Obstacles(self.robot.observe(), scene))
            if ways.possible.all() and ways.open_from((x_m, y_m, z_m)).all():
                break
        world = self.robot.observe()
        goals = Goals.at(candidates(world, scene))
        entropy = rng.uniform(0.3, 0.99, 1)
        self.start_with(scene, goals, Belief(goals.ids, beliefs_of_entropy(rng, len(goals.ids), entropy)[0]))

    def start_with(self, scene: SceneSpec, goals: Goals, belief: Belief) -> None:
        """The robot stands where it is to begin."""
        self.scene, self.goals, self.belief = scene, goals, belief
        self._momentum: Vector3 = STILL
        self._gate = Gate()

    @property
    def world(self) -> WorldState:
        return self.robot.observe()

    @property
    def state(self) -> State:
        world = self.world
        return State(world.position_world_gripper_m, self._momentum, self.goals.ids, self.goals.positions_m, world.held)

    def feasible(self) -> Feasibility:
        """What can be done, wherever it leads to."""
        return Feasibility(self.robot, self.world, self.scene, self._model, self._momentum, self._speed_m_s * TICK_S)

    def allowed(self) -> Feasible:
        """What the arbiter may choose now."""
        feasible = self.feasible()
        if not self._keep_way_on:
            return feasible
        return self._gate.question(feasible, self.state, self.belief, self.world, self.scene)

    def ticks(self, count: int) -> Iterator[Done]:
        for _ in range(count):
            state = self.state
            action = self._arbiter.decide(state, self.belief, None, self.allowed())
            segments = motion_segments(self._model, self._momentum, action)
            verdict = self.robot.command(RobotCommand(segments, self._speed_m_s))
            self.robot.advance(SLICES_PER_TICK)
            stopped = verdict.blocked or self.world.lagging or not any(action)
            kept = verdict.executed[-1].direction
            self._momentum = STILL if stopped else unit_direction(action) if kept == segments[-1].direction else kept
            yield Done(state, action, self.world.position_world_gripper_m)


def farthest_m(places_m: Sequence[Vector3]) -> float:
    """How far the first of some places is from any other."""
    return max(math.dist(places_m[0], place_m) for place_m in places_m)
