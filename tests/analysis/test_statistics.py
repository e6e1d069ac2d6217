"""The statistics against published worked examples, and against an independent implementation in the library."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import TypeVar

import numpy as np
import pandas as pd
import pytest
from scipy.special import ndtr
from statsmodels.stats.anova import AnovaRM

from study.analysis.effect_sizes import Interval, NotFitted, d_within, eta_squared, hedges_g
from study.analysis.linear_model import (
    Anova,
    RepeatedMeasures,
    anova,
    brown_forsythe,
    greenhouse_geisser,
    repeated_measures,
    slope,
    tukey,
)

# Dobson, "An Introduction to Statistical Modelling" (1983), plant weights; R ships it as PlantGrowth.
PLANTS = {
    "ctrl": [4.17, 5.58, 5.18, 6.11, 4.50, 4.61, 5.17, 4.53, 5.33, 5.14],
    "trt1": [4.81, 4.17, 4.41, 3.59, 5.87, 3.83, 6.03, 4.89, 4.32, 4.69],
    "trt2": [6.31, 5.12, 5.54, 5.50, 5.37, 5.29, 4.92, 6.15, 5.80, 5.26],
}

# Tippett, "Technological Applications of Statistics" (1950), warp breaks by wool and tension; R's warpbreaks.
BREAKS = {
    ("A", "L"): [26, 30, 54, 25, 70, 52, 51, 26, 67],
    ("A", "M"): [18, 21, 29, 17, 12, 18, 35, 30, 36],
    ("A", "H"): [36, 21, 24, 18, 10, 43, 28, 15, 26],
    ("B", "L"): [27, 14, 29, 19, 29, 31, 41, 20, 44],
    ("B", "M"): [42, 26, 19, 16, 39, 28, 21, 39, 29],
    ("B", "H"): [20, 21, 24, 17, 13, 15, 15, 16, 28],
}

# Pinheiro & Bates, "Mixed-Effects Models in S and S-PLUS" (2000), sec. 1.2: effort to rise
# from four stools, 9 subjects.
STOOLS = {
    "T1": [12, 10, 7, 7, 8, 9, 8, 7, 9],
    "T2": [15, 14, 14, 11, 11, 11, 12, 11, 13],
    "T3": [12, 13, 13, 10, 8, 11, 12, 8, 10],
    "T4": [10, 12, 9, 9, 7, 10, 11, 7, 8],
}

# Winer, "Statistical Principles in Experimental Design" (1971), table 4.3-1: reaction time, 5 people, 4 drugs.
DRUGS = [[30, 28, 16, 34], [14, 18, 10, 22], [24, 20, 18, 30], [38, 34, 20, 44], [26, 28, 14, 30]]

# Henderson & Velleman (1981), miles per gallon of cars with automatic and manual transmission; R's mtcars.
AUTOMATIC = [21.4, 18.7, 18.1, 14.3, 24.4, 22.8, 19.2, 17.8, 16.4, 17.3, 15.2, 10.4, 10.4, 14.7, 21.5, 15.5, 15.2]
AUTOMATIC += [13.3, 19.2]
MANUAL = [21.0, 21.0, 22.8, 32.4, 30.4, 33.9, 27.3, 26.0, 30.4, 15.8, 19.7, 15.0, 21.4]

# Student, "The probable error of a mean" (1908): extra hours of sleep, 10 patients, two drugs.
SLEEP = ([0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0], [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4])


Cell = TypeVar("Cell", bound=Hashable)


def flat(groups: Mapping[Cell, Sequence[float]]) -> tuple[list[float], list[Cell]]:
    return [value for values in groups.values() for value in values], [
        name for name, values in groups.items() for _ in values
    ]


def stools() -> tuple[list[float], list[str], list[str]]:
    values, kinds = flat(STOOLS)
    return values, kinds, [f"S{index}" for _ in STOOLS for index in range(9)]


def fitted(model: Anova | NotFitted) -> Anova:
    assert isinstance(model, Anova), model
    return model


def test_one_way_anova_of_plant_weights() -> None:
    model = fitted(anova(*flat(PLANTS)))
    assert (model.df_effect, model.df_error) == (2, 27)
    assert model.f == pytest.approx(4.846, abs=5e-4)
    assert model.p == pytest.approx(0.01591, abs=5e-6)
    assert model.mean_square_error == pytest.approx(0.3886, abs=5e-5)


def test_tukey_hsd_of_plant_weights() -> None:
    """R: TukeyHSD(aov(weight ~ group, PlantGrowth))."""
    found = {(pair.second, pair.first): pair for pair in tukey(fitted(anova(*flat(PLANTS))))}
    expected = {
        ("trt1", "ctrl"): (-0.371, -1.0622161, 0.3202161, 0.3908711),
        ("trt2", "ctrl"): (0.494, -0.1972161, 1.1852161, 0.1979960),
        ("trt2", "trt1"): (0.865, 0.1737839, 1.5562161, 0.0120064),
    }
    for names, (difference, low, high, p) in expected.items():
        pair = found[names]  # ours is first less second, R's second less first
        assert -pair.difference.value == pytest.approx(difference, abs=1e-9)
        assert (-pair.difference.high, -pair.difference.low) == pytest.approx((low, high), abs=2e-6)
        assert pair.p == pytest.approx(p, abs=2e-6)


def test_anova_and_tukey_given_a_second_factor() -> None:
    """R: aov(breaks ~ wool + tension, warpbreaks) and its TukeyHSD: the condition here is the tension."""
    values, cells = flat(BREAKS)
    wool, tension = zip(*cells, strict=True)
    model = fitted(anova(values, tension, {"wool": wool}))
    assert (model.df_effect, model.df_error) == (2, 50)
    assert model.f == pytest.approx(7.537, abs=5e-4)
    assert model.p == pytest.approx(0.00138, abs=5e-6)
    pairs = {(pair.first, pair.second): pair for pair in tukey(model)}
    low_high = pairs["L", "H"]
    assert low_high.difference.value == pytest.approx(14.722222, abs=1e-6)
    assert (low_high.difference.low, low_high.difference.high) == pytest.approx((5.3688015, 24.075643), abs=1e-5)
    assert low_high.p == pytest.approx(0.0011218, abs=2e-6)
    assert pairs["L", "M"].p == pytest.approx(0.0336262, abs=2e-6)
    assert pairs["M", "H"].p == pytest.approx(0.4474210, abs=2e-6)


def test_an_unbalanced_covariate_moves_the_adjusted_means() -> None:
    # Value = 10 per condition step + 100 for position 2; "b" was mostly run second. Noise is symmetric.
    rows = [("a", 1, 0.0)] * 6 + [("a", 2, 100.0)] * 2 + [("b", 1, 10.0)] * 2 + [("b", 2, 110.0)] * 6
    noise = [1.0, -1.0] * 8
    values = [value + error for (_, _, value), error in zip(rows, noise, strict=True)]
    model = fitted(anova(values, [row[0] for row in rows], {"position": [row[1] for row in rows]}))
    means = {item.condition: item.mean for item in model.adjusted_means}
    assert means == pytest.approx({"a": 50.0, "b": 60.0})
    assert tukey(model)[0].difference.value == pytest.approx(-10.0)


def test_repeated_measures_of_the_stools() -> None:
    """Pinheiro & Bates: anova(lme(effort ~ Type, random = ~ 1 | Subject)) gives F(3, 24) = 22.3556."""
    result = repeated_measures(*stools())
    assert isinstance(result, RepeatedMeasures)
    assert (result.anova.df_effect, result.anova.df_error, result.participants) == (3, 24, 9)
    assert result.anova.f == pytest.approx(22.3556, abs=5e-5)


def test_repeated_measures_agree_with_the_librarys_own() -> None:
    values = np.array(DRUGS, dtype=float).ravel().tolist()
    drug, person = ["a", "b", "c", "d"] * 5, [str(index) for index in range(5) for _ in range(4)]
    result = repeated_measures(values, drug, person)
    assert isinstance(result, RepeatedMeasures)
    frame = pd.DataFrame({"value": values, "drug": drug, "person": person})
    table = AnovaRM(frame, "value", "person", within=["drug"]).fit().anova_table
    assert result.anova.f == pytest.approx(float(table["F Value"].iloc[0]))
    assert result.anova.f == pytest.approx(24.76, abs=5e-3)  # Winer 1971
    assert result.epsilon == pytest.approx(0.6049, abs=5e-5)  # Stata manual, [R] anova, example 15
    assert result.p_corrected > result.anova.p


def test_a_spherical_table_needs_no_correction() -> None:
    assert greenhouse_geisser([[1.0, 2.0], [2.0, 5.0], [4.0, 4.0]]) == 1.0
    assert greenhouse_geisser(DRUGS) == pytest.approx(0.6049, abs=5e-5)


@pytest.mark.parametrize(
    ("f", "df_effect", "df_error", "low", "high"),
    [
        # Smithson (2001), Educational and Psychological Measurement 61(4), p. 619; as the R package apaTables prints it
        (6.00, 1, 42, 0.01170243, 0.2801166),
        (2.65, 6, 42, 0.01744483, 0.3577174),
        # Fidler & Thompson (2001), the same journal, tables 6 and 8
        (4.00, 3, 16, 0.03574041, 0.5670909),
        (1.50, 1, 16, 0.0, 0.3166901),
    ],
)
def test_partial_eta_squared_and_its_interval(f: float, df_effect: int, df_error: int, low: float, high: float) -> None:
    found = eta_squared(f, df_effect, df_error)
    assert found.value == pytest.approx(f * df_effect / (f * df_effect + df_error))
    assert (found.low, found.high) == pytest.approx((low, high), abs=1e-4)


def test_hedges_g_of_the_cars() -> None:
    """Documentation of the R package effectsize: hedges_g(mpg ~ am, mtcars) = -1.44 [-2.21, -0.65]."""
    found = hedges_g(AUTOMATIC, MANUAL)
    assert isinstance(found, Interval)
    assert (found.value, found.low, found.high) == pytest.approx((-1.44, -2.21, -0.65), abs=5e-3)


def test_d_within_of_the_sleepers() -> None:
    """Documentation of the R package effectsize: cohens_d(Pair(extra 1, extra 2)) of sleep = -1.28 [-2.12, -0.41]."""
    found = d_within(*SLEEP)
    assert isinstance(found, Interval)
    assert (found.value, found.low, found.high) == pytest.approx((-1.28, -2.12, -0.41), abs=5e-3)


def test_intervals_of_huge_effects_and_of_none() -> None:
    rng = np.random.default_rng(3)
    huge = hedges_g((100.0 + rng.normal(size=400)).tolist(), rng.normal(size=400).tolist())
    assert isinstance(huge, Interval)
    assert huge.low < huge.value < huge.high
    assert eta_squared(0.0, 2, 100) == Interval(0.0, 0.0, 0.0)
    assert 0.98 < eta_squared(5000.0, 2, 100).low < eta_squared(5000.0, 2, 100).high < 1.0


def test_two_participants_have_an_interval_too() -> None:
    """t = d sqrt(2) = 20 with one degree of freedom, where the library's noncentral t gives up."""
    found = d_within([10.0, 10.0 + 2**0.5 / 10.0], [0.0, 0.0])
    assert isinstance(found, Interval)
    assert found.low < found.value < found.high
    t, s = found.value * 2**0.5, np.linspace(0.0, 12.0, 240_001)
    chi = np.sqrt(2.0 / np.pi) * np.exp(-(s**2) / 2.0)  # one degree of freedom
    for limit, probability in ((found.low, 0.975), (found.high, 0.025)):
        below = float((ndtr(t * s - limit * 2**0.5) * chi).sum() * s[1])
        assert below == pytest.approx(probability, abs=1e-4)


