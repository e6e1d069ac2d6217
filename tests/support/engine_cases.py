"""A trial to run in tests: its set-up, somebody to drive it, and a robot that does what the test says."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from app.autonomy.actions import Direction
from app.autonomy.arbiters.weighing import WeighingArbiter
from app.autonomy.transition import TransitionModel
from app.simulated.pilot import Pilot, Sight
from app.trial.engine import TrialEngine
from app.trial.setup import StudySetup, study_setup
from app.trial.values import CycleSetup, EngineEvent, RobotTiming, TickResult, TrialSetup, UserInput
from app.trial.verdicts import release_points
from sim.interface import (
    SLICE_S,
    SLICES_PER_TICK,
    GripperState,
    MotionSegment,
    MotionVerdict,
    ObjectState,
    Pose,
    Robot,
    RobotCommand,
    SceneSpec,
    Vector3,
    WorldState,
)
from sim.kinematic import KinematicRobot
from sim.layouts import practice_scene
from sim.layouts import scene as layout_scene
from sim.objects import grasp_point
from study.records import TaskRow, TickRow
from tests.support.arbiter_cases import ArbiterCase, Condition, case_of
from tests.support.shipped_world import LAYOUTS, PRACTICE_OBJECT, STUDY_OBJECTS
from tests.support.study_samples import lab_study

ARC = LAYOUTS["arc"]
PLACEMENT = tuple(STUDY_OBJECTS)
PICKUPS = (("spray_bottle", "left_bin"), ("sponge_pack", "right_bin"), ("paper_towels", "left_bin"))
FORWARD, BACK, LEFT, RIGHT, UP, DOWN = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
OPEN, CLOSE = UserInput(gripper="open"), UserInput(gripper="close")
HANDS_OFF = UserInput()

Policy = Callable[[TrialEngine], UserInput]


@cache
def paper_study() -> StudySetup:
    """The study that shipped first, in its world, with its calibrated alpha."""
    return study_setup(lab_study())


def parameters(condition: Condition = "teleoperation", model: TransitionModel | None = None) -> ArbiterCase:
    """The arbiter's numbers: the study's own, apart from the transition model."""
    arbiter = paper_study().arbiter(condition)
    assert isinstance(arbiter, WeighingArbiter)
    own = case_of(condition, arbiter)
    return own if model is None else replace(own, transition=model)


def trial_setup(
    condition: str = "teleoperation",
    pickups: Sequence[tuple[str, str]] = PICKUPS,
    *,
    model: TransitionModel | None = None,
    timing: RobotTiming | None = None,
    **weights: float,
) -> TrialSetup:
    """A trial on the arc layout, objects in the order of the catalogue from left to right. `weights` are parameters of
    the arbiter that are others than the study's, such as `gamma`."""
    done: list[str] = []
    cycles = []
    for object_id, bin_id in pickups:
        remaining = [name for name in PLACEMENT if name not in done]
        cycles.append(CycleSetup(layout_scene(ARC, PLACEMENT, remaining), object_id, bin_id))
        done.append(object_id)
    study = paper_study()
    models, arbiter = study.models(condition), study.arbiters[condition]
    return TrialSetup(
        "p01",
        2,
        condition,
        "trial",
        tuple(cycles),
        replace(arbiter, parameters={**arbiter.parameters, **weights}),
        models=models if model is None else replace(models, transition=model),
        timing=timing or RobotTiming(),
    )


def practice_setup(condition: str = "teleoperation") -> TrialSetup:
    """The practice before a trial."""
    cycle = CycleSetup(practice_scene(ARC), PRACTICE_OBJECT.id, None)
    study = paper_study()
    return TrialSetup(
        "p01", 1, condition, "practice", (cycle,), study.arbiters[condition], models=study.models(condition)
    )


def opened(setup: TrialSetup, robot: Robot | None = None) -> TrialEngine:
    """An engine whose world stands."""
    engine = TrialEngine(setup, robot or KinematicRobot())
    engine.open()
    return engine


def rows_of(results: Sequence[TickResult]) -> list[TickRow]:
    return [result.row for result in results]


def tasks_of(results: Sequence[TickResult]) -> list[TaskRow]:
    return [task for result in results for task in result.tasks]


def events_of(results: Sequence[TickResult]) -> list[EngineEvent]:
    return [event for result in results for event in result.events]


def push(direction: Direction) -> UserInput:
    return UserInput(direction)


def run(engine: TrialEngine, inputs: Sequence[UserInput]) -> list[TickResult]:
    """One tick for each input, as long as the trial lasts."""
    results: list[TickResult] = []
    for user_input in inputs:
        if engine.finished:
            break
        results.append(engine.tick(user_input))
    return results


class Person:
    """Drives as the instruction says, on `target` instead of the instructed object when that is given."""

    def __init__(self, target: str | None = None) -> None:
        self._pilot = Pilot()
        self._target = target

    def __call__(self, engine: TrialEngine) -> UserInput:
        view, world = engine.view(), engine.world
        if view.phase == "reset":
            return HANDS_OFF
        name = self._target or view.object
        release_m = release_points(engine.scene.bins)[view.bin] if view.bin else None
        grasp_m = world.object(name).grasp_world_m
        return self._pilot.act(
            name, Sight(world.position_world_gripper_m, world.held, world.gripper, grasp_m, release_m)
        )


