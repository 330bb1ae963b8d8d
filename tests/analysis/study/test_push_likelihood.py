"""The likelihood agrees with SciPy's censored fits, quadrature and differences."""

import numpy as np
import pytest

from analysis.study.push_likelihood import CensoredLikelihood, log_prior
from analysis.study.pushes import FootPush, PushTable
from analysis.study.survival import kaplan_meier, pit_distance, pit_limit

NO_TRIALS = -7.0  # log su


def drawn(seed=1, *, trials=12, pushes=6, terrains=1):
    rng = np.random.default_rng(seed)
    table = []
    for k in range(trials):
        F_n = rng.uniform(0.5, 9.0, pushes)
        strength = np.exp(2.0 + 0.4 * np.log(np.maximum(F_n, 1.0) / 3.5))
        strength = strength * rng.weibull(3.0, pushes)
        limit = rng.uniform(3.0, 25.0, pushes)
        table.append(
            (
                k % terrains,
                [
                    FootPush(0.0, min(s, c), f, bool(c < s))
                    for s, c, f in zip(strength, limit, F_n, strict=True)
                ],
            )
        )
    return PushTable.of(table)


def without_load(table):
    return PushTable(
        table.log_peak, 0.0 * table.load, table.is_held, table.terrain, table.trial
    )


def test_the_maximum_agrees_with_an_independent_censored_fit():
    from scipy import stats

    law = stats.weibull_min
    table = without_load(drawn(trials=40))
    peak = np.exp(table.log_peak)
    data = stats.CensoredData(peak[~table.is_held], right=peak[table.is_held])
    shape, _, scale = law.fit(data, floc=0.0)
    level, s = np.log(scale), 1.0 / shape
    likelihood = CensoredLikelihood(table, 1)

    def value(level, s):
        p = np.array([level, 0.0, np.log(s), NO_TRIALS])
        return likelihood.by_trial(p)[0].sum()

    here = value(level, s)
    assert table.is_held.sum() > 20
    for d_level, d_s in ((0.01, 1.0), (-0.01, 1.0), (0.0, 1.02), (0.0, 0.98)):
        assert value(level + d_level, s * d_s) < here
    # densities of P and of log P differ by log P of the slips
    jacobian = table.log_peak[~table.is_held].sum()
    expected = -law.nnlf((shape, 0.0, scale), peak[~table.is_held]) + jacobian
    expected += law(shape, 0.0, scale).logsf(peak[table.is_held]).sum()
    assert here == pytest.approx(expected, abs=1e-3)


def test_the_effect_of_a_trial_is_integrated_out():
    from scipy import stats
    from scipy.integrate import quad

    table = drawn(trials=3)
    b0, b1, s, su = 2.1, 0.4, 0.4, 0.25
    p = np.array([b0, b1, np.log(s), np.log(su)])
    values, _ = CensoredLikelihood(table, 1).by_trial(p)
    law = stats.gumbel_l(scale=s)
    for k, value in enumerate(values):
        rows = table.trial == k
        above, is_held = table.log_peak[rows] - b0, table.is_held[rows]
        above = above - b1 * table.load[rows]

        def density(u, above=above, is_held=is_held):
            terms = np.where(is_held, law.logsf(above - u), law.logpdf(above - u))
            return np.exp(terms.sum()) * stats.norm(scale=su).pdf(u)

        exact, _ = quad(density, -6 * su, 6 * su, epsabs=0.0, epsrel=1e-9)
        assert value == pytest.approx(np.log(exact), abs=5e-4)  # of 15 points


def test_gradients_agree_with_differences():
    table = drawn(terrains=2)
    likelihood = CensoredLikelihood(table, 2)
    counts = np.random.default_rng(0).integers(0, 3, 12).astype(float)
    p = np.array([2.0, 2.2, 0.3, np.log(0.4), np.log(0.2)])
    _, gradient = likelihood.objective(p, counts)
    step = 1e-5
    for k in range(p.size):
        ends = [
            likelihood.objective(p + sign * step * np.eye(p.size)[k], counts)[0]
            for sign in (1.0, -1.0)
        ]
        assert gradient[k] == pytest.approx((ends[0] - ends[1]) / (2 * step), abs=1e-5)


def test_a_weight_of_two_equals_two_trials():
    table = drawn(trials=3)
    likelihood = CensoredLikelihood(table, 1)
    p = np.array([2.0, 0.4, np.log(0.35), np.log(0.1)])
    values, _ = likelihood.by_trial(p)
    prior, _ = log_prior(p[1:])
    value, _ = likelihood.objective(p, np.array([2.0, 0.0, 1.0]))
    assert -value == pytest.approx(2.0 * values[0] + values[2] + prior)


def test_known_parameters_are_recovered_through_censoring():
    table = drawn(seed=5, trials=120, pushes=8)
    level, slope, log_s, log_su = CensoredLikelihood(table, 1).fit()
    assert 0.1 < table.is_held.mean() < 0.6
    # 960 pushes: standard errors of .015, .03 and .01
    assert level == pytest.approx(2.0, abs=0.05)
    assert slope == pytest.approx(0.4, abs=0.09)
    assert np.exp(log_s) == pytest.approx(1.0 / 3.0, abs=0.03)
    assert np.exp(log_su) < 0.1


def test_the_survival_curve_agrees_with_an_independent_one():
    from scipy import stats

    table = drawn(trials=20)
    peak = np.round(np.exp(table.log_peak), 1)  # ties as well
    curve = kaplan_meier(peak, table.is_held)
    data = stats.CensoredData(peak[~table.is_held], right=peak[table.is_held])
    expected = stats.ecdf(data).cdf
    points = np.linspace(0.0, 30.0, 61) + 0.01
    assert curve.share_below(points) == pytest.approx(expected.evaluate(points))


def test_uniform_transforms_are_within_the_limit_and_shifted_ones_are_not():
    rng = np.random.default_rng(2)
    pit, limit = rng.uniform(size=300), rng.uniform(size=300) * 1.5
    is_held = limit < pit
    seen = np.minimum(pit, limit)
    slips = int((~is_held).sum())
    assert pit_distance(seen, is_held) < pit_limit(slips)
    assert pit_distance(seen**1.5, is_held) > pit_limit(slips)


def test_without_a_slip_there_is_no_distance():
    assert np.isnan(pit_distance(np.array([0.2, 0.4]), np.array([True, True])))
