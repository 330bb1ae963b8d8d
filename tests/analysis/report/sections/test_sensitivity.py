from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.prepare import prepare_trial
from analysis.report.sections.sensitivity import (
    VALUES,
    comparison_table,
    parse_choice,
    plain_choice,
)
from analysis.study.crossval import plan_folds
from analysis.study.models import GP_NN, TUSTIN, FitOptions
from analysis.study.study import StudyOptions, run_study


@pytest.mark.parametrize(
    "text",
    [
        "",
        "smoothing",
        "colour=red",
        "smoothing=4",
        "smoothing=0",
        "smoothing=x",
        "smoothing=99999",
        "window=0.2",
        "window=0.2:0.1",
        "window=0:0.1",
        "window=nan:0.1",
        "frame=base",
        "drift=constant",
        "inertia=halved",
        "kernel=cubic",
        "static_friction=none",
        "lag=x",
        "lag=nan",
        "lag=51",
    ],
)
def test_unknown_choices_are_refused_with_a_list(text):
    with pytest.raises(SettingsError) as refused:
        parse_choice(text)
    key = text.partition("=")[0]
    expected = [VALUES[key]] if key in VALUES else VALUES
    assert all(word in refused.value.hint for word in expected)


def test_a_choice_changes_only_its_own_option():
    before = StudyOptions()
    smoothed = parse_choice("smoothing=25").options(before)
    assert smoothed.prepare.smoothing == 25
    assert smoothed.prepare.fastest == before.prepare.fastest
    window = parse_choice("window=0.01:0.15").options(before).prepare
    assert (window.slowest, window.fastest) == (0.01, 0.15)
    assert parse_choice("kernel=as_printed").options(before).fit.is_nn_as_printed
    proportional = parse_choice("static_friction=proportional").options(before)
    assert proportional.fit.form.is_proportional
    assert parse_choice("frame=sole").frame == "sole"
    assert parse_choice("drift=interpolated").is_interpolated
    assert not parse_choice("drift=first").is_interpolated
    assert parse_choice("lag=-12.5").lag == -0.0125
    assert parse_choice("inertia=removed").is_inertia_removed
    assert not parse_choice("inertia=kept").is_inertia_removed


@pytest.mark.parametrize("text", ["smoothing=41", "window=0.02:0.12"])
def test_other_training_samples_are_scored_on_the_same_test_samples(
    make_series, moving, text
):
    trials = [make_series(moving, seed=k) for k in range(3)]
    before = StudyOptions()
    after = parse_choice(text).options(before)

    def prepared(options):
        return {"S0": [prepare_trial(series, options) for series in trials]}

    plain, _ = plan_folds(prepared(before.prepare), before.fit)
    varied, _ = plan_folds(
        prepared(after.prepare), after.fit, prepared(after.target or after.prepare)
    )
    for fold, other in zip(plain, varied, strict=True):
        np.testing.assert_array_equal(fold.test_trials[0].F_t, other.test_trials[0].F_t)
        assert fold.training.F_t.shape != other.training.F_t.shape or not np.allclose(
            fold.training.F_t, other.training.F_t
        )


@pytest.mark.slow
def test_another_smoothing_is_compared_on_the_same_samples(make_series, moving):
    trials = {"S0": [make_series(moving, seed=k) for k in range(3)]}
    fit = FitOptions(gp_points=40, models=(TUSTIN,), draws=0)
    options = StudyOptions(fit=fit, n_jobs=1)
    smooth = parse_choice("smoothing=101").options(options)
    same = run_study(trials, smooth, simulated=True).terrains["S0"].mae(TUSTIN)
    own = replace(smooth, target=None)
    easier = run_study(trials, own, simulated=True).terrains["S0"].mae(TUSTIN)
    # a smoothed target is easier to predict: its noise is removed
    assert same > 1.02 * easier


def test_tables_have_no_frame_choice(make_series, moving):
    with pytest.raises(SettingsError, match="no frame"):
        parse_choice("frame=sole").series(make_series(moving))


def test_a_lag_shifts_only_the_forces(make_series, moving):
    series = make_series(moving)
    later = parse_choice("lag=20").series(series)
    np.testing.assert_array_equal(later.v_t, series.v_t[: later.v_t.size])
    np.testing.assert_allclose(later.F_t, series.F_t[10 : 10 + later.F_t.size])


def test_only_models_affected_by_a_choice_are_refitted():
    assert TUSTIN not in parse_choice("kernel=as_printed").models
    assert GP_NN not in parse_choice("static_friction=proportional").models


@pytest.fixture(scope="module")
def both(make_series, moving):
    trials = {"S0": [make_series(moving, seed=k) for k in range(3)]}
    choice = parse_choice("static_friction=proportional")
    fit = FitOptions(gp_points=40, models=(TUSTIN,), draws=0)
    before = run_study(trials, StudyOptions(fit=fit, n_jobs=1), simulated=True)
    options = StudyOptions(fit=fit, n_jobs=1)
    return choice, before, run_study(trials, choice.options(options), simulated=True)


def test_models_that_the_study_leaves_out_are_not_fitted():
    before = StudyOptions(fit=FitOptions(models=("tustin", "gp_se")))
    repeated = parse_choice("smoothing=25").options(before)
    assert repeated.fit.models == ("tustin", "gp_se")


@pytest.mark.slow
def test_both_studies_are_shown_side_by_side(both):
    choice, before, after = both
    table = comparison_table(choice, before, after)
    row = next(row for row in table.rows if row[1] == "Tustin")
    assert row[2] == f"{before.terrains['S0'].mae(TUSTIN):.3f}"
    assert row[3] == f"{after.terrains['S0'].mae(TUSTIN):.3f}"
    assert "(p " in row[4]


def test_results_of_both_studies_are_kept_with_their_difference(both):
    plain = plain_choice(*both)["terrains"]["S0"][TUSTIN]["mae"]
    difference = plain["after"] - plain["before"]
    assert plain["paired"]["difference"] == pytest.approx(difference)
    assert plain["paired"]["trials"] == 3
    # the synthetic force has a static part that does not grow with the load
    assert difference > 0
    assert np.isfinite(plain["paired"]["p"])