def drive(
    engine: TrialEngine, policy: Policy, until: Callable[[TickResult], bool] | None = None, at_most: int = 600
) -> list[TickResult]:
    """Ticks by `policy` until one satisfies `until` (else until the trial is over); fails if that takes too long."""
    results: list[TickResult] = []
    while not engine.finished:
        assert len(results) < at_most, f"still under way after {at_most} ticks: {engine.view()}"
        results.append(engine.tick(policy(engine)))
        if until is not None and until(results[-1]):
            break
    return results


def go_to(engine: TrialEngine, target_m: Sequence[float], axes: str = "xyz") -> list[TickResult]:
    """Along one axis after another, in the order given, to within a tick's way."""
    results = []
    for axis in ("xyz".index(letter) for letter in axes):
        while abs(gap := target_m[axis] - engine.world.position_world_gripper_m[axis]) > 0.012:
            direction = [0, 0, 0]
            direction[axis] = 1 if gap > 0 else -1
            results.append(engine.tick(push((direction[0], direction[1], direction[2]))))
            assert not results[-1].row.blocked, f"cannot go to {target_m} along {axes}"
    return results


def fly_to(engine: TrialEngine, target_m: Sequence[float]) -> list[TickResult]:
    """With what is held: up, in front of everything, sideways, and on to a place given by x, y and z."""
    return [
        *go_to(engine, (ARC.aisle_x_m, target_m[1], 0.91), "zxy"),
        *go_to(engine, target_m, "xz"),
    ]


def pick_up(engine: TrialEngine) -> list[TickResult]:
    """The instructed object, until the task is done."""
    return drive(engine, Person(), lambda result: any(task.kind == "pickup" for task in result.tasks))


Stage = Callable[["StagedRobot"], object]


class StagedRobot:
    """A robot whose world is what the test says: `stages[k]` changes it in the last slice of tick k.

    It moves as commanded, without limits; objects stay where they are put and the fingers obey within one tick.

    Attributes:
        commands: every command taken.
        limit: what becomes of a command; everything is executed by default.
    """

    def __init__(self, stages: dict[int, Stage] | None = None) -> None:
        self.commands: list[RobotCommand] = []
        self.limit: Callable[[RobotCommand], MotionVerdict] = lambda command: MotionVerdict(command.segments, False)
        self.lagging = False
        self.held: str | None = None
        self.gripper: GripperState = "open"
        self.position_m: Vector3 = (0.0, 0.0, 0.0)
        self.closed = 0
        self.scenes: list[SceneSpec] = []
        self._stages = stages or {}
        self._objects: dict[str, ObjectState] = {}
        self._slices = 0
        self._path: list[MotionSegment] = []
        self._speed_m_s = 0.0

    def hold(self, object_id: str | None, lifted_m: float = 0.0) -> None:
        """Hold an object that far above its rest, or nothing."""
        self.held = object_id
        if object_id is not None:
            x_m, y_m, z_m = self.scenes[-1].object(object_id).rest_pose.position_world_m
            self.put(object_id, (x_m, y_m, z_m + lifted_m), settled=False)

    def put_down(self, object_id: str) -> None:
        """Let go of an object; it is falling."""
        self.held = None
        self._objects[object_id] = replace(self._objects[object_id], settled=False)

    def put(self, object_id: str, position_m: Vector3, *, tilt_rad: float = 0.0, settled: bool = True) -> None:
        """An object's centre, tilted about y."""
        pose = Pose(position_m, (math.cos(tilt_rad / 2.0), 0.0, math.sin(tilt_rad / 2.0), 0.0))
        spec = self.scenes[-1].object(object_id).spec
        self._objects[object_id] = ObjectState(object_id, pose, grasp_point(spec, pose), settled)

    def reset(self, scene: SceneSpec) -> None:
        self.scenes.append(scene)
        self.held, self.gripper, self.position_m = None, "open", scene.start_world_m
        self._objects, self._path = {}, []
        for placed in scene.objects:
            self.put(placed.spec.id, placed.rest_pose.position_world_m)

    def command(self, command: RobotCommand) -> MotionVerdict:
        verdict = self.limit(command)
        self.commands.append(command)
        self._path = [
            MotionSegment(segment.direction, 1) for segment in verdict.executed for _ in range(segment.slices)
        ]
        self._speed_m_s = command.speed_m_s
        if command.gripper != "hold":
            self.gripper = "open" if command.gripper == "open" else "closed"
        return verdict

    def advance(self, slices: int = 1) -> None:
        for _ in range(slices):
            direction = self._path.pop(0).direction
            way_m = self._speed_m_s * SLICE_S
            x_m, y_m, z_m = self.position_m
            self.position_m = (x_m + way_m * direction[0], y_m + way_m * direction[1], z_m + way_m * direction[2])
            self._slices += 1
            tick, left = divmod(self._slices, SLICES_PER_TICK)
            if left == 0 and tick - 1 in self._stages:
                self._stages[tick - 1](self)

    def observe(self) -> WorldState:
        return WorldState(
            time_s=self._slices * SLICE_S,
            position_world_gripper_m=self.position_m,
            joint_positions_rad=(0.0,) * 7,
            finger_opening_m=0.1,
            gripper=self.gripper,
            held=self.held,
            lagging=self.lagging,
            objects=tuple(self._objects.values()),
        )

    def feasible(self, displacements_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.ones(len(displacements_m), dtype=np.bool_)

    def close(self) -> None:
        self.closed += 1
