"""The trial effect agrees with finite differences, a closed form and scikit-learn."""

import numpy as np
import pytest

from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import SquaredExponential
from analysis.gp.likelihood import Likelihood
from analysis.gp.noise import ConstantNoise, LogLinearNoise
from analysis.gp.refit import refit_gp
from analysis.gp.regression import GaussianProcess, fit_gp
from analysis.gp.trial_noise import TrialNoise, TrialRows

SE = SquaredExponential(2)
LEVEL = TrialNoise()
CHANGING = TrialNoise(LogLinearNoise(2))


def drawn(trials, rows, seed=0):
    """Return random inputs, outputs and trial indices, `rows` rows per trial."""
    rng = np.random.default_rng(seed)
    X, y = rng.normal(size=(trials * rows, 2)), rng.normal(size=trials * rows)
    return X, y, TrialRows(np.repeat(np.arange(trials), rows))


@pytest.mark.parametrize("kernel", [SE, Arcsine(2), Arcsine(2, as_printed=True)])
@pytest.mark.parametrize("rows", [6, 38])  # 38: inverted block by block
def test_gradient_agrees_with_finite_differences(kernel, rows):
    X, y, trials = drawn(5, rows)
    likelihood = Likelihood(kernel, CHANGING, X, y, trials)
    shape = np.linspace(0.3, -0.2, len(kernel.names))
    theta = np.concatenate([shape, [-0.5, 0.2, -0.1, -0.3]])
    slope = likelihood(theta)[1]
    h = 1e-5  # the error of a central difference is of order h^2
    for k, step in enumerate(h * np.eye(theta.size)):
        change = likelihood.value(theta + step) - likelihood.value(theta - step)
        assert slope[k] == pytest.approx(change / (2 * h), rel=1e-6, abs=1e-6)


def test_likelihood_has_the_closed_form_of_a_mixed_model():
    from scipy.stats import multivariate_normal

    X, y, trials = drawn(4, 5)
    sc = 0.7
    theta = np.concatenate([[0.1, 0.2, -0.3], np.log([0.6, sc])])
    noise = TrialNoise(ConstantNoise())
    same = (trials.trial[:, None] == trials.trial).astype(float)
    C = SE.matrix(theta[:3], X, X) + 0.6**2 * np.eye(y.size)
    C += same * sc**2
    expected = multivariate_normal(np.zeros(y.size), C).logpdf(y)
    lml = Likelihood(SE, noise, X, y, trials).value(theta)
    assert lml == pytest.approx(expected, rel=1e-10)


def test_likelihood_gradient_and_prediction_agree_with_scikit_learn():
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel
    from sklearn.gaussian_process.kernels import WhiteKernel as White

    X, y, trials = drawn(6, 8, seed=3)
    ignored, exact = 1e9, 1e-3  # length scales: no effect; inputs must be equal
    inputs = np.column_stack([X, trials.trial])
    smooth = ConstantKernel(1.3**2) * RBF([0.9, 1.7, ignored])
    level = ConstantKernel(0.6**2) * RBF([ignored, ignored, exact])
    reference = GaussianProcessRegressor(
        smooth + level + White(0.4**2), alpha=1e-300, optimizer=None
    ).fit(inputs, y)
    value, gradient = reference.log_marginal_likelihood(
        reference.kernel_.theta, eval_gradient=True
    )
    noise = TrialNoise(ConstantNoise())
    theta = np.log([1.3, 0.9, 1.7, 0.4, 0.6])
    lml, slope = Likelihood(SE, noise, X, y, trials)(theta)
    assert lml == pytest.approx(value, rel=1e-10)
    # scikit-learn's order: sf^2, l1, l2, (fixed), sc^2, (3 fixed lengths), sn^2
    own_order = [0, 1, 2, 8, 4]
    factors = [2.0, 1.0, 1.0, 2.0, 2.0]  # d/d log sf = 2 d/d log sf^2
    np.testing.assert_allclose(slope, gradient[own_order] * factors, rtol=1e-6)

    at = np.random.default_rng(1).normal(size=(5, 2))
    new = np.column_stack([at, np.full(5, 99.0)])  # a trial that is not in the data
    mean, sd = reference.predict(new, return_std=True)
    C = np.linalg.inv(reference.kernel_(inputs))
    own_mean, variance = GaussianProcess(
        kernel=SE, noise=noise, theta=theta, X=X, alpha=C @ y, offset=0.0,
        centre=np.zeros(2), scale=np.ones(2), lml=0.0, starts=(), jitter=0.0,
        at_bound=(), trials=trials,
    ).predict(at)  # fmt: skip
    np.testing.assert_allclose(own_mean, mean, rtol=1e-8)
    np.testing.assert_allclose(np.sqrt(variance), sd, rtol=1e-8)


