"""Models of a new trial: which family they choose, and whether their bands hold."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.samples import SampleTable, TrainingSet
from analysis.gp.kernels import SquaredExponential
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
from analysis.study.new_trial import NORMAL, NewTrialFit, family_counts
from analysis.study.skew import bends_for, unwarped, warped

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
    """Noise that is normal in z = 3 log(y + 3), as a force on stones."""
    y = 0.5 * F_n + 2.0
    return unwarped(warped(y, 3.0) + rng.normal(0.0, 1.5, F_n.size), 3.0) - y


def trials_of(spread, count, between=0.0, seed=0):
    rng = np.random.default_rng(seed)
    return [rows_of(rng, rng.normal(0.0, between), spread) for _ in range(count)]


def training(trials, chosen=CHOSEN, seed=1):
    rows = SampleTable.joined(trials)
    take = np.random.default_rng(seed).choice(rows.count, chosen, replace=False)
    return TrainingSet(rows, tuple(trial.count for trial in trials), take)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spread", "family"),
    [(normal, "normal"), (growing, "loglinear"), (skewed, "log warp")],
)
def test_the_family_that_made_the_trials_is_chosen(spread, family):
    model = NewTrialFit(training(trials_of(spread, 8)), None).fit(SE)
    assert model.choice.chosen == family
    assert set(model.choice.nlpd) == {"normal", "loglinear", "log warp"}
    assert (model.c is not None) == (family == "log warp")
    assert family_counts([model])[family] == 1


def test_a_normal_force_gets_no_shape_on_top():
    assert NewTrialFit(training(trials_of(normal, 8)), None).fit(SE).shape is None


@pytest.mark.slow
def test_forces_with_heavy_tails_and_skew_get_a_shape():
    def odd(rng, F_n):
        return 0.5 * np.sinh(1.2 * np.arcsinh(rng.normal(size=F_n.size)) * 1.5 + 0.6)

    data = training(trials_of(odd, 10), 300)
    model = NewTrialFit(data, None).fit(SE)
    assert model.choice.chosen != "loglinear"
    assert model.shape is not None
    assert model.choice.shape_gain > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("spread", [normal, skewed])
def test_bands_hold_for_trials_that_differ(spread):
    trials = trials_of(spread, 9, between=1.0, seed=3)
    model = NewTrialFit(training(trials), None).fit(SE)
    new = trials_of(spread, 60, between=1.0, seed=4)
    shares = {
        share: np.mean(
            [coverage(r.F_t, model.predict(r.F_n, r.v_t), share) for r in new]
        )
        for share in (0.5, 0.9)
    }
    # nine trials show the spread between trials to a quarter
    assert shares[0.5] == pytest.approx(0.5, abs=0.12)
    assert shares[0.9] == pytest.approx(0.9, abs=0.07)


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
def test_every_process_has_the_effect_of_a_trial(name, spread):
    data = training(trials_of(spread, 6, between=0.8))
    model = ModelFitter(data, FitOptions()).fit(name)
    found = model.predict(np.array([2.0, 6.0]), np.array([0.05, 0.05]))
    assert "log_sc" in model.describe()["theta"]
    assert found.between.min() > 0.0
    assert found.point == pytest.approx([3.0, 5.0], abs=1.6)
    assert model.mean(np.array([2.0]), np.array([0.05]))[0] == pytest.approx(
        found.point[0], rel=1e-6
    )


def test_an_effect_in_proportion_to_load_is_an_option():
    data = training(trials_of(normal, 6, between=0.8), 100)
    model = ModelFitter(data, FitOptions(effect="proportional")).fit(GP_SE_TRIAL)
    theta = model.describe()["theta"]
    assert "log_sp" in theta
    assert "log_sc" not in theta
    near, far = model.predict(np.array([1.0, 8.0]), np.array([0.1, 0.1])).between
    # relative loads of 1 and 8 N; a warp leaves the order
    assert far / near == pytest.approx(64.0, rel=0.01)


def test_an_unknown_effect_is_refused():
    with pytest.raises(SettingsError, match="wrong"):
        FitOptions(effect="wrong")


def test_one_trial_leaves_nothing_to_choose_by():
    model = NewTrialFit(training(trials_of(skewed, 1), 60), None).fit(SE)
    assert model.choice.chosen == NORMAL
    assert model.predict(np.array([3.0]), np.array([0.1])).between[0] == 0.0


def test_the_rows_of_a_trial_may_come_in_any_order():
    data = training(trials_of(normal, 5, between=0.5), 80)
    mixed = TrainingSet(data.rows, data.lengths, data.chosen[::-1])
    first, second = (NewTrialFit(d, None).fit(SE) for d in (data, mixed))
    assert first.process.lml == pytest.approx(second.process.lml, rel=1e-12)


def test_what_the_warp_clips_is_counted():
    trials = trials_of(skewed, 8)
    trials[0].F_t[:] = -20.0
    data = training(trials, 200)
    model = NewTrialFit(data, None).fit(SE)
    deep = np.count_nonzero(data.subset.F_t < -0.95 * (model.c or np.inf))
    assert model.choice.clipped == deep
    assert ("forces clipped by the warp" in model.flags) == (deep > 0)


@pytest.mark.filterwarnings("error")
def test_forces_of_the_other_sign_are_not_warped():
    turned = [
        SampleTable(rows.F_n, rows.v_t, -10.0 - rows.F_t)
        for rows in trials_of(normal, 4)
    ]
    model = NewTrialFit(training(turned), None).fit(SE)
    assert model.c is None
    assert "log warp" not in model.choice.nlpd
    assert float(model.mean(np.array([4.0]), np.array([0.1]))[0]) == pytest.approx(
        -14.0, abs=0.3
    )


def test_bends_are_those_that_leave_most_forces_as_they_are():
    bends = (3.0, 1.0, 9.0, None)
    F_t = np.array([4.0, -2.0, -2.5, 5.0, -2.0])
    assert bends_for(F_t, bends) == [3.0, 9.0, None]
    assert bends_for(-np.abs(F_t) - 20.0, bends) == [None]
    assert bends_for(np.abs(F_t), bends) == list(bends)


def test_every_model_beyond_the_paper_has_a_fitter():
    assert set(NEW_TRIAL) >= {GP_SE_TRIAL, GP_NN_TRIAL, GP_SE_TUSTIN_TRIAL}


@pytest.mark.slow
def test_levels_come_from_residuals_of_rows_that_were_not_fitted():
    trials = trials_of(normal, 6, between=0.5)
    assert NewTrialFit(training(trials, 150), None).fit(SE).spread is not None
    # nearly all rows are in the fit: what is left of them would be too small
    assert NewTrialFit(training(trials, 600), None).fit(SE).spread is None
