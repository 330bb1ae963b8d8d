"""Likelihood of right-censored peak forces with a random trial effect.

    log P = b_terrain + b1 log(max(F_n, 1)/3.5) + u_trial + s e,   u ~ N(0, su^2)

(accelerated failure model) with e from the smallest extreme value distribution: P is
Weibull with shape 1/s. With z = (log P - mu - u)/s a slip contributes
z - exp(z) - log s, a held push the logarithm of its survival, -exp(z).

u is integrated out per trial by Gauss-Hermite quadrature with 15 points. All terrains
share slope and spread; each has its own level. Weak priors regularise fits to few
pushes: log s ~ N(log 0.35, 0.5), b1 ~ N(0.5, 0.5), su half-normal 0.3.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from analysis.data.series import Array
from analysis.study.pushes import PushTable

NODES = 15
_LOG_SPREAD = (float(np.log(0.35)), 0.5)  # prior of log s: mean, sd
_SLOPE = (0.5, 0.5)  # prior of b1
_TRIAL_SD = 0.3  # scale of the half-normal prior of su
_LARGEST_Z = 300.0  # keeps exp finite
_LEVEL_RANGE = 3.0  # bounds of a level about the mean of log P
_NO_EFFECT = -7.0  # log su that is practically zero
_BOX = (
    (-1.0, 2.0),
    (float(np.log(0.02)), float(np.log(3.0))),
    (_NO_EFFECT, 0.4),
)
_START = (0.5, float(np.log(0.35)), float(np.log(0.1)))


@cache
def nodes() -> tuple[Array, Array]:
    """Return quadrature points and weights for a standard normal, shape (15,)."""
    points, weights = np.polynomial.hermite.hermgauss(NODES)
    points, weights = np.sqrt(2.0) * points, weights / np.sqrt(np.pi)
    points.setflags(write=False)
    weights.setflags(write=False)
    return points, weights


def share_weaker(z: Array) -> Array:
    """Return P(e < z) of the smallest extreme value distribution, shape of `z`."""
    return -np.expm1(-np.exp(np.minimum(z, _LARGEST_Z)))


@dataclass(frozen=True, slots=True)
class CensoredLikelihood:
    """Likelihood of a table of pushes.

    The parameter vector holds a level per terrain, b1, log s, log su.

    Attributes:
        table: the pushes.
        levels: number of terrains, each with at least one push.
    """

    table: PushTable
    levels: int

    def fit(
        self,
        counts: Array | None = None,
        start: Array | None = None,
        *,
        has_trials: bool = True,
    ) -> Array:
        """Return the parameters with the largest posterior density, (levels + 3,).

        Args:
            counts: weight of every trial by its number; 1 by default.
            start: initial parameters; by default mean log P and the prior centres.
            has_trials: include the trial effect; otherwise su is practically 0.
        """
        from scipy.optimize import minimize

        begin = self._start() if start is None else start.copy()
        box = self._box()
        if not has_trials:
            begin[-1] = _NO_EFFECT
            box[-1] = (_NO_EFFECT, _NO_EFFECT)
        result = minimize(
            self.objective, begin, (counts,), "L-BFGS-B", jac=True, bounds=box
        )
        return np.asarray(result.x, dtype=np.float64)

    def objective(self, p: Array, counts: Array | None = None) -> tuple[float, Array]:
        """Return minus the log posterior density and its gradient in `p`."""
        by_trial, gradients = self.by_trial(p)
        weights = np.ones(by_trial.size)
        if counts is not None:
            weights = counts[self.table.trial[self.table.starts]]
        value, gradient = log_prior(p[self.levels :])
        total = gradients.T @ weights
        total[self.levels :] += gradient
        return -float(by_trial @ weights + value), -total

    def by_trial(self, p: Array) -> tuple[Array, Array]:
        """Return log likelihood and gradient of every trial with a push.

        Returns:
            Values, shape (trials,), and gradients, shape (trials, levels + 3).
        """
        table, m = self.table, self.levels
        s, su = np.exp(p[m + 1]), np.exp(p[m + 2])
        points, weights = nodes()
        centre = p[table.terrain] + p[m] * table.load
        z = (table.log_peak - centre)[:, None] / s - su / s * points
        hazard = np.exp(np.minimum(z, _LARGEST_Z))
        slipped = ~table.is_held[:, None]
        terms = np.where(slipped, z, 0.0) - hazard - slipped * p[m + 1]
        slope = slipped - hazard
        at_node = np.add.reduceat(terms, table.starts) + np.log(weights)
        top = at_node.max(axis=1, keepdims=True)
        share = np.exp(at_node - top)
        value = (top + np.log(share.sum(axis=1, keepdims=True)))[:, 0]
        share /= share.sum(axis=1, keepdims=True)
        posterior = np.repeat(share, table.lengths, axis=0)
        by_z = (posterior * slope).sum(axis=1)
        rows = np.zeros((table.count, m + 3))
        rows[np.arange(table.count), table.terrain] = -by_z / s
        rows[:, m] = -by_z * table.load / s
        rows[:, m + 1] = -(posterior * slope * z).sum(axis=1) - ~table.is_held
        rows[:, m + 2] = -(posterior * slope * points).sum(axis=1) * su / s
        return value, np.add.reduceat(rows, table.starts)

    def _start(self) -> Array:
        table = self.table
        sums = np.bincount(table.terrain, table.log_peak, self.levels)
        counts = np.bincount(table.terrain, minlength=self.levels)
        return np.concatenate([sums / counts, _START])

    def _box(self) -> list[tuple[float, float]]:
        middle = float(self.table.log_peak.mean())
        return [(middle - _LEVEL_RANGE, middle + _LEVEL_RANGE)] * self.levels + list(
            _BOX
        )


def log_prior(p: Array) -> tuple[float, Array]:
    """Return the log prior density of (b1, log s, log su), and its gradient."""
    slope, log_s, su = p[0], p[1], float(np.exp(p[2]))
    a = (slope - _SLOPE[0]) / _SLOPE[1]
    b = (log_s - _LOG_SPREAD[0]) / _LOG_SPREAD[1]
    c = su / _TRIAL_SD
    gradient = np.array([-a / _SLOPE[1], -b / _LOG_SPREAD[1], -c * c])
    return -0.5 * float(a * a + b * b + c * c), gradient
