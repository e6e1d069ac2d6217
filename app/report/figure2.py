"""The values of the paper's Fig. 2: what each reward wants, over the table plane, for a stated belief.

As the paper's figure this is a discretised plane: the goals are the layout's objects, all at the plane's height. The
arbiter looks at the information of a next state x' = T(x, u), whose momentum is u, the way it came. So a place has one
value for each way to come to it; `best` takes the largest of them over the moves within the plane, which is what the
arbiter can get there. One that looks at information otherwise (`information` of its parameters) is drawn as it looks.
Where the arm cannot be, nothing is drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from app.autonomy.actions import DIRECTIONS, UNIT_DIRECTIONS
from app.autonomy.arbiters.weighing import Weights, entropy_weights
from app.autonomy.belief import belief_entropy
from app.autonomy.hindsight import hindsight_reward_at
from app.autonomy.information import information_gain_at
from app.autonomy.interface import RATIONALITY_PER_M
from app.autonomy.looking import Looking
from app.autonomy.transition import TransitionModel
from app.errors import LabError
from app.trial.world import layout_in
from sim import ik
from sim.layouts import Layout, scene
from study.analysis.dataset import DataSet
from study.analysis.heatmap import FloatArray, Heatmap, HeatmapGoal

LIKELY = 0.34
"""Probability of each of the two likely goals; the others share the rest. The paper states no numbers."""
CELLS_A_METRE = 100.0
MOMENTA: Mapping[str, str] = {
    "best": "with the momentum of the move within the plane that makes it largest, as the arbiter evaluates it",
    "rest": "at rest, as the arbiter evaluates standing still",
    "averaged": "on average over the momentum that the person's next action leaves",
}
"""Which momentum a place is given, and how the caption says it."""
AS_IT_LOOKS: Mapping[str, str] = {"next": "best", "ahead": "best", "at_rest": "rest", "averaged": "averaged"}
"""The momentum that goes with an arbiter's `information`."""


def fig2_heatmap(
    settings: Mapping[str, Any], parameters: Mapping[str, Any], momentum: str | None = None, likely: float = LIKELY
) -> Heatmap:
    """Fig. 2 for a study's layout and objects (`settings`: its study file) under one trial's arbiter parameters.

    What is not stated there is the shipped study's: layout `arc` with its objects, and the model of `app.autonomy`.
    `likely` is the probability of each of the two likely goals; the momentum is the arbiter's if none is given. Raises
    `LabError` for a probability out of bounds, or for a momentum that is not one of `MOMENTA`.
    """
    momentum = AS_IT_LOOKS[str(parameters.get("information", "next"))] if momentum is None else momentum
    if momentum not in MOMENTA:
        raise LabError(f"momentum {momentum!r}; choices are {', '.join(MOMENTA)}")
    layout = layout_in(settings)
    placed = _placed(layout)
    transition = parameters.get("transition", {})
    model = TransitionModel(**transition) if transition else TransitionModel()
    rationality_per_m = float(parameters.get("rationality_per_m", RATIONALITY_PER_M))
    belief = _belief(len(placed), likely)
    z_m = float(np.mean([position[2] for position in placed.values()]))
    goals_m = np.array([(x, y, z_m) for x, y, _ in placed.values()])
    half_y_m = layout.table.size_m[1] / 2.0
    nearest_x_m = min(layout.start_world_m[0], *(item.release_world_m[0] for item in layout.bins))
    x_m = _axis(nearest_x_m - 0.05, ik.WORKSPACE_HIGH_M[0])
    y_m = _axis(layout.table.center_world_m[1] - half_y_m, layout.table.center_world_m[1] + half_y_m)
    grid = np.array([(x, y, z_m) for x in x_m for y in y_m])
    fits = ik.solve_many(grid)[1] == 0
    start_m = (layout.start_world_m[0], layout.start_world_m[1], z_m)
    information, reward = np.full(len(grid), np.nan), np.full(len(grid), np.nan)
    information[fits] = _information(momentum, grid[fits], goals_m, belief, model, rationality_per_m)
    reward[fits] = hindsight_reward_at(grid[fits], start_m, goals_m, belief)
    entropy = belief_entropy(belief)
    weights = {name: parameters[name] for name in ("alpha", "beta", "entropy_floor") if name in parameters}
    weighed = Weights(**{"alpha": 0.0, **weights})
    f1, f2 = entropy_weights(entropy, weighed.entropy_floor)
    return Heatmap(
        x_m=x_m,
        y_m=y_m,
        information=information.reshape(len(x_m), len(y_m)),
        reward=reward.reshape(len(x_m), len(y_m)),
        goals=tuple(
            HeatmapGoal(chr(ord("A") + index), float(x), float(y), float(belief[index]))
            for index, (x, y, _) in enumerate(goals_m)
        ),
        start_xy_m=start_m[:2],
        information_weight_m=float(weighed.alpha) * f1,
        reward_weight=weighed.beta * f2,
        caption=(
            f"(A) Expected information gain (eq. 11) of watching the next user action at each place, "
            f"{MOMENTA[momentum]}; (B) expected approach to the goals (eq. 7) at each place, against the start at "
            f"x = {start_m[0]:.2f} m, y = {start_m[1]:.2f} m. In both, colour is the share of the map's own range over "
            f"the places where the arm can be; the rest is grey. Layout “{layout.name}” at height {z_m:.2f} m; labels "
            f"are goals with their probability (entropy {entropy:.2f}); rationality κ = {rationality_per_m:g} per "
            f"metre, model step {model.step_m:g} m, transition “{model.kind}” with planning delay "
            f"{model.planning_delay:g}."
        ),
    )


