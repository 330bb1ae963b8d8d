"""What a terrain database answers, and the table that it is read from.

A distribution of F_t is kept as quantiles. Between them forces are linear in the normal
score of the share, and beyond the outer ones they go on with the same slope: a normal
distribution comes back exactly.
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

_AT_ONCE = 1024  # points
_NODES = 64  # shares that moments are integrated over


@dataclass(frozen=True)
class Table:
    """Quantiles of F_t on a grid of F_n and v_t.

    Attributes:
        F_n: normal forces [N], shape (n,), increasing.
        v_t: velocities [m/s], shape (m,), increasing.
        shares: of the quantiles, increasing, shape (q,).
        forces: F_t [N] that is not reached with each share, q times n rows of m.
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
        """Return the same of many points, shape (n,)."""
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
        for start in range(0, cell.size, _AT_ONCE):  # what fits into the cache
            part = slice(start, start + _AT_ONCE)
            corners = cells.take(cell[part], axis=1)
            forces[part] = _blended(corners, a[part], b[part])
        return forces.T

    @cached_property
    def _arrays(self) -> tuple[tuple[Array, Array], tuple[Array, Array], Array]:
        """Return both axes with their numbers and, by point, the cell above it.

        Cells have the shape (4, n m, q): F_t [N] at the point, what it gains along v_t,
        what it gains to the next load, and what that gains along v_t. Beyond the last
        point of an axis nothing is gained.
        """
        forces = np.array(self.forces)
        along = np.diff(forces, axis=2, append=forces[:, :, -1:])
        across = [np.diff(c, axis=1, append=c[:, -1:]) for c in (forces, along)]
        cells = np.stack([forces, along, *across]).reshape(4, len(forces), -1)
        cells = np.ascontiguousarray(cells.transpose(0, 2, 1))
        return _numbered(self.F_n), _numbered(self.v_t), cells


def rows_of(values: Array) -> Rows:
    """Return an array of shape (n, m) as n rows of m numbers."""
    return tuple(tuple(row) for row in values.tolist())


def _bracket(axis: tuple[float, ...], value: float) -> tuple[int, float]:
    """Return (lower point, share of the way to the next), clamped to the axis."""
    if value <= axis[0]:
        return 0, 0.0
    if value >= axis[-1]:
        return len(axis) - 2, 1.0
    i = bisect_right(axis, value) - 1
    return i, (value - axis[i]) / (axis[i + 1] - axis[i])


def _numbered(axis: tuple[float, ...]) -> tuple[Array, Array]:
    return np.array(axis), np.arange(len(axis), dtype=np.float64)


def _brackets(points: Array, numbers: Array, values: Array) -> tuple[np.ndarray, Array]:
    """Return (lower points, shares of the way to the next), clamped to the axis."""
    position = np.interp(values, points, numbers)
    i = position.astype(np.intp)
    return i, position - i


def _blended(corners: Array, a: Array, b: Array) -> Array:
    """Return F_t [N], shape (n, q), in the memory of cells of shape (4, n, q)."""
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
    """What is to be expected of a terrain at many points.

    Attributes:
        shares: of the quantiles, shape (q,).
        forces: traction [N] that is not reached with each share, shape (q, n).
        is_extrapolated: which points lie outside the table, shape (n,).
    """

    shares: tuple[float, ...]
    forces: Array
    is_extrapolated: NDArray[np.bool_]

    @property
    def median(self) -> Array:
        """Traction [N] that is reached every second time, shape (n,)."""
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
        """Return the traction [N] not reached with probability `share`, shape (n,)."""
        checked_shares((share,))
        return self._forces_at(normal_scores((share,))[:, None])[0]

    def at_scores(self, scores: Array) -> Array:
        """Return the traction [N] at normal scores of each point, shape (count, n).

        Beyond the outer shares it goes on with the slope of the last two, but not
        across 0: where no quantile is below 0 no force is, and likewise above.

        Args:
            scores: normal scores of the force, shape (count, n).
        """
        least = np.where(self.forces[0] >= 0.0, 0.0, -np.inf)
        most = np.where(self.forces[-1] <= 0.0, 0.0, np.inf)
        return np.clip(self._forces_at(scores), least, most)

    def _integrated(self) -> tuple[Array, Array]:
        """Return weights, shape (64,), and forces [N], shape (64, n), of moments."""
        nodes, weights = np.polynomial.legendre.leggauss(_NODES)
        shares = tuple((0.5 * (nodes + 1.0)).tolist())
        return 0.5 * weights, self._forces_at(normal_scores(shares)[:, None])

    def _forces_at(self, scores: Array) -> Array:
        """Return the forces [N] at normal scores of shape (k, n) or (k, 1), (k, n)."""
        return forces_at_scores(self.forces, normal_scores(self.shares), scores)


@dataclass(frozen=True, slots=True)
class TractionEstimate:
    """What is to be expected of a terrain at one point.

    Attributes:
        shares: of the quantiles, shape (q,).
        forces: traction [N] that is not reached with each share, shape (q,).
        is_extrapolated: the point lies outside the table: the values are of its edge.
    """

    shares: tuple[float, ...]
    forces: tuple[float, ...]
    is_extrapolated: bool = False

    @property
    def median(self) -> float:
        """Traction [N] that is reached every second time."""
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
        """Return the traction [N] that is not reached with probability `share`."""
        return float(self._many().quantile(share)[0])

    def probability_below(self, force: float) -> float:
        """Return the probability of less traction than `force` [N]."""
        from scipy.special import ndtr

        return float(ndtr(_score_of(force, self.forces, normal_scores(self.shares))))

    def _many(self) -> TractionEstimates:
        forces = np.array(self.forces)[:, None]
        return TractionEstimates(self.shares, forces, np.array([self.is_extrapolated]))


def _score_of(force: float, forces: Sequence[float], scores: Array) -> float:
    """Return the normal score of a force [N] among quantiles, which do not decrease."""
    i = min(max(bisect_right(forces, force) - 1, 0), len(forces) - 2)
    step = max(forces[i + 1] - forces[i], 1e-9)
    return float(scores[i] + (force - forces[i]) / step * (scores[i + 1] - scores[i]))


class SlipRisk(float):
    """A probability of too little traction, a number that knows where it comes from.

    Attributes:
        kind: "in motion": of a foot that slides, not of one at rest.
        is_extrapolated: the point lies outside the table: the risk is that of its edge,
            and nobody has measured it.
    """

    __slots__ = ("is_extrapolated",)
    kind = "in motion"
    is_extrapolated: bool

    def __new__(cls, probability: float, *, is_extrapolated: bool) -> "SlipRisk":
        """Return the risk `probability` (0 to 1)."""
        risk = super().__new__(cls, probability)
        risk.is_extrapolated = is_extrapolated
        return risk
