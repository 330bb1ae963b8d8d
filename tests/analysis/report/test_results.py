"""Results of a report beyond the models: trends, residuals, surfaces, coverage."""

import csv
import io
import json

import numpy as np
import pytest

from analysis.report.findings import findings_rows, plain_findings
from analysis.report.results import compute_results
from analysis.report.sections.beyond_paper.classification import shares_of
from analysis.report.sections.beyond_paper.noise import noise_summaries
from analysis.report.sections.beyond_paper.residuals import residual_band
from analysis.report.sections.beyond_paper.stick_slip import travel_of
from analysis.report.sections.beyond_paper.trends import fit_trend, trends_of
from analysis.report.surfaces import cell_edges, coverages
from analysis.study.fits import to_csv, to_plain
from analysis.study.models import GP_SE, GP_SE_NOISE, FitOptions
from analysis.study.study import StudyOptions, run_study
from analysis.terrains.identify import Confusion


@pytest.fixture(scope="module")
def results(small_study):
    return compute_results(small_study)


def test_a_trends_slope_and_error_are_those_of_regression():
    trials, means = np.arange(1.0, 9.0), np.array([3, 1, 4, 1, 5, 9, 2, 6.0])
    trend = fit_trend(trials, means)
    (slope, start), covariance = np.polyfit(trials, means, 1, cov=True)
    assert trend.slope == pytest.approx(slope, rel=1e-12)
    assert trend.start == pytest.approx(start, rel=1e-12)
    assert trend.slope_error == pytest.approx(covariance[0, 0] ** 0.5, rel=1e-12)


def test_a_line_is_significant_and_scatter_is_not():
    trials = np.arange(1.0, 11.0)
    scatter = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1, -1.0])
    assert fit_trend(trials, 0.3 * trials + 0.1 * scatter).is_significant
    assert not fit_trend(trials, scatter).is_significant


@pytest.mark.parametrize("count", [0, 1, 2])
def test_two_trials_or_fewer_have_no_slope(count):
    trend = fit_trend(np.arange(count) + 1.0, np.ones(count))
    assert trend.slope is None
    assert not trend.is_significant


def test_trends_count_only_trials_with_samples(make_series, moving):
    trials = [make_series(moving), make_series(np.zeros(500)), make_series(moving)]
    options = StudyOptions(fit=FitOptions(models=("tustin",), draws=0), n_jobs=1)
    study = run_study({"S0": trials}, options, simulated=False)
    assert trends_of(study.terrains["S0"])["F_t"].trials.tolist() == [1.0, 3.0]


def test_residuals_average_to_their_bias(small_study):
    result = small_study.terrains["S0"]
    band = residual_band(result, GP_SE)
    residual = np.concatenate(
        [
            trial.F_t - fold.models[GP_SE].model.mean(trial.F_n, trial.v_t)
            for fold, trial in zip(result.folds, result.trials, strict=True)
        ]
    )
    assert band.bias == pytest.approx(residual.mean())
    assert band.sd == pytest.approx(residual.std())
    assert (np.diff(band.quantiles, axis=0) > 0).all()


def test_a_coverage_map_counts_every_sample_once(small_study):
    for cells in coverages(small_study, cell_edges(small_study)):
        kept = small_study.terrains[cells.terrain].kept
        assert cells.counts.sum() + cells.outside == kept


def test_surfaces_equal_the_predictions_of_the_model(results, small_study):
    surface = results.surfaces[0]
    model = small_study.terrains[surface.terrain].models(GP_SE)[0].model
    i, j = 7, 30
    prediction = model.predict(results.axes.F_n[[i]], results.axes.v_t[[j]])
    assert surface.mean[i, j] == pytest.approx(prediction.mean[0])
    assert surface.variance[i, j] == pytest.approx(prediction.sd[0] ** 2)


def test_travelled_distance_is_the_integral_of_velocity(small_study):
    smooth = small_study.terrains["TF"].trials[0].smooth
    expected = np.trapezoid(smooth.v_t, smooth.t)
    assert travel_of(smooth)[-1] == pytest.approx(expected)


def test_shares_of_a_row_without_windows_are_unknown():
    shares = shares_of(Confusion(("a", "b"), np.array([[3, 1], [0, 0]])))
    assert shares[0].tolist() == [0.75, 0.25]
    assert np.isnan(shares[1]).all()


def test_selected_noise_is_counted_and_compared(make_series, moving):
    trials = [make_series(moving, seed=k) for k in range(3)]
    fit = FitOptions(gp_points=40, models=(GP_SE, GP_SE_NOISE), draws=0)
    options = StudyOptions(fit=fit, n_jobs=1)
    study = run_study({"S0": trials}, options, simulated=False)
    (summary,) = noise_summaries(compute_results(study))
    assert sum(summary.counts.values()) == 3
    difference = summary.after - summary.before
    assert summary.paired.difference == pytest.approx(difference)


def test_findings_are_valid_json_and_csv_rows(results, small_study):
    plain = json.loads(json.dumps(to_plain(plain_findings(results)), allow_nan=False))
    slope = plain["trends"]["S0"]["F_t"]["slope"]
    text = to_csv(small_study, findings_rows(results))
    rows = [
        row
        for row in csv.DictReader(io.StringIO(text))
        if row["terrain"] == "S0" and row["quantity"] == "F_t slope per trial"
    ]
    assert [float(row["value"]) for row in rows] == [slope]
    assert rows[0]["unit"] == "N"
