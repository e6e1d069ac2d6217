"""The Fetch's kinematics: the closed form against forward kinematics, and what is within reach."""

from __future__ import annotations

import math

import numpy as np
import pytest

from app.contracts.driving import START_JOINTS_RAD
from sim import fetch, ik
from sim.interface import TICK_S, MotionSegment, RobotCommand, SimError, Vector3, steady, still
from tests.support.robot_cases import reachable

WORKSPACE = np.array([ik.WORKSPACE_LOW_M, ik.WORKSPACE_HIGH_M])


def positions(count: int, seed: int = 0) -> np.ndarray:
    """Positions within reach, shape (N, 3), N about three quarters of `count`."""
    low_m, high_m = WORKSPACE
    points = np.random.default_rng(seed).uniform(low_m, high_m, size=(count, 3))
    within: np.ndarray = points[reachable(points)]
    return within


def triple(point: np.ndarray) -> Vector3:
    return float(point[0]), float(point[1]), float(point[2])


def test_gripper_is_where_it_was_asked_to_be_level_and_pointing_forward() -> None:
    for point in positions(300):
        joints, code = ik.solve(triple(point))
        position, quaternion = fetch.link_poses(joints, 0.1)["gripper_link"]
        assert code == 0
        assert position == pytest.approx(point, abs=1e-9)
        assert quaternion == pytest.approx((1, 0, 0, 0), abs=1e-9) or quaternion == pytest.approx(
            (-1, 0, 0, 0), abs=1e-9
        )


def test_numbers_and_arrays_share_one_formula() -> None:
    low_m, high_m = WORKSPACE + [[-0.1] * 3, [0.1] * 3]
    points = np.random.default_rng(1).uniform(low_m, high_m, size=(500, 3))
    joints, codes = ik.solve_many(points)
    for point, row, code in zip(points, joints, codes, strict=True):
        alone, alone_code = ik.solve(triple(point))
        assert alone_code == code
        assert alone == pytest.approx(row, abs=1e-12)
    assert set(codes) >= {0, 1, 2, 3}  # the sample reaches all the common cases


def test_joint_limits_and_elbow_range_hold_wherever_it_is_within_reach() -> None:
    joints, _ = ik.solve_many(positions(20_000))
    assert np.all(joints >= fetch.LOWER_RAD)
    assert np.all(joints <= fetch.UPPER_RAD)
    assert joints[:, 3].min() >= ik.ELBOW_RAD[0]
    assert joints[:, 3].max() <= ik.ELBOW_RAD[1]


def test_no_joint_turns_faster_than_rated_at_the_highest_speed() -> None:
    points = positions(40_000)
    tiny_m = 1e-6
    here, _ = ik.solve_many(points)
    slopes = np.stack([(ik.solve_many(points + tiny_m * axis)[0] - here) / tiny_m for axis in np.eye(3)], axis=-1)
    steepest = np.linalg.norm(slopes, axis=-1).max(axis=0)  # (7,) rad per metre in the worst direction
    assert np.all(steepest <= ik.MAX_TURN_RAD_PER_M)
    rated_rad_s = np.array([joint.velocity_rad_s for joint in fetch.ARM_JOINTS])
    assert np.all(np.array(ik.MAX_TURN_RAD_PER_M) * ik.MAX_SPEED_M_S < 0.9 * rated_rad_s)


def test_posture_is_a_continuous_function_of_position() -> None:
    """No elbow flips and no rolls that jump by a turn, anywhere a neighbouring position is within reach too."""
    points = positions(5_000)
    step_m = np.array([0.002, -0.002, 0.002])
    there = points + step_m
    both = reachable(there)
    jumps = np.abs(ik.solve_many(there[both])[0] - ik.solve_many(points[both])[0])
    assert jumps.max() < 0.002 * math.sqrt(3) * max(ik.MAX_TURN_RAD_PER_M) * 1.1


def test_start_posture_is_the_published_constant() -> None:
    assert ik.solve(fetch.START_POSITION_M)[0] == pytest.approx(START_JOINTS_RAD, abs=1e-9)


@pytest.mark.parametrize(
    ("position", "reason"),
    [
        ((0.70, 0.0, 0.70), "edge of the workspace"),
        ((0.94, 0.50, 0.88), "the arm cannot stretch further"),
        ((0.50, 0.0, 1.00), "the arm cannot fold further"),
        ((0.50, 0.0, 0.80), "the wrist is at its limit"),
    ],
)
def test_out_of_reach_has_a_reason(position: Vector3, reason: str) -> None:
    assert ik.REASONS[ik.solve(position)[1]] == reason
    assert not reachable(np.array([position]))[0]


def test_stated_box_is_within_reach() -> None:
    corners = np.stack(np.meshgrid([0.67, 0.80, 0.90], np.linspace(-0.34, 0.34, 9), [0.80, 0.86, 0.92]), -1).reshape(
        -1, 3
    )
    assert reachable(corners).all()


