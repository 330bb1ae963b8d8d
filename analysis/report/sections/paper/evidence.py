"""What statements of the paper are held against, beyond what a study has already.

The paper sees stones and plates; a terrain of unknown kind counts as neither.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.samples import SampleTable
from analysis.data.terrain_kinds import BIG, FLAT, SMALL
from analysis.gp.regression import GaussianProcess
from analysis.report.sections.beyond_paper.noise import NoiseSummary
from analysis.study.crossval import FoldResult
from analysis.study.metrics import (
    PairedComparison,
    compare,
)
from analysis.study.models import GP_SE, GpModel
from analysis.study.study import Study
from analysis.study.tasks import Batch, run_batches
from analysis.study.terrain_fit import TerrainResult, mean_of
from analysis.study.worker_processes import running_workers
from analysis.terrains.identify import Identification
from analysis.tustin.model import bound

_MORE = 4  # times as many rows as the process was fitted to
_STREAM = 2_000_000  # apart from the folds, which have the same kind of seed


@dataclass(frozen=True, slots=True)
class StickingBound:
    """How often the force stays below its bound while the foot sticks.

    Attributes:
        terrain: its terrain.
        samples: thinned samples slower than the window in either direction.
        as_printed: share with |F_t| <= mu F_n (eq. 2).
        with_static: share with |F_t| <= max(F_s, mu F_n).
    """

    terrain: str
    samples: int
    as_printed: float
    with_static: float


@dataclass(frozen=True, slots=True)
class MoreRows:
    """A Gaussian process given more training rows, its hyperparameters kept.

    Attributes:
        terrain: its terrain.
        rows: training rows that the process was given, the largest fold's.
        before: error on trials left out with the rows it was fitted to [N].
        paired: the error with more rows minus that [N], trial by trial.
    """

    terrain: str
    rows: int
    before: float
    paired: PairedComparison

    @property
    def gain(self) -> float:
        """Share of the error that more rows take away; below zero they add to it."""
        return -self.paired.difference / self.before


@dataclass(frozen=True, slots=True)
class PaperEvidence:
    """Everything that the paper's statements are held against.

    Attributes:
        study: the study.
        identification: how well the terrains can be told apart; None for one terrain.
        noise: constant against chosen noise, by terrain.
        sticking: force against its bound while sticking, by terrain.
        more_rows: a process given more rows, by terrain.
    """

    study: Study
    identification: Identification | None
    noise: Sequence[NoiseSummary]
    sticking: Sequence[StickingBound]
    more_rows: Sequence[MoreRows]

    @property
    def stones(self) -> list[TerrainResult]:
        """The terrains of stones with kept samples."""
        return self._of_kinds(SMALL, BIG)

    @property
    def plates(self) -> list[TerrainResult]:
        """The plates with kept samples."""
        return self._of_kinds(FLAT)

    def _of_kinds(self, *kinds: str) -> list[TerrainResult]:
        results = self.study.terrains.values()
        return [result for result in results if result.kind in kinds and result.kept]


def gather_evidence(
    study: Study,
    identification: Identification | None,
    noise: Sequence[NoiseSummary],
) -> PaperEvidence:
    """Return what the paper's statements are held against."""
    results = study.terrains.values()
    sticking = [sticking_bound(result, study) for result in results]
    return PaperEvidence(
        study=study,
        identification=identification,
        noise=noise,
        sticking=[entry for entry in sticking if entry is not None],
        more_rows=more_rows(study),
    )


def sticking_bound(result: TerrainResult, study: Study) -> StickingBound | None:
    """Return how often eq. (2) holds with the Tustin fit of all trials.

    None where there is no fit, or no sample that sticks.
    """
    fit, slowest = result.whole.fit, study.options.prepare.slowest
    columns = [_sticking(trial, slowest) for trial in result.trials]
    F_n, F_t = (
        np.concatenate([getattr(c, k) for c in columns]) for k in ("F_n", "F_t")
    )
    if fit is None or F_t.size == 0:
        return None
    force = np.abs(F_t)
    printed = bound(fit.parameters, F_n, fit.form, as_printed=True)
    static = bound(fit.parameters, F_n, fit.form)
    return StickingBound(
        terrain=result.terrain,
        samples=F_t.size,
        as_printed=float(np.mean(force <= printed)),
        with_static=float(np.mean(force <= static)),
    )


def _sticking(trial: PreparedTrial, slowest: float) -> SampleTable:
    smooth, every = trial.smooth, trial.widths[1]
    rows = np.arange(0, smooth.t.size, every)
    rows = rows[np.abs(smooth.v_t[rows]) < slowest]
    return SampleTable(smooth.F_n[rows], smooth.v_t[rows], smooth.F_t[rows])


@dataclass(frozen=True, slots=True)
class MoreRowsTask:
    """A fold's process that is given more of its training rows.

    Attributes:
        process: fitted to few of them.
        rows: many of them.
        tested: what the fold leaves out.
    """

    process: GaussianProcess
    rows: SampleTable
    tested: SampleTable

    @classmethod
    def of(
        cls, result: TerrainResult, fold: FoldResult, study: Study
    ) -> "MoreRowsTask | None":
        """Return the task of a fold, None without such a process or more rows."""
        model = fold.models[GP_SE].model if GP_SE in fold.models else None
        fit = study.options.fit
        every = [k for f in result.folds for k in f.left_out]
        others = [k for k in sorted(every) if k not in fold.left_out]
        training = SampleTable.of([result.trials[k] for k in others])
        count = min(_MORE * fit.gp_points, training.count)
        if not isinstance(model, GpModel) or count <= len(fold.gp_rows):
            return None
        key = (fit.seed, zlib.crc32(result.terrain.encode()), _STREAM + fold.fold)
        unused = np.setdiff1d(np.arange(training.count), fold.gp_rows)
        added = np.random.default_rng(key).choice(
            unused, count - len(fold.gp_rows), replace=False
        )
        return cls(
            model.process,
            training.take(np.concatenate([np.array(fold.gp_rows, np.intp), added])),
            SampleTable.of([result.trials[k] for k in fold.left_out]),
        )


def errors_of_more(task: MoreRowsTask) -> tuple[float, float]:
    """Return the mean absolute errors [N] with few and with many rows.

    A pure function of the task.
    """
    tested, rows = task.tested, task.rows
    more = task.process.given(rows.inputs, rows.F_t)
    few, many = (
        float(np.mean(np.abs(tested.F_t - process.mean(tested.inputs))))
        for process in (task.process, more)
    )
    return few, many


def more_rows(study: Study) -> list[MoreRows]:
    """Return what four times as many training rows change, by terrain that has them."""
    tasks = {
        name: [
            task
            for fold in result.folds
            if (task := MoreRowsTask.of(result, fold, study)) is not None
        ]
        for name, result in study.terrains.items()
    }
    batches = [Batch(errors_of_more, given) for given in tasks.values()]
    done = run_batches(batches, study.options.n_jobs or running_workers())
    found: list[MoreRows] = []
    for (name, given), errors in zip(tasks.items(), done, strict=True):
        before, after = ([pair[k] for pair in errors] for k in (0, 1))
        paired, mean = compare(before, after), mean_of(before)
        if paired is not None and mean:
            count = max(task.rows.count for task in given)
            found.append(MoreRows(name, count, mean, paired))
    return found
