"""One alpha for a study, so that information and goals weigh the same at half entropy (paper IV-A).

The paper tuned its weights so that "information gathering actions are favored over goal-oriented actions when
entropy values are high". The weighted ranges over the 27 actions cross where alpha f1^2 range(I) = beta
range(R_HO), beta = 1. That ratio differs tenfold between states, so alpha is its median over states and
beliefs drawn from the study's own layouts. The two shares tell how well one number serves them all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.autonomy.actions import ACTION_COUNT, UNIT_DIRECTIONS
from app.autonomy.arbiters.weighing import entropy_weights
from app.autonomy.arrays import FloatArray, checked_goals_m, checked_points_m
from app.autonomy.belief import belief_entropy
from app.autonomy.errors import AutonomyError
from app.autonomy.hindsight import hindsight_reward
from app.autonomy.looking import Looking, look
from app.autonomy.transition import TransitionModel

PRINTED = Looking()
CROSSING_SAMPLES = 400
SHARE_SAMPLES = 200

_HIGH_ENTROPIES = (0.7, 0.99)
_LOW_ENTROPIES = (0.01, 0.3)
_BISECTIONS = 60
_NO_RANGE = 1e-15


BANDS = ((0.7, 1.0), (0.3, 0.7), (0.0, 0.3))
"""Little known, in between, much known: the paper's bounds (IV-A)."""
VISITED_ENTROPIES = (0.4, 0.6)
LEAST_VISITS = 30
"""Fewer states near half entropy than this say nothing about a study."""


class Visit(NamedTuple):
    """A state in which the hands left the controls, and what was believed there."""

    position_m: FloatArray  # (3,)
    momentum: FloatArray  # (3,)
    goals_m: FloatArray  # (G, 3)
    belief: FloatArray  # (G,)


class Band(NamedTuple):
    """Entropies between two bounds, in use: the share of visited states that lie there, and in how many of them
    information has the larger weighted range."""

    low: float
    high: float
    states: float
    information_leads: float


class Shares(NamedTuple):
    """How well one number serves all states.

    ``information_above_0_7``: of sampled states with H in (0.7, 0.99), the share where information has the larger
    weighted range. ``goals_below_0_3``: with H in (0.01, 0.3), the share where goals have it. ``in_use``: of visited
    states, by entropy; empty for sampled ones.
    """

    information_above_0_7: float
    goals_below_0_3: float
    in_use: tuple[Band, ...] = ()


@dataclass(frozen=True)
class Calibration:
    """The result, with what speaks for it.

    ``ratio_quartiles``: first and third quartile of the ratio whose median is ``alpha``. ``samples``: how many states
    ``alpha`` rests on. ``find_shares`` works out what only a reader wants to know, most of the time that it takes.
    """

    alpha: float
    samples: int
    ratio_quartiles: tuple[float, float]
    find_shares: Callable[[], Shares] = field(repr=False, compare=False)

    @cached_property
    def shares(self) -> Shares:
        """How well it serves."""
        return self.find_shares()


def calibrate_on_visits(
    visits: Sequence[Visit], model: TransitionModel, rationality_per_m: float, looking: Looking = PRINTED
) -> Calibration:
    """The median of range(R_HO) / (f1^2 range(I)) over visited states with H from 0.4 to 0.6; I as the arbiter looks at
    it.

    Raises:
        AutonomyError: too few such states, or values out of bounds.
    """
    entropies = np.array([belief_entropy(visit.belief) for visit in visits])
    low, high = VISITED_ENTROPIES
    near = np.flatnonzero((entropies >= low) & (entropies <= high)).tolist()
    ratios = np.array([_ratio(visits[place], model, rationality_per_m, looking) for place in near])
    crossing = ratios[np.isfinite(ratios)]
    if all(visit.belief.shape[0] == 1 for visit in visits):
        raise AutonomyError(
            "alpha is 'calibrated'; with one goal at a time there is nothing to find out: give a number"
        )
    if crossing.size < LEAST_VISITS:
        raise AutonomyError(
            f"calibrated_on is 'visited'; only {crossing.size} of {len(visits)} visited states have an entropy from "
            f"{low:g} to {high:g}, {LEAST_VISITS} are needed: calibrate on sampled ones, or give alpha as a number"
        )
    first, third = (float(quartile) for quartile in np.quantile(crossing, (0.25, 0.75)))
    alpha = _median(crossing)
    shares = partial(_shares_in_use, alpha, tuple(visits), model, rationality_per_m, looking)
    return Calibration(alpha, int(crossing.size), (first, third), shares)