# ---- what cannot be fitted ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "condition", "covariates", "reason"),
    [
        ([], [], {}, "there are no values"),
        ([1.0, 2.0], ["a", "a"], {}, "at least two conditions are needed"),
        ([1.0, 2.0, 3.0], ["a", "a", "b"], {}, "fewer than 2 values under b"),
        ([2.0] * 6, ["a", "b"] * 3, {}, "all 6 values are equal"),
        ([1.0, 2.0] * 3, ["a", "b"] * 3, {}, "do not vary within the conditions"),
        ([1.0, float("nan")] * 3, ["a", "b"] * 3, {}, "not a finite number"),
        ([1.0, 2.0, 4.0, 3.0], ["a", "a", "b", "b"], {"position": [1, 1, 2, 2]}, "cannot be told apart from position"),
        ([1.0, 2.0, 4.0, 3.0], ["a", "b", "a", "b"], {"goal": [1, 2, 3, 3]}, "too few"),
    ],
)
def test_what_cannot_be_fitted_says_why(
    values: list[float], condition: list[str], covariates: dict[str, list[int]], reason: str
) -> None:
    model = anova(values, condition, covariates)
    assert isinstance(model, NotFitted)
    assert reason in model.reason


def test_repeated_measures_say_why_not() -> None:
    one = repeated_measures([1.0, 2.0, 3.0], ["a", "b", "a"], ["x", "x", "y"])
    assert isinstance(one, NotFitted) and "with a value for every condition: 1" in one.reason
    twice = repeated_measures([1.0, 2.0], ["a", "a"], ["x", "x"])
    assert isinstance(twice, NotFitted) and "two values" in twice.reason
    assert isinstance(hedges_g([1.0], [2.0, 3.0]), NotFitted)
    assert isinstance(d_within([1.0, 2.0], [0.0, 1.0]), NotFitted)
    assert brown_forsythe([1.0, 2.0], ["a", "b"]) is None


def test_the_slope_of_a_line_with_known_noise() -> None:
    found = slope([2, 4, 5, 6], [1.0, 3.0, 4.0, 5.0])
    assert not isinstance(found, NotFitted)
    assert found.per_unit.value == pytest.approx(1.0)
    flat_line, one_place = slope([2, 4, 6], [1.0, 1.0, 1.0]), slope([2, 2, 2], [1.0, 2.0, 3.0])
    assert isinstance(flat_line, NotFitted) and "all 3 values are equal" in flat_line.reason
    assert isinstance(one_place, NotFitted) and "at 1 places" in one_place.reason
