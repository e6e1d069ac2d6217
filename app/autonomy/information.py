"""Expected information gain of going somewhere and watching the person act there (paper III-D, eqs. 8-11).

Eq. 11 sums the entropies of the 27 posteriors that the person's next action could leave. No posterior has to
be formed: with p(u) = sum_phi P(u | phi, x') b(phi) it equals the mutual information between goal and next
    action,

    I(x') = sum_phi b(phi) sum_u P(u | phi, x') (log P(u | phi, x') - log p(u)) / log |Phi|.

This form never subtracts two large entropies, so equal gains come out equal to about 1e-17; H minus expected
entropy loses ten times more, which a large alpha would turn into false preferences between tied actions.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.autonomy.actions import UNIT_DIRECTIONS
from app.autonomy.arrays import (
    FloatArray,
    checked_goals_m,
    checked_momenta,
    checked_points_m,
    checked_probabilities,
)
from app.autonomy.belief import belief_entropy, log_likelihood
from app.autonomy.transition import TransitionModel

_SMALLEST = float(np.finfo(np.float64).tiny)
_PLACES_A_BATCH = 2048


def mutual_information(log_likelihoods: FloatArray, probabilities: FloatArray) -> FloatArray:
    """Eq. 11 in closed form: log P(u | phi, x') as (..., 27, G) and b as (G,) -> (...,), in [0, H(b)]."""
    goal_count = probabilities.shape[0]
    if goal_count == 1:
        return np.zeros(log_likelihoods.shape[:-2])
    likelihoods = np.exp(log_likelihoods)
    # An action that underflows for every possible goal has p(u) = 0 and adds 0, whatever its logarithm.
    log_marginals = np.log(np.maximum(likelihoods @ probabilities, _SMALLEST))  # (..., 27)
    likelihoods *= log_likelihoods - log_marginals[..., None]
    nats: FloatArray = likelihoods.sum(axis=-2) @ probabilities
    gains: FloatArray = np.clip(nats / np.log(goal_count), 0.0, belief_entropy(probabilities))
    return gains


def expected_information_gain(
    position_m: npt.ArrayLike,
    momentum: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    probabilities: npt.ArrayLike,
    model: TransitionModel,
    rationality_per_m: float,
) -> FloatArray:
    """I(xi, x') of eq. 11 at x' = T(x, u) for each of the 27 actions u, in units of log |Phi|.

    Args:
        position_m: (3,), world frame, metres.
        momentum: (3,), unitless, length <= 1.
        goals_m: (G, 3), world frame, metres.
        probabilities: b(phi), (G,).
        model: T(x, u); it is applied twice, since the person acts from x' with the momentum u.
        rationality_per_m: kappa, per metre, in [0, 1e6].

    Returns:
        (27,), each in [0, H(b)].

    Raises:
        AutonomyError: values that are not finite, of the wrong shape or out of bounds.
    """
    goals = checked_goals_m(goals_m)
    belief = checked_probabilities(probabilities, goals.shape[0])
    next_positions_m = model.next_positions(position_m, momentum)  # (27, 3)
    ahead = log_likelihood(next_positions_m, UNIT_DIRECTIONS, goals, model, rationality_per_m)  # (27, 27, G)
    return mutual_information(ahead, belief)


def information_gain_at(
    positions_m: npt.ArrayLike,
    momentum: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    probabilities: npt.ArrayLike,
    model: TransitionModel,
    rationality_per_m: float,
) -> FloatArray:
    """Eq. 11 as a map over places x' (paper Fig. 2A): (N, 3) positions, all with one ``momentum`` (3,) ->
    (N,).

    Raises:
        AutonomyError: values that are not finite, of the wrong shape or out of bounds.
    """
    places_m = checked_points_m("positions_m", positions_m).reshape(-1, 3)
    belief = checked_probabilities(probabilities, checked_goals_m(goals_m).shape[0])
    shared_momentum = checked_momenta(momentum)
    gains = np.empty(places_m.shape[0])
    for start in range(0, places_m.shape[0], _PLACES_A_BATCH):  # bounds memory, not speed
        batch = slice(start, start + _PLACES_A_BATCH)
        ahead = log_likelihood(places_m[batch], shared_momentum, goals_m, model, rationality_per_m)
        gains[batch] = mutual_information(ahead, belief)
    return gains
