"""Models of a new trial keep the shape of residuals and have calibrated bands."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.samples import SampleTable, TrainingSet
from analysis.gp.kernels import SquaredExponential
from analysis.gp.regression import fit_gp
from analysis.study.distribution import SHARES, normal_scores
from analysis.study.metrics import coverage, log_density
from analysis.study.models import (
    GP_NN_TRIAL,
    GP_NN_TUSTIN_TRIAL,
    GP_SE,
    GP_SE_TRIAL,
    GP_SE_TUSTIN_TRIAL,
    NEW_TRIAL,
    FitOptions,
    ModelFitter,
)
from analysis.study.new_trial import NewTrialFit, spread_rows

PER_TRIAL, CHOSEN = 120, 150
SE = SquaredExponential()


def rows_of(rng, level, spread):
    """Return one trial around 0.5 F_n + 2 N: `spread` makes the noise of F_n."""
    F_n, v_t = rng.uniform(1, 8, PER_TRIAL), rng.uniform(0.01, 0.2, PER_TRIAL)
    return SampleTable(F_n, v_t, 0.5 * F_n + 2.0 + level + spread(rng, F_n))


def normal(rng, F_n):
    return rng.normal(0.0, 0.4, F_n.size)


def growing(rng, F_n):
    return 0.05 * np.exp(0.4 * F_n) * rng.normal(size=F_n.size)


def skewed(rng, F_n):
    """Noise with a long tail upwards and none downwards, as forces on stones have."""
    return 1.2 * (rng.exponential(size=F_n.size) - 1.0)


def trials_of(spread, count, between=0.0, seed=0):
    rng = np.random.default_rng(seed)
    return [rows_of(rng, rng.normal(0.0, between), spread) for _ in range(count)]


def training(trials, chosen=CHOSEN, seed=1):
    rows = SampleTable.joined(trials)
    take = np.random.default_rng(seed).choice(rows.count, chosen, replace=False)
    return TrainingSet(rows, tuple(trial.count for trial in trials), take)


def fitted(data):
    start = fit_gp(data.subset.inputs, data.subset.F_t, SE)
    return NewTrialFit(data, None).fit(start)


def test_the_residuals_of_normal_noise_are_normal():
    model = fitted(training(trials_of(normal, 8)))
    inner = slice(1, -1)  # 190 rows show 1 % poorly
    assert model.residuals[inner] == pytest.approx(
        normal_scores(SHARES)[inner], abs=0.35
    )


def test_the_residuals_of_skewed_noise_are_skewed():
    model = fitted(training(trials_of(skewed, 8)))
    low, median, high = (model.residuals[SHARES.index(s)] for s in (0.05, 0.5, 0.95))
    # an exponential variable: 0.05, 0.69 and 3.0
    assert high - median > 2.0 * (median - low)


def test_bands_widen_where_the_noise_grows():
    model = fitted(training(trials_of(growing, 8)))
    low, high = model.predict(np.array([1.5, 7.5]), np.array([0.1, 0.1])).quantiles(
        (0.05, 0.95)
    )
    # the noise grows tenfold; its logarithm is linear in F_n with a prior on the slope
    assert (high - low)[1] > 3.0 * (high - low)[0]


@pytest.mark.slow
@pytest.mark.parametrize("spread", [normal, skewed])
def test_bands_have_nominal_coverage_for_differing_trials(spread):
    shares = {0.5: [], 0.9: []}
    for seed in range(3, 9):
        trials = trials_of(spread, 9, between=1.0, seed=seed)
        model = fitted(training(trials))
        for rows in trials_of(spread, 30, between=1.0, seed=100 + seed):
            made = model.predict(rows.F_n, rows.v_t)
            for share, found in shares.items():
                found.append(coverage(rows.F_t, made, share))
    # nine trials show the spread between trials to a quarter, six times nine to a tenth
    assert np.mean(shares[0.5]) == pytest.approx(0.5, abs=0.08)
    assert np.mean(shares[0.9]) == pytest.approx(0.9, abs=0.05)


def test_a_pooled_fit_of_the_same_trials_is_worse():
    trials = trials_of(normal, 9, between=1.5, seed=5)
    fitter = ModelFitter(training(trials), FitOptions())
    pooled, new = fitter.fit(GP_SE), fitter.fit(GP_SE_TRIAL)
    unseen = trials_of(normal, 40, between=1.5, seed=6)
    gains = [
        new.predict(r.F_n, r.v_t).log_density(r.F_t).mean()
        - log_density(r.F_t, pooled.predict(r.F_n, r.v_t)).mean()
        for r in unseen
    ]
    assert np.mean(gains) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [GP_SE_TRIAL, GP_NN_TRIAL, GP_SE_TUSTIN_TRIAL, GP_NN_TUSTIN_TRIAL]
)
@pytest.mark.parametrize("spread", [normal, skewed])
def test_every_process_has_a_trial_effect(name, spread):
    data = training(trials_of(spread, 6, between=0.8))
    model = ModelFitter(data, FitOptions()).fit(name)
    found = model.predict(np.array([2.0, 6.0]), np.array([0.05, 0.05]))
    assert "log_sc" in model.describe()["theta"]
    assert model.level_sd > 0.0
    assert found.point == pytest.approx([3.0, 5.0], abs=1.6)
    assert model.mean(np.array([2.0]), np.array([0.05]))[0] == pytest.approx(
        found.point[0], rel=1e-6
    )


def test_one_trial_gives_neither_levels_nor_residuals():
    model = fitted(training(trials_of(skewed, 1), 60))
    assert model.level_sd == 0.0
    assert model.residuals == pytest.approx(normal_scores(SHARES))


def test_outputs_that_vary_only_outside_the_spread_rows_are_refused():
    data = training(trials_of(normal, 4), 60)
    F_t = np.full(data.rows.count, 5.0)
    spread = spread_rows(data.lengths, data.chosen.size)
    varying = np.setdiff1d(data.chosen, spread)
    F_t[varying] = np.arange(varying.size)
    rows = SampleTable(data.rows.F_n, data.rows.v_t, F_t)
    with pytest.raises(SettingsError, match="spanning 0 N"):
        fitted(TrainingSet(rows, data.lengths, data.chosen))


def test_the_rows_of_a_trial_may_come_in_any_order():
    data = training(trials_of(normal, 5, between=0.5), 80)
    mixed = TrainingSet(data.rows, data.lengths, data.chosen[::-1])
    start = fit_gp(data.subset.inputs, data.subset.F_t, SE)
    first, second = (NewTrialFit(d, None).fit(start) for d in (data, mixed))
    assert first.process.lml == pytest.approx(second.process.lml, rel=1e-12)


def test_every_model_beyond_the_paper_has_a_fitter():
    assert set(NEW_TRIAL) >= {GP_SE_TRIAL, GP_NN_TRIAL, GP_SE_TUSTIN_TRIAL}


def test_held_out_squares_are_split_into_residuals_and_levels():
    trials = trials_of(normal, 12, between=1.0, seed=8)
    model = fitted(training(trials, 240))
    means = [trial.F_t.mean() - 0.5 * trial.F_n.mean() for trial in trials]
    assert model.level_sd == pytest.approx(np.std(means, ddof=1), rel=0.2)
    # the residual around the levels is the noise of single rows
    assert np.ptp(model.residuals) == pytest.approx(2 * 2.33, rel=0.15)
