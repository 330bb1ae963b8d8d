from dataclasses import dataclass

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis import gp as gp_module
from analysis.gp import GaussianProcess, factorise, fit_gp, likelihood, maximise
from analysis.kernels import SquaredExponential
from analysis.noise import ConstantNoise

SE = SquaredExponential(2)
CASES = [("n12", "se"), ("n12", "se_short"), ("n60", "se"), ("n60", "se_short")]


@dataclass(frozen=True)
class ScaledNoise:
    """Noise with a known multiplier of the variance in every row."""

    multipliers: np.ndarray
    names = ("log_sn",)

    def variance(self, theta, X):
        return np.exp(2 * theta[0]) * self.multipliers

    def evaluate(self, theta, X):
        S = self.variance(theta, X)
        return S, lambda d: np.array([d @ S])


def load(vectors, name):
    chosen = vectors["sets"][name]
    return [np.array(chosen[key]) for key in ("X", "y", "Xt", "g")]


def process(X, y, theta, noise):
    K = SE.matrix(theta[:-1], X, X)
    C = K + np.diag(noise.variance(theta[-1:], X))
    return GaussianProcess(
        kernel=SE, noise=noise, theta=theta, X=X, alpha=np.linalg.solve(C, y),
        offset=0.0, centre=np.zeros(2), scale=np.ones(2), lml=0.0, starts=(),
        jitter=0.0, at_bound=(),
    )  # fmt: skip


