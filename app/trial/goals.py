"""The candidate goals of a tick, as the arbiter and as the record want them. Pure."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from app.autonomy.arrays import frozen
from app.autonomy.belief import Belief
from app.trial.verdicts import release_points
from sim.interface import SceneSpec, Vector3, WorldState

Places = tuple[tuple[str, Vector3], ...]
"""Goal ids with their positions in the world frame, metres."""

_ENCODER = json.JSONEncoder(separators=(",", ":"))


@dataclass(frozen=True, eq=False)
class Goals:
    """Made once and kept for as long as nothing moves."""

    places_m: Places
    ids: tuple[str, ...]
    positions_m: npt.NDArray[np.float64]
    """(G, 3), world frame; read-only, since parts that others wrote are given it."""
    text: str
    """JSON: goal id to its position."""

    @classmethod
    def at(cls, places_m: Places) -> Goals:
        """The goals at those places."""
        positions_m = frozen(np.array([position for _, position in places_m]))
        return cls(places_m, tuple(name for name, _ in places_m), positions_m, compact_json(dict(places_m)))


def candidates(world: WorldState, scene: SceneSpec) -> Places:
    """The bins while something is held, else the objects of the scene where they are now."""
    if world.held is not None:
        return tuple(release_points(scene.bins).items())
    return tuple([(item.id, item.grasp_world_m) for item in world.objects])


def compact_json(value: Any) -> str:
    """JSON without spaces."""
    return _ENCODER.encode(value)


def belief_text(belief: Belief) -> str:
    """JSON: goal id to probability, as `compact_json` has it."""
    names = _names_of(belief.goal_ids)
    numbers = map(repr, belief.probabilities.tolist())
    return "{" + ",".join([name + number for name, number in zip(names, numbers, strict=True)]) + "}"


@lru_cache(maxsize=1024)
def _names_of(goal_ids: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{compact_json(name)}:" for name in goal_ids)
