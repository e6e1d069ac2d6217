"""A trial of the paper's study with a part under test: the kinematic robot, and a scripted person who also lets go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

from app.simulated.pilot import Pilot, Sight
from app.trial.engine import TrialEngine
from app.trial.setup import study_setup
from app.trial.values import NO_INPUT, CycleStart, TickResult, TrialSetup, UserInput, inputs_of
from app.trial.verdicts import release_points
from app.trial.world import open_study
from sim.kinematic import KinematicRobot
from study.definition.study import orders, plan_session
from study.parts.shelf import Named
from study.records import TickRow

SEED = 2020
MOST_TICKS = 600
"""An arbiter that leads away from everything is not followed for ever."""
HANDS_OFF_EVERY, IN_THE_FIRST, OF_TICKS = 4, 24, 72
"""When the person lets go. Nobody who is led away all the time ever arrives, so there are ticks without."""


@cache
def _shipped() -> TrialSetup:
    setup = study_setup(open_study(None))
    order = orders(setup.study)[0]
    return setup.trial_setup("P001", plan_session(setup.study, order, SEED), 1, "trial")


def trial_with(part: Named) -> TrialSetup:
    """A trial's set-up with that arbiter, or that inference under a helpful arbiter."""
    if part.kind == "inference":
        return replace(_shipped(), inference=part, arbiter=Named("arbiter", "goal_oriented", {}))
    return replace(_shipped(), arbiter=part)


def drive(setup: TrialSetup) -> list[TickResult]:
    """The trial, driven. Raises `PartFault`."""
    pilot, robot = Pilot(), KinematicRobot()
    engine = TrialEngine(setup, robot)
    engine.open()
    results: list[TickResult] = []
    while not engine.finished and len(results) < MOST_TICKS:
        results.append(engine.tick(_input(engine, pilot)))
        engine.explain()
    robot.close()
    return results


def _input(engine: TrialEngine, pilot: Pilot) -> UserInput:
    view, world = engine.view(), engine.world
    if view.phase == "reset":
        return NO_INPUT
    release_m = release_points(engine.scene.bins)[view.bin] if view.bin else None
    grasp_m = world.object(view.object).grasp_world_m
    sight = Sight(world.position_world_gripper_m, world.held, world.gripper, grasp_m, release_m)
    act = pilot.act(view.object, sight)
    tick = engine.next_tick
    lets_go = tick % HANDS_OFF_EVERY == 0 and tick % OF_TICKS < IN_THE_FIRST and act.gripper is None
    return NO_INPUT if lets_go else act


def rerun(setup: TrialSetup, rows: Sequence[TickRow], start: CycleStart | None = None) -> list[TickRow]:
    """What becomes of the same inputs, from the first tick or from a cycle's start. Raises `PartFault`."""
    robot = KinematicRobot()
    engine = TrialEngine(setup, robot, start)
    engine.open()
    again = []
    for row in rows[engine.next_tick :]:
        if engine.finished:
            break
        again.append(engine.tick(inputs_of(row)).row)
    robot.close()
    return again
