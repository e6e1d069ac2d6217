"""From a chosen action to the arm's motion within a tick: the transition model, made of slices. Pure."""

from __future__ import annotations

from functools import lru_cache

from app.autonomy.actions import UNIT_DIRECTIONS, Direction, index_of, nearest_action
from app.autonomy.transition import TransitionModel
from app.trial.values import STILL
from sim.interface import SLICES_PER_TICK, MotionSegment, RobotCommand, Vector3

_UNIT_VECTORS: tuple[Vector3, ...] = tuple((float(x), float(y), float(z)) for x, y, z in UNIT_DIRECTIONS)


def unit_direction(action: Direction) -> Vector3:
    """The action as a vector of length 1 (0 for staying)."""
    return _UNIT_VECTORS[index_of(action)]


@lru_cache(maxsize=4096)  # few momenta and actions, the same ones tick after tick
def motion_segments(model: TransitionModel, momentum: Vector3, action: Direction) -> tuple[MotionSegment, ...]:
    """How the arm carries out `action` within a tick, so that it ends where `model` says it does.

    `mix`: for the planning delay the arm still follows `momentum`. `replan`: a change of direction starts late.
    A delay that ends within a slice is shared out in that slice.
    """
    direction = unit_direction(action)
    before = momentum if model.kind == "mix" else STILL
    continues = model.kind == "replan" and nearest_action(momentum) == index_of(action)
    late = 0.0 if continues else model.planning_delay * SLICES_PER_TICK
    whole = int(late + 1e-9)
    share = late - whole if late - whole > 1e-9 else 0.0
    between = (
        share * before[0] + (1.0 - share) * direction[0],
        share * before[1] + (1.0 - share) * direction[1],
        share * before[2] + (1.0 - share) * direction[2],
    )
    rest = SLICES_PER_TICK - whole - (1 if share else 0)
    parts = ((before, whole), (between, 1 if share else 0), (direction, rest))
    return tuple(MotionSegment(along, slices) for along, slices in parts if slices)


@lru_cache(maxsize=4096)
def motion_command(model: TransitionModel, momentum: Vector3, action: Direction, speed_m_s: float) -> RobotCommand:
    """The tick's command for these `motion_segments`."""
    return RobotCommand(motion_segments(model, momentum, action), speed_m_s)
