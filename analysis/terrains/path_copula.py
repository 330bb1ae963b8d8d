"""Forces along a path: quantiles of a new trial correlated by a Gaussian copula.

The force of a step is the quantile at a normal score z. The scores of a trial consist
of a level of the trial and a first-order autoregressive process:

    F_t = Q(Phi(z_i); F_n, v_t),    z_i = sqrt(s) u + sqrt(1 - s) x_i
    x_i = r x_{i-1} + sqrt(1 - r^2) e_i,    r = exp(-dt / tau)

with u, x_0 and e_i standard normal. tau differs between sticking and sliding, so two
scores of a trial have the correlation

    s + (1 - s) exp(-a / tau_stick - b / tau_slide)

if the foot sticks for a and slides for b seconds between them. Copula and marginal
distributions: Nelsen, An Introduction to Copulas (2006), section 2.3.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.study.distribution import Distribution

LAGS = (1, 2, 5, 10, 15, 20, 25, 30, 50, 100)  # kept samples
_EDGE = 1e-9  # probabilities are clipped to this distance from 0 and 1
_TAUS = (1e-3, 1e2)  # s
_START = (0.2, 0.2, 0.2)  # level, and both correlation times [s]


@dataclass(frozen=True, slots=True)
class ScoredTrial:
    """Normal scores of a held-out trial.

    Attributes:
        score: normal scores of the kept samples, shape (n,).
        stuck: cumulative sticking time at each of them [s], shape (n,).
        slid: cumulative sliding time at each of them [s], shape (n,).
    """

    score: Array
    stuck: Array
    slid: Array

    @classmethod
    def of(
        cls, trial: PreparedTrial, prediction: Distribution, slowest: float
    ) -> "ScoredTrial":
        """Compute the scores of a trial's kept samples.

        Args:
            trial: held-out trial.
            prediction: predictive distribution of its kept samples.
            slowest: speed below which the foot sticks [m/s].
        """
        from scipy.special import ndtri

        step = np.diff(trial.smooth.t, prepend=trial.smooth.t[:1])
        is_stuck = np.abs(trial.smooth.v_t) < slowest
        stuck, slid = (np.cumsum(step * mask) for mask in (is_stuck, ~is_stuck))
        share = np.clip(prediction.cdf(trial.F_t), _EDGE, 1.0 - _EDGE)
        return cls(ndtri(share), stuck[trial.indices], slid[trial.indices])


@dataclass(frozen=True, slots=True)
class PathCopula:
    """Dependence between the normal scores of a trial.

    Attributes:
        level: share of their variance that belongs to the trial's level, s.
        tau_stick: correlation time of the other part while the foot sticks [s].
        tau_slide: the same while the foot slides [s].
    """

    level: float
    tau_stick: float
    tau_slide: float

    def correlations(self, stuck: Array, slid: Array) -> Array:
        """Return correlations of scores separated by these times [s], shape (n,)."""
        decay = np.exp(-stuck / self.tau_stick - slid / self.tau_slide)
        return self.level + (1.0 - self.level) * decay

    def scores(self, is_stuck: NDArray[np.bool_], dt: float, normals: Array) -> Array:
        """Draw normal scores of trials along a path, shape (count, n).

        Args:
            is_stuck: whether the foot sticks at each step, shape (n,).
            dt: time from one step to the next [s].
            normals: standard normal numbers, shape (count, 1 + n): for each trial its
                level, then one per step.
        """
        r = np.exp(-dt / np.where(is_stuck, self.tau_stick, self.tau_slide))
        innovation = np.sqrt(1.0 - r**2) * normals[:, 1:]
        x = normals[:, 1:].copy()
        for i in range(1, r.size):
            x[:, i] = r[i] * x[:, i - 1] + innovation[:, i]
        return np.sqrt(self.level) * normals[:, :1] + np.sqrt(1.0 - self.level) * x


def fit_copula(trials: Sequence[ScoredTrial]) -> PathCopula | None:
    """Fit a copula to the products of scores at several lags by least squares.

    Every lag has the same weight. None with fewer than two trials of at least two
    samples.
    """
    from scipy.optimize import least_squares

    trials = [trial for trial in trials if trial.score.size > 1]
    if len(trials) < 2:
        return None
    products, stuck, slid, weight = np.concatenate(
        [part for lag in LAGS if (part := _pairs(trials, lag)).size], axis=1
    )
    products /= np.mean(np.concatenate([trial.score for trial in trials]) ** 2)

    def residuals(theta: Array) -> Array:
        return weight * (PathCopula(*theta).correlations(stuck, slid) - products)

    low, high = (0.0, _TAUS[0], _TAUS[0]), (1.0, _TAUS[1], _TAUS[1])
    best = least_squares(residuals, _START, bounds=(low, high), x_scale=_START)
    return PathCopula(*(round(value, 6) for value in best.x.tolist()))


def lag_correlation(trials: Sequence[ScoredTrial], lag: int) -> float:
    """Return the uncentred correlation of scores `lag` kept samples apart."""
    products = _pairs(trials, lag)[0]
    return float(
        products.mean() / np.mean(np.concatenate([t.score for t in trials]) ** 2)
    )


def _pairs(trials: Sequence[ScoredTrial], lag: int) -> Array:
    """Return products of scores, times between them [s] and weights, shape (4, n)."""
    columns = [
        (
            trial.score[lag:] * trial.score[:-lag],
            trial.stuck[lag:] - trial.stuck[:-lag],
            trial.slid[lag:] - trial.slid[:-lag],
        )
        for trial in trials
    ]
    pairs = np.concatenate(columns, axis=1)
    weight = np.full(pairs.shape[1], 1.0 / np.sqrt(max(pairs.shape[1], 1)))
    return np.vstack([pairs, weight])
