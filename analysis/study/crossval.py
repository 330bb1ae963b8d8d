"""Leave one trial out: every model is tested on a trial it never saw.

Samples of one trial are correlated over tenths of a second, so a fold is a whole trial.
The model of fold k of a terrain is also tested on trial k of every other terrain.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import TractionError
from analysis.data import Indices, PreparedTrial, SampleTable, TrainingSet
from analysis.study.metrics import Score, mean_absolute_error, score
from analysis.study.models import TITLES, FitOptions, FittedModel, ModelFitter

Prepared = Mapping[str, Sequence[PreparedTrial]]


@dataclass(frozen=True, slots=True)
class FoldTask:
    """Everything one fold needs; `run_fold` is a pure function of it.

    Attributes:
        terrain: terrain of the models.
        fold: number of the trial left out, from 0.
        training: kept samples of the other trials.
        lengths: number of samples of each of them.
        own: kept samples of the trial left out.
        others: for every other terrain the trials this fold is tested on.
        options: how to fit.
    """

    terrain: str
    fold: int
    training: SampleTable
    lengths: tuple[int, ...]
    own: SampleTable
    others: Mapping[str, tuple[SampleTable, ...]]
    options: FitOptions


@dataclass(frozen=True, slots=True)
class ModelFold:
    """One model of one fold.

    Attributes:
        model: the fitted model.
        score: its errors on the trial left out.
        train_rmse: root mean square error on all training rows [N].
        cross: mean absolute errors [N] on trials of other terrains.
    """

    model: FittedModel
    score: Score
    train_rmse: float
    cross: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True, slots=True)
class FoldResult:
    """All models of one fold.

    Attributes:
        terrain: terrain of the models.
        fold: number of the trial left out, from 0.
        models: results by the name of the model; one that failed is missing.
        gp_rows: training rows that the Gaussian processes were given.
        constant_mae: error [N] of the training rows' median F_t, for scale.
        notes: what could not be done, and why.
    """

    terrain: str
    fold: int
    models: Mapping[str, ModelFold]
    gp_rows: tuple[int, ...]
    constant_mae: float
    notes: tuple[str, ...]


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
    notes = _notes_on_gaps(trials, usable)
    tasks: list[FoldTask] = []
    for terrain, folds in usable.items():
        if len(folds) < 2:
            notes.append(
                f"{terrain}: {len(folds)} trial with kept samples; leaving one out "
                "needs two, so no model was fitted."
            )
            continue
        tasks += [
            _task((trials, targets), usable, (terrain, fold), options) for fold in folds
        ]
    return tasks, notes


def run_fold(task: FoldTask) -> FoldResult:
    """Return the models of one fold and their errors."""
    chosen = choose_rows(task)
    training = TrainingSet(task.training, task.lengths, chosen)
    fitter = ModelFitter(training, task.options)
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
    constant = np.full(task.own.count, np.median(task.training.F_t))
    return FoldResult(
        terrain=task.terrain,
        fold=task.fold,
        models=models,
        gp_rows=tuple(int(k) for k in chosen),
        constant_mae=mean_absolute_error(task.own.F_t, constant),
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


def pair_trials(models: Sequence[int], tests: Sequence[int]) -> list[tuple[int, int]]:
    """Return which fold's model meets which trial of another terrain.

    Fold k meets trial k where both exist. A fold or trial left over is paired by
    wrapping round the other list, so that each is used at least once.
    """
    if not models or not tests:
        return []
    pairs = [(k, k) for k in models if k in tests]
    pairs += [(k, tests[k % len(tests)]) for k in models if k not in tests]
    pairs += [(models[k % len(models)], k) for k in tests if k not in models]
    return sorted(pairs)


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


def _task(
    trials: tuple[Prepared, Prepared],
    usable: Mapping[str, list[int]],
    place: tuple[str, int],
    options: FitOptions,
) -> FoldTask:
    terrain, fold = place
    own, targets = trials[0][terrain], trials[1]
    others = {
        other: tuple(
            SampleTable.of([targets[other][j]])
            for k, j in pair_trials(usable[terrain], usable[other])
            if k == fold
        )
        for other in targets
        if other != terrain
    }
    return FoldTask(
        terrain=terrain,
        fold=fold,
        training=SampleTable.of([own[k] for k in usable[terrain] if k != fold]),
        lengths=tuple(own[k].kept for k in usable[terrain] if k != fold),
        own=SampleTable.of([targets[terrain][fold]]),
        others=others,
        options=options,
    )


def _examine(model: FittedModel, task: FoldTask) -> ModelFold:
    own = task.own
    foreign = [rows for trials in task.others.values() for rows in trials]
    tested = SampleTable.joined([task.training, *foreign])
    # one call for all rows: small ones cost more than they compute
    error = np.abs(model.mean(tested.F_n, tested.v_t) - tested.F_t)
    ends = np.cumsum([task.training.count, *(rows.count for rows in foreign)])
    on_training, *on_foreign = np.split(error, ends[:-1])
    maes = iter(float(part.mean()) for part in on_foreign)
    return ModelFold(
        model=model,
        score=score(own.F_t, model.predict(own.F_n, own.v_t)),
        train_rmse=float(np.sqrt(np.mean(on_training**2))),
        cross={
            terrain: tuple(next(maes) for _ in trials)
            for terrain, trials in task.others.items()
        },
    )
