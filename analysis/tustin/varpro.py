"""Search of the Tustin model by variable projection.

For given q = (log v_s, log delta_s) the model is linear in p = (mu, F_s, b) with the
columns F_n (1 - e), e and v_t, e = exp(-|v_t/v_s|^delta_s). Those three are solved
exactly in their bounds; the two that are left are polished by Newton's method, with
exact first and second derivatives. `moments` finds where to begin.
"""

from collections.abc import Sequence
from math import hypot
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.tustin.box_least_squares import solve_in_box

_REACH = 0.5  # of q, the furthest first step
_STEPS = 100  # four or five do
_GAIN = 1e-13  # of the squared forces, below which a step is not worth taking
_FLAT = 1e-8  # smallest second derivative, of the largest, that counts as bent upwards
_POOR, _GOOD = 0.25, 0.75  # shares of a promised gain: the reach shrinks, grows
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


class Expansion(NamedTuple):
    """The SSE to second order around a point, with the p that is best for every q.

    Attributes:
        point: the point.
        slope: first derivatives in q, shape (2,).
        bend: second derivatives in q, shape (2, 2); a p on its bound stays there.
    """

    point: Point
    slope: Array
    bend: Array


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

    def project(self, q: Array) -> Expansion:
        """Return the best point at `q` and the derivatives of its SSE in q.

        p drops out of the slope because p is optimal (envelope theorem), but not of
        the second derivatives: H_qq - H_qp H_pp^-1 H_pq over the p that are free.
        """
        delta = np.exp(q[1])
        log_z = np.minimum(delta * (self.log_v - q[0]), LARGEST_LOG_POWER)
        z = np.exp(log_z)
        e = np.exp(-z)
        A = self.columns(e)
        weighed = A.T * self.weights
        G, (lower, upper, _) = weighed @ A, self.box
        p = solve_in_box(G, weighed @ self.F_t, lower, upper)
        r = A @ p - self.F_t
        weighed_r = self.weights * r
        lever = p[1] * self.static - p[0] * self.F_n  # of e on the prediction
        e_z = e * z
        de = np.array([delta * e_z, -log_z * e_z])  # slope of e in q, shape (2, n)
        tilt = lever * de
        cross = weighed @ tilt.T
        cross[0] -= de @ (self.F_n * weighed_r)
        cross[1] += de @ (self.static * weighed_r)
        bend = (tilt * self.weights) @ tilt.T
        bend += _second(weighed_r * lever * e_z, z, log_z, delta)
        free = np.where((p > lower) & (p < upper), np.inf, 0.0)
        answer = solve_in_box(np.array([G, G]), cross.T, -free, free)
        return Expansion(
            Point(q, p, float(r @ weighed_r)),
            2.0 * tilt @ weighed_r,
            2.0 * (bend - answer @ cross),
        )


def _second(lever: Array, z: Array, log_z: Array, delta: float) -> Array:
    """Return the sum over rows of lever/(e z) times the second derivatives of e in q.

    Shape (2, 2); e = exp(-z), z = |v/v_s|^delta.
    """
    rest = 1.0 - z
    grown = 1.0 + rest * log_z
    mixed = delta * (lever @ grown)
    return np.array(
        [
            [-(delta**2) * (lever @ rest), mixed],
            [mixed, -(lever @ (log_z * grown))],
        ]
    )


def polish(problem: Problem, start: Array, known: Sequence[Point] = ()) -> Point:
    """Return the local optimum reached from `start` = (log v_s, log delta_s).

    Newton's method; steps are as long as the last ones kept what they promised.

    Args:
        problem: samples and box.
        start: q to begin with.
        known: optima; a start that comes to lie just above one is left there.
    """
    least = _GAIN * float(problem.weights @ problem.F_t**2)
    bounds, reach = problem.box.logarithmic.T, _REACH
    here = problem.project(np.clip(start, *bounds))
    for _ in range(_STEPS):
        if _is_known(here.point, known):
            break
        step, promised = _step(here, bounds, reach)
        if promised <= least:
            break
        there = problem.project(np.clip(here.point.q + step, *bounds))
        gain = here.point.sse - there.point.sse
        length = float(np.abs(step).max())
        if gain < _POOR * promised:
            reach = 0.5 * length
            here = _taught(here, step, there.slope)
        elif gain > _GOOD * promised:
            reach = max(reach, 2.0 * length)
        if gain > 0.0:
            here = there
    return here.point


def _step(around: Expansion, bounds: Array, reach: float) -> tuple[Array, float]:
    """Return the step to the bottom of a parabola, and what it promises.

    Where the SSE is not bent upwards, the parabola is bent up just enough.
    """
    slope, q = around.slope, around.point.q
    (first, mixed), (_, second) = around.bend.tolist()
    middle, spread = 0.5 * (first + second), hypot(0.5 * (first - second), mixed)
    lift = max(0.0, _FLAT * (abs(middle) + spread) - (middle - spread))
    G = np.eye(3)  # the third parameter is at 0 and stays there
    G[:2, :2] = 0.5 * (around.bend + lift * np.eye(2))
    low, high = np.zeros((2, 3))
    low[:2] = np.maximum(bounds[0] - q, -reach)
    high[:2] = np.minimum(bounds[1] - q, reach)
    c = np.array([-0.5 * slope[0], -0.5 * slope[1], 0.0])
    step = solve_in_box(G, c, low, high)
    return step[:2], float(2.0 * c @ step - step @ G @ step)


def _taught(here: Expansion, step: Array, slope: Array) -> Expansion:
    """Return an expansion with the slope that was met at the end of a poor step.

    Where a p comes to its bound the second derivatives jump; those of one side alone
    lead across again and again. Symmetric update of rank one.
    """
    missing = slope - here.slope - here.bend @ step
    along = float(missing @ step)
    if abs(along) < _FLAT * float(np.abs(missing).max() * np.abs(step).max()):
        return here
    return here._replace(bend=here.bend + np.outer(missing, missing) / along)


def _is_known(point: Point, known: Sequence[Point]) -> bool:
    """Return whether a point lies just above a known optimum."""
    near, above = _SAME
    return any(
        np.abs(point.q - top.q).max() < near
        and top.sse <= point.sse <= (1.0 + above) * top.sse
        for top in known
    )
