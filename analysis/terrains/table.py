"""What a terrain database answers, and the table that it is read from."""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.data import Array
from analysis.study import Prediction


@dataclass(frozen=True, slots=True)
class Table:
    """Mean and spread of F_t on a grid of F_n and v_t.

    Attributes:
        F_n: normal forces [N], shape (n,), increasing.
        v_t: velocities [m/s], shape (m,), increasing.
        mean: F_t [N], n rows of m.
        sd: its standard deviation [N], n rows of m.
    """

    F_n: tuple[float, ...]
    v_t: tuple[float, ...]
    mean: tuple[tuple[float, ...], ...]
    sd: tuple[tuple[float, ...], ...]

    def at(self, F_n: float, v_t: float) -> tuple[float, float]:
        """Return (mean, standard deviation) [N] at one point; a few microseconds."""
        i, a = _place(self.F_n, F_n)
        j, b = _place(self.v_t, v_t)
        return _blend(self.mean, i, a, j, b), _blend(self.sd, i, a, j, b)

    def covers(self, F_n: float, v_t: float) -> bool:
        """Return whether a point lies between the ends of both axes."""
        is_load = self.F_n[0] <= F_n <= self.F_n[-1]
        return is_load and self.v_t[0] <= v_t <= self.v_t[-1]

    def covers_many(self, F_n: Array, v_t: Array) -> NDArray[np.bool_]:
        """Return the same of many points, shape (n,)."""
        is_load = (self.F_n[0] <= F_n) & (F_n <= self.F_n[-1])
        return is_load & (self.v_t[0] <= v_t) & (v_t <= self.v_t[-1])

    def over(self, F_n: Array, v_t: Array) -> Prediction:
        """Return mean and standard deviation [N] at many points, shape (n,)."""
        i, a = _places(self.F_n, F_n)
        j, b = _places(self.v_t, v_t)
        values = []
        for rows in (self.mean, self.sd):
            table = np.array(rows)
            low = table[i, j] + b * (table[i, j + 1] - table[i, j])
            high = table[i + 1, j] + b * (table[i + 1, j + 1] - table[i + 1, j])
            values.append(low + a * (high - low))
        return Prediction(*values)


def _place(axis: tuple[float, ...], value: float) -> tuple[int, float]:
    """Return (lower point, share of the way to the next), clamped to the axis."""
    if value <= axis[0]:
        return 0, 0.0
    if value >= axis[-1]:
        return len(axis) - 2, 1.0
    i = bisect_right(axis, value) - 1
    return i, (value - axis[i]) / (axis[i + 1] - axis[i])


def _places(axis: tuple[float, ...], values: Array) -> tuple[np.ndarray, Array]:
    points = np.array(axis)
    inside = np.clip(values, points[0], points[-1])
    i = np.clip(np.searchsorted(points, inside, "right") - 1, 0, points.size - 2)
    return i, (inside - points[i]) / (points[i + 1] - points[i])


def _blend(
    rows: tuple[tuple[float, ...], ...], i: int, a: float, j: int, b: float
) -> float:
    low, high = rows[i], rows[i + 1]
    left = low[j] + b * (low[j + 1] - low[j])
    right = high[j] + b * (high[j + 1] - high[j])
    return left + a * (right - left)


@dataclass(frozen=True, slots=True)
class TractionEstimate:
    """What is to be expected of a terrain at one point.

    Attributes:
        mean: traction [N].
        sd: its standard deviation [N], noise included.
        is_extrapolated: the point lies outside the table: the values are of its edge.
    """

    mean: float
    sd: float
    is_extrapolated: bool = False

    def quantile(self, share: float) -> float:
        """Return the traction [N] that is not reached with probability `share`."""
        from scipy.special import ndtri

        return self.mean + self.sd * float(ndtri(share))


@dataclass(frozen=True, slots=True)
class TractionEstimates:
    """What is to be expected of a terrain at many points, arrays of shape (n,).

    Attributes:
        mean: traction [N].
        sd: its standard deviation [N], noise included.
        is_extrapolated: which points lie outside the table.
    """

    mean: Array
    sd: Array
    is_extrapolated: NDArray[np.bool_]


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
