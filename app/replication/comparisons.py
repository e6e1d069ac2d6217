"""Simulated studies held against the paper's comparisons: signs, significance, equivalence, each counted by itself."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from app.replication.paper import CLAIMS, CONDITIONS_IN_ORDER, DIFFERENCES, REPORTED, Claim
from app.replication.studies import SURVEYS, Values
from study.analysis.analysis import Covariates, compare
from study.analysis.effect_sizes import NotFitted
from study.analysis.linear_model import Anova, Slope, slope

ALPHA = 0.05
SIGN_AIM, SIGNIFICANT_AIM = 0.95, 0.80
"""As in `rule.toml`."""


@dataclass(frozen=True)
class Contrast:
    """One comparison in one study: the adjusted difference, Tukey's p, and whether it was shown to be within the
    margin (two one-sided tests at .05)."""

    difference: float
    p: float
    equivalent: bool


Compared = Mapping[Claim, "Contrast | NotFitted"]
"""One study's comparisons, or why one could not be made."""


@dataclass(frozen=True)
class Share:
    """One of the paper's comparisons over all studies."""

    claim: Claim
    differences: tuple[float, ...]
    same_sign: float
    significant: float
    """In the paper's direction; for a comparison without a reported difference, in any."""
    opposite: float
    """Significant in the other direction."""
    within: float
    """The difference itself is smaller than the margin."""
    equivalent: float
    """And the study shows it to be."""
    untested: tuple[str, ...] = ()
    """Why it could not be made, for each study in which it could not."""

    @property
    def mean(self) -> float:
        """Mean difference over the studies."""
        return float(np.mean(self.differences)) if self.differences else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """The middle 95 % of the studies."""
        return middle(self.differences)


@dataclass(frozen=True)
class Joint:
    """The paper's differences all at once, over studies: each study counts as a whole."""

    comparisons: int
    studies: int
    signs: float
    """Share of the studies in which every difference has the paper's sign."""
    significant: float
    """And is significant."""
    mean_signs: float
    mean_significant: float
    """How many of the differences a study has, on average."""


@dataclass(frozen=True)
class Means:
    """One measure under one condition: the paper's mean and SD, ours over the studies."""

    measure: str
    kind: str
    condition: str
    paper_mean: float
    paper_sd: float
    mean: float
    interval: tuple[float, float]
    sd: float

    @property
    def known(self) -> bool:
        """Whether there were any values."""
        return self.mean == self.mean

    @property
    def within_sd(self) -> bool:
        """Whether ours lies within one SD of the paper's mean."""
        return abs(self.mean - self.paper_mean) <= self.paper_sd


@dataclass(frozen=True)
class GoalGain:
    """Belief gain by number of goals under one condition, and how often it rises with it."""

    condition: str
    by_goals: dict[int, float]
    rising: float
    rising_significant: float
    falling_significant: float


def middle(values: Sequence[float]) -> tuple[float, float]:
    """2.5 % and 97.5 % quantile."""
    if not values:
        return float("nan"), float("nan")
    low, high = np.quantile(values, (0.025, 0.975))
    return float(low), float(high)


def compared(
    values: Values, claims: Sequence[Claim] = CLAIMS, *, covariates: Covariates = "random"
) -> dict[Claim, Contrast | NotFitted]:
    """Every comparison in one study, with position and goal as random covariates as the paper states, or as fixed."""
    found: dict[Claim, Contrast | NotFitted] = {}
    for key in dict.fromkeys((claim.measure, claim.kind) for claim in claims):
        measure, kind = key
        own = [claim for claim in claims if (claim.measure, claim.kind) == key]
        result = compare(
            values.observations.get(key, ()),
            measure,
            None if measure in SURVEYS else kind,
            CONDITIONS_IN_ORDER,
            covariates=covariates,
            beside=False,
            intervals=False,
        )
        model = result.anova
        if not isinstance(model, Anova):
            found.update(dict.fromkeys(own, model))
            continue
        for claim in own:
            pair = next(
                (pair for pair in result.pairs if {pair.first, pair.second} == {claim.first, claim.second}), None
            )
            if pair is None:
                absent = " and ".join(name for name in (claim.first, claim.second) if name not in model.conditions)
                found[claim] = NotFitted(f"there are no values under {absent}")
                continue
            difference = (1.0 if pair.first == claim.first else -1.0) * pair.difference.value
            found[claim] = Contrast(difference, pair.p, _equivalent(claim, model, difference))
    return found


def contrasts(study: Compared) -> dict[Claim, Contrast]:
    """The comparisons that could be made."""
    return {claim: item for claim, item in study.items() if isinstance(item, Contrast)}


def _equivalent(claim: Claim, model: Anova, difference: float) -> bool:
    if not claim.margin:
        return False
    places = [model.conditions.index(name) for name in (claim.first, claim.second)]
    df = model.contrast_df[places[0]][places[1]]
    reach = float(stats.t.ppf(1.0 - ALPHA, df)) * model.contrast_se[places[0]][places[1]]
    return abs(difference) + reach < claim.margin


