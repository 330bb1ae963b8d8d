"""The spread of trial levels is estimated from residuals of a known process."""

import numpy as np
import pytest

from analysis.gp.trial_level import (
    FEW,
    LevelSums,
    RestrictedLikelihood,
    TrialResiduals,
    estimate_levels,
)


def drawn(count, between, within=2.5, tau=0.5, noise=0.3, seconds=12.0, seed=0):
    """Return random times and residuals of trials, a row every 0.1 s."""
    rng = np.random.default_rng(seed)
    rho = np.exp(-0.1 / tau)
    trials = []
    for _ in range(count):
        t = 0.1 * np.arange(int(seconds * rng.uniform(6, 14)))
        e = np.empty(t.size)
        e[0] = rng.normal(0.0, within)
        for i in range(1, t.size):
            e[i] = rho * e[i - 1] + within * np.sqrt(1 - rho**2) * rng.normal()
        trials.append((t, e + rng.normal(0, between) + rng.normal(0, noise, t.size)))
    return trials


def test_the_spread_of_many_trials_is_estimated_by_moments():
    levels = estimate_levels(TrialResiduals(drawn(300, 0.6)))
    assert levels.is_by_moments
    assert levels.between == pytest.approx(0.6, rel=0.2)
    assert levels.other == pytest.approx(0.6, rel=0.2)
    assert not levels.estimates_differ
    assert levels.components.tau == pytest.approx(0.5, rel=0.15)
    assert levels.components.within == pytest.approx(2.5, rel=0.05)


def test_the_spread_of_few_trials_is_estimated_by_restricted_likelihood():
    levels = estimate_levels(TrialResiduals(drawn(FEW - 1, 3.0, within=1.0)))
    assert not levels.is_by_moments
    assert levels.between == pytest.approx(3.0, rel=0.4)
    assert levels.levels.size == FEW - 1


def test_correlated_residuals_are_not_mistaken_for_trial_spread():
    spreads = [
        estimate_levels(
            TrialResiduals(drawn(40, 0.0, within=2.0, tau=0.5, seed=s))
        ).between
        for s in range(4)
    ]
    # standard deviation of the means of such trials: 0.58 N
    assert np.mean(spreads) < 0.35


def test_sums_without_a_trial_equal_those_of_the_others():
    trials = drawn(6, 1.0)
    sums = LevelSums.of(TrialResiduals(trials), 1.5)
    for k, variance in enumerate(sums.without_each()):
        others = LevelSums.of(TrialResiduals(trials[:k] + trials[k + 1 :]), 1.5)
        assert variance == pytest.approx(others.variance(), rel=1e-9, abs=1e-12)


def test_the_likelihood_is_that_of_the_dense_covariance():
    residuals = TrialResiduals(drawn(3, 1.0, seconds=2.0))
    theta = np.log([0.3, 0.8, 1.7, 0.4])
    sn, sc, so, tau = np.exp(theta)
    ones, precision, cost = 0.0, 0.0, 0.0
    costs = []
    for k, n in enumerate(residuals.counts):
        t, r = residuals.t[k, :n], residuals.r[k, :n]
        C = so**2 * np.exp(-np.abs(t[:, None] - t) / tau) + sn**2 * np.eye(n) + sc**2
        u = np.linalg.solve(C, np.ones(n))
        precision, ones = precision + u.sum(), ones + u @ r
        costs.append(0.5 * (np.linalg.slogdet(C)[1] + r @ np.linalg.solve(C, r)))
    cost = sum(costs) + 0.5 * (np.log(precision) - ones**2 / precision)
    computed = RestrictedLikelihood(residuals).costs(theta[None, :])[0]
    assert computed == pytest.approx(cost, rel=1e-9)


def test_a_single_trial_has_no_spread():
    with pytest.raises(ValueError, match="two of them"):
        estimate_levels(TrialResiduals(drawn(1, 1.0)))
