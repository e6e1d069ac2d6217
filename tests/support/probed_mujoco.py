"""A robot on MuJoCo's physics that can be put back, and says what it touches."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

from sim.mujoco import MujocoRobot
from tests.support.rough_drives import TOUCH_M, ProbedRobot, Vector


class ProbedMujoco(ProbedRobot, MujocoRobot):
    """A world's data are all of its state."""

    def contacts(self) -> list[Vector]:
        model, data = self._model, self._data
        held = int(model.body_geomadr[self._held.body]) if self._held else -1
        root = model.body("base_link").id
        own = [
            shape == held or (model.body_rootid[body] == root and body != root)
            for shape, body in enumerate(model.geom_bodyid.tolist())
        ]
        found = []
        for one, other in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True):
            if own[one] != own[other]:
                ends = np.zeros(6)
                apart_m = mujoco.mj_geomDistance(model, data, one, other, TOUCH_M, ends)
                way = (ends[:3] - ends[3:]) * (1.0 if own[one] else -1.0) * (1.0 if apart_m > 0.0 else -1.0)
                length_m = float(np.linalg.norm(way))
                if apart_m < TOUCH_M and length_m > 0.0:
                    found.append(way / length_m)
        return found

    @contextmanager
    def _physics_kept(self) -> Iterator[Callable[[], None]]:
        saved = copy.copy(self._data)
        yield lambda: mujoco.mj_copyData(self._data, self._model, saved)
