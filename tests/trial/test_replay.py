"""Same inputs, same rows, bit for bit; and a trial can be taken up again at any cycle from its log."""

from __future__ import annotations

import pickle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.autonomy.actions import DIRECTIONS
from app.trial.engine import TrialEngine
from app.trial.values import (
    CycleStart,
    RobotTiming,
    TickResult,
    TrialSetup,
    UserInput,
    cycle_from_json,
    cycle_to_json,
    inputs_of,
)
from sim.interface import SLICES_PER_TICK, Pose
from sim.kinematic import KinematicRobot
from tests.support.arbiter_cases import CONDITIONS
from tests.support.engine_cases import (
    CLOSE,
    FORWARD,
    HANDS_OFF,
    Person,
    drive,
    opened,
    push,
    run,
    trial_setup,
)

MOVES = [direction for direction in DIRECTIONS if any(direction)]
INPUTS = st.builds(
    UserInput,
    direction=st.one_of(st.none(), st.sampled_from(MOVES)),
    gripper=st.sampled_from([None, None, None, None, "open", "close"]),
    seq=st.one_of(st.none(), st.integers(0, 10_000)),
    after_pause=st.sampled_from([False] * 9 + [True]),
)


class RandomPerson(Person):
    """Does the job with interruptions: what is drawn now and then comes in place of the next step."""

    def __init__(self, drawn: list[UserInput]) -> None:
        super().__init__()
        self._drawn = list(drawn)
        self._ticks = 0

    def __call__(self, engine: TrialEngine) -> UserInput:
        self._ticks += 1
        if self._ticks % 3 == 0 and self._drawn:
            return self._drawn.pop()
        return super().__call__(engine)


def recorded(setup: TrialSetup, drawn: list[UserInput]) -> list[TickResult]:
    """Up to 300 ticks of somebody unsteady: most get through a cycle or two."""
    engine, person = opened(setup), RandomPerson(drawn)
    results: list[TickResult] = []
    while not engine.finished and len(results) < 300:
        results.append(engine.tick(person(engine)))
    return results


def rerun(setup: TrialSetup, start: CycleStart, logged: list[TickResult]) -> list[TickResult]:
    """Those ticks again, from the log's rows alone, in a new engine with a new robot."""
    engine = TrialEngine(setup, KinematicRobot(), start)
    engine.open()
    return run(engine, [inputs_of(result.row) for result in logged])


@settings(max_examples=6, deadline=None)
@given(condition=st.sampled_from(CONDITIONS), drawn=st.lists(INPUTS, max_size=30))
def test_a_log_re_run_from_any_cycle_gives_the_same_rows_tasks_and_events(
    condition: str, drawn: list[UserInput]
) -> None:
    setup = trial_setup(condition)
    results = recorded(setup, drawn)
    starts = [CycleStart(), *(result.cycle_start for result in results if result.cycle_start)]
    for start in starts:
        logged = results[start.first_tick :]
        again = rerun(setup, cycle_from_json(cycle_to_json(start)), logged)
        assert again == logged


def test_the_property_above_meets_cycles_pauses_and_presses() -> None:
    """It would be worth little if no example got past the first object."""
    drawn = [UserInput(FORWARD, None, 7, True), push((1, 1, 0)), HANDS_OFF] * 4
    results = recorded(trial_setup("balanced"), drawn)
    assert sum(result.cycle_start is not None for result in results) >= 1
    assert {row.source for row in (result.row for result in results)} == {"user", "robot", "gripper", "reset"}
    assert any(result.row.after_pause for result in results)


def test_a_tick_in_slices_is_the_tick_at_once() -> None:
    whole, sliced = opened(trial_setup("balanced")), opened(trial_setup("balanced"))
    person = Person()
    while not whole.finished:
        user_input = person(whole)
        sliced.begin(user_input)
        for _ in range(SLICES_PER_TICK):
            sliced.advance()
        assert sliced.end() == whole.tick(user_input)
    assert sliced.finished


def test_looking_at_the_world_between_slices_changes_nothing() -> None:
    plain, watched = opened(trial_setup("balanced")), opened(trial_setup("balanced"))
    for user_input in [push(FORWARD), HANDS_OFF, CLOSE, HANDS_OFF, push(FORWARD)]:
        watched.begin(user_input)
        before = {watched.world.digest()}
        for _ in range(SLICES_PER_TICK):
            watched.advance()
            watched.view()
            assert watched.world.digest() not in before  # its time alone has moved on
            before.add(watched.world.digest())
        assert watched.end() == plain.tick(user_input)


@pytest.mark.parametrize(
    "user_input",
    [
        HANDS_OFF,
        UserInput((1, 0, -1), None, 12),
        UserInput((0, 0, 0), None, 12),
        UserInput(None, "close", 3),
        UserInput(None, None, 3, after_pause=True),
    ],
)
def test_a_row_gives_back_the_input_it_was_made_from(user_input: UserInput) -> None:
    assert inputs_of(opened(trial_setup()).tick(user_input).row) == user_input


def test_what_was_ignored_is_not_in_the_row_and_does_not_matter() -> None:
    """A direction during a press, a press while the fingers are busy: the row tells what was acted on."""
    inputs = [UserInput(FORWARD, "close"), UserInput(FORWARD, "open"), push(FORWARD)]
    results = run(opened(trial_setup()), inputs)
    assert [inputs_of(result.row) for result in results] == [CLOSE, HANDS_OFF, push(FORWARD)]
    assert rerun(trial_setup(), CycleStart(), results) == results


def test_different_inputs_give_different_digests() -> None:
    ends = {run(opened(trial_setup()), [push(direction)])[0].row.digest for direction in MOVES}
    assert len(ends) == len(MOVES)


def test_a_cycle_start_says_where_what_was_delivered_lies() -> None:
    engine = opened(trial_setup())
    start = drive(engine, Person(), lambda result: result.cycle_start is not None)[-1].cycle_start
    assert start is not None
    again = TrialEngine(trial_setup(), KinematicRobot(), start)
    again.open()
    assert (again.cycle, again.next_tick) == (2, start.first_tick)
    assert dict(again.delivered) == dict(engine.delivered) != {}
    assert again.view() == engine.view()
    assert again.world == engine.world


def test_a_cycle_start_survives_the_store() -> None:
    odd = CycleStart(3, 141, (("sponge_pack", Pose((0.1 + 0.2, -0.0, 1e-17), (0.5, 0.5, 0.5, -0.5))),))
    assert cycle_from_json(cycle_to_json(odd)) == odd
    assert cycle_from_json(cycle_to_json(CycleStart())) == CycleStart()


def test_what_crosses_to_a_worker_can_be_pickled() -> None:
    setup = trial_setup("balanced", timing=RobotTiming(reset_ticks=7))
    assert pickle.loads(pickle.dumps(setup)) == setup
    result = opened(setup).tick(push(FORWARD))
    assert pickle.loads(pickle.dumps(result)) == result
