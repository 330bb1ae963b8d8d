"""Additional evidence for testing the paper's statements.

The paper has stones and plates; a terrain of unknown kind counts as neither.
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

_MORE = 4  # factor on the number of training rows
_STREAM = 2_000_000  # random stream, distinct from the folds


@dataclass(frozen=True, slots=True)
class StickingBound:
    """Share of sticking samples whose force is within its bound.

    Attributes:
        terrain: name of the terrain.
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
    """Effect of more training rows on a Gaussian process with fixed hyperparameters.

    Attributes:
        terrain: name of the terrain.
        rows: number of training rows, largest over the folds.
        before: error on held-out trials with the original rows [N].
        paired: error with more rows minus that [N], trial by trial.
    """

    terrain: str
    rows: int
    before: float
    paired: PairedComparison

    @property
    def gain(self) -> float:
        """Relative reduction of the error by more rows; negative if it grows."""
        return -self.paired.difference / self.before


@dataclass(frozen=True, slots=True)
class PaperEvidence:
    """Evidence for testing the paper's statements.

    Attributes:
        study: the study.
        identification: terrain classification; None for one terrain.
        noise: comparison of constant and chosen noise by terrain.
        sticking: force compared with its bound while sticking, by terrain.
        more_rows: effect of more training rows by terrain.
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
    """Compute the evidence for testing the paper's statements."""
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
    """Return how often eq. (2) holds for the Tustin fit to all trials.

    None without a fit or without sticking samples.
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
    """Refactorisation of a fold's process with more training rows.

    Attributes:
        process: process fitted to few rows.
        rows: larger set of training rows.
        tested: samples of the held-out trials.
    """

    process: GaussianProcess
    rows: SampleTable
    tested: SampleTable

    @classmethod
    def of(
        cls, result: TerrainResult, fold: FoldResult, study: Study
    ) -> "MoreRowsTask | None":
        """Make the task of a fold; None without such a process or more rows."""
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

    Pure.
    """
    tested, rows = task.tested, task.rows
    more = task.process.given(rows.inputs, rows.F_t)
    few, many = (
        float(np.mean(np.abs(tested.F_t - process.mean(tested.inputs))))
        for process in (task.process, more)
    )
    return few, many


def more_rows(study: Study) -> list[MoreRows]:
    """Return the effect of four times as many training rows by terrain."""
    tasks = {
        name: [
            task
            for fold in result.folds
            if (task := MoreRowsTask.of(result, fold, study)) is not None
        ]
        for name, result in study.terrains.items()
    }
    batches = [Batch(errors_of_more, group) for group in tasks.values()]
    results = run_batches(batches, study.options.n_jobs or running_workers())
    comparisons: list[MoreRows] = []
    for (name, group), errors in zip(tasks.items(), results, strict=True):
        before, after = ([pair[k] for pair in errors] for k in (0, 1))
        paired, mean = compare(before, after), mean_of(before)
        if paired is not None and mean:
            count = max(task.rows.count for task in group)
            comparisons.append(MoreRows(name, count, mean, paired))
    return comparisons
