"""Our least squares and partial likelihood beside those of statsmodels, on data of many kinds."""

from __future__ import annotations

import numpy as np
import pytest
from statsmodels.duration.hazard_regression import PHReg
from statsmodels.regression.linear_model import OLS

from study.analysis.design_matrix import design_matrix, rank_of
from study.analysis.least_squares import least_squares
from study.analysis.partial_likelihood import NoMaximum, greatest

SEEDS = range(8)


@pytest.mark.filterwarnings("ignore:The design matrix is rank-deficient")  # which it is on purpose
@pytest.mark.parametrize("seed", SEEDS)
def test_least_squares_is_that_of_statsmodels(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(20, 60))
    condition = [f"c{index}" for index in rng.integers(0, 3, count)]
    levels = tuple(sorted(set(condition)))
    places = [int(index) for index in rng.integers(0, 4, count)]
    twice = {"place": places, "again": places} if seed % 2 else {"place": places}  # columns that others make up
    design = design_matrix(condition, levels, twice)
    y = rng.normal(50.0, 10.0 ** rng.integers(-2, 3), count)
    ours, theirs = least_squares(y, design, rank_of(design)), OLS(y, design).fit()
    assert ours.coefficients == pytest.approx(theirs.params, rel=1e-9)
    assert ours.covariance == pytest.approx(theirs.cov_params(), rel=1e-9, abs=1e-12)
    assert ours.mean_square_error == pytest.approx(theirs.mse_resid)
    assert ours.df_residual == theirs.df_resid
    own = list(range(1, len(levels)))
    test = theirs.f_test(np.eye(design.shape[1])[own])
    assert ours.f_test(own) == pytest.approx(float(np.squeeze(test.fvalue)), rel=1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_partial_likelihood_is_that_of_statsmodels(seed: int) -> None:
    rng = np.random.default_rng(seed)
    people, each = int(rng.integers(3, 9)), 12
    strata = np.repeat([f"P{number:03d}" for number in range(people)], each)
    design = np.array([[float(index == 1), float(index == 2)] for index in rng.integers(0, 3, people * each)])
    times = np.ceil(rng.exponential(10.0 * np.exp(-design @ [0.5, -0.4])))  # whole numbers, many of them tied
    ended = times < 20.0
    effects, covariance = greatest(np.minimum(times, 20.0), design, ended, strata)
    theirs = PHReg(np.minimum(times, 20.0), design, status=ended.astype(int), strata=strata, ties="efron").fit(disp=0)
    assert effects == pytest.approx(theirs.params, abs=1e-5)
    assert covariance == pytest.approx(theirs.cov_params(), rel=1e-4)


def test_a_likelihood_that_grows_without_end_has_no_maximum() -> None:
    strata = np.repeat(["P001", "P002"], 4)
    design = np.tile([[0.0], [0.0], [1.0], [1.0]], (2, 1))
    times = np.tile([1.0, 2.0, 3.0, 4.0], 2)
    with pytest.raises(NoMaximum):
        greatest(times, design, np.full(8, True), strata)
    with pytest.raises(NoMaximum):
        greatest(times, np.zeros((8, 1)), np.full(8, True), strata)
