"""A robot on pybullet's physics that can be put back, and says what it touches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pybullet

from sim.bullet import BulletRobot
from sim.interface import SLICE_S
from tests.support.rough_drives import TOUCH_M, ProbedRobot, Vector


class ProbedBullet(ProbedRobot, BulletRobot):
    """What motors are told is not a part of the state that pybullet saves."""

    def contacts(self) -> list[Vector]:
        client, held = self._client, self._held.body if self._held else None
        ours = [body for body in (self._arm, held) if body is not None]
        others = [body for body in range(pybullet.getNumBodies(physicsClientId=client)) if body not in ours]
        return [
            np.array(point[7])
            for own in ours
            for other in others
            for point in pybullet.getClosestPoints(own, other, TOUCH_M, physicsClientId=client)
        ]

    @contextmanager
    def _physics_kept(self) -> Iterator[Callable[[], None]]:
        saved = pybullet.saveState(physicsClientId=self._client)

        def put_back() -> None:
            pybullet.restoreState(stateId=saved, physicsClientId=self._client)
            pybullet.setPhysicsEngineParameter(fixedTimeStep=SLICE_S / self._steps, physicsClientId=self._client)
            self._drive_arm(self._joints_rad)
            self._drive_fingers()

        try:
            yield put_back
        finally:
            pybullet.removeState(saved, physicsClientId=self._client)