def _shares_in_use(
    alpha: float, visits: Sequence[Visit], model: TransitionModel, rationality_per_m: float, looking: Looking
) -> Shares:
    entropies = np.array([belief_entropy(visit.belief) for visit in visits])
    ratios = np.array([_ratio(visit, model, rationality_per_m, looking) for visit in visits])
    bands = tuple(_band(low, high, entropies, ratios, alpha) for low, high in BANDS)
    return Shares(bands[0].information_leads, 1.0 - bands[-1].information_leads, bands)


def _median(values: FloatArray) -> float:
    """As `np.median`, which loads masked arrays first."""
    ordered, half = np.sort(values).tolist(), values.size // 2
    return float(ordered[half] if values.size % 2 else (ordered[half - 1] + ordered[half]) / 2.0)


def _band(low: float, high: float, entropies: FloatArray, ratios: FloatArray, alpha: float) -> Band:
    inside = (entropies >= low) & ((entropies < high) | (high == 1.0))
    leads = float((ratios[inside] < alpha).mean()) if inside.any() else 0.0
    return Band(low, high, float(inside.mean()), leads)


def calibrate_alpha(
    goal_sets: Sequence[npt.ArrayLike],
    workspace_bounds_m: npt.ArrayLike,
    model: TransitionModel,
    rationality_per_m: float,
    seed: int,
    target_entropy: float = 0.5,
    tolerance: float = 0.03,
    looking: Looking = PRINTED,
) -> Calibration:
    """The median of range(R_HO) / (f1^2 range(I)) over a seeded sample with H within ``tolerance`` of the
    target.

    Args:
        goal_sets: goals of the study's layouts, each (G, 3), world frame, metres; sets of one goal have no
            entropy and are left out.
        workspace_bounds_m: (2, 3), lowest and highest corner of where the gripper can be, world frame,
            metres.
        model: T(x, u).
        rationality_per_m: kappa, per metre, > 0.
        seed: makes the sample repeatable.
        target_entropy: where the two terms should cross, in (0, 1).
        tolerance: half width of the sampled band around it.
        looking: where the arbiter looks at information.

    Raises:
        AutonomyError: no set with two goals or more, values out of bounds, or goals that no action tells
            apart.
    """
    goals = [checked_goals_m(goal_set) for goal_set in goal_sets]
    goals = [goal_set for goal_set in goals if goal_set.shape[0] > 1]
    if not goals:
        raise AutonomyError(f"goal_sets holds {len(goal_sets)} sets; at least one must have two goals or more")
    bounds_m = checked_points_m("workspace_bounds_m", workspace_bounds_m)
    if bounds_m.shape != (2, 3) or not (bounds_m[0] <= bounds_m[1]).all():
        raise AutonomyError(f"workspace_bounds_m is {bounds_m.tolist()}; it must be a lower and an upper corner")
    if not 0.0 < target_entropy - tolerance <= target_entropy + tolerance < 1.0:
        raise AutonomyError(f"target_entropy is {target_entropy!r} ± {tolerance!r}; it must stay inside (0, 1)")
    if not rationality_per_m > 0.0:
        raise AutonomyError(f"rationality_per_m is {rationality_per_m!r}; calibration needs more than 0")

    rng = np.random.default_rng(seed)

    def sampled_ratios(entropies: tuple[float, float], count: int) -> FloatArray:
        return _ratios(rng, goals, bounds_m, model, rationality_per_m, entropies, count, looking)

    crossing = sampled_ratios((target_entropy - tolerance, target_entropy + tolerance), CROSSING_SAMPLES)
    informative = crossing[np.isfinite(crossing)]
    if informative.size == 0:
        raise AutonomyError("goal_sets has no goals that an action tells apart; they must differ in position")
    alpha = _median(informative)
    lower, upper = (float(quartile) for quartile in np.quantile(informative, (0.25, 0.75)))
    shares = Shares(
        information_above_0_7=float((sampled_ratios(_HIGH_ENTROPIES, SHARE_SAMPLES) < alpha).mean()),
        goals_below_0_3=float((sampled_ratios(_LOW_ENTROPIES, SHARE_SAMPLES) > alpha).mean()),
    )
    return Calibration(alpha, int(informative.size), (lower, upper), partial(_known, shares))


