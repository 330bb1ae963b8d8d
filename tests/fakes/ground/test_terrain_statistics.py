"""Terrain and hand alone give the statistics of the model's reference runs.

The reference ran three independent sets of ten trials on eight terrains with a point
foot; so does the long form here. The reference numbers are random too, hence margins:
where a range over its sets is printed, the range over these sets must meet it; where a
mean is printed, the mean of these sets lies within three standard errors. Its twelve
varied runs bound the pooled values.
"""

import os
from dataclasses import dataclass

import numpy as np
import pytest

from analysis.data.events import Slip, find_slips
from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.study.crossval import FoldResult, plan_folds, run_fold
from analysis.study.models import GP_SE, TUSTIN, FitOptions
from analysis.study.tasks import run_tasks
from tests.fakes.point_foot import GROUNDS, PointFoot

SETS = (1, 2, 3)
TRIALS = range(1, 11)
STONES = tuple(name for name in GROUNDS if name not in {"TF", "Tf"})
# Mean over the reference's sets: kept samples per trial, slips per trial.
KEPT = dict(zip(GROUNDS, (964, 974, 888, 915, 865, 936, 1105, 1157), strict=True))
SLIPS = dict(zip(STONES, (6.6, 6.2, 6.5, 6.4, 5.6, 5.7), strict=True))
# Range over the reference's sets: mean absolute error on held-out trials [N].
MAE = {
    TUSTIN: {
        "S0": (2.67, 2.77),
        "S10": (2.57, 2.81),
        "S15": (2.31, 2.51),
        "B0": (2.52, 2.93),
        "B10": (2.42, 2.98),
        "B15": (2.36, 2.64),
        "TF": (0.41, 0.52),
        "Tf": (0.25, 0.41),
    },
    GP_SE: {
        "S0": (2.67, 2.73),
        "S10": (2.55, 2.66),
        "S15": (2.24, 2.37),
        "B0": (2.27, 2.85),
        "B10": (2.46, 2.79),
        "B15": (2.21, 2.39),
        "TF": (0.40, 0.50),
        "Tf": (0.26, 0.39),
    },
}

ROUNDING = 0.005  # N; the reference prints two decimals
# On these plates a Gaussian process errs 2 to 4 % less than any set of the reference.
SMOOTH = {(GP_SE, "TF"), (GP_SE, "Tf")}
SMOOTHER = pytest.mark.xfail(reason="plates are smoother", strict=True)


@dataclass(frozen=True)
class Run:
    """Trials of one terrain and set, and their slips."""

    trials: tuple[PreparedTrial, ...]
    slips: tuple[tuple[Slip, ...], ...]

    @property
    def all_slips(self):
        return [slip for found in self.slips for slip in found]

    def mean_kept(self):
        return np.mean([trial.kept for trial in self.trials])

    def slips_per_trial(self):
        return len(self.all_slips) / len(self.trials)


def push_across(terrain, seed, trials=TRIALS):
    """Simulate trials and find their slips."""
    prepared = tuple(
        prepare_trial(PointFoot(terrain, seed, trial).run(), PrepareOptions())
        for trial in trials
    )
    return Run(prepared, tuple(find_slips(trial.smooth) for trial in prepared))


def floors(slips):
    return np.array([slip.floor / slip.peak for slip in slips])


def bounces(slips):
    return np.mean([slip.has_bounce for slip in slips])


def column(run, name):
    return np.concatenate([getattr(trial, name) for trial in run.trials])


@pytest.fixture(scope="module")
def few():
    return {name: push_across(name, 1, range(1, 4)) for name in ("S0", "B15", "TF")}


@pytest.mark.slow
def test_a_slip_on_stones_releases_nearly_all_force(few):
    for name in ("S0", "B15"):
        slips = few[name].all_slips
        assert 3.0 <= few[name].slips_per_trial() <= 11.0
        assert np.median(floors(slips)) < 0.2
        assert (floors(slips) < 0.3).mean() > 0.85
        assert 0.2 < bounces(slips) < 0.9
        assert 7.0 < np.median([slip.peak for slip in slips]) < 15.0


@pytest.mark.slow
def test_a_foot_on_a_plate_neither_slips_nor_bounces(few):
    plate = few["TF"]
    assert plate.slips_per_trial() <= 0.4
    assert all(trial.shares.backward < 0.005 for trial in plate.trials)


