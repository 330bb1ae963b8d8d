"""A study's folds raced against scikit-learn: four Gaussian processes, predictions.

Both get the same selected rows and the same Tustin curve; scikit-learn is given the
starts, while choosing them counts for this project. Both predict the same rows: means
for the training rows and the trials of all other terrains, mean and standard deviation
for the held-out trial. They take turns, fold by fold. The processor time of one thread
each is measured, so that other programs do not count.
"""

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.samples import SampleTable, TrainingSet
from analysis.data.series import Array
from analysis.study.crossval import FoldTask, choose_rows, plan_folds, run_fold
from analysis.study.models import (
    GP_NN,
    GP_NN_TUSTIN,
    GP_SE,
    GP_SE_TUSTIN,
    TUSTIN,
    FitOptions,
    ModelFitter,
)
from analysis.tables.loading import load_tables
from analysis.tustin.model import TustinFit
from benchmarks.peer_sklearn import fit_sklearn, three_starts

SLICE = Path(__file__).parents[1] / "tests" / "data" / "rehearsal_slice.npz"
_GOAL = 4.0
# model: (part in `benchmarks.peer_sklearn`, whether the mean is a Tustin curve)
FITS = {
    GP_SE: ("SE fit", False),
    GP_NN: ("NN fit", False),
    GP_SE_TUSTIN: ("SE fit", True),
    GP_NN_TUSTIN: ("NN fit", True),
}


class FoldRows(NamedTuple):
    """Training data of the Gaussian processes of one fold.

    Attributes:
        curve: Tustin fit to all training rows.
        centre: means of the selected rows' inputs, shape (2,).
        scale: their standard deviations, shape (2,).
        X: standardised inputs of the selected rows, shape (n, 2).
        outputs: F_t [N] of the selected rows minus their mean or the curve, shape (n,),
            by name of the model.
    """

    curve: TustinFit
    centre: Array
    scale: Array
    X: Array
    outputs: dict[str, Array]

    def standardised(self, rows: SampleTable) -> Array:
        """Return the inputs of other rows in the same scaling, shape (m, 2)."""
        return (rows.inputs - self.centre) / self.scale


class FoldTimes(NamedTuple):
    """Times and likelihoods of one fold.

    Attributes:
        own_s: processor time of this project [s].
        sklearn_s: scikit-learn's processor time [s].
        reached: log likelihoods of each fit, (this project's, scikit-learn's).
    """

    own_s: float
    sklearn_s: float
    reached: list[tuple[float, float]]


def race(
    path: Path, share: float = 1.0, *, rounds: int = 1, is_whole: bool = True
) -> dict[str, Any]:
    """Race all folds in turn; return times and likelihoods of both sides.

    Args:
        path: npz file of trials.
        share: share of the folds that both run, drawn with a fixed seed; the other
            folds are run by this project alone.
        rounds: repeats of every fold; medians count.
        is_whole: run every fold; else only the first of every terrain.
    """
    tasks = folds_of(path)
    run_fold(tasks[0])  # warm-up: imports and caches
    if not is_whole:
        tasks = [task for task in tasks if task.fold == 0]
    count = max(1, round(share * len(tasks)))
    drawn = np.random.default_rng(0).choice(len(tasks), count, replace=False)
    laps = [lap(tasks[k], rounds) for k in sorted(drawn.tolist())]
    others = [task for k, task in enumerate(tasks) if k not in drawn]
    alone, _ = timed(lambda: [run_fold(task) for task in others])
    return report(laps, alone, len(tasks)) | {
        "notes": [*likelihood_comparison(laps), *time_breakdown(tasks[0])]
    }


def folds_of(path: Path) -> list[FoldTask]:
    """Return every fold of the trials in a file."""
    trials = {
        name: [prepare_trial(series, PrepareOptions()) for series in group]
        for name, group in load_tables([path]).items()
    }
    return plan_folds(trials, FitOptions())[0]


def fold_rows(task: FoldTask) -> FoldRows:
    """Return the training data of the Gaussian processes of one fold."""
    training = TrainingSet(task.training, task.lengths, choose_rows(task))
    curve = ModelFitter(training, task.options).curve()
    subset = training.subset
    plain = subset.F_t - subset.F_t.mean()
    residual = subset.F_t - curve.mean(subset.F_n, subset.v_t)
    centre, scale = subset.inputs.mean(axis=0), subset.inputs.std(axis=0)
    return FoldRows(
        curve=curve,
        centre=centre,
        scale=scale,
        X=(subset.inputs - centre) / scale,
        outputs={
            name: residual if has_curve else plain
            for name, (_, has_curve) in FITS.items()
        },
    )


