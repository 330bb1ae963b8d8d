"""Windows of trials are described, classified by surface, or rejected as unknown."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries
from analysis.terrains.classifier import (
    FLAT_GROUND,
    ROCKY_GROUND,
    SurfaceClassifier,
    fit_surfaces,
)
from analysis.terrains.evidence import (
    REFUSED,
    StudyEvidence,
    SurfaceProbability,
    TrialEvidence,
    calibration_of,
    exclusion_of,
    surface_probabilities,
)
from analysis.terrains.logistic import fit_balanced
from analysis.terrains.recognition import TerrainScores
from analysis.terrains.verdict import WindowLimits
from analysis.terrains.windows import (
    FEATURES,
    ROUGHNESS,
    WINDOWS,
    stretch_of,
    window_features,
    windows_of,
)


def record(rough=0.3, seed=0, rows=4000):
    """Return a trial that slides with pauses; F_t is a line in F_n and noise."""
    rng = np.random.default_rng(seed)
    t = 0.002 * np.arange(rows)
    v_t = np.where(np.sin(2.0 * t) > -0.5, 0.05 + 0.02 * np.sin(9.0 * t), 0.0)
    F_n = 4.0 + np.sin(1.3 * t + seed)
    noise = np.repeat(rng.normal(size=rows // 10), 10)
    series = TractionSeries(
        "S0", f"made-{seed}", t, v_t, F_n, 0.6 * F_n + rough * noise
    )
    return prepare_trial(series, PrepareOptions(smoothing=1))


def test_windows_are_contiguous_or_overlap_as_configured():
    assert [w.start for w in windows_of(230, 100)] == [0, 100]
    overlapping = windows_of(230, 100, overlap=True)
    assert [w.start for w in overlapping] == [0, 20, 40, 60, 80, 100, 120]
    assert {w.stop - w.start for w in overlapping} == {100}
    assert windows_of(99, 100) == []


def test_a_window_spans_the_pauses_between_its_kept_samples():
    trial = record()
    stretch = stretch_of(trial, slice(0, 200))
    assert stretch.is_kept.sum() == 200
    assert stretch.t.size > 250
    assert np.diff(stretch.t) == pytest.approx(0.01)
    assert stretch.F_t[stretch.is_kept] == pytest.approx(trial.F_t[:200])


def test_roughness_is_the_spread_about_a_line_in_the_load():
    trial = record()
    rows = slice(0, 100)
    line = np.polyfit(trial.F_n[rows], trial.F_t[rows], 1)
    off = trial.F_t[rows] - np.polyval(line, trial.F_n[rows])
    (features,) = window_features(trial, [rows])
    assert features[ROUGHNESS] == pytest.approx(math.log(off.std()))
    assert features[FEATURES.index("slope of F_t on F_n")] == pytest.approx(line[0])


def test_features_use_their_window_and_no_later_sample():
    trial = record()
    windows = windows_of(trial.kept, 100)[:2]
    last = trial.indices[windows[-1]][-1] + 1
    later = trial.smooth.F_t.copy()
    later[last:] += 50.0
    changed = replace(trial, smooth=replace(trial.smooth, F_t=later))
    assert window_features(changed, windows) == pytest.approx(
        window_features(trial, windows)
    )


def test_a_constant_window_has_finite_features():
    t = 0.002 * np.arange(2000)
    flat = np.full(2000, 0.05) + 1e-9 * np.arange(2000)
    series = TractionSeries("TF", "still", t, flat, flat, -flat)
    trial = prepare_trial(series, PrepareOptions(smoothing=1))
    features = window_features(trial, windows_of(trial.kept, 50))
    assert np.isfinite(features).all()


def drawn(seed=0, count=4000, shift=0.7):
    """Return normal features of two kinds; the means of two are 2 `shift` apart."""
    rng = np.random.default_rng(seed)
    is_rocky = rng.uniform(size=count) < 0.5
    X = rng.normal(size=(count, len(FEATURES)))
    X[:, :2] += np.where(is_rocky, shift, -shift)[:, None]
    return X, is_rocky


def fitted(X, is_rocky):
    return fit_balanced([(X[is_rocky], True), (X[~is_rocky], False)], 0.2)


def test_probabilities_match_the_generating_kinds():
    model = fitted(*drawn())
    X, is_rocky = drawn(seed=1)
    exact = 1.0 / (1.0 + np.exp(-2.0 * 0.7 * X[:, :2].sum(axis=1)))
    found = model.probabilities(X)
    assert np.abs(found - exact).mean() < 0.04
    assert ((found > 0.5) == is_rocky).mean() == pytest.approx(0.84, abs=0.02)


def test_the_fit_agrees_with_an_independent_program():
    from sklearn.linear_model import LogisticRegression

    X, is_rocky = drawn(count=500, shift=0.4)
    is_rocky[:200] = True  # far more of one kind
    model = fitted(X, is_rocky)
    z = np.clip((X - X.mean(axis=0)) / X.std(axis=0), -5.0, 5.0)
    share = is_rocky.mean()
    weight = np.where(is_rocky, 0.5 / share, 0.5 / (1.0 - share)) * 0.2
    other = LogisticRegression(C=1.0, tol=1e-10, max_iter=10_000)
    other.fit(np.column_stack([z, z * z]), is_rocky, sample_weight=weight)
    assert model.weights[1:] == pytest.approx(other.coef_[0], abs=1e-4)
    assert model.weights[0] == pytest.approx(other.intercept_[0], abs=1e-4)


def test_separable_kinds_have_finite_weights():
    X = np.linspace(-1.0, 1.0, 200)[:, None] * np.ones(len(FEATURES))
    model = fitted(1e6 * X, X[:, 0] > 0.0)
    assert np.isfinite(model.weights).all()
    assert ((model.probabilities(1e6 * X) > 0.5) == (X[:, 0] > 0.0)).all()


def labelled(rough=0.6, smooth=0.1, trials=4):
    made = [(record(rough, k), ROCKY_GROUND) for k in range(trials)]
    made += [(record(smooth, 100 + k), FLAT_GROUND) for k in range(trials)]
    return [
        (
            {
                s: window_features(t, windows_of(t.kept, s, overlap=True))
                for s in WINDOWS
            },
            surface,
        )
        for t, surface in made
    ]


@pytest.fixture(scope="module")
def classifier():
    return fit_surfaces(labelled())


@pytest.mark.parametrize("size", WINDOWS)
@pytest.mark.parametrize(("rough", "is_rocky"), [(0.6, True), (0.1, False)])
def test_windows_of_new_trials_are_classified(classifier, size, rough, is_rocky):
    trial = record(rough, seed=50)
    features = window_features(trial, windows_of(trial.kept, size))
    rocky = classifier.models[size].probabilities(features)
    assert ((rocky > 0.5) == is_rocky).all()


def test_with_one_kind_of_ground_there_is_no_classifier():
    assert fit_surfaces(labelled()[:4]) is None
    other = [(features, "sand") for features, _ in labelled()]
    assert fit_surfaces(other) is None


def test_a_stored_classifier_gives_the_same_answers(classifier):
    stored = SurfaceClassifier.from_dict(json.loads(json.dumps(classifier.to_dict())))
    X, _ = drawn(count=50)
    for size, model in classifier.models.items():
        assert stored.models[size].probabilities(X) == pytest.approx(
            model.probabilities(X), abs=1e-6
        )


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c.update(features=["other"]),
        lambda c: c["models"]["50"].update(weights=[1.0]),
        lambda c: c["models"]["50"].update(mean=[math.nan] * len(FEATURES)),
        lambda c: c["models"]["50"].update(scale=[0.0] * len(FEATURES)),
        lambda c: c["models"]["50"].update(mean=[1e308] * len(FEATURES)),
        lambda c: c["models"].update({"51": c["models"]["50"]}),
        lambda c: c.update(models=[1]),
    ],
)
def test_a_damaged_classifier_is_refused(classifier, change):
    content = json.loads(json.dumps(classifier.to_dict()))
    change(content)
    with pytest.raises((ValueError, TypeError)):
        SurfaceClassifier.from_dict(content)


def outcomes(rocky, surface, count):
    return [SurfaceProbability("S0", surface, rocky)] * count


def test_calibrated_probabilities_have_no_calibration_error():
    honest = [
        *outcomes(0.8, ROCKY_GROUND, 80),
        *outcomes(0.8, FLAT_GROUND, 20),
        *outcomes(0.2, ROCKY_GROUND, 20),
        *outcomes(0.2, FLAT_GROUND, 80),
    ]
    assert calibration_of(honest).error == pytest.approx(0.0, abs=1e-9)
    bold = [replace(p, rocky=0.99 if p.rocky > 0.5 else 0.01) for p in honest]
    result = calibration_of(bold)
    assert result.error == pytest.approx(0.19)
    assert result.sure == 1.0
    assert result.sure_and_wrong == pytest.approx(0.2)


def evidence(rough, number, densities, terrains=("S0", "TF"), strain=1.0):
    """Return a trial of which every sample has those log densities by terrain."""
    trial = record(rough, seed=number)
    n = trial.kept
    scores = TerrainScores(
        terrains,
        np.tile(np.array(densities), (n, 1)),
        np.ones((n, len(terrains))),
        np.tile(np.array([1.0, strain])[: len(terrains)], (n, 1)),
    )
    features = {s: window_features(trial, windows_of(n, s)) for s in WINDOWS}
    more = {s: window_features(trial, windows_of(n, s, overlap=True)) for s in WINDOWS}
    return TrialEvidence(number, scores, features, more)


@pytest.fixture(scope="module")
def study_evidence():
    return StudyEvidence(
        {
            "S0": [evidence(0.6, k, (0.0, -1.0), strain=30.0) for k in range(4)],
            "TF": [evidence(0.1, k, (-1.0, 0.0)) for k in range(4)],
        },
        {"S0": ROCKY_GROUND, "TF": FLAT_GROUND},
    )


@pytest.mark.parametrize("size", [50, 100])
def test_ground_of_unknown_kind_is_excluded(study_evidence, size):
    result = exclusion_of(study_evidence, size)
    # a plate fits the wide bands of stones: only its smoothness shows it
    assert result.flat_among_rocky > 0.95
    assert result.rocky_among_flat > 0.95
    assert result.false_alarms < 0.2  # by limits of three short trials


def test_held_out_windows_are_classified_by_other_trial_numbers(study_evidence):
    found = surface_probabilities(study_evidence, 100)
    windows = sum(
        len(trial.features[100])
        for trials in study_evidence.trials.values()
        for trial in trials
    )
    assert len(found) == windows
    assert all(p.answer == p.surface for p in found)


def test_limits_exclude_the_judged_trial(study_evidence):
    strange = evidence(0.01, 9, (0.0, -1.0))
    more = StudyEvidence(
        {**study_evidence.trials, "S0": [*study_evidence.trials["S0"], strange]},
        study_evidence.surface,
    )
    with_it, without = more.limits("S0", 100), more.limits("S0", 100, without=9)
    assert with_it.roughness < without.roughness - 1.0
    assert without == study_evidence.limits("S0", 100)


def made_up(name, number, rng):
    """Return a trial of 1000 samples that is rougher and more strained than others."""
    rough, strain = rng.normal(0.0, 0.3), np.exp(rng.normal(0.0, 0.4))
    n = 1000
    scores = TerrainScores(
        (name,), np.zeros((n, 1)), np.ones((n, 1)), strain * rng.chisquare(1, (n, 1))
    )

    def features(count):
        rows = np.zeros((count, len(FEATURES)))
        rows[:, ROUGHNESS] = rough + rng.normal(0.0, 0.3, count)
        return rows

    return TrialEvidence(
        number,
        scores,
        {s: features(len(windows_of(n, s))) for s in WINDOWS},
        {s: features(len(windows_of(n, s, overlap=True))) for s in WINDOWS},
    )


@pytest.mark.parametrize(
    ("surface", "trials"),
    [
        (ROCKY_GROUND, 10),
        (FLAT_GROUND, 10),
        pytest.param(ROCKY_GROUND, 40, marks=pytest.mark.slow),
        pytest.param(FLAT_GROUND, 40, marks=[pytest.mark.slow, pytest.mark.long]),
    ],
)
def test_the_rejection_rate_of_held_out_windows_is_the_allowed_one(surface, trials):
    shares = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        own = [made_up("S0", k, rng) for k in range(trials)]
        found = exclusion_of(StudyEvidence({"S0": own}, {"S0": surface}), 50)
        shares.append(found.false_alarms)
    assert np.mean(shares) == pytest.approx(REFUSED, abs=0.02)


def test_a_single_trial_rejects_some_of_its_own_windows():
    rng = np.random.default_rng(3)
    trial = made_up("S0", 0, rng)
    limits = StudyEvidence({"S0": [trial]}, {"S0": FLAT_GROUND}).limits("S0", 50)
    roughness = trial.overlapping[50][:, ROUGHNESS]
    strains = trial.strains("S0", 50, overlap=True)
    refused = [limits.exclude(*pair) for pair in zip(roughness, strains, strict=True)]
    assert 0.0 < np.mean(refused) <= REFUSED + 2 / len(refused)  # two limits, rounded


def test_surplus_trials_of_the_larger_kind_are_left_out(study_evidence):
    alone = evidence(0.1, 9, (0.0,), terrains=("TF",))
    more = StudyEvidence(
        {**study_evidence.trials, "TF": [*study_evidence.trials["TF"], alone]},
        study_evidence.surface,
    )
    here, there = exclusion_of(more, 50), exclusion_of(study_evidence, 50)
    assert here.flat_among_rocky == there.flat_among_rocky
    one_kind = StudyEvidence({"TF": [alone]}, {"TF": FLAT_GROUND})
    assert exclusion_of(one_kind, 50).flat_among_rocky is None


@pytest.mark.parametrize(
    ("roughness", "strain", "is_out"),
    [(-1.0, 1.0, False), (-2.1, 1.0, True), (-1.0, 3.1, True), (5.0, 0.0, False)],
)
def test_a_window_too_smooth_or_too_strained_is_rejected(roughness, strain, is_out):
    assert WindowLimits(-2.0, 3.0).exclude(roughness, strain) is is_out
    assert not WindowLimits().exclude(roughness, strain)