def test_steps_that_add_up_to_the_edge_get_there() -> None:
    here = (0.80, 0.0, ik.WORKSPACE_LOW_M[2] + 0.06)
    down = steady((0.0, 0.0, -1.0), 0.04)
    for _ in range(3):
        verdict = ik.executable(here, down)
        assert not verdict.blocked
        here = ik.waypoints(here, verdict, down.speed_m_s)[-1]
    assert here[2] == pytest.approx(ik.WORKSPACE_LOW_M[2], abs=1e-9)
    assert ik.executable(here, down).blocked


def test_a_straight_path_may_leave_the_reach_though_both_ends_are_within() -> None:
    left, right = (0.50, 0.45, 0.86), (0.50, -0.45, 0.86)  # across the hole straight ahead
    way = np.subtract(right, left)
    assert reachable(np.array([left, right])).all()
    assert not ik.segment_feasible(left, way[None])[0]
    assert ik.path_code(left, right) != 0


def test_displacements_agree_with_their_paths_one_by_one() -> None:
    moves = np.random.default_rng(2).uniform(-0.1, 0.1, size=(27, 3))
    moves[13] = 0.0
    for start in positions(60, seed=3)[:25]:
        fits = ik.segment_feasible(triple(start), moves)
        alone = [ik.path_code(triple(start), triple(start + move)) == 0 for move in moves]
        assert fits.tolist() == alone
        assert fits[13]


def test_blocked_axis_is_dropped_and_the_rest_goes_on() -> None:
    start = (0.80, 0.0, ik.WORKSPACE_LOW_M[2])  # as low as it gets
    down_and_left = (0.0, math.sqrt(0.5), -math.sqrt(0.5))
    verdict = ik.executable(start, steady(down_and_left, 0.04))
    assert verdict.executed == (MotionSegment((0.0, down_and_left[1], 0.0), 15),)
    assert not verdict.blocked
    assert verdict.reason == "edge of the workspace"


def test_blocked_means_nothing_of_the_last_direction_is_left() -> None:
    start = (0.80, 0.0, ik.WORKSPACE_LOW_M[2])
    momentum_then_down = RobotCommand((MotionSegment((1.0, 0.0, 0.0), 3), MotionSegment((0.0, 0.0, -1.0), 12)), 0.04)
    verdict = ik.executable(start, momentum_then_down)
    assert [segment.direction for segment in verdict.executed] == [(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    assert verdict.blocked
    assert verdict.reason == "edge of the workspace"
    down_then_stay = RobotCommand((MotionSegment((0.0, 0.0, -1.0), 3), MotionSegment((0.0, 0.0, 0.0), 12)), 0.04)
    assert not ik.executable(start, down_then_stay).blocked
    assert not ik.executable(start, still()).blocked


def test_whatever_is_executable_stays_within_reach_slice_by_slice() -> None:
    rng = np.random.default_rng(4)
    for start in positions(400, seed=5)[:200]:
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        command = steady(triple(direction), 0.08)
        path = np.array(ik.waypoints(triple(start), ik.executable(triple(start), command), command.speed_m_s))
        codes = ik.solve_many(path)[1]
        # Between two samples a path may bulge out of the reach by a hair; the limits themselves keep a margin.
        inward = path + (start - path) * 0.02
        assert np.all((codes == 0) | reachable(inward))


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (RobotCommand((MotionSegment((1.0, 0.0, 0.0), 14),), 0.04), ("14", "15")),
        (RobotCommand((MotionSegment((1.0, 0.0, 0.0), 15), MotionSegment((1.0, 0.0, 0.0), 0)), 0.04), ("0", "15")),
        (RobotCommand((), 0.04), ("15",)),
        (steady((1.0, 1.0, 0.0), 0.04), ("1.41", "at most 1")),
        (steady((math.nan, 0.0, 0.0), 0.04), ("nan",)),
        (steady((1.0, 0.0, 0.0), 0.11), ("0.11", "0.1")),
        (steady((1.0, 0.0, 0.0), -0.01), ("-0.01",)),
        (steady((1.0, 0.0, 0.0), math.nan), ("nan",)),
        (still("grab"), ("grab", "open", "close", "hold")),  # type: ignore[arg-type]
    ],
)
def test_command_errors_give_value_bound_and_choices(command: RobotCommand, words: tuple[str, ...]) -> None:
    with pytest.raises(SimError) as error:
        ik.executable(fetch.START_POSITION_M, command)
    for word in words:
        assert word in str(error.value)


def test_one_tick_is_at_most_five_centimetres() -> None:
    assert ik.MAX_SPEED_M_S * TICK_S <= 0.05


def test_link_poses_names_the_joints_it_wants() -> None:
    with pytest.raises(SimError, match=r"6 joint positions.*shoulder_pan_joint"):
        fetch.link_poses((0.0,) * 6, 0.1)


def test_a_position_out_of_the_workspace_is_brought_to_its_edge_and_one_within_is_left_alone() -> None:
    within = (0.8, 0.1, 0.9)
    assert ik.into_workspace(within) == within
    assert ik.into_workspace((0.9506, -0.7, 0.7894)) == (0.95, -0.62, 0.79)