@pytest.mark.slow
def test_most_of_a_trial_is_kept(few):
    for run in few.values():
        assert all(420 <= trial.kept <= 2000 for trial in run.trials)
        assert all(trial.shares.window_of_moving > 0.8 for trial in run.trials)


@pytest.mark.slow
def test_forces_are_those_of_a_light_foot(few):
    for name, friction in (("S0", 1.6), ("B15", 1.15), ("TF", 0.84)):
        F_n, F_t = column(few[name], "F_n"), column(few[name], "F_t")
        assert 2.0 < F_n.mean() < 6.0
        pressed = F_n > 1.0
        ratio = np.median(F_t[pressed] / F_n[pressed])
        # three trials: their spread is a quarter on stones
        assert ratio == pytest.approx(friction, rel=0.1 if name == "TF" else 0.4)


def test_a_point_foot_repeats_itself_bit_for_bit():
    def start(trial):
        foot = PointFoot("S0", 1, trial)
        for _ in range(600):
            foot.cycle()
        return np.array(foot.rows).tobytes()

    first = start(2)
    start(3)
    assert start(2) == first


@pytest.fixture(scope="module")
def runs():
    tasks = [(name, seed) for name in GROUNDS for seed in SETS]
    found = run_tasks(_push_across, tasks, os.cpu_count() or 1)
    return dict(zip(tasks, found, strict=True))


def _push_across(task):
    return push_across(*task)


@pytest.fixture(scope="module")
def folds(runs) -> dict[int, list[FoldResult]]:
    found = {}
    for seed in SETS:
        prepared = {name: runs[name, seed].trials for name in GROUNDS}
        tasks = plan_folds(prepared, FitOptions(models=(TUSTIN, GP_SE)))[0]
        found[seed] = run_tasks(run_fold, tasks, os.cpu_count() or 1)
    return found


def pooled(runs):
    """Return the slips of all stone terrains, one list per set."""
    return [[s for name in STONES for s in runs[name, k].all_slips] for k in SETS]


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", GROUNDS)
def test_as_many_samples_are_kept_as_in_the_reference(runs, name):
    kept = [runs[name, seed].mean_kept() for seed in SETS]
    # a trial's count spreads by 25 %; 30 trials against 30: 6.5 % at one sigma
    assert np.mean(kept) == pytest.approx(KEPT[name], rel=0.19)
    smallest = min(t.kept for seed in SETS for t in runs[name, seed].trials)
    assert smallest >= 421  # the smallest trial of the reference's twelve runs


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", STONES)
def test_a_foot_slips_as_often_as_in_the_reference(runs, name):
    slips = [runs[name, seed].slips_per_trial() for seed in SETS]
    # a trial has 6 +- 1.7; 30 trials against 30: 0.44 at one sigma
    assert np.mean(slips) == pytest.approx(SLIPS[name], abs=1.3)
    assert all(4.4 <= count <= 8.3 for count in slips)


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["TF", "Tf"])
def test_plates_have_no_slips(runs, name):
    assert all(runs[name, seed].slips_per_trial() <= 0.2 for seed in SETS)


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_slips_end_near_zero_force_as_in_the_reference(runs):
    sets = [floors(slips) for slips in pooled(runs)]
    assert 0.063 <= np.mean([np.median(found) for found in sets]) <= 0.102
    assert np.mean([(found < 0.3).mean() for found in sets]) >= 0.966


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_slips_bounce_back_as_often_as_in_the_reference(runs):
    assert all(0.347 <= bounces(slips) <= 0.656 for slips in pooled(runs))


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("model", "name"),
    [
        pytest.param(model, name, marks=SMOOTHER if (model, name) in SMOOTH else [])
        for model in (TUSTIN, GP_SE)
        for name in GROUNDS
    ],
)
def test_model_errors_agree_with_the_reference(folds, model, name):
    errors = [
        np.mean([f.models[model].score.mae for f in folds[seed] if f.terrain == name])
        for seed in SETS
    ]
    low, high = MAE[model][name]
    assert min(errors) <= high + ROUNDING
    assert max(errors) >= low - ROUNDING
