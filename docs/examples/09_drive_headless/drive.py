"""A trial without a server: `TrialEngine` driven by a policy of one's own, printing what happens.

    python docs/examples/09_drive_headless/drive.py

The engine has no clock and no randomness: the same set-up and the same inputs give the same rows, bit for bit. Put your
own policy in the place of `policy`, or an arbiter of your own into the study.
"""

from __future__ import annotations

import sys
from pathlib import Path

from app.autonomy.actions import Direction
from app.trial.engine import TrialEngine
from app.trial.robots import make_robot
from app.trial.setup import study_setup
from app.trial.values import UserInput
from app.trial.world import open_study
from study.definition.study import orders, plan_session

NEAR_M = 0.012
"""What counts as there: a little more than half of what the arm moves in a tick, so that it never swings around."""
IN_FRONT_M = 0.10
"""How far in front of an object the gripper lines up."""
CARRY_X_M = 0.66
"""How far from the robot things are carried sideways: in front of what stands on the table, and well in reach."""
MOST_TICKS = 2000
"""A policy that is no good would drive for ever."""

Point = tuple[float, float, float]


def policy(engine: TrialEngine) -> UserInput:
    """One tick's input of somebody who sees the world and goes straight for what the page asks."""
    view, world = engine.view(), engine.world
    here_m = world.position_world_gripper_m
    if view.phase != "operating":
        return UserInput()  # the fingers move, or the arm goes back to its start: nothing to do
    if world.held is None and world.gripper == "closed":
        return UserInput(gripper="open")
    if world.held is None:
        x_m, y_m, z_m = world.object(view.object).grasp_world_m
        in_line = abs(here_m[1] - y_m) <= NEAR_M and abs(here_m[2] - z_m) <= NEAR_M
        if not in_line:
            return moved(here_m, (min(here_m[0], x_m - IN_FRONT_M), y_m, z_m))
        return moved(here_m, (x_m, y_m, z_m), then="close")
    assert view.bin is not None  # there is one in every trial; only practice has none
    x_m, y_m, z_m = engine.scene.bin(view.bin).release_world_m
    # Up, out, sideways, along: one after the other, so that nothing on the way is knocked over.
    if here_m[2] < z_m - NEAR_M:
        return moved(here_m, (here_m[0], here_m[1], z_m))
    if abs(here_m[1] - y_m) > NEAR_M:
        out_m = (CARRY_X_M, here_m[1], here_m[2])
        is_out = abs(here_m[0] - CARRY_X_M) <= NEAR_M
        return moved(here_m, (CARRY_X_M, y_m, here_m[2]) if is_out else out_m)
    return moved(here_m, (x_m, y_m, z_m), then="open")


def moved(here_m: Point, there_m: Point, then: str | None = None) -> UserInput:
    """A step on the way, along as many axes as it takes; once there, what the gripper does."""
    x, y, z = (
        0 if abs(there - here) <= NEAR_M else (1 if there > here else -1)
        for here, there in zip(here_m, there_m, strict=True)
    )
    direction: Direction = (x, y, z)
    if any(direction):
        return UserInput(direction)
    return UserInput(gripper="close" if then == "close" else "open" if then == "open" else None)


def main(study_file: Path | None = None, seed: int = 7) -> int:
    """Drive one trial to its end; how many tasks succeeded."""
    study = open_study(study_file)
    plan = plan_session(study, orders(study)[0], seed)
    robot = make_robot("kinematic")
    engine = TrialEngine(study_setup(study).trial_setup("P001", plan, trial=1, kind="trial"), robot)
    engine.open()
    done = 0
    while not engine.finished and engine.next_tick < MOST_TICKS:
        result = engine.tick(policy(engine))
        for event in result.events:
            print(f"{result.row.trial_s:6.1f} s  {event.kind}: {event.data}")
        for task in result.tasks:
            print(f"{result.row.trial_s:6.1f} s  task {task.task}: {task.kind} of {task.goal}, {task.outcome}")
            done += task.outcome == "success"
    robot.close()
    print(f"{done} of {study.tasks_per_trial} tasks in {engine.next_tick} ticks, under {plan.trial(1).condition}")
    return done


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
