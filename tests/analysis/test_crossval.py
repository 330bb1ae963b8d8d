from dataclasses import replace

import numpy as np
import pytest

from analysis.crossval import choose_rows, pair_trials, plan_folds, run_fold
from analysis.metrics import mean_absolute_error
from analysis.models import GP_SE, TUSTIN, FitOptions
from analysis.prepare import PrepareOptions, prepare


@pytest.fixture
def trials(slice_trials):
    return {
        terrain: [prepare(series, PrepareOptions()) for series in recorded]
        for terrain, recorded in slice_trials.items()
    }


def test_a_fold_is_trained_on_every_trial_but_its_own(trials):
    tasks, notes = plan_folds(trials, FitOptions())
    assert len(tasks) == 9
    assert notes == []
    task = next(t for t in tasks if (t.terrain, t.fold) == ("B0", 1))
    own = trials["B0"]
    np.testing.assert_array_equal(task.own.F_t, own[1].F_t)
    expected = np.concatenate([own[0].F_t, own[2].F_t])
    np.testing.assert_array_equal(task.training.F_t, expected)


def test_model_of_fold_k_meets_trial_k_of_the_other_terrains(trials):
    tasks, _ = plan_folds(trials, FitOptions())
    task = next(t for t in tasks if (t.terrain, t.fold) == ("B0", 2))
    assert set(task.others) == {"S0", "TF"}
    (rows,) = task.others["TF"]
    np.testing.assert_array_equal(rows.F_t, trials["TF"][2].F_t)


@pytest.mark.parametrize(
    ("models", "tests", "pairs"),
    [
        ([0, 1], [0, 1], [(0, 0), (1, 1)]),
        ([0, 1, 2], [0, 1], [(0, 0), (1, 1), (2, 0)]),
        ([0, 1], [0, 1, 2, 3], [(0, 0), (0, 2), (1, 1), (1, 3)]),
        ([0, 2], [0, 1], [(0, 0), (2, 0), (2, 1)]),
        ([0, 1], [0], [(0, 0), (1, 0)]),
        ([], [0], []),
        ([0], [], []),
    ],
)
def test_trials_pair_by_number_and_wrap_where_they_cannot(models, tests, pairs):
    assert pair_trials(models, tests) == pairs


def test_chosen_rows_are_distinct_and_depend_on_seed_terrain_and_fold(trials):
    tasks, _ = plan_folds(trials, FitOptions(seed=3))
    task = tasks[0]
    rows = choose_rows(task)
    assert len(set(rows.tolist())) == 300
    assert rows.max() < task.training.count
    np.testing.assert_array_equal(rows, choose_rows(task))
    others = [
        replace(task, fold=1),
        replace(task, terrain="TF"),
        replace(task, options=FitOptions(seed=4)),
    ]
    for other in others:
        assert not np.array_equal(rows, choose_rows(other))


def test_few_training_rows_are_all_taken(trials):
    tasks, _ = plan_folds(trials, FitOptions(gp_points=100_000))
    assert choose_rows(tasks[0]).size == tasks[0].training.count


def test_scores_of_a_fold_are_those_of_its_model_on_the_unseen_trial(trials):
    tasks, _ = plan_folds(trials, FitOptions())
    task = tasks[0]
    result = run_fold(task)
    for name in (TUSTIN, GP_SE):
        fold = result.models[name]
        own = fold.model.mean(task.own.F_n, task.own.v_t)
        assert fold.score.mae == mean_absolute_error(task.own.F_t, own)
        (rows,) = task.others["TF"]
        there = fold.model.mean(rows.F_n, rows.v_t)
        assert fold.cross["TF"] == (mean_absolute_error(rows.F_t, there),)


def test_constant_for_scale_is_the_median_of_the_training_rows(trials):
    tasks, _ = plan_folds(trials, FitOptions())
    task = tasks[4]
    median = np.median(task.training.F_t)
    expected = np.mean(np.abs(task.own.F_t - median))
    assert run_fold(task).constant_mae == pytest.approx(expected)


def test_training_error_of_tustin_is_that_of_its_fit(trials):
    tasks, _ = plan_folds(trials, FitOptions())
    fold = run_fold(tasks[0]).models[TUSTIN]
    assert fold.train_rmse == pytest.approx(fold.model.fit.rmse, rel=1e-9)


def test_one_trial_cannot_be_left_out_and_the_notes_say_so(trials):
    tasks, notes = plan_folds(
        {"S0": trials["S0"][:1], "TF": trials["TF"]}, FitOptions()
    )
    assert {task.terrain for task in tasks} == {"TF"}
    assert any("S0: 1 trial" in note for note in notes)


def test_two_trials_are_enough(trials):
    tasks, notes = plan_folds({"S0": trials["S0"][:2]}, FitOptions())
    assert len(tasks) == 2
    assert notes == []
