"""What the paper's own numbers let one expect: studies drawn with its means, SDs and numbers of values exactly true.

Values are independent and normal around each condition's mean; conditions are compared by the plain Tukey test. That is
a *ceiling* for a simulation that has the paper's means and spread and whose model of the data removes no noise: where
the ceiling itself is seldom significant, a simulation that agrees with the paper is seldom significant too.

The paper gives no numbers of values; they follow from its degrees of freedom (error df and 3), shared out equally.
Measures, and pickups and all tasks, are drawn independently of one another, since the paper does not say how they hang
together; in real studies they do, so that the joint shares are the least certain of what stands here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from app.replication.comparisons import ALPHA, SIGN_AIM, SIGNIFICANT_AIM, Joint, Share
from app.replication.formats import MEASURE_NAMES, columns, percent
from app.replication.paper import (
    CLAIMS,
    CONDITIONS_IN_ORDER,
    DIFFERENCES,
    PARTICIPANTS,
    TESTS,
    Claim,
    Reported,
    Tested,
    reported,
)
from study.analysis.studentized_range import critical

DRAWS = 8_000
SEED = 11
"""The ceiling is a constant of the paper's numbers; the seed is fixed, so that it is the same in every report."""
_ONE_EACH = ("window_rate", "sus_modified", "tlx_raw")
"""Measures with one value for each participant and condition, compared within participants."""

Draws = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CeilingRow:
    """One comparison under the paper's own numbers."""

    claim: Claim
    values: tuple[int, ...]
    """How many under each condition, in the paper's order."""
    same_sign: float
    significant: float
    """In the paper's direction; for a comparison without a reported difference, in any."""

    @property
    def aim(self) -> float:
        """The share to be reached: significance as often as here, or in 80 % of studies, whichever is lower; where the
        paper found no difference, none as often as here or in 80 %."""
        reached = self.significant if self.claim.verdict == "different" else 1.0 - self.significant
        return min(reached, SIGNIFICANT_AIM)

    def met_by(self, share: Share) -> bool:
        """Whether studies reach it, and have the paper's sign in 95 % where it found a difference."""
        if self.claim.verdict == "different":
            return share.same_sign >= SIGN_AIM and share.significant >= self.aim
        return 1.0 - share.significant >= self.aim


@dataclass(frozen=True)
class Implied:
    """The F that a measure's means, SDs and numbers of values imply, beside the one the paper reports."""

    tested: Tested
    f: float

    @property
    def ratio(self) -> float | None:
        """Reported by implied; None = none reported."""
        return None if self.tested.f is None else self.tested.f / self.f

    @property
    def absorbed(self) -> float | None:
        """The share of the variance within the conditions that the paper's model must have taken up for its F to be
        what it is. Below 0 the F is smaller than the means and SDs imply."""
        return None if self.tested.f is None else 1.0 - self.f / self.tested.f


@dataclass(frozen=True)
class Ceiling:
    """All of it."""

    rows: Mapping[Claim, CeilingRow]
    joint: Joint
    implied: tuple[Implied, ...]


@lru_cache(maxsize=2)
def ceiling(draws: int = DRAWS, seed: int = SEED) -> Ceiling:
    """Drawn once a process."""
    rng = np.random.default_rng(seed)
    rows: dict[Claim, CeilingRow] = {}
    signs: dict[Claim, npt.NDArray[np.bool_]] = {}
    found: dict[Claim, npt.NDArray[np.bool_]] = {}
    for tested in TESTS:
        values = numbers_of(tested)
        means, error = _drawn(reported(tested.measure, tested.kind), tested, values, draws, rng)
        for claim in CLAIMS:
            if (claim.measure, claim.kind) != (tested.measure, tested.kind):
                continue
            first, second = (CONDITIONS_IN_ORDER.index(name) for name in (claim.first, claim.second))
            difference = means[:, first] - means[:, second]
            se = np.sqrt(error * (1.0 / values[first] + 1.0 / values[second]) / 2.0)
            significant = np.abs(difference) > critical_range(tested.df_error) * se
            same = difference * claim.sign > 0.0
            signs[claim], found[claim] = same, significant & same
            counted = found[claim] if claim.verdict == "different" else significant
            sign = float(same.mean()) if claim.sign else float("nan")
            rows[claim] = CeilingRow(claim, values, sign, float(counted.mean()))
    return Ceiling(rows, _joint(signs, found, draws), tuple(Implied(item, implied_f(item)) for item in TESTS))


