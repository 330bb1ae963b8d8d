"""Transfer from other terrains about one, on drawn terrains that are alike or not."""

import numpy as np
import pytest

from analysis.data.samples import SampleTable
from analysis.data.series import TractionSeries
from analysis.gp.ground import Ground
from analysis.study.all_ground import TerrainRows, fit_all_ground, rows_of
from analysis.study.metrics import score
from analysis.study.models import FitOptions
from analysis.study.relatives import (
    RelativesTask,
    grounds_of,
    plan_relatives,
    run_relatives,
)
from analysis.study.store import TYPES, decode, encode

OPTIONS = FitOptions(gp_points=60, draws=0, models=("gp_se_trial",))
STONES = (Ground("S0", "small", 0.0), Ground("S15", "small", 15.0))
NEW = Ground("S10", "small", 10.0)
PLATE = Ground("TF", "flat", 0.0)


def drawn(rng, level=0.0, rows=40, noise=0.25):
    """Return a trial whose force has a skewed noise around one form."""
    F_n, v_t = rng.uniform(1.0, 8.0, rows), rng.uniform(0.005, 0.2, rows)
    form = 1.0 + 0.7 * F_n + 2.0 * np.exp(-v_t / 0.05) + level
    return SampleTable(F_n, v_t, form * np.exp(rng.normal(0.0, noise, rows)))


def terrain(ground, trials=5, level=0.0, seed=0, noise=0.25):
    rng = np.random.default_rng(seed)
    effects = rng.normal(0.0, 0.2, trials)
    samples = tuple(drawn(rng, level + effect, noise=noise) for effect in effects)
    return TerrainRows(ground, samples)


KNOWN = tuple(terrain(ground, 4, seed=k) for k, ground in enumerate(STONES))


def task(own, others):
    three = TerrainRows(own.ground, own.trials[:3])
    return RelativesTask(three, own.trials[3:], (3, 4), others, OPTIONS)


@pytest.fixture(scope="module")
def alike():
    return run_relatives(task(terrain(NEW, seed=7), KNOWN))


def nlpd(scores):
    return float(np.mean([s.nlpd for s in scores]))


@pytest.mark.slow
def test_terrains_of_one_form_predict_as_well_as_own_trials(alike):
    assert nlpd(alike.joint) < nlpd(alike.alone) + 0.05
    assert nlpd(alike.unseen) < nlpd(alike.alone) + 0.1
    assert (alike.terrain, alike.relatives, alike.tested) == (
        "S10",
        ("S0", "S15"),
        (3, 4),
    )


def test_an_incline_never_recorded_is_covered_by_its_band(alike):
    # four fifths to all of 100 samples; five trials leave no closer statement
    assert len(alike.unseen) == 5
    assert 0.8 < np.mean([s.coverage90 for s in alike.unseen]) < 1.0


def test_skewed_forces_are_warped_for_all_ground(alike):
    assert alike.c is not None


def test_force_in_slip_is_not_below_zero_where_no_sample_is(alike):
    assert alike.dissipation.measured == 0.0
    assert alike.dissipation.latent < 1e-3
    assert alike.dissipation.predicted < 0.02


def test_enough_relatives_are_used_and_one_is_few(alike):
    assert (alike.has_few, alike.uses_relatives) == (False, True)
    assert alike.chosen == alike.joint


@pytest.mark.slow
def test_a_lone_plate_has_no_relatives_and_relies_on_its_own_trials():
    plate = terrain(PLATE, level=-3.0, seed=9, noise=0.02)
    outcome = run_relatives(task(plate, KNOWN))
    assert (outcome.relatives, outcome.has_few) == ((), True)
    assert outcome.uses_relatives is (outcome.inner_joint < outcome.inner_alone + 0.05)
    assert nlpd(outcome.chosen) <= nlpd(outcome.alone) + 0.05


def test_an_outcome_comes_back_from_the_disk(alike):
    assert decode(encode(alike), TYPES) == alike


def test_a_ground_never_recorded_is_less_sure_than_a_known_one():
    model = fit_all_ground(KNOWN)
    inputs = np.array([[4.0, 0.05]])
    known, unknown, plate = (
        float(model.predict(g, inputs).within[0]) for g in (STONES[0], NEW, PLATE)
    )
    assert known < unknown
    assert float(model.predict(PLATE, inputs).sd[0]) > 0.0
    assert plate > 0.0


def test_rows_of_trials_stand_together_with_their_ground():
    rows = rows_of([KNOWN[0].thinned(10), KNOWN[1].thinned(15)], None)
    assert rows.ground.tolist() == [0] * 8 + [1] * 12
    assert rows.trial.tolist() == np.repeat(np.arange(8), [2] * 4 + [3] * 4).tolist()
    assert rows.freedom == (6, 0)


def series(name, stones="", incline=None):
    t = 0.002 * np.arange(3)
    return TractionSeries(name, name, t, t, t + 1.0, t, stones, incline)


def test_grounds_need_stones_and_incline():
    grounds = grounds_of(
        {
            "S10": [series("S10")],
            "Beach": [series("Beach", "big", 4.0), series("Beach", "big", 6.0)],
            "Sand": [series("Sand", "none")],
            "Moor": [series("Moor", "", 3.0)],
        }
    )
    assert grounds == {
        "S10": Ground("S10", "small", 10.0),
        "Beach": Ground("Beach", "big", 5.0),
    }


def test_three_trials_are_known_and_no_fewer_than_four_compared(slice_trials):
    from analysis.data.prepare import PrepareOptions, prepare_trial

    prepared = {
        name: [prepare_trial(s, PrepareOptions()) for s in group]
        for name, group in slice_trials.items()
    }
    grounds = grounds_of(slice_trials)
    assert plan_relatives(prepared, grounds, OPTIONS) == []  # three trials each
    prepared["S0"] = [*prepared["S0"], *prepared["B0"]]
    (only,) = plan_relatives(prepared, grounds, OPTIONS)
    assert len(only.own.trials) == len(only.tested) == 3
    assert {rows.ground.terrain for rows in only.others} == {"B0", "TF"}
    other = plan_relatives(prepared, grounds, OPTIONS, draw=1)[0]
    assert sorted([*only.numbers, *other.numbers]) != sorted(2 * only.numbers)
    assert plan_relatives(prepared, grounds, FitOptions()) == []


def test_scores_are_those_of_the_predicted_distribution():
    model = fit_all_ground(KNOWN)
    table = KNOWN[0].trials[0]
    told = score(table.F_t, model.predict(STONES[0], table.inputs))
    assert told.nlpd == pytest.approx(
        -np.mean(model.predict(STONES[0], table.inputs).log_density(table.F_t))
    )
