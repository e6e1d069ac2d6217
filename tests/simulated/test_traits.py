"""Simulated people: traits that differ, streams of their own, and hands that behave as said."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.errors import LabError
from app.simulated.answers import Experience, SimulatedPerson
from app.simulated.driver import Driver
from app.simulated.pilot import Sight
from app.simulated.task_state import MIDDLE_TASK, Course, practised, tasks_before, tired
from app.simulated.trait_table import trait_table
from app.simulated.traits import OFF, TRAITS, Population, Purpose, Traits, draw_traits, stream
from app.trial.values import UserInput
from sim.interface import TICK_S, RobotCommand, run_tick, steady, still
from sim.kinematic import KinematicRobot
from sim.layouts import scene
from study.flow.answers import score, validate_surveys
from tests.support.flow_cases import handed_in
from tests.support.shipped_world import LAYOUTS
from tests.support.study_samples import OBJECTS, shipped_study

SPEED_M_S = 0.03


@cache
def average() -> Traits:
    return draw_traits(Population(OFF, spread_scale=0.0), np.random.default_rng(0))


# ---- who they are ---------------------------------------------------------------------------------------------------


def test_individuals_differ_and_stay_within_bounds() -> None:
    people = [draw_traits(Population(), stream(seed, "traits")) for seed in range(200)]
    for name, trait in TRAITS.items():
        values = [getattr(person, name) for person in people]
        assert all(trait.low <= value <= trait.high for value in values), name
        assert len(set(values)) > 100 or trait.spread == 0.0, name


def test_the_mean_of_a_trait_is_where_the_population_puts_it() -> None:
    rng = np.random.default_rng(1)
    times = [draw_traits(Population({"away_s": 6.0}), rng).away_s for _ in range(4000)]
    assert np.mean(times) == pytest.approx(6.0, rel=0.02)


def test_without_spread_everyone_has_the_means() -> None:
    one, other = (draw_traits(Population(spread_scale=0.0), np.random.default_rng(seed)) for seed in (1, 2))
    assert [getattr(one, name) for name in TRAITS] == [getattr(other, name) for name in TRAITS]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"means": {"spee": 1.0}}, "traits are rationality"),
        ({"means": {"look": 2.0}}, "from 0 to 0.6"),
        ({"spread_scale": -1.0}, "from 0 to 5"),
    ],
)
def test_a_population_that_cannot_be_is_told(wrong: dict[str, Any], told: str) -> None:
    with pytest.raises(LabError, match=told):
        Population(**wrong)


def test_every_purpose_trial_and_alert_has_a_stream_of_its_own() -> None:
    keys: list[tuple[Purpose, tuple[int, ...]]] = [
        ("traits", ()),
        ("trial", (1,)),
        ("trial", (2,)),
        ("practice", (1,)),
        ("alerts", (1, 1)),
        ("alerts", (1, 2)),
        ("survey", (1,)),
    ]
    first = [stream(5, purpose, *key).random() for purpose, key in keys]
    assert len(set(first)) == len(keys)
    assert first == [stream(5, purpose, *key).random() for purpose, key in keys]


# ---- how they drive -------------------------------------------------------------------------------------------------


def drive(traits: Traits, seed: int, ticks: int = 600, target: int = 3) -> tuple[list[UserInput], str | None]:
    """Inputs of a person who picks an object up, and what ended up in the fingers."""
    spec = scene(LAYOUTS["arc"], OBJECTS)
    robot = KinematicRobot()
    robot.reset(spec)
    driver = Driver(traits, np.random.default_rng(seed), SPEED_M_S * TICK_S)
    inputs: list[UserInput] = []
    name = OBJECTS[target]
    for _ in range(ticks):
        world = robot.observe()
        if world.held is not None:
            break
        sight = Sight(
            world.position_world_gripper_m, world.held, world.gripper, world.object(name).grasp_world_m, (0.5, 0.5, 0.9)
        )
        inputs.append(driver.act(name, sight))
        run_tick(robot, command(inputs[-1]))
    return inputs, robot.observe().held


def command(operator: UserInput) -> RobotCommand:
    if operator.gripper is not None:
        return still(operator.gripper)
    if operator.direction is None:
        return still()
    direction = np.array(operator.direction) / np.linalg.norm(operator.direction)
    return steady(direction, SPEED_M_S)


@pytest.mark.parametrize("seed", range(6))
def test_people_of_all_kinds_get_the_object(seed: int) -> None:
    _, held = drive(draw_traits(Population(), stream(seed, "traits")), seed, target=seed % 6)
    assert held == OBJECTS[seed % 6]


def test_hands_are_never_still_for_as_long_as_a_window_unless_called_away() -> None:
    """Five ticks without input are what the paper calls a window; looking at things makes none."""
    for seed in range(4):
        inputs, _ = drive(replace(average(), pause=4.0, fine_pause=4.0, checks=0.0), seed)
        longest = still_for = 0
        for operator in inputs:
            busy = operator.direction is not None or operator.gripper is not None
            still_for = 0 if busy else still_for + 1
            longest = max(longest, still_for)
        assert 1 <= longest <= 4


def test_mostly_one_or_two_axes_are_used() -> None:
    counts = [
        sum(map(abs, operator.direction))
        for seed in range(3)
        for operator in drive(average(), seed)[0]
        if operator.direction
    ]
    assert set(counts) <= {1, 2}
    assert np.mean([count == 1 for count in counts]) > 0.5


def test_a_person_who_hesitates_takes_longer() -> None:
    quick = [
        len(drive(replace(average(), pause=1.0, fine_pause=1.0, checks=0.0, look=0.0), seed)[0]) for seed in range(5)
    ]
    slow = [
        len(drive(replace(average(), pause=4.0, fine_pause=4.0, checks=5.0, look=0.2), seed)[0]) for seed in range(5)
    ]
    assert np.mean(slow) > 1.5 * np.mean(quick)


def test_a_reading_takes_the_hands_away_for_exactly_that_long() -> None:
    driver = Driver(average(), np.random.default_rng(0), 0.015)
    sight = Sight((0.70, 0.0, 0.88), None, "open", (0.84, 0.27, 0.85), (0.5, 0.5, 0.9))
    assert driver.act("wipes_tub", sight).direction is not None
    driver.leave(7)
    assert [driver.act("wipes_tub", sight).direction for _ in range(7)] == [None] * 7
    assert not driver.away
    assert driver.act("wipes_tub", sight).direction is not None


def test_a_look_ends_when_the_arm_goes_where_it_should_not() -> None:
    traits = replace(average(), pause=4.0, look=1.0)
    sight = Sight((0.70, 0.0, 0.88), None, "open", (0.772, 0.40, 0.85), (0.5, 0.5, 0.9))
    driver = Driver(traits, np.random.default_rng(0), 0.015)
    driver.act("wipes_tub", sight)
    assert driver.act("wipes_tub", sight).direction is None  # looks, for four ticks
    away = replace(sight, position_m=(0.70, -0.03, 0.88))
    driver.act("wipes_tub", sight)
    assert driver.act("wipes_tub", away).direction is not None


def test_the_wrong_object_and_a_missed_grasp_are_let_go() -> None:
    driver = Driver(average(), np.random.default_rng(0), 0.015)
    missed = Sight((0.84, 0.27, 0.85), None, "closed", (0.84, 0.27, 0.85), (0.5, 0.5, 0.9))
    assert driver.act("wipes_tub", missed).gripper == "open"
    assert driver.act("wipes_tub", replace(missed, held="sponge_pack")).gripper == "open"


# ---- how they are in a task -----------------------------------------------------------------------------------------


def test_every_trait_names_its_source_or_says_that_it_is_assumed() -> None:
    for name, trait in TRAITS.items():
        assert trait.source.strip(), name
        named = any(char.isdigit() for char in trait.source) or "paper" in trait.source
        assert named or "assumed" in trait.source, name
        assert trait.about, name


def test_a_trait_added_or_switched_off_leaves_every_other_as_it_was() -> None:
    person = draw_traits(Population(), stream(3, "traits"))
    for name in OFF:
        other = draw_traits(Population({name: OFF[name]}), stream(3, "traits"))
        assert replace(other, **{name: getattr(person, name)}) == replace(person, device=other.device), name


def test_what_is_off_changes_nothing_about_a_task() -> None:
    person = draw_traits(Population(OFF), stream(3, "traits"))
    for number in range(6):
        state = Course(person, np.random.default_rng(number), 10).state("wipes_tub", carrying=False, tick=900)
        assert (state.traits, state.depth_error_m, state.mixed_up) == (person, 0.0, 0)


def test_practice_makes_quicker_and_time_on_task_slower() -> None:
    assert [practised(0.2, number) for number in (1, MIDDLE_TASK, 24)] == sorted(
        (practised(0.2, number) for number in (1, MIDDLE_TASK, 24)), reverse=True
    )
    assert practised(0.2, MIDDLE_TASK) == tired(0.1, 3.5) == 1.0
    assert tired(0.1, 13.5) == pytest.approx(1.1)
    assert [tasks_before(6, trial, practising) for trial in (1, 2) for practising in (True, False)] == [0, 2, 8, 10]


def test_one_person_s_tasks_differ_and_a_task_that_is_tried_again_stays_the_same() -> None:
    person = replace(average(), mood=0.5, mix_up=0.5)
    course = Course(person, np.random.default_rng(1))
    states = [course.state(name, carrying, 0) for name in OBJECTS for carrying in (False, True)]
    assert len({state.traits.checks for state in states}) == len(states)
    assert 0 < sum(state.mixed_up > 0 for state in states) < len(states)
    assert course.state(OBJECTS[0], False, 500) is states[0]


def test_keyboards_are_drawn_by_share_and_use_two_axes_less_often() -> None:
    people = [draw_traits(Population({"keyboard": 0.4}), stream(seed, "traits")) for seed in range(300)]
    assert 0.3 < np.mean([person.device == "keyboard" for person in people]) < 0.5
    on_keys = Course(replace(average(), device="keyboard"), np.random.default_rng(0)).state("wipes_tub", False, 0)
    on_pad = Course(replace(average(), device="gamepad"), np.random.default_rng(0)).state("wipes_tub", False, 0)
    assert on_keys.traits.two_axes < on_pad.traits.two_axes
    assert on_keys.traits.slip > on_pad.traits.slip


# ---- what they say --------------------------------------------------------------------------------------------------


def test_answers_are_complete_and_follow_the_stated_model() -> None:
    study = shipped_study()

    def mean_scores(felt: Experience) -> tuple[float, float]:
        rng = np.random.default_rng(2)
        person = SimulatedPerson(study, average(), felt, rng)
        given = [handed_in(study, "survey", person)["answers"] for _ in range(60)]
        assert all(validate_surveys(study, answers) == () for answers in given)
        usability = np.mean([score("sus_modified", answers["sus_modified"]) for answers in given])
        workload = np.mean([score("tlx_raw", answers["tlx_raw"]) for answers in given])
        return float(usability), float(workload)

    calm = mean_scores(Experience(minutes=7.0, failures=0, missed=0, contrary=0.0))
    annoyed = mean_scores(Experience(minutes=7.0, failures=0, missed=0, contrary=0.4))
    assert annoyed[0] < calm[0] - 0.5
    assert annoyed[1] > calm[1] + 0.5


def test_the_documentation_shows_the_traits_that_ship() -> None:
    page = Path(__file__).parents[2] / "docs" / "topics" / "simulated-participants.md"
    assert trait_table() in page.read_text(encoding="utf-8"), "python -m app.simulated.trait_table prints it"
