"""Test whether a further column explains F_t beyond F_n and v_t.

Trials are left out in up to ten groups. The others are fitted twice, by the model of a
new trial over F_n and v_t, and over these and the column; the gain is the difference in
log density per sample of the held-out trials, with Student's interval over the trials.

A gain alone does not show that a column is a property of the ground. A quantity driven
by F_t, such as the tilt of a sole on a compliant arm or the moment about the wrist,
merely repeats it: a large share of its changes over 0.2 s within a trial is explained
by those of F_t, given F_n and v_t. A property of the ground does not follow F_t from
one moment to the next.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from acquisition.errors import TractionError
from analysis.data.prepare import PreparedTrial
from analysis.data.samples import SampleTable, TrainingSet
from analysis.data.series import Array, Indices
from analysis.data.terrain_kinds import FLAT
from analysis.gp.kernels import SquaredExponential
from analysis.gp.regression import fit_gp
from analysis.study.crossval import fold_groups
from analysis.study.models import FitOptions
from analysis.study.new_trial import NewTrialFit
from analysis.study.store import ResultStore
from analysis.study.tasks import Workers, run_tasks

TRAVEL = "travel"  # travel since the last drop, computed from F_t and v_t
SPAN = 0.2  # s over which changes are compared with those of F_t
REPEATED = 0.3  # share of the changes explained by F_t from which a column repeats it
FEWEST = 3  # trials
LEAST_GAIN = 0.05  # nat

_STONES_DROP, _PLATE_DROP = 1.5, 0.4  # N between two extremes of the force
_FOLDS = 10
_STREAM = 4_000_000  # random stream, distinct from folds, terrain fits, components
_LEVEL = 0.975  # upper end of a 95 % interval
_NEAR = 0.3  # tolerance of the time between two rows, relative to the span


@dataclass(frozen=True, slots=True)
class CovariateRows:
    """Kept samples of a trial with the columns to test.

    Attributes:
        rows: the samples, with the inputs common to all models.
        columns: columns to test, shape (n, k).
        t: time [s], shape (n,).
    """

    rows: SampleTable
    columns: Array
    t: Array

    @classmethod
    def of(
        cls, trial: PreparedTrial, names: Sequence[str], least: float
    ) -> "CovariateRows":
        """Take the samples of a trial whose further inputs include the columns.

        Args:
            trial: a prepared trial.
            names: names of the columns; `TRAVEL` is computed. All models share the
                other inputs.
            least: decrease in force [N] that counts as a drop.
        """
        smooth, kept = trial.smooth, trial.indices
        inputs = [x[kept] for n, x in smooth.further.items() if n not in names]
        further = np.column_stack(inputs) if inputs else None
        columns = [
            travel_since_drop(trial, least) if n == TRAVEL else smooth.further[n][kept]
            for n in names
        ]
        return cls(
            SampleTable(trial.F_n, trial.v_t, trial.F_t, further),
            np.column_stack(columns),
            smooth.t[kept],
        )

    def with_column(self, k: int | None) -> SampleTable:
        """Return the samples with column `k` as an additional input, None = without."""
        if k is None:
            return self.rows
        own, column = self.rows.further, self.columns[:, [k]]
        further = column if own is None else np.column_stack([own, column])
        return SampleTable(self.rows.F_n, self.rows.v_t, self.rows.F_t, further)


@dataclass(frozen=True, slots=True)
class CovariateTask:
    """Input of one fold of the test.

    Attributes:
        terrain: its name.
        columns: names of the columns to test.
        trials: trials with kept samples.
        left_out: numbers of the held-out trials.
        options: options of the fits.
    """

    terrain: str
    columns: tuple[str, ...]
    trials: tuple[CovariateRows, ...]
    left_out: tuple[int, ...]
    options: FitOptions


class CovariateFold(NamedTuple):
    """Gains of the columns in one fold.

    Attributes:
        gains: gain in log density per sample [nat] of every held-out trial, by column.
    """

    gains: Mapping[str, tuple[float, ...]]


class CovariateResult(NamedTuple):
    """Result of the test of a column on a terrain.

    Attributes:
        terrain: its name.
        column: name of the column.
        trials: number of held-out trials.
        gain: gain in log density per sample [nat], mean over the trials.
        lower: lower end of the 95 % interval of the gain.
        upper: upper end of that interval.
        repeated: share of the column's changes over 0.2 s explained by F_t.
    """

    terrain: str
    column: str
    trials: int
    gain: float
    lower: float
    upper: float
    repeated: float

    @property
    def verdict(self) -> str:
        """Verdict in two words."""
        if self.repeated >= REPEATED:
            return "repeats F_t"
        return "gain" if self.lower > 0.0 and self.gain >= LEAST_GAIN else "no gain"

    @property
    def sentence(self) -> str:
        """Verdict with its numbers in one sentence."""
        ends = (
            f"{self.gain:+z.2f} nat per sample, "
            f"{self.lower:+z.2f} to {self.upper:+z.2f}"
        )
        where = f"{self.terrain}: {self.column}: {self.verdict}"
        if self.repeated >= REPEATED:
            return (
                f"{where} ({self.repeated:.0%} of its changes over {SPAN:g} s "
                f"are those of F_t; {ends})."
            )
        return f"{where} ({ends})."

    def numbers(self) -> dict[str, Any]:
        """Return the result as plain values."""
        return self._asdict() | {"verdict": self.verdict}


def covariate_results(
    trials: Mapping[str, Sequence[CovariateRows]],
    columns: Sequence[str],
    options: FitOptions,
    workers: Workers | int | None = None,
    store: ResultStore | None = None,
) -> list[CovariateResult]:
    """Test every column on every terrain with at least three trials.

    Args:
        trials: trials with kept samples, by terrain.
        columns: names of the columns.
        options: options of the fits.
        workers: processes that run the fits.
        store: cache of earlier results.
    """
    tasks = [
        CovariateTask(name, tuple(columns), tuple(rows), group, options)
        for name, rows in trials.items()
        if len(rows) >= FEWEST
        for group in fold_groups(range(len(rows)), _FOLDS)
    ]
    folds = run_tasks(judge_covariates, tasks, workers, store=store)
    gains: dict[tuple[str, str], list[float]] = {}
    for task, fold in zip(tasks, folds, strict=True):
        for column, values in fold.gains.items():
            gains.setdefault((task.terrain, column), []).extend(values)
    results: list[CovariateResult] = []
    for (terrain, column), values in gains.items():
        share = repeated(trials[terrain], columns.index(column))
        results.append(_result(terrain, column, values, share))
    return results


def judge_covariates(task: CovariateTask) -> CovariateFold:
    """Compute the gains of columns on the held-out trials; pure.

    A column with which no model can be fitted is omitted.
    """
    try:
        without = _densities(task, None)
    except TractionError:
        return CovariateFold({})
    gains: dict[str, tuple[float, ...]] = {}
    for k, column in enumerate(task.columns):
        try:
            densities = _densities(task, k)
        except TractionError:
            continue
        gains[column] = tuple(b - a for a, b in zip(without, densities, strict=True))
    return CovariateFold(gains)


def _densities(task: CovariateTask, column: int | None) -> list[float]:
    """Return the log density per sample of the held-out trials."""
    tables = [rows.with_column(column) for rows in task.trials]
    fitted = [rows for k, rows in enumerate(tables) if k not in task.left_out]
    joined, options = SampleTable.joined(fitted), task.options
    key = (options.seed, zlib.crc32(task.terrain.encode()), _STREAM + task.left_out[0])
    count = min(options.gp_points, joined.count)
    chosen = np.random.default_rng(key).choice(joined.count, count, replace=False)
    training = TrainingSet(joined, tuple(rows.count for rows in fitted), chosen)
    kernel = SquaredExponential(joined.inputs.shape[1])
    start = fit_gp(training.subset.inputs, training.subset.F_t, kernel)
    model = NewTrialFit(training, None).fit(start)
    return [
        float(
            model.predict(rows.F_n, rows.v_t, rows.further).log_density(rows.F_t).mean()
        )
        for rows in (tables[k] for k in task.left_out)
    ]


def _result(
    terrain: str, column: str, gains: Sequence[float], share: float
) -> CovariateResult:
    """Return the gain with Student's interval over the trials."""
    from scipy.special import stdtrit

    count, mean = len(gains), float(np.mean(gains))
    spread = float(np.std(gains, ddof=1)) if count > 1 else float("inf")
    reach = float(stdtrit(max(count - 1, 1), _LEVEL)) * spread / np.sqrt(count)
    return CovariateResult(
        terrain, column, count, mean, mean - reach, mean + reach, share
    )


