import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import SquaredExponential
from analysis.gp.likelihood import Likelihood
from analysis.gp.noise import ConstantNoise, LogLinearNoise
from analysis.gp.regression import fit_gp
from analysis.gp.sparse import choose_inducing, fit_sparse
from analysis.gp.sparse_bound import bound

SE = (SquaredExponential(2), ConstantNoise())


@pytest.fixture
def small(vectors):
    chosen = vectors["sets"]["n60"]
    return np.array(chosen["X"]), np.array(chosen["y"])


def test_bound_has_the_reference_value(vectors, small):
    X, y = small
    case = vectors["vfe"]
    value, _ = bound(SE, np.array(case["th"]), (X, X[5:13]), y, jitter=0.0)
    assert value == pytest.approx(case["bound"], rel=1e-10)
    assert value < case["exact_lml"]


@pytest.mark.parametrize(
    ("model", "theta"),
    [
        (SE, [0.6, 0.2, -0.3, -0.9]),
        ((Arcsine(2), LogLinearNoise(2)), [0.6, 0.2, -0.3, 0.1, -0.5, 0.1, -0.2]),
    ],
)
def test_slope_of_the_bound_agrees_with_differences(small, model, theta):
    X, y = small
    theta, h = np.array(theta), 1e-5
    _, slope = bound(model, theta, (X, X[5:13]), y)
    for k, step in enumerate(h * np.eye(theta.size)):
        ahead = bound(model, theta + step, (X, X[5:13]), y)[0]
        behind = bound(model, theta - step, (X, X[5:13]), y)[0]
        # error of order h^2 and rounding 1e-13/h
        assert slope[k] == pytest.approx((ahead - behind) / (2 * h), rel=1e-5)


def test_all_points_inducing_give_the_exact_likelihood_from_below(small):
    X, y = small[0][:20], small[1][:20]
    theta = np.array([0.1, -1.2, -1.0, -1.5])
    exact, _ = Likelihood(SE, X, y)(theta)
    assert bound(SE, theta, (X, X), y)[0] == pytest.approx(exact, abs=1e-4)
    for count in (1, 5, 15):
        assert bound(SE, theta, (X, X[:count]), y)[0] <= exact


def test_inducing_points_are_spread_and_stop_where_nothing_is_left():
    X = np.array([[0.0, 0.0], [0.001, 0.0], [3.0, 0.0], [0.0, 3.0], [0.0, 0.0]])
    assert set(choose_inducing(X, 3).tolist()) == {0, 2, 3}
    assert choose_inducing(X, 5).size == 4


def test_enough_inducing_points_predict_like_the_exact_process():
    rng = np.random.default_rng(2)
    X = rng.normal(size=(150, 2))
    y = np.sin(2 * X[:, 0]) + rng.normal(0, 0.3, 150)
    exact, sparse = fit_gp(X, y), fit_sparse(X, y, inducing=60)
    mean, variance = exact.predict(X)
    found, spread = sparse.predict(X)
    assert exact.lml - 0.1 < sparse.lml < exact.lml + 1e-3
    np.testing.assert_allclose(found, mean, atol=0.01)
    np.testing.assert_allclose(spread, variance, rtol=0.02)
    np.testing.assert_allclose(sparse.mean(X), found, rtol=1e-9)
    _, of_function = sparse.predict(X, include_noise=False)
    np.testing.assert_allclose(spread - of_function, np.exp(2 * sparse.theta[-1]))


def test_outputs_that_teach_nothing_are_refused():
    with pytest.raises(SettingsError, match="19 samples"):
        fit_sparse(np.zeros((19, 2)), np.arange(19.0))
