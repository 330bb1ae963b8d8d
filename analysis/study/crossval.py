"""Leave one trial out: every model is tested on a trial it never saw.

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

MOST_FOLDS = 50  # of a terrain
_MOST_ROWS = 50_000  # of the training that its error is told of, at most twice as many
Prepared = Mapping[str, Sequence[PreparedTrial]]
Tables = Mapping[str, Mapping[int, SampleTable]]  # by terrain and number of the trial


@dataclass(frozen=True, slots=True)
class FoldTask:
    """Everything one fold needs; `run_fold` is a pure function of it.

    Tasks share the tables of the trials, so that all of them grow with the trials.

    Attributes:
        terrain: terrain of the models.
        left_out: numbers of the trials left out, from 0.
        training_trials: kept samples of every other trial.
        test_trials: kept samples of every trial left out.
        others: for every other terrain the trials this fold is tested on.
        options: how to fit.
    """

    terrain: str
    left_out: tuple[int, ...]
    training_trials: tuple[SampleTable, ...]
    test_trials: tuple[SampleTable, ...]
    others: Mapping[str, tuple[SampleTable, ...]]
    options: FitOptions

    @property
    def fold(self) -> int:
        """Number of the fold: that of the first trial left out."""
        return self.left_out[0]

    @property
    def training(self) -> SampleTable:
        """What models are fitted to, trial by trial."""
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
        scores: its errors on every trial left out.
        train_rmse: root mean square error on the training rows [N], of more than
            100,000 on every n-th.
        cross: mean absolute errors [N] on trials of other terrains.
    """

    model: FittedModel
    scores: tuple[Score, ...]
    train_rmse: float
    cross: Mapping[str, tuple[float, ...]]

    @property
    def score(self) -> Score:
        """Its errors, means over the trials left out."""
        return Score(*np.mean(self.scores, axis=0).tolist())


@dataclass(frozen=True, slots=True)
class FoldResult:
    """All models of one fold.

    Attributes:
        terrain: terrain of the models.
        left_out: numbers of the trials left out, from 0.
        models: results by the name of the model; one that failed is missing.
        gp_rows: training rows that the Gaussian processes were given.
        constant_mae: error [N] of the training rows' median F_t, for scale, mean over
            the trials left out.
        notes: what could not be done, and why.
    """

    terrain: str
    left_out: tuple[int, ...]
    models: Mapping[str, ModelFold]
    gp_rows: tuple[int, ...]
    constant_mae: float
    notes: tuple[str, ...]

    @property
    def fold(self) -> int:
        """Number of the fold, from 0: that of the first trial left out."""
        return self.left_out[0]


def plan_folds(
    trials: Prepared, options: FitOptions, targets: Prepared | None = None
) -> tuple[list[FoldTask], list[str]]:
    """Return the folds of a study and notes on what cannot be folded.

    Args:
        trials: what models are fitted to.
        options: how to fit.
        targets: the same trials as models are tested on them; None = as fitted to.
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
    met = {
        other: {k for fold in group for k in paired_trials(fold, own, list(trials))}
        for other, trials in test.items()
        if other != terrain
    }
    return {
        other: tuple(test[other][k] for k in sorted(numbers))
        for other, numbers in met.items()
    }


def fold_groups(trials: Sequence[int], most: int = MOST_FOLDS) -> list[tuple[int, ...]]:
    """Return which trials each fold of a terrain leaves out.

    Args:
        trials: their numbers; each by itself up to `most` of them.
        most: folds.
    """
    count = min(len(trials), most)
    return [tuple(trials[k::count]) for k in range(count)]


def notes_on_groups(trials: Mapping[str, Sequence[int]]) -> list[str]:
    """Return where folds leave out groups of trials.

    Args:
        trials: numbers of those that are left out, by terrain.
    """
    return [
        f"{terrain}: {len(numbers)} trials in {MOST_FOLDS} folds. Each leaves out a "
        f"group of about {len(numbers) / MOST_FOLDS:.3g} trials and scores them one "
        f"by one; up to {MOST_FOLDS} trials a fold leaves out one."
        for terrain, numbers in trials.items()
        if len(numbers) > MOST_FOLDS
    ]


def run_fold(task: FoldTask) -> FoldResult:
    """Return the models of one fold and their errors."""
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
    """Return the training rows for Gaussian processes: random, without replacement.

    Seeded by (seed, terrain, fold), so that they depend on no other terrain and every
    variant gets the same rows.
    """
    key = (task.options.seed, zlib.crc32(task.terrain.encode()), task.fold)
    count = min(task.options.gp_points, task.training.count)
    return np.random.default_rng(key).choice(task.training.count, count, replace=False)


def paired_trials(fold: int, models: Sequence[int], tests: Sequence[int]) -> list[int]:
    """Return the trials of another terrain that the model of a fold meets, in order.

    Fold k meets trial k where both exist. A fold or trial left over is paired by
    wrapping round the other list, so that each is used at least once.

    Args:
        fold: one of `models`.
        models: numbers of the folds.
        tests: numbers of the trials of the other terrain.
    """
    if not tests:
        return []
    own, known = fold if fold in tests else tests[fold % len(tests)], set(models)
    left = (k for k in tests if k not in known)
    return sorted([own, *(k for k in left if models[k % len(models)] == fold)])


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
    # one call for all rows: small ones cost more than they compute
    error = np.abs(model.mean(tested.F_n, tested.v_t, tested.further) - tested.F_t)
    ends = np.cumsum([training.count, *(rows.count for rows in foreign)])
    on_training, *on_foreign = np.split(error, ends[:-1])
    maes = iter(float(part.mean()) for part in on_foreign)
    return ModelFold(
        model=model,
        scores=tuple(
            score(one.F_t, model.predict(one.F_n, one.v_t, one.further))
            for one in task.test_trials
        ),
        train_rmse=float(np.sqrt(np.mean(on_training**2))),
        cross={
            terrain: tuple(next(maes) for _ in trials)
            for terrain, trials in task.others.items()
        },
    )
