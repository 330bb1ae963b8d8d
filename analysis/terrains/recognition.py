"""Recognition of known terrains: log densities and posterior probabilities of a trial.

Neighbouring samples are correlated, so each sample is scored given the previous one:
with the standardised residual z_i = (y_i - m_i) / s_i and its correlation rho from one
sample to the next

    ll = sum_i log N(z_i; rho z_{i-1}, 1 - rho^2) - log s_i

(a first-order process; for the first sample and after a gap, log N(z_i; 0, 1)). Single
terms are bounded below, so that one spike cannot decide. The posterior is the softmax
of ll / tau, because the remaining correlation makes plain sums overconfident.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.study.distribution import Distribution
from analysis.terrains.windows import windows_of

TAU = 10.0  # samples that count as one independent sample
_SMALLEST_SD = 1e-6  # N
_SPIKE = 10.0  # standard deviations at which errors are clipped
Predictor = Callable[[Array, Array], Distribution]


@dataclass(frozen=True, slots=True)
class Expert:
    """The prediction of one terrain's model.

    Attributes:
        predict: distribution of F_t for given (F_n, v_t).
        rho: correlation of the standardised residual from one sample to the next.
    """

    predict: Predictor
    rho: float


def log_densities(trial: PreparedTrial, prediction: Distribution, rho: float) -> Array:
    """Return the log density of every kept sample given the previous one, (n,)."""
    sd = np.maximum(prediction.sd, _SMALLEST_SD)
    z = (trial.F_t - prediction.mean) / sd
    before = np.where(_is_next(trial), rho, 0.0)
    spread = 1.0 - before**2
    innovation = z.copy()
    innovation[1:] -= before[1:] * z[:-1]
    squares = np.minimum(innovation**2 / spread, _SPIKE**2)
    return -0.5 * (squares + np.log(2.0 * np.pi * spread)) - np.log(sd)


def neighbour_correlation(pairs: Sequence[tuple[PreparedTrial, Distribution]]) -> float:
    """Estimate rho of trials under the models of their own terrain, 0 to 0.99."""
    products = squares = 0.0
    for trial, prediction in pairs:
        z = (trial.F_t - prediction.mean) / np.maximum(prediction.sd, _SMALLEST_SD)
        is_next = _is_next(trial)[1:]
        products += float((z[1:] * z[:-1])[is_next].sum())
        squares += float((z[:-1] ** 2)[is_next].sum())
    return min(max(products / squares, 0.0), 0.99) if squares > 0.0 else 0.0


def _is_next(trial: PreparedTrial) -> np.ndarray:
    """Return which kept samples follow the previous one without a gap, shape (n,)."""
    steps = np.diff(trial.indices)
    usual = int(steps.min()) if steps.size else 1
    return np.concatenate([[False], steps == usual])[: trial.kept]


@dataclass(frozen=True, slots=True)
class TerrainScores:
    """Scores of every sample of a trial by the model of each terrain.

    Attributes:
        terrains: the m names.
        log_density: log density of every kept sample, shape (n, m).
        error: absolute error of every kept sample [N], shape (n, m).
        strain: squared error over the predicted variance, shape (n, m); 1 on average
            if the model is right.
    """

    terrains: tuple[str, ...]
    log_density: Array
    error: Array
    strain: Array

    def windows(self, size: int) -> "list[slice]":
        """Return consecutive windows of `size` kept samples; a remainder is dropped."""
        return windows_of(len(self.log_density), size)

    def posterior(self, rows: slice) -> Array:
        """Return the probability of each terrain after the samples `rows`, (m,)."""
        total = self.log_density[rows].sum(axis=0) / TAU
        weight = np.exp(total - total.max())
        return weight / weight.sum()

    def least_error(self, rows: slice) -> str:
        """Return the terrain with the smallest mean error: the paper's rule."""
        return self.terrains[int(self.error[rows].mean(axis=0).argmin())]

    def likeliest(self, rows: slice) -> str:
        """Return the terrain with the largest log density."""
        return self.terrains[int(self.log_density[rows].sum(axis=0).argmax())]

    def likeliest_group(self, rows: slice, groups: Mapping[str, str]) -> str:
        """Return the group of terrains with the largest total posterior.

        Args:
            rows: samples used.
            groups: group by terrain name.
        """
        total: dict[str, float] = {}
        for name, share in zip(self.terrains, self.posterior(rows), strict=True):
            group = groups[name]
            total[group] = total.get(group, 0.0) + float(share)
        return max(total, key=lambda name: total[name])


def score_trial(trial: PreparedTrial, experts: Mapping[str, Expert]) -> TerrainScores:
    """Score `trial` by the prediction of every expert."""
    predictions = [
        (expert.predict(trial.F_n, trial.v_t), expert.rho)
        for expert in experts.values()
    ]
    empty = np.zeros((trial.kept, 0))
    density = [log_densities(trial, p, rho) for p, rho in predictions]
    error = [np.abs(trial.F_t - p.mean) for p, _ in predictions]
    strain = [
        ((trial.F_t - p.mean) / np.maximum(p.sd, _SMALLEST_SD)) ** 2
        for p, _ in predictions
    ]
    columns = [
        np.column_stack(values) if values else empty
        for values in (density, error, strain)
    ]
    return TerrainScores(tuple(experts), *columns)
