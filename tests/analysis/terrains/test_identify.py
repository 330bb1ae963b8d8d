import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import SettingsError
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.samples import SampleTable
from analysis.data.series import TractionSeries
from analysis.study.metrics import Prediction
from analysis.study.models import GP_SE, TUSTIN, FitOptions, ModelFitter
from analysis.study.study import StudyOptions, run_study
from analysis.tables.loading import load_tables
from analysis.terrains.database import load
from analysis.terrains.identify import Confusion, identify_study
from analysis.terrains.recognition import (
    Expert,
    TerrainScores,
    log_densities,
    neighbour_correlation,
    score_trial,
)
from analysis.terrains.table import Table
from analysis.terrains.tabulation import TableTask, database_of, training_set
from analysis.terrains.verdict import recognise

LEVELS = {"S0": (1.5, 1.2), "TF": (0.8, 0.15), "Tf": (0.3, 0.15)}  # ratio, spread [N]


def push(terrain, trial, ratio=None, spread=None):
    """Return ten seconds on ground with F_t = ratio F_n and noise that lasts."""
    from scipy.signal import lfilter

    usual = LEVELS.get(terrain, (1.0, 0.2))
    ratio, spread = ratio or usual[0], spread or usual[1]
    rng = np.random.default_rng([trial, len(terrain), ord(terrain[-1])])
    t = np.arange(5000) * 0.002
    slow = np.cumsum(rng.normal(size=(5000, 2)), axis=0) / 40.0
    v_t = np.clip(0.05 + 0.03 * np.sin(slow[:, 0]), 0.006, 0.19)
    F_n = 3.5 + np.sin(slow[:, 1])
    lasting = lfilter([np.sqrt(1 - 0.98**2)], [1.0, -0.98], rng.normal(size=5000))
    F_t = ratio * F_n + spread * lasting
    return TractionSeries(terrain, f"{terrain}-{trial}", t, v_t, F_n, F_t)


@pytest.fixture(scope="module")
def study():
    trials = {name: [push(name, k) for k in range(4)] for name in LEVELS}
    fit = FitOptions(models=(TUSTIN, GP_SE), gp_points=60, draws=0)
    return run_study(trials, StudyOptions(fit=fit, n_jobs=1), simulated=True)


@pytest.fixture(scope="module")
def found(study):
    return identify_study(study)


@pytest.fixture(scope="module")
def path(study, found, tmp_path_factory):
    path = tmp_path_factory.mktemp("db") / "terrains.json"
    path.write_text(database_of(study, found, "2027-01-15T08:00:00Z", 1))
    return path


def first_order(rho, sd=2.0, count=4000):
    """Return a trial whose force is a first-order process around zero."""
    rng = np.random.default_rng(3)
    z = np.zeros(count)
    for i, noise in enumerate(rng.normal(size=count - 1), 1):
        z[i] = rho * z[i - 1] + np.sqrt(1 - rho**2) * noise
    t = np.arange(count) * 0.01
    flat = np.full(count, 0.05)
    series = TractionSeries("S0", "drawn", t, flat, flat + 3.0, sd * z)
    return prepare_trial(series, PrepareOptions(smoothing=1, downsample=1))


def around_zero(trial, sd=2.0):
    return Prediction(np.zeros(trial.kept), np.full(trial.kept, sd))


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.95])
def test_the_correlation_of_neighbours_is_recovered(rho):
    trial = first_order(rho)
    found = neighbour_correlation([(trial, around_zero(trial))])
    assert found == pytest.approx(rho, abs=0.04)


def test_a_correlated_trial_is_likeliest_under_its_own_correlation():
    trial = first_order(0.9)
    total = {
        rho: log_densities(trial, around_zero(trial), rho).sum()
        for rho in (0.0, 0.7, 0.9, 0.97)
    }
    assert max(total, key=total.get) == 0.9


def test_densities_are_those_of_the_process():
    trial = first_order(0.5, count=50)
    z = trial.F_t / 2.0
    expected = -0.5 * z[0] ** 2 - 0.5 * math.log(2 * math.pi) - math.log(2.0)
    step = (z[1] - 0.5 * z[0]) ** 2 / 0.75
    second = -0.5 * step - 0.5 * math.log(2 * math.pi * 0.75) - math.log(2.0)
    found = log_densities(trial, around_zero(trial), 0.5)
    assert found[:2] == pytest.approx([expected, second])


