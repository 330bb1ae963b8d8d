from itertools import pairwise

import numpy as np
import pytest

from analysis.study.distribution import SHARES, NewTrialPrediction
from analysis.study.metrics import Prediction, score
from analysis.study.skew import ShapeMap, log_warp_slope, unwarped, warped

SHAPE = ShapeMap(0.2, 0.1, -0.4, -0.2)
KINDS = {
    "plain": (None, None),
    "warped": (3.0, None),
    "shaped": (None, SHAPE),
    "both": (3.0, SHAPE),
}


def predicted(c=None, shape=None, within=0.5, between=0.3, freedom=8, centre=2.0):
    one = np.ones(1)
    return NewTrialPrediction(
        centre * one, within * one, between * one, freedom, c, shape
    )


@pytest.mark.parametrize("kind", KINDS)
def test_quantiles_invert_the_distribution_function(kind):
    law = predicted(*KINDS[kind])
    for share, force in zip(SHARES, law.quantiles(SHARES)[:, 0], strict=True):
        # quantiles are interpolated between 129 ratios of the two variances
        assert law.cdf(np.array([force]))[0] == pytest.approx(share, abs=2e-5)


@pytest.mark.parametrize("freedom", [4, 9, 1000])
@pytest.mark.parametrize("between", [0.0, 0.5, 0.5e6])
def test_quantiles_of_rare_forces_invert_it_too(freedom, between):
    law = predicted(within=0.5, between=between, freedom=freedom, centre=0.0)
    shares = np.array([1e-12, 1e-6, 0.3, 0.5])
    low, high = (law.quantiles(x)[:, 0] for x in (shares, 1.0 - shares))
    assert low == pytest.approx(-high, rel=1e-4, abs=1e-12)
    reached = [law.cdf(np.array([force]))[0] for force in low]
    # the ratio of variances is one of the 129, or as near to one as it can be
    assert reached == pytest.approx(shares, rel=1e-4)
    never, always = law.quantiles((0.0, 1.0))[:, 0]
    assert np.isfinite([never, always]).all()
    assert never < low[0]
    assert always > high[0]


@pytest.mark.parametrize("kind", KINDS)
def test_density_is_the_slope_of_the_distribution_function(kind):
    law = predicted(*KINDS[kind])
    for force in (0.5, 2.0, 4.0):
        h = 1e-5
        step = law.cdf(np.array([force + h])) - law.cdf(np.array([force - h]))
        density = np.exp(law.log_density(np.array([force])))
        assert density[0] == pytest.approx(step[0] / (2 * h), rel=1e-5)


def test_a_spread_known_from_few_trials_gives_student_t():
    from scipy.stats import t

    law = predicted(within=0.0, between=4.0, centre=0.0)
    for force in (-3.0, 0.5, 2.0, 5.0):
        # 40 quantiles stand for the chi^2 distribution
        exact = t(8, scale=2.0).cdf(force)
        assert law.cdf(np.array([force]))[0] == pytest.approx(exact, abs=2e-3)


def test_without_a_spread_between_trials_it_is_normal():
    from scipy.stats import norm

    law, force = predicted(between=0.0), np.array([1.2])
    exact = norm(2.0, np.sqrt(0.5))
    assert law.cdf(force)[0] == pytest.approx(exact.cdf(1.2), rel=1e-12)
    assert law.log_density(force)[0] == pytest.approx(exact.logpdf(1.2), rel=1e-12)
    assert law.mean[0] == pytest.approx(2.0, abs=1e-6)
    assert law.sd[0] == pytest.approx(np.sqrt(0.5), rel=5e-3)


def test_a_warped_normal_has_the_moments_of_a_shifted_lognormal():
    c, m, s = 3.0, 4.0, 0.6
    law = predicted(c, within=s**2, between=0.0, centre=m)
    assert law.mean[0] == pytest.approx(
        np.exp(m / c + 0.5 * (s / c) ** 2) - c, rel=1e-4
    )
    assert law.point[0] == pytest.approx(np.exp(m / c) - c, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("force", [0.3, 2.1, 5.0])
def test_ranked_probability_is_its_integral(kind, force):
    from scipy.integrate import quad

    law = predicted(*KINDS[kind])

    def squared(y):
        return (law.cdf(np.array([y]))[0] - (y >= force)) ** 2

    low, high = law.quantiles((1e-6, 1.0 - 1e-6))[:, 0]
    parts = [min(low, force), force, max(high, force)]
    exact = sum(quad(squared, a, b, limit=200)[0] for a, b in pairwise(parts))
    # the kink of the pinball loss costs a quadrature of 64 nodes up to a percent
    assert law.ranked_probability(np.array([force]))[0] == pytest.approx(
        exact, rel=0.01, abs=2e-3
    )


def test_a_shape_and_its_inverse_agree():
    x = np.linspace(-4.0, 4.0, 9)
    np.testing.assert_allclose(SHAPE.inverse(SHAPE.score(x)), x, atol=1e-12)
    np.testing.assert_allclose(ShapeMap().score(x), x, atol=1e-12)
    np.testing.assert_allclose(ShapeMap().log_gain(x), 0.0, atol=1e-12)


def test_the_warp_and_its_inverse_agree_and_a_deep_force_is_clipped():
    y = np.array([-2.0, 0.0, 3.0, 30.0])
    np.testing.assert_allclose(unwarped(warped(y, 3.0), 3.0), y, atol=1e-12)
    assert unwarped(warped(np.array([-50.0]), 3.0), 3.0)[0] == pytest.approx(-2.85)
    h = 1e-6
    slope = (warped(y + h, 3.0) - warped(y - h, 3.0)) / (2 * h)
    np.testing.assert_allclose(np.exp(log_warp_slope(y, 3.0)), slope, rtol=1e-6)


@pytest.mark.parametrize("nu", [np.inf, 4.0])
def test_a_normal_prediction_has_quantiles_and_a_distribution_function(nu):
    law = Prediction(np.array([1.0, 2.0]), np.array([0.5, 2.0]), nu)
    forces = law.quantiles(SHARES)
    for share, row in zip(SHARES, forces, strict=True):
        np.testing.assert_allclose(law.cdf(row), share, rtol=1e-9)


def test_a_skewed_prediction_is_scored_by_median_and_mean():
    law = predicted(3.0, within=1.0, between=0.0, centre=4.0)
    F_t = np.array([1.5])
    found = score(F_t, law)
    assert found.mae == pytest.approx(abs(1.5 - law.point[0]))
    assert found.rmse == pytest.approx(abs(1.5 - law.mean[0]))
    assert found.rmse != pytest.approx(found.mae, rel=1e-3)
    assert found.coverage95 == 1.0


def test_the_slopes_of_a_shape_agree_with_differences():
    x, step = np.linspace(-3.0, 3.0, 9), 1e-6
    slopes = SHAPE.gain_and_slopes(x)[1]
    for k in range(4):
        aside = step * np.eye(4)[k]
        high, low = (
            ShapeMap(*(np.array(SHAPE) + d)).log_gain(x) for d in (aside, -aside)
        )
        np.testing.assert_allclose(slopes[k], (high - low) / (2.0 * step), atol=1e-7)
