"""The mixed model against lme4, lmerTest, emmeans and pbkrtest (figures of a fitted R session, in reference/), against
published examples, and on data that cannot be fitted."""

from __future__ import annotations

import csv
import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from study.analysis.effect_sizes import NotFitted
from study.analysis.linear_model import Anova, anova, tukey
from study.analysis.mixed_model import MixedModel, mixed_model
from study.analysis.studentized_range import critical, upper_tail
from tests.analysis.test_statistics import stools

REFERENCE = Path(__file__).parent / "reference"
FITTED: dict[str, Any] = json.loads((REFERENCE / "lme4.json").read_text(encoding="utf-8"))
COVARIATES = {"random": ("position", "goal"), "with_participant": ("position", "goal", "participant")}
CLOSE = 1e-4
"""Relative, as promised in docs/topics/statistics.md."""
COARSE_DF = 5.0
"""R's own ptukey is off by up to 1e-3 below this, and has no value below 2."""


@cache
def data() -> dict[str, list[dict[str, str]]]:
    found: dict[str, list[dict[str, str]]] = {}
    with (REFERENCE / "data.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            found.setdefault(row["case"], []).append(row)
    return found


@cache
def ours(case: str, model: str) -> MixedModel | NotFitted:
    rows = data()[case]
    covariates = {name: [row[name] for row in rows] for name in COVARIATES[model]}
    return mixed_model([float(row["value"]) for row in rows], [row["condition"] for row in rows], covariates)


def fitted(model: MixedModel | NotFitted) -> MixedModel:
    assert isinstance(model, MixedModel), model
    return model


def listed(value: Any) -> list[Any]:
    """R's JSON writes one number as itself."""
    return value if isinstance(value, list) else [value]


OF_A_PAIR = ("pairs", "difference", "pair_se", "pair_df", "p_tukey", "low", "high")
EVERY = [(case, model) for case, of in FITTED["cases"].items() for model in of]


def test_the_reference_holds_what_can_go_wrong() -> None:
    assert set(data()) == set(FITTED["cases"])
    assert all("error" not in FITTED["cases"][case][model] for case, model in EVERY)
    assert set(FITTED["versions"]) == {"R", "lme4", "lmerTest", "emmeans", "pbkrtest"}
    singular = [case for case, model in EVERY if min(FITTED["cases"][case][model]["sd"].values()) == 0.0]
    assert {"singular_position", "singular_all"} <= set(singular)
    assert listed(FITTED["cases"]["one_level_position"]["random"]["random"]) == ["goal"]
    assert len(listed(FITTED["cases"]["missing_condition"]["random"]["satterthwaite"]["means"])) == 2


@pytest.mark.parametrize(("case", "model"), EVERY)
def test_the_fit_is_that_of_lme4(case: str, model: str) -> None:
    found, expected = fitted(ours(case, model)), FITTED["cases"][case][model]
    assert found.criterion == pytest.approx(expected["criterion"], rel=1e-9, abs=1e-6)
    names = expected["random"]
    assert [part.name for part in found.random] == listed(names)
    smallest = 1e-4 * found.residual_sd
    for part in found.random:
        assert part.sd == pytest.approx(expected["sd"][part.name], rel=CLOSE, abs=smallest)
    assert found.residual_sd == pytest.approx(expected["sd"]["Residual"], rel=CLOSE)


@pytest.mark.parametrize("method", ["satterthwaite", "kenward_roger"])
@pytest.mark.parametrize(("case", "model"), EVERY)
def test_f_degrees_of_freedom_p_and_adjusted_means_are_those_of_r(case: str, model: str, method: str) -> None:
    found, expected = fitted(ours(case, model)), FITTED["cases"][case][model][method]
    test = found.anova if method == "satterthwaite" else found.kenward_roger
    assert isinstance(test, Anova)
    assert test.df_effect == expected["df_effect"]
    assert test.f == pytest.approx(expected["f"], rel=CLOSE)
    assert test.df_error == pytest.approx(expected["df_error"], rel=CLOSE)
    assert test.p == pytest.approx(expected["p"], rel=CLOSE, abs=1e-12)
    near_zero = 1e-4 * test.adjusted_means[0].se  # means of thousandths lie around 0
    assert [of.mean for of in test.adjusted_means] == pytest.approx(listed(expected["means"]), rel=CLOSE, abs=near_zero)
    assert [of.se for of in test.adjusted_means] == pytest.approx(expected["se"], rel=CLOSE)
    assert [of.df for of in test.adjusted_means] == pytest.approx(expected["df"], rel=CLOSE)
    pairs = tukey(test)
    for index, pair in enumerate(pairs):
        row, column = test.conditions.index(pair.first), test.conditions.index(pair.second)
        one = {key: listed(expected[key])[index] for key in OF_A_PAIR}
        assert one["pairs"] == f"{pair.first} - {pair.second}"
        assert pair.difference.value == pytest.approx(one["difference"], rel=CLOSE, abs=near_zero)
        assert test.contrast_se[row][column] == pytest.approx(one["pair_se"], rel=CLOSE)
        assert test.contrast_df[row][column] == pytest.approx(one["pair_df"], rel=CLOSE)
        if one["pair_df"] >= COARSE_DF or len(pairs) == 1:
            assert pair.p == pytest.approx(one["p_tukey"], rel=CLOSE, abs=1e-9)
            assert pair.difference.low == pytest.approx(one["low"], rel=CLOSE, abs=near_zero)
            assert pair.difference.high == pytest.approx(one["high"], rel=CLOSE, abs=near_zero)


# ---- published ------------------------------------------------------------------------------------------------------


def test_the_stools() -> None:
    """Pinheiro & Bates (2000), sec. 1.2.1: lme, REML. Balanced: the degrees of freedom are those of the ANOVA."""
    values, kinds, people = stools()
    model = fitted(mixed_model(values, kinds, {"participant": people}))
    means = [of.mean for of in model.anova.adjusted_means]
    assert np.subtract(means[1:], means[0]) == pytest.approx([3.888889, 2.222222, 0.666667], abs=1e-6)
    assert model.anova.contrast_se[0][1] == pytest.approx(0.5186838, abs=1e-7)
    assert (model.random[0].sd, model.residual_sd) == pytest.approx((1.332465, 1.100295), abs=1e-6)
    assert model.anova.f == pytest.approx(22.3556, abs=5e-5)
    assert model.anova.df_error == pytest.approx(24.0)
    assert isinstance(model.kenward_roger, Anova)
    assert model.kenward_roger.df_error == pytest.approx(24.0)
    assert model.kenward_roger.f == pytest.approx(model.anova.f)
    assert model.notes == ()


# ---- what happens at the edges --------------------------------------------------------------------------------------


def test_without_any_variance_of_a_covariate_it_is_the_analysis_of_variance() -> None:
    rng = np.random.default_rng(5)
    kinds, people = ["a", "b", "c"] * 40, [str(index // 12) for index in range(120)]
    values = np.tile(rng.normal(size=12), 10).tolist()  # every participant has the same twelve values
    model = fitted(mixed_model(values, kinds, {"participant": people}))
    plain = anova(values, kinds)
    assert isinstance(plain, Anova)
    assert model.notes == ("the variance of participant is estimated as 0",)
    assert (model.anova.f, model.anova.df_error, model.anova.p) == pytest.approx((plain.f, plain.df_error, plain.p))


def test_a_covariate_with_one_level_is_left_out_and_told() -> None:
    model = fitted(ours("one_level_position", "random"))
    assert [part.name for part in model.random] == ["goal"]
    assert model.notes == ("position has one level and is left out",)


def test_covariates_that_always_change_together_count_once_and_it_is_told() -> None:
    values, kinds, people = stools()
    once = fitted(mixed_model(values, kinds, {"participant": people}))
    twice = fitted(mixed_model(values, kinds, {"participant": people, "chair": [f"of {name}" for name in people]}))
    assert twice.anova == once.anova
    assert "chair is left out: its variance cannot be told apart from that of participant" in twice.notes[0]
    own = fitted(mixed_model(values, kinds, {"value": [str(index) for index in range(36)]}))
    assert "value is left out: its variance cannot be told apart from that of single values" in own.notes[0]


def test_the_unit_and_the_zero_of_the_values_change_nothing() -> None:
    rows = data()["unbalanced"]
    covariates = {name: [row[name] for row in rows] for name in COVARIATES["random"]}
    kinds = [row["condition"] for row in rows]
    values = np.array([float(row["value"]) for row in rows])
    base = fitted(mixed_model(values.tolist(), kinds, covariates))
    for factor, shift in ((1e-7, 0.0), (1e9, 0.0), (1.0, 1e5)):
        other = fitted(mixed_model((factor * values + shift).tolist(), kinds, covariates))
        assert (other.anova.f, other.anova.df_error) == pytest.approx((base.anova.f, base.anova.df_error), rel=1e-6)
        assert other.anova.adjusted_means[0].se == pytest.approx(factor * base.anova.adjusted_means[0].se, rel=1e-6)


KINDS = ["a", "a", "b", "b", "c", "c"]


@pytest.mark.parametrize(
    ("values", "kinds", "covariate", "reason"),
    [
        ([], [], [], "there are no values"),
        ([1.0, 2.0], ["a", "a"], ["x", "y"], "values under a alone; at least two conditions are needed"),
        ([1.0, 2.0, 3.0], ["a", "a", "b"], ["x", "y", "x"], "fewer than 2 values under b"),
        ([4.0] * 6, KINDS, ["x", "y"] * 3, "all 6 values are equal"),
        ([1.0, math.nan, 1.0, 2.0, 3.0, 4.0], KINDS, ["x", "y"] * 3, "a value is not a finite number"),
        ([1.0, math.inf, 1.0, 2.0, 3.0, 4.0], KINDS, ["x", "y"] * 3, "a value is not a finite number"),
        ([1.0, 2.0, 3.0, 4.0, 5.0, 7.0], KINDS, list("112233"), "cannot be told apart from covariate"),
        ([1.0, 1.0, 2.0, 2.0, 3.0, 3.0], KINDS, ["x", "y"] * 3, "the values do not vary within the conditions"),
        ([1.0, 2.0, 2.0, 3.0, 3.0, 4.0], KINDS, ["x", "y"] * 3, "the values do not vary within the conditions"),
        ([1.0, 2.0, 3.0, 5.0], ["a", "b", "a", "b"], list("xyyz"), "4 values are too few for 2 conditions"),
    ],
)
def test_what_cannot_be_fitted_is_said(
    values: list[float], kinds: list[str], covariate: list[str], reason: str
) -> None:
    model = mixed_model(values, kinds, {"covariate": covariate})
    assert isinstance(model, NotFitted)
    assert reason in model.reason


def test_few_values_give_finite_numbers_or_a_sentence() -> None:
    """Many tiny, ragged designs: no exception, no NaN."""
    rng = np.random.default_rng(17)
    fits = 0
    for _ in range(150):
        count = int(rng.integers(4, 14))
        values = np.round(rng.normal(size=count), int(rng.integers(0, 3))).tolist()
        kinds = [str(code) for code in rng.integers(0, 3, count)]
        covariates = {name: [str(code) for code in rng.integers(0, 4, count)] for name in ("position", "goal")}
        model = mixed_model(values, kinds, covariates)
        if isinstance(model, NotFitted):
            assert model.reason
            continue
        fits += 1
        for test in (model.anova, model.kenward_roger):
            if isinstance(test, Anova):
                numbers = [test.f, test.df_error, test.p, *(of.se for of in test.adjusted_means)]
                numbers += [pair.p for pair in tukey(test, intervals=False)]
                assert all(math.isfinite(number) and number >= 0.0 for number in numbers)
    assert fits > 50


def test_an_f_below_zero_is_no_test() -> None:
    """Below two degrees of freedom Kenward and Roger's scale of F may be negative: R prints such an F with p = 1."""
    values = [176, 251, 436, 102, 40, 143, 82, 196, 233, -120, 247, -190, 154, 265, 52, 237, 6, 190, 9]
    positions, goals = "1111222333111222333", "0123226026113983488"
    model = fitted(mixed_model(values, list("bbbbtttgggtttbbbggg"), {"position": list(positions), "goal": list(goals)}))
    assert isinstance(model.kenward_roger, NotFitted)
    assert "too few values for Kenward and Roger's adjustment" in model.kenward_roger.reason
    assert math.isfinite(model.anova.p)


def test_of_two_summits_the_higher_is_found() -> None:
    """Nine people and fourteen values: lme4 begun at 1 ends at -9.4435, and begun at 0.1 or 3 at -11.4067354."""
    values = [1.158653083, 0.9859767344, 1.072384954, 0.9930958428, 1.064213175, 0.8112864874, 0.8230225646]
    values += [0.9256162351, 0.6730320291, 0.7804344823, 1.075341543, 0.8417327001, 1.102268901, 0.8595483709]
    covariates = {"position": list("23311312331313"), "goal": list("12000023000000"), "person": list("00123344568899")}
    model = fitted(mixed_model(values, list("btbbbggtgbgbbg"), covariates))
    assert model.criterion == pytest.approx(-11.4067354, abs=1e-6)


# ---- Tukey's distribution -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("df", [0.7, 1.3, 3.7, 10.0, 55.5, 2e6])
@pytest.mark.parametrize("groups", [3, 5])
def test_the_studentised_range_is_that_of_the_library(groups: int, df: float) -> None:
    for q in (0.1, 1.0, 3.0, 12.0):
        expected = float(stats.studentized_range.sf(q, groups, df if df < 1e5 else math.inf))
        assert upper_tail(q, groups, df) == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert upper_tail(critical(0.95, groups, df), groups, df) == pytest.approx(0.05)


def test_of_two_groups_it_is_t() -> None:
    assert upper_tail(3.0, 2, 2.5) == pytest.approx(2.0 * float(stats.t.sf(3.0 / math.sqrt(2.0), 2.5)), rel=1e-12)
    assert critical(0.95, 2, 2.5) == pytest.approx(math.sqrt(2.0) * float(stats.t.ppf(0.975, 2.5)), rel=1e-9)
    assert upper_tail(0.0, 3, 10.0) == 1.0
