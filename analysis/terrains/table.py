"""Tabulated distributions of F_t, and the estimates read from them.

A distribution of F_t is stored as quantiles. Forces are interpolated linearly in the
normal score of the share and extrapolated with the slope of the outer pair, so a normal
distribution is reproduced exactly.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.data.series import Array
from analysis.study.distribution import (
    checked_shares,
    forces_at_scores,
    normal_scores,
)

Rows = tuple[tuple[float, ...], ...]

_AT_ONCE = 1024  # points evaluated at a time
_NODES = 64  # quadrature nodes for moments


@dataclass(frozen=True)
class Table:
    """Quantiles of F_t on a grid of F_n and v_t.

    Attributes:
        F_n: normal forces [N], shape (n,), increasing.
        v_t: velocities [m/s], shape (m,), increasing.
        shares: probabilities of the quantiles, increasing, shape (q,).
        forces: quantiles of F_t [N], q times n rows of m.
    """

    F_n: tuple[float, ...]
    v_t: tuple[float, ...]
    shares: tuple[float, ...]
    forces: tuple[Rows, ...]

    def at(self, F_n: float, v_t: float) -> tuple[float, ...]:
        """Return the quantiles [N] at one point, shape (q,); a few microseconds."""
        i, a = _bracket(self.F_n, F_n)
        j, b = _bracket(self.v_t, v_t)
        return tuple(_blend(rows, i, a, j, b) for rows in self.forces)

    def covers(self, F_n: float, v_t: float) -> bool:
        """Return whether a point lies between the ends of both axes."""
        is_load = self.F_n[0] <= F_n <= self.F_n[-1]
        return is_load and self.v_t[0] <= v_t <= self.v_t[-1]

    def covers_many(self, F_n: Array, v_t: Array) -> NDArray[np.bool_]:
        """Return which points lie between the ends of both axes, shape (n,)."""
        is_load = (self.F_n[0] <= F_n) & (F_n <= self.F_n[-1])
        return is_load & (self.v_t[0] <= v_t) & (v_t <= self.v_t[-1])

    def over(self, F_n: Array, v_t: Array) -> Array:
        """Return the quantiles [N] at many points, shape (q, n)."""
        loads, speeds, cells = self._arrays
        i, a = _brackets(*loads, F_n)
        j, b = _brackets(*speeds, v_t)
        cell = i * len(self.v_t) + j
        if cell.size <= _AT_ONCE:
            return _blended(cells.take(cell, axis=1), a, b).T
        forces = np.empty((cell.size, cells.shape[2]))
        for start in range(0, cell.size, _AT_ONCE):  # blocks that fit into the cache
            part = slice(start, start + _AT_ONCE)
            corners = cells.take(cell[part], axis=1)
            forces[part] = _blended(corners, a[part], b[part])
        return forces.T

    @cached_property
    def _arrays(self) -> tuple[tuple[Array, Array], tuple[Array, Array], Array]:
        """Return both axes with their indices, and the cell above each point.

        Cells have the shape (4, n m, q): F_t [N] at the point, its difference along
        v_t, its difference to the next load, and the difference of that along v_t.
        Beyond the last point of an axis the differences are 0.
        """
        forces = np.array(self.forces)
        along = np.diff(forces, axis=2, append=forces[:, :, -1:])
        across = [np.diff(c, axis=1, append=c[:, -1:]) for c in (forces, along)]
        cells = np.stack([forces, along, *across]).reshape(4, len(forces), -1)
        cells = np.ascontiguousarray(cells.transpose(0, 2, 1))
        return _numbered(self.F_n), _numbered(self.v_t), cells


def rows_of(values: Array) -> Rows:
    """Convert an array of shape (n, m) to n rows of m numbers."""
    return tuple(tuple(row) for row in values.tolist())


def _bracket(axis: tuple[float, ...], value: float) -> tuple[int, float]:
    """Return (lower index, fraction of the interval), clamped to the axis."""
    if value <= axis[0]:
        return 0, 0.0
    if value >= axis[-1]:
        return len(axis) - 2, 1.0
    i = bisect_right(axis, value) - 1
    return i, (value - axis[i]) / (axis[i + 1] - axis[i])


def _numbered(axis: tuple[float, ...]) -> tuple[Array, Array]:
    return np.array(axis), np.arange(len(axis), dtype=np.float64)


def _brackets(points: Array, numbers: Array, values: Array) -> tuple[np.ndarray, Array]:
    """Return (lower indices, fractions of the interval), clamped to the axis."""
    position = np.interp(values, points, numbers)
    i = position.astype(np.intp)
    return i, position - i


def _blended(corners: Array, a: Array, b: Array) -> Array:
    """Interpolate F_t [N], shape (n, q), in place in cells of shape (4, n, q)."""
    low, gains = corners[:2], corners[2:]
    gains *= a[:, None]
    low += gains
    forces, along = low
    along *= b[:, None]
    forces += along
    return forces


def _blend(rows: Rows, i: int, a: float, j: int, b: float) -> float:
    low, high = rows[i], rows[i + 1]
    left = low[j] + b * (low[j + 1] - low[j])
    right = high[j] + b * (high[j + 1] - high[j])
    return left + a * (right - left)


@dataclass(frozen=True, slots=True)
class TractionEstimates:
    """Predicted traction on a terrain at many points.

    Attributes:
        shares: probabilities of the quantiles, shape (q,).
        forces: quantiles of the traction [N], shape (q, n).
        is_extrapolated: which points lie outside the table, shape (n,).
    """

    shares: tuple[float, ...]
    forces: Array
    is_extrapolated: NDArray[np.bool_]

    @property
    def median(self) -> Array:
        """Median traction [N], shape (n,)."""
        return self.quantile(0.5)

    @property
    def mean(self) -> Array:
        """Expected traction [N], shape (n,)."""
        weights, values = self._integrated()
        return weights @ values

    @property
    def sd(self) -> Array:
        """Standard deviation of a measurement [N], shape (n,)."""
        weights, values = self._integrated()
        return np.sqrt(weights @ (values - weights @ values) ** 2)

    def quantile(self, share: float) -> Array:
        """Return the quantile of the traction [N] at `share`, shape (n,)."""
        checked_shares((share,))
        return self._forces_at(normal_scores((share,))[:, None])[0]

    def at_scores(self, scores: Array) -> Array:
        """Return the traction [N] at normal scores of each point, shape (count, n).

        Beyond the outer shares forces are extrapolated with the slope of the outer
        pair, but not across 0 unless the quantiles cross it.

        Args:
            scores: normal scores of the force, shape (count, n).
        """
        least = np.where(self.forces[0] >= 0.0, 0.0, -np.inf)
        most = np.where(self.forces[-1] <= 0.0, 0.0, np.inf)
        return np.clip(self._forces_at(scores), least, most)

    def _integrated(self) -> tuple[Array, Array]:
        """Return quadrature weights (64,) and forces [N] (64, n) for moments."""
        nodes, weights = np.polynomial.legendre.leggauss(_NODES)
        shares = tuple((0.5 * (nodes + 1.0)).tolist())
        return 0.5 * weights, self._forces_at(normal_scores(shares)[:, None])

    def _forces_at(self, scores: Array) -> Array:
        """Return the forces [N] at normal scores of shape (k, n) or (k, 1), (k, n)."""
        return forces_at_scores(self.forces, normal_scores(self.shares), scores)


@dataclass(frozen=True, slots=True)
class TractionEstimate:
    """Predicted traction on a terrain at one point.

    Attributes:
        shares: probabilities of the quantiles, shape (q,).
        forces: quantiles of the traction [N], shape (q,).
        is_extrapolated: the point lies outside the table; the values are from its edge.
    """

    shares: tuple[float, ...]
    forces: tuple[float, ...]
    is_extrapolated: bool = False

    @property
    def median(self) -> float:
        """Median traction [N]."""
        return self.quantile(0.5)

    @property
    def mean(self) -> float:
        """Expected traction [N]."""
        return float(self._many().mean[0])

    @property
    def sd(self) -> float:
        """Standard deviation of a measurement [N]."""
        return float(self._many().sd[0])

    def quantile(self, share: float) -> float:
        """Return the quantile of the traction [N] at probability `share`."""
        return float(self._many().quantile(share)[0])

    def probability_below(self, force: float) -> float:
        """Return the probability of less traction than `force` [N]."""
        from scipy.special import ndtr

        return float(ndtr(_score_of(force, self.forces, normal_scores(self.shares))))

    def _many(self) -> TractionEstimates:
        forces = np.array(self.forces)[:, None]
        return TractionEstimates(self.shares, forces, np.array([self.is_extrapolated]))


def _score_of(force: float, forces: Sequence[float], scores: Array) -> float:
    """Return the normal score of a force [N] among non-decreasing quantiles."""
    i = min(max(bisect_right(forces, force) - 1, 0), len(forces) - 2)
    step = max(forces[i + 1] - forces[i], 1e-9)
    return float(scores[i] + (force - forces[i]) / step * (scores[i + 1] - scores[i]))


class SlipRisk(float):
    """Probability of too little traction, with its kind.

    Attributes:
        kind: "in motion": for a sliding foot, not one at rest.
        is_extrapolated: the point lies outside the measured table; the risk is from its
            edge.
    """

    __slots__ = ("is_extrapolated",)
    kind = "in motion"
    is_extrapolated: bool

    def __new__(cls, probability: float, *, is_extrapolated: bool) -> "SlipRisk":
        """Create a risk from a probability (0 to 1)."""
        risk = super().__new__(cls, probability)
        risk.is_extrapolated = is_extrapolated
        return risk
