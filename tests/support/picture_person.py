"""Somebody who steers by what the pictures show and by nothing else: points on a screen, in pixels, a little off.

They know no position in the world. In the overview they see where the fingers are and where the top of the object is:
that is what one looks at from above. In the inset, if there is one, they see the same from the side. They line up, go
forward until fingers and object are at the same place in the picture, close, and lift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.autonomy.actions import Direction
from app.trial.engine import TrialEngine
from app.trial.values import UserInput
from sim.interface import Vector3
from sim.view.viewpoints import DEFAULT_VIEW, INSET, VIEWS, CameraView

OVERVIEW_PX = (930, 664)
INSET_PX = (304, 200)
"""Of the driving page in a window of 1280 by 720, the smallest in which everything is seen at once."""
NOISE_PX = 2.0
"""Standard deviation of where a point seems to be, right and up, anew every tick."""
NEAR_M = 0.012
"""Within little more than half of what one tick moves, they take a thing for reached."""
BACK_M = 0.10
"""So far before an object, as it looks, they go sideways."""
BELOW_TOP_M, ABOVE_BASE_M = 0.035, 0.05
"""In the inset they keep the fingers so far below the object's top and above its base, as it looks."""

Pixels = NDArray[np.float64]
"""(right, up), shape (2,)."""


@dataclass(frozen=True)
class Picture:
    """One picture on the page and how large a centimetre looks in it."""

    view: CameraView
    size_px: tuple[int, int]

    def of(self, point_world_m: Vector3) -> Pixels:
        """Where a point of the world appears."""
        wide_px, high_px = self.size_px
        right, up = self.view.in_picture(point_world_m, wide_px / high_px)
        return np.array([right * wide_px / 2.0, up * high_px / 2.0])


class PicturePerson:
    """See the module's text. `inset`: whether they look at the second picture, too."""

    def __init__(self, seed: int, inset: bool) -> None:
        self._rng = np.random.default_rng(seed)
        self._inset = inset
        self._lined_up = False
        self._closed_ticks = 0
        overview = Picture(VIEWS[DEFAULT_VIEW], OVERVIEW_PX)
        middle = (0.80, 0.0, 0.87)
        ahead, aside = overview.of((0.81, 0.0, 0.87)), overview.of((0.80, -0.01, 0.87))
        here = overview.of(middle)
        self._overview = overview
        self._forward_px_m = float((ahead - here)[1]) * 100.0
        self._aside_px_m = float((aside - here)[0]) * 100.0
        self._inset_px_m = INSET_PX[0] / (2.0 * INSET.half_width_m)

    def act(self, engine: TrialEngine) -> UserInput:
        """What they do in the next tick."""
        view = engine.view()
        if view.phase == "gripper":
            return UserInput()
        if view.gripper == "closed":
            self._closed_ticks += 1
            return UserInput((0, 0, 1)) if view.holding or self._closed_ticks < 3 else UserInput(gripper="open")
        self._closed_ticks = 0
        aside_m, forward_m, up_m = self._seen(engine)
        if not self._lined_up:
            back = forward_m < BACK_M - NEAR_M
            if abs(aside_m) > NEAR_M and back:
                return _go((-1, 0, 0))
            self._lined_up = abs(aside_m) <= NEAR_M and up_m == 0.0
            if not self._lined_up:
                return _go((0, _sign(aside_m), _sign(up_m)))
        if forward_m > NEAR_M:
            return _go((1, 0, 0))
        if forward_m < -NEAR_M:
            return _go((-1, 0, 0))
        return UserInput(gripper="close")

    def _seen(self, engine: TrialEngine) -> tuple[float, float, float]:
        """How far to the left, forward and up the object looks from the fingers, in metres as the pictures show it.

        Up is 0 when the fingers look right in height, or when no picture shows it.
        """
        world = engine.world
        fingers = world.position_world_gripper_m
        spec = engine.scene.object(engine.view().object).spec
        x_m, y_m, z_m = world.object(spec.id).pose.position_world_m
        top, base = (x_m, y_m, z_m + spec.size_m[2] / 2.0), (x_m, y_m, z_m - spec.size_m[2] / 2.0)
        right_px, up_px = self._look(self._overview, top) - self._look(self._overview, fingers)
        aside_m, forward_m = -right_px / self._aside_px_m, up_px / self._forward_px_m
        if not self._inset:
            return aside_m, forward_m, 0.0
        picture = Picture(INSET.at(fingers, INSET_PX[0] / INSET_PX[1]), INSET_PX)
        here = self._look(picture, fingers)
        top_m, base_m = ((self._look(picture, point) - here) / self._inset_px_m for point in (top, base))
        too_low_m, too_high_m = base_m[1] + ABOVE_BASE_M, BELOW_TOP_M - top_m[1]
        up_m = too_low_m if too_low_m > 0.0 else -too_high_m if too_high_m > 0.0 else 0.0
        return aside_m, float(top_m[0]), up_m

    def _look(self, picture: Picture, point_world_m: Vector3) -> Pixels:
        return picture.of(point_world_m) + self._rng.normal(0.0, NOISE_PX, 2)


def _sign(value: float) -> int:
    return 0 if abs(value) <= NEAR_M / 2.0 else 1 if value > 0.0 else -1


def _go(direction: Direction) -> UserInput:
    return UserInput(direction if any(direction) else None)
