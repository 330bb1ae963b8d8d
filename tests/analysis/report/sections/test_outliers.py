"""Outlier trials are reported with the reason, other trials are not."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.prepare import PrepareOptions
from analysis.data.series import TractionSeries
from analysis.report.sections.summary.outliers import (
    outlier_tables,
    outlier_trials,
    qn_scale,
)
from analysis.study.models import TUSTIN, FitOptions
from analysis.study.study import StudyOptions, run_study

OPTIONS = StudyOptions(
    PrepareOptions(), fit=FitOptions(models=(TUSTIN,), draws=0), n_jobs=1
)


def push(number, mu=0.8):
    """Return a push whose load, velocity and friction vary from trial to trial."""
    rng = np.random.default_rng(number)
    t = np.arange(2000) / 500.0
    v = 0.05 * np.exp(rng.normal(0.0, 0.1)) * (1.2 + np.sin(7.0 * t))
    load = 5.0 + rng.normal(0.0, 0.3) + np.sin(3.0 * t + rng.uniform(0.0, 6.0))
    force = mu * load + rng.normal(0.0, 0.1) + rng.normal(0.0, 0.1, t.size)
    return TractionSeries("X", f"T{number + 1:02d}", t, v, load, force)


def studied(trials):
    return run_study({"X": trials}, OPTIONS, simulated=True)


def test_similar_trials_have_no_outlier():
    trials = [push(k) for k in range(10)]
    study = studied(trials)
    assert outlier_trials(study) == []
    assert outlier_tables(study) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: replace(s, F_t=s.F_t + 2.0), "F_t at the same load and velocity +2"),
        (lambda s: replace(s, F_n=s.F_n + 4.0), "F_t/F_n 0."),
        (lambda s: replace(s, v_t=0.3 * s.v_t), "velocity 0."),
        (
            lambda s: replace(
                s, F_t=s.F_t + np.random.default_rng(1).normal(0.0, 3.0, s.t.size)
            ),
            "change from sample to sample",
        ),
        (lambda s: replace(s, F_t=-s.F_t), "the ground drives the foot"),
    ],
)
def test_a_faulty_trial_ranks_first_with_its_cause(change, words):
    trials = [push(k) for k in range(10)]
    trials[3] = change(trials[3])
    study = studied(trials)
    outliers = outlier_trials(study)
    first = outliers[0]
    assert (first.terrain, first.number, first.name) == ("X", 4, "T04")
    assert first.score > 1.0
    assert any(words in reason for reason in first.reasons), first.reasons
    (table,) = outlier_tables(study)
    assert table.rows[0][1] == "4"


def test_several_trials_with_one_fault_do_not_mask_each_other():
    trials = [push(k) for k in range(10)]
    for k in (2, 5, 8):
        trials[k] = replace(trials[k], F_t=trials[k].F_t + 3.0)
    assert {trial.number for trial in outlier_trials(studied(trials))} == {3, 6, 9}


def test_the_scale_is_the_standard_deviation_of_normal_values():
    rng = np.random.default_rng(1)
    for count in (4, 9, 10, 31):
        scales = [qn_scale(rng.normal(5.0, 2.0, count)) for _ in range(2000)]
        assert np.mean(scales) == pytest.approx(2.0, rel=0.04), count


def test_the_scale_is_robust_to_half_of_the_values():
    x = np.random.default_rng(1).normal(size=20)
    x[:9] = 1e6
    assert qn_scale(x) < 5.0


def after_a_rest(series):
    """Return a push at 125 Hz after a rest of the foot under its weight alone.

    Such a rate is too low for the lag of a force.
    """
    rng = np.random.default_rng(int(series.name[1:]))
    t = np.arange(series.t.size + 500) / 125.0
    load, force = (
        np.concatenate([weight + rng.normal(0.0, 0.3, 500), values])
        for weight, values in ((2.9, series.F_n), (0.0, series.F_t))
    )
    v_t = np.concatenate([np.zeros(500), series.v_t])
    return replace(series, t=t, v_t=v_t, F_n=load, F_t=force)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: replace(s, F_t=s.F_t + 3.0), "F_t at rest +3"),
        pytest.param(
            lambda s: replace(s, F_n=s.F_n + 3.0),
            "F_n at rest +3",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            lambda s: replace(
                s, F_n=s.F_n + np.random.default_rng(1).normal(0.0, 3.0, s.t.size)
            ),
            "noise of F_n at rest 8",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_wrong_sensor_is_detected_at_rest_on_any_ground(change, words):
    trials = [after_a_rest(push(k, mu=0.4 + 0.1 * k)) for k in range(10)]
    assert outlier_trials(studied(trials)) == []
    trials[3] = change(trials[3])
    assert outlier_trials(studied(trials))[0].number == 4
    assert any(words in reason for reason in outlier_trials(studied(trials))[0].reasons)


def test_three_trials_are_too_few_to_compare():
    trials = [push(k) for k in range(3)]
    trials[1] = replace(trials[1], F_t=trials[1].F_t + 5.0)
    assert outlier_trials(studied(trials)) == []
