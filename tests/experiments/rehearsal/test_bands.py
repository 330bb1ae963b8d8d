import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.data.events import find_slips
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries
from analysis.study.models import GP_SE, TUSTIN, FitOptions
from analysis.study.study import StudyOptions, run_study
from experiments.rehearsal.bands import BANDS, Band, BandResult, compare_with_bands
from experiments.rehearsal.model_measures import measure_models
from experiments.rehearsal.slip_measures import GroundTrials, measure_slips
from tests.fakes.point_foot import PointFoot

BAND = Band("X1", "something", 0.2, 0.4)
# Bands that a trial or two of three terrains can meet.
QUICK = ("D1", "D2", "D3", "D4", "E1", "E3", "E4", "F1")


def test_bands_have_unique_names_and_ordered_limits():
    ids = [band.id for band in BANDS]
    assert len(ids) == len(set(ids))
    assert all(band.least < band.most for band in BANDS)


@pytest.mark.parametrize(
    ("values", "is_met"),
    [
        ((0.2, 0.4), True),
        ((0.3,), True),
        ((0.19,), False),
        ((0.3, 0.41), False),
        ((), False),
        ((math.nan,), False),
    ],
)
def test_a_band_is_met_when_every_value_is_inside(values, is_met):
    assert BandResult(BAND, values).is_met is is_met


def test_a_band_without_a_measurement_is_not_met():
    found = compare_with_bands({"A2": [0.4]})
    assert [f.band.id for f in found if f.is_met] == ["A2"]
    assert found[-1].text == "none"


def test_several_values_are_printed_as_their_range():
    assert BandResult(BAND, (0.31, 0.22, 0.28)).text == "0.22 .. 0.31"


# --- slips, samples, rest -------------------------------------------------------------


def ground(trials, *, is_plate):
    prepared = tuple(prepare_trial(series, PrepareOptions()) for series in trials)
    slips = tuple(find_slips(trial.smooth) for trial in prepared)
    return GroundTrials(is_plate, tuple(trials), prepared, slips)


def failed(grounds, ids):
    measures = measure_slips(grounds)
    found = compare_with_bands(measures)
    return {f.band.id for f in found if f.band.id in ids and not f.is_met}


@pytest.mark.slow
def test_simulated_stones_and_plate_meet_the_bands_of_one_trial():
    grounds = {
        name: ground([PointFoot(name, 1, 1).run()], is_plate=name == "TF")
        for name in ("S0", "B0", "TF")
    }
    assert failed(grounds, QUICK) == set()


def drawn(terrain, trial, *, seed=1, samples=4000):
    """Toy trial without dynamics: a line in F_n and v_t with coloured noise."""
    rng = np.random.default_rng([seed, trial, len(terrain)])
    t = np.arange(samples) * 0.002
    wander = np.cumsum(rng.normal(size=(samples, 3)), axis=0)
    wander = (wander - wander.mean(axis=0)) / wander.std(axis=0)
    v_t = np.clip(0.05 + 0.03 * wander[:, 0], 0.006, 0.19)
    F_n = 3.5 + 0.8 * wander[:, 1]
    if terrain.startswith("T"):
        F_t = 0.8 * F_n + 0.2 * wander[:, 2]
    else:
        F_t = 0.7 * F_n + 4.0 - 20.0 * v_t + 2.0 * wander[:, 2]
    return TractionSeries(terrain, f"{terrain}-{trial}", t, v_t, F_n, F_t)


def test_a_toy_without_dynamics_is_rejected():
    grounds = {
        name: ground([drawn(name, k) for k in range(2)], is_plate=name == "TF")
        for name in ("S0", "B0", "TF")
    }
    assert {"D1", "D4", "D5", "E2", "E3", "F1"} <= failed(
        grounds, [band.id for band in BANDS]
    )


