"""Forces sampled along a path have known correlations, quantiles and signs."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.study.distribution import SHARES, normal_scores
from analysis.terrains.path_copula import (
    PathCopula,
    ScoredTrial,
    fit_copula,
    lag_correlation,
)
from analysis.terrains.table import TractionEstimates
from tests.analysis.terrains.export.databases import database

DT = 0.01
TRUE = PathCopula(level=0.3, tau_stick=0.05, tau_slide=0.25)


def stick_slip(rows):
    """Return a mask of the steps in which the foot sticks: four of ten."""
    return np.arange(rows) % 10 < 4


def drawn(copula, trials, rows, seed=1):
    is_stuck = stick_slip(rows)
    normals = np.random.default_rng(seed).standard_normal((trials, 1 + rows))
    stuck, slid = np.cumsum(is_stuck) * DT, np.cumsum(~is_stuck) * DT
    kept = ~is_stuck
    return [
        ScoredTrial(score[kept], stuck[kept], slid[kept])
        for score in copula.scores(is_stuck, DT, normals)
    ]


@pytest.mark.slow
def test_a_copula_is_recovered_from_its_scores():
    fitted = fit_copula(drawn(TRUE, 400, 800))
    assert fitted.level == pytest.approx(TRUE.level, abs=0.04)
    assert fitted.tau_stick == pytest.approx(TRUE.tau_stick, rel=0.1)
    assert fitted.tau_slide == pytest.approx(TRUE.tau_slide, rel=0.1)


@pytest.mark.parametrize("lag", [1, 6, 60])
def test_scores_have_the_correlations_of_their_copula(lag):
    scores = drawn(TRUE, 400, 800)
    trial = scores[0]
    apart = (part[lag:] - part[:-lag] for part in (trial.stuck, trial.slid))
    expected = TRUE.correlations(*apart).mean()
    assert lag_correlation(scores, lag) == pytest.approx(expected, abs=0.03)


def test_every_step_has_a_standard_normal_score():
    normals = np.random.default_rng(2).standard_normal((40_000, 31))
    scores = TRUE.scores(stick_slip(30), DT, normals)
    assert np.abs(scores.mean(axis=0)).max() < 0.03  # six standard errors
    assert np.abs(scores.std(axis=0) - 1.0).max() < 0.02


def test_halving_the_step_changes_no_correlation():
    normals = np.random.default_rng(3).standard_normal((20_000, 41))
    coarse = TRUE.scores(np.zeros(21, dtype=bool), 0.02, normals[:, :22])
    fine = TRUE.scores(np.zeros(40, dtype=bool), 0.01, normals)
    assert np.corrcoef(coarse[:, 0], coarse[:, 10])[0, 1] == pytest.approx(
        np.corrcoef(fine[:, 0], fine[:, 20])[0, 1], abs=0.03
    )


def test_one_trial_gives_no_copula():
    assert fit_copula(drawn(TRUE, 1, 800)) is None
    assert fit_copula([]) is None


@pytest.mark.parametrize("name", ["S0", "TF"])
def test_sampled_forces_have_the_quantiles_of_a_new_trial(name):
    known = database().terrain(name)
    forces = known.sample(np.full(3, 4.0), 0.05, DT, seed=4, count=40_000)
    assert forces.shape == (40_000, 3)
    expected = known.predict(4.0, 0.05).forces
    for step in forces.T:
        shares = [float(np.mean(step < force)) for force in expected]
        assert np.abs(np.subtract(shares, SHARES)).max() < 0.012


def test_a_seed_is_reproducible_and_a_generator_advances():
    known, path = database().terrain("S0"), (np.linspace(2.0, 6.0, 50), 0.05, DT)
    assert np.array_equal(known.sample(*path, seed=5), known.sample(*path, seed=5))
    rng = np.random.default_rng(5)
    first, second = known.sample(*path, seed=rng), known.sample(*path, seed=rng)
    assert np.array_equal(first, known.sample(*path, seed=5))
    assert not np.array_equal(first, second)


def test_a_path_outside_the_table_is_clamped_to_its_edge():
    known = database().terrain("S0")
    F_n, v_t = known.tables["gp_se_trial"].F_n[-1], known.tables["gp_se_trial"].v_t[-1]
    edge = known.sample([F_n] * 40, v_t, DT, seed=6)
    assert np.array_equal(known.sample([9.0 * F_n] * 40, 9.0 * v_t, DT, seed=6), edge)


def test_sampled_forces_keep_the_sign_of_their_quantiles():
    scores = np.array([[-9.0], [9.0]])
    forces = np.exp(normal_scores(SHARES))[
        :, None
    ]  # 1 % at 0.1: the slope ends below 0
    is_outside = np.array([False])
    above = TractionEstimates(SHARES, forces, is_outside).at_scores(scores)
    assert above[0, 0] == 0.0
    assert above[1, 0] > forces[-1, 0]
    below = TractionEstimates(SHARES, -forces[::-1], is_outside).at_scores(scores)
    assert below[0, 0] < -forces[-1, 0]
    assert below[1, 0] == 0.0
    both = TractionEstimates(SHARES, forces - 1.0, is_outside).at_scores(scores)
    assert both[0, 0] < 0.0 < both[1, 0]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"dt": 0.0}, "dt"),
        ({"dt": -0.01}, "dt"),
        ({"dt": np.nan}, "dt"),
        ({"dt": np.inf}, "dt"),
        ({"dt": "0.01"}, "dt"),
        ({"count": 0}, "count"),
        ({"count": 1.5}, "count"),
        ({"seed": -1}, "seed"),
        ({"seed": None}, "seed"),
        ({"F_n": [1.0, np.nan]}, "F_n"),
        ({"v_t": [0.1, np.inf]}, "v_t"),
        ({"v_t": [0.1, 0.1, 0.1]}, "one shape"),
    ],
)
def test_an_invalid_path_is_refused(change, word):
    sound = {"F_n": [1.0, 2.0], "v_t": [0.05, 0.06], "dt": DT, "seed": 1, "count": 2}
    known = database().terrain("S0")
    assert known.sample(**sound).shape == (2, 2)
    with pytest.raises(SettingsError, match=word):
        known.sample(**sound | change)


def test_a_terrain_without_a_copula_refuses_sampling():
    known = replace(database().terrain("S0"), copula=None)
    with pytest.raises(SettingsError, match="not known"):
        known.sample([3.0], [0.05], DT, seed=1)
