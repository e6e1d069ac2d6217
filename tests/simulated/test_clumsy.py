"""The clumsy person finds an arm that does not come free, and every trial ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.simulated.clumsy import Clumsy, Finding
from app.simulated.pilot import Sight
from app.trial.engine import TrialEngine
from app.trial.values import TrialSetup, UserInput
from app.trial.verdicts import release_points
from sim.bullet import BulletRobot
from sim.interface import MotionVerdict, Robot, RobotCommand, WorldState
from sim.kinematic import KinematicRobot
from tests.support.arbiter_cases import CONDITIONS
from tests.support.engine_cases import practice_setup, trial_setup

AT_MOST_TICKS = 3000


def clumsy_trial(setup: TrialSetup, robot: Robot, seed: int) -> tuple[list[str], list[Finding]]:
    """The digests of a whole trial, and what was found."""
    engine, clumsy = TrialEngine(setup, robot), Clumsy(np.random.default_rng(seed))
    digests: list[str] = []
    engine.open()
    while not engine.finished:
        assert len(digests) < AT_MOST_TICKS, f"still under way: {engine.view()}"
        view, world = engine.view(), engine.world
        if view.phase == "reset":
            act = UserInput()
        else:
            release_m = release_points(engine.scene.bins)[view.bin] if view.bin else None
            grasp_m = world.object(view.object).grasp_world_m
            sight = Sight(world.position_world_gripper_m, world.held, world.gripper, grasp_m, release_m)
            act = clumsy.act(view.object, sight)
        result = engine.tick(act)
        digests.append(result.row.digest)
        assert (result.view.hint is not None) == result.view.blocked
        running = view.phase == result.view.phase == "operating" and not result.tasks
        clumsy.told(result.view.blocked, running, engine.world.position_world_gripper_m)
    return digests, clumsy.findings


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("seed", range(3))
def test_a_clumsy_person_comes_to_the_end_of_a_trial_and_finds_nothing(condition: str, seed: int) -> None:
    robot = KinematicRobot()
    for setup in (practice_setup(condition), trial_setup(condition)):
        digests, findings = clumsy_trial(setup, robot, seed)
        assert digests
        assert not findings


@pytest.mark.bullet
@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_clumsy_person_finds_nothing_in_physics(condition: str) -> None:
    robot = BulletRobot()
    for seed in range(2):
        digests, findings = clumsy_trial(trial_setup(condition), robot, seed)
        assert digests
        assert not findings, (condition, seed)
    robot.close()


def test_the_same_seed_presses_the_same() -> None:
    first, again = (clumsy_trial(trial_setup("balanced"), KinematicRobot(), 5)[0] for _ in range(2))
    assert first == again
    assert clumsy_trial(trial_setup("balanced"), KinematicRobot(), 6)[0] != first


class Locking(KinematicRobot):
    """Every now and then it stands for a while, pressed against nothing."""

    def __init__(self) -> None:
        super().__init__()
        self._commands = 0

    def command(self, command: RobotCommand) -> MotionVerdict:
        self._commands += 1
        return super().command(RobotCommand(command.segments, 0.0, command.gripper) if self._is_locked else command)

    @property
    def _is_locked(self) -> bool:
        return self._commands % 40 > 30

    def observe(self) -> WorldState:
        return replace(super().observe(), lagging=self._is_locked)


def test_an_arm_that_does_not_come_free_is_found() -> None:
    _, findings = clumsy_trial(trial_setup("teleoperation"), Locking(), 1)
    assert findings
    assert {finding.kind for finding in findings} == {"jam"}
    assert "mm in two ticks" in str(findings[0])