def repeated(trials: Sequence[CovariateRows], column: int) -> float:
    """Return the share of a column's changes over 0.2 s explained by F_t.

    Partial R^2 of its changes within trials on those of F_t, given those of F_n and
    v_t.
    """
    changes = [_changes(rows, column) for rows in trials]
    every = np.concatenate([np.zeros((0, 4)), *changes])
    if len(every) <= every.shape[1]:
        return 0.0
    predictors, own = every[:, 1:], every[:, 0]
    squares = [
        float(np.sum((own - X @ np.linalg.lstsq(X, own, rcond=None)[0]) ** 2))
        for X in (predictors[:, :2], predictors)
    ]
    return 1.0 - squares[1] / squares[0] if squares[0] > 0.0 else 0.0


def _changes(rows: CovariateRows, column: int) -> Array:
    """Return changes over 0.2 s of column, F_n, v_t and F_t, shape (m, 4)."""
    later = np.searchsorted(rows.t, rows.t + SPAN)
    here = np.flatnonzero(later < rows.t.size)
    there = later[here]
    is_near = np.abs(rows.t[there] - rows.t[here] - SPAN) <= _NEAR * SPAN
    here, there = here[is_near], there[is_near]
    table = np.column_stack(
        [rows.columns[:, column], rows.rows.F_n, rows.rows.v_t, rows.rows.F_t]
    )
    return table[there] - table[here]


