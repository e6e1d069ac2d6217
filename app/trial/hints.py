"""What a person whose arm does not move can do about it: a cause and ways out, as codes; the page has the words. Pure.

A hint depends on the arm and what it touches alone, never on who decided or what is believed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from sim.interface import Vector3, WorldState

Cause = Literal["touches", "touches_closed", "touches_holding", "low", "high", "near", "limit"]
"""Something is in the way (of an open gripper, a closed one, one that holds something); the gripper is as low, as high,
or as near to the robot as it goes; or the arm reaches no further."""
Way = Literal["up", "back", "left", "right", "forward", "down", "open"]

WAYS: dict[Way, Vector3] = {
    "up": (0.0, 0.0, 1.0),
    "back": (-1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "forward": (1.0, 0.0, 0.0),
    "down": (0.0, 0.0, -1.0),
}
"""In the order of preference: up leads away from most things, and back to where there is room."""
FOLDED = "the arm cannot fold further"
LONG_TICKS = 6
"""Pressed for so long, whatever was tried, a closed gripper is told to open."""
AROUND = (1.0, 2.0)
"""So many of a tick's ways aside an end of the reach is looked past."""


@dataclass(frozen=True)
class Hint:
    """Why the arm does not move, and what to do, one after the other."""

    cause: Cause
    ways: tuple[Way, ...]


def hint_for(
    asked: Vector3,
    reason: str | None,
    world: WorldState,
    can_go: Callable[[Vector3], bool],
    pressed_ticks: int = 0,
) -> Hint:
    """`asked` is the direction that did not go, `can_go` whether the arm could go a little along another.

    `reason` is that of `sim.ik.REASONS`; it does not count for an arm that is pressed against something (`lagging`).
    """
    found = _way_out(asked, can_go)
    if not world.lagging:
        found = _way_around(asked, can_go) or found
        return Hint(_limit(asked, reason), () if found is None else (found,))
    away: tuple[Way, ...] = () if found is None else (found,)
    if world.held is not None:
        lets_go = pressed_ticks >= LONG_TICKS or found is None
        return Hint("touches_holding", (*away, "open") if lets_go else away)
    if world.gripper == "closed":
        return Hint("touches_closed", (*away, "open"))
    return Hint("touches", away)


def _limit(asked: Vector3, reason: str | None) -> Cause:
    x, y, z = asked
    if reason == FOLDED:
        return "near"
    if z and not (x or y):
        return "low" if z < 0.0 else "high"
    return "limit"


def _way_around(asked: Vector3, can_go: Callable[[Vector3], bool]) -> Way | None:
    """The first way aside that leads past the end of the reach, and on where the arm was asked to go: out of the hole
    before the robot, say."""
    for far in AROUND:
        for name, way in WAYS.items():
            is_aside = sum(a * b for a, b in zip(way, asked, strict=True)) == 0.0
            past_it = tuple(far * a + b for a, b in zip(way, asked, strict=True))
            if is_aside and can_go(way) and can_go((past_it[0], past_it[1], past_it[2])):
                return name
    return None


def _way_out(asked: Vector3, can_go: Callable[[Vector3], bool]) -> Way | None:
    """The first way that leads back from where the arm went, else one aside, that is free."""
    names: Sequence[Way] = tuple(WAYS)
    along = {name: sum(a * b for a, b in zip(WAYS[name], asked, strict=True)) for name in names}
    ordered = [name for name in names if along[name] < 0.0] + [name for name in names if along[name] == 0.0]
    return next((name for name in ordered if can_go(WAYS[name])), None)
