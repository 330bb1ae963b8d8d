import numpy as np
import pytest

from analysis.study.metrics import (
    Prediction,
    coverage,
    crps,
    log_density,
    score,
)


def test_errors_of_known_predictions_are_exact():
    found = score(
        np.array([1.0, 2.0, 6.0]),
        Prediction(np.array([0.0, 2.0, 2.0]), np.array([1.0, 2.0, 3.0])),
    )
    assert found.mae == pytest.approx(5 / 3)
    assert found.rmse == pytest.approx(np.sqrt(17 / 3))
    assert found.variance == pytest.approx(14 / 3)


def test_coverage_has_the_reference_values(vectors):
    case = vectors["metrics"]
    for level, inside in enumerate(case["inside_50_90_95"]):
        for k, is_inside in enumerate(inside):
            y, mean, sd = (np.array([case[key][k]]) for key in ("y", "mean", "sd"))
            found = score(y, Prediction(mean, sd))
            shares = (found.coverage50, found.coverage90, found.coverage95)
            assert shares[level] == float(is_inside)


def test_densities_and_ranked_scores_have_the_reference_values(vectors):
    case = vectors["metrics"]
    given = Prediction(np.array(case["mean"]), np.array(case["sd"]))
    y = np.array(case["y"])
    np.testing.assert_allclose(-log_density(y, given), case["nlpd_each"], rtol=1e-12)
    np.testing.assert_allclose(crps(y, given), case["crps_each"], rtol=1e-9)


def test_student_t_agrees_with_scipy_and_with_its_integrated_score():
    from scipy import stats

    y, given = np.array([1.4]), Prediction(np.array([0.2]), np.array([0.7]), 4.0)
    law = stats.t(4.0, 0.2, 0.7 * np.sqrt(0.5))  # variance = scale^2 nu/(nu - 2)
    assert log_density(y, given)[0] == pytest.approx(law.logpdf(1.4), rel=1e-12)
    x = np.linspace(-60.0, 60.0, 120_001)
    integral = np.trapezoid((law.cdf(x) - (x >= 1.4)) ** 2, x)
    # the step falls between two points 1e-3 apart
    assert crps(y, given)[0] == pytest.approx(integral, abs=1e-3)
    assert coverage(np.array([law.ppf(0.94)]), given, 0.9) == 1.0
    assert coverage(np.array([law.ppf(0.96)]), given, 0.9) == 0.0


def test_the_crps_of_a_certain_prediction_is_its_error():
    sure = Prediction(np.array([1.0]), np.array([0.0]))
    assert crps(np.array([3.0]), sure)[0] == pytest.approx(2.0)


def test_a_95_percent_band_covers_95_percent_of_a_normal_sample():
    y = np.random.default_rng(0).normal(size=20_000)
    found = score(y, Prediction(np.zeros(y.size), np.ones(y.size)))
    # three binomial standard deviations of 20,000 samples are 0.0046
    assert found.coverage95 == pytest.approx(0.95, abs=0.0046)
