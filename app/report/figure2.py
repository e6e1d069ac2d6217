"""The values of the paper's Fig. 2: what each reward wants, over the table plane, for a stated belief.

As the paper's figure this is a discretised plane: the goals are the layout's objects, all at the plane's height.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from app.autonomy.hindsight import hindsight_reward_at
from app.autonomy.information import information_gain_at
from app.autonomy.interface import RATIONALITY_PER_M
from app.autonomy.transition import TransitionModel
from app.trial.world import layout_in
from sim.layouts import Layout, scene
from study.analysis.dataset import DataSet
from study.analysis.figures import Heatmap, HeatmapGoal

LIKELY = 0.34
"""Probability of each of the two likely goals; the others share the rest. The paper states no numbers."""
CELLS_A_METRE = 200.0


def fig2_heatmap(settings: Mapping[str, Any], parameters: Mapping[str, Any]) -> Heatmap:
    """Fig. 2 for a study's layout and objects (`settings`: its study file) under one trial's arbiter parameters.

    What is not stated there is the shipped study's: layout `arc` with its objects, and the model of `app.autonomy`.
    """
    layout = layout_in(settings)
    placed = _placed(layout)
    transition = parameters.get("transition", {})
    model = TransitionModel(**transition) if transition else TransitionModel()
    rationality_per_m = float(parameters.get("rationality_per_m", RATIONALITY_PER_M))
    names = list(placed)
    belief = _belief(len(names))
    z_m = float(np.mean([position[2] for position in placed.values()]))
    goals_m = np.array([(x, y, z_m) for x, y, _ in placed.values()])
    table = layout.table
    half_y_m = table.size_m[1] / 2.0
    x_m = _axis(layout.start_world_m[0] - 0.05, table.center_world_m[0] + table.size_m[0] / 2.0)
    y_m = _axis(table.center_world_m[1] - half_y_m, table.center_world_m[1] + half_y_m)
    grid = np.array([(x, y, z_m) for x in x_m for y in y_m])
    start_m = (layout.start_world_m[0], layout.start_world_m[1], z_m)
    information = information_gain_at(grid, (0.0, 0.0, 0.0), goals_m, belief, model, rationality_per_m)
    reward = hindsight_reward_at(grid, start_m, goals_m, belief)
    return Heatmap(
        x_m=x_m,
        y_m=y_m,
        information=information.reshape(len(x_m), len(y_m)),
        reward=reward.reshape(len(x_m), len(y_m)),
        goals=tuple(
            HeatmapGoal(chr(ord("A") + index), float(x), float(y), float(belief[index]))
            for index, (x, y, _) in enumerate(goals_m)
        ),
        caption=(
            "(A) Expected information gain (eq. 11) of watching the next user action at each place, from rest; (B) "
            f"expected approach to the goals (eq. 7) at each place, against the start at x = {start_m[0]:.2f} m, "
            f"y = {start_m[1]:.2f} m. Layout “{layout.name}” at height {z_m:.2f} m; labels are goals with their "
            f"probability; rationality κ = {rationality_per_m:g} per metre, model step {model.step_m:g} m, transition "
            f"“{model.kind}” with planning delay {model.planning_delay:g}."
        ),
    )


def heatmap_of(data: DataSet) -> Heatmap | None:
    """Fig. 2 for a data set: its study file, and the parameters of the condition that gathers information.

    None when the logged parameters are not those of this lab's arbiter; the report says that the figure is missing.
    """
    studies, parameters = list(data.studies.values()), data.parameters
    try:
        condition = max(parameters, key=lambda name: float(parameters[name][-1].get("alpha", 0.0)))
        return fig2_heatmap(studies[-1] if studies else {}, parameters[condition][-1])
    except (TypeError, ValueError, AttributeError):  # AutonomyError is a ValueError
        return None


def _placed(layout: Layout) -> dict[str, tuple[float, float, float]]:
    placed = scene(layout, [spec.id for spec in layout.objects[: len(layout.places)]]).objects
    return {item.spec.id: (*item.base_world_m[:2], item.base_world_m[2] + item.spec.grasp_height_m) for item in placed}


def _belief(count: int) -> np.ndarray:
    """The first and the fourth goal likely (as far apart as the paper's A and B), the others equally unlikely."""
    if count < 3:
        return np.full(count, 1.0 / count)
    belief = np.full(count, (1.0 - 2.0 * LIKELY) / (count - 2))
    belief[[0, min(3, count - 1)]] = LIKELY
    return belief


def _axis(low_m: float, high_m: float) -> np.ndarray:
    return np.linspace(low_m, high_m, round((high_m - low_m) * CELLS_A_METRE) + 1)