def test_the_search_recovers_the_spread_between_trials():
    X, _, trials = drawn(40, 8, seed=1)
    rng = np.random.default_rng(2)
    y = np.sin(X[:, 0]) + rng.normal(0, 0.7, 40)[trials.trial]
    y += rng.normal(0, 0.3, y.size)
    model = fit_gp(X, y, SE, LEVEL, trials=trials)
    theta = dict(zip(("log_sn", "log_sc"), model.theta[3:], strict=True))
    # standard errors: 1/sqrt(80) = 11 % for 40 trials, 4 % for 320 rows
    assert np.exp(theta["log_sc"]) == pytest.approx(0.7, rel=0.35)
    assert np.exp(theta["log_sn"]) == pytest.approx(0.3, rel=0.15)


def test_uncertainty_of_a_new_trial_includes_the_trial_spread():
    X, _, trials = drawn(10, 20, seed=4)
    rng = np.random.default_rng(5)
    y = rng.normal(0, 2.0, 10)[trials.trial] + rng.normal(0, 0.1, 200)
    with_level = fit_gp(X, y, SE, LEVEL, trials=trials).predict(X[:5])[1]
    pooled = fit_gp(X, y).predict(X[:5])[1]
    level = y.reshape(10, 20).mean(axis=1).std()
    assert np.sqrt(with_level) == pytest.approx(np.full(5, level), rel=0.35)
    assert with_level.min() > pooled.mean() * 0.8


def test_the_trial_effect_is_ignored_without_trial_indices():
    X, y, _ = drawn(5, 8)
    theta = np.array([0.1, 0.2, 0.3, -0.4])
    alone = Likelihood(SE, ConstantNoise(), X, y).value(theta)
    named = np.append(theta, 0.5)
    assert Likelihood(SE, LEVEL, X, y).value(named) == pytest.approx(alone)


def test_a_refit_with_other_outputs_equals_a_new_fit():
    X, _, trials = drawn(8, 20, seed=6)
    rng = np.random.default_rng(7)
    y = 5.0 + np.sin(X[:, 0]) + rng.normal(0, 0.4, 160)
    first = fit_gp(X, y, SE, LEVEL, trials=trials)
    z = y + rng.normal(0, 0.1, 160)
    refitted = refit_gp(first, z)
    new_fit = fit_gp(X, z, SE, LEVEL, trials=trials)
    assert refitted.lml == pytest.approx(new_fit.lml, abs=1e-2)


def test_conditioning_uses_the_given_rows():
    X, _, trials = drawn(6, 12, seed=8)
    y = np.random.default_rng(9).normal(0, 1.0, 6)[trials.trial] + X[:, 0]
    model = fit_gp(X, y, SE, LEVEL, trials=trials)
    keep = trials.trial != 2
    others = TrialRows(trials.trial[keep])
    whole = model.given(X, y, trials)
    np.testing.assert_allclose(whole.predict(X)[0], model.predict(X)[0], rtol=1e-9)
    held_out = model.given(X[keep], y[keep], others)
    assert held_out.X.shape == (60, 2)
    assert not np.allclose(held_out.predict(X)[0], whole.predict(X)[0])
