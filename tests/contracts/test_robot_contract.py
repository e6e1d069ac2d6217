"""The robots' contract finds what is wrong with one, in its line. That those that ship keep it: `tests/sim`."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.contracts.candidate import Candidate
from app.contracts.robot import RobotContract
from app.contracts.verdict import Failed
from sim.interface import MotionVerdict, RobotCommand, SceneSpec, WorldState
from sim.kinematic import KinematicRobot


class Forgetful(KinematicRobot):
    """A world that remembers the one before it."""

    def reset(self, scene: SceneSpec) -> None:
        if not hasattr(self, "_was"):
            self._was = True
            super().reset(scene)


class Optimistic(KinematicRobot):
    def feasible(self, displacements_m: Any) -> Any:
        return np.ones(len(displacements_m), dtype=bool)


class Random(KinematicRobot):
    """Somewhat elsewhere, each time."""

    def observe(self) -> WorldState:
        return _moved(super().observe(), float(np.random.default_rng().normal(0.0, 1e-4)))


class Watched(KinematicRobot):
    """Looking at it moves it."""

    looks = itertools.count()

    def observe(self) -> WorldState:
        return _moved(super().observe(), 1e-9 * next(self.looks))


class Slow(KinematicRobot):
    def advance(self, slices: int = 1) -> None:
        super().advance(max(slices - 1, 0))


class Short(KinematicRobot):
    """Says it goes all the way, and does not."""

    def command(self, command: RobotCommand) -> MotionVerdict:
        return super().command(replace(command, speed_m_s=0.8 * command.speed_m_s))


class Willing(KinematicRobot):
    """Takes what no robot can do, without a word."""

    def command(self, command: RobotCommand) -> MotionVerdict:
        try:
            return super().command(command)
        except ValueError:
            return MotionVerdict(command.segments, False)


class Once(KinematicRobot):
    closed = False

    def close(self) -> None:
        if self.closed:
            raise RuntimeError("closed already")
        self.closed = True
        super().close()


def _moved(state: WorldState, by_m: float) -> WorldState:
    x_m, y_m, z_m = state.position_world_gripper_m
    moved = vars(state) | {"position_world_gripper_m": (x_m + by_m, y_m, z_m)}
    return WorldState(**moved)


BROKEN = [
    (Forgetful, "test_reset_is_a_fresh_world", "reset makes a fresh world: .*Broken at `assert state"),
    (Short, "test_motion_is_straight_and_as_long_as_commanded", "the gripper moves straight, and as far as commanded"),
    (Optimistic, "test_feasible_agrees_with_what_is_executed", "`feasible` says of a displacement whether `command`"),
    (Slow, "test_time_counts_slices", "`time_s` counts the slices that were run"),
    (Willing, "test_command_errors", "a command that breaks a bound raises `sim.interface.SimError`"),
    (Once, "test_closing_twice_is_harmless", "It raised RuntimeError: closed already, at `"),
    (Watched, "test_watched_slice_by_slice_or_run_at_once_is_the_same", "looking at the world, or advancing slice by"),
]


@pytest.mark.parametrize(
    ("made", "check", "told"), BROKEN, ids=[f"{made.__name__}-{check}" for made, check, _ in BROKEN]
)
def test_a_robot_that_breaks_it_is_told_what_to_mend(made: type[KinematicRobot], check: str, told: str) -> None:
    with pytest.raises(Failed, match=told) as failed:
        getattr(RobotContract(), check)(robot=made())
    assert "\n" not in str(failed.value)
    assert str(failed.value).startswith(f"robot {made.__name__} must keep this: ")


def test_one_that_is_not_the_same_twice_is_told() -> None:
    with pytest.raises(
        Failed, match="robot Random must keep this: the same commands give the same states, bit for bit"
    ):
        RobotContract().test_same_commands_same_states_bit_for_bit(make_robot=Random)


def test_one_that_cannot_be_loaded_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "half.py").write_text("class Half:\n    def reset(self): ...\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"robot 'half\.py:Half' lacks command, advance, observe, feasible, close"):
        _ = Candidate("robot", "half.py:Half", tmp_path, {}).loaded
