"""What every robot promises, tried on one. An author's own test file says it in two lines:

from app.contracts.robot import RobotContract

class TestTwoFinger(RobotContract):
    robot_name = "two_finger.py:TwoFingerRobot"     # a file beside this one; or the name that a package registers
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.contracts.candidate import Candidate, candidate
from app.contracts.driving import SPEED_M_S, START_JOINTS_RAD, drive, move_gripper, pick_and_place, settle, way_in
from app.contracts.part import usable
from app.contracts.verdict import approx, fixture, mend, parametrize, promises, raises
from app.trial.world import shipped_layout
from sim import fetch, ik, layouts
from sim.interface import (
    SLICES_PER_TICK,
    TICK_S,
    MotionSegment,
    Robot,
    RobotCommand,
    SceneSpec,
    SimError,
    Vector3,
    WorldState,
    run_tick,
    steady,
    still,
)

ARC, ROWS = shipped_layout("arc"), shipped_layout("rows")
IDS = [spec.id for spec in ARC.objects]
EMPTY = layouts.scene(ARC, {})
TABLE = layouts.scene(ARC, IDS)
DIAGONAL = math.sqrt(0.5)

MakeRobot = Callable[[], Robot]

HANDFUL = [
    (ARC, "spray_bottle", "left_bin"),
    (ARC, "bleach_bottle", "right_bin"),
    (ARC, "wipes_tub", "left_bin"),
    (ROWS, "sponge_pack", "right_bin"),
    (ROWS, "paper_towels", "left_bin"),
    (ROWS, "absorbent_can", "right_bin"),
]


def distance_to_line_m(point: Vector3, start: Vector3, end: Vector3) -> float:
    """How far a point lies beside the segment."""
    along = np.subtract(end, start)
    share = np.clip(np.dot(np.subtract(point, start), along) / np.dot(along, along), 0.0, 1.0)
    return float(np.linalg.norm(np.subtract(point, start) - share * along))


def tilt_rad(state: WorldState) -> float:
    """Angle between the gripper's orientation and level, pointing forward, by its joints."""
    w = fetch.link_poses(state.joint_positions_rad, state.finger_opening_m)["gripper_link"][1][0]
    return 2.0 * math.acos(min(abs(w), 1.0))


def check_pick_and_place(robot: Robot, layout: layouts.Layout, scene: SceneSpec, object_id: str, bin_id: str) -> None:
    outcome = pick_and_place(robot, layout, scene, object_id, bin_id)
    assert outcome.grasped == object_id
    assert outcome.lifted_m == approx(layouts.LIFT_M, abs=0.005)
    assert outcome.carried == object_id
    assert outcome.end.held is None
    end = outcome.end.object(object_id)
    x, y, z = end.pose.position_world_m
    assert end.settled
    assert scene.bin(bin_id).distance_m(x, y) == 0.0
    assert 0.0 < z < scene.bin(bin_id).height_m
    for item in outcome.end.objects:  # nobody else was touched
        if item.id != object_id:
            assert math.dist(item.pose.position_world_m, scene.object(item.id).rest_pose.position_world_m) < 0.001


def busy_commands() -> list[RobotCommand]:
    """A grasp with momentum, a carry and a drop, in a full scene."""
    to_object = [steady((0.0, 1.0, 0.0), 0.045)] * 4
    forward = RobotCommand((MotionSegment((0.0, 0.0, 0.0), 3), MotionSegment((1.0, 0.0, 0.0), 12)), 0.05)
    back = RobotCommand((MotionSegment((1.0, 0.0, 0.0), 3), MotionSegment((-DIAGONAL, DIAGONAL, 0.0), 12)), 0.04)
    lower = [steady((0.0, 0.0, -1.0), 0.03)] * 2
    return [*to_object, *lower, *[forward] * 9, still("close"), still(), *[back] * 3, still("open"), still(), still()]