def travel_since_drop(trial: PreparedTrial, least: float) -> Array:
    """Return the travel since the last drop in force at the kept samples [m], (m,).

    A drop is detected once the force is `least` [N] below its peak; before the first
    one, the travel is counted from the start of the trial.
    """
    F, v = trial.smooth.F_t, np.maximum(trial.smooth.v_t, 0.0)
    steps = 0.5 * (v[1:] + v[:-1]) * np.diff(trial.smooth.t)
    x = np.concatenate([[0.0], np.cumsum(steps)])
    peaks, floors = falls(F, least)
    detected = [
        peak + int(np.argmax(F[peak : floor + 1] <= F[peak] - least))
        for peak, floor in zip(peaks, floors, strict=True)
    ]
    last = np.zeros(x.size)
    last[detected] = x[detected]
    return (x - np.maximum.accumulate(last))[trial.indices]


def least_drop(kind: str) -> float:
    """Return the decrease in force [N] that counts as a drop on a kind of terrain."""
    return _PLATE_DROP if kind == FLAT else _STONES_DROP


def falls(F: Array, least: float) -> tuple[Indices, Indices]:
    """Find peak and floor of every drop between alternating extremes.

    Args:
        F: forces [N], shape (T,).
        least: smallest difference between two extremes [N].

    Returns:
        Rows of the peaks and of the floors, each of shape (number of drops,).
    """
    steps = np.sign(np.diff(F))
    turning = np.flatnonzero(steps[1:] * steps[:-1] <= 0.0) + 1
    rows = np.concatenate([[0], turning, [F.size - 1]])
    peaks: list[int] = []
    floors: list[int] = []
    high = low = int(rows[0])
    is_rising = True
    values = F.tolist()
    for k in rows.tolist():
        if is_rising:
            if values[k] > values[high]:
                high = k
            elif values[high] - values[k] >= least:
                peaks.append(high)
                low, is_rising = k, False
        elif values[k] < values[low]:
            low = k
        elif values[k] - values[low] >= least:
            floors.append(low)
            high, is_rising = k, True
    if len(floors) < len(peaks):
        floors.append(low)
    return np.array(peaks, dtype=int), np.array(floors, dtype=int)
