"""The gain from an additional column is recovered on simulated ground."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries
from analysis.report.sections.beyond_paper.further_columns import covariate_tables
from analysis.study.covariates import (
    TRAVEL,
    CovariateResult,
    CovariateRows,
    covariate_results,
    travel_since_drop,
)
from analysis.study.models import FitOptions
from analysis.study.store import ResultStore
from analysis.tables.columns import parse_covariates

AS_THEY_ARE = PrepareOptions(smoothing=1, downsample=5, slowest=1e-4, fastest=1.0)


def slow(rng, size, count=6):
    """Return a curve that changes over seconds, shape (size,)."""
    knots = np.linspace(0, size - 1, count)
    return np.interp(np.arange(size), knots, rng.normal(size=count))


def trials_of(count=6, size=4000):
    """Return trials of a wet ground: F_t grows with moisture and causes the tilt."""
    trials = []
    for k in range(count):
        rng = np.random.default_rng(k)
        t = 0.002 * np.arange(size)
        v_t = 0.06 + 0.03 * np.sin(2.0 * t + k)
        F_n = 4.0 + 2.0 * np.sin(1.3 * t + 2 * k)
        moisture = slow(rng, size)
        quick = np.convolve(rng.normal(size=size + 49), np.ones(50) / 7.0, "valid")
        F_t = 0.6 * F_n + moisture + quick + rng.normal(0, 0.1, size)
        further = {
            "moisture": moisture + rng.normal(0, 0.02, size),
            "idle": slow(rng, size),
            "tilt": 0.1 * F_t + 0.1 * rng.normal(size=size),
        }
        series = TractionSeries("X", f"T{k}", t, v_t, F_n, F_t, further=further)
        trials.append(prepare_trial(series, AS_THEY_ARE))
    return trials


@pytest.fixture(scope="module")
def results():
    names = ("moisture", "idle", "tilt")
    rows = {"X": [CovariateRows.of(trial, names, 1.5) for trial in trials_of()]}
    found = covariate_results(rows, names, FitOptions(gp_points=120), 1)
    return {result.column: result for result in found}


@pytest.mark.slow
def test_a_ground_property_improves_prediction(results):
    moisture = results["moisture"]
    assert moisture.verdict == "gain"
    assert moisture.trials == 6
    assert 0.05 < moisture.lower < moisture.gain < moisture.upper
    assert moisture.sentence.startswith("X: moisture: gain (+")


@pytest.mark.slow
def test_an_unrelated_column_does_not_improve_prediction(results):
    assert results["idle"].verdict == "no gain"
    assert results["idle"].repeated < 0.1


@pytest.mark.slow
def test_a_column_caused_by_the_force_is_flagged(results):
    tilt = results["tilt"]
    assert tilt.verdict == "repeats F_t"
    assert tilt.lower > 0.05
    assert "of its changes over 0.2 s are those of F_t" in tilt.sentence


@pytest.mark.slow
def test_the_report_has_a_row_for_every_column(results):
    (table,) = covariate_tables(list(results.values()))
    assert [row[1:3] for row in table.rows] == [
        ["moisture", "gain"],
        ["idle", "no gain"],
        ["tilt", "repeats F_t"],
    ]
    assert covariate_tables([]) == []


@pytest.mark.parametrize(
    ("gain", "lower", "verdict"),
    [(0.2, 0.1, "gain"), (0.2, -0.1, "no gain"), (0.04, 0.03, "no gain")],
)
def test_a_gain_must_be_significant_and_not_tiny(gain, lower, verdict):
    assert CovariateResult("X", "c", 9, gain, lower, 0.5, 0.1).verdict == verdict


def test_two_trials_are_too_few_for_a_comparison():
    rows = {"X": [CovariateRows.of(trial, ("idle",), 1.5) for trial in trials_of(2)]}
    assert covariate_results(rows, ("idle",), FitOptions(), 1) == []


@pytest.mark.slow
def test_a_constant_column_does_not_improve_prediction():
    trials = trials_of(3)
    flat = np.full_like(trials[0].smooth.t, 7.0)
    trials = [
        replace(trial, smooth=replace(trial.smooth, further={"flat": flat}))
        for trial in trials
    ]
    rows = {"X": [CovariateRows.of(trial, ("flat",), 1.5) for trial in trials]}
    (found,) = covariate_results(rows, ("flat",), FitOptions(gp_points=60), 1)
    assert found.verdict == "no gain"
    assert found.repeated == 0.0


@pytest.mark.slow
def test_folds_are_restored_from_the_store(tmp_path):
    rows = {"X": [CovariateRows.of(trial, ("idle",), 1.5) for trial in trials_of(3)]}
    options, store = (
        FitOptions(gp_points=60),
        ResultStore(tmp_path),
    )
    first = covariate_results(rows, ("idle",), options, 1, store)
    assert len(list(tmp_path.glob("*.json"))) == 3
    assert covariate_results(rows, ("idle",), options, 1, store) == first


def test_travel_since_a_drop_begins_at_the_drop():
    t = 0.01 * np.arange(100.0)
    F_t = np.concatenate([np.linspace(0, 4, 50), np.linspace(3.5, 0, 10), np.zeros(40)])
    F_t[70:] += np.linspace(0, 0.5, 30)  # no drop follows
    series = TractionSeries("X", "x", t, np.full(100, 0.1), np.ones(100), F_t)
    trial = prepare_trial(series, replace(AS_THEY_ARE, downsample=1))
    travel = travel_since_drop(trial, 1.5)
    known = int(np.argmax((np.arange(100) > 49) & (F_t <= 2.5)))
    assert travel[known] == pytest.approx(0.0, abs=1e-12)
    assert travel[known - 1] == pytest.approx(0.001 * (known - 1))
    assert travel[-1] == pytest.approx(0.001 * (99 - known))


def test_travel_is_a_column_of_any_trial():
    rows = CovariateRows.of(trials_of(1)[0], (TRAVEL,), 1.5)
    assert rows.columns.shape == (rows.t.size, 1)
    assert rows.rows.further.shape[1] == 3  # the other columns are inputs of all models


@pytest.mark.parametrize(
    ("text", "known", "reason"),
    [
        ("", None, "0 columns"),
        ("a,a", None, "occurs twice"),
        ("F_t", None, "is not a further column"),
        ("a,b,c,d,e,f,g", None, "7 columns"),
        ("tilt,skew", ("tilt", "height"), "there is no skew"),
    ],
)
def test_an_untestable_column_is_refused(text, known, reason):
    with pytest.raises(SettingsError, match=reason):
        parse_covariates(text, known)
