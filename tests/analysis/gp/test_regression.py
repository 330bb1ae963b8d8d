from dataclasses import dataclass

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.gp import regression as gp_module
from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import SquaredExponential
from analysis.gp.likelihood import Likelihood, factorise
from analysis.gp.noise import ConstantNoise
from analysis.gp.regression import GaussianProcess, fit_gp
from analysis.gp.search import posterior_search

SE = SquaredExponential(2)
KERNELS = {
    "se": SE,
    "se_short": SE,
    "nn_c1": Arcsine(2),
    "nn_c1_steep": Arcsine(2),
    "nn_c0": Arcsine(2, as_printed=True),  # n60 repeats inputs
}
CASES = [(name, case) for name in ("n12", "n60") for case in KERNELS]


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

    def log_prior(self, theta):
        return 0.0, np.zeros(1)


def load(vectors, name):
    chosen = vectors["sets"][name]
    return [np.array(chosen[key]) for key in ("X", "y", "Xt", "g")]


def process(X, y, theta, noise, kernel=SE):
    K = kernel.matrix(theta[:-1], X, X)
    C = K + np.diag(noise.variance(theta[-1:], X))
    return GaussianProcess(
        kernel=kernel, noise=noise, theta=theta, X=X, alpha=np.linalg.solve(C, y),
        offset=0.0, centre=np.zeros(2), scale=np.ones(2), lml=0.0, starts=(),
        jitter=0.0, at_bound=(),
    )  # fmt: skip


