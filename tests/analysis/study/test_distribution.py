from itertools import pairwise

import numpy as np
import pytest

from analysis.study.distribution import (
    SHARES,
    NewTrialPrediction,
    expected_variance,
    normal_scores,
    residual_quantiles,
)
from analysis.study.metrics import Prediction, score

NORMAL = tuple(normal_scores(SHARES).tolist())
SKEWED = tuple(np.expm1(0.5 * normal_scores(SHARES)).tolist())
KINDS = {"normal": NORMAL, "skewed": SKEWED}


def predicted(residuals=NORMAL, within=0.5, between=0.3, centre=2.0):
    one = np.ones(1)
    return NewTrialPrediction.of(centre * one, within * one, between * one, residuals)


@pytest.mark.parametrize("kind", KINDS)
def test_quantiles_invert_the_distribution_function(kind):
    distribution = predicted(KINDS[kind])
    shares = np.array([1e-9, 1e-3, 0.02, *SHARES, 0.97, 0.9999])
    for share, force in zip(shares, distribution.quantiles(shares)[:, 0], strict=True):
        assert distribution.cdf(np.array([force]))[0] == pytest.approx(share, rel=1e-9)


def test_extreme_quantiles_are_finite():
    lowest, low, highest = predicted().quantiles((0.0, 0.001, 1.0))[:, 0]
    assert np.isfinite([lowest, highest]).all()
    assert lowest < low < highest


@pytest.mark.parametrize("kind", KINDS)
def test_density_is_the_slope_of_the_distribution_function(kind):
    distribution = predicted(KINDS[kind])
    for force in (0.5, 2.1, 4.0):
        h = 1e-5
        step = distribution.cdf(np.array([force + h])) - distribution.cdf(
            np.array([force - h])
        )
        density = np.exp(distribution.log_density(np.array([force])))
        assert density[0] == pytest.approx(step[0] / (2 * h), rel=1e-5)


@pytest.mark.parametrize("between", [0.0, 0.01, 0.3, 5.0])
def test_the_sum_of_normal_residuals_and_levels_is_normal(between):
    from scipy.stats import norm

    distribution = predicted(between=between)
    exact = norm(2.0, np.sqrt(0.5 + between))
    # quadrature with 64 nodes, interpolated over the ratio of variances
    assert distribution.quantiles(SHARES)[:, 0] == pytest.approx(
        exact.ppf(SHARES), abs=0.02
    )
    force = np.array([1.2])
    assert distribution.log_density(force)[0] == pytest.approx(
        exact.logpdf(1.2), abs=0.02
    )
    assert distribution.mean[0] == pytest.approx(2.0, abs=1e-2)
    assert distribution.sd[0] == pytest.approx(exact.std(), rel=2e-2)


def test_a_level_is_added_to_skewed_residuals():
    rng = np.random.default_rng(1)
    within, between, count = 0.5, 0.3, 400_000
    e = np.expm1(0.5 * rng.standard_normal(count))
    drawn = np.sqrt(within) * e + np.sqrt(between) * rng.standard_normal(count)
    distribution = predicted(SKEWED, within, between, centre=0.0)
    expected = np.quantile(drawn, SHARES)
    # residuals are linear in the normal score between their nine quantiles
    assert distribution.quantiles(SHARES)[:, 0] == pytest.approx(expected, abs=0.05)


def test_a_variance_from_few_trials_is_inflated():
    assert expected_variance(2.0, 10) == pytest.approx(2.0 * 9 / 7)
    assert expected_variance(2.0, 2) == expected_variance(2.0, 5) == 4.0
    assert expected_variance(2.0, 10_000) == pytest.approx(2.0, rel=1e-3)


def test_residuals_are_weighted_by_trial():
    rng = np.random.default_rng(2)
    short, long = rng.normal(-5.0, 0.1, 100), rng.normal(5.0, 0.1, 10_000)
    quantiles = residual_quantiles([short, long])
    assert quantiles[SHARES.index(0.25)] == pytest.approx(-5.0, abs=0.1)
    assert quantiles[SHARES.index(0.75)] == pytest.approx(5.0, abs=0.1)
    assert residual_quantiles([long]) == NORMAL


def test_quantiles_of_equal_residuals_increase():
    quantiles = residual_quantiles([np.zeros(5), np.zeros(7)])
    assert (np.diff(quantiles) > 0.0).all()
    assert quantiles == pytest.approx(np.zeros(9), abs=1e-4)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("force", [0.3, 2.1, 5.0])
def test_crps_equals_its_defining_integral(kind, force):
    from scipy.integrate import quad

    distribution = predicted(KINDS[kind])

    def squared(y):
        return (distribution.cdf(np.array([y]))[0] - (y >= force)) ** 2

    low, high = distribution.quantiles((1e-6, 1.0 - 1e-6))[:, 0]
    parts = [min(low, force), force, max(high, force)]
    exact = sum(quad(squared, a, b, limit=200)[0] for a, b in pairwise(parts))
    # the kink of the pinball loss limits a 64-node quadrature to about 1 %
    assert distribution.crps(np.array([force]))[0] == pytest.approx(
        exact, rel=0.01, abs=2e-3
    )


@pytest.mark.parametrize("nu", [np.inf, 4.0])
def test_quantiles_of_a_normal_and_a_t_prediction_invert_its_cdf(nu):
    distribution = Prediction(np.array([1.0, 2.0]), np.array([0.5, 2.0]), nu)
    forces = distribution.quantiles(SHARES)
    for share, row in zip(SHARES, forces, strict=True):
        np.testing.assert_allclose(distribution.cdf(row), share, rtol=1e-9)


def test_a_skewed_prediction_is_scored_by_median_and_mean():
    distribution = predicted(SKEWED, within=1.0, between=0.0, centre=4.0)
    F_t = np.array([1.5])
    scores = score(F_t, distribution)
    assert scores.mae == pytest.approx(abs(1.5 - distribution.point[0]))
    assert scores.rmse == pytest.approx(abs(1.5 - distribution.mean[0]))
    assert scores.rmse != pytest.approx(scores.mae, rel=1e-3)
