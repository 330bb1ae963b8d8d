import json
from dataclasses import asdict

import numpy as np
import pytest

from acquisition.validation import first_problem
from analysis.terrains.logistic import RidgeLogistic, fit_logistic


def rows(count=600, seed=0):
    random = np.random.default_rng(seed)
    X = random.normal(size=(count, 3)) * (1.0, 5.0, 0.1) + (0.0, 20.0, 1.0)
    logit = X[:, 0] - 0.3 * (X[:, 1] - 20.0) + 0.8 * X[:, 0] ** 2 - 0.5
    return X, random.random(count) < 1.0 / (1.0 + np.exp(-logit))


def fitted():
    X, truth = rows()
    return fit_logistic(X, truth, np.ones(truth.size))


def test_the_fit_agrees_with_an_independent_library():
    from sklearn.linear_model import LogisticRegression

    X, truth = rows()
    z = (X - X.mean(axis=0)) / X.std(axis=0)
    assert np.abs(z).max() < 5.0  # nothing is cut
    design = np.column_stack([z, z * z])
    other = LogisticRegression(C=1.0, tol=1e-10, max_iter=2000).fit(design, truth)
    own = np.array(fitted().weights)
    assert own[1:] == pytest.approx(other.coef_[0], abs=1e-4)
    assert own[0] == pytest.approx(other.intercept_[0], abs=1e-4)


def test_a_weight_of_two_equals_a_repeated_row():
    X, truth = rows(200)
    weighted = fit_logistic(X, truth, np.full(200, 2.0))
    doubled = fit_logistic(np.tile(X, (2, 1)), np.tile(truth, 2), np.ones(400))
    assert weighted.weights == pytest.approx(doubled.weights, abs=1e-6)


def test_a_single_class_gives_an_uninformative_fit():
    X, _ = rows(50)
    with pytest.raises(ValueError, match="one answer"):
        fit_logistic(X, np.zeros(50, bool), np.ones(50))


def test_a_model_round_trips_through_text_bit_for_bit():
    model = fitted()
    text = json.dumps(asdict(model))
    assert RidgeLogistic.from_dict(json.loads(text), 3) == model


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"weights": [0.0]}, "weights of a regression is not 7 numbers"),
        ({"mean": [0.0, 0.0, float("nan")]}, "mean.2: Input should be a finite number"),
        ({"mean": [0.0, 0.0, 1e10]}, "mean.2: Input should be less than"),
        ({"scale": [1.0, 0.0, 1.0]}, "scale.1: Input should be greater than"),
    ],
)
def test_an_invalid_model_is_refused(change, words):
    with pytest.raises(ValueError, match=r".+") as caught:
        RidgeLogistic.from_dict(asdict(fitted()) | change, 3)
    assert first_problem(caught.value).startswith(words)
