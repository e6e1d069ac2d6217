"""What one tick costs: the arbiter's decision, and both robots under the trial engine. See tests/bench.py.

Seconds are those of the processor: nothing here waits, and a busy machine should not change the figures.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from app.autonomy.actions import DIRECTIONS, UNIT_DIRECTIONS
from app.autonomy.arbiter import ArbiterParameters, choose, evaluate
from app.autonomy.transition import TransitionModel
from app.parts import ROBOTS, make_robot
from app.pilot import Pilot, Sight
from app.planning import StudySetup, study_setup
from app.trial import TrialEngine
from app.trial_values import OperatorInput, TrialSetup
from app.variants import open_study
from sim.interface import TICK_S
from study.design import orders, plan_session
from tests.bench import Figure
from tests.literal_reference import evaluate_literal

GOALS = 6
STATES = 60
REPEATS = 5
IDLE_TICKS = 120
SEED = 7


# ---- decisions --------------------------------------------------------------------------------------------------


def decision_figures() -> Iterator[Figure]:
    """Milliseconds over the same random states: in whole, as a tick needs it, and literally."""
    rng = np.random.default_rng(SEED)
    parameters = ArbiterParameters("balanced", alpha=400.0, transition=TransitionModel("mix"))
    states = [_state(rng, away=number % 2 == 0) for number in range(STATES)]
    whole_ms = _median_ms(lambda state: evaluate(*state, parameters), states, REPEATS)
    literal_ms = _median_ms(lambda state: evaluate_literal(*state, parameters), states[:20], 1)
    yield Figure(f"whole evaluation, {GOALS} goals, model mix", f"{whole_ms:.3f} ms")
    yield Figure("literal equations, same states", f"{literal_ms:.1f} ms")
    yield Figure("times faster", f"{literal_ms / whole_ms:.0f}", "12 or more")
    for condition in ("teleoperation", "goal_oriented", "balanced"):
        held = replace(parameters, condition=condition)
        for away in (False, True):
            chosen = [state for state in states if (state[-1] is None) == away]
            light_ms = _median_ms(lambda state, held=held: choose(*state, held), chosen, REPEATS)
            hands = "hands off" if away else "hands on"
            yield Figure(f"what a tick works out: {condition}, {hands}", f"{light_ms:.3f} ms")


def _state(rng: np.random.Generator, away: bool) -> tuple[Any, ...]:
    """Position, momentum, goals, belief, user action."""
    user = None if away else DIRECTIONS[rng.integers(len(DIRECTIONS))]
    momentum = UNIT_DIRECTIONS[rng.integers(len(UNIT_DIRECTIONS))]
    goals_m = rng.uniform((0.75, -0.42, 0.83), (0.85, 0.42, 0.90), (GOALS, 3))
    return rng.uniform((0.65, -0.35, 0.83), (0.9, 0.35, 0.93)), momentum, goals_m, rng.dirichlet(np.ones(GOALS)), user


def _median_ms(work: Callable[[Any], object], states: Sequence[Any], repeats: int) -> float:
    work(states[0])
    times_s = []
    for _ in range(repeats):
        for state in states:
            started_s = time.process_time()
            work(state)
            times_s.append(time.process_time() - started_s)
    return 1e3 * statistics.median(times_s)


# ---- robots -----------------------------------------------------------------------------------------------------


def robot_figures() -> Iterator[Figure]:
    """Ticks per second in the full scene of six objects; real time has two."""
    setup = study_setup(open_study(None))
    for name in reversed(ROBOTS):
        times_s, outcomes = _driven(name, _trial(setup, "balanced"))
        total_s, ticks = sum(map(sum, times_s.values())), sum(map(len, times_s.values()))
        yield Figure(
            f"{name}: a trial of three cycles, building worlds included",
            _speed(ticks, total_s),
            "60 x or more" if name == "bullet" else "",
        )
        yield Figure(f"{name}: tasks that succeeded", f"{outcomes.count('success')} of {len(outcomes)}")
        for source in ("user", "gripper", "reset"):
            yield Figure(f"{name}: ticks of source {source}", _speed(len(times_s[source]), sum(times_s[source])))
        for condition in ("teleoperation", "balanced"):
            yield Figure(f"{name}: hands off, {condition}", _speed(IDLE_TICKS, _idle_s(name, _trial(setup, condition))))


def _speed(ticks: int, seconds: float) -> str:
    return f"{ticks / seconds:.0f} /s = {ticks / seconds * TICK_S:.0f} x"


def _trial(setup: StudySetup, condition: str) -> TrialSetup:
    order = next(order for order in orders(setup.study) if order[0] == condition)
    return setup.trial_setup("bench", plan_session(setup.study, order, SEED), 1, "trial")


def _driven(robot_name: str, trial: TrialSetup) -> tuple[dict[str, list[float]], list[str]]:
    """Seconds of each tick by source, and the tasks' outcomes."""
    robot = make_robot(robot_name)
    times_s: dict[str, list[float]] = defaultdict(list)
    outcomes = []
    started_s = time.process_time()
    engine = TrialEngine(trial, robot)
    engine.open()
    times_s["opening"].append(time.process_time() - started_s)
    pilot = Pilot(trial.timing.speed_m_s * TICK_S)
    while not engine.finished:
        view, world = engine.view(), engine.world
        act = OperatorInput()
        if view.phase == "operating":
            release_m = engine.scene.bin(view.bin or "").release_world_m
            grasp_m = world.object(view.object).grasp_world_m
            position_m = world.position_world_gripper_m
            act = pilot.act(view.object, Sight(position_m, world.held, world.gripper, grasp_m, release_m))
        started_s = time.process_time()
        result = engine.tick(act)
        times_s[result.row.source].append(time.process_time() - started_s)
        outcomes += [task.outcome for task in result.tasks]
    robot.close()
    return times_s, outcomes


def _idle_s(robot_name: str, trial: TrialSetup) -> float:
    """Seconds of so many ticks without input from the start."""
    robot = make_robot(robot_name)
    engine = TrialEngine(trial, robot)
    engine.open()
    started_s = time.process_time()
    for _ in range(IDLE_TICKS):
        engine.tick()
    passed_s = time.process_time() - started_s
    robot.close()
    return passed_s
