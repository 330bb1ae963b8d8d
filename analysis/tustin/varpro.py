"""Search of the Tustin model by variable projection.

For given q = (log v_s, log delta_s) the model is linear in p = (mu, F_s, b) with the
columns F_n (1 - e), e and v_t, e = exp(-|v_t/v_s|^delta_s). Those three are solved
exactly in their bounds; the two that are left are polished with the exact slope.
`moments` scans them on a grid.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from analysis.data import Array
from analysis.tustin.box_least_squares import solve_in_box

_SAME = (0.2, 1e-3)  # largest difference of q, and relative one of the SSE, of optima
LARGEST_LOG_POWER = np.log(700.0)  # exp(-700) is about the smallest that is not zero


class Box(NamedTuple):
    """Where the optimum is sought.

    Attributes:
        lower: lower bounds of (mu, F_s, b), shape (3,).
        upper: upper bounds of (mu, F_s, b), shape (3,).
        logarithmic: bounds of (log v_s, log delta_s), shape (2, 2).
    """

    lower: Array
    upper: Array
    logarithmic: Array


def stribeck_power(speed: Array, v_s: float, delta_s: float) -> Array:
    """Return |v/v_s|^delta_s, held below overflow."""
    with np.errstate(divide="ignore"):
        exponent = delta_s * (np.log(speed) - np.log(abs(v_s)))
    return np.exp(np.minimum(exponent, LARGEST_LOG_POWER))


class Point(NamedTuple):
    """A point of the search: q, the p that is best there, and their SSE [N^2]."""

    q: Array
    p: Array
    sse: float


class Problem:
    """The samples and box of one fit, with the logarithms taken once.

    With `is_proportional` the second linear parameter is f_s = F_s/F_n [-]. `weights`
    of the squared residuals, shape (n,), are 1 at first.
    """

    def __init__(
        self,
        rows: tuple[Array, Array, Array],
        box: Box,
        *,
        is_proportional: bool = False,
        weights: Array | None = None,
    ) -> None:
        self.F_n, self.v_t, self.F_t = rows
        self.box, self.is_proportional = box, is_proportional
        self.log_v = np.log(self.v_t)
        self.weights = np.ones(self.F_t.size) if weights is None else weights

    def reweighted(self, weights: Array) -> "Problem":
        """Return the same problem with other weights."""
        return Problem(
            (self.F_n, self.v_t, self.F_t),
            self.box,
            is_proportional=self.is_proportional,
            weights=weights,
        )

    def residual(self, point: "Point") -> Array:
        """Return prediction minus measurement [N] at `point`, shape (n,)."""
        return self.design(point.q) @ point.p - self.F_t

    def design(self, q: Array) -> Array:
        """Return the design matrix at `q`, shape (n, 3)."""
        return self.columns(np.exp(-stribeck_power(self.v_t, *np.exp(q))))

    def columns(self, e: Array) -> Array:
        """Return the design matrix for Stribeck factors `e`, shape (n, 3)."""
        static = self.F_n * e if self.is_proportional else e
        return np.column_stack([self.F_n * (1.0 - e), static, self.v_t])

    def project(self, q: Array) -> tuple[Point, Array]:
        """Return the best point at `q` and the slope of its SSE in q, shape (2,).

        The slope of p drops out because p is optimal (envelope theorem).
        """
        delta, distance = np.exp(q[1]), self.log_v - q[0]
        z = np.exp(np.minimum(delta * distance, LARGEST_LOG_POWER))
        e = np.exp(-z)
        A = self.columns(e)
        weighed = A.T * self.weights
        p = solve_in_box(
            weighed @ A, weighed @ self.F_t, self.box.lower, self.box.upper
        )
        r = A @ p - self.F_t
        weighed_r = self.weights * r
        static = p[1] * self.F_n if self.is_proportional else p[1]
        common = 2.0 * weighed_r * (static - p[0] * self.F_n) * e * z * delta
        slope = np.array([common.sum(), -common @ distance])
        return Point(q, p, float(r @ weighed_r)), slope


def polish(problem: Problem, start: Array, known: Sequence[Point] = ()) -> Point:
    """Return the local optimum reached from `start` = (log v_s, log delta_s).

    Args:
        problem: samples and box.
        start: q to begin with.
        known: optima; a start that comes to lie just above one is left there.
    """
    from scipy.optimize import OptimizeResult, minimize

    power = float(problem.weights @ problem.F_t**2)
    scale = max(power, np.finfo(float).tiny)

    def objective(q: Array) -> tuple[float, Array]:
        point, slope = problem.project(q)
        return point.sse / scale, slope / scale

    def look(intermediate_result: OptimizeResult) -> None:
        if _is_known(intermediate_result.x, intermediate_result.fun * scale, known):
            raise StopIteration

    optimum = minimize(
        objective,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=problem.box.logarithmic,
        callback=look,
        options={"maxiter": 200, "ftol": 1e-13, "gtol": 1e-9},
    )
    return problem.project(np.asarray(optimum.x))[0]


def _is_known(q: Array, sse: float, known: Sequence[Point]) -> bool:
    """Return whether a point lies just above a known optimum."""
    near, above = _SAME
    return any(
        np.abs(q - top.q).max() < near and top.sse <= sse <= (1.0 + above) * top.sse
        for top in known
    )
