"""Where expected information is looked at: in the state that an action leads to, as the paper prints it, or elsewhere.

With x = (p, m) and T(x, u) = (p', u), the information of action u is I(xi, x') of eq. 11 at

- ``next``      x' = T(x, u), the printed equation;
- ``ahead``     x' = (p + look_ahead u, u), a stated distance on in the direction of u; staying looks at T(x, 0);
- ``at_rest``   x' = (p', 0), the place alone: the person acts when the arm has come to rest;
- ``averaged``  sum_v P(v | b, (p', 0)) I(xi, (p', v)): the person acts there, and from then on with what momentum that
  leaves; v is each of their 27 actions, as probable as the belief makes it.

The first also prefers actions whose *momentum* makes the person's next action telling; the others ask for the place
rather.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from app.autonomy.actions import NULL_ACTION, UNIT_DIRECTIONS
from app.autonomy.arrays import FloatArray, checked_point_m, distances_m
from app.autonomy.belief import log_softmax
from app.autonomy.errors import AutonomyError
from app.autonomy.information import information_gain_ahead, mutual_information
from app.autonomy.transition import TransitionModel

Place = Literal["next", "ahead", "at_rest", "averaged"]
MAX_LOOK_AHEAD_M = 1.0


@dataclass(frozen=True)
class Looking:
    """One of the four.

    Args:
        place: which.
        look_ahead_m: how far on ``ahead`` looks, metres, in (0, 1].
        at_rest: whether the momentum is taken as 0 there: what is left is about the place. No arbiter looks so but the
            one ``at_rest``; it tells what the others look for (`app.replication.mechanism`).

    Raises:
        AutonomyError: a value outside these bounds.
    """

    place: Place = "next"
    look_ahead_m: float = 0.20
    at_rest: bool = False

    def __post_init__(self) -> None:
        if self.place not in get_args(Place):
            raise AutonomyError(f"information is {self.place!r}; choose one of {', '.join(get_args(Place))}")
        if not 0.0 < self.look_ahead_m <= MAX_LOOK_AHEAD_M:
            bound = f"(0, {MAX_LOOK_AHEAD_M:g}] metres"
            raise AutonomyError(f"look_ahead_m is {self.look_ahead_m!r}; it must be in {bound}")

    def gains(
        self,
        position_m: FloatArray,
        next_positions_m: FloatArray,
        goals_m: FloatArray,
        probabilities: FloatArray,
        model: TransitionModel,
        rationality_per_m: float,
    ) -> FloatArray:
        """I of each action, (27,), of values already checked; ``next_positions_m`` is p' of T(x, u), (27, 3)."""
        given = goals_m, probabilities, model, rationality_per_m
        places_m = next_positions_m
        if self.place == "ahead":
            places_m = position_m + self.look_ahead_m * UNIT_DIRECTIONS
            places_m[NULL_ACTION] = next_positions_m[NULL_ACTION]
        if self.place in ("next", "ahead") and not self.at_rest:
            return information_gain_ahead(places_m, *given)
        at_rest = _log_likelihoods(places_m, model.displacements(np.zeros(3))[:, None], goals_m, rationality_per_m)
        if self.place == "averaged":
            return _averaged(np.exp(at_rest) @ probabilities, places_m, *given)
        return mutual_information(at_rest, probabilities)


def _averaged(
    weights: FloatArray,  # (27 of the person's first action v, 27 of u)
    places_m: FloatArray,  # (27 of u, 3)
    goals_m: FloatArray,
    probabilities: FloatArray,
    model: TransitionModel,
    rationality_per_m: float,
) -> FloatArray:
    then_m = model.displacements_ahead()  # (27 of the person's next action, 27 of v, 3)
    averages = np.empty(len(places_m))
    for index, place_m in enumerate(places_m):  # all at once would take 27 times the memory, and no less time
        likelihoods = _log_likelihoods(place_m, then_m, goals_m, rationality_per_m)  # (27, 27, G)
        averages[index] = weights[:, index] @ mutual_information(likelihoods, probabilities)
    return averages


def _log_likelihoods(places_m: FloatArray, moves_m: FloatArray, goals_m: FloatArray, kappa: float) -> FloatArray:
    """log P(u' | phi, x') with the person's action u' first: places (..., 3), moves (27, ..., 3) -> (27, ..., G)."""
    rewards_m = distances_m(places_m, goals_m) - distances_m(places_m + moves_m, goals_m)
    return log_softmax(kappa * rewards_m, axis=0)


def look(
    looking: Looking,
    position_m: FloatArray,
    momentum: FloatArray,
    goals_m: FloatArray,
    probabilities: FloatArray,
    model: TransitionModel,
    rationality_per_m: float,
) -> FloatArray:
    """I of each action of one state, (27,), for whoever has no next positions at hand; (3,), (3,), (G, 3), (G,)."""
    here_m = checked_point_m("position_m", position_m)
    return looking.gains(
        here_m, here_m + model.displacements(momentum), goals_m, probabilities, model, rationality_per_m
    )