@pytest.mark.parametrize(("name", "case"), CASES)
def test_likelihood_and_gradient_have_the_reference_values(vectors, name, case):
    X, y, _, _ = load(vectors, name)
    expected = vectors["sets"][name]["cases"][case]
    likelihood = Likelihood(KERNELS[case], ConstantNoise(), X, y)
    lml, slope = likelihood(np.array(expected["th"]))
    assert lml == pytest.approx(expected["lml"], rel=1e-10)
    np.testing.assert_allclose(slope, expected["grad"], rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(("name", "case"), CASES)
def test_prediction_has_the_reference_values(vectors, name, case):
    X, y, Xt, _ = load(vectors, name)
    expected = vectors["sets"][name]["cases"][case]
    kernel, theta = KERNELS[case], np.array(expected["th"])
    model = process(X, y, theta, ConstantNoise(), kernel)
    mean, variance = model.predict(Xt, include_noise=False)
    np.testing.assert_allclose(mean, expected["mean"], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(variance, expected["var"], atol=1e-10 * expected["k00"])


@pytest.mark.parametrize("name", ["n12", "n60"])
def test_the_noise_model_is_replaceable(vectors, name):
    X, y, _, g = load(vectors, name)
    expected = vectors["sets"][name]["cases"]["se_noise_g"]
    lml, slope = Likelihood(SE, ScaledNoise(g), X, y)(np.array(expected["th"]))
    assert lml == pytest.approx(expected["lml"], rel=1e-10)
    np.testing.assert_allclose(slope, expected["grad"], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("name", list(KERNELS))
def test_kernels_have_the_reference_values(vectors, name):
    X, _, _, _ = load(vectors, "n12")
    case = vectors["sets"]["n12"]["cases"][name]
    theta = np.array(case["th"])[:-1]
    K = KERNELS[name].matrix(theta, X, X)
    assert K[0, 1] == pytest.approx(case["k01"], rel=1e-14)
    assert KERNELS[name].diagonal(theta, X)[0] == pytest.approx(case["k00"], rel=1e-14)


def test_gradient_agrees_with_finite_differences_for_any_weights(vectors):
    X, _, _, _ = load(vectors, "n12")
    theta, h = np.array([0.3, -0.2, 0.4]), 1e-6
    W = np.random.default_rng(0).normal(size=(12, 12))
    W = W + W.T
    slope = SE.over(X, X)(theta)[1](W.copy())
    for k, step in enumerate(h * np.eye(3)):
        change = SE.matrix(theta + step, X, X) - SE.matrix(theta - step, X, X)
        # central difference: error of order h^2, rounding 1e-16/h
        assert slope[k] == pytest.approx(np.sum(W * change) / (2 * h), rel=1e-6)


@pytest.mark.parametrize(("kernel", "case"), [(SE, "se"), (Arcsine(2), "nn_c1")])
def test_search_reaches_the_reference_optimum(vectors, kernel, case):
    data = vectors["optimised_n100"]
    X, y = np.array(data["X"]), np.array(data["y"])
    optimum = posterior_search(kernel, ConstantNoise(), X, y)
    best = data[case].get("polished_lml", data[case].get("lml"))
    assert optimum.lml == pytest.approx(best, abs=1e-4)
    theta = data[case].get("polished_theta", data[case].get("theta"))
    np.testing.assert_allclose(optimum.theta, theta, atol=1e-2)
    assert len(optimum.starts) == len(optimum.start_points) > 1
    assert optimum.lml == max(start.lml for start in optimum.starts)


def test_likelihood_and_prediction_agree_with_scikit_learn(vectors):
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    X, y, Xt, _ = load(vectors, "n60")
    sf, lengths, sn = 1.3, np.array([0.9, 1.7]), 0.4
    reference = GaussianProcessRegressor(
        ConstantKernel(sf**2) * RBF(lengths) + WhiteKernel(sn**2),
        alpha=1e-300,
        optimizer=None,
    ).fit(X, y)
    theta = np.log([sf, *lengths, sn])
    lml, slope = Likelihood(SE, ConstantNoise(), X, y)(theta)
    value, gradient = reference.log_marginal_likelihood(
        reference.kernel_.theta, eval_gradient=True
    )
    assert lml == pytest.approx(value, rel=1e-10)
    # scikit-learn's parameters are log sf^2 and log sn^2
    np.testing.assert_allclose(slope, gradient * [2, 1, 1, 2], rtol=1e-7)
    mean, sd = reference.predict(Xt, return_std=True)
    own_mean, variance = process(X, y, theta, ConstantNoise()).predict(Xt)
    np.testing.assert_allclose(own_mean, mean, rtol=1e-9)
    np.testing.assert_allclose(np.sqrt(variance), sd, rtol=1e-9)


@pytest.mark.parametrize("kernel", [SE, Arcsine(2)])
def test_gradient_of_many_rows_agrees_with_finite_differences(kernel):
    X, y = draw(np.random.default_rng(2), 190)  # inverted block by block
    likelihood = Likelihood(kernel, ConstantNoise(), X, y)
    theta = np.random.default_rng(5).normal(0, 0.3, len(kernel.names) + 1)
    _, slope = likelihood(theta)
    for k, step in enumerate(1e-5 * np.eye(theta.size)):
        change = likelihood(theta + step)[0] - likelihood(theta - step)[0]
        # error of order h^2 and rounding 1e-12/h
        assert slope[k] == pytest.approx(change / 2e-5, rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("kernel", [SE, Arcsine(2), SE + Arcsine(2), SE * SE])
def test_an_evaluation_does_not_depend_on_earlier_ones(kernel):
    X, y = draw(np.random.default_rng(2), 100)
    rng = np.random.default_rng(6)
    theta, other = rng.normal(0, 0.3, (2, len(kernel.names) + 1))
    reused = Likelihood(kernel, ConstantNoise(), X, y)
    reused(other)
    lml, slope = reused(theta)
    reused(other)
    expected, fresh = Likelihood(kernel, ConstantNoise(), X, y)(theta)
    assert lml == expected
    np.testing.assert_array_equal(slope, fresh)


@pytest.mark.parametrize("kernel", [SE, Arcsine(2)])
def test_the_value_without_a_gradient_equals_that_with_one(kernel):
    X, y = draw(np.random.default_rng(2), 100)
    likelihood = Likelihood(kernel, ConstantNoise(), X, y)
    theta = np.random.default_rng(5).normal(0, 0.3, len(kernel.names) + 1)
    assert likelihood.value(theta) == likelihood(theta)[0]


def draw(rng, n):
    X = rng.uniform(-2, 2, (n, 2))
    K = SE.matrix(np.log([2.0, 0.8, 1.5]), X, X)
    f = np.linalg.cholesky(K + 1e-10 * np.eye(n)) @ rng.normal(size=n)
    return X, f + 0.5 * rng.normal(size=n)


def test_known_noise_is_recovered_with_nominal_coverage():
    X, y = draw(np.random.default_rng(4), 500)
    model = fit_gp(X[:300], y[:300])
    mean, variance = model.predict(X[300:])
    inside = np.mean(np.abs(y[300:] - mean) <= 1.96 * np.sqrt(variance))
    # 200 samples: three binomial standard deviations are 0.046
    assert abs(inside - 0.95) < 0.046
    # standard error: 0.5/sqrt(2 * 300)
    assert np.exp(model.theta[-1]) == pytest.approx(0.5, abs=0.07)


@pytest.mark.parametrize(
    "repeats",
    [20, pytest.param(200, marks=[pytest.mark.long, pytest.mark.timeout(600)])],
)
def test_bands_of_a_known_process_have_nominal_coverage(repeats):
    rng, inside = np.random.default_rng(11), []
    for _ in range(repeats):
        X, y = draw(rng, 110)
        model = process(X[:100], y[:100], np.log([2.0, 0.8, 1.5, 0.5]), ConstantNoise())
        mean, variance = model.predict(X[100:101])
        inside += list(np.abs(y[100:101] - mean) / np.sqrt(variance))
    for share, width in ((0.5, 0.67449), (0.9, 1.64485), (0.95, 1.95996)):
        coverage = np.mean(np.array(inside) <= width)
        # one independent sample per draw: three binomial standard deviations
        assert abs(coverage - share) <= 3 * np.sqrt(share * (1 - share) / repeats)


def test_likelihood_does_not_depend_on_the_order_of_rows():
    X, y = draw(np.random.default_rng(3), 50)
    theta = np.log([2.0, 0.8, 1.5, 0.5])
    order = np.random.default_rng(1).permutation(50)
    ordered = Likelihood(SE, ConstantNoise(), X, y)(theta)[0]
    mixed = Likelihood(SE, ConstantNoise(), X[order], y[order])(theta)[0]
    assert mixed == pytest.approx(ordered, rel=1e-12)


def test_predictions_follow_a_change_of_units():
    X, y = draw(np.random.default_rng(6), 60)
    plain, scaled = fit_gp(X, y), fit_gp(X * [1000.0, 0.01] + [5.0, 1.0], y)
    np.testing.assert_allclose(
        scaled.mean(X * [1000.0, 0.01] + [5.0, 1.0]),
        plain.mean(X),
        rtol=1e-3,
        atol=1e-3,
    )


def test_noise_is_in_the_variance_only_if_requested():
    X, y = draw(np.random.default_rng(7), 40)
    model = fit_gp(X, y)
    _, of_function = model.predict(X, include_noise=False)
    _, of_measurement = model.predict(X)
    np.testing.assert_allclose(
        of_measurement - of_function, np.exp(2 * model.theta[-1]), rtol=1e-9
    )


def test_mean_and_prediction_agree_to_the_last_digit():
    X, y = draw(np.random.default_rng(8), 40)
    model = fit_gp(X, y, Arcsine(2))
    inputs = np.random.default_rng(9).uniform(-2, 2, (700, 2))  # more than a block
    np.testing.assert_array_equal(model.mean(inputs), model.predict(inputs)[0])


def test_blocks_do_not_change_a_prediction(monkeypatch):
    X, y = draw(np.random.default_rng(8), 40)
    model = fit_gp(X, y)
    whole = model.predict(X)
    monkeypatch.setattr(gp_module, "_BLOCK", 7)
    np.testing.assert_allclose(model.predict(X), whole, rtol=1e-9)
    assert model.mean(np.zeros((0, 2))).shape == (0,)


def test_jitter_is_added_only_if_needed_and_is_recorded():
    K = np.ones((30, 30))
    assert factorise(K, np.full(30, 0.1)).jitter == 0.0
    assert factorise(K, np.full(30, -1e-11)).jitter == pytest.approx(1e-10)


def test_an_ill_conditioned_covariance_is_refused():
    with pytest.raises(SettingsError, match="not positive definite"):
        factorise(-np.eye(5), np.zeros(5))


def test_a_constant_input_gives_finite_variances():
    X, y = draw(np.random.default_rng(9), 40)
    X[:, 0] = 3.0
    model = fit_gp(X, y)
    assert np.all(np.isfinite(model.predict(X)[1]))


@pytest.mark.parametrize(
    ("y", "reason"), [(np.zeros(50), "50 samples"), (np.arange(19.0), "19 samples")]
)
def test_uninformative_outputs_are_refused(y, reason):
    with pytest.raises(SettingsError, match=reason):
        fit_gp(np.random.default_rng(0).normal(size=(y.size, 2)), y)


def test_only_conditioning_on_new_rows_changes_the_prediction(vectors):
    X, y, Xt, _ = load(vectors, "n60")
    fitted = fit_gp(X[:40], y[:40])
    same, more = fitted.given(X[:40], y[:40]), fitted.given(X, y)
    assert same.mean(Xt) == pytest.approx(fitted.mean(Xt))
    assert same.lml == pytest.approx(fitted.lml)
    assert more.predict(Xt)[1].sum() < fitted.predict(Xt)[1].sum()
    own = np.abs(fitted.mean(X[40:]) - y[40:]).mean()
    assert np.abs(more.mean(X[40:]) - y[40:]).mean() < own