def numbers_of(tested: Tested) -> tuple[int, ...]:
    """How many values each condition has: all that the degrees of freedom say, shared out as equally as they go."""
    count = len(CONDITIONS_IN_ORDER)
    if tested.measure in _ONE_EACH:
        return (PARTICIPANTS,) * count
    each, more = divmod(tested.df_error + count, count)
    return tuple(each + (place < more) for place in range(count))


def implied_f(tested: Tested) -> float:
    """F of a one-way analysis of variance of values with just these means, SDs and numbers."""
    item, values = reported(tested.measure, tested.kind), np.array(numbers_of(tested))
    means, variances = _of(item.means), _of(item.sds) ** 2
    between = float(values @ (means - values @ means / values.sum()) ** 2) / (len(means) - 1)
    within = float((values - 1) @ variances) / float((values - 1).sum())
    return between / within


@lru_cache(maxsize=64)
def critical_range(df_error: int) -> float:
    """The studentised range of three means that 5 % exceed."""
    return critical(1.0 - ALPHA, len(CONDITIONS_IN_ORDER), df_error)


def _of(by_condition: Mapping[str, float]) -> Draws:
    return np.array([by_condition[name] for name in CONDITIONS_IN_ORDER])


def _drawn(
    item: Reported, tested: Tested, values: Sequence[int], draws: int, rng: np.random.Generator
) -> tuple[Draws, Draws]:
    """Means of each condition (draws, 3) and the error's mean square (draws,) of studies with those numbers.

    Of normal values the mean and the variance are independent, so that no single value need be drawn; within
    participants the error is what is left of a table of people and conditions.
    """
    centre, spread, count = _of(item.means), _of(item.sds), np.array(values)
    if tested.measure in _ONE_EACH:
        table = rng.normal(centre, spread, (draws, PARTICIPANTS, len(centre)))
        means = table.mean(axis=1)
        left = table - means[:, None, :] - table.mean(axis=2, keepdims=True) + table.mean(axis=(1, 2))[:, None, None]
        return means, (left**2).sum(axis=(1, 2)) / tested.df_error
    means = rng.normal(centre, spread / np.sqrt(count), (draws, len(centre)))
    squares = spread**2 * rng.chisquare(count - 1, (draws, len(centre)))
    return means, squares.sum(axis=1) / float((count - 1).sum())


def _joint(
    signs: Mapping[Claim, npt.NDArray[np.bool_]], found: Mapping[Claim, npt.NDArray[np.bool_]], draws: int
) -> Joint:
    same = np.stack([signs[claim] for claim in DIFFERENCES])
    significant = np.stack([found[claim] for claim in DIFFERENCES])
    return Joint(
        comparisons=len(DIFFERENCES),
        studies=draws,
        signs=float(same.all(axis=0).mean()),
        significant=float(significant.all(axis=0).mean()),
        mean_signs=float(same.sum(axis=0).mean()),
        mean_significant=float(significant.sum(axis=0).mean()),
    )


# ---- as text --------------------------------------------------------------------------------------------------------

LEGEND = (
    f"Ceiling: {DRAWS:,} studies drawn with the paper's own means, SDs and numbers of values exactly true, "
    "independent normal values, plain Tukey. Where it is low, a simulation that agrees with the paper is seldom "
    "significant either. Questionnaires and window rates are compared within people, whose values hang together by an "
    "amount that the paper does not report; drawn independently, their ceiling is lower than the paper's F suggests."
)


def implied_table(of: Ceiling) -> str:
    """The paper's F values beside those that its means, SDs and numbers of values imply."""
    rows: list[tuple[str, ...]] = [("measure", "values", "F reported", "F implied", "ratio", "variance absorbed")]
    for item in of.implied:
        tested = item.tested
        rows.append(
            (
                f"{MEASURE_NAMES[tested.measure]} {tested.kind}",
                str(sum(numbers_of(tested))),
                "" if tested.f is None else f"F(2, {tested.df_error}) = {tested.f:.2f}",
                f"{item.f:.2f}",
                "" if item.ratio is None else f"{item.ratio:.1f}",
                "" if item.absorbed is None else percent(item.absorbed),
            )
        )
    return columns(rows)


IMPLIED_LEGEND = (
    "F implied: one-way, of values with the paper's means, SDs and numbers of values. variance absorbed: the share of "
    "the variance within conditions that the paper's model (condition order and goal as covariates) must have taken up "
    "for the reported F; negative where the reported F is the smaller one. Where it is large, the paper's significance "
    "is out of reach for a model that does not take up as much."
)
