"""Models with predictive bands for a new trial: trial level and empirical residuals.

The noise within a trial depends on the inputs, every trial has its own level, and the
shape of the distribution comes from the residuals of training trials, each left out in
turn with fixed hyperparameters.

The function is fitted to evenly spaced rows of at most 30 trials: the cost of a process
is cubic in the number of rows, and a trial with one row or none cannot show its level.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from analysis.data.samples import TrainingSet
from analysis.data.series import Array, Indices
from analysis.gp.noise import LogLinearNoise, Noise
from analysis.gp.refit import refit_gp
from analysis.gp.regression import GaussianProcess, LeaveOut, check_outputs
from analysis.gp.trial_noise import TrialNoise, TrialRows
from analysis.study.distribution import (
    NewTrialPrediction,
    expected_variance,
    residual_quantiles,
)
from analysis.tustin.model import TustinFit

MOST_TRIALS = 30  # trials that the function is fitted to
_TINY = 1e-12  # N^2
_THIN = 5  # every fifth row of a held-out trial is used


@dataclass(frozen=True, slots=True)
class NewTrialModel:
    """Model of F_t over (F_n, v_t) that predicts a new trial.

    Attributes:
        process: process of F_t with the trial level in its noise.
        curve: Tustin fit that is its mean function.
        trials: number of trials that the process was fitted to.
        residuals: quantiles at `SHARES` of standardised residuals about the level of a
            trial.
    """

    process: GaussianProcess
    curve: TustinFit | None
    trials: int
    residuals: tuple[float, ...]

    @property
    def level_sd(self) -> float:
        """Standard deviation of the level of a trial [N]; 0 with a single trial."""
        return float(np.sqrt(_level_variance(self.process)))

    @property
    def flags(self) -> tuple[str, ...]:
        """Hyperparameters at a bound of the search, and added jitter."""
        jitter = ("jitter added",) if self.process.jitter else ()
        return (*(f"{name} at bound" for name in self.process.at_bound), *jitter)

    def mean(self, F_n: Array, v_t: Array, further: Array | None = None) -> Array:
        """Return the median [N], which minimises the expected absolute error."""
        return self.predict(F_n, v_t, further).point

    def predict(
        self, F_n: Array, v_t: Array, further: Array | None = None
    ) -> NewTrialPrediction:
        """Return the distribution of measurements in a new trial."""
        inputs = self.process.at(F_n, v_t, further)
        mean, variance = self.process.predict(inputs)
        within = variance - _level_variance(self.process)
        between = expected_variance(self.level_sd**2, self.trials)
        centre = mean + _curve(self.curve, inputs)
        return NewTrialPrediction.of(
            centre, within, np.full(mean.shape, between), self.residuals
        )

    def describe(self) -> dict[str, Any]:
        """Return hyperparameters, likelihood, starts, level and standardisation."""
        return self.process.describe() | {
            "curve": None if self.curve is None else asdict(self.curve.parameters),
            "trials": self.trials,
            "level_sd": self.level_sd,
            "residuals": list(self.residuals),
        }


class NewTrialFit:
    """Fits the model of a new trial to one training set.

    Args:
        training: rows of the training trials.
        curve: Tustin fit that is the mean function; None for a constant.
    """

    def __init__(self, training: TrainingSet, curve: TustinFit | None) -> None:
        self._training, self._curve = training, curve
        self._chosen = spread_rows(training.lengths, training.chosen.size)
        self._rows = training.rows.take(self._chosen)
        trial = training.trial_of()
        label = trial[self._chosen]
        self._trials = TrialRows(label)
        self._left_out = [np.flatnonzero(trial == k)[::_THIN] for k in np.unique(label)]

    def fit(self, start: GaussianProcess) -> NewTrialModel:
        """Fit the model with the kernel of `start`.

        Args:
            start: process with constant noise and the same mean function, fitted to the
                chosen rows; the search starts from its optima.

        Raises:
            SettingsError: fewer than 20 spread rows, or outputs that do not vary there.
        """
        process = self._process(start)
        residuals = residual_quantiles(self._held_out(process))
        return NewTrialModel(process, self._curve, len(self._left_out), residuals)

    def _process(self, start: GaussianProcess) -> GaussianProcess:
        """Fit the process to the spread rows, with levels and input-dependent noise."""
        inputs, outputs = self._rows.inputs, self._outputs(self._chosen)
        check_outputs(outputs)
        noise: Noise = LogLinearNoise(inputs.shape[1])
        if len(self._left_out) > 1:
            noise = TrialNoise(noise)
        return refit_gp(start.given(inputs, outputs, self._trials), outputs, noise)

    def _held_out(self, process: GaussianProcess) -> list[Array]:
        """Return the standardised residuals of every held-out trial about its level.

        The mean residual of a trial contains more than its level. It is subtracted only
        in part, so that the mean square decreases by the variance between trials.
        """
        if len(self._left_out) < 2:
            return []
        without, between = LeaveOut(process), _level_variance(process)
        parts: list[tuple[Array, Array]] = []
        for rows, block in zip(self._left_out, self._trials.blocks(), strict=True):
            inputs = self._training.rows.take(rows).inputs
            mean, variance = without.predict(block, inputs)
            residual = self._outputs(rows) - mean
            parts.append((residual, np.sqrt(variance - between)))
        means = np.array([residual.mean() for residual, _ in parts])
        shared = min(between / max(float(np.mean(means**2)), _TINY), 1.0)
        levels = (1.0 - np.sqrt(1.0 - shared)) * means
        return [(r - level) / sd for (r, sd), level in zip(parts, levels, strict=True)]

    def _outputs(self, rows: Indices) -> Array:
        table = self._training.rows.take(rows)
        return table.F_t - _curve(self._curve, table.inputs)


def _level_variance(process: GaussianProcess) -> float:
    """Return the variance of the trial level in a process; 0 without levels."""
    if not isinstance(process.noise, TrialNoise):
        return 0.0
    return process.noise.level_variance(process.theta[len(process.kernel.names) :])


def _curve(curve: TustinFit | None, inputs: Array) -> Array:
    """Return the mean function [N] at (F_n, v_t), shape (n,)."""
    if curve is None:
        return np.zeros(inputs.shape[0])
    return curve.mean(inputs[:, 0], inputs[:, 1])


def _spread_trials(count: int) -> Indices:
    """Choose at most 30 of `count` trials, evenly spaced in order."""
    chosen = min(count, MOST_TRIALS)
    return np.round(np.linspace(0, count - 1, chosen)).astype(int)


def spread_rows(lengths: Sequence[int], count: int) -> Indices:
    """Choose about `count` evenly spaced rows of at most 30 trials.

    Args:
        lengths: number of rows of every trial, one trial after the other.
        count: number of rows to choose.
    """
    starts = np.concatenate([[0], np.cumsum(lengths)])
    trials = _spread_trials(len(lengths))
    per_trial = max(count // trials.size, 1)
    middles = (np.arange(per_trial) + 0.5) / per_trial
    rows = [starts[k] + np.floor(middles * lengths[k]).astype(int) for k in trials]
    return np.unique(np.concatenate(rows))