@pytest.mark.parametrize(("name", "case"), CASES)
def test_likelihood_and_gradient_have_the_reference_values(vectors, name, case):
    X, y, _, _ = load(vectors, name)
    expected = vectors["sets"][name]["cases"][case]
    lml, slope = likelihood((SE, ConstantNoise()), np.array(expected["th"]), X, y)
    assert lml == pytest.approx(expected["lml"], rel=1e-10)
    np.testing.assert_allclose(slope, expected["grad"], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(("name", "case"), CASES)
def test_prediction_has_the_reference_values(vectors, name, case):
    X, y, Xt, _ = load(vectors, name)
    expected = vectors["sets"][name]["cases"][case]
    model = process(X, y, np.array(expected["th"]), ConstantNoise())
    mean, variance = model.predict(Xt, include_noise=False)
    np.testing.assert_allclose(mean, expected["mean"], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(variance, expected["var"], atol=1e-8 * expected["k00"])


@pytest.mark.parametrize("name", ["n12", "n60"])
def test_another_noise_can_be_put_in_place(vectors, name):
    X, y, _, g = load(vectors, name)
    expected = vectors["sets"][name]["cases"]["se_noise_g"]
    lml, slope = likelihood((SE, ScaledNoise(g)), np.array(expected["th"]), X, y)
    assert lml == pytest.approx(expected["lml"], rel=1e-10)
    np.testing.assert_allclose(slope, expected["grad"], rtol=1e-8, atol=1e-8)


def test_kernel_has_the_reference_values(vectors):
    X, _, _, _ = load(vectors, "n12")
    case = vectors["sets"]["n12"]["cases"]["se"]
    theta = np.array(case["th"])[:-1]
    K = SE.matrix(theta, X, X)
    assert K[0, 1] == pytest.approx(case["k01"], rel=1e-14)
    assert SE.diagonal(theta, X)[0] == pytest.approx(case["k00"], rel=1e-14)


def test_gradient_agrees_with_differences_for_any_weights(vectors):
    X, _, _, _ = load(vectors, "n12")
    theta, h = np.array([0.3, -0.2, 0.4]), 1e-6
    W = np.random.default_rng(0).normal(size=(12, 12))
    W = W + W.T
    slope = SE.evaluate(theta, X)[1](W)
    for k, step in enumerate(h * np.eye(3)):
        change = SE.matrix(theta + step, X, X) - SE.matrix(theta - step, X, X)
        # central difference: error of order h^2, rounding 1e-16/h
        assert slope[k] == pytest.approx(np.sum(W * change) / (4 * h), rel=1e-6)


def test_search_reaches_the_reference_optimum(vectors):
    case = vectors["optimised_n100"]
    found = maximise((SE, ConstantNoise()), np.array(case["X"]), np.array(case["y"]))
    assert found.lml == pytest.approx(case["se"]["polished_lml"], abs=1e-4)
    np.testing.assert_allclose(found.theta, case["se"]["polished_theta"], atol=1e-2)
    assert len(found.starts) == 3
    assert found.lml == max(start.lml for start in found.starts)


def test_likelihood_and_prediction_agree_with_scikit_learn(vectors):
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    X, y, Xt, _ = load(vectors, "n60")
    sf, lengths, sn = 1.3, np.array([0.9, 1.7]), 0.4
    theirs = GaussianProcessRegressor(
        ConstantKernel(sf**2) * RBF(lengths) + WhiteKernel(sn**2),
        alpha=1e-300,
        optimizer=None,
    ).fit(X, y)
    theta = np.log([sf, *lengths, sn])
    lml, slope = likelihood((SE, ConstantNoise()), theta, X, y)
    value, gradient = theirs.log_marginal_likelihood(
        theirs.kernel_.theta, eval_gradient=True
    )
    assert lml == pytest.approx(value, rel=1e-10)
    # theirs is by the logarithms of variances for sf and sn
    np.testing.assert_allclose(slope, gradient * [2, 1, 1, 2], rtol=1e-7)
    mean, sd = theirs.predict(Xt, return_std=True)
    ours, variance = process(X, y, theta, ConstantNoise()).predict(Xt)
    np.testing.assert_allclose(ours, mean, rtol=1e-9)
    np.testing.assert_allclose(np.sqrt(variance), sd, rtol=1e-9)


def draw(rng, n):
    X = rng.uniform(-2, 2, (n, 2))
    K = SE.matrix(np.log([2.0, 0.8, 1.5]), X, X)
    f = np.linalg.cholesky(K + 1e-10 * np.eye(n)) @ rng.normal(size=n)
    return X, f + 0.5 * rng.normal(size=n)


def test_known_noise_is_recovered_and_the_band_holds_its_share():
    X, y = draw(np.random.default_rng(4), 500)
    model = fit_gp(X[:300], y[:300])
    mean, variance = model.predict(X[300:])
    inside = np.mean(np.abs(y[300:] - mean) <= 1.96 * np.sqrt(variance))
    # 200 samples: three binomial standard deviations are 0.046
    assert abs(inside - 0.95) < 0.046
    # its standard error is 0.5/sqrt(2 300)
    assert np.exp(model.theta[-1]) == pytest.approx(0.5, abs=0.07)


def test_predictions_follow_a_change_of_units():
    X, y = draw(np.random.default_rng(6), 60)
    plain, scaled = fit_gp(X, y), fit_gp(X * [1000.0, 0.01] + [5.0, 1.0], y)
    np.testing.assert_allclose(
        scaled.mean(X * [1000.0, 0.01] + [5.0, 1.0]),
        plain.mean(X),
        rtol=1e-3,
        atol=1e-3,
    )


def test_noise_is_in_the_variance_only_if_asked_for():
    X, y = draw(np.random.default_rng(7), 40)
    model = fit_gp(X, y)
    _, of_function = model.predict(X, include_noise=False)
    _, of_measurement = model.predict(X)
    np.testing.assert_allclose(
        of_measurement - of_function, np.exp(2 * model.theta[-1]), rtol=1e-9
    )


def test_blocks_do_not_change_a_prediction(monkeypatch):
    X, y = draw(np.random.default_rng(8), 40)
    model = fit_gp(X, y)
    whole = model.predict(X)
    monkeypatch.setattr(gp_module, "_BLOCK", 7)
    np.testing.assert_allclose(model.predict(X), whole, rtol=1e-9)
    assert model.mean(np.zeros((0, 2))).shape == (0,)


def test_jitter_is_added_only_where_it_is_needed_and_is_recorded():
    K = np.ones((30, 30))
    assert factorise(K, np.full(30, 0.1)).jitter == 0.0
    assert factorise(K, np.full(30, -1e-11)).jitter == pytest.approx(1e-10)


def test_a_hopeless_covariance_is_refused():
    with pytest.raises(SettingsError, match="not positive definite"):
        factorise(-np.eye(5), np.zeros(5))


def test_an_input_that_does_not_vary_is_carried_along():
    X, y = draw(np.random.default_rng(9), 40)
    X[:, 0] = 3.0
    model = fit_gp(X, y)
    assert np.all(np.isfinite(model.predict(X)[1]))


@pytest.mark.parametrize(
    ("y", "reason"), [(np.zeros(50), "50 samples"), (np.arange(19.0), "19 samples")]
)
def test_outputs_that_teach_nothing_are_refused(y, reason):
    with pytest.raises(SettingsError, match=reason):
        fit_gp(np.random.default_rng(0).normal(size=(y.size, 2)), y)
