import csv
import io
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.prepare import PrepareOptions
from analysis.data.series import TractionSeries
from analysis.study.break_away_fit import fit_planned
from analysis.study.fits import to_csv, to_fits
from analysis.study.models import GP_SE, TUSTIN, FitOptions
from analysis.study.study import StudyOptions, run_study

SMALL_FIT = FitOptions(gp_points=60, draws=20)  # as in the shared small study
TWO = (TUSTIN, GP_SE)
OPTIONS = StudyOptions(fit=FitOptions(gp_points=80, models=TWO, draws=0), n_jobs=1)
PARAMETERS = ["mu", "F_s", "v_s", "delta_s", "b"]


@pytest.mark.slow
def test_stones_are_predicted_far_worse_than_a_plate(small_study):
    for model in (TUSTIN, GP_SE):
        maes = {name: r.mae(model) for name, r in small_study.terrains.items()}
        assert maes["S0"] > 3 * maes["TF"]
        assert maes["B0"] > 3 * maes["TF"]


def test_models_of_stones_fail_on_a_plate(small_study):
    cross = small_study.cross(TUSTIN)
    assert cross["S0"]["TF"] > 1.4 * cross["TF"]["TF"]
    assert cross["S0"]["S0"] == small_study.terrains["S0"].mae(TUSTIN)


def test_trials_with_contradicting_stones_give_a_warning(make_series, moving):
    trials = [
        replace(make_series(moving, seed=k), stones=stones)
        for k, stones in enumerate(("small", "big"))
    ]
    fit = FitOptions(models=(TUSTIN,), draws=0)
    options = StudyOptions(fit=fit, n_jobs=1)
    study = run_study({"S0": trials}, options, simulated=True)
    assert study.kinds == {"S0": "S0"}
    assert any("big, small" in warning for warning in study.warnings)


def test_a_terrain_is_titled_with_its_kind(small_study):
    titles = [result.title for result in small_study.terrains.values()]
    assert titles == ["S0: small stones", "B0: big stones", "TF: flat plate"]


def test_fits_have_the_agreed_schema(small_study):
    fits = json.loads(json.dumps(to_fits(small_study), allow_nan=False))
    assert fits["schema"] == 1
    assert fits["simulated"] is True
    assert list(fits["terrains"]) == ["S0", "B0", "TF"]
    terrain = fits["terrains"]["S0"]
    assert terrain["trials"] == 3
    assert terrain["kept_samples"] == [745, 704, 552]
    assert terrain["slips"] == [5, 4, 6]
    assert list(terrain["tustin"]["median"]) == PARAMETERS
    assert [list(fold) for fold in terrain["tustin"]["folds"]] == [PARAMETERS] * 3
    assert all(isinstance(flag, str) for flag in terrain["tustin"]["flags"])
    for model in (TUSTIN, GP_SE):
        folds = terrain["mae_folds"][model]
        assert terrain["mae"][model] == pytest.approx(np.mean(folds))
        assert set(fits["cross"][model]["TF"]) == {"S0", "B0", "TF"}
    assert len(terrain["train_rmse_folds"]["tustin"]) == 3
    assert set(PARAMETERS) <= set(fits["units"])
    assert len(terrain["gp"]["gp_se"]["folds"][0]["rows"]) == 60


def test_medians_are_taken_parameter_by_parameter(small_study):
    tustin = to_fits(small_study)["terrains"]["B0"]["tustin"]
    for name in PARAMETERS:
        expected = np.median([fold[name] for fold in tustin["folds"]])
        assert tustin["median"][name] == pytest.approx(expected)


def test_csv_has_every_parameter_with_its_unit(small_study):
    table = list(csv.DictReader(io.StringIO(to_csv(small_study))))
    rows = [r for r in table if r["quantity"] == "F_s" and r["terrain"] == "TF"]
    folds = to_fits(small_study)["terrains"]["TF"]["tustin"]["folds"]
    assert [float(row["value"]) for row in rows] == [fold["F_s"] for fold in folds]
    assert {row["unit"] for row in rows} == {"N"}
    assert [row["fold"] for row in rows] == ["1", "2", "3"]


def test_csv_keeps_a_terrain_from_becoming_a_formula(make_series, moving):
    trials = [make_series(moving, terrain="=1+1", seed=k) for k in range(2)]
    study = run_study({"=1+1": trials}, OPTIONS, simulated=False)
    table = csv.DictReader(io.StringIO(to_csv(study)))
    assert {row["terrain"] for row in table} == {"'=1+1"}


@pytest.mark.slow
def test_results_are_identical_bit_by_bit_for_two_workers(small_study, slice_trials):
    options = StudyOptions(fit=SMALL_FIT, n_jobs=2)
    parallel = run_study(slice_trials, options, simulated=True)
    serial, concurrent = to_fits(small_study), to_fits(parallel)
    serial["options"]["n_jobs"] = concurrent["options"]["n_jobs"] = None
    assert serial == concurrent


