"""Why a comparison misses its aim: experiments that change one thing each, and the reason that they point to.

Most are done with the studies at hand: their values are scaled, moved, joined or analysed otherwise. What cannot be had
from them (another weight of information, equal people) is simulated, by `app.replication.replicate`. None of it is used
to choose anything; it says what a miss is made of.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from app.replication.ceiling import ceiling
from app.replication.comparisons import SIGN_AIM, Compared, Share, compared, shares
from app.replication.formats import CONDITION_NAMES, name_of, number, percent
from app.replication.paper import CONDITIONS_IN_ORDER, Claim, reported
from app.replication.studies import SURVEYS, Key, Studies, Values, unpacked
from app.simulated.study import run_jobs
from study.analysis.analysis import Covariates
from study.analysis.observations import Observation

MOVED = 0.15
"""A share is said to move when it changes by more than this and twice its standard error."""
CHANCE_SE = 2.0
"""A share this many standard errors below its aim, or nearer, may be below it by the luck of the studies."""

BOTH = "size and noise together"

Spread = Mapping[tuple[Key, str], tuple[float, float]]
"""Mean and SD of our values, by measure, kind and condition."""


@dataclass(frozen=True)
class Experiment:
    """One experiment: what was changed, which reason it speaks for, and the shares without and with the change."""

    name: str
    reason: str
    studies: int
    before: tuple[Share, ...]
    after: tuple[Share, ...]
    simulated: bool
    """Whether it was simulated anew, and not had from the studies at hand."""

    def pair(self, claim: Claim) -> tuple[Share, Share] | None:
        """The shares of one comparison, before and after; None = it is not among them."""
        of = [next((share for share in shares_ if share.claim == claim), None) for shares_ in (self.before, self.after)]
        return None if of[0] is None or of[1] is None else (of[0], of[1])


def missed(of: Sequence[Share]) -> tuple[Share, ...]:
    """Those that miss their aim."""
    rows = ceiling().rows
    return tuple(share for share in of if not rows[share.claim].met_by(share))


def experiments(studies: Sequence[Values], base: Sequence[Share], workers: int) -> tuple[Experiment, ...]:
    """The experiments that need no simulation, for the comparisons that miss their aim; none if none does."""
    claims = tuple(share.claim for share in missed(base))
    if not claims:
        return ()
    ours = spread_of(studies)

    def tried(
        name: str, reason: str, of: Sequence[Values], before: Sequence[Share], covariates: Covariates = "random"
    ) -> Experiment:
        return Experiment(name, reason, len(of), tuple(before), tested(of, claims, covariates, workers), False)

    def changed(change: Callable[[Observation, Key], Observation]) -> Studies:
        return Studies.of(_changed(values, change) for values in studies)

    scaled, moved = partial(_scaled, ours), partial(_moved, ours)
    found = [
        tried("the paper's SD", "residual noise", changed(scaled), base),
        tried("the paper's means", "size of the difference", changed(moved), base),
        tried("the paper's means and SD", BOTH, changed(lambda one, key: moved(scaled(one, key), key)), base),
        tried("no covariates", "model of covariates", changed(_alone), base),
        tried("fixed covariates", "model of covariates", studies, base, "fixed"),
    ]
    if len(studies) > 1:
        pairs = Studies.of(_together(studies[at], studies[at + 1]) for at in range(0, len(studies) - 1, 2))
        found.append(tried("twice the people", "sample size", pairs, base))
    return tuple(found)


def tested(
    studies: Sequence[Values], claims: Sequence[Claim], covariates: Covariates, workers: int
) -> tuple[Share, ...]:
    """These comparisons in all these studies."""
    held = studies if isinstance(studies, Studies) else Studies.of(studies)
    jobs = list(enumerate(held.packed))
    work = partial(_tested, tuple(claims), covariates)
    found = {job[0]: result for job, result in run_jobs(work, jobs, min(workers, 1 + len(studies) // 50))}
    return shares([found[place] for place in sorted(found)], claims)


def _tested(claims: tuple[Claim, ...], covariates: Covariates, job: tuple[int, bytes]) -> Compared:
    return compared(unpacked(job[1]), claims, covariates=covariates)


# ---- what is changed ------------------------------------------------------------------------------------------------


def spread_of(studies: Sequence[Values]) -> Spread:
    """Mean over all studies together, and the mean over them of the SD within one."""
    per_study: dict[tuple[Key, str], tuple[list[float], list[float]]] = {}
    for study in studies:
        for key, observed in study.observations.items():
            for condition in CONDITIONS_IN_ORDER:
                of = [one.value for one in observed if one.condition == condition]
                means, sds = per_study.setdefault((key, condition), ([], []))
                means += [float(np.mean(of))] if of else []
                sds += [float(np.std(of, ddof=1))] if len(of) > 1 else []
    return {
        place: (float(np.mean(means)), float(np.mean(sds)))
        for place, (means, sds) in per_study.items()
        if means and sds
    }


def _changed(values: Values, change: Callable[[Observation, Key], Observation]) -> Values:
    found = {key: tuple(change(one, key) for one in of) for key, of in values.observations.items()}
    return replace(values, observations=found)


def _scaled(ours: Spread, one: Observation, key: Key) -> Observation:
    """As far from our mean as the paper's SD has it; constant values stay."""
    mean, sd = ours.get((key, one.condition), (0.0, 0.0))
    if sd <= 0.0:
        return one
    return replace(one, value=mean + (one.value - mean) * reported(*key).sds[one.condition] / sd)


