"""What a model predicts of a measurement: a distribution, read as shares of it.

The force of a new trial is predicted as

    F_t = m + u + sqrt(w) e,    u ~ N(0, b k / (k - 2)),    k = trials - 1

with m the mean, w the variance within a trial, model included, and e the residuals of
trials left out, given by their quantiles. b is the variance between trials: so many
trials know it with k degrees of freedom, and what it is expected to be, given them, is
larger (mean of its posterior under Jeffreys' prior; Gelman et al. 2013, section 3.2).

The distribution is kept as forces at nine shares. Between them forces are linear in the
normal score of the share, and beyond the outer ones they go on with the same slope: a
normal distribution comes back exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array

SHARES = (0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
FEWEST = 4  # degrees of freedom of a variance between trials, however few there are

_NODES = 64  # shares that moments and scores are integrated over
_RATIOS = 21  # of variance between trials over all of it, for quantiles
_FARTHEST = 37.0  # normal score of a quantile at most; double precision ends there
_REACH, _POINTS = 8.0, 321  # standard deviations of a grid to invert a sum on, its size
_STEP = 1e-6  # standard deviations between two quantiles at least


class Distribution(Protocol):
    """A predicted F_t [N] of n measurements."""

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
        """Return the forces [N] that are not reached with these shares, (q, n)."""
        ...

    def log_density(self, F_t: Array) -> Array:
        """Return the log density of F_t [N] in log 1/N, shape (n,)."""
        ...

    def ranked_probability(self, F_t: Array) -> Array:
        """Return the continuous ranked probability score of F_t [N], shape (n,)."""
        ...


@dataclass(frozen=True, slots=True)
class NewTrialPrediction:
    """F_t of a trial that no model was fitted to.

    Attributes:
        forces: F_t [N] that is not reached with each of `SHARES`, shape (9, n).
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
        """Return the distribution around a mean.

        Args:
            centre: mean [N], shape (n,).
            within: variance within a trial, noise and model included [N^2], shape (n,).
            between: variance between trials as it is to be expected [N^2], shape (n,).
            residuals: quantiles of what a trial leaves around its level, over the root
                of the variance within, at `SHARES`.
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

    def ranked_probability(self, F_t: Array) -> Array:
        """Return the continuous ranked probability score of F_t [N], shape (n,)."""
        nodes, weights = _nodes()
        return expected_pinball(F_t, self.quantiles(nodes), nodes, weights)

    def normal_score(self, F_t: Array) -> Array:
        """Return the normal score of F_t [N], shape (n,)."""
        return self._scores(F_t)[0]

    def _scores(self, F_t: Array) -> tuple[Array, Array]:
        """Return normal scores of F_t and their slopes in it [1/N], each (n,)."""
        known, column = normal_scores(SHARES), np.arange(F_t.size)
        inside = self.forces[1:-1]
        i = np.count_nonzero(inside <= F_t, axis=0)
        low = self.forces[i, column]
        slope = (known[i + 1] - known[i]) / (self.forces[i + 1, column] - low)
        return known[i] + slope * (F_t - low), slope


def residual_quantiles(parts: Sequence[Array]) -> tuple[float, ...]:
    """Return quantiles of residuals at `SHARES`, every trial with the same weight.

    Those of a standard normal distribution where there are fewer than two trials.

    Args:
        parts: of every trial what it leaves around its level, over the root of the
            predicted variance.
    """
    parts = [part for part in parts if part.size > 1]
    if len(parts) < 2:
        return tuple(normal_scores(SHARES).tolist())
    values = np.concatenate(parts)
    weight = np.concatenate([np.full(part.size, 1.0 / part.size) for part in parts])
    order = np.argsort(values)
    reached = np.cumsum(weight[order]) - 0.5 * weight[order]
    found = np.interp(SHARES, reached / weight.sum(), values[order])
    rising = np.maximum.accumulate(found - _STEP * np.arange(found.size))
    return tuple((rising + _STEP * np.arange(found.size)).tolist())


def expected_variance(variance: float, trials: int) -> float:
    """Return what a variance between trials is expected to be, known from so many."""
    freedom = max(trials - 1, FEWEST)
    return variance * freedom / (freedom - 2)


def checked_shares(shares: Sequence[float] | Array) -> Array:
    """Return shares of a distribution as an array, shape (q,).

    Raises:
        SettingsError: one is no number from 0 to 1.
    """
    wanted = np.asarray(shares)
    is_share = wanted.dtype.kind in "fiu" and wanted.ndim == 1
    if not is_share or not ((wanted >= 0.0) & (wanted <= 1.0)).all():
        raise SettingsError(
            f"quantiles({shares}): shares are numbers from 0 to 1 in a list.",
            hint="Write e.g. quantiles([0.05, 0.5, 0.95]).",
        )
    return wanted.astype(np.float64)


@lru_cache
def normal_scores(shares: tuple[float, ...]) -> Array:
    """Return what a standard normal variable does not reach with these shares, (q,)."""
    from scipy.special import ndtri

    return ndtri(np.array(shares))


def forces_at_scores(forces: Array, known: Array, scores: Array) -> Array:
    """Return forces [N] at normal scores, shape (k, n).

    Args:
        forces: at known scores, shape (q, n).
        known: these scores, increasing, shape (q,).
        scores: of each point, shape (k, n), or of all of them, (k, 1).
    """
    i = np.clip(np.searchsorted(known, scores, "right") - 1, 0, known.size - 2)
    way = (scores - known[i]) / (known[i + 1] - known[i])
    column = np.arange(forces.shape[1])
    left, right = forces[i, column], forces[i + 1, column]
    return left + way * (right - left)


def expected_pinball(F_t: Array, values: Array, nodes: Array, weights: Array) -> Array:
    """Return the ranked probability score as the integral of the pinball loss.

    Args:
        F_t: measurements [N], shape (n,).
        values: their predicted quantiles [N], shape (q, n).
        nodes: shares of these, shape (q,).
        weights: of the shares in the integral, shape (q,).
    """
    is_below = (F_t < values).astype(float)
    return 2.0 * weights @ ((is_below - nodes[:, None]) * (values - F_t))


@lru_cache
def _nodes() -> tuple[Array, Array]:
    """Return shares between 0 and 1 and their weights (Gauss and Legendre)."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    return 0.5 * (nodes + 1.0), 0.5 * weights


@lru_cache(maxsize=256)
def _sum_quantiles(residuals: tuple[float, ...]) -> Array:
    """Return quantiles at `SHARES` of sqrt(1 - r) e + sqrt(r) n, shape (9, 21).

    A column for every ratio r from 0 to 1; n is standard normal.

    Args:
        residuals: quantiles of e.
    """
    from scipy.special import ndtr, ndtri

    known, (nodes, weights) = normal_scores(SHARES), _nodes()
    e = forces_at_scores(np.array(residuals)[:, None], known, ndtri(nodes)[:, None])
    widest = max(_REACH, 1.5 * float(np.abs(e).max()))
    x, columns = np.linspace(-widest, widest, _POINTS), [np.array(residuals)]
    for ratio in np.linspace(0.0, 1.0, _RATIOS)[1:]:
        share = weights @ ndtr((x - np.sqrt(1.0 - ratio) * e) / np.sqrt(ratio))
        is_inside = (share > 0.0) & (share < 1.0)
        columns.append(np.interp(known, ndtri(share[is_inside]), x[is_inside]))
    return np.column_stack(columns)