def test_a_single_spike_does_not_decide():
    trial = first_order(0.0, count=200)
    calm = log_densities(trial, around_zero(trial), 0.0)
    F_t = trial.F_t.copy()
    F_t[100] = 1e6
    wild = log_densities(replace(trial, F_t=F_t), around_zero(trial), 0.0)
    assert calm.sum() - wild.sum() < 60.0


@pytest.mark.slow
def test_different_terrains_are_distinguished_by_density(found):
    for levels in found.by_density.values():
        assert levels["terrain"].accuracy > 0.9
        assert levels["surface"].accuracy > 0.9
        assert levels["surface"].counts.sum() == levels["terrain"].counts.sum()


def test_the_papers_rule_is_reported_with_the_density(found):
    for levels in found.by_error.values():
        assert set(levels) == {"terrain", "stones", "surface"}
        assert levels["terrain"].accuracy > 0.9


def test_probabilities_of_one_kind_add_up_over_its_models():
    density = np.zeros((10, 3))
    density[:, 2] = 0.05  # the plate is a little likelier than either bed
    scores = TerrainScores(
        ("S0", "S10", "TF"), density, np.zeros((10, 3)), np.zeros((10, 3))
    )
    rows = slice(0, 10)
    assert scores.likeliest(rows) == "TF"
    surfaces = {"S0": "rocky", "S10": "rocky", "TF": "flat"}
    assert scores.likeliest_group(rows, surfaces) == "rocky"
    sure = TerrainScores(scores.terrains, 100.0 * density, scores.error, scores.strain)
    assert sure.likeliest_group(rows, surfaces) == "flat"


def test_neighbouring_residuals_are_correlated(found):
    assert all(0.3 < rho < 1.0 for rho in found.rho.values())


def test_a_study_of_one_terrain_identifies_nothing():
    trials = {"TF": [push("TF", k) for k in range(3)]}
    fit = FitOptions(models=(GP_SE,), gp_points=40, draws=0)
    one = run_study(trials, StudyOptions(fit=fit, n_jobs=1), simulated=True)
    assert identify_study(one) is None


def test_accuracy_weights_every_kind_equally():
    confusion = Confusion(("rocky", "flat"), np.array([[12, 0], [1, 6]]))
    assert confusion.accuracy == pytest.approx((1.0 + 6 / 7) / 2)


def test_a_posterior_is_a_probability(study):
    trial = study.terrains["TF"].trials[0]
    experts = {
        name: Expert(result.folds[0].models[GP_SE].model.predict, 0.5)
        for name, result in study.terrains.items()
    }
    scores = score_trial(trial, experts)
    posterior = scores.posterior(slice(0, 100))
    assert posterior.sum() == pytest.approx(1.0)
    assert scores.terrains[int(posterior.argmax())] == "TF"


@pytest.mark.slow
def test_recorded_stones_decide_the_kind_of_a_terrain():
    # a plate called Sand, small stones called Beach and Gravel
    laws = {"Sand": ("TF", "none"), "Beach": ("S0", "small"), "Gravel": ("S0", "small")}
    trials = {
        name: [
            replace(push(law, k), terrain=name, stones=stones)
            for k in range(start, stop)
        ]
        for (name, (law, stones)), (start, stop) in zip(
            laws.items(), [(0, 3), (0, 3), (3, 6)], strict=True
        )
    }
    fit = FitOptions(models=(GP_SE,), gp_points=40, draws=0)
    study = run_study(trials, StudyOptions(fit=fit, n_jobs=1), simulated=True)
    assert study.kinds == {"Sand": "flat", "Beach": "small", "Gravel": "small"}
    levels = identify_study(study).by_density[100]
    assert levels["terrain"].names == ("Sand", "Beach", "Gravel")
    assert set(levels["stones"].names) == {"flat", "small"}
    assert set(levels["surface"].names) == {"flat", "rocky"}
    # equal terrains cannot be distinguished, but both count as small stones
    assert levels["terrain"].accuracy < 0.9
    assert levels["stones"].accuracy > 0.9
    content = json.loads(database_of(study, None, "2027-01-15T08:00:00Z", 1))
    kinds = {name: terrain["kind"] for name, terrain in content["terrains"].items()}
    assert kinds == study.kinds


