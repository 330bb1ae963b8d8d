"""Search of the Tustin model by variable projection.

For given q = (log v_s, log delta_s) the model is linear in p = (mu, F_s, b) with the
columns F_n (1 - e), e and v_t, e = exp(-|v_t/v_s|^delta_s). These three are solved
exactly within their bounds (Golub and Pereyra 1973); the other two are polished by
SciPy's L-BFGS-B. `moments` provides the starting points.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.tustin.box_least_squares import solve_in_box

_GAIN = 1e-14  # smallest gain of a step, relative to the squared forces (ftol)
_LEVEL = 1e-9  # slope of the relative SSE in q that counts as flat (gtol)
_SAME = (0.2, 1e-3)  # largest difference in q and relative one in SSE of equal optima
LARGEST_LOG_POWER = np.log(700.0)  # exp(-700) is near the smallest nonzero double


class Box(NamedTuple):
    """Bounds of the search.

    Attributes:
        lower: lower bounds of (mu, F_s, b), shape (3,).
        upper: upper bounds of (mu, F_s, b), shape (3,).
        logarithmic: bounds of (log v_s, log delta_s), shape (2, 2).
    """

    lower: Array
    upper: Array
    logarithmic: Array


def stribeck_power(speed: Array, v_s: float, delta_s: float) -> Array:
    """Return |v/v_s|^delta_s, limited to avoid overflow."""
    with np.errstate(divide="ignore"):
        exponent = delta_s * (np.log(speed) - np.log(abs(v_s)))
    return np.exp(np.minimum(exponent, LARGEST_LOG_POWER))


class Point(NamedTuple):
    """A point of the search: q, the optimal p at q, and their SSE [N^2]."""

    q: Array
    p: Array
    sse: float


class Projected(NamedTuple):
    """A point and the slope of the projected SSE.

    Attributes:
        point: the point.
        slope: first derivatives of the SSE in q, shape (2,).
    """

    point: Point
    slope: Array


class Problem:
    """The samples and box of one fit, with the logarithms taken once.

    With `is_proportional` the second linear parameter is f_s = F_s/F_n [-]. The
    `weights` of the squared residuals, shape (n,), default to 1.
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
        self.static = self.F_n if is_proportional else np.ones(self.F_n.size)
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
        return np.array([self.F_n * (1.0 - e), self.static * e, self.v_t]).T

    def project(self, q: Array) -> Projected:
        """Return the best point at `q` and the slope of its SSE in q.

        p drops out of the slope because p is optimal (envelope theorem).
        """
        delta = np.exp(q[1])
        log_z = np.minimum(delta * (self.log_v - q[0]), LARGEST_LOG_POWER)
        z = np.exp(log_z)
        e = np.exp(-z)
        A = self.columns(e)
        weighed = A.T * self.weights
        p = solve_in_box(
            weighed @ A, weighed @ self.F_t, self.box.lower, self.box.upper
        )
        r = A @ p - self.F_t
        weighed_r = self.weights * r
        lever = p[1] * self.static - p[0] * self.F_n  # derivative of the model by e
        by_e = weighed_r * lever * e * z
        slope = 2.0 * np.array([delta * by_e.sum(), -(log_z @ by_e)])
        return Projected(Point(q, p, float(r @ weighed_r)), slope)


def polish(problem: Problem, start: Array, known: Sequence[Point] = ()) -> Point:
    """Return the local optimum reached from `start` = (log v_s, log delta_s).

    Args:
        problem: samples and box.
        start: q to begin with.
        known: optima found before; a search that arrives just above one is stopped.
    """
    from scipy.optimize import minimize

    # relative to the squared forces, so that tolerances do not depend on their unit
    total = max(float(problem.weights @ problem.F_t**2), np.finfo(float).tiny)

    def cost(q: Array) -> tuple[float, Array]:
        projected = problem.project(q)
        return projected.point.sse / total, projected.slope / total

    def stop_at_known(intermediate_result: Any) -> None:  # noqa: ANN401
        if _is_known(intermediate_result.x, intermediate_result.fun * total, known):
            raise StopIteration

    bounds = problem.box.logarithmic
    result = minimize(
        cost,
        np.clip(start, *bounds.T),
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        callback=stop_at_known,
        options={"ftol": _GAIN, "gtol": _LEVEL},
    )
    return problem.project(result.x).point


def _is_known(q: Array, sse: float, known: Sequence[Point]) -> bool:
    """Return whether a point lies just above a known optimum."""
    near, above = _SAME
    return any(
        np.abs(q - top.q).max() < near and top.sse <= sse <= (1.0 + above) * top.sse
        for top in known
    )
