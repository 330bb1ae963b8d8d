"""What a model predicts of a measurement: a distribution, read as shares of it.

The force of a new trial is predicted as

    z ~ N(m, w + b s),  s = k / chi^2_k,  y = c exp-warped back from z = c log(y + c)

with w the variance within a trial, model included, and b the variance between trials.
A few trials say little about b: their number less one is k, and s stands for what b may
be (the posterior of a variance under Jeffreys' prior). The mixture is taken over 40
equally probable values of s, so that its distribution function is a plain mean.

A `ShapeMap` may be put on top of the normal scores.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.study.skew import ShapeMap, log_warp_slope, unwarped, warped

SHARES = (0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
FEWEST = 4  # degrees of freedom of a variance between trials, however few there are

_MIXED = 40  # values of the variance between trials
_NODES = 64  # shares that moments and scores are integrated over
_RATIOS = 129  # of variance between trials over all of it, for quantiles
_LOWEST = -37.0  # normal score of a quantile at most; double precision ends there
_STEPS, _ROUNDING = 50, 1e-11  # of Newton's method, mostly five; the last one's length
_EDGE = 1e-12  # a share nearer to 0 or 1 has no normal score worth the name


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
        centre: mean of z, shape (n,).
        within: variance of z within a trial, noise and model included, shape (n,).
        between: variance of z between trials, shape (n,).
        freedom: degrees of freedom of the variance between trials.
        c: of the warp z = c log(y + c) [N]; None for z = y.
        shape: of the distribution, where it was worth one.
    """

    centre: Array
    within: Array
    between: Array
    freedom: int
    c: float | None = None
    shape: ShapeMap | None = None

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

        x = self.normal_score(F_t)
        return ndtr(x if self.shape is None else self.shape.score(x))

    def quantiles(self, shares: Sequence[float] | Array) -> Array:
        """Return the forces [N] that are not reached with these shares, (q, n)."""
        from scipy.special import ndtr, ndtri

        wanted = checked_shares(shares)
        if self.shape is not None:
            wanted = ndtr(self.shape.inverse(ndtri(wanted)))
        total = self.within + self.between
        ratio = self.between / np.maximum(total, np.finfo(float).tiny)
        grid = np.linspace(0.0, 1.0, _RATIOS)
        table = _mixture_quantiles(tuple(wanted.tolist()), self.freedom)
        width = np.array([np.interp(ratio, grid, column) for column in table])
        return unwarped(self.centre + np.sqrt(total) * width, self.c)

    def log_density(self, F_t: Array) -> Array:
        """Return the log density of F_t [N] in log 1/N, shape (n,)."""
        far, variance = self._distances(F_t)
        each = -0.5 * (far**2 / variance + np.log(2.0 * np.pi * variance))
        highest = each.max(axis=0)
        density = highest + np.log(np.exp(each - highest).mean(axis=0))
        density = density + log_warp_slope(F_t, self.c)
        if self.shape is None:
            return density
        return density + self.shape.log_gain(self.normal_score(F_t))

    def ranked_probability(self, F_t: Array) -> Array:
        """Return the continuous ranked probability score of F_t [N], shape (n,)."""
        nodes, weights = _nodes()
        return expected_pinball(F_t, self.quantiles(nodes), nodes, weights)

    def normal_score(self, F_t: Array) -> Array:
        """Return the normal score of F_t [N] before the shape is put on, (n,)."""
        from scipy.special import ndtr, ndtri

        far, variance = self._distances(F_t)
        share = ndtr(far / np.sqrt(variance)).mean(axis=0)
        return ndtri(np.clip(share, _EDGE, 1.0 - _EDGE))

    def _distances(self, F_t: Array) -> tuple[Array, Array]:
        """Return z - m, shape (n,), and every variance it may have, shape (40, n)."""
        variance = self.within + self.between * _mixed(self.freedom)[:, None]
        return warped(F_t, self.c) - self.centre, variance


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


@lru_cache
def _mixed(freedom: int) -> Array:
    """Return equally probable values of k / chi^2_k, shape (40,)."""
    from scipy.special import chdtri

    middles = (np.arange(_MIXED) + 0.5) / _MIXED
    return freedom / chdtri(freedom, middles)


@lru_cache(maxsize=256)
def _mixture_quantiles(shares: tuple[float, ...], freedom: int) -> Array:
    """Return quantiles of the mixture of unit variance, shape (q, 129).

    A column for every ratio from 0 to 1 of the variance between trials to all of it.
    Newton's method on the normal score of the share that is reached, nearly a straight
    line in the quantile; in the lower half, whose shares lose no digits.
    """
    from scipy.special import ndtr, ndtri

    ratio = np.linspace(0.0, 1.0, _RATIOS)
    spread = np.sqrt(1.0 - ratio + ratio * _mixed(freedom)[:, None, None])
    score = ndtri(np.array(shares))[:, None]
    wanted = np.maximum(-np.abs(score), _LOWEST)
    quantile = np.repeat(wanted, _RATIOS, axis=1)
    for _ in range(_STEPS):
        each = quantile / spread
        reached = ndtri(ndtr(each).mean(axis=0))
        slope = np.mean(np.exp(0.5 * (reached**2 - each**2)) / spread, axis=0)
        step = (reached - wanted) / slope
        quantile = quantile - step
        if np.abs(step).max(initial=0.0) < _ROUNDING:
            break
    return -np.sign(score) * quantile