def test_break_away_is_fitted_and_stored_on_request(slice_trials):
    trials, kept = {"TF": slice_trials["TF"]}, []
    store = SimpleNamespace(
        get=lambda function, task: None,
        put=lambda function, task, result: kept.append((function, result)),
    )
    study = run_study(
        trials, OPTIONS, simulated=True, store=store, with_break_away=True
    )
    assert set(study.break_away) == {"TF"}
    assert (fit_planned, study.break_away) in kept
    assert run_study(trials, OPTIONS, simulated=True).break_away == {}


def test_a_terrain_is_fitted_independently_of_others(small_study, slice_trials):
    options = StudyOptions(fit=replace(SMALL_FIT, models=TWO), n_jobs=1)
    alone = run_study({"TF": slice_trials["TF"]}, options, simulated=True)
    expected = small_study.terrains["TF"].maes(GP_SE)
    assert alone.terrains["TF"].maes(GP_SE) == pytest.approx(expected, rel=1e-9)


def test_no_trials_are_refused():
    with pytest.raises(SettingsError, match="no trial"):
        run_study({"S0": []}, OPTIONS, simulated=False)


def test_one_trial_is_reported_but_not_fitted(make_series, moving):
    study = run_study({"S0": [make_series(moving)]}, OPTIONS, simulated=False)
    fits = to_fits(study)["terrains"]["S0"]
    assert set(fits["mae"].values()) == {None}
    assert fits["tustin"]["median"]["mu"] is None
    assert any("needs two" in note for note in study.notes)
    json.dumps(to_fits(study), allow_nan=False)


def test_a_trial_that_only_sticks_is_left_out(make_series, moving):
    stuck = make_series(np.zeros(500), name="stuck")
    trials = [make_series(moving), stuck, make_series(moving, seed=1)]
    study = run_study({"S0": trials}, OPTIONS, simulated=False)
    maes = study.terrains["S0"].maes(TUSTIN)
    assert maes[1] is None
    assert maes[0] is not None
    assert maes[2] is not None
    assert any("trial 2 (stuck)" in note and "100%" in note for note in study.notes)


def test_constant_load_is_warned_about_and_fitted(make_series, moving):
    load = np.full(moving.size, 5.0)
    trials = [make_series(moving, F_n=load, seed=k) for k in range(2)]
    study = run_study({"S0": trials}, OPTIONS, simulated=False)
    assert study.terrains["S0"].mae(GP_SE) < 0.2
    assert any("F_n never varies" in warning for warning in study.warnings)


def test_too_few_samples_are_reported(make_series):
    trials = [make_series(np.full(10, 0.05), seed=k) for k in range(3)]
    study = run_study({"S0": trials}, OPTIONS, simulated=False)
    assert study.terrains["S0"].mae(TUSTIN) is None
    assert any("fold 1, Tustin: 4 samples are too few" in n for n in study.notes)
    assert any("GP (SE): No Gaussian process" in n for n in study.notes)
    assert study.terrains["S0"].constant_mae is not None


def test_a_constant_force_leaves_only_tustin(moving):
    t = 0.002 * np.arange(moving.size)
    trials = [
        TractionSeries("S0", "flat", t, moving, 4 + np.sin(t), np.full(t.size, 2.0))
        for _ in range(2)
    ]
    study = run_study({"S0": trials}, OPTIONS, simulated=False)
    assert study.terrains["S0"].mae(TUSTIN) == pytest.approx(0.0, abs=1e-3)
    assert study.terrains["S0"].mae(GP_SE) is None


@pytest.mark.parametrize(
    ("share", "below", "is_warned"),
    [
        (0.02, -1.0, False),
        (0.05, -1.0, True),
        (0.05, -0.3, False),  # hops in slips, within the error of the sensor
    ],
)
def test_a_ground_that_pulls_is_warned_about(
    make_series, moving, share, below, is_warned
):
    load = np.full(moving.size, 4.0)
    load[: int(share * moving.size)] = below
    trials = [make_series(moving, F_n=load, seed=k) for k in range(2)]
    study = run_study({"S0": trials}, OPTIONS, simulated=False)
    assert any("Suspect the tare" in w for w in study.warnings) is is_warned
    assert study.terrains["S0"].lifted_share == pytest.approx(share, abs=0.01)


def test_terrains_with_unequal_numbers_of_trials_are_compared(make_series, moving):
    trials = {
        "S0": [make_series(moving, seed=k) for k in range(2)],
        "B0": [make_series(moving, terrain="B0", seed=k) for k in range(3)],
        "TF": [make_series(moving, terrain="TF")],
    }
    cross = run_study(trials, OPTIONS, simulated=False).cross(TUSTIN)
    assert set(cross) == {"S0", "B0"}
    assert all(error is not None for error in cross["S0"].values() if error != 0)
    assert cross["S0"]["TF"] is not None


@pytest.mark.parametrize(
    ("container", "is_named"), [(None, False), (0.46, True), (0.43, False)]
)
def test_trials_too_short_to_count_give_a_warning(make_series, container, is_named):
    # 5 s at 0.08 m/s: 500 kept samples, 0.40 m
    trials = [make_series(np.full(2501, 0.08), seed=k) for k in range(2)]
    prepare = PrepareOptions(container_travel=container)
    options = replace(OPTIONS, prepare=prepare)
    study = run_study({"S0": trials}, options, simulated=False)
    named = [w for w in study.warnings if "the container not crossed" in w]
    assert bool(named) is is_named
