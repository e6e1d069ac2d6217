"""Recorded inputs given to several robots side by side, up to the first contact.

Every attempt at a pick-and-place begins in a fresh world, so each is run by itself: the same inputs, tick by tick, to
an engine of its own for every robot. The first robot named is the one the others are held against. A robot is followed

- up to the tick in which something is touched on it or on the first one: an object has moved by more than
  `TOUCHED_M`, is held, or the arm is pressed against something; at the latest until a gripper button is pressed;
- no further than the arbiter chooses the same on both, and both are refused the same: after that the commands differ,
  and with them the ways.

Up to there every command is the same, and what is apart is physics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.physics_comparison.choices import WHYS, Why, why_otherwise
from app.physics_comparison.recorded import Recorded
from app.trial.engine import TrialEngine
from app.trial.tick_rows import RETURNING
from app.trial.values import CycleStart, TickResult, TrialSetup, inputs_of
from sim.fetch import link_poses
from sim.interface import SLICES_PER_TICK, QuaternionWxyz, Robot, Vector3, WorldState
from study.records import TickRow

TOUCHED_M = 0.001
"""An object that is farther than this from where it stood has been touched."""
STANDS_M = 1e-5
"""A gripper that goes less than this in a slice counts as standing."""
MM = 1000.0

Ended = Literal["contact", "gripper", "choice", "refusal", "recording"]
ENDS: Mapping[Ended, str] = {
    "contact": "something was touched",
    "gripper": "a gripper button was pressed",
    "choice": "the arbiter chose otherwise",
    "refusal": "a motion was refused on one of the two",
    "recording": "the recording ended",
}


@dataclass(frozen=True)
class Followed:
    """One attempt on one robot, beside the first robot."""

    robot: str
    participant: str
    condition: str
    trial: int
    cycle: int
    attempt: int
    ended: Ended
    ticks: int
    """Ticks with the same commands on both."""
    choices: int
    """Of these, and the one after them, ticks in which the arbiter chose by itself."""
    same_choices: int
    why: Why | None
    """Why it chose otherwise, where that is the end."""
    apart_mm: tuple[float, ...] = field(repr=False)
    """Distance between the grippers after each slice of these ticks (1/30 s)."""
    behind_mm: tuple[float, ...] = field(repr=False)
    """How far this robot's gripper is behind the first one's along its way, after each slice of that one's motion."""
    beside_mm: tuple[float, ...] = field(repr=False)
    """And how far off to the side of it."""
    turned_deg: tuple[float, ...] = field(repr=False)
    """Angle between the two grippers after each tick."""


def follow(recorded: Recorded, robots: Mapping[str, Callable[[], Robot]]) -> list[Followed]:
    """Every attempt of a recorded trial on every robot but the first."""
    made = {name: make() for name, make in robots.items()}
    try:
        return [one for rows in recorded.attempts() for one in _Attempt(recorded, rows, made).run()]
    finally:
        for robot in made.values():
            robot.close()


class _Beside:
    """One robot and the first one, as far as they can be followed."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.ended: Ended | None = None
        self.ticks = self.choices = self.same_choices = 0
        self.why: Why | None = None
        self.apart_mm: list[float] = []
        self.behind_mm: list[float] = []
        self.beside_mm: list[float] = []
        self.turned_deg: list[float] = []

    def take(self, setup: TrialSetup, first: _Way, other: _Way) -> None:
        """What came of one tick on both."""
        self.ended = _parted(first, other)
        if first.result.row.source == "robot" or other.result.row.source == "robot":
            self.choices += 1
            self.same_choices += self.ended != "choice"
        if self.ended == "choice":
            self.why = why_otherwise(setup, first.result.row, other.result.row)
        if self.ended is not None:
            return
        self.ticks += 1
        here_m = first.began_m
        for one_m, other_m in zip(first.places_m, other.places_m, strict=True):
            off_m = np.subtract(other_m, one_m)
            way_m = np.subtract(one_m, here_m)
            here_m = one_m
            self.apart_mm.append(float(np.linalg.norm(off_m)) * MM)
            length_m = float(np.linalg.norm(way_m))
            if length_m > STANDS_M:
                along_m = float(off_m @ way_m) / length_m
                self.behind_mm.append(-along_m * MM)
                self.beside_mm.append(math.sqrt(max(float(off_m @ off_m) - along_m**2, 0.0)) * MM)
        self.turned_deg.append(math.degrees(angle_rad(gripper_turn(first.world), gripper_turn(other.world))))

    def told(self, recorded: Recorded, row: TickRow) -> Followed:
        """As a value, at the end."""
        return Followed(
            robot=self.name,
            participant=recorded.setup.participant,
            condition=recorded.setup.condition,
            trial=recorded.setup.trial,
            cycle=row.cycle,
            attempt=row.attempt,
            ended=self.ended or "recording",
            ticks=self.ticks,
            choices=self.choices,
            same_choices=self.same_choices,
            why=self.why,
            apart_mm=tuple(self.apart_mm),
            behind_mm=tuple(self.behind_mm),
            beside_mm=tuple(self.beside_mm),
            turned_deg=tuple(self.turned_deg),
        )


@dataclass(frozen=True)
class _Way:
    """One tick on one robot."""

    began_m: Vector3
    places_m: tuple[Vector3, ...]
    world: WorldState
    result: TickResult
    touched: bool


class _Attempt:
    """The engines of all robots for one attempt."""

    def __init__(self, recorded: Recorded, rows: Sequence[TickRow], robots: Mapping[str, Robot]) -> None:
        self._recorded, self._rows = recorded, rows
        begun = CycleStart(cycle=rows[0].cycle, first_tick=rows[0].tick, attempt=rows[0].attempt)
        self._engines = {name: TrialEngine(recorded.setup, robot, begun) for name, robot in robots.items()}
        self._stood: dict[str, dict[str, Vector3]] = {}

    def run(self) -> list[Followed]:
        for name, engine in self._engines.items():
            engine.open()
            self._stood[name] = {item.id: item.pose.position_world_m for item in engine.world.objects}
        first, *others = self._engines
        beside = [_Beside(name) for name in others]
        for row in self._rows:
            followed = [one for one in beside if one.ended is None]
            if not followed:
                break
            if row.gripper_input is not None:
                for one in followed:
                    one.ended = "gripper"
                break
            way = self._tick(first, row)
            for one in followed:
                one.take(self._recorded.setup, way, self._tick(one.name, row))
        return [one.told(self._recorded, self._rows[0]) for one in beside]

    def _tick(self, name: str, row: TickRow) -> _Way:
        engine = self._engines[name]
        began_m, places_m = engine.world.position_world_gripper_m, []
        engine.begin(inputs_of(row))
        for _ in range(SLICES_PER_TICK):
            engine.advance()
            places_m.append(engine.world.position_world_gripper_m)
        world = engine.world
        return _Way(began_m, tuple(places_m), world, engine.end(), self._touches(name, world))

    def _touches(self, name: str, world: WorldState) -> bool:
        stood = self._stood[name]
        moved = any(math.dist(item.pose.position_world_m, stood[item.id]) > TOUCHED_M for item in world.objects)
        return moved or world.held is not None or world.lagging


def _parted(first: _Way, other: _Way) -> Ended | None:
    """Why the two are not followed any further, if so."""
    one, two = first.result.row, other.result.row
    if one.source in RETURNING or two.source in RETURNING:
        return None
    if first.touched or other.touched:
        return "contact"
    if (one.source, one.action_x, one.action_y, one.action_z) != (two.source, two.action_x, two.action_y, two.action_z):
        return "choice"
    return "refusal" if (one.blocked, one.blocked_reason) != (two.blocked, two.blocked_reason) else None


def gripper_turn(world: WorldState) -> QuaternionWxyz:
    """The gripper's orientation in the world frame, (w, x, y, z), from the joints."""
    return link_poses(world.joint_positions_rad, world.finger_opening_m)["gripper_link"][1]


