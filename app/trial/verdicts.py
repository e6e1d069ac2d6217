"""When a pickup or a dropoff is over, and how it went (paper IV-B). Pure: worlds in, verdicts out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sim.ik import solve
from sim.interface import Bin, SceneSpec, WorldState

LIFT_M = 0.03
"""A held object this far above its rest has been picked up."""

BIN_MARGIN_M = 0.10
"""An object that lies within this distance of a bin's edges counts as in it (paper IV-B)."""

FALLEN_TILT_RAD = np.pi / 4
"""An object tilted further than this lies down; the fingers, kept level, cannot grasp it any more."""

PRACTICE_MOVE_M = 0.10
"""A practice object carried this far, in a straight line over the table, has been moved."""


@dataclass(frozen=True)
class Verdict:
    """The end of a task. `reason` is blank after a success."""

    outcome: Literal["success", "failure"]
    reason: str | None = None


SUCCESS = Verdict("success")
TIME_LIMIT = Verdict("failure", "time_limit")
"""The time that the study gives is over: what would have become of the task is not known."""


def pickup_verdict(scene: SceneSpec, world: WorldState, object_id: str, waited_out: bool = False) -> Verdict | None:
    """How the pickup of `object_id` ended, or None while it can still be done.

    An object on the table is judged once it has settled, or as it is now when the wait for that has run out.
    Reasons of failure: `off_table`, `knocked_over`, `out_of_reach`.
    """
    placed, now = scene.object(object_id), world.object(object_id)
    z_m = now.pose.position_world_m[2]
    if world.held == object_id:
        lifted_m = z_m - placed.rest_pose.position_world_m[2]
        return SUCCESS if lifted_m >= LIFT_M else None
    if z_m < scene.table.top_z_m:
        return Verdict("failure", "off_table")
    if not (now.settled or waited_out):
        return None
    if now.pose.tilt_rad > FALLEN_TILT_RAD:
        return Verdict("failure", "knocked_over")
    if solve(now.grasp_world_m)[1]:
        return Verdict("failure", "out_of_reach")
    return None


def dropoff_verdict(scene: SceneSpec, world: WorldState, object_id: str, bin_id: str) -> Verdict:
    """How the dropoff ended, judged where the object lies now.

    Reasons of failure: `wrong_bin`, `left_on_table`, `outside_bin`.
    """
    x_m, y_m, z_m = world.object(object_id).pose.position_world_m
    if z_m >= scene.table.top_z_m:
        return Verdict("failure", "left_on_table")
    instructed = scene.bin(bin_id)
    if instructed.distance_m(x_m, y_m) <= BIN_MARGIN_M:
        return SUCCESS
    if any(other.distance_m(x_m, y_m) <= BIN_MARGIN_M for other in scene.bins if other.id != bin_id):
        return Verdict("failure", "wrong_bin")
    return Verdict("failure", "outside_bin")


def practice_verdict(scene: SceneSpec, world: WorldState, object_id: str) -> Verdict:
    """Whether the practice object, released and settled, was moved. Reason of failure: `not_moved`."""
    x_m, y_m, _ = world.object(object_id).pose.position_world_m
    rest_x_m, rest_y_m, _ = scene.object(object_id).base_world_m
    moved_m = float(np.hypot(x_m - rest_x_m, y_m - rest_y_m))
    return SUCCESS if moved_m >= PRACTICE_MOVE_M else Verdict("failure", "not_moved")


def release_points(bins: tuple[Bin, ...]) -> dict[str, tuple[float, float, float]]:
    """Where the gripper should be to drop into each bin: the candidate goals while it holds something."""
    return {candidate.id: candidate.release_world_m for candidate in bins}
