"""What the person seems to want: P(u | phi, x) and the belief over goals (paper III-B, eqs. 1-6).

Each decision of the person is one observation; no input is none. Goals are passed with every observation, so
they may move between updates; when the *set* changes (the gripper opens or closes, a task ends) start from
``Belief.uniform`` again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import numpy.typing as npt

from app.autonomy.arrays import FloatArray, check_rationality, checked_probabilities, frozen
from app.autonomy.errors import AutonomyError
from app.autonomy.hindsight import goal_rewards_m
from app.autonomy.transition import TransitionModel

PROBABILITY_FLOOR = 1e-12
"""No observation takes a goal that was possible below this, so a person who changes their mind is believed
again.

A goal whose prior is exactly 0 stays ruled out.
"""

_ROUNDS_WELL = 1000
"""Up to so many goals a normalised posterior sums to 1 within what counts as rounding."""


def log_softmax(scores: FloatArray, axis: int) -> FloatArray:
    """log(exp(s) / sum exp(s)) along ``axis``, shifted by the maximum so that nothing overflows; same
    shape."""
    shifted: FloatArray = scores - scores.max(axis=axis, keepdims=True)
    shifted -= np.log(np.exp(shifted).sum(axis=axis, keepdims=True))
    return shifted


def log_likelihood(
    position: npt.ArrayLike,
    momentum: npt.ArrayLike,
    goals_m: npt.ArrayLike,
    model: TransitionModel,
    rationality_per_m: float,
) -> FloatArray:
    """log P(u | phi, x) of eqs. 2-3, normalised over all 27 actions, the null one too.

    P(u | phi, x) = exp(kappa R_phi(x, u)) / sum_u' exp(kappa R_phi(x, u')). The paper writes no coefficient,
    which makes kappa the unit of distance; here it is explicit.

    Args:
        position: (..., 3), world frame, metres.
        momentum: (..., 3), unitless, length <= 1.
        goals_m: (G, 3), world frame, metres.
        model: T(x, u).
        rationality_per_m: kappa, per metre, in [0, 1e6].

    Returns:
        (..., 27, G).

    Raises:
        AutonomyError: values that are not finite, of the wrong shape or out of bounds.
    """
    check_rationality(rationality_per_m)
    return log_softmax(rationality_per_m * goal_rewards_m(position, momentum, goals_m, model), axis=-2)


@cache
def log_of_count(goal_count: int) -> float:
    """log |Phi|, which turns nats into units of base |Phi|."""
    return float(np.log(goal_count))


def belief_entropy(probabilities: FloatArray) -> float:
    """H(b) = -sum b log_|Phi| b, eq. 8, in [0, 1]; 0 log 0 = 0, and a single goal has no entropy. (G,) ->
    scalar."""
    return 0.0 if probabilities.shape[0] == 1 else _logs_and_entropy(probabilities)[1]


def _logs_and_entropy(probabilities: FloatArray) -> tuple[FloatArray, float]:
    """log b, (G,), with log 0 = -inf and no warning; and `belief_entropy`."""
    if np.minimum.reduce(probabilities) > 0.0:
        logs = np.log(probabilities)
        terms = probabilities * logs
    else:
        possible = probabilities > 0.0
        logs = np.log(probabilities, out=np.full(probabilities.shape, -np.inf), where=possible)
        terms = probabilities[possible] * np.log(probabilities[possible])
    if probabilities.shape[0] == 1:
        return logs, 0.0
    entropy = -float(np.add.reduce(terms)) / log_of_count(probabilities.shape[0])
    return logs, min(max(0.0, entropy), 1.0)  # in this order: of a zero and a negative zero the first is returned


def bayes_update(prior: FloatArray, log_likelihood_row: FloatArray) -> FloatArray:
    """P(phi | xi + (x, u)) proportional to P(u | phi, x) P(phi | xi), eqs. 4-6 one observation at a time.

    (G,), (G,) -> (G,). Works in logs; ends with ``PROBABILITY_FLOOR`` for goals whose prior is not 0.
    """
    return _updated(prior, _logs_and_entropy(prior)[0], log_likelihood_row)


def _updated(prior: FloatArray, log_prior: FloatArray, log_likelihood_row: FloatArray) -> FloatArray:
    log_posterior = log_prior + log_likelihood_row
    log_posterior -= np.maximum.reduce(log_posterior)
    posterior: FloatArray = np.exp(log_posterior, out=log_posterior)
    posterior /= np.add.reduce(posterior)
    if np.minimum.reduce(posterior) < PROBABILITY_FLOOR:
        too_low = (prior > 0.0) & (posterior < PROBABILITY_FLOOR)
        if too_low.any():
            posterior[too_low] = PROBABILITY_FLOOR
            posterior /= posterior.sum()
    return posterior


@dataclass(frozen=True, eq=False)
class Belief:
    """b(phi) over named goals (paper III-B).

    Args:
        goal_ids: one distinct name for each goal, in the order of the rows of ``goals_m``.
        probabilities: (G,), sums to 1; stored read-only.

    Raises:
        AutonomyError: no goal, repeated names, or probabilities that are not a distribution over them.
    """

    goal_ids: tuple[str, ...]
    probabilities: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "goal_ids", tuple(self.goal_ids))
        if not self.goal_ids or len(set(self.goal_ids)) != len(self.goal_ids):
            raise AutonomyError(f"goal_ids is {self.goal_ids!r}; it must hold at least one name, each once")
        checked = checked_probabilities(self.probabilities, len(self.goal_ids))
        object.__setattr__(self, "probabilities", frozen(checked.copy()))

    @classmethod
    def uniform(cls, goal_ids: Sequence[str]) -> Belief:
        """The prior of eq. 6: every goal equally likely. Raises AutonomyError without goals."""
        names = tuple(goal_ids)
        return cls(names, np.full(len(names), 1.0 / max(len(names), 1)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Belief):
            return NotImplemented
        return self.goal_ids == other.goal_ids and np.array_equal(self.probabilities, other.probabilities)

    def __hash__(self) -> int:
        return hash((self.goal_ids, self.probabilities.tobytes()))

    def after(self, log_likelihood_row: FloatArray) -> Belief:
        """The posterior of ``bayes_update``, log P(u | phi, x) as (G,) of checked values."""
        posterior = _updated(self.probabilities, self._logs, log_likelihood_row)
        if posterior.shape[0] > _ROUNDS_WELL:
            return Belief(self.goal_ids, posterior)
        after = object.__new__(Belief)  # it has been normalised just now: there is nothing to check
        logs, entropy = _logs_and_entropy(posterior)
        after.__dict__.update(goal_ids=self.goal_ids, probabilities=frozen(posterior), _logs=logs, entropy=entropy)
        return after

    @cached_property
    def _logs(self) -> FloatArray:
        """log b, -inf for what is ruled out, (G,)."""
        return _logs_and_entropy(self.probabilities)[0]

    @cached_property
    def entropy(self) -> float:
        """H(b), eq. 8, to base |Phi|: 0 when certain or with one goal, 1 when uniform."""
        return _logs_and_entropy(self.probabilities)[1]

    def as_dict(self) -> dict[str, float]:
        """Goal name -> probability, in order."""
        return dict(zip(self.goal_ids, self.probabilities.tolist(), strict=True))