def angle_rad(one: QuaternionWxyz, other: QuaternionWxyz) -> float:
    """The angle between two orientations, 0 to π."""
    # By the vector part of one⁻¹ · other: the arc cosine of the scalar part has no digits left for small angles.
    (w, x, y, z), (a, b, c, d) = one, other
    vector = (w * b - x * a - y * d + z * c, w * c + x * d - y * a - z * b, w * d - x * c + y * b - z * a)
    return 2.0 * math.atan2(math.hypot(*vector), abs(w * a + x * b + y * c + z * d))


# ---- many attempts together -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Paths:
    """One robot beside the first one, over all attempts."""

    robot: str
    attempts: int
    ticks: int
    choices: int
    same_choices: int
    why: Mapping[Why, int]
    """Why the others are others, to how many."""
    ended: Mapping[Ended, int]
    """Why attempts were not followed further, to how many."""
    apart_mm: tuple[float, ...] = field(repr=False)
    """Percentiles 0 to 100 of the distance between the grippers."""
    apart_quantile_mm: float
    """At the rule's quantile."""
    behind_mm: float
    """Median, while the first robot moves; negative = ahead of it."""
    beside_mm: float
    """Likewise, to the side of its way."""
    turned_deg: tuple[float, float, float]
    """Median, the rule's quantile, most."""

    @property
    def same_share(self) -> float:
        """Share of the arbiter's own choices that are the same; NaN where it made none."""
        return self.same_choices / self.choices if self.choices else math.nan


def pooled(followed: Sequence[Followed], quantile: float) -> tuple[Paths, ...]:
    """All attempts, robot by robot."""
    found = []
    for robot in dict.fromkeys(one.robot for one in followed):
        of = [one for one in followed if one.robot == robot]
        apart, behind, beside, turned = (
            np.array([value for one in of for value in values(one)]) for values in _SAMPLES
        )
        found.append(
            Paths(
                robot=robot,
                attempts=len(of),
                ticks=sum(one.ticks for one in of),
                choices=sum(one.choices for one in of),
                same_choices=sum(one.same_choices for one in of),
                why={why: sum(one.why == why for one in of) for why in WHYS},
                ended={why: sum(one.ended == why for one in of) for why in ENDS},
                apart_mm=tuple(_quantile(apart, percent / 100.0) for percent in range(101)),
                apart_quantile_mm=_quantile(apart, quantile),
                behind_mm=_quantile(behind, 0.5),
                beside_mm=_quantile(beside, 0.5),
                turned_deg=(_quantile(turned, 0.5), _quantile(turned, quantile), _quantile(turned, 1.0)),
            )
        )
    return tuple(found)


_SAMPLES: tuple[Callable[[Followed], tuple[float, ...]], ...] = (
    lambda one: one.apart_mm,
    lambda one: one.behind_mm,
    lambda one: one.beside_mm,
    lambda one: one.turned_deg,
)


def _quantile(values: NDArray[np.float64], share: float) -> float:
    return float(np.quantile(values, share)) if len(values) else math.nan
