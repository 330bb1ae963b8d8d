"""Predictive distributions of a measurement, represented by quantiles.

The force in a new trial is modelled as

    F_t = m + u + sqrt(w) e,    u ~ N(0, b k / (k - 2)),    k = trials - 1

with m the mean, w the variance within a trial including that of the model, and e the
residuals of held-out trials, given by their quantiles. b is the estimated variance
between trials, with k degrees of freedom; its expected value is larger (posterior mean
under Jeffreys' prior; Gelman et al. 2013, section 3.2).

The distribution is stored as forces at nine probabilities ("shares"). Forces are
interpolated linearly in the normal score of the share and extrapolated with the slope
of the outer pair, so a normal distribution is reproduced exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array

SHARES = (0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
FEWEST = 4  # lower limit of the degrees of freedom of the variance between trials

_NODES = 64  # quadrature nodes for moments and scores
_RATIOS = 21  # tabulated ratios of the variance between trials to the total
_FARTHEST = 37.0  # largest normal score of a quantile; limit of double precision
_REACH, _POINTS = 8.0, 321  # half width [sd] and size of the grid that inverts a sum
_STEP = 1e-6  # smallest distance between two quantiles [sd]


class Distribution(Protocol):
    """Predictive distribution of F_t [N] of n measurements."""

    @property
    def mean(self) -> Array:
        """Expected F_t [N], shape (n,)."""
        ...

    @property
    def sd(self) -> Array:
        """Standard deviation [N], shape (n,)."""
        ...

    @property
    def point(self) -> Array:
        """Median [N], which has the smallest absolute error, shape (n,)."""
        ...

    def cdf(self, F_t: Array) -> Array:
        """Return the probability of less than F_t [N], each (n,)."""
        ...

    def quantiles(self, shares: Sequence[float] | Array) -> Array:
        """Return the quantiles [N] at these probabilities, shape (q, n)."""
        ...

    def log_density(self, F_t: Array) -> Array:
        """Return the log density of F_t [N] in log 1/N, shape (n,)."""
        ...

    def crps(self, F_t: Array) -> Array:
        """Return the continuous ranked probability score of F_t [N], shape (n,)."""
        ...


@dataclass(frozen=True, slots=True)
class NewTrialPrediction:
    """Predictive distribution of F_t in a new trial.

    Attributes:
        forces: quantiles of F_t [N] at `SHARES`, shape (9, n).
    """

    forces: Array

    @classmethod
    def of(
        cls,
        centre: Array,
        within: Array,
        between: Array,
        residuals: tuple[float, ...],
    ) -> "NewTrialPrediction":
        """Build the distribution about a mean.

        Args:
            centre: mean [N], shape (n,).
            within: variance within a trial, noise and model included [N^2], shape (n,).
            between: expected variance between trials [N^2], shape (n,).
            residuals: quantiles at `SHARES` of standardised residuals about the level
                of a trial.
        """
        total = within + between
        ratio = between / np.maximum(total, np.finfo(float).tiny)
        grid = np.linspace(0.0, 1.0, _RATIOS)
        width = [np.interp(ratio, grid, row) for row in _sum_quantiles(residuals)]
        return cls(centre + np.sqrt(total) * np.array(width))

    @property
    def point(self) -> Array:
        """Median [N], shape (n,)."""
        return self.quantiles((0.5,))[0]

    @property
    def mean(self) -> Array:
        """Expected F_t [N], shape (n,)."""
        nodes, weights = _nodes()
        return weights @ self.quantiles(nodes)

    @property
    def sd(self) -> Array:
        """Standard deviation [N], shape (n,)."""
        nodes, weights = _nodes()
        values = self.quantiles(nodes)
        return np.sqrt(weights @ (values - weights @ values) ** 2)

    def cdf(self, F_t: Array) -> Array:
        """Return the probability of less than F_t [N], each (n,)."""
        from scipy.special import ndtr

        return ndtr(self.normal_score(F_t))

    def quantiles(self, shares: Sequence[float] | Array) -> Array:
        """Return the forces [N] that are not reached with these shares, (q, n)."""
        from scipy.special import ndtri

        scores = np.clip(ndtri(checked_shares(shares)), -_FARTHEST, _FARTHEST)
        return forces_at_scores(self.forces, normal_scores(SHARES), scores[:, None])

    def log_density(self, F_t: Array) -> Array:
        """Return the log density of F_t [N] in log 1/N, shape (n,)."""
        score, slope = self._scores(F_t)
        return np.log(slope) - 0.5 * (score**2 + np.log(2.0 * np.pi))

    def crps(self, F_t: Array) -> Array:
        """Return the continuous ranked probability score of F_t [N], shape (n,)."""
        nodes, weights = _nodes()
        return expected_pinball(F_t, self.quantiles(nodes), nodes, weights)

    def normal_score(self, F_t: Array) -> Array:
        """Return the normal score of F_t [N], shape (n,)."""
        return self._scores(F_t)[0]

    def _scores(self, F_t: Array) -> tuple[Array, Array]:
        """Return normal scores of F_t and their derivatives [1/N], each (n,)."""
        nodes, column = normal_scores(SHARES), np.arange(F_t.size)
        inside = self.forces[1:-1]
        i = np.count_nonzero(inside <= F_t, axis=0)
        low = self.forces[i, column]
        slope = (nodes[i + 1] - nodes[i]) / (self.forces[i + 1, column] - low)
        return nodes[i] + slope * (F_t - low), slope


def residual_quantiles(parts: Sequence[Array]) -> tuple[float, ...]:
    """Return quantiles of residuals at `SHARES` with equal trial weights.

    With fewer than two trials, those of a standard normal distribution.

    Args:
        parts: residuals of every trial about its level, divided by the predicted
            standard deviation.
    """
    parts = [part for part in parts if part.size > 1]
    if len(parts) < 2:
        return tuple(normal_scores(SHARES).tolist())
    values = np.concatenate(parts)
    weight = np.concatenate([np.full(part.size, 1.0 / part.size) for part in parts])
    order = np.argsort(values)
    cumulative = np.cumsum(weight[order]) - 0.5 * weight[order]
    quantiles = np.interp(SHARES, cumulative / weight.sum(), values[order])
    rising = np.maximum.accumulate(quantiles - _STEP * np.arange(quantiles.size))
    return tuple((rising + _STEP * np.arange(quantiles.size)).tolist())


def expected_variance(variance: float, trials: int) -> float:
    """Return the posterior mean of a variance between trials from its estimate."""
    freedom = max(trials - 1, FEWEST)
    return variance * freedom / (freedom - 2)


def checked_shares(shares: Sequence[float] | Array) -> Array:
    """Validate probabilities and return them as an array, shape (q,).

    Raises:
        SettingsError: a value is not a number from 0 to 1.
    """
    array = np.asarray(shares)
    is_numeric = array.dtype.kind in "fiu" and array.ndim == 1
    if not is_numeric or not ((array >= 0.0) & (array <= 1.0)).all():
        raise SettingsError(
            f"quantiles({shares}): shares are numbers from 0 to 1 in a list.",
            hint="Write e.g. quantiles([0.05, 0.5, 0.95]).",
        )
    return array.astype(np.float64)


@lru_cache
def normal_scores(shares: tuple[float, ...]) -> Array:
    """Return the standard normal quantiles of these probabilities, shape (q,)."""
    from scipy.special import ndtri

    return ndtri(np.array(shares))


def forces_at_scores(forces: Array, known: Array, scores: Array) -> Array:
    """Interpolate forces [N] at normal scores, shape (k, n).

    Args:
        forces: forces at the tabulated scores, shape (q, n).
        known: tabulated scores, increasing, shape (q,).
        scores: scores of each point, shape (k, n), or of all points, (k, 1).
    """
    i = np.clip(np.searchsorted(known, scores, "right") - 1, 0, known.size - 2)
    fraction = (scores - known[i]) / (known[i + 1] - known[i])
    column = np.arange(forces.shape[1])
    left, right = forces[i, column], forces[i + 1, column]
    return left + fraction * (right - left)


def expected_pinball(F_t: Array, values: Array, nodes: Array, weights: Array) -> Array:
    """Return the ranked probability score as the integral of the pinball loss.

    Args:
        F_t: measurements [N], shape (n,).
        values: predicted quantiles [N], shape (q, n).
        nodes: probabilities of the quantiles, shape (q,).
        weights: quadrature weights, shape (q,).
    """
    is_below = (F_t < values).astype(float)
    return 2.0 * weights @ ((is_below - nodes[:, None]) * (values - F_t))


@lru_cache
def _nodes() -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    return 0.5 * (nodes + 1.0), 0.5 * weights


@lru_cache(maxsize=256)
def _sum_quantiles(residuals: tuple[float, ...]) -> Array:
    """Return quantiles at `SHARES` of sqrt(1 - r) e + sqrt(r) n, shape (9, 21).

    One column per ratio r from 0 to 1; n is standard normal.

    Args:
        residuals: quantiles of e.
    """
    from scipy.special import ndtr, ndtri

    scores, (nodes, weights) = normal_scores(SHARES), _nodes()
    e = forces_at_scores(np.array(residuals)[:, None], scores, ndtri(nodes)[:, None])
    widest = max(_REACH, 1.5 * float(np.abs(e).max()))
    x, columns = np.linspace(-widest, widest, _POINTS), [np.array(residuals)]
    for ratio in np.linspace(0.0, 1.0, _RATIOS)[1:]:
        share = weights @ ndtr((x - np.sqrt(1.0 - ratio) * e) / np.sqrt(ratio))
        is_inside = (share > 0.0) & (share < 1.0)
        columns.append(np.interp(scores, ndtri(share[is_inside]), x[is_inside]))
    return np.column_stack(columns)
