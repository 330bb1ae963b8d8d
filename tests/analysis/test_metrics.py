import numpy as np
import pytest

from analysis.metrics import Prediction, score


def test_errors_of_known_predictions():
    found = score(
        np.array([1.0, 2.0, 6.0]),
        Prediction(np.array([0.0, 2.0, 2.0]), np.array([1.0, 2.0, 3.0])),
    )
    assert found.mae == pytest.approx(5 / 3)
    assert found.rmse == pytest.approx(np.sqrt(17 / 3))
    assert found.variance == pytest.approx(14 / 3)


def test_coverage_has_the_reference_values(vectors):
    case = vectors["metrics"]
    inside = case["inside_50_90_95"][2]
    for k, is_inside in enumerate(inside):
        y, mean, sd = (np.array([case[key][k]]) for key in ("y", "mean", "sd"))
        assert score(y, Prediction(mean, sd)).coverage95 == float(is_inside)


def test_coverage_of_a_normal_sample():
    y = np.random.default_rng(0).normal(size=20_000)
    found = score(y, Prediction(np.zeros(y.size), np.ones(y.size)))
    # three binomial standard deviations of 20,000 samples are 0.0046
    assert found.coverage95 == pytest.approx(0.95, abs=0.0046)
