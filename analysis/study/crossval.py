"""Leave-one-trial-out cross-validation.

Samples of one trial are correlated over tenths of a second, so a fold is a whole trial.
A terrain has at most 50 folds: of more trials each fold leaves out a group, trials k,
k + 50, k + 100 and so on, and scores them one by one. The function of a model comes
from 300 rows of the others in either case, and groups of neighbours would leave out
whole sessions. The model of fold k of a terrain is also tested on trial k of every
other terrain.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.errors import TractionError
from analysis.data.prepare import PreparedTrial
from analysis.data.samples import SampleTable, TrainingSet
from analysis.data.series import Indices
from analysis.study.metrics import Score, score
from analysis.study.models import TITLES, FitOptions, FittedModel, ModelFitter

MOST_FOLDS = 50  # per terrain
_MOST_ROWS = 50_000  # training rows for the training error; at most twice as many
Prepared = Mapping[str, Sequence[PreparedTrial]]
Tables = Mapping[str, Mapping[int, SampleTable]]  # by terrain and number of the trial


@dataclass(frozen=True, slots=True)
class FoldTask:
    """Input of one fold; `run_fold` is a pure function of it.

    Tasks share the tables of the trials, so that memory grows linearly with the trials.

    Attributes:
        terrain: terrain of the models.
        left_out: numbers of the held-out trials, from 0.
        training_trials: kept samples of every other trial.
        test_trials: kept samples of every held-out trial.
        others: trials of every other terrain that this fold is tested on.
        options: options of the fits.
    """

    terrain: str
    left_out: tuple[int, ...]
    training_trials: tuple[SampleTable, ...]
    test_trials: tuple[SampleTable, ...]
    others: Mapping[str, tuple[SampleTable, ...]]
    options: FitOptions

    @property
    def fold(self) -> int:
        """Number of the fold: that of the first held-out trial."""
        return self.left_out[0]

    @property
    def training(self) -> SampleTable:
        """Training rows, trial by trial."""
        return SampleTable.joined(self.training_trials)

    @property
    def lengths(self) -> tuple[int, ...]:
        """Number of samples of every trial of `training`."""
        return tuple(rows.count for rows in self.training_trials)


@dataclass(frozen=True, slots=True)
class ModelFold:
    """One model of one fold.

    Attributes:
        model: the fitted model.
        scores: errors on every held-out trial.
        train_rmse: root mean square error on the training rows [N]; on every n-th if
            there are more than 100,000.
        cross: mean absolute errors [N] on trials of other terrains.
    """

    model: FittedModel
    scores: tuple[Score, ...]
    train_rmse: float
    cross: Mapping[str, tuple[float, ...]]

    @property
    def score(self) -> Score:
        """Errors averaged over the held-out trials."""
        return Score(*np.mean(self.scores, axis=0).tolist())


@dataclass(frozen=True, slots=True)
class FoldResult:
    """All models of one fold.

    Attributes:
        terrain: terrain of the models.
        left_out: numbers of the held-out trials, from 0.
        models: results by model name; failed models are missing.
        gp_rows: training rows used by the Gaussian processes.
        constant_mae: error [N] of the training rows' median F_t as a reference, mean
            over the held-out trials.
        notes: failures with their reasons.
    """

    terrain: str
    left_out: tuple[int, ...]
    models: Mapping[str, ModelFold]
    gp_rows: tuple[int, ...]
    constant_mae: float
    notes: tuple[str, ...]

    @property
    def fold(self) -> int:
        """Number of the fold, from 0: that of the first held-out trial."""
        return self.left_out[0]


def plan_folds(
    trials: Prepared, options: FitOptions, targets: Prepared | None = None
) -> tuple[list[FoldTask], list[str]]:
    """Plan the folds of a study, with notes on trials that cannot be used.

    Args:
        trials: trials that models are fitted to.
        options: options of the fits.
        targets: the same trials as prepared for testing; None = as for fitting.
    """
    targets = trials if targets is None else targets
    usable = {
        terrain: [
            k
            for k, (trial, target) in enumerate(
                zip(prepared, targets[terrain], strict=True)
            )
            if trial.kept and target.kept
        ]
        for terrain, prepared in trials.items()
    }
    training = _tables(trials, usable)
    test = training if targets is trials else _tables(targets, usable)
    folds = [
        FoldTask(
            terrain=terrain,
            left_out=group,
            training_trials=tuple(
                training[terrain][k] for k in numbers if k not in group
            ),
            test_trials=tuple(test[terrain][k] for k in group),
            others=_paired(terrain, group, test),
            options=options,
        )
        for terrain, numbers in usable.items()
        if len(numbers) > 1
        for group in fold_groups(numbers)
    ]
    notes = _notes_on_gaps(trials, usable)
    notes += [
        f"{terrain}: {len(numbers)} trial with kept samples; leaving one out "
        "needs two, so no model was fitted."
        for terrain, numbers in usable.items()
        if len(numbers) < 2
    ]
    notes += notes_on_groups(usable)
    return folds, notes


def _tables(trials: Prepared, usable: Mapping[str, Sequence[int]]) -> Tables:
    """Return the samples of the usable trials by terrain and number."""
    return {
        terrain: {k: SampleTable.of([trials[terrain][k]]) for k in numbers}
        for terrain, numbers in usable.items()
    }


def _paired(
    terrain: str, group: Sequence[int], test: Tables
) -> dict[str, tuple[SampleTable, ...]]:
    """Return the trials of every other terrain that a fold is tested on."""
    own = list(test[terrain])
    paired = {
        other: {k for fold in group for k in paired_trials(fold, own, list(trials))}
        for other, trials in test.items()
        if other != terrain
    }
    return {
        other: tuple(test[other][k] for k in sorted(numbers))
        for other, numbers in paired.items()
    }


def fold_groups(trials: Sequence[int], most: int = MOST_FOLDS) -> list[tuple[int, ...]]:
    """Divide the trials of a terrain into the groups that folds leave out.

    Args:
        trials: numbers of the trials; up to `most` of them, each is a group.
        most: largest number of folds.
    """
    count = min(len(trials), most)
    return [tuple(trials[k::count]) for k in range(count)]


def notes_on_groups(trials: Mapping[str, Sequence[int]]) -> list[str]:
    """Return a note for every terrain whose folds leave out groups of trials.

    Args:
        trials: numbers of the held-out trials, by terrain.
    """
    return [
        f"{terrain}: {len(numbers)} trials in {MOST_FOLDS} folds. Each leaves out a "
        f"group of about {len(numbers) / MOST_FOLDS:.3g} trials and scores them one "
        f"by one; up to {MOST_FOLDS} trials a fold leaves out one."
        for terrain, numbers in trials.items()
        if len(numbers) > MOST_FOLDS
    ]


def run_fold(task: FoldTask) -> FoldResult:
    """Fit the models of one fold and score them."""
    training, chosen = task.training, choose_rows(task)
    fitter = ModelFitter(TrainingSet(training, task.lengths, chosen), task.options)
    models: dict[str, ModelFold] = {}
    notes: list[str] = []
    for name in task.options.models:
        try:
            model = fitter.fit(name)
        except TractionError as error:
            notes.append(
                f"{task.terrain}, fold {task.fold + 1}, {TITLES[name]}: {error.message}"
            )
        else:
            models[name] = _examine(model, task)
    median = np.median(training.F_t)
    errors = [float(np.abs(rows.F_t - median).mean()) for rows in task.test_trials]
    return FoldResult(
        terrain=task.terrain,
        left_out=task.left_out,
        models=models,
        gp_rows=tuple(int(k) for k in chosen),
        constant_mae=float(np.mean(errors)),
        notes=tuple(notes),
    )


def choose_rows(task: FoldTask) -> Indices:
    """Draw the training rows for Gaussian processes at random, without replacement.

    Seeded by (seed, terrain, fold), so that they do not depend on other terrains and
    every variant uses the same rows.
    """
    key = (task.options.seed, zlib.crc32(task.terrain.encode()), task.fold)
    count = min(task.options.gp_points, task.training.count)
    return np.random.default_rng(key).choice(task.training.count, count, replace=False)


def paired_trials(fold: int, models: Sequence[int], tests: Sequence[int]) -> list[int]:
    """Return the trials of another terrain that the model of a fold is tested on.

    Fold k is tested on trial k if both exist. Remaining folds or trials are paired by
    wrapping around the other list, so that each is used at least once.

    Args:
        fold: one of `models`.
        models: numbers of the folds.
        tests: numbers of the trials of the other terrain.
    """
    if not tests:
        return []
    own, folds = fold if fold in tests else tests[fold % len(tests)], set(models)
    unpaired = (k for k in tests if k not in folds)
    return sorted([own, *(k for k in unpaired if models[k % len(models)] == fold)])


def _notes_on_gaps(trials: Prepared, usable: Mapping[str, list[int]]) -> list[str]:
    return [
        f"{terrain}, trial {k + 1} ({trial.name}): no sample inside the window of "
        f"velocities ({trial.shares.sticking:.0%} sticking, "
        f"{trial.shares.backward:.0%} backward, {trial.shares.fast:.0%} too fast); "
        "left out."
        for terrain, prepared in trials.items()
        for k, trial in enumerate(prepared)
        if k not in usable[terrain]
    ]


def _examine(model: FittedModel, task: FoldTask) -> ModelFold:
    foreign = [rows for trials in task.others.values() for rows in trials]
    training = task.training
    if (step := training.count // _MOST_ROWS) > 1:
        training = training.take(np.arange(0, training.count, step))
    tested = SampleTable.joined([training, *foreign])
    # one call for all rows: the overhead of small calls exceeds their computation
    error = np.abs(model.mean(tested.F_n, tested.v_t, tested.further) - tested.F_t)
    ends = np.cumsum([training.count, *(rows.count for rows in foreign)])
    on_training, *on_foreign = np.split(error, ends[:-1])
    maes = iter(float(part.mean()) for part in on_foreign)
    return ModelFold(
        model=model,
        scores=tuple(
            score(rows.F_t, model.predict(rows.F_n, rows.v_t, rows.further))
            for rows in task.test_trials
        ),
        train_rmse=float(np.sqrt(np.mean(on_training**2))),
        cross={
            terrain: tuple(next(maes) for _ in trials)
            for terrain, trials in task.others.items()
        },
    )