class RobotContract:
    """Straight, feasible as it says, the same again bit for bit; grasps, carries and lets go."""

    kind: ClassVar[str] = "robot"
    robot_name: ClassVar[str] = ""

    @fixture
    def part(self, request: Any) -> Candidate:
        """The robot that the class names, beside the file that the class stands in."""
        if not self.robot_name:
            mend(f'{type(self).__name__} names no robot; give it a line such as robot_name = "two_finger.py:TwoFinger"')
        folder = Path(inspect.getfile(request.cls)).resolve().parent
        return usable(candidate("robot", self.robot_name, folder, "{}"))

    @fixture
    def make_robot(self, part: Candidate) -> MakeRobot:
        """The class of the robot."""
        make: MakeRobot = part.loaded
        return make

    @fixture
    def robot(self, part: Candidate, make_robot: MakeRobot) -> Iterator[Robot]:
        """One robot for one check."""
        try:
            made = make_robot()
        except Exception as error:
            mend(f"{part} must be made without arguments; it raised {type(error).__name__}: {error}")
        yield made
        made.close()

    # The world after a reset.

    @promises(
        "reset makes a fresh world: time 0, arm at its start, gripper open, objects standing where the scene says"
    )
    def test_reset_is_a_fresh_world(self, robot: Robot) -> None:
        robot.reset(TABLE)
        drive(robot, (0.72, 0.05, 0.90))
        robot.reset(TABLE)
        state = robot.observe()
        assert state.time_s == 0.0
        assert state.position_world_gripper_m == approx(TABLE.start_world_m, abs=1e-6)
        assert state.joint_positions_rad == approx(START_JOINTS_RAD, abs=1e-6)
        assert (state.gripper, state.held, state.lagging) == ("open", None, False)
        assert state.finger_opening_m == approx(fetch.MAX_OPENING_M, abs=1e-6)
        assert [item.id for item in state.objects] == IDS
        for item in state.objects:
            placed = TABLE.object(item.id)
            assert item.settled
            assert item.pose.position_world_m == approx(placed.rest_pose.position_world_m, abs=1e-6)
            x, y, z = placed.base_world_m
            assert item.grasp_world_m == approx((x, y, z + placed.spec.grasp_height_m), abs=1e-6)

    @promises("objects that nobody touches stay where they are, and are settled")
    def test_untouched_objects_stay_where_they_are(self, robot: Robot) -> None:
        robot.reset(TABLE)
        for _ in range(6):
            _, state = run_tick(robot, still())
        for item in state.objects:
            assert item.settled
            rest = TABLE.object(item.id).rest_pose
            assert math.dist(item.pose.position_world_m, rest.position_world_m) < 5e-4
            assert item.pose.tilt_rad < 0.002

    # Motion.

    @promises("the gripper moves straight, and as far as commanded, to 2 mm")
    def test_motion_is_straight_and_as_long_as_commanded(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        start = robot.observe().position_world_gripper_m
        for direction in ((1.0, 0.0, 0.0), (0.0, DIAGONAL, -DIAGONAL), (0.0, -1.0, 0.0), (-0.5, 0.5, DIAGONAL)):
            verdict = robot.command(steady(direction, SPEED_M_S))
            assert verdict.executed == steady(direction, SPEED_M_S).segments
            assert (verdict.blocked, verdict.reason) == (False, None)
            x, y, z = (a + b * SPEED_M_S * TICK_S for a, b in zip(start, direction, strict=True))
            end: Vector3 = (x, y, z)
            for _ in range(SLICES_PER_TICK):
                robot.advance()
                assert distance_to_line_m(robot.observe().position_world_gripper_m, start, end) < 0.002
            assert math.dist(robot.observe().position_world_gripper_m, end) < 0.002
            start = end

    @promises("the segments of a command follow one another, each for its slices")
    def test_segments_follow_one_another_within_a_tick(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        momentum = RobotCommand((MotionSegment((1.0, 0.0, 0.0), 3), MotionSegment((0.0, 1.0, 0.0), 12)), SPEED_M_S)
        robot.command(momentum)
        x, y, z = EMPTY.start_world_m
        for _ in range(3):
            robot.advance()
        assert robot.observe().position_world_gripper_m == approx((x + 0.004, y, z), abs=0.002)
        for _ in range(12):
            robot.advance()
        assert robot.observe().position_world_gripper_m == approx((x + 0.004, y + 0.016, z), abs=0.002)

    @promises("a command lasts one tick; then the arm stands still")
    def test_a_command_lasts_one_tick(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        run_tick(robot, steady((1.0, 0.0, 0.0), SPEED_M_S))
        for _ in range(SLICES_PER_TICK):
            robot.advance()
        assert robot.observe().position_world_gripper_m[0] == approx(EMPTY.start_world_m[0] + 0.02, abs=0.002)

    @parametrize("speed_m_s", [SPEED_M_S, ik.MAX_SPEED_M_S])
    @promises("what `executed` says is what is done, to 2 mm and 1 degree, within the joints' limits")
    def test_random_motion_tracks_within_two_millimetres_and_one_degree(self, robot: Robot, speed_m_s: float) -> None:
        """Across the whole reach, turning every tick: what is commanded is what is done, within the joints' limits."""
        rng = np.random.default_rng(7)
        robot.reset(EMPTY)
        expected = np.array(EMPTY.start_world_m)
        refused = 0
        for tick in range(400):
            if tick % 6 == 0:
                direction = rng.integers(-1, 2, size=3).astype(float)
                direction /= max(float(np.linalg.norm(direction)), 1.0)
            verdict, state = run_tick(robot, steady(direction.tolist(), speed_m_s))
            for segment in verdict.executed:
                expected += np.array(segment.direction) * speed_m_s * TICK_S * segment.slices / SLICES_PER_TICK
            refused += verdict.reason is not None
            assert math.dist(state.position_world_gripper_m, expected) < 0.002
            assert tilt_rad(state) < math.radians(1.0)
            joints = np.array(state.joint_positions_rad)
            assert np.all(joints >= np.array(fetch.LOWER_RAD) - 1e-3)
            assert np.all(joints <= np.array(fetch.UPPER_RAD) + 1e-3)
        assert refused > 20  # the walk did come to the edges

    @parametrize("direction", [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)])
    @promises("what cannot be reached is blocked, with one of the reasons of `sim.ik.REASONS`, and the arm never jumps")
    def test_what_cannot_be_reached_stops_with_a_reason_and_never_jumps(self, robot: Robot, direction: Vector3) -> None:
        robot.reset(EMPTY)
        before = robot.observe().position_world_gripper_m
        for _ in range(60):
            verdict = robot.command(steady(direction, SPEED_M_S))
            for _ in range(SLICES_PER_TICK):
                robot.advance()
                here = robot.observe().position_world_gripper_m
                assert math.dist(before, here) < 0.004
                before = here
            if verdict.blocked:
                break
        assert verdict.blocked
        assert verdict.reason in ik.REASONS[1:]
        assert [segment.direction for segment in verdict.executed] == [(0.0, 0.0, 0.0)]
        state = run_tick(robot, steady(direction, SPEED_M_S))[1]
        assert math.dist(state.position_world_gripper_m, here) < 0.002
        # And back out again.
        verdict, state = run_tick(robot, steady([-value for value in direction], SPEED_M_S))
        assert not verdict.blocked
        assert math.dist(state.position_world_gripper_m, here) == approx(0.02, abs=0.003)

    @promises("of a diagonal the axis that is blocked is dropped, and the rest goes on")
    def test_a_blocked_axis_is_dropped_and_the_rest_goes_on(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        drive(robot, (0.80, 0.0, ik.WORKSPACE_LOW_M[2] + 0.001))
        verdict, state = run_tick(robot, steady((0.0, DIAGONAL, -DIAGONAL), SPEED_M_S))
        assert [segment.direction for segment in verdict.executed] == [(0.0, DIAGONAL, 0.0)]
        assert not verdict.blocked
        assert verdict.reason == "edge of the workspace"
        assert state.position_world_gripper_m == approx(
            (0.80, 0.02 * DIAGONAL, ik.WORKSPACE_LOW_M[2] + 0.001), abs=0.002
        )

    @promises("`feasible` says of a displacement whether `command` would execute all of it")
    def test_feasible_agrees_with_what_is_executed(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        drive(robot, (0.68, 0.20, 0.95))
        drive(robot, (0.55, 0.40, 0.95))
        directions = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], dtype=float)
        directions /= np.maximum(np.linalg.norm(directions, axis=1), 1.0)[:, None]
        fits = robot.feasible(directions * SPEED_M_S * TICK_S)
        assert fits.shape == (27,)
        assert fits.dtype == bool
        assert fits[13]
        for direction, fit in zip(directions, fits, strict=True):
            command = steady(direction, SPEED_M_S)
            assert (robot.command(command).executed == command.segments) == fit
        # A metre in any direction leads out of reach.
        assert not robot.feasible(np.delete(directions, 13, axis=0)).any()

    # Gripper.

    @promises("the gripper takes two ticks to close and to open, and says `moving` meanwhile")
    def test_gripper_takes_two_ticks_each_way(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        assert run_tick(robot, still("close"))[1].gripper == "moving"
        state = run_tick(robot, still())[1]
        assert (state.gripper, state.held) == ("closed", None)
        assert state.finger_opening_m == approx(0.0, abs=0.002)
        assert run_tick(robot, still("open"))[1].gripper == "moving"
        state = run_tick(robot, still())[1]
        assert state.gripper == "open"
        assert state.finger_opening_m == approx(fetch.MAX_OPENING_M, abs=0.002)

    @promises("opening an open gripper, or closing a closed one, changes nothing")
    def test_asking_for_what_is_already_so_changes_nothing(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        assert run_tick(robot, still("open"))[1].gripper == "open"
        move_gripper(robot, "close")
        assert run_tick(robot, still("close"))[1].gripper == "closed"

    # Objects.

    @parametrize(("layout", "object_id", "bin_id"), HANDFUL, ids=[f"{c[0].name}-{c[1]}" for c in HANDFUL])
    @promises("an object is grasped, lifted, carried, let go and settles in the bin, and no other is touched")
    def test_grasp_lift_carry_and_drop_into_the_bin(
        self, robot: Robot, layout: layouts.Layout, object_id: str, bin_id: str
    ) -> None:
        check_pick_and_place(robot, layout, layouts.scene(layout, IDS), object_id, bin_id)

    @promises("an object can be put down upright on the table")
    def test_practice_object_can_be_moved_and_put_down(self, robot: Robot) -> None:
        scene = layouts.practice_scene(ARC)
        robot.reset(scene)
        x, y, z = robot.observe().objects[0].grasp_world_m
        for target in way_in(ARC, (x, y, z)):
            drive(robot, target)
        assert move_gripper(robot, "close").held == "practice_block"
        for target in ((x, y, z + 0.05), (x, y + 0.16, z + 0.05), (x, y + 0.16, z + 0.002)):
            drive(robot, target)
        move_gripper(robot, "open")
        end = settle(robot, "practice_block").objects[0]
        assert end.settled
        assert end.pose.tilt_rad < 0.02
        assert end.pose.position_world_m[1] == approx(y + 0.16, abs=0.01)

    @promises("a tall object that is pushed from the side falls over and settles")
    def test_an_object_pushed_from_the_side_falls_over(self, robot: Robot) -> None:
        scene = layouts.scene(ARC, {2: "spray_bottle"})
        robot.reset(scene)
        x, y, z = robot.observe().object("spray_bottle").grasp_world_m
        drive(robot, (x, y - 0.12, z))
        for _ in range(8):
            run_tick(robot, steady((0.0, 1.0, 0.0), SPEED_M_S))
        end = settle(robot, "spray_bottle").object("spray_bottle")
        assert end.settled
        assert end.pose.tilt_rad > math.pi / 4
        assert end.grasp_world_m[2] < z - 0.05

    @promises("an object let go beside the bins lies on the floor and settles")
    def test_an_object_dropped_outside_lies_on_the_floor(self, robot: Robot) -> None:
        scene = layouts.scene(ARC, {0: "absorbent_can"})
        robot.reset(scene)
        x, y, z = robot.observe().object("absorbent_can").grasp_world_m
        for target in (*way_in(ARC, (x, y, z)),):
            drive(robot, target)
        assert move_gripper(robot, "close").held == "absorbent_can"
        drive(robot, (x, y, z + 0.06))
        drive(robot, (0.65, 0.10, z + 0.06))  # between the bins, in front of the table
        move_gripper(robot, "open")
        end = settle(robot, "absorbent_can").object("absorbent_can")
        assert end.settled
        assert end.pose.position_world_m[2] < 0.1
        assert all(item.distance_m(*end.pose.position_world_m[:2]) > 0.0 for item in scene.bins)

    @promises("closing on nothing holds nothing, and what is held is not settled")
    def test_closing_on_nothing_holds_nothing_and_opening_grasps_again(self, robot: Robot) -> None:
        scene = layouts.scene(ARC, {3: "wipes_tub"})
        robot.reset(scene)
        grasp = robot.observe().object("wipes_tub").grasp_world_m
        assert move_gripper(robot, "close").held is None
        move_gripper(robot, "open")
        for target in way_in(ARC, grasp):
            drive(robot, target)
        assert move_gripper(robot, "close").held == "wipes_tub"
        for _ in range(2):
            _, state = run_tick(robot, still())
        assert not state.objects[0].settled  # held still is not settled
        assert move_gripper(robot, "open").held is None

    # Determinism.

    @promises("the same commands give the same states, bit for bit, in a new robot and in one that was reset")
    def test_same_commands_same_states_bit_for_bit(self, make_robot: MakeRobot) -> None:
        digests = []
        for _ in range(2):
            robot = make_robot()
            for again in range(2):  # a fresh world in a used robot is as fresh as in a new one
                robot.reset(TABLE)
                states = [run_tick(robot, command)[1] for command in busy_commands()]
                assert "paper_towels" in {state.held for state in states}
                digests.append([state.digest() for state in states])
                if not again:
                    drive(robot, (0.75, 0.0, 0.85))
            robot.close()
        assert all(run == digests[0] for run in digests)
        assert len(set(digests[0])) > len(digests[0]) - 3  # something happened in nearly every tick

    @promises("looking at the world, or advancing slice by slice, changes nothing")
    def test_watched_slice_by_slice_or_run_at_once_is_the_same(self, robot: Robot) -> None:
        ends = []
        for watch in (False, True):
            robot.reset(TABLE)
            for command in busy_commands():
                robot.command(command)
                if not watch:
                    robot.advance(SLICES_PER_TICK)
                    continue
                for _ in range(SLICES_PER_TICK):
                    robot.advance()
                    robot.observe()
                    robot.feasible(np.eye(3) * 0.02)
            ends.append(robot.observe().digest())
        assert ends[0] == ends[1]

    @promises("`time_s` counts the slices that were run")
    def test_time_counts_slices(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        states = [run_tick(robot, still())[1] for _ in range(4)]
        for before, after in pairwise(states):
            assert after.time_s - before.time_s == approx(TICK_S)

    # Errors.

    @promises("a command that breaks a bound raises `sim.interface.SimError`, and changes nothing")
    def test_command_errors(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        before = robot.observe().digest()
        for command in (
            RobotCommand((MotionSegment((1.0, 0.0, 0.0), 14),), SPEED_M_S),
            steady((1.0, 1.0, 0.0), SPEED_M_S),
            steady((1.0, 0.0, 0.0), 0.2),
            still("grab"),  # type: ignore[arg-type]
        ):
            with raises(SimError):
                robot.command(command)
        assert robot.observe().digest() == before

    @promises("before `reset` everything raises `sim.interface.SimError`, which says `reset`")
    def test_without_a_world_there_is_nothing_to_command(self, robot: Robot) -> None:
        for use in (robot.observe, robot.advance, lambda: robot.command(still())):
            with raises(SimError, match="reset"):
                use()

    @promises("`reset` refuses a start out of reach with `SimError`, which gives the value and names the workspace")
    def test_start_out_of_reach_is_refused(self, robot: Robot) -> None:
        scene = SceneSpec(EMPTY.table, EMPTY.bins, (), (2.0, 0.0, 0.88))
        with raises(SimError, match=r"2\.0.*workspace"):
            robot.reset(scene)

    @promises("`close` may be called twice, and `reset` makes a world again")
    def test_closing_twice_is_harmless(self, robot: Robot) -> None:
        robot.reset(EMPTY)
        robot.close()
        robot.close()
        with raises(SimError, match="reset"):
            robot.observe()
        robot.reset(EMPTY)
        assert robot.observe().time_s == 0.0
