"""What the robot thinks, for whoever watches: the participant's side has none of it.

A tick's row holds the state, the belief and the choice; what spoke for the choice comes from the arbiter itself, by way
of the worker it runs in.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.autonomy.hindsight import hindsight_reward_at
from app.autonomy.information import information_gain_at
from app.autonomy.interface import Explanation
from app.trial.labels import Labels
from app.trial.values import TrialSetup
from sim.interface import SceneSpec, Vector3
from study.records import TickRow

PlaneKind = Literal["information", "reward"]
CELL_M = 0.02
MARGIN_M = 0.05


@dataclass(frozen=True)
class Goal:
    """A candidate goal of a tick: position in the world frame, metres, and its probability."""

    id: str
    label: str
    position_m: Vector3 | None
    """None while the arm goes back and the belief is still about the last goals."""
    probability: float
    instructed: bool


@dataclass(frozen=True)
class TickExplanation:
    """One tick as the experimenter sees it."""

    phase: str
    trial: int
    tick: int
    trial_s: float
    task: int | None
    kind: str | None
    source: str
    departure: float | None
    """How far the action is from what the participant asked, 0 to 2; None where they asked for nothing."""
    position_m: Vector3
    action: tuple[int, int, int] | None
    user: tuple[int, int, int] | None
    gripper: str
    held: str | None
    blocked: bool
    blocked_reason: str | None
    late_ms: float | None
    entropy: float
    goals: tuple[Goal, ...]
    explanation: Explanation
    """What the arbiter says of its action, by name; empty where it chose none. The paper's arbiters tell `information`
    (eq. 11, units of log |goals|), `reward_m` (eq. 7, metres), what the two weigh, and their sum, the `score`."""


def explain_tick(row: TickRow, told: Explanation, setup: TrialSetup, labels: Labels) -> TickExplanation:
    """Everything about a tick that the experimenter's page shows; `told` is what the arbiter said of it."""
    places, belief = json.loads(row.goals), json.loads(row.belief)
    action = _direction(row.action_x, row.action_y, row.action_z)
    goals = tuple(
        Goal(name, label_of(name, labels), _vector(places.get(name)), float(probability), name == row.goal)
        for name, probability in belief.items()
    )
    return TickExplanation(
        phase=setup.kind,
        trial=row.trial,
        tick=row.tick,
        trial_s=row.trial_s,
        task=row.task,
        kind=row.kind,
        source=row.source,
        departure=row.departure,
        position_m=(row.p_x, row.p_y, row.p_z),
        action=action,
        user=_direction(row.user_x, row.user_y, row.user_z),
        gripper=row.gripper,
        held=row.held,
        blocked=bool(row.blocked),
        blocked_reason=row.blocked_reason,
        late_ms=row.late_ms,
        entropy=row.entropy,
        goals=goals,
        explanation={} if action is None else dict(told),
    )


def label_of(name: str, labels: Labels) -> str:
    """The words for an object or a bin."""
    return labels.objects.get(name) or labels.bins.get(name) or name


@dataclass(frozen=True)
class Plane:
    """One of the two heatmaps of paper Fig. 2, for a live tick. `values` has a row for each x, a column for each y."""

    kind: PlaneKind
    tick: int
    z_m: float
    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]
    unit: str
    caption: str
    goals: tuple[Goal, ...]
    gripper_m: Vector3
    table_m: tuple[float, float, float, float]
    """The table top: least x, most x, least y, most y."""


def plane_of(row: TickRow, setup: TrialSetup, labels: Labels, kind: PlaneKind) -> Plane:
    """Fig. 2 for the state after a tick: each place of the plane at the gripper's height, under the belief of the tick.

    The plane covers the table, the goals and the gripper. Information (A) is eq. 11 of standing there at rest and
    watching the next action; reward (B) is eq. 7 of standing there instead of where the gripper was.
    """
    names, goals_m, belief = _goals(row)
    gripper: Vector3 = (row.p_x, row.p_y, row.p_z)
    x_m, y_m = _axes(setup.cycles[0].scene, np.vstack([goals_m, gripper]))
    grid = np.array([(x, y, gripper[2]) for x in x_m for y in y_m])
    models = setup.models
    if kind == "information":
        values = information_gain_at(
            grid, (0.0, 0.0, 0.0), goals_m, belief, models.transition, models.rationality_per_m
        )
        caption = "Expected information gain (eq. 11) of watching the next user action at each place, from rest."
        unit = "of the whole uncertainty"
    else:
        values = hindsight_reward_at(grid, gripper, goals_m, belief)
        caption = "Expected approach to the goals (eq. 7) of standing at each place instead of at the gripper's."
        unit = "m"
    shown = values.reshape(len(x_m), len(y_m)).round(6)
    table = _table(setup.cycles[0].scene)
    return Plane(
        kind=kind,
        tick=row.tick,
        z_m=round(gripper[2], 3),
        x_m=tuple(x_m.round(4).tolist()),
        y_m=tuple(y_m.round(4).tolist()),
        values=tuple(tuple(line) for line in shown.tolist()),
        unit=unit,
        caption=caption,
        goals=tuple(
            Goal(name, label_of(name, labels), _vector(goals_m[index].tolist()), float(belief[index]), name == row.goal)
            for index, name in enumerate(names)
        ),
        gripper_m=gripper,
        table_m=table,
    )


def _goals(row: TickRow) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Ids, positions (G, 3) and belief (G,). While the arm goes back, the new goals are all alike to it."""
    places: Mapping[str, list[float]] = json.loads(row.goals)
    belief: Mapping[str, float] = json.loads(row.belief)
    names = list(places)
    fits = places.keys() == belief.keys()
    probabilities = [belief[name] for name in names] if fits else [1.0 / len(names)] * len(names)
    return names, np.array(list(places.values())), np.array(probabilities)


def _vector(values: Sequence[float] | None) -> Vector3 | None:
    if values is None:
        return None
    x, y, z = (float(value) for value in values)
    return x, y, z


def _direction(x: int | None, y: int | None, z: int | None) -> tuple[int, int, int] | None:
    return None if x is None or y is None or z is None else (x, y, z)


def _table(scene: SceneSpec) -> tuple[float, float, float, float]:
    center, size = scene.table.center_world_m, scene.table.size_m
    return (
        center[0] - size[0] / 2.0,
        center[0] + size[0] / 2.0,
        center[1] - size[1] / 2.0,
        center[1] + size[1] / 2.0,
    )


def _axes(scene: SceneSpec, places_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low_x, high_x, low_y, high_y = _table(scene)
    low = np.minimum((low_x, low_y), places_m[:, :2].min(axis=0) - MARGIN_M)
    high = np.maximum((high_x, high_y), places_m[:, :2].max(axis=0) + MARGIN_M)
    x_m, y_m = (np.linspace(a, b, round((b - a) / CELL_M) + 1) for a, b in zip(low, high, strict=True))
    return x_m, y_m
