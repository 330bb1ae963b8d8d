"""The likelihood from pivots, held against the exact one and against differences."""

import numpy as np
import pytest

from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import SquaredExponential
from analysis.gp.likelihood import Likelihood
from analysis.gp.low_rank import LowRankLikelihood, choose_pivots, near_over
from analysis.gp.noise import ConstantNoise, LogLinearNoise
from analysis.gp.trial_noise import TrialNoise, TrialRows, columns_over

SE = SquaredExponential(2)
BOTH = TrialNoise(LogLinearNoise(2), True, True, load=(1.0, 0.4))
MODELS = [
    (SE, ConstantNoise()),
    (SE, LogLinearNoise(2)),
    (SE, TrialNoise()),
    (SE, TrialNoise(has_level=False, has_ratio=True, load=(1.0, 0.4))),
    (SE, BOTH),
    (Arcsine(2), ConstantNoise()),
    (Arcsine(2), BOTH),
    (SE + Arcsine(2), ConstantNoise()),
    (SE * SE, LogLinearNoise(2)),
]
NAMES = ["constant", "loglinear", "level", "ratio", "both", "nn", "nn both", "+", "*"]


def rows(count=120, trials=6):
    rng = np.random.default_rng(3)
    X = rng.uniform(-1.5, 1.5, (count, 2))
    r = np.sin(X[:, 0]) + 0.3 * X[:, 1] + rng.normal(0, 0.5, count)
    label = np.repeat(np.arange(trials), count // trials)
    return X, r, TrialRows(label, np.zeros(count))


def low_rank(model, X, r, trials, pivots):
    return LowRankLikelihood(model, X, r, pivots, columns_over(model[1], X, trials))


def drawn(model, rng):
    """Return hyperparameters: smooth kernels, noise above a tenth of the outputs."""
    kernel, noise = model
    shape, within = rng.uniform(0.0, 0.8, len(kernel.names)), rng.normal(-0.8, 0.3, 1)
    others = rng.normal(-0.3, 0.2, len(noise.names) - 1)
    return np.concatenate([shape, within, others])


@pytest.mark.parametrize("model", MODELS, ids=NAMES)
def test_gradient_agrees_with_differences(model):
    X, r, trials = rows()
    likelihood = low_rank(model, X, r, trials, np.arange(0, 120, 4))
    theta = drawn(model, np.random.default_rng(4))
    slope = likelihood(theta)[1]
    for k, step in enumerate(1e-5 * np.eye(theta.size)):
        change = likelihood(theta + step)[0] - likelihood(theta - step)[0]
        # h^2 of the difference, and rounding of the pivots' inverse, 1e-16 / 1e-9
        assert slope[k] == pytest.approx(change / 2e-5, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("model", MODELS, ids=NAMES)
def test_with_enough_pivots_it_is_the_exact_likelihood(model):
    X, r, trials = rows()
    exact = Likelihood(model, X, r, trials)
    theta = drawn(model, np.random.default_rng(5))
    value, slope = low_rank(model, X, r, trials, np.arange(120))(theta)
    expected, exact_slope = exact(theta)
    # all rows are pivots: what is left is 1e-9 of their variance
    assert value == pytest.approx(expected, abs=1e-5)
    np.testing.assert_allclose(slope, exact_slope, atol=1e-4)


@pytest.mark.parametrize("model", MODELS, ids=NAMES)
def test_its_value_comes_with_the_scaled_trace(model):
    X, r, trials = rows()
    pivots = np.arange(0, 120, 8)
    likelihood = low_rank(model, X, r, trials, pivots)
    rng = np.random.default_rng(6)
    for theta in (drawn(model, rng), drawn(model, rng)):
        expected = low_rank(model, X, r, trials, pivots)(theta)[0]
        count = len(model[0].names)
        S = model[1].evaluate(theta[count:], X)[0]
        for value, t in (likelihood.value(theta), likelihood.value(theta)):
            assert value == expected
            trace = left(model[0], theta[:count], S, X, pivots)
            assert t == pytest.approx(trace, rel=1e-4, abs=1e-6)
        assert likelihood(theta)[0] == expected


def left(kernel, theta, S, X, pivots):
    """Return sum_i R_ii / S_ii of what the pivots leave."""
    K = kernel.matrix(theta, X, X)
    F = K[pivots]
    A = F[:, pivots] + 1e-9 * np.diag(np.diagonal(K)[pivots])
    rest = np.diagonal(K) - np.einsum("mn,mn->n", F, np.linalg.solve(A, F))
    return float(np.sum(rest / S))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kernel", [SE, Arcsine(2)])
def test_its_error_keeps_within_the_bound_of_the_scaled_trace(kernel, seed):
    X, r, _ = rows()
    rng = np.random.default_rng(seed)
    model = (kernel, ConstantNoise())
    theta = np.append(rng.normal(0.0, 0.7, len(kernel.names)), rng.normal(-0.5, 0.3))
    S = np.full(r.size, np.exp(2.0 * theta[-1]))
    C = kernel.matrix(theta[:-1], X, X) + np.diag(S)
    square = float(r @ np.linalg.solve(C, r))
    for count in (5, 10, 20, 40):
        pivots = rng.choice(r.size, count, replace=False)
        t = left(kernel, theta[:-1], S, X, pivots)
        value = low_rank(model, X, r, None, pivots)(theta)[0]
        error = value - Likelihood(model, X, r)(theta)[0]
        # log det is too small by t at most, the square too large by t times its value
        assert -0.5 * t * square - 1e-5 <= error <= 0.5 * t + 1e-5


@pytest.mark.parametrize("trace", [0.1, 3.0])
@pytest.mark.parametrize("model", MODELS[:2], ids=NAMES[:2])
def test_pivots_leave_no_more_than_they_may(model, trace):
    X, _, _ = rows()
    kernel, noise = model
    for seed in range(5):
        theta = drawn(model, np.random.default_rng(seed))
        S = noise.evaluate(theta[3:], X)[0]
        K = kernel.matrix(theta[:3], X, X)
        pivots = choose_pivots(K, S, (trace, trace))
        assert pivots is not None
        assert np.unique(pivots).size == pivots.size <= 40
        assert left(kernel, theta[:3], S, X, pivots) <= trace


def test_a_rough_function_has_no_approximation():
    X, r, _ = rows()
    near = near_over(Likelihood((SE, ConstantNoise()), X, r))
    # lengths of the distance between rows: every row tells something of its own
    assert near(np.log([3.0, 0.05, 0.05, 0.3]), (0.1, 0.1)) is None
    assert near(np.log([1.0, 2.0, 2.0, 0.3]), (0.1, 0.1)) is not None


def test_a_drift_along_the_trials_has_no_approximation():
    X, r, trials = rows()
    noise = TrialNoise(has_drift=True)
    theta = np.log([1.0, 2.0, 2.0, 0.3, 0.3, 0.5, 0.5])
    assert near_over(Likelihood((SE, noise), X, r, trials))(theta, (1.0, 1e3)) is None
    assert columns_over(noise, X, trials) is None