def shares(tested: Sequence[Compared], claims: Sequence[Claim] = CLAIMS) -> tuple[Share, ...]:
    """All studies together; a study in which a comparison could not be made counts against it."""
    made = [contrasts(study) for study in tested]
    return tuple(
        replace(
            _share(claim, [study[claim] for study in made if claim in study], len(tested)),
            untested=tuple(item.reason for study in tested if isinstance(item := study.get(claim), NotFitted)),
        )
        for claim in claims
    )


def joint(tested: Sequence[Compared], claims: Sequence[Claim] = DIFFERENCES) -> Joint:
    """How many studies show all of these differences; one that could not be tested is none."""
    made = [contrasts(study) for study in tested]
    signs = [[claim in study and study[claim].difference * claim.sign > 0.0 for claim in claims] for study in made]
    significant = [
        [sign and study[claim].p < ALPHA for claim, sign in zip(claims, of, strict=True)]
        for study, of in zip(made, signs, strict=True)
    ]
    return Joint(
        comparisons=len(claims),
        studies=len(tested),
        signs=_part([all(of) for of in signs]),
        significant=_part([all(of) for of in significant]),
        mean_signs=float(np.mean([sum(of) for of in signs])) if signs else float("nan"),
        mean_significant=float(np.mean([sum(of) for of in significant])) if significant else float("nan"),
    )


def _share(claim: Claim, found: Sequence[Contrast], studies: int) -> Share:
    def share(holds: Sequence[bool]) -> float:
        return sum(holds) / studies if studies else float("nan")

    sign = claim.sign
    directed = claim.verdict == "different"
    return Share(
        claim=claim,
        differences=tuple(item.difference for item in found),
        same_sign=share([item.difference * sign > 0.0 for item in found]) if sign else float("nan"),
        significant=share([item.p < ALPHA and (not directed or item.difference * sign > 0.0) for item in found]),
        opposite=share([item.p < ALPHA and item.difference * sign < 0.0 for item in found]),
        within=share([abs(item.difference) < claim.margin for item in found]),
        equivalent=share([item.equivalent for item in found]),
    )


def means(studies: Sequence[Values]) -> tuple[Means, ...]:
    """The paper's means beside ours."""
    of: dict[tuple[str, str, str], tuple[list[float], list[float]]] = {}
    for study in studies:
        for item in REPORTED:
            for condition in CONDITIONS_IN_ORDER:
                observed = study.observations[item.measure, item.kind]
                found = [one.value for one in observed if one.condition == condition]
                own_means, sds = of.setdefault((item.measure, item.kind, condition), ([], []))
                own_means += [float(np.mean(found))] if found else []
                sds += [float(np.std(found, ddof=1))] if len(found) > 1 else []
    rows = []
    for item in REPORTED:
        for condition in CONDITIONS_IN_ORDER:
            own_means, sds = of.get((item.measure, item.kind, condition), ([], []))
            rows.append(
                Means(
                    measure=item.measure,
                    kind=item.kind,
                    condition=condition,
                    paper_mean=item.means[condition],
                    paper_sd=item.sds[condition],
                    mean=float(np.mean(own_means)) if own_means else float("nan"),
                    interval=middle(own_means),
                    sd=float(np.mean(sds)) if sds else float("nan"),
                )
            )
    return tuple(rows)


def goal_gains(studies: Sequence[Values]) -> tuple[GoalGain, ...]:
    """The paper's Fig. 4: all tasks, dropoffs having two goals."""
    lines: dict[str, list[Slope]] = {condition: [] for condition in CONDITIONS_IN_ORDER}
    values: dict[str, dict[int, array[float]]] = {condition: {} for condition in CONDITIONS_IN_ORDER}
    for study in studies:
        for condition in CONDITIONS_IN_ORDER:
            found = [one for one in study.observations["belief_gain", "all"] if one.condition == condition]
            line = slope([one.goals for one in found], [one.value for one in found])
            lines[condition] += [] if isinstance(line, NotFitted) else [line]
            for one in found:
                values[condition].setdefault(one.goals, array("d")).append(one.value)
    return tuple(
        GoalGain(
            condition=condition,
            by_goals={count: float(np.mean(of)) for count, of in sorted(values[condition].items())},
            rising=_part([line.per_unit.value > 0.0 for line in known]),
            rising_significant=_part([line.per_unit.value > 0.0 and line.p < ALPHA for line in known]),
            falling_significant=_part([line.per_unit.value < 0.0 and line.p < ALPHA for line in known]),
        )
        for condition, known in lines.items()
    )


def _part(holds: Sequence[bool]) -> float:
    return sum(holds) / len(holds) if holds else float("nan")