def _known(shares: Shares) -> Shares:
    return shares


def beliefs_of_entropy(rng: np.random.Generator, goal_count: int, entropies: FloatArray) -> FloatArray:
    """Random beliefs (N, G) with the wanted ``entropies`` (N,), each in (0, 1), base G.

    A random direction in log-probability space is sharpened until the entropy fits, by bisection.
    """
    logits = rng.standard_normal((entropies.shape[0], goal_count))
    logits -= logits.max(axis=1, keepdims=True)
    low, high = np.full(entropies.shape, -15.0), np.full(entropies.shape, 30.0)  # log sharpness
    beliefs = np.empty_like(logits)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        beliefs = np.exp(np.exp(middle)[:, None] * logits)
        beliefs /= beliefs.sum(axis=1, keepdims=True)
        logs = np.log(beliefs, out=np.zeros_like(beliefs), where=beliefs > 0.0)
        too_vague = -(beliefs * logs).sum(axis=1) > entropies * np.log(goal_count)
        low, high = np.where(too_vague, middle, low), np.where(too_vague, high, middle)
    return beliefs


def _ratios(
    rng: np.random.Generator,
    goal_sets: list[FloatArray],
    bounds_m: FloatArray,
    model: TransitionModel,
    rationality_per_m: float,
    entropies: tuple[float, float],
    count: int,
    looking: Looking,
) -> FloatArray:
    """range(R_HO) / (f1^2 range(I)) of ``count`` sampled states and beliefs, (count,); inf where I is
    flat."""
    positions_m = rng.uniform(bounds_m[0], bounds_m[1], (count, 3))
    momenta = UNIT_DIRECTIONS[rng.integers(ACTION_COUNT, size=count)]  # rest is one of them
    wanted = rng.uniform(*entropies, size=count)
    chosen_sets = rng.integers(len(goal_sets), size=count)
    ratios = np.empty(count)
    for set_index, goals_m in enumerate(goal_sets):
        members = np.flatnonzero(chosen_sets == set_index)
        beliefs = beliefs_of_entropy(rng, goals_m.shape[0], wanted[members])
        for member, belief in zip(members, beliefs, strict=True):
            visit = Visit(positions_m[member], momenta[member], goals_m, belief)
            ratios[member] = _ratio(visit, model, rationality_per_m, looking)
    return ratios


def _ratio(visit: Visit, model: TransitionModel, rationality_per_m: float, looking: Looking) -> float:
    """range(R_HO) / (f1^2 range(I)); inf where I is flat."""
    gain_range = float(np.ptp(look(looking, *visit, model, rationality_per_m)))
    f1, _ = entropy_weights(belief_entropy(visit.belief))
    return float(np.ptp(hindsight_reward(*visit, model))) / (f1**2 * gain_range) if gain_range > _NO_RANGE else np.inf
