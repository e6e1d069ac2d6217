"""Drives that end badly: an arm pushed into objects, bins, the table and the ends of its reach, on every layout."""

from __future__ import annotations

import copy
import math
from abc import abstractmethod
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, UNIT_DIRECTIONS, Direction, index_of
from app.trial.engine import TrialEngine
from app.trial.values import CycleSetup, TickResult, TrialSetup, UserInput
from sim.interface import SceneSpec
from sim.layouts import scene as layout_scene
from sim.physical import PhysicalRobot
from tests.support.arbiter_cases import CONDITIONS
from tests.support.engine_cases import CLOSE, DOWN, FORWARD, HANDS_OFF, OPEN, UP, Person, push, trial_setup
from tests.support.shipped_world import LAYOUTS

MOVES: tuple[Direction, ...] = tuple(way for way in DIRECTIONS if way != DIRECTIONS[NULL_ACTION])
Vector = np.ndarray[Any, np.dtype[np.float64]]
TOUCH_M = 0.008
"""What is as near as this counts as touched: a way into it is at its end before it has begun."""
INTO = -0.01
"""Cosine of a direction and a contact's normal below which the direction leads into the contact."""


@dataclass(frozen=True)
class Drive:
    """One of the drives; every combination comes in turn, everything else is drawn from the seed."""

    seed: int

    @property
    def layout(self) -> str:
        return list(LAYOUTS)[self.seed % len(LAYOUTS)]

    @property
    def condition(self) -> str:
        return CONDITIONS[self.seed // len(LAYOUTS) % len(CONDITIONS)]

    @property
    def beginning(self) -> str:
        return list(BEGINNINGS)[self.seed // (len(LAYOUTS) * len(CONDITIONS)) % len(BEGINNINGS)]

    @property
    def after(self) -> str:
        """Who moved last."""
        every = len(LAYOUTS) * len(CONDITIONS) * len(BEGINNINGS)
        return ("arbiter", "person")[(self.seed + self.seed // every) % 2]


class Hands:
    """Somebody at the controls of an engine who pushes on, and at times notices being pressed and stops."""

    def __init__(self, engine: TrialEngine, rng: np.random.Generator, side: int) -> None:
        self.engine, self.rng, self.side = engine, rng, side
        self.results: list[TickResult] = []
        self._pressed = 0
        self._stops_at = int(rng.integers(1, 14)) if rng.random() < 0.7 else 1000

    @property
    def has_stopped(self) -> bool:
        return self._pressed >= self._stops_at or self.engine.finished

    def act(self, given: UserInput) -> None:
        if not self.has_stopped:
            self.results.append(self.engine.tick(given))
            self._pressed += self.engine.world.lagging

    def push(self, direction: Direction, ticks: int) -> None:
        for _ in range(ticks):
            self.act(push(direction))

    def pushes(self, direction: Direction, least: int, most: int) -> None:
        self.push(direction, int(self.rng.integers(least, most + 1)))

    def off(self, ticks: int) -> None:
        for _ in range(ticks):
            if not self.engine.finished:
                self.results.append(self.engine.tick(HANDS_OFF))

    def go(self, axis: int, target_m: float) -> None:
        for _ in range(40):
            gap_m = target_m - self.engine.world.position_world_gripper_m[axis]
            if abs(gap_m) < 0.012:
                return
            x, y, z = (int(math.copysign(1, gap_m)) if index == axis else 0 for index in range(3))
            self.push((x, y, z), 1)


def _row(hands: Hands) -> None:
    hands.pushes((0, hands.side, 0), 0, 10)
    hands.pushes(FORWARD, 8, 12)


def _low(hands: Hands) -> None:
    hands.pushes(DOWN, 0, 5)
    hands.pushes((0, hands.side, 0), 0, 9)
    hands.pushes((1, int(hands.rng.integers(0, 2)) * hands.side, int(hands.rng.integers(-1, 1))), 6, 15)


def _above(hands: Hands) -> None:
    hands.push(UP, 10)
    hands.pushes((0, hands.side, 0), 0, 9)
    hands.pushes(FORWARD, 4, 13)
    hands.pushes(DOWN, 8, 19)


def _bin(hands: Hands) -> None:
    bins = hands.engine.scene.bins
    x_m, y_m, _ = bins[int(hands.rng.integers(len(bins)))].release_world_m
    for axis, target_m in ((2, 0.95), (0, x_m), (1, y_m)):
        hands.go(axis, target_m)
    hands.pushes(DOWN, 6, 15)


def _holding(hands: Hands) -> None:
    person = Person()
    for _ in range(80):
        if hands.engine.finished or hands.engine.world.held:
            break
        hands.act(person(hands.engine))
    if hands.rng.random() < 0.4:
        hands.pushes(UP, 0, 4)


def _closed(hands: Hands) -> None:
    hands.pushes(MOVES[int(hands.rng.integers(len(MOVES)))], 0, 4)
    hands.act(CLOSE)
    hands.off(2)
    hands.pushes((0, hands.side, int(hands.rng.integers(-1, 1))), 0, 9)
    hands.pushes((1, 0, int(hands.rng.integers(-1, 1))), 6, 15)


BEGINNINGS: dict[str, Callable[[Hands], None]] = {
    "row": _row,
    "low": _low,
    "above": _above,
    "bin": _bin,
    "holding": _holding,
    "closed": _closed,
}
"""Into the row of objects; low, to the table; from above; down onto and into a bin; with an object; with a fist."""


def driven(drive: Drive, robot: ProbedRobot) -> tuple[TrialEngine, list[TickResult]]:
    """The engine after the drive, and the ticks of it."""
    rng = np.random.default_rng(drive.seed)
    side = 1 if rng.random() < 0.5 else -1
    robot.probed = False
    engine = TrialEngine(_setup(drive, rng, side), robot)
    engine.open()
    hands = Hands(engine, rng, side)
    BEGINNINGS[drive.beginning](hands)
    for _ in range(int(rng.integers(0, 4))):
        x, y, z = MOVES[int(rng.integers(len(MOVES)))]
        hands.pushes((x, y, min(z, 0) if rng.random() < 0.6 else z), 4, 15)
        chance = rng.random()
        if chance < 0.15:
            hands.act(CLOSE if rng.random() < 0.7 else OPEN)
        elif chance < 0.5:
            hands.off(int(rng.integers(1, 13)))
    if drive.after == "arbiter":
        hands.off(int(rng.integers(1, 13)))
    else:
        hands.pushes((1, int(rng.integers(-1, 2)), int(rng.integers(-1, 1))), 3, 11)
    while not engine.finished and engine.view().phase != "operating":
        engine.tick(HANDS_OFF)
    return engine, hands.results


def _setup(drive: Drive, rng: np.random.Generator, side: int) -> TrialSetup:
    """The instructed object stands on the other side, so that the cycle does not end with the first thing felled."""
    layout = LAYOUTS[drive.layout]
    placement = rng.permutation([spec.id for spec in layout.objects])[: len(layout.places)].tolist()
    far = sorted(range(len(placement)), key=lambda index: side * layout.places[index][1])
    scene: SceneSpec = layout_scene(layout, placement, placement)
    chosen = placement[far[0 if rng.random() < 0.8 else 1]]
    bin_id = layout.bins[int(rng.integers(len(layout.bins)))].id
    setup = trial_setup(drive.condition)
    return replace(setup, cycles=(CycleSetup(scene, chosen, bin_id),) * 6)


class ProbedRobot(PhysicalRobot):
    """A robot that can be put back: many ways out are tried from one state. Probed, it does not begin a new world."""

    probed = False

    def reset(self, scene: SceneSpec) -> None:
        if not self.probed:
            super().reset(scene)

    @abstractmethod
    def contacts(self) -> list[Vector]:
        """Normals, towards the arm or what it holds, of everything that either touches."""

    @abstractmethod
    def _physics_kept(self) -> AbstractContextManager[Callable[[], None]]:
        """The physics as it is now; what is yielded puts it back."""

    def leads_away(self, direction: Direction) -> bool:
        """Whether no part of a direction leads into anything that the arm or what it holds touches."""
        way = UNIT_DIRECTIONS[index_of(direction)]
        return all(float(way @ normal) >= INTO for normal in self.contacts())

    def states(self, engine: TrialEngine) -> Generator[TrialEngine, None, None]:
        """Copies of the engine, without end: at each, the robot is as it is now."""
        self.probed = True
        kept = copy.deepcopy({key: value for key, value in vars(self).items() if key not in _SHARED})
        held, rests = self._held, [item.rest_slices for item in self._bodies]
        with self._physics_kept() as put_back:
            try:
                while True:
                    vars(self).update(copy.deepcopy(kept))
                    self._held = held
                    for item, rest in zip(self._bodies, rests, strict=True):
                        item.rest_slices = rest
                    put_back()
                    yield copy.deepcopy(engine, {id(self): self})
            finally:
                self.probed = False


_SHARED = ("_scene", "_bodies", "_held", "_model", "_data")
