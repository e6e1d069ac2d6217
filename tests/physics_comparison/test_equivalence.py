"""Differences within people, and what the rule says of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from app.physics_comparison.closed_loop import BLOCKED, MEASURES, OUTCOMES
from app.physics_comparison.equivalence import Difference, Equivalence, equivalences
from app.physics_comparison.rule import hash_line, rule
from app.replication.studies import Values
from study.analysis.observations import Observation

CONDITIONS = ("teleoperation", "goal_oriented", "balanced")
TICKS = ("efficiency_ticks", "pickup")
KEYS = (*MEASURES, *OUTCOMES, *BLOCKED)


def values(
    people: int = 40, shift: float = 0.0, of: str | None = None, noise: float = 2.0, seed: int = 1, picked: float = 1.0
) -> Values:
    """People who take 150, 90 and 120 ticks a pickup, `shift` more (under one condition only, if it is named)."""
    rng = np.random.default_rng(seed)
    found: dict[tuple[str, str], tuple[Observation, ...]] = dict.fromkeys(KEYS, ())
    for condition, mean in zip(CONDITIONS, (150.0, 90.0, 120.0), strict=True):
        more = shift if of in (None, condition) else 0.0
        for person in range(people):
            for _ in range(3):
                place = (condition, f"{person:05d}", 1, "", 0)
                found[TICKS] += (Observation(mean + more + person + float(rng.normal(0.0, noise)), *place),)
                found["picked", "pickup"] += (Observation(float(rng.random() < picked), *place),)
    return Values(found)


def ticks(other: Values, people: int = 40) -> Equivalence:
    found = equivalences("other", values(people), other, CONDITIONS, participants=12)
    return next(one for one in found if one.key == TICKS)


def test_the_bound_is_a_quarter_of_the_largest_difference_between_conditions() -> None:
    found = ticks(values(seed=2))
    assert found.bound == pytest.approx(rule().share_of_difference * 60.0, rel=0.02)
    assert found.verdict == "interchangeable"
    assert [level.condition for level in found.levels] == list(CONDITIONS)
    assert found.effects[0].conditions == ("teleoperation", "goal_oriented")
    assert found.effects[0].first == pytest.approx(60.0, abs=1.0)


def test_where_conditions_hardly_differ_it_is_half_the_standard_error_in_one_study() -> None:
    people = [Observation(100.0 + who % 2 * (condition == "balanced"), condition, f"{who}", 1, "", 0)
              for condition in CONDITIONS for who in range(40)]  # fmt: skip
    flat = Values({**dict.fromkeys(KEYS, ()), TICKS: tuple(people)})
    (found,) = (one for one in equivalences("other", flat, flat, CONDITIONS, 12) if one.key == TICKS)
    spread = np.std([0.0, 1.0] * 20, ddof=1)
    assert found.bound == pytest.approx(max(0.5 * spread / math.sqrt(12), 0.25 * 0.5))


def test_an_offset_of_all_conditions_leaves_the_effects() -> None:
    assert ticks(values(seed=2, shift=40.0)).verdict == "effects carry over"


def test_an_offset_of_one_condition_turns_a_result_round() -> None:
    found = ticks(values(seed=2, shift=40.0, of="balanced"))
    assert found.verdict == "differs" and found.people_needed == math.inf


def test_few_people_and_much_noise_show_nothing_and_it_is_told_how_many_it_takes() -> None:
    few = equivalences("other", values(4, noise=80.0), values(4, noise=80.0, seed=9), CONDITIONS, 12)
    found = next(one for one in few if one.key == TICKS)
    assert found.verdict == "not shown"
    assert found.people_needed > 4
    lone = equivalences("other", values(1), values(1, seed=2), CONDITIONS, 12)
    assert {one.verdict for one in lone if one.key == TICKS} == {"not shown"}


def test_the_interval_is_students_over_people_of_differences_within_them() -> None:
    of = [1.0, 2.0, 4.0, 5.5]
    found = Difference.of(of)
    low, high = stats.t.interval(0.95, 3, loc=np.mean(of), scale=stats.sem(of))
    assert (found.mean - found.reach(0.95), found.mean + found.reach(0.95)) == pytest.approx((low, high))
    # Two one-sided tests at .05 and the 90 % interval are one and the same.
    p = stats.ttest_1samp(of, 9.0, alternative="less").pvalue
    assert (p < 0.05) == (found.shown(9.0, 0.05, 1) == "within")


def test_only_who_has_values_on_both_counts() -> None:
    other = values(seed=2)
    fewer = {key: tuple(one for one in of if one.participant < "00010") for key, of in other.observations.items()}
    assert {level.difference.people for level in ticks(Values(fewer)).levels} == {10}


def test_outcomes_have_a_bound_of_their_own_over_all_conditions() -> None:
    first = values(picked=1.0)
    for share, verdict in ((1.0, "interchangeable"), (0.6, "differs")):
        found = equivalences("other", first, values(picked=share, seed=3), CONDITIONS, 12)
        picked = next(one for one in found if one.measure == "picked")
        assert (picked.verdict, picked.bound) == (verdict, rule().outcome)
        assert picked.effects == () and len(picked.levels) == 4


def test_one_condition_alone_has_no_bound() -> None:
    found = equivalences("other", values(), values(seed=2), CONDITIONS[:1], 12)
    assert next(one for one in found if one.key == TICKS).verdict == "no bound"


def test_the_rule_names_the_numbers_that_it_tests_with() -> None:
    told = " ".join(rule().sentences)
    assert rule().share_of_difference == 0.25 and "a quarter" in told
    assert rule().share_of_standard_error == 0.5 and "half the standard error" in told
    for number in (rule().outcome, rule().alpha, f"{rule().apart_mm:g} mm", f"{rule().turned_deg:g} degree"):
        assert str(number).removeprefix("0") in told
    assert rule().quantile == rule().same_choices == 0.99 and told.count("99 of 100") == 2
    assert rule().sha256 in hash_line()


def test_an_outcome_that_never_differs_is_shown_by_many_attempts_and_not_by_few() -> None:
    def picked(people: int) -> Equivalence:
        found = equivalences("other", values(people), values(people, seed=2), CONDITIONS, participants=12)
        return next(one for one in found if one.key == ("picked", "pickup"))

    few, many = picked(2), picked(20)  # 18 and 180 attempts, all of them successes on both robots
    assert (few.verdict, many.verdict) == ("not shown", "interchangeable")
    assert few.people_needed == math.ceil(59 / 9)
    assert many.levels[0].difference.reach(0.9) == pytest.approx(1.0 - 0.05 ** (1.0 / 180.0))
    assert 0.95**59 < 0.05 < 0.95**58