@pytest.mark.shared_data
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_unknown_ground_is_rejected_and_known_ground_rarely(shared_data):
    trials = load_tables([shared_data / "rehearsal_trials.npz"])
    fit = FitOptions(models=(GP_SE,), draws=0)
    study = run_study(trials, StudyOptions(fit=fit), simulated=True)
    for size, exclusion in identify_study(study).exclusions.items():
        assert exclusion.false_alarms < 0.1, size
        assert exclusion.flat_among_rocky > 0.7, size
        assert exclusion.rocky_among_flat > 0.7, size


def test_the_database_predicts_the_force_of_its_terrain(study, path):
    known = load(path).terrain("S0")
    answer = known.predict(3.5, 0.05)
    assert answer.mean == pytest.approx(1.5 * 3.5, abs=0.6)
    assert 0.3 < answer.sd < 2.0
    # quantiles are kept to 0.1 mN
    assert answer.quantile(0.5) == pytest.approx(answer.mean, abs=1e-4)
    assert answer.quantile(0.05) < answer.mean < answer.quantile(0.95)


def test_the_database_samples_paths_with_held_out_correlation(path):
    for name in LEVELS:
        known = load(path).terrain(name)
        # 0.98 from one recorded sample to the next, 2 ms, with the level of a trial
        assert 0.02 < known.copula.tau_slide < 0.5
        forces = known.sample(np.full(300, 3.5), 0.05, 0.01, seed=1, count=200)
        near = np.mean([np.corrcoef(forces[:, k : k + 2].T)[0, 1] for k in range(299)])
        assert 0.7 < near < 1.0


def test_one_point_and_many_points_agree(path):
    known = load(path).terrain("TF")
    rng = np.random.default_rng(2)
    F_n, v_t = rng.uniform(-2.0, 20.0, 50), rng.uniform(0.0, 0.4, 50)
    many = known.predict(F_n, v_t)
    single = [known.predict(f, v) for f, v in zip(F_n, v_t, strict=True)]
    assert many.mean == pytest.approx([a.mean for a in single], abs=1e-9)
    assert many.sd == pytest.approx([a.sd for a in single], abs=1e-9)


def test_excess_traction_demand_is_a_risk(path):
    known = load(path).terrain("TF")
    median = known.predict(3.5, 0.005).median
    assert known.risk_in_motion(0.5 * median, 3.5) < 0.01
    assert known.risk_in_motion(median, 3.5) == pytest.approx(0.5, abs=1e-6)
    assert known.risk_in_motion(1.5 * median, 3.5) > 0.99


def test_interpolated_tables_are_close_to_the_model(study, path):
    trials = tuple(SampleTable.of([t]) for t in study.terrains["S0"].trials)
    no_axes = (np.zeros(0), np.zeros(0))
    training = training_set(TableTask("S0", trials, no_axes, study.options.fit))
    model = ModelFitter(training, study.options.fit).fit(GP_SE)
    F_n = np.linspace(2.6, 4.4, 37)
    v_t = np.linspace(0.021, 0.079, 37)
    exact = model.predict(F_n, v_t)
    tabled = load(path).terrain("S0").predict(F_n, v_t)
    assert np.abs(tabled.mean - exact.mean).max() < 0.05 * exact.sd.min()
    assert np.abs(tabled.sd / exact.sd - 1.0).max() < 0.05


def test_an_unknown_terrain_and_an_unknown_model_are_reported(path):
    database = load(path)
    with pytest.raises(SettingsError, match="no terrain 'moon'"):
        database.terrain("moon")
    with pytest.raises(SettingsError, match="no model 'oracle'"):
        database.terrain("S0").predict(1.0, 0.1, "oracle")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"version": 3}, "version: it is 3, and only 1.0 is read"),
        ({"terrains": {}}, "terrains: Dictionary should have at least 1 item"),
        (
            {"axes": {"F_n": [1.0, 0.0], "v_t": [0.1, 0.2]}},
            "axes.F_n: it does not increase",
        ),
        (
            {"axes": {"F_n": [0.0, float("nan")], "v_t": [0.1, 0.2]}},
            "axes.F_n.1: Input should be a finite",
        ),
        ({"default": "oracle"}, "lacks the model"),
        ({"terrains": {"S0": {"kind": "small"}}}, "terrains.S0.trials is missing"),
        ({"terrains": 3}, "not a terrain database: terrains: "),
    ],
)
def test_a_file_that_is_not_a_database_is_refused(path, tmp_path, change, words):
    content = json.loads(path.read_text()) | change
    bad = tmp_path / "bad.json"
    bad.write_text(json.dumps(content))
    with pytest.raises(SettingsError, match=words):
        load(bad)


