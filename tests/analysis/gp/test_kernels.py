import numpy as np
import pytest

from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import Product, SquaredExponential, Sum
from analysis.gp.noise import ConstantNoise, LogLinearNoise
from analysis.gp.regression import fit_gp

SE, NN = SquaredExponential(2), Arcsine(2)
KERNELS = {
    "se": SE,
    "nn": NN,
    "printed": Arcsine(2, as_printed=True),
    "sum": SE + NN,
    "product": SE * NN,
    "nested": (SE + NN) * SquaredExponential(2),
}


@pytest.fixture
def rows():
    rng = np.random.default_rng(0)
    return rng.normal(size=(9, 2)), rng.normal(size=(5, 2))


def random_theta(kernel):
    return np.random.default_rng(1).normal(0, 0.4, len(kernel.names))


def central_differences(function, theta, h=1e-6):
    return [
        (function(theta + step) - function(theta - step)) / (2 * h)
        for step in h * np.eye(theta.size)
    ]


@pytest.mark.parametrize("name", list(KERNELS))
def test_contracted_gradient_agrees_with_finite_differences(rows, name):
    kernel, (X, X_other) = KERNELS[name], rows
    theta = random_theta(kernel)
    W = np.random.default_rng(2).normal(size=(9, 5))
    K, contract = kernel.over(X, X_other)(theta)
    np.testing.assert_allclose(K, kernel.matrix(theta, X, X_other), rtol=1e-14)
    expected = central_differences(
        lambda t: np.vdot(W, kernel.matrix(t, X, X_other)), theta
    )
    # central difference: rounding 1e-16/h
    np.testing.assert_allclose(contract(W.copy()), expected, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("name", list(KERNELS))
@pytest.mark.parametrize("count", [1, 9, 40, 95])  # rows; a strip has 40
def test_the_symmetric_evaluation_equals_the_full_one_above_the_diagonal(name, count):
    kernel, rng = KERNELS[name], np.random.default_rng(4)
    X, W = rng.normal(size=(count, 2)), np.triu(rng.normal(size=(count, count)))
    evaluate, whole = kernel.over(X), kernel.over(X, X)
    for seed in range(3):  # stale values below the diagonal must not matter
        theta = np.random.default_rng(seed).normal(0, 2.0, len(kernel.names))
        (K, contract), (expected, contract_whole) = evaluate(theta), whole(theta)
        np.testing.assert_array_equal(np.triu(K), np.triu(expected))
        slope = contract_whole(W.copy())
        np.testing.assert_allclose(contract(W.copy()), slope, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", list(KERNELS))
def test_variances_equal_the_diagonal_of_the_covariance(rows, name):
    kernel, (X, _) = KERNELS[name], rows
    theta = random_theta(kernel)
    K = kernel.matrix(theta, X, X)
    np.testing.assert_allclose(kernel.diagonal(theta, X), np.diagonal(K), rtol=1e-12)


def test_kernels_compose_by_sum_and_product(rows):
    X, X_other = rows
    a, b = random_theta(SE), random_theta(NN)
    theta = np.concatenate([a, b])
    left, right = SE.matrix(a, X, X_other), NN.matrix(b, X, X_other)
    assert Sum(SE, NN) == (SE + NN)
    assert Product(SE, NN) == (SE * NN)
    np.testing.assert_allclose((SE + NN).matrix(theta, X, X_other), left + right)
    np.testing.assert_allclose((SE * NN).matrix(theta, X, X_other), left * right)
    assert (SE + NN).names[0] == "a.log_sf"


def test_a_sum_of_kernels_fits_at_least_as_well_as_one_of_them():
    rng = np.random.default_rng(3)
    X = rng.normal(size=(40, 2))
    y = np.sin(3 * X[:, 0]) + 0.5 * X[:, 1] + rng.normal(0, 0.1, 40)
    both, one = fit_gp(X, y, SE + NN), fit_gp(X, y, SE)
    # the sum contains each part: the other's variance is at its lower bound e^-12
    assert both.lml > one.lml - 0.1


def test_the_kernel_as_printed_has_constant_variance():
    kernel, X = Arcsine(2, as_printed=True), np.array([[0.0, 0.0], [9.0, -4.0]])
    theta = np.array([0.3, 0.1, -0.2, 0.5])
    expected = np.exp(0.6) * np.pi / 2
    np.testing.assert_allclose(kernel.diagonal(theta, X), expected)
    variance = NN.diagonal(theta, X)
    assert variance[1] > 1.1 * variance[0]


@pytest.mark.parametrize("noise", [ConstantNoise(), LogLinearNoise(2)])
def test_noise_gradients_agree_with_finite_differences(rows, noise):
    X, _ = rows
    theta = np.random.default_rng(4).normal(0, 0.3, len(noise.names))
    d = np.arange(9.0)
    S, contract = noise.evaluate(theta, 2 * X)
    np.testing.assert_allclose(S, noise.variance(theta, 2 * X))
    expected = central_differences(lambda t: 0.5 * d @ noise.variance(t, 2 * X), theta)
    np.testing.assert_allclose(contract(d), expected, rtol=1e-6)
    slope = central_differences(lambda t: noise.log_prior(t)[0], theta)
    np.testing.assert_allclose(noise.log_prior(theta)[1], slope, atol=1e-8)


def test_the_fit_recovers_noise_that_grows_with_an_input():
    rng = np.random.default_rng(5)
    X = rng.uniform(-1.7, 1.7, (200, 2))  # unit variance
    y = np.sin(X[:, 1]) + np.exp(-1.0 + 0.6 * X[:, 0]) * rng.normal(size=200)
    model = fit_gp(X, y, noise=LogLinearNoise(2))
    slopes = model.theta[-2:]
    # standard error of the slope of log sd: 1/sqrt(2 * 200) = 0.05; weak prior
    assert slopes[0] == pytest.approx(0.6, abs=0.16)
    assert slopes[1] == pytest.approx(0.0, abs=0.16)
    constant = fit_gp(X, y)
    assert model.lml > constant.lml + 10
