"""Measurements of simulated sessions agree with the truth of the simulation."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.trial_file.reader import TrialReader
from analysis.data.load import load_trial
from analysis.data.prepare import PrepareOptions, moving_average, prepare_trial
from experiments.report.truth_errors import z_scores

WIDTH = 11  # samples, the smoothing of the analysis


def smooth(columns):
    return np.column_stack([moving_average(column, WIDTH) for column in columns.T])


def compare(recorded, name):
    """(trial, measured, true): v_t, F_t, F_n of the cycles since the push."""
    path = recorded.folder / "trials" / f"{name}.mcap"
    trial = load_trial(path)
    truth = TrialReader(path.with_suffix(".truth.mcap")).truth().data
    host_ns = trial.cycles["host_ns"].astype(float)
    t_true = truth["host_ns"].astype(float)
    inside = (host_ns >= t_true[0]) & (host_ns <= t_true[-1])
    true = np.column_stack(
        [np.interp(host_ns[inside], t_true, truth["traction"][:, k]) for k in range(3)]
    )
    return trial, smooth(trial.traction[inside]), smooth(true)


@pytest.fixture(scope="module", params=["T01", "T02"])
def pair(request, recorded):
    return compare(recorded, request.param)


def test_measured_velocity_follows_the_true_one(pair):
    _, measured, true = pair
    error = measured[WIDTH:-WIDTH, 0] - true[WIDTH:-WIDTH, 0]
    assert np.sqrt(np.mean(error**2)) <= 1.5e-3
    assert true[:, 0].max() > 0.02  # there was something to follow


def test_measured_forces_follow_the_true_ones(recorded):
    errors = []
    for name in ("T01", "T02"):
        _, measured, true = compare(recorded, name)
        errors.append(np.abs(measured[:, 1:] - true[:, 1:]).mean(axis=0))
        assert true[:, 2].max() > 2.0
    # a tare leaves 0.3 to 0.4 N of the sensor's zero in the mean
    assert np.mean(errors, axis=0).max() <= 0.6


def test_the_tares_of_a_session_predict_the_error_of_its_forces(recorded):
    trials = [load_trial(recorded.folder / "trials" / f"T0{k}.mcap") for k in (1, 2)]
    scores = z_scores(trials)
    assert scores.shape == (2, 2)
    # Four errors; in 80 trials their rms is 1, see test_rehearse.
    assert 0.1 < np.sqrt(np.mean(scores**2)) < 3.0


def test_recovered_friction_is_near_the_true_one(pair):
    trial, measured, true = pair
    truth = TrialReader(trial.path.with_suffix(".truth.mcap")).metadata["trial"]
    mu_k, b = float(truth["true:mu_k"]), float(truth["true:b"])
    # The bias that the tare has left is visible before and after the push.
    is_pushed = (true[:, 2] > 1.0) & (true[:, 0] > 0.03)
    _, F_t, F_n = (measured - true)[~is_pushed].mean(axis=0)
    series = trial.series()
    tared = replace(series, F_t=series.F_t - F_t, F_n=series.F_n - F_n)
    kept = prepare_trial(tared, PrepareOptions())
    loaded = (kept.F_n > 1.0) & (kept.v_t > 0.03)  # beyond Stribeck: F_t = mu F_n + b v
    assert loaded.sum() > 50
    ratio = (kept.F_t[loaded] - b * kept.v_t[loaded]) / kept.F_n[loaded]
    assert np.median(ratio) == pytest.approx(mu_k, rel=0.1)


def test_the_sole_is_at_its_true_position(recorded):
    path = recorded.folder / "trials" / "T01.mcap"
    trial = load_trial(path)
    truth = TrialReader(path.with_suffix(".truth.mcap")).truth().data
    row = len(truth) // 2
    k = int(
        np.argmin(np.abs(trial.cycles["host_ns"].astype(float) - truth["host_ns"][row]))
    )
    # one encoder count is below 0.3 mm at the sole; 2 ms at 0.05 m/s are 0.1 mm
    assert trial.sole[k] == pytest.approx(truth["sole_position"][row], abs=5e-4)


def test_the_truth_is_not_in_the_recording(recorded):
    reader = TrialReader(recorded.folder / "trials" / "T01.mcap")
    assert not [key for key in reader.metadata["trial"] if key.startswith("true:")]
    assert "/truth" not in reader.topic_counts()