@pytest.mark.parametrize("text", ["", "[]", "{}", "nonsense", "[" * 100_000])
def test_other_texts_are_refused(tmp_path, text):
    bad = tmp_path / "bad.json"
    bad.write_text(text)
    with pytest.raises(SettingsError, match="not a terrain database"):
        load(bad)


def test_a_missing_file_is_reported(tmp_path):
    with pytest.raises(SettingsError, match="cannot be read"):
        load(tmp_path / "gone.json")


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(-1e9, 1e9))
def test_a_distant_point_still_has_an_answer(F_n, v_t):
    rows = ((1.0, 2.0), (3.0, 4.0))
    table = Table((0.0, 10.0), (0.005, 0.2), (0.1, 0.9), (rows, rows))
    low, high = table.at(F_n, v_t)
    assert 1.0 <= low <= 4.0
    assert low == high


def kept(series):
    return prepare_trial(series, PrepareOptions())


def test_a_held_out_trial_is_recognised(path):
    database = load(path)
    for name in LEVELS:
        seen = recognise(kept(push(name, 77)), database)
        assert seen.best == name
        assert seen.posterior[seen.terrains.index(name)] > 0.9
        assert seen.least_error == name


def test_probabilities_are_given_over_time(path):
    seen = recognise(kept(push("TF", 78)), load(path), window=50)
    times = [moment.t for moment in seen.moments]
    assert times == sorted(times)
    assert len(times) >= 15
    assert all(sum(m.posterior) == pytest.approx(1.0) for m in seen.moments)


def test_unknown_ground_matches_no_known_terrain(path):
    seen = recognise(kept(push("moon", 1, ratio=4.0, spread=0.1)), load(path))
    assert seen.best == "none"


def test_the_surface_of_a_held_out_trial_is_classified(path):
    database = load(path)
    for name, surface in (("S0", "rocky"), ("TF", "flat"), ("Tf", "flat")):
        seen = recognise(kept(push(name, 79)), database)
        assert seen.surface == surface
        assert all((m.rocky > 0.5) == (surface == "rocky") for m in seen.moments)


def test_without_a_classifier_surfaces_are_classified_by_the_models(path, tmp_path):
    content = json.loads(path.read_text())
    del content["surfaces"]
    old = tmp_path / "old.json"
    old.write_text(json.dumps(content))
    seen = recognise(kept(push("Tf", 80)), load(old))
    assert seen.surface == "flat"
    assert {moment.rocky for moment in seen.moments} == {None}


def test_ground_smoother_than_all_known_stones_is_unknown(path, tmp_path):
    content = json.loads(path.read_text())
    content["terrains"] = {"S0": content["terrains"]["S0"]}
    stones = tmp_path / "stones.json"
    stones.write_text(json.dumps(content))
    seen = recognise(kept(push("S0", 81, spread=0.05)), load(stones))
    assert (seen.best, seen.surface) == ("none", "none")
    del content["terrains"]["S0"]["roughness"]
    stones.write_text(json.dumps(content))
    assert recognise(kept(push("S0", 81, spread=0.05)), load(stones)).best == "S0"


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c["surfaces"].update(models=3),
        lambda c: c.update(surfaces=[1]),
        lambda c: c["terrains"]["S0"].update(roughness={"50": float("nan")}),
    ],
)
def test_a_damaged_part_of_a_database_is_refused(path, tmp_path, change):
    content = json.loads(path.read_text())
    change(content)
    bad = tmp_path / "bad.json"
    bad.write_text(json.dumps(content))
    with pytest.raises(SettingsError, match="not a terrain database"):
        load(bad)


def test_a_single_terrain_with_stones_has_no_accuracy_of_stones(study, found):
    assert found.exact_stones(100) is None  # of a single terrain
    assert found.rocky == ("S0",)


def test_features_separate_flat_from_rocky_with_calibrated_probabilities(found):
    for size, levels in found.by_features.items():
        assert levels["surface"].accuracy > 0.95
        assert found.calibrations[size].error < 0.06


def test_a_trial_too_short_for_a_window_has_no_answer(path):
    short = push("TF", 1)
    cut = TractionSeries("TF", "short", *(c[:200] for c in _columns(short)))
    assert recognise(kept(cut), load(path), window=200) is None


def _columns(series):
    return series.t, series.v_t, series.F_n, series.F_t
