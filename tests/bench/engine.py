"""What one tick costs: the arbiter's decision, and both robots under the trial engine. See `tests.bench`.

Seconds are those of the processor: nothing here waits, and a busy machine should not change the figures.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from app.autonomy.actions import DIRECTIONS, UNIT_DIRECTIONS, Direction
from app.autonomy.arbiters.weighing import WeighingArbiter
from app.autonomy.belief import Belief
from app.autonomy.evaluation import state_of
from app.autonomy.inference.boltzmann import Boltzmann
from app.autonomy.interface import State as SeenState
from app.autonomy.transition import TransitionModel
from app.simulated.pilot import Pilot, Sight
from app.trial.engine import TrialEngine
from app.trial.robots import ROBOTS, make_robot
from app.trial.setup import StudySetup, study_setup
from app.trial.values import TrialSetup, UserInput
from app.trial.world import open_study
from sim.interface import TICK_S
from study.definition.study import orders, plan_session
from tests.bench.figure import Figure
from tests.support.arbiter_cases import CONDITIONS, ArbiterCase, evaluate
from tests.support.literal_reference import evaluate_literal

GOALS, MANY_GOALS = 6, 1000
STATES = 60
REPEATS = 5
IDLE_TICKS = 120
WORLDS = 10
SEED = 7
PARTS = EMPTY_HANDED, CARRYING, FINGERS, RESET = (
    "empty-handed",
    "carrying",
    "fingers move, object settles",
    "arm resets",
)


# ---- decisions --------------------------------------------------------------------------------------------------

State = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Direction | None]
"""Position, momentum, goals, belief, user action."""
Case = TypeVar("Case")


def decision_figures() -> Iterator[Figure]:
    """Milliseconds over the same random states: in whole, as a tick needs it, and literally."""
    rng = np.random.default_rng(SEED)
    parameters = ArbiterCase("balanced", alpha=400.0, transition=TransitionModel("mix"))
    states = [_state(rng, away=number % 2 == 0) for number in range(STATES)]
    whole_ms = _median_ms(lambda state: evaluate(*state, parameters), states, REPEATS)
    plain = [
        (position_m.tolist(), momentum.tolist(), goals_m.tolist(), belief.tolist(), user)
        for position_m, momentum, goals_m, belief, user in states[:20]
    ]
    literal_ms = _median_ms(lambda state: evaluate_literal(*state, parameters), plain, 1)
    yield Figure(f"whole evaluation, {GOALS} goals, model mix", f"{whole_ms:.3f} ms")
    yield Figure("literal equations, same states", f"{literal_ms:.1f} ms")
    yield Figure("times faster", f"{literal_ms / whole_ms:.0f}", "12 or more")
    for condition in CONDITIONS:
        held = replace(parameters, condition=condition)
        for away in (False, True):
            chosen = [state for state in states if (state[-1] is None) == away]
            light_ms = _median_ms(_choice, [_asked(held.arbiter, state) for state in chosen], REPEATS)
            hands = "hands off" if away else "hands on"
            aim = "0.05 ms or less" if away else ""
            yield Figure(f"what a tick works out: {condition}, {hands}", f"{light_ms:.3f} ms", aim)
    many = [_state(rng, away=True, goals=MANY_GOALS) for _ in range(STATES // 4)]
    many_ms = _median_ms(_choice, [_asked(parameters.arbiter, state) for state in many], REPEATS)
    yield Figure(
        f"what a tick works out: balanced, hands off, {MANY_GOALS:,} goals", f"{many_ms:.2f} ms", "2 ms or less"
    )
    yield from _bound_figures(rng)


def _bound_figures(rng: np.random.Generator) -> Iterator[Figure]:
    """What no evaluation of all 27 x 27 pairs of actions can do without: a root and an exponential of each goal."""
    for goals in (GOALS, MANY_GOALS):
        at_once = min(goals, 20)  # what stays near the processor
        numbers = rng.random((len(DIRECTIONS) ** 2, at_once))
        bound_ms = goals / at_once * _median_ms(lambda numbers: np.exp(np.sqrt(numbers)), [numbers], 50)
        yield Figure(f"bound: its roots and exponentials alone, {goals:,} goals", f"{bound_ms:.3f} ms")


@dataclass(frozen=True)
class _Asked:
    """What inference and arbiter are asked in a tick, made ready as the trial has it ready: both parts, the state, and
    the belief from the tick before."""

    inference: Boltzmann
    arbiter: WeighingArbiter
    state: SeenState
    belief: Belief
    user: Direction | None


def _asked(arbiter: WeighingArbiter, state: State) -> _Asked:
    position_m, momentum, goals_m, prior, user = state
    seen = state_of(position_m, momentum, goals_m)
    belief = Belief(seen.goal_ids, prior)
    return _Asked(Boltzmann(Boltzmann.Parameters(), arbiter.models), arbiter, seen, belief, user)


def _choice(asked: _Asked) -> Direction:
    belief = asked.inference.update(asked.state, asked.belief, asked.user)
    return asked.arbiter.decide(asked.state, belief, asked.user, lambda action: True)


def _state(rng: np.random.Generator, away: bool, goals: int = GOALS) -> State:
    user = None if away else DIRECTIONS[rng.integers(len(DIRECTIONS))]
    momentum = UNIT_DIRECTIONS[rng.integers(len(UNIT_DIRECTIONS))]
    goals_m = rng.uniform((0.75, -0.42, 0.83), (0.85, 0.42, 0.90), (goals, 3))
    return rng.uniform((0.65, -0.35, 0.83), (0.9, 0.35, 0.93)), momentum, goals_m, rng.dirichlet(np.ones(goals)), user


def _median_ms(work: Callable[[Case], object], states: Sequence[Case], repeats: int) -> float:
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
    """Whole pick-and-place cycles by the scripted pilot in the full scene of six objects, and their parts.

    A trial of three cycles in each condition, from building the world to the object at rest in the bin. Simulated
    seconds over those of the processor, user and system, of this one process.
    """
    setup = study_setup(open_study(None))
    for name in reversed([name for name in ROBOTS.names if not ROBOTS.lacking(name)]):
        times_s: dict[str, list[float]] = defaultdict(list)
        outcomes: list[str] = []
        for condition in CONDITIONS:
            outcomes += _drive(name, first_trial(setup, condition), times_s)
        opening_s = sum(times_s.pop("opening"))
        ticks = sum(map(len, times_s.values()))
        yield Figure(
            f"{name}: whole cycles, building worlds included",
            _speed(ticks, sum(map(sum, times_s.values())) + opening_s),
            "60 x or more" if name in ROBOTS.libraries else "25,000 /s or more",
        )
        yield Figure(f"{name}: tasks that succeeded", f"{outcomes.count('success')} of {len(outcomes)}")
        for part in PARTS:
            share = len(times_s[part]) / ticks
            yield Figure(f"{name}: {part} ({share:.0%} of the ticks)", _speed(len(times_s[part]), sum(times_s[part])))
        yield Figure(f"{name}: building a world", f"{1e3 * _building_s(name, first_trial(setup, 'balanced')):.1f} ms")
        for condition in ("teleoperation", "balanced"):
            idle_s = _idle_s(name, first_trial(setup, condition))
            yield Figure(f"{name}: idle, hands off, {condition}", _speed(IDLE_TICKS, idle_s))


def _speed(ticks: int, seconds: float) -> str:
    return f"{ticks / seconds:.0f} /s = {ticks / seconds * TICK_S:.0f} x"


def first_trial(setup: StudySetup, condition: str) -> TrialSetup:
    """The trial that is timed in a condition."""
    order = next(order for order in orders(setup.study) if order[0] == condition)
    return setup.trial_setup("bench", plan_session(setup.study, order, SEED), 1, "trial")


def _drive(robot_name: str, trial: TrialSetup, times_s: dict[str, list[float]]) -> list[str]:
    """A whole trial: adds the seconds of each tick to its part of a cycle; returns the tasks' outcomes."""
    robot = make_robot(robot_name)
    outcomes: list[str] = []
    started_s = time.process_time()
    engine = TrialEngine(trial, robot)
    engine.open()
    times_s["opening"].append(time.process_time() - started_s)
    pilot = pilots_input(trial)
    while not engine.finished:
        act, world = pilot(engine), engine.world
        started_s = time.process_time()
        result = engine.tick(act)
        passed_s = time.process_time() - started_s
        part = {"gripper": FINGERS, "reset": RESET}.get(result.row.source, CARRYING if world.held else EMPTY_HANDED)
        times_s[part].append(passed_s)
        outcomes += [task.outcome for task in result.tasks]
    robot.close()
    return outcomes


def pilots_input(trial: TrialSetup) -> Callable[[TrialEngine], UserInput]:
    """What the scripted pilot does in the next tick of a trial."""
    pilot = Pilot(trial.timing.speed_m_s * TICK_S)

    def act(engine: TrialEngine) -> UserInput:
        view, world = engine.view(), engine.world
        if view.phase != "operating":
            return UserInput()
        release_m = engine.scene.bin(view.bin or "").release_world_m
        grasp_m = world.object(view.object).grasp_world_m
        position_m = world.position_world_gripper_m
        return pilot.act(view.object, Sight(position_m, world.held, world.gripper, grasp_m, release_m))

    return act


def _building_s(robot_name: str, trial: TrialSetup) -> float:
    """Seconds to build the world of a cycle, in a robot that has had one before."""
    robot = make_robot(robot_name)
    engine = TrialEngine(trial, robot)
    engine.open()
    started_s = time.process_time()
    for _ in range(WORLDS):
        robot.reset(engine.scene)
    passed_s = time.process_time() - started_s
    robot.close()
    return passed_s / WORLDS


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
