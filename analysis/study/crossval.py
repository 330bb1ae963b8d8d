"""Leave one trial out: every model is tested on a trial it never saw.

Samples of one trial are correlated over tenths of a second, so a fold is a whole trial.
A terrain has at most 50 folds: of more trials each fold leaves out a group, trials k,
k + 50, k + 100 and so on, and scores them one by one. The function of a model comes
from 300 rows of the others in either case, and groups of neighbours would leave out
whole sessions. The model of fold k of a terrain is also tested on trial k of every
other terrain.
"""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from itertools import accumulate
from typing import TypeVar, overload

import numpy as np

from acquisition.errors import TractionError
from analysis.data.prepare import PreparedTrial
from analysis.data.samples import PooledSamples, SampleTable, TrainingSet
from analysis.data.series import Array, Indices
from analysis.study.metrics import Score, score
from analysis.study.models import TITLES, FitOptions, FittedModel, ModelFitter

T = TypeVar("T")
Digests = Mapping[str, Mapping[int, str]]
MOST_FOLDS = 50  # of a terrain
_MOST_ROWS = 50_000  # of the training that its error is told of, at most twice as many
_DERIVED = ("_digests", "_wholes")  # of a plan
Prepared = Mapping[str, Sequence[PreparedTrial]]


@dataclass(frozen=True, slots=True)
class FoldTask:
    """Everything one fold needs; `run_fold` is a pure function of it.

    Attributes:
        terrain: terrain of the models.
        left_out: numbers of the trials left out, from 0.
        training: kept samples of the other trials.
        lengths: number of samples of each of them.
        own: kept samples of the trials left out, one after the other.
        own_lengths: number of samples of each of these.
        others: for every other terrain the trials this fold is tested on.
        options: how to fit.
    """

    terrain: str
    left_out: tuple[int, ...]
    training: SampleTable
    lengths: tuple[int, ...]
    own: SampleTable
    own_lengths: tuple[int, ...]
    others: Mapping[str, tuple[SampleTable, ...]]
    options: FitOptions

    @property
    def fold(self) -> int:
        """Number of the fold: that of the first trial left out."""
        return self.left_out[0]

    def per_trial(self, values: Array) -> list[Array]:
        """Return what belongs to the rows of `own`, shape (n,), trial by trial."""
        return np.split(values, np.cumsum(self.own_lengths)[:-1])


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


class FoldPlan(Sequence[FoldTask]):
    """The folds of a study, each made from the samples of all when it is asked for.

    A plan grows with the trials, and a worker that has it needs no more than a number.

    Args:
        trials: what models are fitted to.
        targets: the same trials as models are tested on them.
        usable: numbers of the trials that can be folded, by terrain.
        options: how to fit.
    """

    def __init__(
        self,
        trials: Prepared,
        targets: Prepared,
        usable: Mapping[str, Sequence[int]],
        options: FitOptions,
    ) -> None:
        self._usable, self._options = usable, options
        self._fitted = PooledSamples.of(trials, usable)
        self._tested = (
            self._fitted if targets is trials else PooledSamples.of(targets, usable)
        )
        self._folds = [
            (name, group)
            for name, numbers in usable.items()
            if len(numbers) > 1
            for group in fold_groups(numbers)
        ]

    def __len__(self) -> int:
        """Return the number of folds."""
        return len(self._folds)

    @overload
    def __getitem__(self, index: int) -> FoldTask: ...
    @overload
    def __getitem__(self, index: slice) -> list[FoldTask]: ...
    def __getitem__(self, index: int | slice) -> FoldTask | list[FoldTask]:
        """Return everything that one fold needs."""
        if isinstance(index, slice):
            return [self[k] for k in range(len(self))[index]]
        terrain, group = self._folds[index]
        rest = [
            self._fitted.trial(terrain, k)
            for k in self._usable[terrain]
            if k not in group
        ]
        own = [self._tested.trial(terrain, k) for k in group]
        return FoldTask(
            terrain=terrain,
            left_out=group,
            training=SampleTable.joined(rest),
            lengths=tuple(rows.count for rows in rest),
            own=SampleTable.joined(own),
            own_lengths=tuple(rows.count for rows in own),
            others=self._paired(terrain, group, self._tested.trial),
            options=self._options,
        )

    def outline(self, index: int) -> tuple[object, ...]:
        """Return what tells a fold from others, digests in the place of samples."""
        (terrain, group), (_, tested) = self._folds[index], self._digests
        paired = self._paired(terrain, group, lambda name, k: tested[name][k])
        own = [tested[terrain][k] for k in group]
        whole, options = self._wholes[terrain], self._options
        return ("fold", terrain, group, whole, own, paired, options)

    def __getstate__(self) -> dict[str, object]:
        """Return what a worker needs."""
        return {k: v for k, v in vars(self).items() if k not in _DERIVED}

    @cached_property
    def _digests(self) -> tuple[Digests, Digests]:
        return self._fitted.digests(), self._tested.digests()

    @cached_property
    def _wholes(self) -> dict[str, str]:
        """Digests of all trials of every terrain: with a fold's number its training."""
        return {
            terrain: blake2b(repr(sorted(digests.items())).encode()).hexdigest()
            for terrain, digests in self._digests[0].items()
        }

    def _paired(
        self, terrain: str, group: Sequence[int], value_of: Callable[[str, int], T]
    ) -> dict[str, tuple[T, ...]]:
        """Return `value_of` every trial of another terrain that a fold is tested on."""
        own = self._usable[terrain]
        met = {
            other: {k for fold in group for k in paired_trials(fold, own, tests)}
            for other, tests in self._usable.items()
            if other != terrain
        }
        return {
            other: tuple(value_of(other, k) for k in sorted(numbers))
            for other, numbers in met.items()
        }


def plan_folds(
    trials: Prepared, options: FitOptions, targets: Prepared | None = None
) -> tuple[FoldPlan, list[str]]:
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
    notes += [
        f"{terrain}: {len(folds)} trial with kept samples; leaving one out "
        "needs two, so no model was fitted."
        for terrain, folds in usable.items()
        if len(folds) < 2
    ]
    notes += notes_on_groups(usable)
    return FoldPlan(trials, targets, usable, options), notes


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
    error = task.per_trial(np.abs(task.own.F_t - np.median(task.training.F_t)))
    return FoldResult(
        terrain=task.terrain,
        left_out=task.left_out,
        models=models,
        gp_rows=tuple(int(k) for k in chosen),
        constant_mae=float(np.mean([part.mean() for part in error])),
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
    own = task.own
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
    left_out = [
        own.part(end - count, end)
        for count, end in zip(
            task.own_lengths, accumulate(task.own_lengths), strict=True
        )
    ]
    return ModelFold(
        model=model,
        scores=tuple(
            score(one.F_t, model.predict(one.F_n, one.v_t, one.further))
            for one in left_out
        ),
        train_rmse=float(np.sqrt(np.mean(on_training**2))),
        cross={
            terrain: tuple(next(maes) for _ in trials)
            for terrain, trials in task.others.items()
        },
    )
