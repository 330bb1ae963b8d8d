from dataclasses import replace

import numpy as np
import pytest

from analysis.data.samples import SampleTable, TrainingSet
from analysis.gp.noise import LogLinearNoise
from analysis.gp.refit import refit_gp
from analysis.gp.regression import fit_gp
from analysis.study import noise_selection
from analysis.study.metrics import Prediction, log_density
from analysis.study.noise_selection import TailedNoise, choose_noise, tail_cost

PER_TRIAL = 120


def training(noise, trials=6, seed=0):
    rng = np.random.default_rng(seed)
    count = trials * PER_TRIAL
    F_n, v_t = rng.uniform(1, 8, count), rng.uniform(0.01, 0.2, count)
    rows = SampleTable(F_n, v_t, 0.5 * F_n + noise(rng, F_n))
    chosen = rng.choice(count, 100, replace=False)
    return TrainingSet(rows, (PER_TRIAL,) * trials, chosen)


def chosen_for(data):
    rows = data.subset
    constant = fit_gp(rows.inputs, rows.F_t)
    changing = refit_gp(constant, rows.F_t, noise=LogLinearNoise())
    return choose_noise(data, constant, changing, seed=0)


def test_constant_noise_is_kept_if_it_is_the_truth():
    data = training(lambda rng, F_n: rng.normal(0, 0.5, F_n.size))
    choice = chosen_for(data)
    assert choice.chosen == "constant"
    assert set(choice.nlpd) == {"constant", "loglinear", "student"}


def test_noise_that_grows_with_load_is_chosen():
    data = training(
        lambda rng, F_n: 0.05 * np.exp(0.5 * F_n) * rng.normal(size=F_n.size)
    )
    choice = chosen_for(data)
    assert choice.chosen == "loglinear"
    assert choice.nlpd["loglinear"] < choice.nlpd["constant"] - 0.03


def test_heavy_tails_are_chosen():
    data = training(lambda rng, F_n: 0.3 * rng.standard_t(2.2, F_n.size))
    assert chosen_for(data).chosen == "student"


def test_one_training_trial_allows_no_selection():
    data = training(lambda rng, F_n: rng.normal(0, 0.5, F_n.size), trials=1)
    assert chosen_for(data).chosen == "constant"


def test_inner_fits_start_only_at_the_best_optimum(monkeypatch):
    data = training(lambda rng, F_n: rng.normal(0, 0.5, F_n.size))
    rows = data.subset
    constant = fit_gp(rows.inputs, rows.F_t)
    (best,) = (top for top in constant.starts if top.lml == constant.lml)
    # another top, 1 nat lower: near enough to be a start of other refits
    lower = best._replace(theta=tuple(x + 2.0 for x in best.theta), lml=best.lml - 1.0)
    begun = []

    def watched(process, y):
        begun.append(process.starts)
        return refit_gp(process, y)

    monkeypatch.setattr(noise_selection, "refit_gp", watched)
    both = replace(constant, starts=(lower, best))
    changing = refit_gp(both, rows.F_t, noise=LogLinearNoise())
    choose_noise(data, both, changing, seed=0)
    assert begun[::2] == [(best,)] * 3
    assert [len(starts) for starts in begun] == [1] * 6


def test_tails_have_the_degrees_of_freedom_of_the_noise():
    data = training(lambda rng, F_n: 0.3 * rng.standard_t(4.0, F_n.size), trials=20)
    process = fit_gp(data.subset.inputs, data.subset.F_t)
    tails = TailedNoise.of(process, data)
    # 2300 samples determine nu = 4 to about a tenth
    assert tails.nu == pytest.approx(4.0, abs=1.2)
    assert 2.1 <= tails.nu <= 60.0


def test_tails_keep_the_mean_and_state_their_standard_deviation():
    normal = Prediction(np.array([1.0]), np.array([2.0]))
    found = TailedNoise(nu=4.0, spread=0.5).applied_to(normal)
    assert found.mean[0] == 1.0
    assert found.sd[0] == pytest.approx(0.5 * 2.0 * np.sqrt(2.0))
    assert found.scale[0] == pytest.approx(1.0)


def test_without_held_out_rows_there_are_no_tails():
    data = training(lambda rng, F_n: rng.normal(0, 0.5, F_n.size), trials=1)
    everything = TrainingSet(data.rows, data.lengths, np.arange(data.rows.count))
    process = fit_gp(data.subset.inputs, data.subset.F_t)
    assert TailedNoise.of(process, everything) is None


def test_the_gradient_of_the_tails_agrees_with_differences():
    z = np.random.default_rng(0).standard_t(3.0, 200)
    x, step = np.log([4.0, 0.8]), 1e-6
    for k in (0, 1):
        aside = step * np.eye(2)[k]
        difference = (tail_cost(x + aside, z)[0] - tail_cost(x - aside, z)[0]) / 2e-6
        assert tail_cost(x, z)[1][k] == pytest.approx(difference, abs=1e-8)


def test_the_tail_objective_is_their_density_up_to_a_constant():
    z = np.random.default_rng(1).normal(size=50)
    normal = Prediction(np.zeros(50), np.ones(50))
    costs = [
        tail_cost(np.log([nu, spread]), z)[0]
        + log_density(z, TailedNoise(nu, spread).applied_to(normal)).mean()
        for nu, spread in ((2.5, 0.6), (8.0, 1.3), (40.0, 1.0))
    ]
    np.testing.assert_allclose(costs, costs[0], atol=1e-12)
