"""The arm's way through a tick is the transition model's, in numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.autonomy.actions import DIRECTIONS, UNIT_DIRECTIONS, index_of
from app.autonomy.transition import TransitionKind, TransitionModel
from app.trial.motion import motion_segments
from sim.interface import SLICES_PER_TICK, TICK_S, MotionSegment, RobotCommand, Vector3
from sim.kinematic import KinematicRobot
from sim.layouts import practice_scene
from tests.support.engine_cases import FORWARD, HANDS_OFF, LEFT, opened, push, run, trial_setup
from tests.support.shipped_world import LAYOUTS

SPEED_M_S = 0.04
KINDS: tuple[TransitionKind, ...] = ("mix", "replan")
# What a tick can leave behind: nothing, an action, or what limits left of one.
MOMENTA = st.one_of(
    st.just((0.0, 0.0, 0.0)),
    st.sampled_from([tuple(float(v) for v in direction) for direction in UNIT_DIRECTIONS]),
    st.tuples(
        st.sampled_from([tuple(float(v) for v in direction) for direction in UNIT_DIRECTIONS]),
        st.tuples(st.booleans(), st.booleans(), st.booleans()),
    ).map(lambda drawn: tuple(v if kept else 0.0 for v, kept in zip(drawn[0], drawn[1], strict=True))),
)


def executed_m(model: TransitionModel, momentum: Vector3, action: tuple[int, int, int]) -> np.ndarray:
    """How far a robot gets in one tick in the middle of its workspace."""
    robot = KinematicRobot()
    robot.reset(practice_scene(LAYOUTS["arc"]))
    before = np.array(robot.observe().position_world_gripper_m)
    verdict = robot.command(RobotCommand(motion_segments(model, momentum, action), SPEED_M_S))
    for _ in range(SLICES_PER_TICK):
        robot.advance()
    assert not verdict.blocked and verdict.reason is None
    moved_m: np.ndarray = np.array(robot.observe().position_world_gripper_m) - before
    return moved_m


@settings(max_examples=150, deadline=None)
@given(
    kind=st.sampled_from(KINDS),
    delay=st.one_of(st.sampled_from([0.0, 0.2, 1.0]), st.floats(0.0, 1.0)),
    momentum=MOMENTA,
    action=st.sampled_from(DIRECTIONS),
)
def test_a_tick_ends_where_the_model_says(
    kind: TransitionKind, delay: float, momentum: Vector3, action: tuple[int, int, int]
) -> None:
    model = TransitionModel(kind, 0.05, delay)
    modelled_m = model.displacements(momentum)[index_of(action)] * (SPEED_M_S * TICK_S / model.step_m)
    np.testing.assert_allclose(executed_m(model, momentum, action), modelled_m, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("kept", [(1, 0, 1), (1, 1, 0), (0, 0, 1)])
def test_going_on_in_what_the_limits_left_of_a_direction_ends_where_the_model_says(
    kind: TransitionKind, kept: tuple[int, int, int]
) -> None:
    """Shorter than 1: for `replan` it continues, for `mix` the delay still counts at the old speed."""
    third = 3.0**-0.5
    momentum = (kept[0] * third, kept[1] * third, kept[2] * third)
    model = TransitionModel(kind, 0.05, 0.2)
    modelled_m = model.displacements(momentum)[index_of(kept)] * (SPEED_M_S * TICK_S / model.step_m)
    np.testing.assert_allclose(executed_m(model, momentum, kept), modelled_m, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("mix", ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
        ("replan", ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
    ],
)
def test_from_rest_the_arm_waits_for_the_planning_delay(
    kind: TransitionKind, expected: tuple[Vector3, Vector3]
) -> None:
    segments = motion_segments(TransitionModel(kind, 0.05, 0.2), (0.0, 0.0, 0.0), FORWARD)
    assert segments == (MotionSegment(expected[0], 3), MotionSegment(expected[1], 12))


def test_while_planning_mix_follows_the_old_direction_and_replan_stops() -> None:
    before = (0.0, 1.0, 0.0)
    mixed = motion_segments(TransitionModel("mix", 0.05, 0.2), before, FORWARD)
    replanned = motion_segments(TransitionModel("replan", 0.05, 0.2), before, FORWARD)
    assert mixed[0] == MotionSegment(before, 3)
    assert replanned[0] == MotionSegment((0.0, 0.0, 0.0), 3)
    assert motion_segments(TransitionModel("replan", 0.05, 0.2), before, LEFT) == (MotionSegment(before, 15),)


def test_a_delay_of_the_whole_tick_shifts_every_action_by_one_tick() -> None:
    """The arm starts late, but it does start: its momentum is the action, not what it has done so far."""
    engine = opened(trial_setup(model=TransitionModel("mix", 0.05, 1.0)))
    rows = [result.row for result in run(engine, [push(FORWARD), push(LEFT), HANDS_OFF, HANDS_OFF])]
    places = [(row.p_x, row.p_y) for row in rows]
    assert places[1] == places[0]
    assert places[2] == pytest.approx((places[1][0] + 0.02, places[1][1]))
    assert places[3] == pytest.approx((places[2][0], places[2][1] + 0.02))
    assert [(row.m_x, row.m_y) for row in rows] == [(0, 0), (1, 0), (0, 1), (0, 0)]