# --- models ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def toy_measures():
    names = ("S0", "B0", "TF", "Tf")
    trials = {name: [drawn(name, k, samples=2000) for k in range(5)] for name in names}
    fit = FitOptions(models=(TUSTIN, GP_SE), gp_points=60, draws=0)
    study = run_study(trials, StudyOptions(fit=fit, n_jobs=1), simulated=True)
    return study, measure_models(study)


@pytest.mark.slow
def test_own_errors_agree_with_the_study(toy_measures):
    study, measures = toy_measures
    plates = [study.terrains[n].mae(m) for m in (TUSTIN, GP_SE) for n in ("TF", "Tf")]
    assert sorted(measures["A1"]) == pytest.approx(sorted(plates))
    assert measures["A2"] == pytest.approx([np.mean(plates)])
    stones = [study.terrains[n].mae(GP_SE) for n in ("S0", "B0")]
    assert measures["A4"] == pytest.approx([np.mean(stones)])


def test_foreign_errors_agree_with_the_cross_table(toy_measures):
    study, measures = toy_measures
    cross = study.cross(GP_SE)
    expected = cross["S0"]["TF"] / cross["TF"]["TF"]
    assert min(abs(value - expected) for value in measures["B6"]) < 1e-9


def test_plates_and_stones_are_distinguished_and_twins_are_not(toy_measures):
    _, measures = toy_measures
    assert measures["B8"] == [1.0]
    assert measures["B9"][0] < 1.0  # S0 and B0 are drawn from one law


def test_a_model_of_stones_is_worse_on_plates_in_every_fold(toy_measures):
    _, measures = toy_measures
    # 2 x 2 cells each way; five folds reach p = 1/32
    assert measures["B10"] == [8.0]


def test_coloured_noise_is_correlated_over_tens_of_milliseconds(toy_measures):
    _, measures = toy_measures
    assert all(0.9 < value <= 1.0 for value in measures["C3"])
    assert measures["C4"][0] < min(measures["C3"])


def test_all_bands_of_models_are_measured(toy_measures):
    _, measures = toy_measures
    assert set(measures) == {b.id for b in BANDS if b.id[0] in "ABC"} | {"E7"}


@pytest.mark.slow
def test_plates_are_recognised_by_their_stones_and_not_by_their_names(toy_measures):
    study, measures = toy_measures
    names = {"S0": "Tundra", "B0": "Trail", "TF": "Sand", "Tf": "Beach"}
    stones = {"S0": "small", "B0": "big", "TF": "none", "Tf": "none"}
    trials = {
        names[name]: [
            replace(
                drawn(name, k, samples=2000), terrain=names[name], stones=stones[name]
            )
            for k in range(5)
        ]
        for name in names
    }
    renamed = measure_models(run_study(trials, study.options, simulated=True))
    assert renamed.keys() == measures.keys()
    assert renamed["B8"] == [1.0]  # stones and plates are never confused


def test_a_study_without_plates_has_no_measures_of_models(toy_measures):
    study, _ = toy_measures
    stones = {n: r for n, r in study.terrains.items() if n in ("S0", "B0")}
    assert measure_models(replace(study, terrains=stones)) == {}


def resting(level, later):
    """A trial of 0.4 s at `level` [N], then of a push back at `later` [N]."""
    t = np.arange(1000) * 0.002
    v_t = np.where(t < 1.0, 0.0, 0.03)
    F_t = np.where(t < 0.4, level, later)
    return TractionSeries("TF", "TF-1", t, v_t, np.full(1000, 3.0), F_t, "none")


def test_the_force_at_rest_is_taken_from_the_start_of_a_trial():
    levels = (0.1, 0.5, 0.3)
    plate = ground([resting(level, 9.0) for level in levels], is_plate=True)
    stones = ground([PointFoot("S0", 1, 1).run()], is_plate=False)
    (found,) = measure_slips({"S0": stones, "TF": plate})["F2"]
    assert found == pytest.approx(np.std(levels, ddof=1))
