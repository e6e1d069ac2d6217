"""Why a comparison misses its aim: the experiment that mends it names the reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.replication.comparisons import Share, compared, joint, shares
from app.replication.paper import CLAIMS, Claim, reported
from app.replication.reasons import Experiment, by_chance, experiments, missed, reason_line, spread_of
from app.replication.studies import Values
from study.analysis.effect_sizes import NotFitted
from study.analysis.observations import Observation
from tests.support.study_values import as_the_paper_found

pytestmark = pytest.mark.slow

KEY = ("efficiency_ticks", "all")
OF_KEY = [claim for claim in CLAIMS if (claim.measure, claim.kind) == KEY]
WANTED = next(claim for claim in OF_KEY if (claim.first, claim.second) == ("goal_oriented", "teleoperation"))
PAPER = reported(*KEY)


def studies_with(change: Callable[[Observation], float], count: int = 12) -> list[Values]:
    """Studies as the paper found, of efficiency alone, each value changed."""
    rng = np.random.default_rng(9)
    found = []
    for _ in range(count):
        values = as_the_paper_found(rng, 24)
        own = tuple(replace(one, value=change(one)) for one in values.observations[KEY])
        found.append(Values({KEY: own}, values.counts))
    return found


def tried(studies: list[Values], claim: Claim = WANTED) -> tuple[Share, dict[str, Experiment], str]:
    """The share of one comparison, the experiments by name, and what is said of it."""
    base = shares([compared(values, OF_KEY) for values in studies], OF_KEY)
    share = next(item for item in base if item.claim == claim)
    found = experiments(studies, base, 1)
    return share, {one.name: one for one in found}, reason_line(share, found, spread_of(studies))


def after(experiment: Experiment, claim: Claim = WANTED) -> Share:
    pair = experiment.pair(claim)
    assert pair is not None
    return pair[1]


def test_noise_is_the_reason_where_values_spread_too_much() -> None:
    studies = studies_with(lambda one: PAPER.means[one.condition] + 4.0 * (one.value - PAPER.means[one.condition]))
    share, found, line = tried(studies)
    assert share.significant < 0.5
    assert after(found["the paper's SD"]).significant > 0.9
    assert after(found["the paper's means"]).significant < 0.5
    assert "reaches the aim: **residual noise**" in line
    assert "(reached)" in line


def test_the_size_of_a_difference_is_the_reason_where_means_are_too_near() -> None:
    between = sum(PAPER.means.values()) / 3.0
    studies = studies_with(lambda one: one.value - 0.9 * (PAPER.means[one.condition] - between))
    _, found, line = tried(studies)
    assert after(found["the paper's means"]).significant > 0.9
    assert after(found["the paper's SD"]).significant < 0.5
    assert "**size of the difference** (the paper's means)" in line


def test_goals_that_differ_are_taken_up_by_covariates() -> None:
    """Ticks that hang on the goal more than on anything else: without covariates the difference drowns."""
    far = {f"goal_{place}": 400.0 * place for place in range(4)}
    studies = studies_with(lambda one: PAPER.means[one.condition] + 0.4 * (one.value - PAPER.means[one.condition]))
    studies = [
        replace(s, observations={KEY: tuple(replace(o, value=o.value + far[o.goal]) for o in s.observations[KEY])})
        for s in studies
    ]
    claims = [WANTED]
    with_goals = shares([compared(values, claims) for values in studies], claims)[0]
    assert with_goals.significant > 0.9
    plain = next(
        e for e in experiments(studies, [replace(with_goals, significant=0.0)], 1) if e.name == "no covariates"
    )
    assert after(plain).significant < 0.1


def test_two_studies_make_one_of_twice_the_people() -> None:
    studies = studies_with(lambda one: PAPER.means[one.condition] + 3.0 * (one.value - PAPER.means[one.condition]))
    share, found, _ = tried(studies)
    doubled = found["twice the people"]
    assert doubled.studies == 6
    assert after(doubled).significant > share.significant
    assert after(doubled).mean == pytest.approx(share.mean, rel=0.1)


def test_only_what_misses_is_looked_into() -> None:
    rng = np.random.default_rng(3)
    studies = [as_the_paper_found(rng, 240)]
    base = shares([compared(values, [WANTED]) for values in studies], [WANTED])
    assert missed(base) == ()
    assert experiments(studies, base, 1) == ()


@pytest.mark.parametrize(("significant", "chance"), [(0.78, True), (0.60, False)])
def test_a_miss_within_chance_is_said_to_be(significant: float, chance: bool) -> None:
    share = Share(WANTED, (-40.0,) * 200, 0.99, significant, 0.0, 0.0, 0.0)
    assert by_chance(share) is chance
    assert ("within the chance" in reason_line(share, (), {})) is chance


# ---- what cannot be compared ----------------------------------------------------------------------------------------


def only(values: Values, keep: Callable[[Observation], bool]) -> Values:
    return replace(
        values, observations={key: tuple(one for one in of if keep(one)) for key, of in values.observations.items()}
    )


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda values: only(values, lambda one: one.condition != "balanced"), "no values under balanced"),
        (lambda values: only(values, lambda one: False), "there are no values"),
        (
            lambda values: replace(
                values,
                observations={key: tuple(replace(o, value=4.0) for o in of) for key, of in values.observations.items()},
            ),
            "values are equal (4)",
        ),
        (lambda values: only(values, lambda one: one.participant == "S001" and one.goal == ""), "at least 2"),
    ],
    ids=["no condition", "nobody", "constant", "one participant"],
)
def test_what_cannot_be_compared_is_a_sentence(change: Callable[[Values], Values], told: str) -> None:
    values = change(as_the_paper_found(np.random.default_rng(1)))
    found = compared(values)
    reasons = {item.reason for item in found.values() if isinstance(item, NotFitted)}
    assert set(found) == set(CLAIMS)
    assert any(told in reason for reason in reasons), reasons
    share = next(item for item in shares([found]) if item.untested)
    assert share.untested[0] in reasons
    assert joint([found]).signs == 0.0
    assert all(mean == mean and sd == sd for mean, sd in spread_of([values]).values())