def _moved(ours: Spread, one: Observation, key: Key) -> Observation:
    """Around the paper's mean, as it was around ours."""
    mean, _ = ours.get((key, one.condition), (one.value, 0.0))
    return replace(one, value=one.value - mean + reported(*key).means[one.condition])


def _alone(one: Observation, key: Key) -> Observation:
    """Position and goal the same everywhere, so that no model can take anything up by them."""
    return one if key[0] in (*SURVEYS, "window_rate") else replace(one, position=1, goal="")


def _together(first: Values, second: Values) -> Values:
    """Two studies as one of twice the people."""
    others = {
        key: tuple(replace(one, participant=f"2-{one.participant}") for one in of)
        for key, of in second.observations.items()
    }
    return first.joined([replace(second, observations=others)])


# ---- what it says ---------------------------------------------------------------------------------------------------


def reason_line(share: Share, of: Sequence[Experiment], ours: Spread) -> str:
    """One missed comparison: how it misses, the reasons that experiments point to, and their results."""
    claim, row = share.claim, ceiling().rows[share.claim]
    reaching = [one for one in of if (pair := one.pair(claim)) and row.met_by(pair[1])]
    helping = [one for one in of if (pair := one.pair(claim)) and _helps(claim, *pair, one.studies)]
    if reaching:
        verdict = "What alone reaches the aim: " + _named(reaching)
    elif helping:
        verdict = "Nothing tried reaches the aim alone; nearer to it comes " + _named(helping)
    else:
        verdict = "Nothing tried brings it nearer to the aim"
    chance = " The miss is within the chance of so many studies." if by_chance(share) else ""
    results = "; ".join(_result(claim, one) for one in of if one.pair(claim))
    return f"- **{name_of(claim)}** {_miss(share, ours)}. {verdict}.{chance} Experiments: {results or 'none'}."


def _named(of: Sequence[Experiment]) -> str:
    """Experiments by their reasons."""
    reasons: dict[str, list[str]] = {}
    for one in of:
        reasons.setdefault(one.reason, []).append(one.name)
    return ", ".join(f"**{reason}** ({', '.join(names)})" for reason, names in reasons.items())


def _miss(share: Share, ours: Spread) -> str:
    claim, row = share.claim, ceiling().rows[share.claim]
    told = []
    if claim.verdict == "different":
        if not share.same_sign >= SIGN_AIM:
            told.append(f"sign in {percent(share.same_sign)} (aim {SIGN_AIM:.0%})")
        if not share.significant >= row.aim:
            told.append(f"significant in {percent(share.significant)} (aim {percent(row.aim)})")
    else:
        told.append(f"without a difference in {percent(1.0 - share.significant)} (aim {percent(row.aim)})")
    ends = []
    for name in (claim.first, claim.second):
        known = ours.get(((claim.measure, claim.kind), name))
        if known is not None:
            paper_sd = number(reported(claim.measure, claim.kind).sds[name], claim.measure)
            ends.append(f"{CONDITION_NAMES[name]} {number(known[1], claim.measure)} ({paper_sd})")
    difference = f"difference {number(share.mean, claim.measure)}, in the paper "
    difference += number(claim.paper_difference, claim.measure)
    return f"{', '.join(told)}; {difference}; SD (the paper's) {', '.join(ends)}"


def _result(claim: Claim, one: Experiment) -> str:
    pair = one.pair(claim)
    assert pair is not None
    before, after = pair
    sign = f", sign {percent(after.same_sign)}" if claim.verdict == "different" else ""
    from_ = f"{percent(before.significant)} to " if one.simulated else ""
    reached = " (reached)" if ceiling().rows[claim].met_by(after) else ""
    return f"{one.name} p<.05 {from_}{percent(after.significant)}{sign}{reached}"


def _helps(claim: Claim, before: Share, after: Share, studies: int) -> bool:
    """Whether an experiment brings a comparison nearer to its aim by more than chance."""
    wanted = 1.0 if claim.verdict == "different" else -1.0
    steps = [(before.significant, after.significant, wanted)]
    if claim.verdict == "different":
        steps.append((before.same_sign, after.same_sign, 1.0))
    return any(toward * (other - one) > noise(one, studies) for one, other, toward in steps)


def noise(share: float, studies: int) -> float:
    """By how much a share must change to be said to move."""
    return max(MOVED, 2.0 * math.sqrt(max(share * (1.0 - share), 0.04) / studies))


def by_chance(share: Share) -> bool:
    """Whether a miss is so small that other studies of the same kind may well not miss."""
    row, studies = ceiling().rows[share.claim], len(share.differences)
    if not studies:
        return False
    reached = share.significant if share.claim.verdict == "different" else 1.0 - share.significant

    def near(value: float, aim: float) -> bool:
        return aim - value <= CHANCE_SE * math.sqrt(max(aim * (1.0 - aim), 0.0) / studies)

    signed = share.claim.verdict != "different" or near(share.same_sign, SIGN_AIM)
    return signed and near(reached, row.aim)
