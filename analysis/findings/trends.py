"""Repeatability of the trials of a terrain, and how they change from first to last."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.study.study import TerrainResult

MEAN_FORCE, TRACTION_RATIO, MEAN_LOAD = "F_t", "F_t/F_n", "F_n"
TREND_UNITS = {MEAN_FORCE: "N", TRACTION_RATIO: "1", MEAN_LOAD: "N"}
SIGNIFICANT = 2.0  # standard errors that a slope must exceed to be called one


@dataclass(frozen=True, slots=True)
class Trend:
    """A straight line through one mean per trial.

    Attributes:
        trials: numbers of the trials that have kept samples, from 1, shape (n,).
        means: one mean per trial, shape (n,).
        slope: change from one trial to the next; None below three trials.
        slope_error: its standard error.
        start: height of the line at trial 0; the overall mean without a slope.
    """

    trials: Array
    means: Array
    slope: float | None
    slope_error: float | None
    start: float

    @property
    def spread(self) -> float | None:
        """Standard deviation of the trial means: repeatability; None for one."""
        return float(self.means.std(ddof=1)) if self.means.size > 1 else None

    @property
    def is_significant(self) -> bool:
        """Whether the slope exceeds two of its standard errors."""
        if self.slope is None or self.slope_error is None:
            return False
        return abs(self.slope) > SIGNIFICANT * self.slope_error


def trends_of(result: TerrainResult) -> dict[str, Trend]:
    """Return the trends of mean F_t, mean F_n and their ratio over the trials."""
    kept = [(k + 1, trial) for k, trial in enumerate(result.trials) if trial.kept]
    return {name: _trend(kept, measure) for name, measure in _MEASURES.items()}


def fit_trend(trials: Array, means: Array) -> Trend:
    """Return the least-squares line through `means` over `trials`, shapes (n,).

    The slope's standard error is s / sqrt(sum (k - mean k)^2), s^2 from the residual
    with n - 2 degrees of freedom.
    """
    if means.size < 3:
        start = float(means.mean()) if means.size else float("nan")
        return Trend(trials, means, None, None, start)
    centred = trials - trials.mean()
    width = float(centred @ centred)
    slope = float(centred @ means) / width
    start = float(means.mean()) - slope * float(trials.mean())
    residual = means - start - slope * trials
    variance = float(residual @ residual) / (means.size - 2)
    return Trend(trials, means, slope, float(np.sqrt(variance / width)), start)


def _trend(
    kept: Sequence[tuple[int, PreparedTrial]], measure: Callable[[PreparedTrial], float]
) -> Trend:
    numbers = np.array([float(number) for number, _ in kept])
    return fit_trend(numbers, np.array([measure(trial) for _, trial in kept]))


def _ratio(trial: PreparedTrial) -> float:
    # a ratio of means: single samples may have F_n near zero
    load = float(trial.F_n.mean())
    return float(trial.F_t.mean()) / load if load > 0 else float("nan")


_MEASURES: Mapping[str, Callable[[PreparedTrial], float]] = {
    MEAN_FORCE: lambda trial: float(trial.F_t.mean()),
    MEAN_LOAD: lambda trial: float(trial.F_n.mean()),
    TRACTION_RATIO: _ratio,
}
