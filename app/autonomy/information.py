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

from app.autonomy.arrays import (
    FloatArray,
    check_rationality,
    checked_goals_m,
    checked_momenta,
    checked_points_m,
    checked_probabilities,
)
from app.autonomy.belief import belief_entropy, log_likelihood, log_of_count, log_softmax
from app.autonomy.hindsight import rewards_of_moves_m
from app.autonomy.transition import TransitionModel

_SMALLEST = float(np.finfo(np.float64).tiny)
_PLACES_A_BATCH = 2048


def mutual_information(log_likelihoods: FloatArray, probabilities: FloatArray) -> FloatArray:
    """Eq. 11 in closed form: log P(u | phi, x') as (27, ..., G) and b as (G,) -> (...,), in [0, H(b)]."""
    goal_count = probabilities.shape[0]
    if goal_count == 1:
        return np.zeros(log_likelihoods.shape[1:-1])
    likelihoods = np.exp(log_likelihoods)
    # An action that underflows for every possible goal has p(u) = 0 and adds 0, whatever its logarithm.
    log_marginals = np.log(np.maximum(likelihoods @ probabilities, _SMALLEST))  # (27, ...)
    likelihoods *= log_likelihoods - log_marginals[..., None]
    nats: FloatArray = likelihoods.sum(axis=0) @ probabilities
    gains: FloatArray = np.minimum(np.maximum(nats / log_of_count(goal_count), 0.0), belief_entropy(probabilities))
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
    check_rationality(rationality_per_m)
    next_positions_m = model.next_positions(position_m, momentum)
    return information_gain_ahead(next_positions_m, goals, belief, model, rationality_per_m)


def information_gain_ahead(
    next_positions_m: FloatArray,
    goals_m: FloatArray,
    probabilities: FloatArray,
    model: TransitionModel,
    rationality_per_m: float,
) -> FloatArray:
    """``expected_information_gain`` of values already checked, with x' = T(x, u) as (27, 3)."""
    # The person's action u' comes first: everything sums over it, and sums down the first axis are the fastest.
    ahead_m = next_positions_m + model.displacements_ahead()  # T(x', u'), (27 of u', 27 of u, 3)
    rewards_m = rewards_of_moves_m(next_positions_m, ahead_m, goals_m)  # (27, 27, G)
    return mutual_information(log_softmax(rationality_per_m * rewards_m, axis=0), probabilities)


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
        gains[batch] = mutual_information(np.moveaxis(ahead, -2, 0), belief)
    return gains