def heatmap_of(data: DataSet) -> Heatmap | None:
    """Fig. 2 for a data set: its study file, and the parameters of the condition that gathers information.

    None when the logged parameters are not those of this lab's arbiter; the report says that the figure is missing.
    """
    studies, parameters = list(data.studies.values()), data.parameters
    try:
        chosen = gathering({name: of[-1] for name, of in parameters.items()})
        return fig2_heatmap(studies[-1] if studies else {}, parameters[chosen][-1])
    except (TypeError, ValueError, AttributeError, KeyError):  # AutonomyError is a ValueError
        return None


def gathering(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Of the conditions with these parameters, the one that weighs information most."""
    return max(parameters, key=lambda name: float(parameters[name].get("alpha", 0.0)))


def _information(
    momentum: str,
    places_m: FloatArray,
    goals_m: FloatArray,
    belief: FloatArray,
    model: TransitionModel,
    rationality_per_m: float,
) -> FloatArray:
    """Eq. 11 at each place (N, 3) -> (N,)."""
    if momentum == "averaged":
        return Looking("averaged").gains(places_m, places_m, goals_m, belief, model, rationality_per_m)
    within_plane = UNIT_DIRECTIONS[[z == 0 for _, _, z in DIRECTIONS]]  # standing still, which leaves none, too
    momenta = np.zeros((1, 3)) if momentum == "rest" else within_plane
    gains = [information_gain_at(places_m, each, goals_m, belief, model, rationality_per_m) for each in momenta]
    most: FloatArray = np.max(gains, axis=0)
    return most


def _placed(layout: Layout) -> dict[str, tuple[float, float, float]]:
    placed = scene(layout, [spec.id for spec in layout.objects[: len(layout.places)]]).objects
    return {item.spec.id: (*item.base_world_m[:2], item.base_world_m[2] + item.spec.grasp_height_m) for item in placed}


def _belief(count: int, likely: float) -> FloatArray:
    """The first and the fourth goal likely (as far apart as the paper's A and B), the others equally unlikely."""
    if count < 3:
        return np.full(count, 1.0 / count)
    if not 1.0 / count <= likely <= 0.5:
        raise LabError(
            f"likely is {likely:g}; each of two likely ones of {count} goals has from {1 / count:.3g} to 0.5"
        )
    belief = np.full(count, (1.0 - 2.0 * likely) / (count - 2))
    belief[[0, min(3, count - 1)]] = likely
    return belief


def _axis(low_m: float, high_m: float) -> FloatArray:
    return np.linspace(low_m, high_m, round((high_m - low_m) * CELLS_A_METRE) + 1)
