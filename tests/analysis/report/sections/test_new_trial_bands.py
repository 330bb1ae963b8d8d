import json

import numpy as np
import pytest

from analysis.report.findings import plain_findings
from analysis.report.results import compute_results
from analysis.report.sections.beyond_paper.new_trial import (
    caption_new_trial,
    draw_new_trial,
    new_trial_tables,
)
from analysis.report.sections.beyond_paper.new_trial_bands import (
    caption_shares,
    conformal_reaches,
    draw_shares,
    held_out_shares,
    oracle_band,
)
from analysis.study.fits import to_plain
from analysis.study.models import GP_SE, GP_SE_TRIAL, FitOptions
from analysis.study.study import StudyOptions, run_study
from analysis.study.trial_components import LEAST_GAIN

pytestmark = pytest.mark.slow  # a whole study


def reach_of(others, nominal):
    """Return the radius for a new trial, independent of its own scores."""
    return conformal_reaches([np.full(3, 1e6), *others], nominal)[0]


def test_a_conformal_radius_has_one_weight_at_infinity():
    scores = [np.array([float(k)]) for k in range(1, 10)]  # nine trials
    # the k-th smallest of nine scores covers a share of k/10
    assert reach_of(scores, 0.5) == 5.0
    assert reach_of(scores, 0.8) == 8.0
    assert reach_of(scores, 0.9) == 9.0


def test_too_few_trials_cannot_give_the_nominal_coverage():
    scores = [np.array([float(k)]) for k in range(9)]
    assert reach_of(scores, 0.95) == np.inf


def test_long_and_short_trials_have_equal_weight():
    short, long = np.full(1, 5.0), np.full(1000, 1.0)
    assert reach_of([short, long, long], 0.5) == 1.0
    assert reach_of([short, long, long], 0.7) == 5.0


@pytest.mark.parametrize("nominal", [0.5, 0.8, 0.9])
@pytest.mark.parametrize("trials", [2, 7, 15])
def test_a_conformal_radius_uses_other_samples_weighted_by_trial(trials, nominal):
    rng = np.random.default_rng(trials)
    scores = [np.abs(rng.normal(size=rng.integers(1, 30))) for _ in range(trials)]
    for k, reach in enumerate(conformal_reaches(scores, nominal)):
        others = [*scores[:k], *scores[k + 1 :]]
        at = np.sort(np.concatenate(others))
        held = np.mean([[np.mean(s <= x) for x in at] for s in others], axis=0)
        is_reached = held * (trials - 1) / trials >= nominal - 1e-9
        assert reach == (at[np.argmax(is_reached)] if is_reached.any() else np.inf)


@pytest.mark.parametrize(("spread", "low", "high"), [(1.0, 0.9, 1.2), (2.0, 1.7, 2.6)])
def test_an_oracle_band_is_as_wide_as_needed(spread, low, high):
    from scipy.special import ndtr

    rng = np.random.default_rng(0)
    shares = [ndtr(spread * rng.normal(size=200)) for _ in range(30)]
    band = oracle_band(shares, 0.8)
    assert low < band.width < high
    assert band.coverage == pytest.approx(0.8 * 31 / 30, abs=0.04)


@pytest.fixture(scope="module")
def results(make_series, moving):
    trials = {
        name: [make_series(moving, seed=k + shift) for k in range(4)]
        for name, shift in (("S0", 0), ("TF", 10))
    }
    fit = FitOptions(gp_points=40, models=(GP_SE, GP_SE_TRIAL), draws=0)
    study = run_study(trials, StudyOptions(fit=fit, n_jobs=1), simulated=True)
    return compute_results(study)


def test_variance_shares_of_a_terrain_add_up(results):
    assert [share.terrain for share in results.of(held_out_shares)] == ["S0", "TF"]
    for share in results.of(held_out_shares):
        assert share.trials == 4
        assert share.density.sum() == pytest.approx(10.0)


def test_components_of_every_terrain_are_in_the_study(results):
    for result in results.study.terrains.values():
        assert result.components is not None
        assert result.components.trials == 4


def test_the_report_states_family_value_and_oracle(results):
    families, worth, oracle = new_trial_tables(results)
    assert [row[0] for row in families.rows] == ["S0", "TF"]
    assert [row[0] for row in oracle.rows] == ["S0", "S0", "TF", "TF"]
    for row, result in zip(worth.rows, results.study.terrains.values(), strict=True):
        is_distinguishable = result.components.gain >= LEAST_GAIN
        assert ("not distinguishable" in row[1]) != is_distinguishable


@pytest.mark.parametrize("draw", [draw_shares, draw_new_trial])
def test_figures_of_a_new_trial_have_a_panel_per_terrain(results, draw):
    figure = draw(results)
    titles = [ax.get_title(loc="left") for ax in figure.axes if ax.get_visible()]
    assert [title[:2] for title in titles if title] == ["S0", "TF"]


@pytest.mark.parametrize("caption", [caption_shares, caption_new_trial])
def test_captions_of_a_new_trial_have_numbers(results, caption):
    assert any(character.isdigit() for character in caption(results))


def test_shares_are_valid_json(results):
    plain = json.loads(json.dumps(to_plain(plain_findings(results)), allow_nan=False))
    assert set(plain["new_trial"]) == {"S0", "TF"}
    assert len(plain["new_trial"]["S0"]["density"]) == 10


def test_without_a_new_trial_model_the_report_omits_it(small_study):
    results = compute_results(small_study)
    assert results.of(held_out_shares) == []
    assert new_trial_tables(results) == []
    assert draw_shares(results) is None
    assert draw_new_trial(results) is None