def lap(task: FoldTask, rounds: int) -> FoldTimes:
    """Run one fold on both sides in turn; return times and likelihoods."""
    own_s, sklearn_s, models, likelihoods = [], [], {}, {}
    starts = starts_of(task)
    for _ in range(rounds):
        seconds, models = timed(lambda: run_fold(task).models)
        own_s.append(seconds)
        seconds, likelihoods = timed(lambda: run_sklearn(task, starts))
        sklearn_s.append(seconds)
    reached = [(models[name].model.process.lml, likelihoods[name]) for name in FITS]
    return FoldTimes(statistics.median(own_s), statistics.median(sklearn_s), reached)


def report(laps: list[FoldTimes], alone: float, folds: int) -> dict[str, Any]:
    """Return the figures of a race; `alone`: time of the folds not raced [s]."""
    own_s, sklearn_s = (
        sum(lap.own_s for lap in laps),
        sum(lap.sklearn_s for lap in laps),
    )
    own, sklearn = likelihoods_of(laps)
    part = f"study, {own.size} fits with predictions"
    if len(laps) < folds:
        part += (
            f" in {len(laps)} of {folds} folds drawn at random, the other "
            f"{folds - len(laps)} by this project alone in {1e3 * alone:.0f} ms"
        )
    return {
        "part": part,
        "ours_ms": 1e3 * own_s,
        "other_ms": 1e3 * sklearn_s,
        "ratio": sklearn_s / own_s,
        "goal": _GOAL,
        "reached": float(own.sum()),
        "other_reached": float(sklearn.sum()),
    }


def likelihood_comparison(laps: list[FoldTimes]) -> list[str]:
    """Return a line with the number of fits in which each side is more likely."""
    own, sklearn = likelihoods_of(laps)
    worse = int(np.count_nonzero(own < sklearn - 1e-3))
    better = int(np.count_nonzero(own > sklearn + 1e-3))
    return [
        f"likelihood lower than scikit-learn's by more than 1e-3: {worse} of "
        f"{own.size} fits; higher: {better}"
    ]


def likelihoods_of(laps: list[FoldTimes]) -> tuple[np.ndarray, np.ndarray]:
    """Return this project's and scikit-learn's likelihoods, one per fit."""
    pairs = [pair for lap in laps for pair in lap.reached]
    own, sklearn = (np.array(column) for column in zip(*pairs, strict=True))
    return own, sklearn


def starts_of(task: FoldTask) -> dict[str, tuple[Array, ...]]:
    """Return the starts of the searches of one fold, by name of the model."""
    rows = fold_rows(task)
    return {n: three_starts(FITS[n][0], rows.X, r) for n, r in rows.outputs.items()}


def run_sklearn(
    task: FoldTask, starts: dict[str, tuple[Array, ...]]
) -> dict[str, float]:
    """Fit and predict one fold with scikit-learn; return the log likelihoods."""
    rows = fold_rows(task)
    foreign = [trial for trials in task.others.values() for trial in trials]
    tested = rows.standardised(SampleTable.joined([task.training, *foreign]))
    held_out = rows.standardised(SampleTable.joined(task.test_trials))
    likelihoods = {}
    for name, (part, _) in FITS.items():
        model: Any = fit_sklearn(part, rows.X, rows.outputs[name], starts[name])
        model.predict(tested)
        model.predict(held_out, return_std=True)
        likelihoods[name] = float(model.log_marginal_likelihood_value_)
    return likelihoods


def time_breakdown(task: FoldTask) -> list[str]:
    """Return a line with the processor time of the parts of one fold."""
    training = TrainingSet(task.training, task.lengths, choose_rows(task))
    fitter = ModelFitter(training, task.options)
    cpu_s, _ = timed(lambda: fitter.fit(TUSTIN))
    parts = [f"Tustin of {task.training.count} rows {1e3 * cpu_s:.0f} ms"]
    foreign = [rows for trials in task.others.values() for rows in trials]
    tested = SampleTable.joined([task.training, *foreign])
    held_out = SampleTable.joined(task.test_trials)
    predicting = 0.0
    for name in FITS:
        cpu_s, model = timed(lambda name=name: fitter.fit(name))
        starts = model.process.starts
        count = sum(start.evaluations for start in starts)
        parts.append(f"{name} {1e3 * cpu_s:.0f} ms ({count} evaluations)")
        predicting += timed(lambda m=model: m.mean(tested.F_n, tested.v_t))[0]
        predicting += timed(lambda m=model: m.predict(held_out.F_n, held_out.v_t))[0]
    parts.append(f"predictions of {tested.count} rows {1e3 * predicting:.0f} ms")
    return ["one fold: " + ", ".join(parts)]


def timed(function: Callable[[], Any]) -> tuple[float, Any]:
    """Call `function`; return (processor time [s], result)."""
    before = time.process_time()
    result = function()
    return time.process_time() - before, result
